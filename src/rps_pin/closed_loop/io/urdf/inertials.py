"""Masses and inertias of a URDF's links, read and checked, each with its line."""

from __future__ import annotations

from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.urdf.elements import INERTIAS, Inertial, UrdfFile
from rps_pin.closed_loop.io.urdf.vocabulary import child, get

#: The lower half of the tensor, which some files write too, and what it must equal.
_MIRRORED = {"iyx": "ixy", "izx": "ixz", "izy": "iyz"}
#: Moments of inertia below this, negative, are rounding, kg m^2.
_ROUNDING = 1e-12
#: A tensor that no body has is told from this share of its largest moment on. (In one file of
#: twenty-five, of real robots too, a tensor is wrong.)
_TOLD = 1e-2
#: It is refused if its largest moment is more than so many times the sum of the others, which no
#: body exceeds once, or a moment is negative by more than this share of the largest.
_GROSS, _INDEFINITE = 4.0, 0.01
#: Moments below this share of the largest count as none.
_ALONE = 1e-3
#: Placeholders have smaller moments, kg m^2, and may be wrong by any factor: they are told.
_PLACEHOLDER = 1e-5


def read_inertials(file: UrdfFile) -> None:
    """Fill `UrdfFile.inertials`.

    Raises
    ------
    MechanismError
        If a value is missing where another says that it matters, or no body can have it.
    """
    for name, link in file.links.items():
        element = child(link, "inertial")
        if element is not None:
            file.inertials[name] = _inertial(file, element, name)


def _inertial(file: UrdfFile, element: Any, name: str) -> Inertial:
    origin, mass_of = child(element, "origin"), child(element, "mass")
    file.placement(origin)
    tensor = _tensor(file, element, name)
    if mass_of is not None and get(mass_of, "value") is not None:
        mass = file.number(mass_of, "value")
    elif any(tensor):
        file.refuse(element, f"link {name!r}: its inertial has no mass value, but an inertia")
    else:
        mass = 0.0
        file.remark(element, name, "links whose inertial has no mass value, taken as without mass")
    if mass < 0:
        file.refuse(mass_of, f"link {name!r}: mass = {get(mass_of, 'value')} kg is negative")
    if mass == 0 and any(tensor):
        file.remark(
            element,
            name,
            "links of mass 0 with an inertia, which counts (MuJoCo leaves it out)",
        )
    return Inertial(origin, mass, tensor)


def _tensor(file: UrdfFile, inertial: Any, name: str) -> tuple[float, ...]:
    """Return the six numbers; zeros, told, where there is no ``inertia``, as in Drake."""
    link, element = f"link {name!r}", child(inertial, "inertia")
    if element is None:
        mass = child(inertial, "mass")
        if mass is not None and get(mass, "value") is not None:
            file.remark(
                inertial, name, "links whose inertial has no inertia, taken as masses in one point"
            )
        return (0.0,) * len(INERTIAS)
    missing = [word for word in INERTIAS if get(element, word) is None]
    if missing:
        file.refuse(element, f"{link}: its inertia has no {', '.join(missing)}")
    values = {word: file.number(element, word) for word in INERTIAS}
    for word, same in _MIRRORED.items():
        if file.number(element, word, values[same]) != values[same]:
            given = f"{word} = {get(element, word)} and {same} = {get(element, same)} kg m^2"
            file.refuse(element, f"{link}: {given} differ; an inertia is symmetric")
    for word in ("ixx", "iyy", "izz"):
        if values[word] < -_ROUNDING:
            value = get(element, word)
            file.refuse(element, f"{link}: {word} = {value} kg m^2 is negative")
    _check_moments(file, element, name, values)
    return tuple(values.values())


def _check_moments(file: UrdfFile, element: Any, name: str, values: dict[str, float]) -> None:
    """Tell or refuse a tensor that no body has."""
    xx, xy, xz, yy, yz, zz = values.values()
    moments = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if why := gross_fault(moments):
        file.refuse(element, f"link {name!r}: {why}")
    excess = moments[2] - moments[0] - moments[1]
    if excess > _TOLD * moments[2] + _ROUNDING or moments[0] < -_ROUNDING:
        file.remark(element.getparent(), name, "inertias that no body has, used as they are")


def gross_fault(moments: Array) -> str:
    """Return why principal moments are far from any body's; or nothing.

    A single moment, the others being below a thousandth of it, passes: it is the only one that
    counts in a plane mechanism.

    Parameters
    ----------
    moments
        In rising order, shape (3,), kg m^2.
    """
    least, middle, largest = moments
    negative = least < -_INDEFINITE * largest
    alone = max(abs(least), abs(middle)) < _ALONE * largest
    wide = largest > _GROSS * (least + middle) and not alone
    if not (negative or wide) or max(largest, -least) < _PLACEHOLDER:
        return ""
    listed = ", ".join(f"{moment:.4g}" for moment in moments)
    return (
        f"its principal moments of inertia are {listed} kg m^2; none can be negative, or exceed "
        "the sum of the others"
    )
