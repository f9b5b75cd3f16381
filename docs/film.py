"""Write the film that opens the README: the 3-RPS on a circle of tilt, with its actuator forces.

Run it from the checkout, in an environment with the development dependencies and a Chromium:

    .venv/bin/python docs/film.py
"""

from __future__ import annotations

from pathlib import Path

from rps_pin import RPSRobot
from rps_pin.trajectories import circle
from rps_pin.viewer import save_video

FILM = Path(__file__).parent / "images" / "robot.webp"
LARGEST = 2_000_000  # bytes


def main() -> None:
    """Write the film; fail if it is too large for a README."""
    robot = RPSRobot.from_preset("sokolov")
    path = circle(height=0.4, tilt=0.3, duration=4.0)
    save_video(
        FILM,
        robot,
        path,
        layers=["trail", "forces"],
        title="3-RPS, tilt of 0.3 rad about a circle",
        size=(720, 450),
        frame_rate=20.0,
    )
    size = FILM.stat().st_size
    assert size <= LARGEST, f"{FILM.name} has {size} bytes, {LARGEST} are allowed"
    print(f"{FILM.name}: {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
