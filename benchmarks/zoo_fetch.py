"""Fetch the packages that benchmarks/zoo.py is run on, and unpack their files, without code.

    .venv/bin/python -m benchmarks.zoo_fetch FOLDER [PACKAGE...]

The folder is outside of the repository, since robots have licences of their own. Names, versions
and licences are in benchmarks/robot_files/packages.txt; nothing is installed, nothing of the
packages is run. What is there already is not fetched again. 1.6 GB are downloaded, 4.4 GB unpacked.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from benchmarks.robot_files.packages import Package, packages

ROOT = Path(__file__).resolve().parents[1]
#: Files that no robot needs.
_LEFT_OUT = {".so", ".py", ".pyc", ".pyd", ".mp4", ".gif", ".npz", ".npy", ".js", ".html"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Fetch and unpack; return 1 if a package could not be fetched."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("names", nargs="*", metavar="PACKAGE", help="default: all")
    options = parser.parse_args(arguments)
    folder = options.folder.resolve()
    if folder.is_relative_to(ROOT):
        parser.error(f"{folder} is in the repository, which no robot of others belongs in")
    known = {one.name: one for one in packages()}
    for name in options.names:
        if name not in known:
            parser.error(f"no package {name!r}; there are: {', '.join(known)}")
    failed = [name for name in options.names or known if not fetched(known[name], folder)]
    if failed:
        print(f"not fetched: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def fetched(package: Package, folder: Path) -> bool:
    """Return whether a package's files are in a folder of its name, after fetching it."""
    target = folder / package.name
    if target.exists():
        return True
    required = f"{package.name}=={package.version}"
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "-q", "-d", scratch]
        if subprocess.run([*command, required], check=False).returncode:
            return False
        (archive,) = Path(scratch).iterdir()
        count = unpacked(archive, target)
    print(f"{required} ({package.licence}): {count} files", flush=True)
    return True


def unpacked(archive: Path, target: Path) -> int:
    """Unpack the files of a wheel or source archive, without code; return how many there are."""
    count = 0
    for name, file in _members(archive):
        path = (target / name).resolve()
        if path.suffix in _LEFT_OUT or ".so." in path.name or not path.is_relative_to(target):
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(file.read())
        count += 1
    return count


def _members(archive: Path) -> Iterator[tuple[str, IO[bytes]]]:
    if archive.suffix in (".whl", ".zip"):
        with zipfile.ZipFile(archive) as wheel:
            for entry in wheel.infolist():
                if not entry.is_dir():
                    with wheel.open(entry) as file:
                        yield entry.filename, file
        return
    with tarfile.open(archive) as source:
        for member in source:
            if (held := source.extractfile(member)) is not None:
                yield member.name, held


if __name__ == "__main__":
    sys.exit(main())
