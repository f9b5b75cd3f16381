"""From a mechanism to its generated code."""

from __future__ import annotations

from collections.abc import Sequence

from rps_pin.closed_loop.constraints.equations import refuse_twice
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.build.builder import CompilerName
from rps_pin.codegen.cuda.mechanism import CudaMechanism
from rps_pin.codegen.engine.compiled import CompiledMechanism
from rps_pin.codegen.engine.generated import GROUPS, GeneratedCode
from rps_pin.errors import InputError, shown
from rps_pin.validation import choice


def compile_mechanism(
    mechanism: ClosedLoopModel,
    *,
    parameters: Sequence[str] = (),
    wrench_frames: Sequence[str] = (),
    functions: Sequence[str] = tuple(GROUPS),
    batches: bool = False,
    compiler: CompilerName = "auto",
    device: str = "cpu",
    dtype: str = "float64",
) -> CompiledMechanism | CudaMechanism:
    """Return a mechanism in generated code, proven against the Pinocchio engine.

    Parameters
    ----------
    mechanism
        The mechanism. Later changes of it do not change the code.
    parameters
        Groups of numbers that are given with each call: ``"gravity"``, ``"inertia:JOINT"``,
        ``"mass:JOINT"``, ``"placement:JOINT"``, ``"closure:NAME"``, ``"distance:NAME"``,
        ``"payload:FRAME"`` (see `rps_pin.codegen.expressions.parameters`).
    wrench_frames
        Frames at which external wrenches will act. Others are possible: code for them is built when
        they are first named, which takes seconds.
    functions
        What is built now, of ``"dynamics"``, ``"kinematics"``, ``"closing"``, ``"forces"``,
        ``"simulation"`` and ``"derivatives"``; with parameters also ``"parameters"`` and
        ``"geometry"``, the derivatives by them, of forces and of gaps. The rest is built when it is
        first called.
    batches
        Whether code for several samples at once (in the processor's vectors) is built now. It takes
        as long again; left out, it is built in the background when the first large batch comes,
        and batches are computed sample by sample until then.
    compiler
        ``"auto"``, ``"gcc"``, ``"clang"``, ``"cc"`` or ``"tcc"``; see
        `rps_pin.codegen.build.build`. With ``"auto"`` TinyCC, if it is installed, answers within
        a second or so, until the code of a better compiler replaces it; `CompiledMechanism.wait`
        waits for that.
    device
        ``"cpu"``, or ``"cuda"`` for an NVIDIA card (``pip install rps-pin[cuda]``). There,
        ``"dynamics"`` (of both kinds), ``"simulation"`` and ``"closing"`` (continuation alone) can
        be built, by NVRTC, which ``compiler`` does not change; each function is built when it is
        first called unless ``functions`` are named.
    dtype
        ``"float64"``, or for a card ``"float32"``.

    Returns
    -------
    CompiledMechanism or CudaMechanism
        The latter for ``device="cuda"``.

    Raises
    ------
    InputError
        If an argument is not one of those.
    MechanismError
        If a joint has no expressions.
    CompileError
        If there is no compiler, or it fails; or if the code does not agree with the Pinocchio
        engine to 1e-10; accelerations of bodies of very different inertia to less, as their
        condition number says.
    """
    choice(device, "device", ("cpu", "cuda"))
    groups, frames = _names(parameters, "parameters"), _names(wrench_frames, "wrench_frames")
    refuse_twice("wrench frame", frames)
    for frame in frames:
        mechanism.system.frame(frame)
    functions = _names(functions, "functions")
    single = device == "cuda" and dtype == "float32"
    code = GeneratedCode(mechanism, groups, frames, compiler, batches, single)
    if device == "cuda":
        return _on_card(code, functions, compiler, dtype)
    if dtype != "float64":
        raise InputError(f"dtype = {dtype!r}: on device 'cpu' it must be 'float64'")
    code.build(*functions)
    return CompiledMechanism(code)


def _on_card(
    code: GeneratedCode, functions: Sequence[str], compiler: str, dtype: str
) -> CudaMechanism:
    if compiler != "auto":
        raise InputError(f"compiler = {compiler!r}: device 'cuda' has its own; leave it out")
    found = CudaMechanism(code, dtype)
    if tuple(functions) != tuple(GROUPS):
        found.build(*functions)
    return found


def _names(given: Sequence[str], name: str) -> tuple[str, ...]:
    """Return names; one alone may be given as it is."""
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, Sequence) or not all(isinstance(one, str) for one in names):
        raise InputError(f"{name} = {shown(given)}: it must be a sequence of names")
    return tuple(names)
