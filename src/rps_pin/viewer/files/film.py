"""Films from pictures, written by imageio: GIF and WebP through Pillow, MP4 through ffmpeg."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rps_pin.errors import InputError, RPSPinError
from rps_pin.viewer.files.pictures import pixels_of

FILMS = (".mp4", ".gif", ".webp")
"""Suffixes of the files that can be written."""


def check_film(path: Path) -> None:
    """Refuse, before anything is drawn, a film that could not be written.

    Raises
    ------
    InputError
        If the suffix is none of `FILMS`.
    RPSPinError
        If imageio or its ffmpeg is not installed; says how to install them.
    """
    suffix = path.suffix.lower()
    if suffix not in FILMS:
        raise InputError(f"{path.name}: a film is written as one of {', '.join(FILMS)}")
    _imageio()


def write_film(path: Path, pictures: Iterable[bytes], frame_rate: float) -> None:
    """Write PNG pictures as a film of the kind that the path's suffix names."""
    kind = path.suffix.lower()
    options: dict[str, Any] = {"duration": round(1000.0 / frame_rate), "loop": 0}
    if kind == ".mp4":
        options = {"fps": frame_rate, "codec": "libx264", "quality": None, "macro_block_size": 1}
        options["output_params"] = ["-crf", "18", "-movflags", "+faststart"]
    elif kind == ".webp":
        options |= {"quality": 85, "method": 4}
    if kind == ".mp4":
        _write(path, pictures, 2, **options)  # H.264 halves the colours' resolution
        return
    # Pillow writes when it closes: where that fails, the file would stay open.
    whole = io.BytesIO()
    _write(whole, pictures, 1, format=kind, **options)
    path.write_bytes(whole.getbuffer())


def _write(target: Path | io.BytesIO, pictures: Iterable[bytes], even: int, **options: Any) -> None:
    """Write pictures whose sides are cut to multiples of a number of pixels."""
    with _imageio().get_writer(target, **options) as film:
        for picture in pictures:
            pixels = pixels_of(picture)
            height, width = (side // even * even for side in pixels.shape[:2])
            film.append_data(pixels[:height, :width])


def _imageio() -> Any:
    try:
        import imageio.v2  # noqa: PLC0415
        import imageio_ffmpeg  # noqa: F401, PLC0415
    except ImportError:
        raise RPSPinError("films need imageio: pip install 'rps-pin[pictures]'") from None
    return imageio.v2
