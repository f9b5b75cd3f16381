"""Kills at random moments of every command that writes: ``python -m tests.kills --each 50``.

Each command is run to its end twice, so that its results and the time of its first file are known.
Then it is killed: some times before it writes, most times while it writes, by SIGINT (as a terminal
sends it, to all processes), SIGTERM, SIGHUP and SIGKILL in turn. Afterwards:

- Each result under its final name is whole: what stood there before, what the command writes when
  nobody disturbs it, or another file that can be read to its end.
- No process is left, and no traceback was printed.
- After a signal other than SIGKILL: the exit status is the signal's (or 0, with all results), and
  there is no other file, neither beside the results nor in TMPDIR nor in the cache of code.
- After SIGKILL the next run of the command clears away what was left, and nothing of others.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import random
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import textwrap
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
from lxml import etree
from PIL import Image

from rps_pin import interruption
from tests.processes import RPS_PIN, lives, start

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
BEFORE = b"what stood there before"
#: Hidden files of others: notes, one of a program of the same kind, one whose process lives.
OTHERS = (
    ".notes.txt",
    ".x.rps_pin-theirs.csv",
    f".x.rps_pin-{interruption._place()}-{os.getpid()}-01234567.csv",
)
#: Time for processes to end, s.
PATIENCE = 60.0
_PAUSE = 0.002

_CIRCLE = "kind: circle\nheight: 0.223\ntilt: 0.05\nduration: 0.2\n"
_LOOP = """\
robot: micro
trajectory: {kind: circle, height: 0.223, tilt: 0.05, duration: 0.2}
settle: 0.1
controller: {bandwidth: 15.0, integral: 0.2}
plant: {masses: 1.2, delay: 1}
"""
#: Files that commands read, beside the folder of results.
INPUTS = {"circle.yaml": _CIRCLE, "loop.yaml": _LOOP}


def _python(text: str) -> tuple[str, ...]:
    return (sys.executable, "-u", "-c", textwrap.dedent(text))


def _rps_pin(words: str) -> tuple[str, ...]:
    return (*RPS_PIN, *words.split())


_WITH_WORKERS = """
    from rps_pin import RPSParameters
    from rps_pin.rps.workspace import leg_grid, workspace_to_file

    micro = RPSParameters.from_preset("micro")
    workspace_to_file(micro, "out/space.h5", leg_grid(micro, 101), workers=2, overwrite=True)
"""
_COMPILE = """
    from importlib import resources

    from rps_pin import ClosedLoopModel

    file = resources.files("rps_pin") / "urdf" / "four_bar.yaml"
    ClosedLoopModel.load(file).compile(compiler="tcc")
"""
#: Commands, run beside a folder ``out`` that they write to.
COMMANDS: dict[str, tuple[str, ...]] = {
    "urdf": _rps_pin("urdf -r micro -o out/micro.urdf --overwrite"),
    "convert urdf": _rps_pin("convert four_bar --to urdf -o out --overwrite"),
    "convert mjcf": _rps_pin("convert four_bar --to mjcf -o out --overwrite"),
    "export c": _rps_pin("export c four_bar -o out --overwrite"),
    "new": _rps_pin("new stewart -o out --overwrite"),
    "examples": _rps_pin("examples -o out --overwrite"),
    "view html": _rps_pin("view -r micro --html out/view.html --overwrite"),
    "helix": _rps_pin("helix -r micro --rate 20 -o out --overwrite"),
    "dynamics": _rps_pin("dynamics circle.yaml -r micro --rate 100 -o out --overwrite"),
    "simulate": _rps_pin("simulate four_bar --duration 0.01 -o out --overwrite"),
    "control": _rps_pin("control loop.yaml -o out --overwrite"),
    "workspace": _rps_pin("workspace --points 5 -o out --overwrite"),
    "reproduce": _rps_pin("reproduce --quick -o out --overwrite"),
    "view png": _rps_pin("view --png out/view.png --size 200x150 --overwrite"),
    "view video": _rps_pin(
        "view -r micro --duration 0.4 --video out/view.gif --size 200x150 --overwrite"
    ),
    "workspace_to_file": _python(_WITH_WORKERS),
    "compile": _python(_COMPILE),
}


@dataclass(frozen=True)
class Undisturbed:
    """What a command does when nobody disturbs it."""

    files: dict[str, bytes]
    """Results by their path in the folder."""
    first: float
    """Time of the first file, s."""
    end: float
    """Time of the end, s."""


@dataclass
class Counts:
    """What became of the kills of one command."""

    when: Counter[str] = field(default_factory=Counter)
    """Before the first file, while it wrote, after its end."""
    left: int = 0
    """Kills by SIGKILL that left files."""
    cleared: int = 0
    """Of them, those that the next run cleared away."""
    faults: list[str] = field(default_factory=list)


class Place:
    """A folder to run a command in, with its own TMPDIR and cache of code."""

    def __init__(self, folder: Path, there: Iterable[str] = ()) -> None:
        self.folder, self.out = folder, folder / "out"
        self.tmp, self.cache = folder / "t", folder / "cache"
        for one in (self.out, self.tmp, self.cache):
            one.mkdir(parents=True)
        for name, text in INPUTS.items():
            (folder / name).write_text(text)
        for name in OTHERS:
            (self.out / name).write_bytes(BEFORE)
        for name in there:
            (self.out / name).parent.mkdir(exist_ok=True)
            (self.out / name).write_bytes(BEFORE)
        self.mark = f"RPS_PIN_KILLS={uuid.uuid4().hex}"
        self.at_first = self.state()

    def start(self, command: Sequence[str]) -> subprocess.Popen[str]:
        """Start a command as a terminal does: in a process group of its own."""
        name, _, value = self.mark.partition("=")
        own = {name: value, "TMPDIR": str(self.tmp), "RPS_PIN_CACHE": str(self.cache)}
        with (self.folder / "errors").open("w") as errors:
            return start(
                command,
                cwd=self.folder,
                env=os.environ | own,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                process_group=0,
            )

    def errors(self) -> str:
        """Return what the command wrote to standard error."""
        return (self.folder / "errors").read_text("utf-8", "replace")

    def processes(self) -> list[int]:
        """Return the processes that live of all that were started here."""
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            try:
                environment = (process / "environ").read_bytes()
            except OSError:  # it has ended, or is another user's
                continue
            if self.mark.encode() in environment and lives(int(process.name)):
                found.append(int(process.name))
        return found

    def state(self) -> dict[str, tuple[int, int]]:
        """Return all files that are there, with what changes when they are written."""
        found = {}
        for folder in (self.out, self.cache):
            for path in folder.rglob("*"):
                with contextlib.suppress(FileNotFoundError):
                    status = path.stat()
                    if stat.S_ISREG(status.st_mode):
                        found[str(path)] = status.st_ino, status.st_mtime_ns
        return found

    def began(self) -> bool:
        """Return whether the command has begun to write."""
        return self.state() != self.at_first

    def results(self) -> dict[str, bytes]:
        """Return the files in the folder of results that are not others'."""
        paths = [path for path in self.out.rglob("*") if path.is_file()]
        found = {str(path.relative_to(self.out)): path.read_bytes() for path in paths}
        return {name: data for name, data in found.items() if name not in OTHERS}

    def leftovers(self, expected: Iterable[str]) -> list[str]:
        """Return the files that are no results."""
        found = [f"out/{name}" for name in self.results() if name not in expected]
        found += [f"t/{path.name}" for path in self.tmp.iterdir()]
        return found + [f"cache/{path.name}" for path in self.cache.glob("*.part-*")]


def undisturbed(command: Sequence[str], folder: Path) -> Undisturbed:
    """Run a command twice to its end."""
    runs: list[dict[str, bytes]] = []
    first = end = 0.0
    for number in range(2):
        place = Place(folder / f"u{number}")
        begin = time.monotonic()
        process = place.start(command)
        while process.poll() is None and not place.began():
            time.sleep(_PAUSE)
        first = time.monotonic() - begin
        status = process.wait()
        end = time.monotonic() - begin
        assert status == 0, place.errors()
        runs.append(place.results())
        assert not place.leftovers(runs[-1]), place.leftovers(runs[-1])
    assert runs[0].keys() == runs[1].keys()
    return Undisturbed(runs[0], first, end)


def kill(
    command: Sequence[str],
    known: Undisturbed,
    number: signal.Signals,
    folder: Path,
    dice: random.Random,
    counts: Counts,
) -> None:
    """Kill a command once, at a random moment, and count what it leaves."""
    place = Place(folder, known.files if dice.random() < 0.5 else ())
    process = place.start(command)
    if dice.random() < 0.2:
        _wait(process, dice.uniform(0.0, known.first), lambda: False)
    else:
        _wait(process, 3.0 * known.first + PATIENCE, place.began)
        _wait(process, dice.uniform(0.0, known.end - known.first), lambda: False)
    ended, began = process.poll() is not None, place.began()
    counts.when["after" if ended else "during" if began else "before"] += 1
    with contextlib.suppress(ProcessLookupError):
        # A terminal sends Ctrl-C, and word of its end, to all processes of the group.
        if number in (signal.SIGINT, signal.SIGHUP) and not ended:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
    try:
        status = process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        status = -1000
    said, own = f"{number.name}: ", tuple(command[: len(RPS_PIN)]) != RPS_PIN
    counts.faults += [said + one for one in _faults(place, known, number, status, ended, own)]
    left = place.leftovers(known.files)
    if left and number == signal.SIGKILL:
        counts.left += 1
        counts.cleared += _next_run_clears(command, place, known, counts, left)
    elif left:
        counts.faults.append(f"{said}left {left}")


def _wait(process: subprocess.Popen[str], limit: float, condition: Callable[[], bool]) -> None:
    """Wait until something is so, a process has ended, or the time is over."""
    end = time.monotonic() + limit
    while process.poll() is None and not condition() and time.monotonic() < end:
        time.sleep(_PAUSE)


def _faults(
    place: Place,
    known: Undisturbed,
    number: signal.Signals,
    status: int,
    ended: bool,
    own: bool,
) -> Iterator[str]:
    """Yield what a kill broke, except for files that are left over."""
    end = time.monotonic() + PATIENCE
    while (living := place.processes()) and time.monotonic() < end:
        time.sleep(10 * _PAUSE)
    for process in living:
        yield f"a process lives on: {_words_of(process)}"
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    results = place.results()
    for name, data in results.items():
        if name not in known.files or data == BEFORE:
            continue
        if data != known.files[name] and not is_readable(place.out / name):
            yield f"{name} is not whole: {len(data)} bytes"
    done = all(name in results and results[name] != BEFORE for name in known.files)
    errors = place.errors()
    if "<frozen site>" in errors:  # Python itself was not ready: no code of ours had begun
        return
    if not ((status == 0 and done) or (status in (-number, 128 + number) and not ended)):
        yield f"exit status {status}, {'all' if done else 'not all'} results written"
    told = errors.count("Traceback") + errors.count("Exception ignored")
    # A script that does not catch Ctrl-C shows where it was: one traceback of one process.
    if told > (number == signal.SIGINT and errors.endswith("\nKeyboardInterrupt\n") and own):
        yield f"it printed {errors[-1500:]!r}"


def _words_of(process: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode()[:200]
    return str(process)


def _next_run_clears(
    command: Sequence[str], place: Place, known: Undisturbed, counts: Counts, left: list[str]
) -> bool:
    status = place.start(command).wait()
    still = place.leftovers(known.files)
    if status != 0:
        counts.faults.append(f"the next run: exit status {status}, {place.errors()[-1000:]}")
    if still:
        counts.faults.append(f"the next run left {still} of {left}")
    if [name for name in OTHERS if not (place.out / name).exists()]:
        counts.faults.append("the next run removed a file of others")
    return status == 0 and not still


def is_readable(path: Path) -> bool:
    """Return whether a file can be read to its end; False of kinds whose end cannot be told."""
    try:
        _READERS[path.suffix](path)
    except Exception:
        return False
    return True


def _read_csv(path: Path) -> None:
    text = path.read_text("utf-8")
    assert text.endswith("\n")
    assert len({line.count(",") for line in text.splitlines() if not line.startswith("#")}) == 1


def _read_picture(path: Path) -> None:
    with Image.open(path) as picture:
        for frame in range(getattr(picture, "n_frames", 1)):
            picture.seek(frame)
            picture.load()


def _read_text(end: str) -> Callable[[Path], None]:
    def read(path: Path) -> None:
        assert path.read_text("utf-8").rstrip().endswith(end)

    return read


def _read_h5(path: Path) -> None:
    with h5py.File(path) as file:
        file.visititems(lambda _, one: one[()] if isinstance(one, h5py.Dataset) else None)


_READERS: dict[str, Callable[[Path], object]] = {
    ".csv": _read_csv,
    ".json": lambda path: json.loads(path.read_text("utf-8")),
    ".svg": etree.parse,
    ".urdf": etree.parse,
    ".xml": etree.parse,
    ".png": _read_picture,
    ".gif": _read_picture,
    ".html": _read_text("</html>"),
    ".md": _read_text(""),
    ".h5": _read_h5,
}


def kills(
    command: Sequence[str],
    each: int,
    folder: Path,
    seed: int,
    signals: Sequence[signal.Signals] = SIGNALS,
) -> Counts:
    """Kill a command several times, by the signals in turn."""
    counts, dice = Counts(), random.Random(f"{' '.join(command)} {seed}")
    known = undisturbed(command, folder)
    for i, number in zip(range(each), itertools.cycle(signals), strict=False):
        kill(command, known, number, folder / str(i), dice, counts)
        if not counts.faults:
            shutil.rmtree(folder / str(i))
    return counts


def main() -> None:
    """Kill each command, and print a table."""
    words = argparse.ArgumentParser(prog="python -m tests.kills", description=__doc__)
    words.add_argument("--each", type=int, default=12, help="kills of each command")
    words.add_argument("--only", nargs="*", default=list(COMMANDS), help="names of commands")
    words.add_argument("--signals", nargs="*", default=[one.name for one in SIGNALS])
    words.add_argument("--seed", type=int, default=0)
    asked = words.parse_args()
    row = "{:18} {:>6} {:>7} {:>7} {:>6} {:>11} {:>8} {:>7} {:>6}"
    titles = "command", "kills", "before", "during", "after", "left by -9", "cleared", "faults", "s"
    print(row.format(*titles), flush=True)
    broken = False
    for name in asked.only:
        begin = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            signals = [signal.Signals[one] for one in asked.signals]
            counts = kills(COMMANDS[name], asked.each, Path(folder), asked.seed, signals)
        when = [counts.when[moment] for moment in ("before", "during", "after")]
        numbers = sum(when), *when, counts.left, counts.cleared, len(counts.faults)
        print(row.format(name, *numbers, round(time.monotonic() - begin)), flush=True)
        for fault, times in Counter(counts.faults).items():
            print(f"    {times} x {fault}", flush=True)
        broken = broken or bool(counts.faults)
    sys.exit(broken)


if __name__ == "__main__":
    main()
