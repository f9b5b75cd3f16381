"""Draw the pictures of docs/parallel_robots.md.

Run it from the checkout, in an environment with the development dependencies and a Chromium:

    .venv/bin/python docs/parallel_robots.py
"""

from __future__ import annotations

from pathlib import Path

from rps_pin import ClosedLoopModel
from rps_pin.closed_loop.visuals import visual_model
from rps_pin.viewer import save_png

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "parallel"
URDF = DOCS.parent / "urdf"

#: Where each is shown: coordinates of its task.
POSES = {
    "stewart": [0.05, 0.0, 0.65, 0.1, 0.15, 0.1],
    "rotary_stewart": [0.01, 0.0, 0.225, 0.05, 0.1, 0.05],
    "delta": [0.08, 0.05, -0.55],
    "linear_delta": [0.03, -0.02, 0.1],
    "rrs": [0.23, 0.1, 0.15],
    "planar_rrr": [0.02, 0.03, 0.2],
    "five_bar": [0.15, 0.5],
    "ankle": [0.2, 0.1],
}


def main() -> None:
    """Write the pictures."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name, pose in POSES.items():
        mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
        save_png(
            IMAGES / f"{name}.png",
            mechanism,
            mechanism.task.configuration(pose),
            visual=visual_model(URDF / f"{name}.yaml", mechanism.model),
            layers=["closures"],
            size=(480, 360),
            background="white",
            captions=False,
        )


if __name__ == "__main__":
    main()
