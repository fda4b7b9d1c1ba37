"""The pictures that an example saves, and its scene to turn around, for its page in the gallery."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from live_scene import write_live_page
from sphinx_gallery.scrapers import figure_rst

import translucent as tl
from translucent.assets import web_path

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: Folder of the live pages, beside the pages of the gallery.
LIVE = "live"

#: Loads the page in place of the picture; without JavaScript the link opens it.
LINK = """

.. raw:: html

   <p><a class="turn" href="{folder}/{name}.html">Turn it around</a> ({megabytes:.1f} MB; runs in the browser)</p>

"""


def new_pictures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Move what the example has saved beside itself into the gallery, and write its scene as a page."""
    example = Path(block_vars["src_file"])
    taken = []
    for picture in sorted(example.parent.glob("*.png"), key=lambda path: path.stat().st_mtime):
        taken.append(next(block_vars["image_path_iterator"]))
        shutil.move(picture, taken[-1])
    figure = str(figure_rst(taken, gallery_conf["src_dir"]))
    scene = block_vars["example_globals"].get("scene")
    if not taken or scene is None:
        return figure
    try:
        web_path("page.js")
    except tl.InputError:  # built by npm, which is not on every machine
        return figure
    folder = Path(block_vars["target_file"]).parent / LIVE
    folder.mkdir(exist_ok=True)
    page = folder / f"{example.stem}.html"
    # A page holds the light of each cell of a body in which it diffuses: with more cells it would have twice the size.
    size = write_live_page(scene, page, size=(960, 720), name=example.stem, scattering=tl.Diffusion(16))
    return figure + LINK.format(folder=LIVE, name=example.stem, megabytes=size / 1e6)


def copy_live(app: Sphinx, exception: Exception | None) -> None:
    """Copy the live pages beside the pages of the gallery."""
    gallery = str(app.config.sphinx_gallery_conf["gallery_dirs"])
    pages = Path(app.srcdir) / gallery / LIVE
    if exception is None and app.builder.name == "html" and pages.is_dir():
        shutil.copytree(pages, Path(app.outdir) / gallery / LIVE, dirs_exist_ok=True)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", copy_live)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
