"""Each formula of the 3-RPS stands once: a table of the formulas, and detectors of copies.

The paper's own equations (`rps_pin.paper`) are derived apart from these, and are what proves them.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import rps_pin

SOURCE = Path(rps_pin.__file__).parent

#: Formula, and the one function that defines it, in `rps_pin`.
FORMULAS = {
    "Stumpff functions": "numerics.stumpff.stumpff",
    "coefficients of rotation and angular velocity, and their derivatives": (
        "rps.kernels.tilt_functions.tilt_functions"
    ),
    "rotation of a tilt": "rps.kernels.platform.rotation",
    "quaternion of a tilt": "rps.kernels.platform.quaternion",
    "angular velocity": "rps.kernels.platform.angular_velocity",
    "angular acceleration": "rps.kernels.platform.angular_acceleration",
    "Euler's equation": "rps.kernels.platform.turning_moment",
    "force of a mass beside the centre": "rps.kernels.platform.offset_force",
    "tips and centre (Eq. 1 and 4)": "rps.kernels.tips.tips",
    "slopes of the tips": "rps.kernels.tips.tip_slopes",
    "time derivatives of the slopes": "rps.kernels.tips.tip_slope_rates",
    "accelerations of the tips": "rps.kernels.tips.tip_accelerations",
    "form of the tips' squared speed": "rps.kernels.tips.speed_form",
    "leg length and direction (Eq. 7)": "rps.kernels.legs.leg_geometry",
    "K, the derivative of length by pose": "rps.kernels.legs.along_leg",
    "N, the derivative of angle by pose": "rps.kernels.legs.across_leg",
    "accelerations of length and angle": "rps.kernels.legs.leg_acceleration",
    "rest axis of a spherical joint": "rps.kernels.legs.rest_axis",
    "cone of a spherical joint": "rps.kernels.legs.cone_cosine",
    "limits, kept to rounding": "rps.kernels.limits.within",
    "Eq. 8": "rps.kernels.leg_equations.residuals",
    "slopes of Eq. 8": "rps.kernels.leg_equations.slopes",
    "determinant of Eq. 8": "rps.kernels.leg_equations.determinant",
    "inverse of Eq. 8's Jacobian": "rps.kernels.leg_equations.adjugate",
    "errors of the tips' distances": "rps.kernels.leg_equations.distance_errors",
    "turn by a Newton step": "rps.kernels.leg_equations.turned",
    "Newton's step and its Kantorovich number": "rps.kernels.continuation.newton_step",
    "an assembly mode followed": "rps.kernels.continuation.follow_legs",
    "centre and axes of tips": "rps.kernels.placement.platform_axes",
    "tilt of axes": "rps.kernels.placement.tilt_of_axes",
    "friction": "closed_loop.dynamics.passive_joint_forces.friction_force",
    "force that moves a rod": "rps.kernels.forces.rod_force",
    "moment that turns a cylinder": "rps.kernels.forces.cylinder_moment",
    "moment that moves a rod": "rps.kernels.forces.rod_moment",
    "virtual work of legs and platform": "rps.kernels.forces.virtual_work",
    "generalised moment of the tilt": "rps.kernels.forces.tilt_couple",
    "inverse of a 3 x 3 matrix by cofactors": "rps.kernels.forces.cofactors",
    "wrench that moves the platform": "rps.dynamics.force_equations.platform_wrench",
}

#: Traces of a formula in the text of an expression, and the only modules that may hold it.
TRACES = {
    "a factorial series": (r"\bfactorial\(", {"numerics.stumpff"}),
    "sin(x) / x": (  # a speed profile is a sine of its own
        r"\bsin\((\w+)\) / \1\b",
        # joints of any mechanism are a layer below
        {"numerics.stumpff", "task.motion.speed_profile", "codegen.expressions.joints"},
    ),
    "(1 - cos(x)) / x^2": (r"\(1(\.0)? - \S*cos\((\w+)\)\) / \2", set[str]()),
    "Eq. 1 in a leg's plane": (
        r"(\w+)(?: \* \1| \*\* 2) - 3(?:\.0)? \* (\w+)(?: \* \2| \*\* 2)",
        set[str](),
    ),
    "Eq. 8's constant": (
        r"6(?:\.0)? \* (\w+)(?: \* \1| \*\* 2) \+ 3(?:\.0)? \* (\w+)(?: \* \2| \*\* 2)",
        {"rps.kernels.leg_equations"},
    ),
    "Eq. 8's determinant": (r"a1 \* b2 \* c3 \+ a2 \* b3 \* c1", {"rps.kernels.leg_equations"}),
    "a turn without trigonometric functions": (
        r"2(?:\.0)? \* (\w+) / \(1(?:\.0)? \+ \1 \* \1\)",
        {"rps.kernels.leg_equations"},
    ),
    "the Kantorovich number": (r"\bcurvature_bound\(", {"rps.kernels.continuation"}),
    "friction": (
        r"\btanh\(",
        {
            "closed_loop.dynamics.passive_joint_forces",
            "numerics.elementary",
            "task.stiffness.beams",  # torsion of rectangles
        },
    ),
    "the tolerance of limits": (
        r"limit\w* [-+] (1e-12|\w*ROUNDING)",
        set[str](),
    ),
}

#: Rooms whose expressions are compared with each other: expressions of at least so many operations
#: that are equal but for names, and are no mere sum of products, are one formula written twice.
ROOMS = ("rps", "control", "viewer", "plots", "panel", "numerics")
OPERATIONS, OPERATIONS_WITHOUT_NUMBERS = 7, 12


@cache
def trees() -> dict[str, ast.Module]:
    """Every module of the package."""
    return {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts): ast.parse(path.read_text("utf-8"))
        for path in sorted(SOURCE.rglob("*.py"))
    }


def modules(*rooms: str) -> Iterator[tuple[str, ast.Module]]:
    for module, tree in trees().items():
        if module.partition(".")[0] in rooms:
            yield module, tree


@cache
def expressions() -> dict[str, str]:
    """The texts of all expressions of each module, one a line."""
    return {
        module: "\n".join(
            {
                ast.unparse(node)
                for node in ast.walk(tree)
                if isinstance(node, (ast.BinOp, ast.Compare, ast.Call))
            }
        )
        for module, tree in trees().items()
        if not module.startswith("paper.")
    }


class _Nameless(ast.NodeTransformer):
    """Replaces names, attributes and entries by the order in which they first stand."""

    def __init__(self) -> None:
        self.order: dict[str, str] = {}

    def named(self, node: ast.expr) -> ast.expr:
        name = self.order.setdefault(ast.unparse(node), f"v{len(self.order)}")
        return ast.Name(name, ast.Load())

    visit_Name = visit_Attribute = visit_Subscript = named  # noqa: N815

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        return ast.Constant(float(node.value)) if isinstance(node.value, (int, float)) else node


def nameless(node: ast.expr) -> str:
    return ast.unparse(_Nameless().visit(ast.parse(ast.unparse(node), mode="eval")))


def formulas(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield each function with an expression that has enough operations, without its names."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for node in ast.walk(function):
                if isinstance(node, ast.BinOp) and is_formula(list(ast.walk(node))):
                    yield function.name, nameless(node)


def is_formula(nodes: list[ast.AST]) -> bool:
    constants = [node.value for node in nodes if isinstance(node, ast.Constant)]
    if not all(isinstance(value, (int, float)) for value in constants):
        return False  # text
    least = OPERATIONS if constants else OPERATIONS_WITHOUT_NUMBERS
    return sum(isinstance(node, (ast.BinOp, ast.UnaryOp)) for node in nodes) >= least


def copies(sources: Iterator[tuple[str, ast.Module]]) -> dict[str, set[str]]:
    """Return the functions that hold the same formula, by formula."""
    places: dict[str, set[str]] = defaultdict(set)
    for module, tree in sources:
        for function, formula in formulas(tree):
            places[formula].add(f"{module}.{function}")
    return {formula: where for formula, where in places.items() if len(where) > 1}


@pytest.mark.parametrize("formula", FORMULAS)
def test_a_formula_stands_where_the_table_says(formula: str) -> None:
    module, _, function = FORMULAS[formula].rpartition(".")
    found = getattr(importlib.import_module(f"rps_pin.{module}"), function)
    assert callable(found)
    assert found.__module__ == f"rps_pin.{module}"


def test_every_kernel_is_in_one_module() -> None:
    names = defaultdict(set)
    for module, tree in modules("rps"):
        if module.startswith("rps.kernels."):
            for node in tree.body:
                if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                    names[node.name].add(module)
    assert {name: where for name, where in names.items() if len(where) > 1} == {}


@pytest.mark.parametrize("formula", TRACES)
def test_traces_of_a_formula_are_in_its_module_only(formula: str) -> None:
    pattern, allowed = TRACES[formula]
    found = {module for module, text in expressions().items() if re.search(pattern, text)}
    assert found <= allowed
    assert found or not allowed


def test_no_formula_stands_twice() -> None:
    assert copies(modules(*ROOMS)) == {}


def test_a_copy_is_found_under_other_names() -> None:
    first = "def one(a, b, c):\n    return a * b - 2 * a * c + b * b * c - 3 * a\n"
    second = "def two(x, y, z):\n    return x.k * y - 2.0 * x.k * z + y * y * z - 3.0 * x.k\n"
    other = "def three(x, y, z):\n    return x * y - 5.0 * x * z + y * y * z - 3.0 * x\n"
    texts = zip("abc", (first, second, other), strict=True)
    trees = [(name, ast.parse(text)) for name, text in texts]
    assert set(map(frozenset, copies(iter(trees)).values())) == {frozenset({"a.one", "b.two"})}
