"""URDF files: open trees, with the closures and joint forces that the files state."""

from rps_pin.closed_loop.io.urdf.tree import model_from_urdf, parts_from_urdf

__all__ = ["model_from_urdf", "parts_from_urdf"]
