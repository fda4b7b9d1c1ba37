"""Make the pictures of docs/gallery/ and their overview from the examples: ``python tools/gallery.py [NAME...]``."""

from __future__ import annotations

import os
import runpy
from pathlib import Path

import click
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "gallery"

#: Those of the overview, row by row.
OVERVIEW = ("wine", "jade", "soap", "bears", "amber", "candle")
TILE = (320, 240)


@click.command(help=__doc__)
@click.argument("names", nargs=-1, type=click.Choice((*OVERVIEW, "bubble")))
def main(names: tuple[str, ...]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    os.chdir(FOLDER)
    for name in names or OVERVIEW:
        print(f"{name}: ", end="", flush=True)
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
