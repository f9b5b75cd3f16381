"""Every robot file below a folder tried: what loads, what agrees with MuJoCo, what is refused, why.

    .venv/bin/python benchmarks/zoo.py FOLDER... [--sample 150] [--json FILE] [--markdown]

Robot files are told by their content: URDF, MJCF, and descriptions of mechanisms (YAML). Each is
loaded, described, closed, held (inverse dynamics at rest), accelerated (forward dynamics) and moved
by one step, in a process of its own with a limit of time; beside it runs MuJoCo where it compiles
the file. One line is printed for each, then the totals by cause. `--markdown` prints tables alone.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from benchmarks.robot_files.find import APART as KINDS_APART
from benchmarks.robot_files.find import RobotFile, robot_files
from benchmarks.robot_files.totals import Tried, by_package, causes, line, table
from benchmarks.robot_files.trial import CRASHED, TIMEOUT, Trial, tried

#: A new process starts as a copy of this one, which has everything imported.
_FORK = multiprocessing.get_context("fork")


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the files, print lines and totals."""
    options = _options(arguments)
    files = robot_files(options.folders)
    apart = Counter(one.kind for one in files if one.kind in KINDS_APART)
    files = [one for one in files if one.kind not in KINDS_APART]
    if options.sample and options.sample < len(files):
        files = random.Random(options.seed).sample(files, options.sample)
        files.sort(key=lambda one: one.shown)
    found = []
    for one in _trials(files, options.processes, options.limit):
        found.append(one)
        if not options.markdown:
            print(line(one), flush=True)
    found.sort(key=lambda one: one.shown)
    if options.json:
        entries = [{"file": o.shown, "kind": o.kind, **o.trial.as_dict()} for o in found]
        content = json.dumps({"apart": apart, "files": entries}, indent=1)
        options.json.write_text(content, encoding="utf-8")
    print(f"\n{table(found)}\n\n{by_package(found)}\n")
    for kind, count in apart.items():
        print(f"- {count} counted apart: {kind} ({KINDS_APART[kind]})")
    for cause in causes(found):
        print(f"- {len(cause.files)}: {cause.what} (such as {cause.files[0]})")
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="or a file")
    parser.add_argument("--sample", type=int, metavar="N", help="try N files, chosen at random")
    parser.add_argument("--seed", type=int, default=0, help="of the choice")
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="at once")
    parser.add_argument("--limit", type=float, default=60.0, metavar="S", help="for a file, s")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all results to a file")
    parser.add_argument("--markdown", action="store_true", help="print totals only")
    return parser.parse_args(arguments)


def _trials(files: Sequence[RobotFile], processes: int, limit: float) -> Iterator[Tried]:
    """Try files, a few at once, each in a process of its own."""
    waiting = list(reversed(files))
    running: dict[Connection, tuple[Any, RobotFile, float]] = {}
    while waiting or running:
        while waiting and len(running) < processes:
            one = waiting.pop()
            ours, theirs = _FORK.Pipe(duplex=False)
            process = _FORK.Process(target=_child, args=(theirs, one), daemon=True)
            process.start()
            theirs.close()
            running[ours] = process, one, time.monotonic() + limit
        ready = wait(list(running), timeout=0.2)
        for end in list(running):
            process, one, deadline = running[end]
            if end in ready:
                trial = _received(end, process)
            elif time.monotonic() > deadline:
                process.kill()
                trial = Trial(TIMEOUT, "load", f"took more than {limit:g} s")
            else:
                continue
            process.join()
            end.close()
            del running[end]
            yield Tried(one.shown, one.kind, trial)


def _child(end: Connection, one: RobotFile) -> None:
    """Send the result; what libraries print, and MuJoCo's log, are dropped."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        end.send(tried(one))
    end.close()


def _received(end: Connection, process: Any) -> Trial:
    try:
        trial: Trial = end.recv()
    except EOFError:
        process.join()
        return Trial(CRASHED, "load", f"the process ended with status {process.exitcode}")
    return trial


if __name__ == "__main__":
    sys.exit(main())
