"""Parameters of a 3-RPS: validated, immutable, in SI units, read from and written to YAML."""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import pydantic
from pydantic import Field, ValidationInfo
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

from rps_pin.arrays import Array
from rps_pin.closed_loop.dynamics.passive_joint_forces import FRICTION_SPEED
from rps_pin.config import Finite, NonNegative, Positive, problems_of, read_yaml, rule_of
from rps_pin.errors import InputError, ParameterError, did_you_mean
from rps_pin.files import write_text
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import LARGEST, fixed_array, inertia_fault, read_only

#: A printed table rounds its inertias (the paper's Table 1 by 0.5 %): this much of the largest
#: principal moment may be missing from the triangle inequality.
INERTIA_ROUNDING = 0.01
_PRESETS = Path(__file__).parent / "presets"


def _array(*shape: int) -> pydantic.BeforeValidator:
    """Return a validator that makes a finite, read-only float array of the given shape."""
    wanted = f"must be {' x '.join(map(str, shape))} finite numbers, shape {shape}"

    def convert(value: Any) -> Array:
        try:
            array = fixed_array(value, "value", shape)
        except InputError:
            raise ValueError(wanted) from None
        return read_only(array + 0.0)  # no negative zeros: equal arrays, equal hashes

    return pydantic.BeforeValidator(convert)


def robot_name(name: str) -> str:
    """Return a robot's name, which names files and functions too, if it is one.

    Raises
    ------
    ValueError
        If it is none; says the rule.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_\-]*", name):
        raise ValueError("a name begins with a letter and has letters a-z, digits, - and _ only")
    return name


def _read_only_zeros(*shape: int) -> Array:
    return read_only(np.zeros(shape))


#: What forces need: all of these, or none, for kinematics alone; the others that call for them.
BODIES = ("platform_mass", "platform_inertia", "leg_mass", "leg_com", "leg_inertia")
_WITH_BODIES = (*BODIES, "leg_inertia_about", "rod_mass", "rod_inertia")
_LEFT_OUT = Field(validate_default=False)
_ToList = pydantic.PlainSerializer(lambda array: array.tolist(), return_type=list)
Vector3 = Annotated[np.ndarray, _array(3), _ToList]
Matrix3 = Annotated[np.ndarray, _array(3, 3), _ToList]


def _bounded(limit: float) -> float:
    """Return a limit that is infinite or at most `LARGEST`."""
    if not (math.isinf(limit) or abs(limit) <= LARGEST):
        raise ValueError(f"it must be infinite (no limit) or at most {LARGEST:g}")
    return limit


Bound = Annotated[float, Field(gt=0), pydantic.AfterValidator(_bounded)]  # infinity means: no bound
Angle = Annotated[float, Field(ge=-math.pi, le=math.pi, allow_inf_nan=False)]


class RPSParameters(pydantic.BaseModel):
    """Parameters of a 3-RPS: geometry, masses, limits, friction, gravity. SI units.

    Immutable; compare with ``==``, make a changed copy with :meth:`replace`. There is a field for
    each symbol of the paper, and for the rods, limits, direction of gravity and friction, which the
    paper does not have and which default to "none".

    Masses and inertias, the fields of `BODIES`, are needed for forces: leave all of them out for
    kinematics, singularities and workspaces alone (`has_bodies` is False then).

    Friction resists a joint's speed v with d v + f tanh(v / v_s): viscous, and dry friction made
    smooth near zero speed (v_s is ``friction_speed``): a joint creeps instead of sticking.

    The middle of a spherical joint's cone is its *rest axis*, fixed in the platform: in the plane
    of the platform's normal n and the joint's radial direction e_i, it is
    cos(r) n - sin(r) e_i with r = ``spherical_rest_angle``. At r = 0 it is the normal. A positive r
    suits legs that lean inwards (phi < pi/2): a leg at the angle phi_0 under the level platform
    is at rest in its joint for r = pi/2 - phi_0 (less a full turn if that exceeds pi). Legs that
    lean outwards have a negative r.

    Raises
    ------
    ParameterError
        If a value is not possible; the error has the field, the value and the rule.
    """

    model_config = pydantic.ConfigDict(
        frozen=True,
        extra="forbid",
        arbitrary_types_allowed=True,
        validate_default=True,
        use_attribute_docstrings=True,
    )

    name: Annotated[str, pydantic.AfterValidator(robot_name)] = "rps"
    """name of the robot; letters, digits, - and _"""

    base_radius: Positive
    """g: revolute joints' distance from base centre, m"""
    platform_radius: Positive
    """h: spherical joints' distance from the platform centre, m"""
    platform_mass: Annotated[Positive, _LEFT_OUT] = 0.0
    """m: mass of the platform, kg"""
    platform_inertia: Annotated[Matrix3, _LEFT_OUT] = _read_only_zeros(3, 3)
    """I: of the platform about its centre, in its own axes, kg m^2"""

    leg_mass: Annotated[NonNegative, _LEFT_OUT] = 0.0
    """m_leg: mass of a leg's cylinder (the part that only turns), kg"""
    leg_com: Annotated[NonNegative, _LEFT_OUT] = 0.0
    """r: cylinder's centre of mass from its revolute joint, along the leg, m"""
    leg_inertia: Annotated[NonNegative, _LEFT_OUT] = 0.0
    """I_leg: cylinder's moment of inertia, in the plane the leg moves in, kg m^2"""
    leg_inertia_about: Literal["joint", "com"] = "joint"
    """point leg_inertia is about: the revolute 'joint' or the 'com'"""

    rod_mass: NonNegative = 0.0
    """mass of a leg's rod (the part that also slides), kg"""
    rod_com: Finite = 0.0
    """rod's centre of mass behind the spherical joint, along the leg, m"""
    rod_inertia: NonNegative = 0.0
    """rod's moment of inertia about its centre of mass, kg m^2"""

    leg_length_limits: tuple[float, float] = (0.0, math.inf)
    """shortest and longest leg (the paper's d), m"""
    leg_angle_limits: tuple[float, float] = (-math.pi, math.pi)
    """least and greatest leg angle (the paper's phi), rad"""
    spherical_cone_limit: Bound = math.pi
    """greatest angle between a leg and its ball's rest axis, rad"""
    spherical_rest_angle: Angle = 0.0
    """angle of a ball's rest axis from the platform's normal, rad; pi/2 - phi for a leg at rest at
    phi under the level platform"""
    actuator_force_limit: Bound = math.inf
    """greatest force of an actuator, push or pull, N"""
    actuator_speed_limit: Bound = math.inf
    """greatest speed of an actuator, out or in, m/s"""
    gravity: Vector3 = np.array([0.0, 0.0, -9.81])
    """gravity's acceleration in base axes, m/s^2"""

    prismatic_damping: NonNegative = 0.0
    """viscous friction of an actuator, N s/m"""
    prismatic_friction: NonNegative = 0.0
    """dry friction of an actuator, N"""
    revolute_damping: NonNegative = 0.0
    """viscous friction of a revolute joint, N m s/rad"""
    revolute_friction: NonNegative = 0.0
    """dry friction of a revolute joint, N m"""
    friction_speed: Positive = FRICTION_SPEED
    """speed at which dry friction reaches 76 % of its value, m/s and rad/s"""

    def __init__(self, /, **values: Any) -> None:
        faults: list[ParameterError] = []
        try:
            super().__init__(**values)
        except pydantic.ValidationError as error:
            faults = _parameter_errors(error)
        missing = set(BODIES) - set(values) if set(_WITH_BODIES) & set(values) else set()
        faults += [ParameterError(name, None, _REQUIRED) for name in BODIES if name in missing]
        if faults:
            raise _together(faults, values)

    @pydantic.field_validator("*", mode="before")
    @classmethod
    def _numbers_are_numbers(cls, value: object, info: ValidationInfo) -> object:
        """Refuse truth values and text, which pydantic would convert to numbers."""
        if cls.model_fields[str(info.field_name)].annotation in (float, tuple[float, float]):
            for part in value if isinstance(value, (list, tuple)) else [value]:
                if isinstance(part, (bool, str, bytes)):
                    kind = "truth value" if isinstance(part, bool) else "text"
                    raise ValueError(f"must be a number, not a {kind}")
        return value

    @pydantic.field_validator("platform_inertia")
    @classmethod
    def _inertia_of_a_rigid_body(cls, inertia: Array) -> Array:
        if not inertia.any():
            raise ValueError("must be positive")
        if fault := inertia_fault(inertia, INERTIA_ROUNDING):
            raise ValueError(fault)
        return inertia

    @pydantic.field_validator("leg_length_limits", "leg_angle_limits")
    @classmethod
    def _limits_in_order(
        cls, limits: tuple[float, float], info: ValidationInfo
    ) -> tuple[float, float]:
        lower, upper = limits
        if math.isnan(lower) or math.isnan(upper):
            raise ValueError("must not be NaN")
        _bounded(lower), _bounded(upper)
        if not lower < upper:
            raise ValueError("the lower limit must be below the upper one")
        if info.field_name == "leg_length_limits" and lower < 0:
            raise ValueError("a leg's length cannot be negative")
        if info.field_name == "leg_angle_limits" and (lower < -math.pi or upper > math.pi):
            raise ValueError("angles lie between -pi and pi")
        return limits

    @pydantic.model_validator(mode="after")
    def _bodies_exist(self) -> Self:
        if not self.model_fields_set.issuperset(BODIES):  # left out, or told as missing
            return self
        for part in ("leg", "rod"):
            inertia = getattr(self, f"{part}_inertia")
            if getattr(self, f"{part}_mass") == 0 and inertia > 0:
                raise ParameterError(
                    f"{part}_inertia", inertia, f"a {part} without mass has no inertia"
                )
        offset = self.leg_mass * self.leg_com**2
        if self.leg_inertia_about == "joint" and self.leg_inertia < offset * (1 - 1e-9):
            raise ParameterError(
                "leg_inertia",
                self.leg_inertia,
                f"about the joint it must be at least leg_mass * leg_com^2 = {offset:.6g}; "
                "if it is about the centre of mass, set leg_inertia_about to 'com'",
            )
        return self

    @property
    def has_bodies(self) -> bool:
        """Whether masses and inertias are given, so that there are forces."""
        return self.platform_mass > 0.0

    def require_bodies(self) -> None:
        """Refuse to go on without masses and inertias.

        Raises
        ------
        ParameterError
            If they were left out.
        """
        if not self.has_bodies:
            words = "forces need it, and it was left out"
            raise _together([ParameterError(name, None, words) for name in BODIES], {})

    def _given(self) -> dict[str, Any]:
        """Return the fields without bodies that were left out."""
        left_out = () if self.has_bodies else _WITH_BODIES
        return {name: value for name, value in self if name not in left_out}

    @property
    def leg_inertia_about_com(self) -> float:
        """Moment of inertia of a leg's cylinder about its own centre of mass, kg m^2."""
        if self.leg_inertia_about == "com":
            return self.leg_inertia
        return max(0.0, self.leg_inertia - self.leg_mass * self.leg_com**2)

    def replace(self, **changes: Any) -> RPSParameters:
        """Return a copy with some fields changed, validated anew."""
        return RPSParameters(**(self._given() | changes))

    def without_limits(self) -> RPSParameters:
        """Return a copy without limits of lengths, angles and spherical joints."""
        limits = ("leg_length_limits", "leg_angle_limits", "spherical_cone_limit")
        return self.replace(**{name: type(self).model_fields[name].default for name in limits})

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RPSParameters):
            return NotImplemented
        return self.model_dump() == other.model_dump()

    def __hash__(self) -> int:
        return hash(tuple(x.tobytes() if isinstance(x, np.ndarray) else x for _, x in self))

    def __copy__(self) -> RPSParameters:
        return self

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> RPSParameters:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(RPSParameters, **self._given()), ()  # the constructor makes arrays read-only

    def __setattr__(self, name: str, value: object) -> None:
        raise ParameterError(name, value, "parameters are frozen; replace() makes a changed copy")

    # Files ----------------------------------------------------------------------------------------

    @classmethod
    def presets(cls) -> tuple[str, ...]:
        """Return the names of the presets that come with the package."""
        return tuple(sorted(path.stem for path in _PRESETS.glob("*.yaml")))

    @classmethod
    @refuses_other_kinds
    def from_preset(cls, name: str) -> RPSParameters:
        """Return a preset by name: ``"sokolov"`` (the paper's Table 1) or ``"micro"``.

        Raises
        ------
        InputError
            If there is no such preset; the message lists the presets.
        """
        if name not in cls.presets():
            raise InputError(f"no preset {name!r}; there are: {', '.join(cls.presets())}")
        return cls.from_yaml(_PRESETS / f"{name}.yaml")

    @classmethod
    @refuses_other_kinds
    def from_yaml(cls, path: str | os.PathLike[str]) -> RPSParameters:
        """Read parameters from a YAML file: one ``field: value`` a line, SI units.

        Raises
        ------
        InputError
            If the file cannot be read or is not such a mapping; with the line.
        ParameterError
            If a value is not possible, a field is missing, or one is unknown.
        """
        file = read_yaml(path, "parameter file")
        try:
            return cls(**file.values)
        except ParameterError as error:
            first, *others = [
                ParameterError(
                    one.field,
                    one.value,
                    one.rule,
                    file.place([one.field] if one.field in file.values else []),
                )
                for one in (error, *error.others)
            ]
            raise ParameterError(
                first.field, first.value, first.rule, first.place, others
            ) from None

    @refuses_other_kinds
    def to_yaml(self, path: str | os.PathLike[str]) -> None:
        """Write the parameters to a YAML file, each with its meaning and unit as a comment."""
        write_text(path, self.yaml_text())

    def yaml_text(self) -> str:
        """Return what `to_yaml` writes."""
        document = CommentedMap(self.model_dump(include=set(self._given())))
        for field in document:
            meaning = " ".join(str(type(self).model_fields[field].description).split())
            document.yaml_set_comment_before_after_key(field, before=meaning)
        yaml = YAML()
        yaml.width = 200
        yaml.default_flow_style = None
        text = io.StringIO()
        yaml.dump(document, text)
        return text.getvalue()


_REQUIRED = "is required and was not given"


def _parameter_errors(error: pydantic.ValidationError) -> list[ParameterError]:
    """Return pydantic's problems, one of each field."""
    found: dict[str, ParameterError] = {}
    for problem in problems_of(error):
        one = _parameter_error(problem)
        found.setdefault(one.field, one)
    return list(found.values())


def _parameter_error(problem: Any) -> ParameterError:
    """Return one of pydantic's problems as a `ParameterError`."""
    cause = problem.get("ctx", {}).get("error")
    if isinstance(cause, ParameterError):
        return cause
    field, *inner = [str(part) for part in problem["loc"]] or ["parameters"]
    kind, value = problem["type"], problem["input"]
    if kind == "extra_forbidden":
        fields = list(RPSParameters.model_fields)
        rule = f"unknown field{did_you_mean(field, fields)}; the fields are {', '.join(fields)}"
    elif kind == "missing" and not inner:
        return ParameterError(field, None, _REQUIRED)
    elif inner:
        rule = "must be two numbers, (lower, upper)"
    else:
        rule = rule_of(problem)
    return ParameterError(field, value, rule)


def _together(faults: Sequence[ParameterError], values: Mapping[str, Any]) -> ParameterError:
    """Return all faults as one; a missing field that a misspelt one stands for is not told."""
    fields = list(RPSParameters.model_fields)
    unknown = set(values) - set(fields)
    meant = {near for name in unknown for near in get_close_matches(name, fields, n=1)}
    first, *others = [one for one in faults if one.value is not None or one.field not in meant]
    return ParameterError(first.field, first.value, first.rule, others=others)
