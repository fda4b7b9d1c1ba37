"""Make the pictures of docs: ``python tools/gallery.py [NAME...]``.

Those of docs/gallery/ and their overview come from the examples, those of docs/pictures/ from the commands that the
pages show, and docs/caustics-in-media.png from tools/caustics_picture.py.
"""

from __future__ import annotations

import os
import re
import runpy
import shlex
import tempfile
from pathlib import Path

import click
import trimesh
from PIL import Image

from translucent.assets import mesh_path
from translucent.cli import main as translucent

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "gallery"

#: Those of the overview, row by row.
OVERVIEW = ("wine", "jade", "soap", "bears", "amber", "candle")
TILE = (320, 240)

CAUSTICS = "caustics_in_media"

#: A picture of docs/pictures/ that a page shows.
SHOWN = re.compile(r"\((?:\.\./)?pictures/(\w+)\.jpg\)")

#: Of a picture on a page.
SMALL = ["--size", "480x320", "--samples", "8"]


def commands(page: str) -> dict[str, str]:
    """The commands of a page that draw its pictures, by the name of the picture."""
    lines = [line.removeprefix("$ translucent ") for line in page.splitlines() if line.startswith("$ translucent ")]
    return {name: line for name in SHOWN.findall(page) for line in lines if f" -o {name}.png " in f"{line} "}


def pages() -> dict[str, str]:
    """All commands that draw pictures of pages."""
    found = {}
    for page in (ROOT / "docs" / "commands.md", *sorted((ROOT / "docs" / "guides").glob("*.md"))):
        found.update(commands(page.read_text(encoding="utf-8")))
    return found


def draw(name: str, command: str) -> None:
    """Run a command of a page, and keep its picture."""
    folder = ROOT / "docs" / "pictures"
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        bear = trimesh.load_mesh(mesh_path("bear"))
        bear.apply_scale(1000.0)  # a file in millimetres, as the pages have it
        bear.export("model.stl")
        if translucent([*shlex.split(command), *SMALL]) != 0:
            raise click.ClickException(f"{name}: {command} failed")
        with Image.open(f"{name}.png") as picture:
            shown = picture.convert("RGBA")  # what is transparent, over a white page
            page = Image.alpha_composite(Image.new("RGBA", shown.size, "white"), shown)
            page.convert("RGB").save(folder / f"{name}.jpg", quality=88, optimize=True)
        os.chdir(ROOT)


@click.command(help=__doc__)
@click.argument("names", nargs=-1, type=click.Choice((*OVERVIEW, "bubble", CAUSTICS, *pages())))
def main(names: tuple[str, ...]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    shown = pages()
    for name in names or (*OVERVIEW, CAUSTICS, *shown):
        print(f"{name}: ", end="", flush=True)
        if name in shown:
            draw(name, shown[name])
        elif name == CAUSTICS:
            os.chdir(ROOT)
            runpy.run_path(str(ROOT / "tools" / "caustics_picture.py"), run_name="__main__")
        else:
            os.chdir(FOLDER)
            runpy.run_path(str(ROOT / "examples" / f"{name}.py"))
    write_overview()


def write_overview() -> None:
    """All pictures in one, for the README."""
    overview = Image.new("RGB", (3 * TILE[0], 2 * TILE[1]))
    for i, name in enumerate(OVERVIEW):
        with Image.open(FOLDER / f"{name}.png") as picture:
            overview.paste(picture.resize(TILE, Image.Resampling.LANCZOS), (i % 3 * TILE[0], i // 3 * TILE[1]))
    overview.save(FOLDER / "overview.png", optimize=True)


if __name__ == "__main__":
    main()
