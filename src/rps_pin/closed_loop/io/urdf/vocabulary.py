"""Words of URDF files, and what is done with each.

`WORDS` lists the elements and attributes of urdfdom's schema (versions 1.0 to 1.2), of Drake's,
URDF+'s, Isaac Sim's and Bullet's extensions, and of urdfdom's proposal of constraints. A word is
*read*, or *harmless*: it changes neither kinematics nor dynamics (appearance, contact, sensors,
control), or *told*: another program's, which stands in robots' files and is not read, or *refused*
with the reason. A word that is near a listed one is taken for a misspelt one and refused. So is any
other in an element that bears on the motion (all but a robot and a link themselves); elsewhere, or
with another program's prefix, it is told in a note.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from rps_pin.errors import MechanismError

_DRAKE = "http://drake.mit.edu"


@dataclass(frozen=True)
class Word:
    """An element: its attributes, and what is done with it.

    Attributes
    ----------
    read, harmless, told
        Its attributes, by what is done with them.
    once
        Whether its parent has at most one of them.
    is_open
        Whether anything may be in it: it is harmless as a whole, but for what `extensions` finds.
    refused
        Why it is refused; empty if it is not.
    """

    read: tuple[str, ...] = ()
    harmless: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    once: bool = False
    is_open: bool = False
    refused: str = ""


def _word(read: str = "", harmless: str = "", once: bool = False, told: str = "") -> Word:
    return Word(tuple(read.split()), tuple(harmless.split()), tuple(told.split()), once)


_POSE = _word("xyz rpy quat_xyzw", once=True)
_OPEN = Word(is_open=True)
_INERTIAL = {
    "": _word(once=True),
    "/origin": _POSE,
    "/mass": _word("value", once=True),
    "/inertia": _word("ixx ixy ixz iyy iyz izz iyx izx izy", once=True),
}
_JOINT = {
    "": _word("name type", "independent dont_collapse drake_ignore"),
    "/origin": _POSE,
    "/parent": _word("link", once=True),
    "/child": _word("link", once=True),
    "/axis": _word("xyz", once=True, told="rpy"),
    "/limit": _word(
        "lower upper effort velocity",
        "acceleration deceleration jerk drake:acceleration",
        once=True,
        told="command_effort gear_velocity current",  # ANYmal's
    ),
    "/dynamics": _word(
        "damping friction",
        "coulomb_window",
        once=True,
        told="D K mu_coulomb mu_viscous spring_reference spring_stiffness",  # Franka's, Stretch's
    ),
    "/mimic": _word("joint multiplier offset", once=True),
    "/actuator": _OPEN,
    "/safety_controller": _OPEN,
    "/calibration": _OPEN,
}
#: Elements that may have unknown words: others bear on the motion.
_NOTED = ("robot", "robot/link")
_FORCE = "is a spring between two links, which is not modelled; remove it, or give it as wrenches"


def _below(path: str, words: dict[str, Word]) -> dict[str, Word]:
    return {path + name: word for name, word in words.items()}


#: What is done with each element, by its path.
WORDS: dict[str, Word] = {
    "robot": _word("name", "version"),
    "robot/material": _OPEN,
    "robot/transmission": _OPEN,
    "robot/gazebo": _OPEN,
    "robot/sensor": _OPEN,
    "robot/ros2_control": _OPEN,
    "robot/mujoco": _OPEN,
    "robot/link": _word("name", "type drake_ignore"),
    **_below("robot/link/inertial", _INERTIAL),
    "robot/link/visual": _OPEN,
    "robot/link/collision": _OPEN,
    "robot/link/contact": _OPEN,
    "robot/link/surface": _OPEN,
    "robot/link/self_filter": _OPEN,
    "robot/link/collision_checking": _OPEN,
    "robot/link/self_collision_checking": _OPEN,
    **_below("robot/joint", _JOINT),
    "robot/joint/joint_properties": _word(told="damping friction"),  # of a converter to Collada
    "robot/frame": _word("name link xyz rpy quat_xyzw"),
    "robot/fixed_frame": _word("name"),
    "robot/fixed_frame/parent": _word("link", once=True),
    "robot/fixed_frame/origin": _POSE,
    # URDF+ (generalized_rbda)
    "robot/loop": _word("name type"),
    "robot/loop/predecessor": _word("link", once=True),
    "robot/loop/predecessor/origin": _POSE,
    "robot/loop/successor": _word("link", once=True),
    "robot/loop/successor/origin": _POSE,
    "robot/loop/axis": _word("xyz", once=True),
    "robot/coupling": _word("name type"),
    "robot/coupling/predecessor": _word("link", once=True),
    "robot/coupling/successor": _word("link", once=True),
    "robot/coupling/ratio": _word("value", once=True),
    # Proposed for urdfdom (pull request 264)
    "robot/constraint": _word("name type"),
    "robot/constraint/parent": _word("link", once=True),
    "robot/constraint/parent_origin": _POSE,
    "robot/constraint/parent_axis": _word("xyz", once=True),
    "robot/constraint/child": _word("link", once=True),
    "robot/constraint/child_origin": _POSE,
    "robot/constraint/child_axis": _word("xyz", once=True),
    # Isaac Sim, and Drake of old
    "robot/loop_joint": _word("name type"),
    "robot/loop_joint/link1": _word("link xyz rpy quat_xyzw", once=True),
    "robot/loop_joint/link2": _word("link xyz rpy quat_xyzw", once=True),
    "robot/loop_joint/axis": _word("xyz", once=True),
    # Drake
    **_below("robot/drake:joint", _JOINT),
    "robot/drake:joint/drake:screw_thread_pitch": _word("value", once=True),
    "robot/drake:joint/drake:curves": _OPEN,
    "robot/drake:joint/drake:initial_tangent": _OPEN,
    "robot/drake:joint/drake:plane_normal": _OPEN,
    "robot/drake:joint/drake:is_periodic": _OPEN,
    "robot/drake:ball_constraint": _word("name"),
    "robot/drake:ball_constraint/drake:ball_constraint_body_A": _word("name", once=True),
    "robot/drake:ball_constraint/drake:ball_constraint_body_B": _word("name", once=True),
    "robot/drake:ball_constraint/drake:ball_constraint_p_AP": _word("value", once=True),
    "robot/drake:ball_constraint/drake:ball_constraint_p_BQ": _word("value", once=True),
    "robot/drake:tendon_constraint": _word("name"),
    "robot/drake:tendon_constraint/drake:tendon_constraint_joint": _word("name a"),
    "robot/drake:tendon_constraint/drake:tendon_constraint_offset": _word("value", once=True),
    "robot/drake:tendon_constraint/drake:tendon_constraint_lower_limit": _word("value", once=True),
    "robot/drake:tendon_constraint/drake:tendon_constraint_upper_limit": _word("value", once=True),
    "robot/drake:tendon_constraint/drake:tendon_constraint_stiffness": _word("value", once=True),
    "robot/drake:tendon_constraint/drake:tendon_constraint_damping": _word("value", once=True),
    "robot/drake:linear_bushing_rpy": Word(is_open=True, refused=_FORCE),
    "robot/drake:linear_spring_damper": Word(is_open=True, refused=_FORCE),
    "robot/drake:collision_filter_group": _OPEN,
}


def tag_of(element: Any) -> str:
    """Return an element's tag: without a default namespace, and Drake's with its usual prefix."""
    return _plain(element.tag, element)


def get(element: Any, name: str, default: Any = None) -> Any:
    """Return the attribute of a plain or Drake's name."""
    if name.startswith("drake:"):
        other = f"{{{_DRAKE}}}{name[6:]}"
        return element.get(name, element.get(other, default))
    return element.get(name, default)


def children(element: Any, tag: str) -> Iterator[Any]:
    """Yield the child elements of a tag."""
    return (child for child in element.iterchildren("*") if tag_of(child) == tag)


def child(element: Any, tag: str) -> Any | None:
    """Return the first child of a tag, or None."""
    return next(children(element, tag), None)


def refuse(element: Any, origin: str, why: str) -> NoReturn:
    """Raise `MechanismError` with a file's name and an element's line."""
    raise MechanismError(f"{origin} is not a valid URDF: line {element.sourceline}: {why}")


def check_words(robot: Any, origin: str) -> list[str]:
    """Refuse misspelt, unknown, doubled and impossible words; return a note on each one not read.

    Raises
    ------
    MechanismError
        With the line.
    """
    found = _Words(origin)
    todo = [(robot, "robot")]
    while todo:
        element, path = todo.pop()
        if WORDS[path].refused:
            refuse(element, origin, f"<{tag_of(element)}> {WORDS[path].refused}")
        if not WORDS[path].is_open:
            found.check_attributes(element, path)
            todo += found.checked_children(element, path)
    return found.notes()


class _Words:
    """Words of a file that are not read, and elements that are repeated."""

    def __init__(self, origin: str) -> None:
        self._origin = origin
        self._lines: dict[str, list[int]] = {}
        self._repeated: list[str] = []

    def notes(self) -> list[str]:
        """Return a note on each."""
        return self._repeated + [
            f"{self._origin}, line {min(lines)}: {words} is not read"
            + (f" (nor are {len(lines) - 1} more)" if len(lines) > 1 else "")
            for words, lines in self._lines.items()
        ]

    def check_attributes(self, element: Any, path: str) -> None:
        """Refuse or note the attributes of an element that are not known."""
        word, tag = WORDS[path], tag_of(element)
        known = (*word.read, *word.harmless)
        for name in (_plain(name, element) for name in element.attrib):
            if name in known:
                continue
            why = "" if name in word.told else _objection(path, name, known, "{!r}")
            if why:
                refuse(element, self._origin, f"<{tag}> has no attribute {name!r}; {why}")
            self._note(f"the attribute {name!r} of <{tag}>", element)

    def checked_children(self, element: Any, path: str) -> Iterator[tuple[Any, str]]:
        """Yield the known elements inside, with their paths; refuse or note others."""
        tag, seen = tag_of(element), dict[str, Any]()
        for inner in element.iterchildren("*"):
            below, inner_tag = f"{path}/{tag_of(inner)}", tag_of(inner)
            if below not in WORDS:
                known = [one.rpartition("/")[2] for one in WORDS if one.rpartition("/")[0] == path]
                if why := _objection(path, inner_tag, known, "<{}>"):
                    refuse(inner, self._origin, f"<{tag}> has a <{inner_tag}>; {why}")
                self._note(f"<{inner_tag}> in <{tag}>", inner)
                continue
            first = seen.setdefault(below, inner)
            if not WORDS[below].once or first is inner:
                yield inner, below
            else:
                self._repeat(tag, first, inner)

    def _note(self, words: str, element: Any) -> None:
        self._lines.setdefault(words, []).append(element.sourceline)

    def _repeat(self, tag: str, first: Any, again: Any) -> None:
        """Note an element that says what the first of its tag says; refuse another."""
        what, line = tag_of(again), first.sourceline
        if not _alike(first, again):
            why = f"<{tag}> has a second <{what}>, which differs from the first (line {line})"
            refuse(again, self._origin, why)
        self._repeated.append(
            f"{self._origin}, line {again.sourceline}: <{tag}> repeats its <{what}> of line "
            f"{line}, which counts once"
        )


def _objection(path: str, word: str, known: Sequence[str], shown: str = "{}") -> str:
    """Return why an element at a path cannot have a word that is not known; empty if it can."""
    if meant := misspelt(word, known):
        return f"did you mean {shown.format(meant)}?"
    foreign = ":" in word and not word.startswith("drake:")
    if path in _NOTED or foreign:
        return ""
    return f"it can have: {', '.join(map(shown.format, known)) or 'none'}"


def _alike(one: Any, other: Any) -> bool:
    """Return whether two elements say the same: attributes, their numbers, and what is inside."""
    if tag_of(one) != tag_of(other) or set(one.attrib) != set(other.attrib):
        return False
    if any(_value(text) != _value(other.attrib[name]) for name, text in one.attrib.items()):
        return False
    inside, others = list(one.iterchildren("*")), list(other.iterchildren("*"))
    return len(inside) == len(others) and all(map(_alike, inside, others))


def _value(text: str) -> list[float] | str:
    try:
        return [float(part) for part in text.split()]
    except ValueError:
        return text


def misspelt(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that differs in one letter, two swapped ones, or in capitals."""
    for right in known:
        if word.casefold() == right.casefold() or _one_slip(word, right):
            return right
    return None


def _one_slip(word: str, right: str) -> bool:
    """Return whether one letter was left out, added, changed or swapped with the next."""
    start = 0
    while start < min(len(word), len(right)) and word[start] == right[start]:
        start += 1
    rest, wanted = word[start:], right[start:]
    if min(len(word), len(right)) < 3:
        return False
    swapped = rest[:2] == wanted[1::-1] and len(wanted) > 1 and rest[2:] == wanted[2:]
    return swapped or wanted[1:] in (rest, rest[1:]) or rest[1:] == wanted


def _plain(name: Any, element: Any) -> str:
    text = str(name)
    if not text.startswith("{"):
        return text
    uri, _, local = text[1:].partition("}")
    if uri == _DRAKE:
        return f"drake:{local}"
    prefixes = [key for key, value in element.nsmap.items() if value == uri]
    prefix = "" if None in prefixes or not prefixes else f"{prefixes[0]}:"
    return f"{prefix}{local}"
