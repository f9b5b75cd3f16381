"""Compliances from YAML files: materials, sections, drives, bearings and beams, units in names.

    materials:
      steel: {young_modulus_Pa: 210.0e9, shear_modulus_Pa: 81.0e9, density_kg_per_m3: 7850}
    sections:
      bar: {shape: rectangle, width_m: 0.03, height_m: 0.02}
      pipe: {shape: tube, outer_diameter_m: 0.03, inner_diameter_m: 0.026}
      rolled: {area_m2: 7.6e-4, second_moment_y_m4: 8.0e-7, second_moment_z_m4: 8.5e-8,
               torsion_constant_m4: 7.0e-9}
    actuators:
      crank_joint: {stiffness_Nm_per_rad: 2.0e4}          # of a slide: stiffness_N_per_m
    joints:
      coupler_joint: {x_N_per_m: 1.0e8, z_N_per_m: 1.0e8, rx_Nm_per_rad: 1.0e5}
    closures:
      knee: {y_N_per_m: 1.0e8}
    beams:
      crank: {link: crank, start: crank_joint, end: coupler_joint, section: bar, material: steel,
              up: [0, 1, 0], segments: 4}

See `Compliances` for what these mean.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.config import Entry, Finite, Positive, Text, Three, YamlFile, read_config
from rps_pin.errors import InputError, did_you_mean
from rps_pin.task.stiffness.beams import Beam, Material, Section
from rps_pin.task.stiffness.compliances import DIRECTIONS, Bearing, Compliances


class MaterialEntry(Entry):
    """See `Material`."""

    young_modulus_Pa: Positive  # noqa: N815 (the file's key)
    shear_modulus_Pa: Positive  # noqa: N815
    density_kg_per_m3: Positive | None = None


class SectionEntry(Entry):
    """See `Section`: of a shape, or by its numbers."""

    shape: Literal["rectangle", "tube"] | None = None
    width_m: Positive | None = None
    height_m: Positive | None = None
    outer_diameter_m: Positive | None = None
    inner_diameter_m: Finite | None = None
    poisson_ratio: Finite | None = None
    area_m2: Positive | None = None
    second_moment_y_m4: Positive | None = None
    second_moment_z_m4: Positive | None = None
    torsion_constant_m4: Positive | None = None
    shear_area_y_m2: Positive | None = None
    shear_area_z_m2: Positive | None = None


#: Keys of a section that must, and that may be given, by its shape.
_KEYS: dict[str | None, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "rectangle": (("width_m", "height_m"), ()),
    "tube": (("outer_diameter_m",), ("inner_diameter_m", "poisson_ratio")),
    None: (
        ("area_m2", "second_moment_y_m4", "second_moment_z_m4", "torsion_constant_m4"),
        ("shear_area_y_m2", "shear_area_z_m2"),
    ),
}


class ActuatorEntry(Entry):
    """Stiffness of a drive."""

    stiffness_N_per_m: Positive | None = None  # noqa: N815
    stiffness_Nm_per_rad: Positive | None = None  # noqa: N815


class BearingEntry(Entry):
    """Stiffness of a bearing by direction."""

    x_N_per_m: Positive | None = None  # noqa: N815
    y_N_per_m: Positive | None = None  # noqa: N815
    z_N_per_m: Positive | None = None  # noqa: N815
    rx_Nm_per_rad: Positive | None = None  # noqa: N815
    ry_Nm_per_rad: Positive | None = None  # noqa: N815
    rz_Nm_per_rad: Positive | None = None  # noqa: N815


class BeamEntry(Entry):
    """See `Beam`."""

    link: Text
    start: Text
    end: Text
    section: Text
    material: Text
    up: Three | None = None
    segments: int = 1


class CompliancesEntry(Entry):
    """A file of compliances."""

    materials: dict[Text, MaterialEntry] = Field(default_factory=dict)
    sections: dict[Text, SectionEntry] = Field(default_factory=dict)
    actuators: dict[Text, ActuatorEntry] = Field(default_factory=dict)
    joints: dict[Text, BearingEntry] = Field(default_factory=dict)
    closures: dict[Text, BearingEntry] = Field(default_factory=dict)
    beams: dict[Text, BeamEntry] = Field(default_factory=dict)


def load_compliances(path: str | os.PathLike[str], mechanism: ClosedLoopModel) -> Compliances:
    """Read compliances of a mechanism from a YAML file; see the module's text.

    Parameters
    ----------
    path
        The file.
    mechanism
        What it is of: tells whether an actuator turns or slides.

    Raises
    ------
    InputError
        If the file cannot be read, or holds what is not possible; with the line.
    """
    file, entry = read_config(path, "stiffness", CompliancesEntry)
    materials = {
        name: Material(one.young_modulus_Pa, one.shear_modulus_Pa, one.density_kg_per_m3)
        for name, one in entry.materials.items()
    }
    sections = {name: _section(file, name, one) for name, one in entry.sections.items()}
    beams = {name: _beam(file, name, one, sections, materials) for name, one in entry.beams.items()}
    _refuse_unused(file, entry)
    return Compliances(
        _actuators(file, entry, mechanism),
        {name: _bearing(file, "joints", name, one) for name, one in entry.joints.items()},
        {name: _bearing(file, "closures", name, one) for name, one in entry.closures.items()},
        beams,
    )


def _section(file: YamlFile, name: str, one: SectionEntry) -> Section:
    """Return a section of a shape, or by its numbers."""
    needed, allowed = _KEYS[one.shape]
    given = {key: value for key, value in one if value is not None and key != "shape"}
    kind = f"of shape {one.shape}" if one.shape else "without a shape"
    for key in given:
        if key not in (*needed, *allowed):
            raise InputError(
                f"{file.place(('sections', name, key))}: a section {kind} has no {key}; it takes "
                f"{', '.join((*needed, *allowed))}"
            )
    for key in needed:
        if key not in given:
            raise InputError(f"{file.place(('sections', name))}: a section {kind} needs {key}")
    plain = {key.rpartition("_")[0] if key != "poisson_ratio" else key: value
             for key, value in given.items()}  # fmt: skip
    with file.at("sections", name):
        if one.shape == "rectangle":
            return Section.rectangle(**plain)
        if one.shape == "tube":
            return Section.tube(**plain)
        return Section(**plain)


def _actuators(
    file: YamlFile, entry: CompliancesEntry, mechanism: ClosedLoopModel
) -> dict[str, float]:
    """Return stiffness by actuator, its unit that of its joint."""
    turning = dict(
        zip(
            mechanism.actuated,
            mechanism.angular_velocities[mechanism.actuated_indices],
            strict=True,
        )
    )
    found = {}
    for name, one in entry.actuators.items():
        where = file.place(("actuators", name))
        if name not in turning:
            raise InputError(
                f"{where}: no actuator {name!r}{did_you_mean(name, turning)}; there are: "
                f"{', '.join(turning)}"
            )
        by_unit = {False: one.stiffness_N_per_m, True: one.stiffness_Nm_per_rad}
        turns = bool(turning[name])
        right = "stiffness_Nm_per_rad" if turns else "stiffness_N_per_m"
        value = by_unit[turns]
        if value is None or by_unit[not turns] is not None:
            what = "turns" if turns else "slides"
            raise InputError(f"{where}: actuator {name!r} {what}: give {right}, and only that")
        found[name] = value
    return found


def _bearing(file: YamlFile, kind: str, name: str, one: BearingEntry) -> Bearing:
    found = {key.partition("_")[0]: value for key, value in one if value is not None}
    if not found:
        raise InputError(
            f"{file.place((kind, name))}: give the stiffness of at least one direction: "
            f"{', '.join(BearingEntry.model_fields)}"
        )
    return {direction: found[direction] for direction in DIRECTIONS if direction in found}


def _beam(
    file: YamlFile,
    name: str,
    one: BeamEntry,
    sections: Mapping[str, Section],
    materials: Mapping[str, Material],
) -> Beam:
    for key, there in (("section", sections), ("material", materials)):
        asked = getattr(one, key)
        if asked not in there:
            raise InputError(
                f"{file.place(('beams', name, key))}: no {key} {asked!r}"
                f"{did_you_mean(asked, there)}; there are: {', '.join(there) or 'none'}"
            )
    with file.at("beams", name):
        section, material = sections[one.section], materials[one.material]
        return Beam(one.link, one.start, one.end, section, material, one.up, one.segments)


def _refuse_unused(file: YamlFile, entry: CompliancesEntry) -> None:
    """Refuse materials and sections that no beam has."""
    for kind, key in (("sections", "section"), ("materials", "material")):
        used = {getattr(beam, key) for beam in entry.beams.values()}
        for name in getattr(entry, kind):
            if name not in used:
                raise InputError(f"{file.place((kind, name))}: no beam has the {key} {name!r}")
