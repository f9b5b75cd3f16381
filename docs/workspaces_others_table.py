"""Write tables of docs/workspaces.md: .venv/bin/python docs/workspaces_others_table.py.

Published workspaces beside this package's, and its speed beside that of two loops that a user would
write: closed forms in NumPy, and Newton's method on the closures with Pinocchio, point by point.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from marked import replaced

from rps_pin import ClosedLoopModel
from rps_pin.task import Task
from rps_pin.task.workspace import task_grid, volume, workspace

DOCS = Path(__file__).parent
PAGE = DOCS / "workspaces.md"
sys.path.insert(0, str(DOCS.parent))

from tests.reference import delta, stewart  # noqa: E402  # the tests are beside the package
from tests.task import published  # noqa: E402

#: Ends of axes that are reached, and points of each for this package and for the loops.
GRIDS = {
    "delta": ({"x": (-0.2, 0.2), "y": (-0.2, 0.2), "z": (-0.65, -0.45)}, 100, (24, 10)),
    "stewart": ({"x": (-0.2, 0.2), "y": (-0.2, 0.2), "z": (0.5, 0.8)}, 100, (24, 10)),
}
Found = tuple[Any, float]


def delta_point(p: Any) -> Found | None:
    """Return a Delta's arm angles and conditioning at a point, in closed form."""
    angles, rows = np.empty(3), np.empty((3, 3))
    for i, turn in enumerate(delta.TURNS):
        x, y, z = turn.T @ p + [delta.PLATFORM - delta.BASE, 0, 0]
        far = np.hypot(x, z)
        along = (far**2 + y**2 + delta.ARM**2 - delta.ROD**2) / (2 * delta.ARM)
        if abs(along) >= far:
            return None
        t = np.arctan2(z, x) + np.arccos(along / far)
        rod = np.array([x - delta.ARM * np.cos(t), y, z - delta.ARM * np.sin(t)])
        angles[i] = (-t + np.pi) % (2 * np.pi) - np.pi
        rows[i] = turn @ rod / (delta.ARM * (rod[0] * np.sin(t) - rod[2] * np.cos(t)))
    values = np.linalg.svd(rows, compute_uv=False)
    return angles, values[-1] / values[0]


def stewart_point(p: Any) -> Found:
    """Return a Stewart platform's lengths and conditioning at a point, in closed form."""
    legs = p + np.array(stewart.BALLS) - stewart.ANCHORS
    length = np.linalg.norm(legs, axis=-1)
    u = legs / length[:, None]
    rows = np.hstack([u, np.cross(stewart.BALLS, u) / LENGTHS["stewart"]])
    values = np.linalg.svd(rows, compute_uv=False)
    return length, values[-1] / values[0]


LENGTHS: dict[str, float] = {}
POINTS: dict[str, Callable[[Any], Found | None]] = {"delta": delta_point, "stewart": stewart_point}


class PinocchioLoop:
    """Newton's method on closures and task at one point after the other, each from the last."""

    def __init__(self, mechanism: ClosedLoopModel, size: int) -> None:
        self.model, self.q, self.size = mechanism.model, mechanism.home.copy(), size
        self.data = self.model.createData()
        frame = self.model.getFrameId
        self.pairs = [
            (frame(c.frame_a), frame(c.frame_b), float(getattr(c, "distance", 0.0) or 0.0))
            for c in mechanism.closures
        ]
        self.platform = frame("platform")
        self.columns = mechanism.actuated_indices
        self.scale = 1 / LENGTHS["stewart"]
        self.where = [self.model.joints[self.model.getJointId(n)].idx_q for n in mechanism.actuated]

    def rows(self, wanted: Any) -> tuple[Any, Any]:
        """Return the residuals and their Jacobian; task rows last."""
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(self.model, self.data, self.q)
        pin.updateFramePlacements(self.model, self.data)
        gaps, rows = [], []
        for a, b, distance in self.pairs:
            d = self.data.oMf[b].translation - self.data.oMf[a].translation
            J = (
                pin.getFrameJacobian(self.model, self.data, b, world)[:3]
                - pin.getFrameJacobian(self.model, self.data, a, world)[:3]
            )
            if distance:
                far = np.linalg.norm(d)
                gaps.append([far - distance])
                rows.append([d / far @ J])
            else:
                gaps.append(d)
                rows.append(J)
        place = self.data.oMf[self.platform]
        J = pin.getFrameJacobian(self.model, self.data, self.platform, world)
        gaps.append(place.translation - wanted)
        rows.append(J[:3])
        if self.size == 6:
            gaps.append(pin.log3(place.rotation))
            rows.append(J[3:])
        return np.concatenate(gaps), np.vstack(rows)

    def __call__(self, wanted: Any) -> Found | None:
        """Return actuators and conditioning at a point; None where Newton's method fails."""
        for _ in range(20):
            gaps, J = self.rows(wanted)
            if np.abs(gaps).max() < 1e-10:
                break
            self.q = pin.integrate(self.model, self.q, np.linalg.solve(J, -gaps))
        else:
            return None
        K = np.linalg.inv(J)[self.columns][:, -self.size :]
        if self.size == 6:
            K[:, 3:] *= self.scale
        values = np.linalg.svd(K, compute_uv=False)
        return self.q[self.where], values[-1] / values[0]


def points_of(name: str, count: int) -> tuple[dict[str, Any], Any]:
    """Return the axes of a grid, and its points (n, 3) as a path without jumps."""
    axes = {key: np.linspace(*ends, count) for key, ends in GRIDS[name][0].items()}
    whole = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1)
    whole[1::2] = whole[1::2, ::-1]
    lines = whole.reshape(-1, count, 3)
    lines[1::2] = lines[1::2, ::-1]
    return axes, lines.reshape(-1, 3)


def seconds_of(answer: Callable[[Any], Any], points: Any) -> tuple[float, list[Any]]:
    """Return the CPU time of a loop, a point, and its answers."""
    begun = time.process_time()
    found = [answer(p) for p in points]
    return (time.process_time() - begun) / len(points), found


def agreed(task: Task, name: str, count: int, points: Any, answers: list[Any]) -> None:
    """Compare a loop's actuators and conditioning with this package's at the same points."""
    axes, _ = points_of(name, count)
    found = workspace(task, task_grid(task, axes))
    at = tuple(
        np.rint((points[:, k] - axis[0]) / (axis[1] - axis[0])).astype(int)
        for k, axis in enumerate(axes.values())
    )
    for k, one in enumerate(answers):
        place = tuple(part[k] for part in at)
        assert np.abs(one[0] - found.actuators[place]).max() < 1e-8
        assert abs(one[1] - found.conditioning[place]) < 1e-7


def speed_rows(name: str) -> list[str]:
    """Return the rows of a mechanism."""
    task = ClosedLoopModel.load(DOCS.parent / "urdf" / f"{name}.yaml").task.compile()
    LENGTHS[name] = task.characteristic_length
    LENGTHS.setdefault("stewart", 1.0)
    _, count, (by_hand, by_newton) = GRIDS[name]
    axes, _ = points_of(name, 12)
    workspace(task, task_grid(task, axes))
    for engine in task.engines:
        engine.wait()
    axes, _ = points_of(name, count)
    begun = time.process_time()
    found = workspace(task, task_grid(task, axes))
    own = (time.process_time() - begun) / found.grid.size
    table = [f"| `{name}` | this package | {found.grid.size:,} | {1e6 * own:.1f} us | 1 |"]
    loops = (
        ("loop in NumPy, closed form by hand", by_hand, POINTS[name]),
        ("loop in Pinocchio, Newton's method", by_newton, PinocchioLoop(task.mechanism, task.size)),
    )
    for words, each, answer in loops:
        _, points = points_of(name, each)
        answer(points[0])
        took, answers = seconds_of(answer, points)
        agreed(task, name, each, points, answers)
        table.append(
            f"| `{name}` | {words} | {len(points):,} | {1e6 * took:.0f} us | {took / own:.0f} |"
        )
    return table


def published_rows() -> list[str]:
    """Return the rows of published workspaces."""
    with tempfile.TemporaryDirectory() as folder:
        one = published.surgiscope(Path(folder)).compile()
        sides = np.arange(-1.0, 1.001, 0.02)
        over = {"x": sides, "y": sides, "z": np.arange(-1.7, -0.299, 0.02)}
        size = volume(workspace(one, task_grid(one, over), min_conditioning=0.0))
    off = size.value / published.VOLUME - 1
    table = [
        f"| Delta of the SurgiScope | {published.VOLUME} m^3, points 0.02 m apart | "
        f"{size.value:.4f} +- {size.error:.1g} m^3, the same points | {100 * off:+.2f} % |"
    ]
    task = ClosedLoopModel.load(DOCS.parent / "urdf" / "stewart.yaml").task.compile()
    axes = {key: np.linspace(-0.8, 0.8, 81) for key in "xy"} | {"z": np.linspace(0.3, 1.0, 36)}
    size = volume(workspace(task, task_grid(task, axes)))
    centres = np.array(stewart.ANCHORS) - stewart.BALLS
    exact = published.volume_of_shells(centres, (0.45, 0.95), (0.3, 1.0))
    table.append(
        f"| `stewart`, level, above 0.3 m | {exact:.5f} m^3, by Gosselin's annuli | "
        f"{size.value:.5f} +- {size.error:.1g} m^3 | {100 * (size.value / exact - 1):+.2f} % |"
    )
    return table


def main() -> None:
    """Write the tables."""
    parts = {
        "published": [
            "| robot | theirs | this package | difference |",
            "|---|---|---|---|",
            *published_rows(),
        ],
        "loops": [
            "| mechanism | by | points | a point | times as long |",
            "|---|---|---|---|---|",
            *(row for name in ("stewart", "delta") for row in speed_rows(name)),
        ],
    }
    for name, lines in parts.items():
        PAGE.write_text(replaced(PAGE.read_text("utf-8"), name, "\n".join(lines)), "utf-8")


if __name__ == "__main__":
    main()
