"""Every element and attribute that MuJoCo knows is known here, in `schema.txt`: by what is done.

========  ==========================================================================================
read      the reader takes its number or name from the compiled model; another test gives one
compiled  MuJoCo's compiler makes of it numbers that are read (masses, placements, other attributes)
force     it makes a force of an actuator, which is a part of tau
harmless  contacts, sensors, appearance, softness, integration, names of what is not read
told      the reader warns, with the line
refused   the reader refuses it, with the line; if all of an element is refused, the element
========  ==========================================================================================

A MuJoCo with something new fails here first.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path

import mujoco
import pytest
from lxml import etree

from rps_pin import MechanismError
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from tests.closed_loop.io.mjcf.schema import table
from tests.closed_loop.io.mjcf.twin import BODY, fourbar, mujoco_file, read
from tests.each import each

HERE = Path(__file__).parent
PAGE = HERE.parents[3] / "docs" / "mjcf_words.md"
KINDS = {"read", "compiled", "force", "harmless", "told", "refused"}


def mujocos_schema() -> dict[str, list[str]]:
    """Attributes by element, from the schema that MuJoCo prints."""
    found: dict[str, list[str]] = {}
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        element = re.match(r" *([\w()]+) \([!?*R]\) *(.*)$", line)
        if element:
            depth = element.start(1) // 3
            path = [*path[:depth], element[1]]
            found["/".join(path[1:]) or path[0]] = element[2].split()
        elif line.strip():
            found["/".join(path[1:]) or path[0]] += line.split()
    return found


SCHEMA, TABLE = mujocos_schema(), table()
OWN = {name: attributes for name, attributes in SCHEMA.items() if not name.startswith("default")}


def test_every_element_and_attribute_is_in_the_table_and_nothing_else() -> None:
    assert len(SCHEMA) > 150 and sum(map(len, SCHEMA.values())) > 1800
    assert TABLE.keys() == OWN.keys()
    for name, kinds in TABLE.items():
        assert kinds.keys() <= KINDS, name
        listed = [attribute for attributes in kinds.values() for attribute in attributes]
        assert len(listed) == len(set(listed)), name
        assert set(listed) == set(OWN[name]), name


def test_the_page_of_the_documentation_has_the_table() -> None:
    spec = importlib.util.spec_from_file_location("mjcf_words", PAGE.with_suffix(".py"))
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    shown = PAGE.read_text("utf-8").partition("mjcf_words.py: words -->")[2]
    assert shown.partition("<!-- end -->")[0].strip() == script.words()
    for name, kinds in TABLE.items():
        if kinds.keys() - {"harmless"}:
            assert f"| `{name}` |" in shown
        else:
            assert f"`{name}`" in shown


def test_defaults_have_no_attributes_of_their_own() -> None:
    parents = {
        "mesh": ["asset/mesh"],
        "texture": ["asset/texture"],
        "material": ["asset/material"],
        "material/layer": ["asset/material/layer"],
        "pair": ["contact/pair"],
        "equality": ["equality/connect"],
        "tendon": ["tendon/spatial", "tendon/fixed"],
    } | {tag: [f"(world)body/{tag}"] for tag in ("joint", "geom", "site", "camera", "light")}
    defaults = {n.partition("/")[2]: a for n, a in SCHEMA.items() if n.startswith("default/")}
    for tag, attributes in defaults.items():
        of = parents.get(tag, [f"actuator/{tag}"])
        assert set(attributes) <= {one for name in of for one in OWN[name]}, tag


def test_what_is_read_is_in_the_tests() -> None:
    written = "".join(p.read_text("utf-8") for p in HERE.glob("*.py") if p.name != "test_schema.py")
    for name, kinds in TABLE.items():
        for attribute in kinds.get("read", []):
            assert re.search(rf'\b{attribute}=\\?"', written), f"{name}: {attribute}"


# What is told and refused -------------------------------------------------------------------------

JOINTS = '<joint joint="j1" coef="1"/>'


def rope(options: str) -> str:
    sites = '<site site="tip"/><site site="knee"/>'
    return fourbar(f'<tendon><spatial name="rope" {options}>{sites}</spatial></tendon>')


YOUNG = '<elasticity young="1"/>'
FLEX = """<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" radius=".01" dim="2">
    <edge damping="1"/><elasticity young="1"/><contact friction="1"/><pin id="1"/></flexcomp>"""
OF_THREE = """<deformable><flex name="f" dim="2" body="world crank rocker"
    vertex="0 0 0 0 0 0 0 0 0" element="0 1 2"><edge damping="1"/><elasticity young="1"/>
    <contact friction="1"/></flex></deformable>"""
#: Elements and attributes that no example can have: they need a plugin, or a grid of cells.
WITHOUT_EXAMPLE = {
    "(world)body/plugin",
    "(world)body/plugin/config",
    "(world)body/flexcomp/plugin",
    "(world)body/flexcomp/plugin/config",
    "equality/flexstrain",
    "actuator/plugin",
}


def actuators() -> Iterator[str]:
    needed = {"dcmotor": 'motorconst="0.1" resistance="2"', "adhesion": 'ctrlrange="0 1"'}
    needed |= {"muscle": 'lengthrange="0 1"', "orientation": 'kp="1"', "damper": 'ctrlrange="0 1"'}
    for name, kinds in TABLE.items():
        section, _, tag = name.partition("/")
        told = kinds.get("told", [])
        for places in (
            'site="tip" refsite="knee"',
            'site="tip"',
            'body="crank"',
            'cranksite="tip" slidersite="knee" cranklength="1"',
        ):
            names = re.findall(r"(\w+)=", places)
            possible = section == "actuator" and name not in WITHOUT_EXAMPLE
            alone = names == ["site"] and "refsite" in told
            if possible and {*names} <= {*told} and not alone:
                yield fourbar(f"<actuator><{tag} {places} {needed.get(tag, '')}/></actuator>")


TOLD = [
    fourbar(
        '<equality><weld body1="rocker"/></equality>', f'<option><flag {flag}="disable"/></option>'
    )
    for flag in ("constraint", "equality")
] + [
    fourbar(
        '<actuator><motor joint="j1"/></actuator>', '<option><flag actuation="disable"/></option>'
    ),
    fourbar('<actuator><motor joint="j1"/></actuator>', '<option actuatorgroupdisable="0"/>'),
    mujoco_file(f'<body name="hand" mocap="true"><geom size="0.1"/></body>{BODY}'),
    rope('limited="true" range="0 1"'),
    *actuators(),
]
REFUSED = [
    fourbar('<option density="1"/>'),
    fourbar('<option viscosity="1"/>'),
    mujoco_file(BODY.replace('"j"', '"j" stiffness="1" springyield="1"')),
    fourbar(f'<tendon><fixed stiffness="1" springyield="1">{JOINTS}</fixed></tendon>'),
    *(rope(f'{name}="1"') for name in ("armature", "damping", "frictionloss", "stiffness")),
    mujoco_file(BODY + FLEX),
    fourbar(OF_THREE),
    mujoco_file(BODY + FLEX.replace(YOUNG, ""), '<equality><flex flex="cloth"/></equality>'),
]


@each("text", TOLD)
def test_what_is_told_is_told_with_its_line(text: str) -> None:
    _, told = read(text)
    assert len(told) == 1 and "the MJCF text, line " in told[0]


@each("text", REFUSED)
def test_what_is_refused_is_refused_with_its_line(text: str) -> None:
    with pytest.raises(MechanismError, match="the MJCF text, line "):
        parts_from_mjcf(text)


@each("kind", ["told", "refused"])
def test_what_is_told_or_refused_has_an_example(kind: str) -> None:
    shown: set[tuple[str, str]] = set()
    for text in TOLD if kind == "told" else REFUSED:
        for element in etree.fromstring(text).iter():
            path = [one.tag for one in [*reversed([*element.iterancestors()]), element]][1:]
            bodies = [k for k, tag in enumerate(path) if tag in ("worldbody", "body")]
            if bodies:
                path = ["(world)body", *path[bodies[-1] + 1 :]]
            name = "/".join(path)
            shown |= {(name, attribute) for attribute in ("", *element.attrib)}
    for name, kinds in TABLE.items():
        if name in WITHOUT_EXAMPLE or kind not in kinds:
            continue
        if kinds.keys() == {"refused"}:
            assert (name, "") in shown, name
        else:
            assert {(name, attribute) for attribute in kinds[kind]} <= shown, name
