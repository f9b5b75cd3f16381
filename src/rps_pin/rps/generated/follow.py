"""Leg lengths followed on a line, in C: `rps_pin.rps.kernels.continuation.follow_legs`.

The loops are written here, in the macros of `rps_pin.codegen.units.Routine`; what they call are
kernels made from the functions of `continuation`. In lanes, samples that are done keep their
numbers while others go on.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rps_pin.codegen.units import Kernel, Routine
from rps_pin.rps.kernels import continuation

#: Steps that one reading may be divided into at most, whatever is asked for.
MOST_STEPS = 1000

_BODY = f"""
    REAL d[3], to[1], at[6], next_at[6], judged[4], found[3], next[6], went[3];
    for (int i = 0; i < 6; ++i) direction[i] = direction_0[i];
    progress[0] = CONST(0.0);
    progress[1] = CONST(1.0);
    progress[2] = CONST(INFINITY);
    for (int k = 0; k < {MOST_STEPS}; ++k) {{
        const REAL going = AND(LT(CONST(k), most[0]), NE(progress[0], CONST(1.0)));
        if (!ANY(going)) break;
        follow_end(begin, goal, progress, to, d);
        follow_begin(d, direction, radii, limit, at, judged);
        REAL solved = CONST(0.0), there = judged[2], trying = AND(going, judged[0]);
        for (int n = 0; n < {continuation.MOST_NEWTON}; ++n) {{
            if (!ANY(trying)) break;
            follow_refine(d, at, radii, limit, judged + 1, next_at, found);
            for (int i = 0; i < 6; ++i) at[i] = SELECT(trying, next_at[i], at[i]);
            there = SELECT(trying, found[0], there);
            solved = SELECT(trying, AND(found[1], found[2]), solved);
            trying = AND(trying, NOT(found[1]));
        }}
        found[0] = solved;
        found[1] = there;
        found[2] = judged[3];
        follow_after(direction, progress, to, at, found, next, went);
        for (int i = 0; i < 6; ++i) direction[i] = SELECT(going, next[i], direction[i]);
        for (int i = 0; i < 3; ++i) progress[i] = SELECT(going, went[i], progress[i]);
    }}
"""


def follow_kernels(single: bool = False) -> tuple[Kernel, ...]:
    """Return the kernels that `FOLLOW` calls, in double or single precision."""
    last_step = (continuation.LAST_STEP_SINGLE,) if single else ()
    begin, goal, progress = symbols("begin", 3), symbols("goal", 3), symbols("progress", 3)
    direction, d, at = symbols("direction", 6), symbols("d", 3), symbols("at", 6)
    (g, h), (limit,), (det,) = symbols("radii", 2), symbols("limit", 1), symbols("det", 1)
    radii = (g, h)
    (to,), (solved, there, kantorovich) = symbols("to", 1), symbols("found", 3)

    end, lengths = continuation.step_end(begin, goal, progress)
    step = continuation.newton_step(d, direction, g, h)
    _, first_det, condition, first_kantorovich, _, _ = step
    trusted = continuation.to_be_trusted(condition, first_kantorovich, limit)
    refined, condition_there, last, good = continuation.refined(d, at, g, h, limit, det, *last_step)
    after, went = continuation.after_step(direction, progress, to, (solved, at, there, kantorovich))
    return (
        kernel(
            "follow_end",
            {"begin": begin, "goal": goal, "progress": progress},
            {"to": (end,), "d": lengths},
        ),
        kernel(
            "follow_begin",
            {"d": d, "direction": direction, "radii": radii, "limit": (limit,)},
            {
                "at": continuation.newton_and_chord(d, direction, g, h, step),
                "judged": (trusted, first_det, condition, first_kantorovich),
            },
        ),
        kernel(
            "follow_refine",
            {"d": d, "at": at, "radii": radii, "limit": (limit,), "det": (det,)},
            {"at": refined, "found": (condition_there, last, good)},
        ),
        kernel(
            "follow_after",
            {
                "direction": direction,
                "progress": progress,
                "to": (to,),
                "at": at,
                "found": (solved, there, kantorovich),
            },
            {"direction": after, "progress": went},
        ),
    )


#: Leg directions at the end of a line of leg lengths; progress: part of the line gone, next step,
#: condition number. Arguments as `follow_legs` has them.
FOLLOW = Routine(
    "follow",
    (
        *(("begin", 3), ("direction_0", 6), ("goal", 3), ("radii", 2)),
        *(("limit", 1), ("most", 1)),
    ),
    (("direction", 6), ("progress", 3)),
    _BODY,
    ("follow_end", "follow_begin", "follow_refine", "follow_after"),
)


def kernel(name: str, inputs: Mapping[str, Any], outputs: Mapping[str, Any]) -> Kernel:
    """Return a kernel of named tuples of expressions; its inputs must be symbols."""
    import casadi as ca  # noqa: PLC0415

    columns = [ca.vertcat(*numbers) for numbers in (*inputs.values(), *outputs.values())]
    given, made = columns[: len(inputs)], columns[len(inputs) :]
    names_out = [f"{name}_out" if name in inputs else name for name in outputs]
    return Kernel(ca.Function(name, given, made, [*inputs], names_out))


def symbols(name: str, size: int) -> tuple[Any, ...]:
    """Return a tuple of symbols."""
    import casadi as ca  # noqa: PLC0415

    symbol = ca.SX.sym(name, size)
    return tuple(symbol[i] for i in range(size))
