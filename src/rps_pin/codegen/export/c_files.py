"""Files of exported C: their texts, and how they are written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from rps_pin.codegen.export.header import MARK, header, heading
from rps_pin.codegen.export.package import Package
from rps_pin.codegen.export.page import cmake, page
from rps_pin.codegen.export.self_test import self_test
from rps_pin.errors import InputError
from rps_pin.files import write_text

#: So many characters at the beginning of a file tell whether it was exported.
_BEGINNING = 400


def c_files(package: Package) -> dict[str, str]:
    """Return the texts of a package's files, by their names."""
    name = package.name
    begin = heading(package, f"{name}.c", f"the functions that {name}.h declares")
    return {
        f"{name}.h": header(package),
        f"{name}.c": package.unit.c99(package.real, heading=f'{begin} */\n#include "{name}.h"\n'),
        f"{name}_test.c": self_test(package),
        "CMakeLists.txt": cmake(package),
        "README.md": page(package),
    }


def write_c_files(
    texts: Mapping[str, str], folder: str | os.PathLike[str], *, overwrite: bool = False
) -> list[Path]:
    """Write files into a folder, which is made, and return their paths.

    All texts are there before the first is written, and each is written whole or not at all. Files
    that were exported before are replaced.

    Parameters
    ----------
    texts
        By file name.
    folder
        Where to.
    overwrite
        Replace other files too.

    Raises
    ------
    InputError
        If there is a file of the same name that was not exported, and `overwrite` is false: nothing
        is written then.
    """
    target = Path(folder)
    paths = [target / name for name in texts]
    others = [str(path) for path in paths if not overwrite and _is_another(path)]
    if others:
        raise InputError(
            f"{', '.join(others)}: there already, and not {MARK}; nothing was written. Choose "
            "another folder, or overwrite"
        )
    target.mkdir(parents=True, exist_ok=True)
    for path, text in zip(paths, texts.values(), strict=True):
        write_text(path, text)
    return paths


def _is_another(path: Path) -> bool:
    """Return whether there is something that was not exported."""
    if not path.is_file():
        return path.exists() or path.is_symlink()
    with path.open("rb") as file:
        beginning = file.read(_BEGINNING).decode("utf-8", "replace")
    return " ".join(MARK.split()) not in " ".join(beginning.split())
