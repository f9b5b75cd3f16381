"""Three kills of a few commands; all commands, fifty times each: ``python -m tests.kills``."""

from __future__ import annotations

import os
import signal
import sys
import textwrap
from pathlib import Path

import pytest

from rps_pin.interruption import scratch_folder
from tests.kills import COMMANDS, kills
from tests.processes import run
from tests.quick import quick

INT, TERM, HUP, KILL = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")


CASES = [("urdf", (INT, KILL, TERM)), ("convert mjcf", (KILL, HUP, INT))]


@pytest.mark.parametrize(("name", "signals"), quick(CASES, [CASES[0]]), ids=["urdf", "convert"])
def test_a_command_that_is_killed_leaves_nothing_half(
    name: str, signals: tuple[signal.Signals, ...], tmp_path: Path
) -> None:
    counts = kills(COMMANDS[name], 3, tmp_path, 0, signals)
    assert counts.faults == []
    assert counts.left == counts.cleared
    assert sum(counts.when.values()) == 3


#: Scripts that break a promise each, by what is found, and the signal that finds it.
CARELESS = {
    "a.bin is not whole": (
        TERM,
        """
        with open("out/a.bin", "wb", buffering=0) as file:
            for _ in range(20):
                file.write(bytes(100))
                time.sleep(0.01)
        """,
    ),
    "SIGTERM: left ['out/b.tmp']": (
        TERM,
        """
        Path("out/b.tmp").touch()
        time.sleep(0.2)
        Path("out/b.tmp").replace("out/b.txt")
        """,
    ),
    "the next run left ['out/.": (
        KILL,
        """
        scratch = Path(f"out/.{os.getpid()}.tmp")
        scratch.touch()
        time.sleep(0.2)
        scratch.replace("out/b.txt")
        """,
    ),
    "the next run removed a file of others": (
        KILL,
        """
        for path in Path("out").glob(".*"):
            path.unlink()
        Path("out/.b.tmp").touch()
        time.sleep(0.2)
        Path("out/.b.tmp").replace("out/b.txt")
        """,
    ),
    "SIGKILL: a process lives on: sleep 60": (
        KILL,
        """
        child = subprocess.Popen(["sleep", "60"])
        Path("out/c.txt").touch()
        time.sleep(0.2)
        child.kill()
        """,
    ),
    "SIGTERM: exit status 0, not all results written": (
        TERM,
        """
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
        Path("out/a.txt").write_text("a")
        time.sleep(0.2)
        Path("out/b.txt").write_text("b")
        """,
    ),
    "ZeroDivisionError": (
        TERM,
        """
        signal.signal(signal.SIGTERM, lambda *_: 1 / 0)
        Path("out/a.txt").touch()
        time.sleep(0.2)
        """,
    ),
}


@pytest.mark.parametrize("found", CARELESS)
def test_a_careless_script_is_found_out(
    found: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    number, text = CARELESS[found]
    modules = "import os, signal, subprocess, sys, time\nfrom pathlib import Path\n"
    script = (sys.executable, "-c", modules + textwrap.dedent(text))
    monkeypatch.setattr("tests.kills.PATIENCE", 1.0)
    faults: list[str] = []
    for seed in range(60):  # the moments are random; a slow machine needs more of them
        faults += kills(script, 1, tmp_path / str(seed), seed, [number]).faults
        if any(found in fault for fault in faults):
            return
    pytest.fail(f"not found; {faults}")


def test_what_a_killed_process_left_among_temporary_files_is_removed_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    script = """
        import os, signal
        from rps_pin.interruption import scratch_folder

        with scratch_folder() as folder:
            (folder / "large.bin").write_bytes(bytes(1000))
            os.kill(os.getpid(), signal.SIGKILL)
    """
    command = [sys.executable, "-c", textwrap.dedent(script)]
    ended = run(command, env=os.environ | {"TMPDIR": str(tmp_path)})
    assert ended.returncode == -KILL
    (left,) = tmp_path.iterdir()
    others = [tmp_path / name for name in ("rps_pin", "rps_pin-notes", left.name[:-1], "rps-pin-1")]
    for one in others:
        one.mkdir()
    link = tmp_path / f"{left.name[:-1]}{'e' if left.name[-1] == 'f' else 'f'}"
    link.symlink_to(others[0])
    with scratch_folder() as folder:
        assert folder.parent == tmp_path
        assert sorted(tmp_path.iterdir()) == sorted([*others, link, folder])
    assert sorted(tmp_path.iterdir()) == sorted([*others, link])
