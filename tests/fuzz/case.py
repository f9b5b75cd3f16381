"""A case: files, or a command, or a call; and what became of it."""

from __future__ import annotations

import base64
import json
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rps_pin.errors import RPSPinError

LOADED, REFUSED, FINDING, LONG = "loaded", "refused", "finding", "interrupted"


@dataclass(frozen=True)
class Case:
    """One input.

    Attributes
    ----------
    files
        By name; those of one format begin with the file that is read.
    arguments
        Of a command, or the name of a call and of its values.
    must_refuse
        Why it would be wrong to take it; empty where it may be taken.
    """

    format: str
    files: dict[str, bytes] = field(default_factory=dict)
    arguments: tuple[str, ...] = ()
    must_refuse: str = ""

    def put(self, folder: Path) -> Path:
        """Write the files; return the first one's path."""
        paths = [folder / name for name in self.files]
        for path, content in zip(paths, self.files.values(), strict=True):
            path.write_bytes(content)
        return paths[0] if paths else folder

    def to_json(self) -> str:
        """Return it as JSON; a file that is no text is in base64."""
        return json.dumps(
            {
                "format": self.format,
                "arguments": self.arguments,
                "must_refuse": self.must_refuse,
                "files": {name: _as_text(content) for name, content in self.files.items()},
            },
            indent=1,
        )

    @classmethod
    def from_json(cls, text: str) -> Case:
        """Return the case of `to_json`."""
        given = json.loads(text)
        files = {name: _as_bytes(content) for name, content in given["files"].items()}
        return cls(given["format"], files, tuple(given["arguments"]), given["must_refuse"])


def _as_text(content: bytes) -> str | list[str]:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return [base64.b64encode(content).decode("ascii")]


def _as_bytes(content: str | list[str]) -> bytes:
    return content.encode("utf-8") if isinstance(content, str) else base64.b64decode(content[0])


class WrongAnswerError(AssertionError):
    """Something was taken that should not be, or an answer is wrong or not finite."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case."""

    kind: str
    """`LOADED`, `REFUSED`, `LONG` (a long command that Ctrl-C ended) or `FINDING`."""
    message: str = ""
    place: str = ""
    """Of a finding: what it is by, such as the last line of the package."""


def judged(case: Case, folder: Path, use: Callable[[Case, Path], Any]) -> Outcome:
    """Return what becomes of a case that is used in a folder."""
    try:
        use(case, folder)
    except RPSPinError as error:
        if not str(error).strip():
            return Outcome(FINDING, f"{type(error).__name__} without a message", _place(error))
        return Outcome(REFUSED, str(error))
    except WrongAnswerError as error:
        return Outcome(FINDING, str(error), str(error).partition(":")[0])
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        words = f"{type(error).__name__}: {error}"
        return Outcome(FINDING, words, f"{type(error).__name__} {_place(error)}")
    if case.must_refuse:
        return Outcome(FINDING, f"taken: {case.must_refuse}", f"taken: {case.must_refuse}")
    return Outcome(LOADED)


def _place(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "rps_pin" in Path(frame.filename).parts]
    last = (own or frames)[-1]
    return f"{Path(last.filename).name}:{last.name}"


def require_finite(values: Any, what: str) -> None:
    """Raise `WrongAnswerError` if numbers are not finite."""
    if not np.isfinite(np.asarray(values, dtype=float)).all():
        raise WrongAnswerError(f"{what} not finite: {values}")
