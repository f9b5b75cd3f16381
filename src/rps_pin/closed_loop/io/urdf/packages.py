"""Where the files are that a URDF names: ``package://`` by the rules of ROS, and plain paths.

A package is looked for in this order: the folders that are given; the folders above the URDF, and
beside them; ``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH`` and ``CMAKE_PREFIX_PATH``; the URDF's own
folder. A folder is the package if its ``package.xml`` says so, or it has the package's name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

from rps_pin.errors import InputError
from rps_pin.files import is_file, is_folder

_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_URI = re.compile(r"\A([a-z][a-z0-9+.-]+)://(.*)\Z", re.IGNORECASE | re.DOTALL)
_LARGEST_MANIFEST = 2**20


def file_of(name: str, urdf: Path, package_path: Sequence[str | os.PathLike[str]] = ()) -> Path:
    """Return the path of a file that a URDF names.

    Parameters
    ----------
    name
        As it stands in the URDF.
    urdf
        The URDF's path.
    package_path
        Folders that are packages, or hold some.

    Raises
    ------
    InputError
        If there is no such file; says where it was looked for.
    """
    uri = _URI.match(name)
    scheme, rest = (uri[1].lower(), unquote(uri[2])) if uri else ("", name)
    if scheme in ("package", "model"):
        return _in_package(name, rest, urdf, package_path)
    if scheme not in ("", "file"):
        raise InputError(f"{name!r}: {scheme}:// is not read, only package:// and files")
    found = urdf.parent / rest
    if is_file(found):
        return found
    raise InputError(f"{name!r}: no file {found}")


def _in_package(
    name: str, rest: str, urdf: Path, package_path: Sequence[str | os.PathLike[str]]
) -> Path:
    package, _, inside = rest.partition("/")
    folders = []
    for folder in _folders(package, urdf, package_path):
        if is_file(folder / inside):
            return folder / inside
        folders.append(folder)
    if is_file(urdf.parent / inside):
        return urdf.parent / inside
    if folders:
        raise InputError(f"{name!r}: package {package!r} has no file {inside!r} ({folders[0]})")
    raise InputError(
        f"{name!r}: no package {package!r}: neither in the folders given (--package-path, "
        "package_path), nor above the URDF, nor in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH or "
        "CMAKE_PREFIX_PATH"
    )


def _folders(
    package: str, urdf: Path, package_path: Sequence[str | os.PathLike[str]]
) -> Iterator[Path]:
    """Yield the folders that are a package, in the order of the search."""
    above = [parent for parent in urdf.absolute().parents if parent != parent.parent]
    for folder in (*map(Path, package_path), *above, *_entries("ROS_PACKAGE_PATH")):
        if _is_package(folder, package):
            yield folder
        yield from (one for one in (folder / package, folder / "src" / package) if is_folder(one))
        yield from _below(folder, package) if folder not in above else ()
    for variable in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        for prefix in _entries(variable):
            if is_folder(prefix / "share" / package):
                yield prefix / "share" / package


def _entries(variable: str) -> list[Path]:
    text = os.environ.get(variable, "")
    return [Path(entry) for entry in text.split(os.pathsep) if entry]


def _below(folder: Path, package: str) -> Iterator[Path]:
    """Yield the packages of a name in the folders of a folder."""
    try:
        inside = sorted(one for one in folder.iterdir() if one.is_dir())
    except OSError:
        return
    for one in inside:
        if one.name != package and _is_package(one, package):
            yield one
        if is_folder(one / package):
            yield one / package


def _is_package(folder: Path, package: str) -> bool:
    manifest = folder / "package.xml"
    if not is_file(manifest):
        return folder.name == package
    try:
        with manifest.open("rb") as file:
            text = file.read(_LARGEST_MANIFEST).decode("utf-8", "replace")
    except OSError:
        return folder.name == package
    named = _NAME.search(text)
    return folder.name == package or (named is not None and named[1] == package)
