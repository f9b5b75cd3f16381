"""Execute notebooks and keep their outputs, for readers who do not run them.

.venv/bin/python tools/execute_notebooks.py [NAME...]      all of notebooks/ if none is named

Frames with a page of the viewer become pictures that move, which any program shows: a page is 1 MB.
"""

import argparse
import base64
import io
import re
import threading
from html import unescape
from pathlib import Path

import nbformat
import numpy as np
from nbclient import NotebookClient
from PIL import Image

from rps_pin.viewer.files.browser import in_own_thread
from rps_pin.viewer.files.pictures import picture_style, take_pictures

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"
FRAME = re.compile(r'<iframe .*? data-duration="(.*?)" .*? srcdoc="(.*)"></iframe>', re.DOTALL)
STYLE = picture_style((760, 475), 0.75, "white", captions=True)
MOMENTS, COLOURS = 16, 96


def execute(path: Path) -> None:
    """Run a notebook in its folder, and write it with its outputs and no traces of this machine."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": NOTEBOOKS}}
    ).execute()
    for cell in notebook.cells:
        cell.metadata.clear()  # times of execution
        for output in cell.get("outputs", []):
            keep_pictures(output)
    nbformat.write(notebook, path)
    print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


def keep_pictures(output: nbformat.NotebookNode) -> None:
    """Put a picture in the place of a frame, if the output is one."""
    found = FRAME.fullmatch(output.get("data", {}).get("text/html", ""))
    if found is not None:
        del output["data"]["text/html"]
        film = film_of(unescape(found[2]), float(found[1]))
        output["data"]["image/png"] = base64.b64encode(film).decode()


def film_of(page: str, duration: float) -> bytes:
    """Return a page's motion as an animated PNG, or a pose as a PNG."""
    times = np.linspace(0.0, duration, MOMENTS if duration else 1, endpoint=False)
    taken = in_own_thread(lambda stop: drawn(page, list(times), stop))
    # One palette for all: the colours of the first, the last and two between.
    sheet = Image.fromarray(np.concatenate([np.asarray(one) for one in taken[:: MOMENTS // 4]]))
    palette = sheet.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, kmeans=1)
    first, *more = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in taken]
    moving = {"save_all": True, "append_images": more, "loop": 0} if more else {}
    file = io.BytesIO()
    first.save(file, "PNG", optimize=True, duration=1e3 * duration / len(taken), **moving)
    return file.getvalue()


def drawn(page: str, times: list[float], stop: threading.Event) -> list[Image.Image]:
    """Return the page's pictures at some times."""
    files = take_pictures(page, times, stop, STYLE)
    return [Image.open(io.BytesIO(one)).convert("RGB") for one in files]


def main() -> None:
    """Execute those named, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", type=Path)
    for path in parser.parse_args().names or sorted(NOTEBOOKS.glob("*.ipynb")):
        execute(path)


if __name__ == "__main__":
    main()
