"""Routines of C with loops: Newton's method on the closures, steps in time, and derivatives.

A step is that of `rps_pin.closed_loop.simulation.integrators.rk4_step`, and ends on the manifold of
closed configurations: by a correction of least norm, and what that leaves, its square, by the
dependent joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from rps_pin.closed_loop.assembly.projection import NEAREST_STEP, NEAREST_STEPS
from rps_pin.closed_loop.constraints.equations import OPEN
from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.codegen.expressions.mechanism import GROWTH
from rps_pin.codegen.units import Routine

#: Steps in one call of `steps`.
BLOCK = 64
#: Squared gaps, in characteristic lengths: rounding error; and from where one more step of Newton's
#: method leads to rounding error.
_CLOSED, _LAST = "PRECISE(1e-28, 1e-13)", "PRECISE(1e-16, 1e-8)"
#: The same in Newton's method beside a singularity, where what a step leaves is many times larger.
_LAST_OF_ALL = "PRECISE(1e-22, 1e-10)"
_NEWTON_STEPS = 20
#: As in `rps_pin.closed_loop.assembly.continuation`: the squared ratio of corrections, and the
#: largest motion in a step, here all together, rad or characteristic lengths.
_CONTRACTION, _REACH = 1 / 16, 0.3
#: Squared, the largest relative change of A in a step.
_CHANGE = 1 / 4
#: A step is at least this part of what is left of a way, and what is left is this part of the way;
#: and most tries.
_PARTS, _LEAST_REST, _TRIES = 64, 1e-7, 1000


def routines(functions: MechanismFunctions, names: Iterable[str]) -> tuple[Routine, ...]:
    """Return those functions of names that are routines, and the routines that they call.

    Each stands after those it calls. There are

    ============================  ====================  ========================================
    name                          arguments             results
    ============================  ====================  ========================================
    closed                        q                     q, its independent coordinates as given;
                                                        squared gap of the guess (1) (check)
    closed_near                   q                     the same by steps of least norm (check)
    completed                     q, q'                 the closed q that continues the first, with
                                                        independent coordinates as the second (those
                                                        of joints of one coordinate) (check)
    nearest                       q                     the closed q at the least distance;
                                                        squared, that distance in one unit (1)
                                                        (check)
    step                          q, v, tau, h (1)      q, v, work (1) (check)
    steps                         q, v, tau, h (BLOCK)  all q, all v, all work, (BLOCK, ...) each
                                                        (check)
    forward_dynamics_derivatives  q, v, tau             as the function of this name
    ============================  ====================  ========================================

    External wrenches and parameters follow the arguments, as for `functions`.
    """
    found: dict[str, Routine] = {}

    def add(name: str) -> None:
        if name in _MAKERS and name not in found:
            one = _MAKERS[name](functions)
            for call in one.calls:
                add(call)
            found[name] = one

    for name in names:
        add(name)
    return tuple(found.values())


def with_calls(
    functions: MechanismFunctions, names: Iterable[str]
) -> tuple[tuple[str, ...], tuple[Routine, ...]]:
    """Return the kernels of functions and of what they call, by name, and their routines."""
    names = tuple(names)
    loops = routines(functions, names)
    are_loops = {one.name for one in loops}
    every = dict.fromkeys((*names, *(call for one in loops for call in one.calls)))
    return tuple(name for name in every if name not in are_loops), loops


def _extra(functions: MechanismFunctions, wrenches: bool) -> list[tuple[str, int]]:
    x = functions.expressions
    extra = [("wrenches", 6 * len(x.wrench_frames))] if wrenches and x.wrench_frames else []
    count = len(x.parameters.labels)
    return extra + ([("parameters", count)] if count else [])


def _call(name: str, given: Sequence[str], extra: list[tuple[str, int]], *results: str) -> str:
    return f"{name}({', '.join([*given, *(name for name, _ in extra), *results])});"


def _newton(functions: MechanismFunctions, name: str, kernel: str) -> Routine:
    model = functions.expressions.tree.model
    extra = _extra(functions, False)
    body = f"""
    REAL dv[{model.nv}], moved[{model.nq}], gap[1], growth[1], before = CONST(INFINITY);
    int i, k;
    for (i = 0; i < {model.nq}; ++i) q_closed[i] = q[i];
    check[0] = check[1] = CONST(0);
    for (k = 0; k < {_NEWTON_STEPS}; ++k) {{
        {_call(kernel, ["q_closed"], extra, "dv", "gap", "growth")}
        check[1] = FMAX(check[1], growth[0]);
        if (k == 0) first[0] = gap[0];
        /* A gap that grows, before it is near rounding error, is not this routine's matter. */
        check[0] = SELECT(AND(LT(before, gap[0]), LT({_LAST}, gap[0])),
                          CONST(2), check[0]);
        before = gap[0];
        if (!ANY(LT({_CLOSED}, gap[0]))) break;
        {_call("integrate", ["q_closed", "dv"], extra, "moved")}
        for (i = 0; i < {model.nq}; ++i) q_closed[i] = moved[i];
        if (!ANY(LT({_LAST_OF_ALL}, gap[0]))) break;
    }}
    check[0] = SELECT(LT({_LAST}, before), CONST(2), check[0]);
"""
    outputs = (("q_closed", model.nq), ("first", 1), ("check", 2))
    return Routine(name, (("q", model.nq), *extra), outputs, body, (kernel, "integrate"))


def _completed(functions: MechanismFunctions) -> Routine:
    """In steps along the way, halved where Newton's steps do not contract as a continuation's must.

    A step that is taken after another one is twice as long. The way is given up where a step would
    be less than 1/64 of what is left of it. Steps also keep the sign of det A, A the closures'
    Jacobian by the others: where it changes, a singularity lies between, and Newton's steps led
    into another assembly mode. Where A is not square, |A^-1| times the motion in a step, which
    bounds the change of A, must be at most a half.
    """
    x = functions.expressions
    model, extra = x.tree.model, _extra(functions, False)
    scale, reach = x.system.column_scale, (_REACH * x.system.equations.length) ** 2
    independent = set(x.independent.tolist())
    simple = [
        (joint.idx_q, float(scale[joint.idx_v]))
        for joint in list(model.joints)[1:]
        if joint.nq == 1 and joint.idx_v in independent
    ]
    squares = [f"way += SQUARE((given[{i}] - q[{i}]) * CONST({1 / by!r}));" for i, by in simple]
    moves = [
        f"at[{i}] = SELECT(LE(CONST(1), aim), given[{i}], q[{i}] + aim * (given[{i}] - q[{i}]));"
        for i, _ in simple
    ]
    lengths = [
        f"length += SQUARE(dv[{j}] * CONST({1 / by!r}));" for j, by in enumerate(scale.tolist())
    ]
    length = x.system.equations.length
    away = [
        f"moving += SQUARE((at[{i}] - q_closed[{i}]) * CONST({by / length!r}));"
        for i, by in enumerate(x.system.arcs.tolist())
    ]
    most = _CHANGE / GROWTH**2
    kept, moved = "LT(CONST(0), turn[0] * side)", []
    if x.orientation is None:
        moved = ["REAL moving = CONST(0);", *away]
        kept = f"LE(growth[0] * moving, CONST({most!r}))"
    body = f"""
    REAL at[{model.nq}], moved[{model.nq}], dv[{model.nv}], gap[1], growth[1];
    REAL turn[1], side = CONST(0), way = CONST(0), good, again = CONST(0), going;
    REAL share = CONST(0), aim = CONST(0), step, longest, before, length, worst;
    int i, k, n;
    #define SQUARE(x) ((x) * (x))
    {" ".join(squares)}
    longest = FMIN(CONST(1), SQRT(CONST({reach!r}) / FMAX(way, CONST(1e-30))));
    step = longest;
    check[1] = CONST(0);
    for (i = 0; i < {model.nq}; ++i) q_closed[i] = q[i];
    for (n = 0; n < {_TRIES}; ++n) {{ /* the first closes the guess to rounding error */
        for (i = 0; i < {model.nq}; ++i) at[i] = q_closed[i];
        if (n) {{
            aim = share + step;
            aim = SELECT(LT(aim, CONST({1 - _LEAST_REST!r})), aim, CONST(1));
            {" ".join(moves)}
        }}
        good = LE(CONST(0), way);
        worst = CONST(0);
        before = CONST({reach!r});
        for (k = 0; k < {_NEWTON_STEPS}; ++k) {{
            {_call("continuing_step", ["at"], extra, "dv", "gap", "growth", "turn")}
            length = CONST(0);
            {" ".join(lengths)}
            worst = FMAX(worst, growth[0]);
            good = AND(good, OR(LT(gap[0], {_LAST}), LE(length, before)));
            before = CONST({_CONTRACTION!r}) * length;
            if (!ANY(AND(good, LT({_CLOSED}, gap[0])))) break;
            {_call("integrate", ["at", "dv"], extra, "moved")}
            for (i = 0; i < {model.nq}; ++i) at[i] = moved[i];
            if (!ANY(LT({_LAST_OF_ALL}, gap[0]))) break;
        }}
        good = AND(good, LE(gap[0], {_LAST}));
        if (n) {{
            {" ".join(moved)}
            good = AND(AND(good, going), {kept});
            share = SELECT(good, aim, share);
            step = SELECT(good, SELECT(again, FMIN(longest, step + step), step),
                          step * CONST(0.5));
            again = good;
        }}
        else {{
            side = turn[0];
            going = good;
        }}
        for (i = 0; i < {model.nq}; ++i) q_closed[i] = SELECT(good, at[i], q_closed[i]);
        check[1] = SELECT(good, FMAX(check[1], worst), check[1]);
        going = AND(going, AND(LT(CONST({_LEAST_REST!r}), CONST(1) - share),
                               LE((CONST(1) - share) * CONST({1 / _PARTS!r}), step)));
        if (!ANY(going)) break;
    }}
    #undef SQUARE
    check[0] = SELECT(LE(CONST(1), share), CONST(0), CONST(2));
"""
    outputs = (("q_closed", model.nq), ("check", 2))
    given = (("q", model.nq), ("given", model.nq), *extra)
    return Routine("completed", given, outputs, body, ("continuing_step", "integrate"))


def _nearest(functions: MechanismFunctions) -> Routine:
    """As `rps_pin.closed_loop.assembly.projection`, without joint limits."""
    x = functions.expressions
    nq, nv, extra = x.tree.model.nq, x.tree.model.nv, _extra(functions, False)
    shortest = (NEAREST_STEP * x.system.equations.length) ** 2
    closing = _call("closed_near", ["moved"], extra, "candidate", "first", "c")
    body = f"""
    REAL dv[{nv}], next[{nv}], moved[{nq}], candidate[{nq}], first[1], c[2], d[1], s[1], e[1];
    REAL length = CONST(1), size, growth[1], nearer, moving;
    int i, k;
    for (i = 0; i < {nq}; ++i) moved[i] = given[i];
    {_call("closed_near", ["moved"], extra, "q", "first", "check")}
    {_call("nearest_step", ["q", "given"], extra, "dv", "distance", "s", "growth")}
    check[1] = FMAX(check[1], growth[0]);
    size = s[0];
    for (k = 0; k < {NEAREST_STEPS}; ++k) {{
        /* No step is left, or none that is longer than rounding leads nearer. */
        moving = AND(LT(CONST({shortest!r}), size), LE(CONST(1e-6), length));
        if (!ANY(moving)) break;
        for (i = 0; i < {nv}; ++i) next[i] = length * dv[i];
        {_call("integrate", ["q", "next"], extra, "moved")}
        {closing}
        {_call("nearest_step", ["candidate", "given"], extra, "next", "d", "s", "e")}
        nearer = AND(AND(LT(d[0], distance[0]), LE(c[0], CONST(1))), moving);
        for (i = 0; i < {nq}; ++i) q[i] = SELECT(nearer, candidate[i], q[i]);
        for (i = 0; i < {nv}; ++i) dv[i] = SELECT(nearer, next[i], dv[i]);
        distance[0] = SELECT(nearer, d[0], distance[0]);
        size = SELECT(nearer, s[0], size);
        check[1] = SELECT(nearer, FMAX(check[1], e[0]), check[1]);
        length = SELECT(nearer, FMIN(CONST(1), length + length), length * CONST(0.5));
    }}
    check[0] = SELECT(AND(LT(CONST({shortest!r}), size), LE(CONST(1e-6), length)),
                      CONST(2), check[0]);
"""
    outputs = (("q", nq), ("distance", 1), ("check", 2))
    calls = ("closed_near", "nearest_step", "integrate")
    return Routine("nearest", (("given", nq), *extra), outputs, body, calls)


def _step(functions: MechanismFunctions) -> Routine:
    x = functions.expressions
    nq, nv, extra, alone = (
        x.tree.model.nq,
        x.tree.model.nv,
        _extra(functions, True),
        _extra(functions, False),
    )

    def stage(q: str, v: str, k: int) -> str:
        call = _call("stage", [q, v, "tau"], extra, f"a{k}", f"p{k}", "c")
        return f"{call} check[1] = FMAX(check[1], c[0]);"

    def move(q: str, to: str) -> str:
        return _call("integrate", [q, "d"], alone, to)

    body = f"""
    REAL a1[{nv}], a2[{nv}], a3[{nv}], a4[{nv}], v2[{nv}], v3[{nv}], v4[{nv}], d[{nv}];
    REAL q2[{nq}], q3[{nq}], p1[1], p2[1], p3[1], p4[1], first[1], c[2];
    const REAL t = h[0], half = t * CONST(0.5), twelfth = t / CONST(12), sixth = t / CONST(6);
    int i;
    check[1] = CONST(0);
    {stage("q", "v", 1)}
    for (i = 0; i < {nv}; ++i) {{ d[i] = half * v[i]; v2[i] = v[i] + half * a1[i]; }}
    {move("q", "q2")}
    {stage("q2", "v2", 2)}
    for (i = 0; i < {nv}; ++i) {{ d[i] = half * v2[i]; v3[i] = v[i] + half * a2[i]; }}
    {move("q", "q3")}
    {stage("q3", "v3", 3)}
    for (i = 0; i < {nv}; ++i) {{
        d[i] = t * (v3[i] - CONST(0.5) * v[i]);
        v4[i] = v[i] + t * a3[i];
    }}
    {move("q2", "q3")}
    {stage("q3", "v4", 4)}
    for (i = 0; i < {nv}; ++i)
        d[i] = twelfth * (CONST(3) * v[i] + CONST(2) * v2[i] + CONST(2) * v3[i] - v4[i]);
    {move("q", "q2")}
    for (i = 0; i < {nv}; ++i)
        d[i] = twelfth * (CONST(2) * v2[i] - v[i] + CONST(2) * v3[i] + CONST(3) * v4[i]);
    {move("q2", "q3")}
    for (i = 0; i < {nv}; ++i)
        v2[i] = v[i] + sixth * (a1[i] + CONST(2) * a2[i] + CONST(2) * a3[i] + a4[i]);
    work[0] = sixth * (p1[0] + CONST(2) * p2[0] + CONST(2) * p3[0] + p4[0]);
    {_call("projection", ["q3", "v2"], alone, "d", "v3", "first", "c")}
    {move("q3", "q2")}
    check[1] = FMAX(check[1], c[0]);
    /* From an open configuration, or far off the manifold: too long a step. */
    check[0] = first[0] / CONST({OPEN**2!r});
    if (ANY(LT({_LAST}, first[0]))) {{
        {_call("closed", ["q2"], alone, "q_next", "first", "c")}
        check[0] = FMAX(check[0], c[0]);
        check[1] = FMAX(check[1], c[1]);
    }} else {{
        for (i = 0; i < {nq}; ++i) q_next[i] = q2[i];
    }}
    {_call("projected_velocity", ["q_next", "v3"], alone, "v_next")}
"""
    given = (("q", nq), ("v", nv), ("tau", x.system.actuated.size), ("h", 1), *extra)
    outputs = (("q_next", nq), ("v_next", nv), ("work", 1), ("check", 2))
    calls = ("stage", "integrate", "projection", "closed", "projected_velocity")
    return Routine("step", given, outputs, body, calls)


def _steps(functions: MechanismFunctions) -> Routine:
    x = functions.expressions
    nq, nv, extra = x.tree.model.nq, x.tree.model.nv, _extra(functions, True)
    results = (f"qs + k * {nq}", f"vs + k * {nv}", "works + k", "c")
    following = [f"k ? qs + (k - 1) * {nq} : q", f"k ? vs + (k - 1) * {nv} : v", "tau", "h + k"]
    body = f"""
    REAL c[2];
    int k;
    check[0] = check[1] = CONST(0);
    for (k = 0; k < {BLOCK}; ++k) {{
        {_call("step", following, extra, *results)}
        check[0] = FMAX(check[0], c[0]);
        check[1] = FMAX(check[1], c[1]);
    }}
"""
    given = (("q", nq), ("v", nv), ("tau", x.system.actuated.size), ("h", BLOCK), *extra)
    outputs = (("qs", BLOCK * nq), ("vs", BLOCK * nv), ("works", BLOCK), ("check", 2))
    return Routine("steps", given, outputs, body, ("step",))


def _forward_dynamics_derivatives(functions: MechanismFunctions) -> Routine:
    """All columns of the derivatives by one linear map: see `ForwardColumns`."""
    x, columns = functions.expressions, functions.forward_columns
    nq, nv, na, m = x.tree.model.nq, x.tree.model.nv, x.tau.numel(), x.independent.size
    extra, response = _extra(functions, True), columns.response
    right = columns.right.sparsity()
    dependent, independent = x.partition.dependent, x.independent.tolist()
    tables = {
        "starts": right.colind(),
        "right_rows": [1 + row for row in right.row()],
        "places": response.places,
        "independent": independent,
    }
    for name, matrix in (("basis", columns.basis), ("followed", columns.followed)):
        tables[f"{name}_starts"] = matrix.sparsity().colind()
        tables[f"{name}_rows"] = dependent[matrix.sparsity().row()].tolist()
    numbers = {
        "right": right.nnz(),
        "coefficients": response.coefficients.numel(),
        "basis": columns.basis.nnz(),
        "followed": columns.followed.nnz(),
    }
    arrays = ", ".join(f"{name}[{max(1, size)}]" for name, size in numbers.items())
    body = f"""
    {"".join(_table(name, values) for name, values in tables.items())}
    REAL {arrays};
    ROW rows[{response.rows}];
    int i, j, k, part, begin;
    {_call("forward_columns", ["q", "v", "tau"], extra, *numbers, "check")}
    for (j = 0; j < COLUMNS; ++j) ENTRY(rows[0], j) = CONST(0);
    for (part = 0; part < 3; ++part) {{
        const int size = part < 2 ? {nv} : {na};
        const int *const start = starts + part * {nv};
        REAL *const to = part == 0 ? by_q : part == 1 ? by_v : by_tau;
        for (begin = 0; begin < size; begin += COLUMNS) {{
            const int left = size - begin, wide = left < COLUMNS ? left : COLUMNS;
            for (i = 1; i <= {right.size1()}; ++i) rows[i] = rows[0];
            for (j = 0; j < wide; ++j)
                for (k = start[begin + j]; k < start[begin + j + 1]; ++k)
                    ENTRY(rows[right_rows[k]], j) = right[k];
            {response.calls("response", "rows", "coefficients")}
            if (wide == COLUMNS)
                for (i = 0; i < {nv}; ++i) STORE(to + i * size + begin, rows[places[i]]);
            else
                for (j = 0; j < wide; ++j)
                    for (i = 0; i < {nv}; ++i)
                        to[i * size + begin + j] = ENTRY(rows[places[i]], j);
        }}
    }}
    for (i = 0; i < {m}; ++i) {{
        const REAL *of_q = by_q + independent[i] * {nv}, *of_v = by_v + independent[i] * {nv};
        for (j = 0; j < {m}; ++j) {{
            REAL position = of_q[independent[j]], velocity = of_v[independent[j]];
            for (k = basis_starts[j]; k < basis_starts[j + 1]; ++k) {{
                position += of_q[basis_rows[k]] * basis[k];
                velocity += of_v[basis_rows[k]] * basis[k];
            }}
            for (k = followed_starts[j]; k < followed_starts[j + 1]; ++k)
                position += of_v[followed_rows[k]] * followed[k];
            by_position[i * {m} + j] = position;
            by_velocity[i * {m} + j] = velocity;
        }}
        for (j = 0; j < {na}; ++j) by_actuation[i * {na} + j] = by_tau[independent[i] * {na} + j];
    }}
"""
    matrices = {
        "by_q": (nv, nv),
        "by_v": (nv, nv),
        "by_tau": (nv, na),
        "by_position": (m, m),
        "by_velocity": (m, m),
        "by_actuation": (m, na),
    }
    outputs = (*((name, rows * size) for name, (rows, size) in matrices.items()), ("check", 2))
    given = (("q", nq), ("v", nv), ("tau", na), *extra)
    name = "forward_dynamics_derivatives"
    before = response.text("response")
    return Routine(name, given, outputs, body, ("forward_columns",), matrices, before)


def _table(name: str, values: Sequence[int]) -> str:
    return f"static const int {name}[] = {{{', '.join(map(str, values or [0]))}}};\n    "


_MAKERS: Mapping[str, Callable[[MechanismFunctions], Routine]] = {
    "closed": partial(_newton, name="closed", kernel="closing_step"),
    "closed_near": partial(_newton, name="closed_near", kernel="least_norm_step"),
    "completed": _completed,
    "nearest": _nearest,
    "step": _step,
    "steps": _steps,
    "forward_dynamics_derivatives": _forward_dynamics_derivatives,
}
