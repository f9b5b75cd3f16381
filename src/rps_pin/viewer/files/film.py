"""Pictures one after another in one file: GIF and WebP through Pillow, MP4 through ffmpeg."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rps_pin.errors import InputError, RPSPinError
from rps_pin.viewer.files.pictures import as_array, as_image

FILMS = (".mp4", ".gif", ".webp")
"""Suffixes of the files that can be written."""


def check_film(path: Path) -> None:
    """Refuse, before anything is drawn, a film that could not be written.

    Raises
    ------
    InputError
        If the suffix is none of `FILMS`.
    RPSPinError
        If the program that writes it is missing; says how to install it.
    """
    suffix = path.suffix.lower()
    if suffix not in FILMS:
        raise InputError(f"{path.name}: a film is written as one of {', '.join(FILMS)}")
    if suffix == ".mp4":
        _import_ffmpeg()


def write_film(path: Path, pictures: Iterable[bytes], frame_rate: float, kind: str) -> None:
    """Write PNG pictures as a film of the kind that the suffix `kind` names."""
    if kind == ".mp4":
        _write_mp4(path, pictures, frame_rate)
        return
    images = [as_image(picture).convert("RGB") for picture in pictures]
    options = {"quality": 85, "method": 4} if kind == ".webp" else {"optimize": False}
    images[0].save(
        path,
        format=kind[1:].upper(),
        save_all=True,
        append_images=images[1:],
        duration=round(1000.0 / frame_rate),
        loop=0,
        **options,
    )


def _write_mp4(path: Path, pictures: Iterable[bytes], frame_rate: float) -> None:
    writer = None
    try:
        for picture in pictures:
            pixels = as_array(picture)
            # H.264 halves colours both ways: even sides only.
            pixels = pixels[: pixels.shape[0] // 2 * 2, : pixels.shape[1] // 2 * 2]
            if writer is None:
                height, width = pixels.shape[:2]
                writer = _import_ffmpeg().write_frames(
                    str(path),
                    (width, height),
                    fps=frame_rate,
                    codec="libx264",
                    quality=None,
                    output_params=["-crf", "18", "-movflags", "+faststart"],
                    macro_block_size=1,
                )
                writer.send(None)
            writer.send(pixels.tobytes())
    finally:
        if writer is not None:
            writer.close()


def _import_ffmpeg() -> Any:
    try:
        import imageio_ffmpeg  # noqa: PLC0415
    except ImportError:
        raise RPSPinError(
            "an MP4 needs ffmpeg: pip install 'rps-pin[pictures]', or write a .gif or .webp"
        ) from None
    return imageio_ffmpeg
