"""The live scene of the front page, written by ``translucent.write_page``; a picture where no viewer is built."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import translucent as tl
from translucent.assets import mesh_path, web_path

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: Bytes that a live page may have.
MOST_BYTES = 1_000_000

PICTURE = """<!doctype html>
<html lang="en">
<title>translucent</title>
<style>body {{ margin: 0 }} img {{ width: 100%; height: 100vh; object-fit: contain }}</style>
<img src="{file}" alt="Gummy bears in three colors">
"""


def write_live_page(scene: tl.Scene, path: Path, **choices: Any) -> int:
    """Write a live page and return its bytes; raises `ValueError` if they are more than `MOST_BYTES`."""
    tl.write_page(scene, path, **choices)
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(
            f"live page {path.name}: it has {size} bytes, more than {MOST_BYTES}; use fewer triangles or cells"
        )
    return size


def write_scene(path: Path) -> None:
    """Write a bear of green glass before a studio, without a ground: what a weak graphics card can turn."""
    size = (960, 600)
    studio = tl.Environment.studio().with_background(tl.Environment.constant((0.8, 0.8, 0.8)))
    bear = tl.load_mesh(mesh_path("bear"))
    scene = tl.showcase(bear, "#5fbf8f", distance=0.006, size=size, environment=studio, stage="none")
    write_live_page(scene, path, size=size)


def write_live(app: Sphinx, exception: Exception | None) -> None:
    """Write ``live.html`` beside the front page, which shows it in a frame."""
    if exception or app.builder.name != "html":
        return
    path = Path(app.outdir) / "live.html"
    try:
        web_path("page.js")
    except tl.InputError:  # built by npm, which is not on every machine
        picture = Path(app.srcdir) / "gallery" / "bears.png"
        (path.parent / "live.png").write_bytes(picture.read_bytes())
        path.write_text(PICTURE.format(file="live.png"), encoding="utf-8")
        return
    write_scene(path)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write_live)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
