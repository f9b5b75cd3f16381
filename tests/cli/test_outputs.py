"""One rule for all commands that write; see `rps_pin.cli.outputs`."""

from __future__ import annotations

import os
import select
import shutil
import stat
import threading
from pathlib import Path

import pytest
import typer.main
from matplotlib.figure import Figure

from rps_pin.cli.app import app, export
from rps_pin.files import write_text
from tests.cli.commands import rps_pin
from tests.each import each

ROOT = Path(__file__).parents[2]
PRESET = ROOT / "src" / "rps_pin" / "rps" / "presets" / "micro.yaml"
CIRCLE = ROOT / "docs" / "trajectories" / "circle.yaml"

#: Commands that renew a folder of results: words without --output, the folder's files.
FOLDERS = {
    "helix": ["helix", "-r", "micro", "--rate", "5"],
    "dynamics": ["dynamics", str(CIRCLE), "-r", "micro", "--rate", "5"],
    "simulate": ["simulate", "four_bar", "--duration", "0.002"],
    "workspace": ["workspace", "--points", "5"],
}
#: Commands that write a file or two: words, the options' value is the file or the folder.
FILES = {
    "urdf": (["urdf", "-r", "micro", "-o"], "x.urdf", "x.urdf"),
    "html": (["view", "--pose", "0.4", "0", "0", "--html"], "x.html", "x.html"),
    "convert": (["convert", "four_bar", "--to", "urdf", "-o"], ".", "four_bar.yaml"),
    "new": (["new", "stewart", "-o"], ".", "mine.urdf"),
    "examples": (["examples", "-o"], ".", "circle.yaml"),
    "mjcf": (["convert", "four_bar", "--to", "mjcf", "-o"], ".", "four_bar.xml"),
}


@pytest.fixture(autouse=True)
def _quick_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave figures empty: other tests look at them, and drawing takes most of the time."""
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **options: path.write_text("<svg/>"))


@pytest.mark.parametrize(("words", "value", "file"), FILES.values(), ids=FILES)
def test_a_file_that_exists_stays(words: list[str], value: str, file: str, tmp_path: Path) -> None:
    there = tmp_path / file
    there.write_text("PRECIOUS")
    ended = rps_pin(*words, value, folder=tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == f"error: {file} exists; --overwrite replaces it\n"
    assert [*tmp_path.iterdir()] == [there]
    assert there.read_text() == "PRECIOUS"
    there.chmod(0o444)
    ended = rps_pin(*words, value, "--overwrite", folder=tmp_path)
    assert ended.stderr == f"error: {file} is write-protected\n"
    there.chmod(0o644)
    ended = rps_pin(*words, value, "--overwrite", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert there.read_text() != "PRECIOUS"


@pytest.mark.parametrize("words", FOLDERS.values(), ids=FOLDERS)
def test_a_folder_of_results_is_renewed_and_others_files_stay(
    words: list[str], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "viewer.html").write_text("PRECIOUS")
    ended = rps_pin(*words, "-o", "out", "--overwrite", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    files = sorted(out.iterdir())
    if words[0] in ("helix", "simulate"):
        assert "PRECIOUS" not in (out / "viewer.html").read_text("utf-8")
        assert rps_pin(*words, "-o", "out", folder=tmp_path).returncode == 0
        assert sorted(out.iterdir()) == files
    if words[0] == "workspace":  # hours of work, perhaps
        (out / "viewer.html").unlink()
        files.remove(out / "viewer.html")
        assert rps_pin(*words, "-o", "out", folder=tmp_path).returncode == 1
    for file in files:  # all that is written is checked before the work
        alone = tmp_path / f"alone_{file.name}" / file.name
        alone.parent.mkdir()
        alone.write_text("PRECIOUS")
        ended = rps_pin(*words, "-o", alone.parent.name, folder=tmp_path)
        shown = alone.relative_to(tmp_path)
        assert ended.stderr == f"error: {shown} exists; --overwrite replaces it\n"
        assert [*alone.parent.iterdir()] == [alone]
        assert alone.read_text() == "PRECIOUS"


def test_control_and_reproduce(tmp_path: Path) -> None:
    scenario = ROOT / "docs" / "scenarios" / "micro_helix.yaml"
    for name in ("report.md", "loop.csv", "summary.json", "tracking.svg", "viewer.html"):
        file = tmp_path / f"of_{name}" / name
        file.parent.mkdir()
        file.write_text("PRECIOUS")
        ended = rps_pin("control", str(scenario), "-o", str(file.parent))
        assert ended.stderr == f"error: {file} exists; --overwrite replaces it\n"
        assert file.read_text() == "PRECIOUS"
    (tmp_path / "reproduction").mkdir()
    for name in ("reproduction.md", "reproduction/figure_7.png", "reproduction/fit.png"):
        (tmp_path / name).write_text("PRECIOUS")
        ended = rps_pin("reproduce", "--quick", "-o", str(tmp_path))
        assert ended.returncode == 1
        assert f"{name} exists; --overwrite replaces it" in ended.stderr
        (tmp_path / name).unlink()


def test_robots_of_a_design_are_checked_before_the_search(tmp_path: Path) -> None:
    described = ROOT / "examples" / "design" / "micro_motion.yaml"
    for name in (
        "least_base_radius_and_platform_radius.yaml",
        "most_stiffness.urdf",
        "front_3.urdf",
    ):
        file = tmp_path / f"of_{name}" / name
        file.parent.mkdir()
        file.write_text("PRECIOUS")
        ended = rps_pin("design", str(described), "-o", str(file.parent))
        assert ended.stderr == f"error: {file} exists; --overwrite replaces it\n"
        assert [*file.parent.iterdir()] == [file]
        assert file.read_text() == "PRECIOUS"


def test_an_input_is_never_replaced(tmp_path: Path) -> None:
    mine, circle = tmp_path / "mine.yaml", tmp_path / "dynamics.csv"
    shutil.copy(PRESET, mine)
    (tmp_path / "link.yaml").symlink_to("mine.yaml")
    os.link(mine, tmp_path / "hard.yaml")
    before = mine.read_bytes()
    for output in ("mine.yaml", "link.yaml", "hard.yaml", "./mine.yaml"):
        for more in ([], ["--overwrite"]):
            ended = rps_pin("urdf", "-r", "mine.yaml", "-o", output, *more, folder=tmp_path)
            assert ended.returncode == 1
            assert "is an input of this command" in ended.stderr
    html = rps_pin(
        *("view", "-r", "mine.yaml", "--html", "mine.yaml", "--overwrite"), folder=tmp_path
    )
    assert html.returncode == 1
    assert mine.read_bytes() == before
    words = ("dynamics", str(CIRCLE), "-r", "micro", "--rate", "10", "-o", ".")
    assert rps_pin(*words, folder=tmp_path).returncode == 0
    before = circle.read_bytes()
    again = ("dynamics", "dynamics.csv", "-r", "micro", "--rate", "5", "-o", ".", "--overwrite")
    ended = rps_pin(*again, folder=tmp_path)
    assert "dynamics.csv is an input of this command" in ended.stderr
    assert circle.read_bytes() == before
    for suffix in ("urdf", "yaml"):
        shutil.copy(ROOT / "urdf" / f"four_bar.{suffix}", tmp_path)
    before = (tmp_path / "four_bar.urdf").read_bytes()
    ended = rps_pin(
        *("convert", "four_bar.yaml", "--to", "urdf", "-o", ".", "--overwrite"), folder=tmp_path
    )
    assert ended.returncode == 1  # the URDF that the description names, too
    assert "is an input of this command" in ended.stderr
    assert (tmp_path / "four_bar.urdf").read_bytes() == before


def test_a_device_is_written_to(tmp_path: Path) -> None:
    before = Path("/dev/null").stat()
    ended = rps_pin("urdf", "-r", "micro", "-o", "/dev/null")
    assert ended.returncode == 0, ended.stderr
    after = Path("/dev/null").stat()
    assert stat.S_ISCHR(after.st_mode)
    assert (after.st_ino, after.st_rdev) == (before.st_ino, before.st_rdev)
    if Path("/dev/full").exists():
        ended = rps_pin("urdf", "-r", "micro", "-o", "/dev/full")
        assert ended.returncode == 1
        assert "No space left" in ended.stderr
        assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)


def test_a_fifo_is_written_to_if_somebody_reads(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    ended = rps_pin("urdf", "-r", "micro", "-o", str(fifo))
    assert ended.returncode == 1
    assert "nobody reads from this FIFO" in ended.stderr
    said: list[str] = []
    reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
    os.set_blocking(reader, True)

    def read() -> None:
        waiting = select.poll()
        waiting.register(reader, select.POLLIN)
        waiting.poll(10_000)  # before the first byte it would be the end
        with os.fdopen(reader) as file:
            said.append(file.read())

    thread = threading.Thread(target=read)
    text = "long " * 100_000 + "\n"  # more than a pipe holds
    writer = threading.Thread(target=write_text, args=(fifo, text))
    writer.start()
    thread.start()
    writer.join(10)
    thread.join(10)
    assert said == [text]
    assert fifo.is_fifo()


def test_a_link_stays_and_its_file_is_replaced(tmp_path: Path) -> None:
    real, link = tmp_path / "real.urdf", tmp_path / "link.urdf"
    real.write_text("old")
    link.symlink_to("real.urdf")
    words = ("urdf", "-r", "micro", "-o", str(link))
    assert "exists; --overwrite replaces it" in rps_pin(*words).stderr
    assert real.read_text() == "old"
    assert rps_pin(*words, "--overwrite").returncode == 0
    assert link.is_symlink()
    assert "<robot" in real.read_text()
    real.unlink()
    assert rps_pin(*words).returncode == 1  # the link is there
    assert rps_pin(*words, "--overwrite").returncode == 0
    assert link.is_symlink()
    assert "<robot" in real.read_text()


def test_folders_and_open_files_are_refused(tmp_path: Path) -> None:
    ended = rps_pin("urdf", "-o", str(tmp_path), "--overwrite")
    assert "is a folder: no file can be written there" in ended.stderr
    with (tmp_path / "a.txt").open("w") as file:
        path = f"/dev/fd/{file.fileno()}"
        ended = rps_pin("urdf", "-o", path, "--overwrite")
    assert ended.returncode == 1
    assert "a.txt: name that file itself" in ended.stderr


SAMPLES = ROOT / "src" / "rps_pin" / "cli" / "samples"
#: All commands that write: words; the last is where to.
EVERY = {
    **{name: [*words, "-o"] for name, words in FOLDERS.items()},
    **{name: words for name, (words, _, _) in FILES.items()},
    "control": ["control", str(ROOT / "docs" / "scenarios" / "micro_helix.yaml"), "-o"],
    "reproduce": ["reproduce", "--quick", "-o"],
    "export c": ["export", "c", "four_bar", "-o"],
    "design": ["design", str(ROOT / "examples" / "design" / "micro_motion.yaml"), "-o"],
    "calibrate": ["calibrate", str(SAMPLES / "readings.csv"), "-m", "five_bar", "-o"],
    "identify": ["identify", str(SAMPLES / "log.csv"), "-m", "five_bar", "-o"],
    "tolerance": [
        *("tolerance", str(SAMPLES / "drawing.yaml")),
        *("-m", "five_bar", "-o"),
    ],
    "stiffness": [
        *("stiffness", str(SAMPLES / "drives.yaml"), "-m", "five_bar"),
        *("--over", "x=0.1:0.3:2", "--over", "z=0.4:0.6:2", "-o"),
    ],
    "png": ["view", "--png"],
    "video": ["view", "--video"],
}


def test_every_command_that_writes_is_tried() -> None:
    top, inner = (typer.main.get_group(one).list_commands(None) for one in (app, export))  # type: ignore[arg-type]
    names = [*top, *(f"export {name}" for name in inner)]
    helps = {name: rps_pin(*name.split(), "--help").stdout for name in names}
    found = {name for name, text in helps.items() if "--output " in text or "--html " in text}
    tried = {" ".join(words[: 2 if words[0] == "export" else 1]) for words in EVERY.values()}
    assert found == tried


@each("name", EVERY)
def test_a_file_in_place_of_a_folder_is_told_before_the_work(name: str, tmp_path: Path) -> None:
    """And a loop of links, and a folder that is missing; nothing is made or changed."""
    file, loop = tmp_path / "file", tmp_path / "loop"
    file.write_text("PRECIOUS")
    if not loop.is_symlink():
        loop.symlink_to(loop)
    words, suffix = EVERY[name], {"png": ".png", "video": ".gif"}.get(name, "")
    if suffix:
        (tmp_path / f"loop{suffix}").symlink_to(f"loop{suffix}")
    given = {f"loop{suffix}": "Too many levels"}
    if name in ("urdf", "html", "png", "video"):
        given[f"file/x{suffix}"] = "file is a file: file/x"
    else:
        given["file"] = "file is a file: file"
    before = sorted(tmp_path.iterdir())
    for value, reason in given.items():
        ended = rps_pin(*words, value, "--overwrite", folder=tmp_path)
        assert ended.returncode == 1, ended
        assert ended.stderr.startswith("error: "), ended
        assert reason in ended.stderr, ended
        assert ended.stdout == ""
    assert file.read_text() == "PRECIOUS"
    assert sorted(tmp_path.iterdir()) == before


def test_what_is_no_file_among_the_results_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "simulation.csv").mkdir(parents=True)
    words = (*FOLDERS["simulate"], "-o", "out", "--overwrite")
    ended = rps_pin(*words, folder=tmp_path)
    assert "simulation.csv is a folder: no file can be written there" in ended.stderr
    (out / "simulation.csv").rmdir()
    (out / "simulation.csv").symlink_to("/dev/null")
    (out / "viewer.html").symlink_to("../elsewhere.html")
    ended = rps_pin(*words, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert (out / "simulation.csv").readlink() == Path("/dev/null")
    assert (out / "viewer.html").is_symlink()
    assert (tmp_path / "elsewhere.html").read_text("utf-8").startswith("<!DOCTYPE html>")


def test_unusual_names(tmp_path: Path) -> None:
    ended = rps_pin("urdf", "-o", "-", folder=tmp_path)
    assert ended.stdout == rps_pin("urdf").stdout
    assert list(tmp_path.iterdir()) == []
    for name in ("two\nlines.urdf", " ", "-o.urdf", "*.urdf", "bad\udcff.urdf"):
        ended = rps_pin("urdf", f"--output={name}", folder=tmp_path)
        assert (ended.returncode, ended.stderr) == (0, "")
        assert "<robot" in (tmp_path / name).read_text()
        ended = rps_pin("urdf", f"--output={name}", folder=tmp_path)
        assert ended.returncode == 1
        assert ended.stderr.count("\n") == 1
    assert len(list(tmp_path.iterdir())) == 5
