"""Rotations over a parameter and over time, and poses with them in a task's coordinates.

`pose_path` is where to begin. Rotations are interpolated on SO(3), by geodesics or splines, and
turned into rotation vectors, with exact derivatives, only where a task's coordinates are asked for.
"""
