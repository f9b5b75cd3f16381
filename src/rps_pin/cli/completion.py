"""Shell completion: names of presets and mechanisms, and files."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import resources
from pathlib import Path

_FILES = (".yaml", ".yml", ".xml")
#: The folder of the package's mechanisms.
MECHANISMS = Path(str(resources.files("rps_pin"))) / "urdf"


def mechanism_names() -> list[str]:
    """Return the names of the package's mechanisms."""
    return sorted(path.stem for path in MECHANISMS.glob("*.yaml"))


def preset_names() -> list[str]:
    """Return the names of the 3-RPS presets."""
    from rps_pin.rps.parameters import RPSParameters

    return sorted(RPSParameters.presets())


def names_or_files(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return a completion of these names, folders, and files of the kinds that are read."""

    def complete(incomplete: str) -> list[str]:
        known = [name for name in names() if name.startswith(incomplete)]
        folder, _, begun = incomplete.rpartition("/")
        place = Path(folder or ("/" if incomplete.startswith("/") else "."))
        prefix = f"{folder}/" if "/" in incomplete else ""
        files = [
            f"{prefix}{path.name}{'/' if path.is_dir() else ''}"
            for path in sorted(place.glob("*"))
            if path.name.startswith(begun)
            and (path.suffix.lower() in _FILES or (path.is_dir() and path.name[0] != "."))
        ]
        return known + files

    return complete
