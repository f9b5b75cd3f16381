"""The cache: libraries that were built and proven, each in a folder of its own.

A library is built in a folder beside, proven there, and then renamed, so that the cache has proven
libraries only. Its digest is compared at each load. One lock for each keeps two processes from
building the same; the system frees the lock of a process that is killed.

Read without a lock, so that a cache that cannot be written to serves too. Where writing fails, a
folder of this process takes its place, with a warning.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import shutil
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import platformdirs
from filelock import FileLock, Timeout

from rps_pin.codegen.build.library import FILE, Library, load
from rps_pin.codegen.build.source import Source

#: The environment variable that names the folder.
VARIABLE = "RPS_PIN_CACHE"
#: Beyond this, bytes, those go that were used the longest time ago.
LARGEST = 2**30
_DAY = 86400.0
_RECORD, _TEXTS, _PART = "record.json", "texts.json", ".part-"
_private = threading.Lock()


def cache_folder() -> Path:
    """Return where libraries are kept: ``RPS_PIN_CACHE``, or the user's folder for caches."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).absolute()
    # Of a user without a home, platformdirs would name a folder "~" in the current one.
    found = Path(platformdirs.user_cache_dir("rps-pin"))
    return found if found.is_absolute() else Path("/dev/null/rps-pin")


def clear() -> int:
    """Remove what the cache holds; return how many libraries that were. Loaded ones stay loaded."""
    folder = cache_folder()
    removed = sum(_remove(entry) for entry in _entries(folder))
    for file in folder.glob("*.lock"):
        held = FileLock(file)
        with suppress(OSError), held.acquire(timeout=0):  # Timeout is an OSError
            file.unlink()
    return removed


def usage() -> tuple[int, int]:
    """Return how many libraries the cache holds, and their size in bytes."""
    sizes = [_size(entry) for entry in _entries(cache_folder())]
    return len(sizes), sum(sizes)


def find(folder: Path, source: Source, key: str | None = None) -> Library | None:
    """Return a proven library of a system compiler, the one used last; nothing if there is none.

    Of the compiler whose `key` is given, or of any.
    """
    entries = [entry for entry in _entries(folder) if entry.name.startswith(f"{source.key}-")]
    for entry in sorted(entries, key=_used, reverse=True):
        if key is None or entry.name == f"{source.key}-{key}":
            library = _load(entry, source)
            if library is not None:
                return library
    return None


def find_texts(folder: Path, source: Source, key: str) -> dict[str, Any] | None:
    """Give a source its proven texts, which are compiled anew in each process; return the proof.

    Nothing if there are none.
    """
    entry = folder / f"{source.key}-{key}"
    try:
        texts = (entry / _TEXTS).read_bytes()
    except OSError:
        return None
    found = _read(entry, texts)
    if found is None:
        return None
    source.recall(tuple(json.loads(texts)))
    return dict(found["proof"])


def keep_texts(folder: Path, source: Source, key: str, library: Library) -> None:
    """Keep the texts of such code, and its proof; OSError if that fails."""
    with lock(folder, source, key, 1.0, lambda: None), new_part(folder, source, key) as part:
        (part / _TEXTS).write_text(json.dumps(source.units), "utf-8")
        keep(part, source, key, library, _TEXTS)


@contextmanager
def lock(
    folder: Path, source: Source, key: str, limit: float, watch: Callable[[], None]
) -> Iterator[None]:
    """Keep other processes and threads from building the same; wait until they have built it.

    Raises
    ------
    OSError
        If the folder cannot be written to, or the lock is not free within `limit`, s.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    held = FileLock(folder / f"{source.key}-{key}.lock")
    pause = 0.05
    for _ in range(1 + int(limit / pause)):
        try:
            held.acquire(timeout=pause, poll_interval=pause / 5)
            break
        except Timeout:
            watch()
    else:
        raise TimeoutError(f"another process held {held.lock_file} for more than {limit:g} s")
    try:
        yield
    finally:
        held.release()


@contextmanager
def new_part(folder: Path, source: Source, key: str) -> Iterator[Path]:
    """Give a new folder to build in; it is removed at the end, unless it was kept.

    Hold the lock: what a killed process left is removed.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    start = f"{source.key}-{key}{_PART}"
    for left in folder.glob(f"{start}*"):
        shutil.rmtree(left, ignore_errors=True)
    part = Path(tempfile.mkdtemp(prefix=start, dir=folder))
    try:
        yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)


def keep(part: Path, source: Source, key: str, library: Library, made: str = FILE) -> None:
    """Put a file that was made and proven into the cache; OSError if that fails."""
    entry = part.parent / f"{source.key}-{key}"
    for file in part.iterdir():
        if file.name != made:
            file.unlink()
    about = {"name": source.name, "compiler": library.compiler, "proof": library.proof}
    about["built"] = datetime.now(UTC).isoformat(timespec="seconds")
    record = {"digest": _digest((part / made).read_bytes(), about), **about}
    (part / _RECORD).write_text(json.dumps(record, indent=1), "utf-8")
    if entry.exists():  # it was damaged, or it would have been loaded
        _remove(entry)
    part.rename(entry)
    _make_room(entry)


@functools.cache
def _own() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="rps-pin-")


def fall_back(reason: OSError) -> Path:
    """Return a folder that goes with this process, and warn that the cache could not be used."""
    with _private:
        own = Path(_own().name)
    words = reason.strerror or str(reason).rpartition(": ")[2]  # without what changes each time
    warnings.warn(
        f"the cache folder {cache_folder()} cannot be used ({words}): what is "
        f"built is kept in {own} until this process ends. Set {VARIABLE} to a folder that can be "
        "written to",
        RuntimeWarning,
        stacklevel=2,
    )
    return own


def _load(entry: Path, source: Source) -> Library | None:
    try:
        found = _read(entry, (entry / FILE).read_bytes())
        if found is None:
            return None
        library = load(entry / FILE, source.functions, found["compiler"])
    except OSError:  # no library, or it was removed meanwhile
        return None
    library.proof = found["proof"]
    return library


def _read(entry: Path, code: bytes) -> dict[str, Any] | None:
    """Return an entry's record if it is whole, and note that it was used."""
    try:
        record = json.loads((entry / _RECORD).read_text("utf-8"))
        wanted = record.pop("digest")
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        return None
    if wanted != _digest(code, record):
        return None
    with suppress(OSError):  # it may be read-only
        os.utime(entry / _RECORD)
    return dict(record)


def _digest(code: bytes, about: Mapping[str, Any]) -> str:
    text = json.dumps(about, sort_keys=True).encode()
    return hashlib.sha256(hashlib.sha256(code).digest() + text).hexdigest()


def _entries(folder: Path) -> list[Path]:
    try:
        return [one for one in folder.iterdir() if one.is_dir() and _PART not in one.name]
    except OSError:
        return []


def _used(entry: Path) -> float:
    found = _status(entry / _RECORD)
    return 0.0 if found is None else found.st_mtime


def _size(entry: Path) -> int:
    found = (_status(file) for file in entry.glob("*"))
    return sum(one.st_size for one in found if one is not None)


def _status(file: Path) -> os.stat_result | None:
    """Return the status of a file or folder; None if another process removed it meanwhile."""
    try:
        return file.stat()
    except OSError:
        return None


def _make_room(newest: Path) -> None:
    """Remove what killed processes left, and what was used the longest time ago if need be."""
    for part in newest.parent.glob(f"*{_PART}*"):
        found = _status(part)
        if found is not None and time.time() - found.st_mtime > _DAY:
            shutil.rmtree(part, ignore_errors=True)
    entries = sorted(_entries(newest.parent), key=_used)
    sizes = [_size(entry) for entry in entries]
    excess = sum(sizes) - LARGEST
    for entry, size in zip(entries, sizes, strict=True):
        if excess > 0 and entry != newest:
            excess -= size
            _remove(entry)


def _remove(entry: Path) -> bool:
    """Remove an entry at one blow: who reads it meanwhile finds all of it, or nothing."""
    try:
        gone = Path(tempfile.mkdtemp(prefix=f"{entry.name}{_PART}", dir=entry.parent))
        entry.rename(gone / "entry")
    except OSError:
        return False
    shutil.rmtree(gone, ignore_errors=True)
    return True
