"""The packages of which robot files are tried: names, versions, licences."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

LIST = Path(__file__).with_name("packages.txt")


class Package(NamedTuple):
    """A package as it was tried."""

    name: str
    version: str
    licence: str


def packages() -> list[Package]:
    """Return the packages, in the order of their names."""
    lines = [line for line in LIST.read_text("utf-8").splitlines() if not line.startswith("#")]
    found = []
    for line in lines:
        required, _, licence = line.partition("  # ")
        name, _, version = required.partition("==")
        found.append(Package(name, version, licence))
    return found
