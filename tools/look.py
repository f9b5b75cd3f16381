"""Walk what a new user does, from a wheel in an empty folder; lay the pictures out on one page.

    make look                                     all of it, some minutes: build/look/index.html
    .venv/bin/python tools/look.py --only view    commands with this word, in what is installed

Commands are those that `rps-pin new` prints, for robots as they are and with other dimensions, and
those of the README and of the help. Each runs in a folder of its own, with the files of
`rps-pin examples`. Pages are seen in Chromium, as a desktop and as a phone show them. A command
that ends otherwise than it should is told at the end, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from playwright.sync_api import Browser, Error, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

from look_page import write_page  # noqa: E402
from site_pictures import take_site_pictures  # noqa: E402

from rps_pin.viewer.files.browser import ARGUMENTS, find_browser  # noqa: E402
from tests.cli.typed import all_commands, commands_of_new, exit_status  # noqa: E402

PLACE = ROOT / "build" / "look"
SCREENS = {"desktop": (1280, 800), "phone": (390, 844)}
PICTURES = (".png", ".svg", ".webp", ".gif")
KINDS = ("3rps", "stewart", "delta", "five-bar")
LONGEST = 400.0  # seconds of a command
#: Commands that serve a page until Ctrl-C.
SERVES = re.compile(r"rps-pin view(?!.*--(?:png|html|video))")
ADDRESS = re.compile(rb"http://\S+")


@dataclass
class Step:
    """A command that was run, and what came of it."""

    group: str
    line: str
    wanted: int = 0
    status: int | None = None
    """Exit status; None if it did not end in time."""
    seconds: float = 0.0
    output: str = ""
    pictures: list[Path] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)

    @property
    def failed(self) -> bool:
        """Whether it ended otherwise than it should, or a page of it has errors."""
        return self.status != self.wanted or bool(self.faults)


class Walk:
    """Runs commands in folders, and takes pictures of what they write and serve."""

    def __init__(self, program: Path, place: Path, browser: Browser, only: str) -> None:
        self.steps: list[Step] = []
        self._program, self._place, self._browser, self._only = program, place, browser, only
        home = place / "home"
        home.mkdir(parents=True, exist_ok=True)
        self._environment = {
            name: value for name, value in os.environ.items() if not name.startswith("PYTHON")
        } | {"COLUMNS": "100", "OPENBLAS_NUM_THREADS": "1", "PATH": self._path()}

    def _path(self) -> str:
        return f"{self._program.parent}{os.pathsep}{os.environ['PATH']}"

    def run(self, group: str, line: str, folder: Path) -> Step:
        """Run a command as typed in a folder; look at the files that are new there."""
        step = Step(group, line, exit_status(line))
        if self._only not in line:
            return step
        before = {file: file.stat().st_mtime_ns for file in files_in(folder)}
        begin = time.monotonic()
        if SERVES.match(line):
            self._serve(step, folder)
        else:
            self._call(step, folder)
        step.seconds = time.monotonic() - begin
        new = [one for one in files_in(folder) if before.get(one) != one.stat().st_mtime_ns]
        for file in new:
            if file.suffix == ".html":
                self._see(step, file.as_uri(), file.stem)
            elif file.suffix in PICTURES and not is_twin(file, new):
                step.pictures.append(self._kept(file))
        self.steps.append(step)
        ended = "FAILED" if step.failed else "ok"
        number = f"[{len(self.steps)}]"
        write_page(self._place, self.steps, [], [])  # what is there if the walk is ended
        print(f"{number:5}{ended:7}{step.seconds:6.1f} s  {len(step.pictures):2} pictures  {line}")
        return step

    def _call(self, step: Step, folder: Path) -> None:
        with subprocess.Popen(
            shlex.split(step.line),
            cwd=folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        ) as process:
            try:
                output, _ = process.communicate(timeout=LONGEST)
                step.status = process.returncode
            except subprocess.TimeoutExpired:
                process.kill()
                output, _ = process.communicate()
        step.output = output.decode("utf-8", "replace")

    def _serve(self, step: Step, folder: Path) -> None:
        """Look at the page that a command serves, and end it as Ctrl-C does."""
        log = self._place / "served.txt"
        with (
            log.open("wb") as file,
            subprocess.Popen(
                shlex.split(step.line),
                cwd=folder,
                env=self._environment | {"PYTHONUNBUFFERED": "1"},
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
            ) as process,
        ):
            address = None
            until = time.monotonic() + 60.0
            while address is None and process.poll() is None and time.monotonic() < until:
                time.sleep(0.2)
                address = ADDRESS.search(log.read_bytes())
            if address is not None:
                self._see(step, address[0].decode(), "served")
            process.send_signal(signal.SIGINT)
            try:
                step.status = process.wait(30.0)
            except subprocess.TimeoutExpired:
                process.kill()
        step.output = log.read_text("utf-8", "replace")
        if address is None:
            step.faults.append("it names no address")

    def _see(self, step: Step, address: str, name: str) -> None:
        """Take pictures of a page on each screen; errors of its scripts are faults."""
        for screen, (width, height) in SCREENS.items():
            page = self._browser.new_page(viewport={"width": width, "height": height})
            page.on("pageerror", lambda error: step.faults.append(f"the page: {error}"))
            picture = self._picture(f"{name}_{screen}.png")
            try:
                page.goto(address, timeout=60e3)
                page.wait_for_timeout(6000 if "interactive" in step.line else 2500)
                page.screenshot(path=picture, timeout=60e3)
                step.pictures.append(picture)
            except Error as error:
                step.faults.append(f"the page on a {screen}: {error.message.splitlines()[0]}")
            page.close()

    def _kept(self, file: Path) -> Path:
        picture = self._picture(file.name)
        shutil.copy(file, picture)
        return picture

    def _picture(self, name: str) -> Path:
        folder = self._place / "pictures" / f"{len(self.steps) + 1:03}"
        folder.mkdir(parents=True, exist_ok=True)
        return folder / name


def is_twin(file: Path, others: list[Path]) -> bool:
    """Return whether a file is the SVG of a PNG."""
    return file.suffix == ".svg" and file.with_suffix(".png") in others


def files_in(folder: Path) -> list[Path]:
    """Return the files below a folder."""
    return sorted(file for file in folder.rglob("*") if file.is_file())


def install(place: Path) -> Path:
    """Build the wheel, install it with its extras into a new environment; return the program."""
    python, wheels, venv = sys.executable, place / "wheel", place / "venv"
    calls: list[list[str | Path]] = [
        [python, "-m", "hatchling", "build", "--target", "wheel", "--directory", wheels],
        ["sh", ROOT / "tools/make-venv", venv],
    ]
    for call in calls:
        subprocess.run(call, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    (wheel,) = wheels.glob("*.whl")
    print(f"installing {wheel.name} ...")
    extras = f"{wheel}[compile,mjcf,panel,pictures]"
    pip = [venv / "bin/python", "-m", "pip", "install", "--quiet", "--no-compile", extras]
    subprocess.run(pip, cwd=place, check=True)
    subprocess.run(["sh", ROOT / "tools/system-libs", venv], check=True)
    return venv / "bin" / "rps-pin"


def with_other_dimensions(kind: str, folder: Path) -> None:
    """Edit the files of `rps-pin new`: a wider 3-RPS, a Stewart with a smaller platform."""
    edits: dict[str, Callable[[str], str]] = {
        "3rps": lambda text: edited(
            text,
            {
                r"^base_radius: .*": "base_radius: 0.15",
                r"^platform_radius: .*": "platform_radius: 0.08",
                r"^leg_length_limits: .*": "leg_length_limits: [0.2, 0.28]",
                r"^name: .*": "name: wide",
            },
        ),
        "stewart": lambda text: re.sub(
            r'(<joint name="platform_ball_\d_joint".*?<origin xyz=")([^"]*)',
            lambda found: found[1] + " ".join(f"{0.7 * float(x):.6g}" for x in found[2].split()),
            text,
            flags=re.DOTALL,
        ),
    }
    file = folder / ("mine.yaml" if kind == "3rps" else "mine.urdf")
    old = file.read_text("utf-8")
    new = edits[kind](old)
    assert new != old
    file.write_text(new, "utf-8")


def edited(text: str, lines: dict[str, str]) -> str:
    """Return a text with lines replaced, each of which must be there."""
    for pattern, line in lines.items():
        text, number = re.subn(pattern, line, text, flags=re.MULTILINE)
        assert number == 1, pattern
    return text


def own_robots(walk: Walk, work: Path) -> None:
    """Begin each kind of robot, and try what is printed, then with other dimensions."""
    for kind in KINDS:
        folder = work / kind
        folder.mkdir()
        group = f"rps-pin new {kind}"
        begun = walk.run(group, f"rps-pin new {kind} --output mine", folder)
        tries = commands_of_new(begun.output)
        for line in [*tries, *pictures_of(tries)]:
            walk.run(group, line, folder)
        if kind in ("3rps", "stewart") and begun.status == 0:
            with_other_dimensions(kind, folder / "mine")
            shutil.rmtree(folder / "mine-dynamics", ignore_errors=True)
            for line in [*tries, *pictures_of(tries, "edited")]:
                walk.run(f"{group}, other dimensions", line, folder)


def pictures_of(tries: list[str], name: str = "mine") -> list[str]:
    """Return commands that draw what the first of some commands shows, and its page."""
    views = [line for line in tries if line.startswith("rps-pin view")][:1]
    return [f"{line} {to}" for line in views for to in (f"--png {name}.png", f"--html {name}.html")]


def typed(walk: Walk, work: Path) -> None:
    """Run the commands of README and help, each beside the samples."""
    samples = work / "samples"
    samples.mkdir()
    call = [str(walk._program), "examples", "--output", "."]
    subprocess.run(call, cwd=samples, check=True, stdout=subprocess.DEVNULL)
    for number, line in enumerate(all_commands()):
        folder = work / f"typed_{number:02}"
        shutil.copytree(samples, folder)
        walk.run(f"README and help: {' '.join(line.split()[1:2])}", line, folder)


def main() -> int:
    """Walk; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="commands with these words, as installed")
    only = parser.parse_args().only
    begin = time.monotonic()
    # Ctrl-C ends what is started here, also where a shell without job control ignores it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if not only:
        shutil.rmtree(PLACE, ignore_errors=True)
    PLACE.mkdir(parents=True, exist_ok=True)
    program = PLACE / "venv/bin/rps-pin"
    program = program if only and program.exists() else install(PLACE)
    work = PLACE / "work"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_browser(), args=ARGUMENTS)
        walk = Walk(program, PLACE, browser, only)
        own_robots(walk, work)
        typed(walk, work)
        browser.close()
    site, ugly = [], []
    if (ROOT / "build/docs/index.html").exists() and not only:
        ugly = take_site_pictures(ROOT / "build/docs", PLACE / "site")
        site = sorted((PLACE / "site").glob("*.png"))
    page = write_page(PLACE, walk.steps, site, ugly)
    failed = [step for step in walk.steps if step.failed]
    count = sum(len(step.pictures) for step in walk.steps)
    print(
        f"\n{len(walk.steps)} commands, {count} pictures, {time.monotonic() - begin:.0f} s: {page}"
    )
    for step in failed:
        print(f"FAILED ({step.status}, not {step.wanted}): {step.line}", *step.faults, sep="\n    ")
    print(f"{len(failed)} commands failed")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
