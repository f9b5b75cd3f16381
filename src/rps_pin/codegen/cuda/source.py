"""CUDA text of a mechanism's dynamics, steps and continuation, one thread a sample."""

from __future__ import annotations

from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.codegen.expressions.mechanism import LIMITS
from rps_pin.codegen.expressions.routines import with_calls
from rps_pin.codegen.units import Kernel, Routine, Unit

#: About the largest number of statements of one function of CUDA. Values that cross from one
#: function to the next lie in local memory, and ptxas spills less than that out of one function;
#: its time stays in proportion to the size so far.
CHUNK = 8000
#: The functions, of which `motion` is many steps in one launch.
NAMES = ("inverse_dynamics", "forward_dynamics", "step", "motion", "completed")


def unit(functions: MechanismFunctions, name: str, real: str) -> Unit:
    """Return the unit of one of `NAMES`, in "double" or "float"; its text is `Unit.cuda`."""
    limit = LIMITS[real]
    called, loops = with_calls(functions, ["step" if name == "motion" else name])
    if name == "motion":
        loops = (*loops, _motion(loops[-1], limit))
    kernels = tuple(Kernel(functions[one], CHUNK) for one in called)
    return Unit(f"{name}_unit", kernels, loops, (name,), frozenset({name}), limit)


def _motion(step: Routine, limit: float) -> Routine:
    """Return equal steps under constant forces, until one is flagged.

    Its arguments are those of `step` with ``count`` (1) after ``h``, its results those of `step`;
    ``work`` is that of all steps.
    """
    (_, nq), (_, nv), *_ = step.inputs
    also = "".join(f"{name}, " for name, _ in step.inputs[4:])
    body = f"""
    REAL q_last[{nq}], v_last[{nv}], done[1], c[2];
    int i, k;
    for (i = 0; i < {nq}; ++i) q_next[i] = q[i];
    for (i = 0; i < {nv}; ++i) v_next[i] = v[i];
    work[0] = check[0] = check[1] = CONST(0);
    for (k = 0; ANY(LT(CONST(k), count[0])); ++k) {{
        for (i = 0; i < {nq}; ++i) q_last[i] = q_next[i];
        for (i = 0; i < {nv}; ++i) v_last[i] = v_next[i];
        step(q_last, v_last, tau, h, {also}q_next, v_next, done, c);
        work[0] = work[0] + done[0];
        check[0] = FMAX(check[0], c[0]);
        check[1] = FMAX(check[1], c[1]);
        if (!ANY(AND(LE(check[0], CONST(1)), LE(check[1], CONST({limit!r}))))) break;
    }}
"""
    given = (*step.inputs[:4], ("count", 1), *step.inputs[4:])
    return Routine("motion", given, step.outputs, body, ("step",))
