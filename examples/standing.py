"""A biped from its file to the torques that keep it standing, and the forces under its feet.

    OPENBLAS_NUM_THREADS=1 python examples/standing.py [--lower 0.05]

The biped of urdf/ has legs like Cassie's: two rods a leg close loops, and each has a ball at both
ends. Its file says nothing about the ground. So it is made to stand here: toe and heel of each foot
are held where they are (`closure_at`, `with_closures`), then the trunk is lowered and shifted with
the feet on the ground (`complete`).

Ten actuators and twelve components of contact forces share the weight: `ForceDistribution` chooses
the torques of least effort with forces that push, within friction pyramids, and torques within the
file's limits. Printed are torques and ground forces, their sum beside the weight, and the
acceleration that they leave: none.

Exit status: 0 done; 1 it cannot stand so; 2 wrong usage.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from rps_pin import ClosedLoopModel, ClosureError, InfeasibleError
from rps_pin.closed_loop import ForceDistribution, friction_pyramid

FILE = Path(__file__).parents[1] / "urdf" / "cassie_biped.yaml"
CONTACTS = ("left_toe", "left_heel", "right_toe", "right_heel")


def main(arguments: Sequence[str] | None = None) -> int:
    """Stand, print torques and forces."""
    options = parser().parse_args(arguments)
    biped = ClosedLoopModel.load(options.file)
    feet = [biped.closure_at(biped.home, p, kind="spherical", name=p) for p in CONTACTS]
    standing = biped.with_closures(feet)
    print(f"mobility {biped.describe().mobility}, standing {standing.describe().mobility}")

    start = standing.home
    trunk = start[:7] - [0.0, -options.aside, options.lower, 0.0, 0.0, 0.0, 0.0]
    bounds = [one for p in CONTACTS for one in friction_pyramid(p, options.friction)]
    distribution = ForceDistribution(standing, torque_limits="model", bounds=bounds)
    rest = np.zeros(standing.model.nv)
    try:
        q = standing.complete({"root_joint": trunk}, start)
        forces = distribution.solve(q, rest, rest)
    except (ClosureError, InfeasibleError) as error:
        print(f"it cannot stand so: {error}", file=sys.stderr)
        return 1
    for name, torque in zip(standing.actuated, forces.tau, strict=True):
        print(f"{name:24} {torque:8.3f} N m")
    ground = {p: forces.constraint_forces[standing.rows(p)] for p in CONTACTS}
    for name, force in ground.items():
        print(f"{name:24} {force[0]:8.3f} {force[1]:8.3f} {force[2]:8.3f} N")
    weight = 9.81 * pin.computeTotalMass(standing.model)
    total = sum(ground.values(), np.zeros(3))
    print(f"sum of the ground's forces {total[2]:.3f} N, weight {weight:.3f} N")
    print(f"other components at most {np.abs(total[:2]).max():.1e} N")
    left = standing.forward_dynamics(q, rest, forces.tau)
    print(f"largest acceleration left {np.abs(left).max():.1e}")
    return 0


def parser() -> argparse.ArgumentParser:
    """Return the options."""
    words = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    words.add_argument("--file", type=Path, default=FILE, help="a biped's description")
    words.add_argument("--lower", type=float, default=0.05, metavar="M", help="lower the trunk")
    words.add_argument(
        "--aside", type=float, default=0.02, metavar="M", help="shift it to the left"
    )
    words.add_argument("--friction", type=float, default=0.6, help="coefficient of dry friction")
    return words


if __name__ == "__main__":
    sys.exit(main())
