"""`rps-pin dynamics` evaluates the legs of its samples once, for all that is computed from them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from rps_pin.rps.kernels import legs as kernels
from tests.cli.commands import rps_pin

SAMPLES = 157  # of no other array of the command


def test_dynamics_evaluates_the_legs_of_its_samples_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For the motion, its states and the forces of all causes; it was ten times."""
    (tmp_path / "circle.yaml").write_text(
        f"kind: circle\nheight: 0.223\ntilt: 0.1\nduration: {(SAMPLES - 1) / 100}\n"
    )
    counted: Counter[bool] = Counter()
    geometry = kernels.leg_geometry

    def counting(radial: object, height: object, g: float) -> object:
        counted[SAMPLES in np.shape(radial)] += 1
        return geometry(radial, height, g)

    monkeypatch.setattr(kernels, "leg_geometry", counting)
    run = rps_pin("dynamics", "circle.yaml", "-r", "micro", "--rate", "100", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert f"({SAMPLES} samples)" in run.stdout
    assert counted[True] == 1
