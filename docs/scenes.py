"""Sphinx extension: scenes of robots that the reader can turn, as `save_html` writes them.

    ```{scene} stewart
    What it shows.
    ```

The build writes each scene into the site; none is in git.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.trajectories import circle, spline
from rps_pin.viewer import Motion, save_html

URDF = Path(__file__).parent.parent / "urdf"
FOLDER = "scenes"
SECONDS, FRAME_RATE = 4.0, 20.0

#: Poses that each robot passes on its way from home to home, coordinates of its task.
TOURS: dict[str, list[list[float]]] = {
    "stewart": [[0.05, 0, 0.65, 0.1, 0.15, 0.1], [-0.05, 0.04, 0.6, -0.1, -0.1, -0.2]],
    "rotary_stewart": [[0.01, 0, 0.225, 0.05, 0.1, 0.05], [-0.01, 0.01, 0.2, -0.1, 0, -0.1]],
    "delta": [[0.08, 0.05, -0.55], [-0.08, 0.05, -0.45]],
    "linear_delta": [[0.03, -0.02, 0.1], [-0.03, 0.02, 0.13]],
    "rrs": [[0.23, 0.1, 0.15], [0.21, -0.15, -0.1]],
    "planar_rrr": [[0.02, 0.03, 0.2], [-0.03, -0.01, -0.2]],
    "five_bar": [[0.15, 0.5], [-0.05, 0.45]],
    "ankle": [[0.2, 0.1], [-0.3, -0.15]],
    "cassie_leg": [[0.15, 0.12, -0.9, 0, 0], [-0.15, 0.12, -0.95, 0, 0.2]],
}
#: A joint of other mechanisms, and how far it moves from home: there and back, or once around.
STROKES = {"slider_crank": ("crank_joint", -2.0 * np.pi), "gripper": ("left_driver_joint", 0.5)}


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive, and write the scenes after the pages."""
    app.add_directive("scene", SceneDirective)
    app.connect("build-finished", write_scenes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


class SceneDirective(SphinxDirective):
    """A scene, and below it what it shows."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return a frame with the scene, and its caption."""
        name = self.arguments[0]
        if name not in SCENES:
            raise self.error(f"there is no scene {name!r} in docs/scenes.py")
        page = f"{'../' * self.env.docname.count('/')}{FOLDER}/{name}.html"
        # Without allow-same-origin, a browser does not draw frames that are out of sight.
        frame = (
            f'<iframe src="{page}" title="{name}, in 3D" loading="lazy" sandbox="allow-scripts">'
            "</iframe>"
        )
        whole = f' <a href="{page}">Whole window</a>'
        words, messages = self.state.inline_text(" ".join(self.content), self.lineno)
        caption = nodes.paragraph("", "", *words, nodes.raw("", whole, format="html"))
        shown = nodes.container("", nodes.raw("", frame, format="html"), caption, classes=["scene"])
        return [shown, *messages]


def write_scenes(app: Sphinx, exception: Exception | None) -> None:
    """Write all scenes into a site that was built."""
    if exception is None and app.builder.format == "html":
        folder = Path(app.outdir) / FOLDER
        folder.mkdir(exist_ok=True)
        for name, write in SCENES.items():
            write(folder / f"{name}.html")


def robot(page: Path) -> None:
    """Write the paper's robot on a circle of tilt, with the forces of its actuators."""
    sokolov = RPSRobot.from_preset("sokolov")
    path = circle(height=0.4, tilt=0.3, duration=SECONDS)
    title, layers = "3-RPS", ["trail", "forces"]
    save_html(page, sokolov, path, layers=layers, title=title, frame_rate=FRAME_RATE)


def micro(page: Path) -> None:
    """Write the tutorial's robot on its circle, eight times as slow."""
    path = circle(height=0.223, tilt=0.1, duration=SECONDS)
    save_html(page, RPSRobot.from_preset("micro"), path, layers=["trail", "forces"])


def tour(name: str, page: Path) -> None:
    """Write a robot on its way through the poses of its tour."""
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    home = mechanism.task.home
    path = spline([home, *TOURS[name], home], duration=SECONDS)
    save_html(page, mechanism, path, layers=["trail"], frame_rate=FRAME_RATE)


def stroke(name: str, page: Path) -> None:
    """Write a mechanism one joint of which moves there and back, or once around."""
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    joint, stroke = STROKES[name]
    times = np.linspace(0.0, SECONDS, 81)
    back = 0.5 - 0.5 * np.cos(2.0 * np.pi * times / SECONDS)
    share = times / SECONDS if abs(stroke) >= 2.0 * np.pi else back
    q = [mechanism.home]
    start = q[0][mechanism.model.joints[mechanism.model.getJointId(joint)].idx_q]
    for part in share[1:]:
        q.append(mechanism.complete({joint: start + stroke * part}, q[-1]))
    motion = Motion(mechanism.model, times, np.array(q))
    save_html(page, mechanism, motion, frame_rate=FRAME_RATE)


SCENES: dict[str, Callable[[Path], None]] = {
    "robot": robot,
    "micro": micro,
    **{name: partial(tour, name) for name in TOURS},
    **{name: partial(stroke, name) for name in STROKES},
}
