"""Contact sheets of all named media on ball and bear, on three stages: ``python tools/preset_sheets.py [NAME ...]``.

Tiles are kept in ``out/presets/``; those that are absent, or of presets that are named, are rendered. The sheets are
``docs/presets/*.jpg``, one for each source of presets. The ball is 4 cm wide and the bear, twice the toolkit's, as
high.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import translucent as tl
from translucent.assets import mesh_path
from translucent.media.preset import Preset
from translucent.scene.showcase import framing
from translucent.scene.stages import STAGED_TONE, stage_named

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "presets"
TILES = ROOT / "out" / "presets"

#: The columns of each preset.
STAGES = ("studio", "daylight", "night")

#: Sheets, and how the sources of the presets on them begin.
SHEETS = {
    "jensen": ("Jensen et al. 2001",),
    "narasimhan": ("Narasimhan et al. 2006",),
    "estimated": ("by eye", "by data sheet"),
}

#: Pixels of a tile, of the line of a name, and between presets; presets in a row; quality of the JPEG.
TILE, NAME, GAP = (160, 100), 18, 8
COLUMNS, QUALITY = 2, 84

#: Samples of a pixel, and directions of the environment that throw shadows.
SAMPLES, SHADOWS = 4, 24


def scene_of(preset: Preset, stage: str) -> tl.Scene:
    """Ball and bear of a preset, side by side on a stage."""
    bear = np.diag([2.0, 2.0, 2.0, 1.0])
    bear[:3, 3] = 0.036, 0.0, 0.0
    objects = [
        tl.Object(tl.load_mesh(mesh_path("sphere")), material=preset),
        tl.Object(tl.load_mesh(mesh_path("bear")), transform=bear, material=preset),
    ]
    scene = tl.Scene(objects, framing(objects, TILE), environment_shadows=SHADOWS)
    chosen = stage_named(stage)
    assert chosen is not None
    return tl.staged(scene, chosen)


def tile_of(renderer: tl.Renderer, preset: Preset, stage: str, again: bool) -> Image.Image:
    """Picture of a preset on a stage, rendered if there is none yet."""
    path = TILES / f"{preset.name}-{stage}.png"
    if again or not path.is_file():
        frame = renderer.render(scene_of(preset, stage), TILE, samples=SAMPLES)
        frame.save(path, tone=STAGED_TONE)
        print(f"{path.name}: {frame.seconds['total']:.1f} s", flush=True)
    with Image.open(path) as picture:
        return picture.convert("RGB")


def corner(number: int) -> tuple[int, int]:
    """Left and upper pixel of a preset on its sheet: its name, and its tiles below that."""
    row, column = divmod(number, COLUMNS)
    return GAP + column * (len(STAGES) * TILE[0] + GAP), GAP + row * (TILE[1] + NAME + GAP)


def sheet_of(renderer: tl.Renderer, presets: list[Preset], named: set[str]) -> Image.Image:
    """All these presets beside their names."""
    rows = -(-len(presets) // COLUMNS)
    width, height = len(STAGES) * TILE[0] + GAP, TILE[1] + NAME + GAP
    sheet = Image.new("RGB", (COLUMNS * width + GAP, rows * height + GAP), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for i, preset in enumerate(presets):
        left, top = corner(i)
        draw.text((left, top), preset.name, fill="black", font=font)
        for k, stage in enumerate(STAGES):
            tile = tile_of(renderer, preset, stage, preset.name in named)
            sheet.paste(tile, (left + k * TILE[0], top + NAME))
    return sheet


def main(names: list[str]) -> None:
    """Write all sheets."""
    named = {tl.preset(name).name for name in names}
    FOLDER.mkdir(parents=True, exist_ok=True)
    TILES.mkdir(parents=True, exist_ok=True)
    with tl.Renderer() as renderer:
        for name, sources in SHEETS.items():
            some = [one for one in tl.presets().values() if one.source.startswith(sources)]
            sheet_of(renderer, some, named).save(FOLDER / f"{name}.jpg", quality=QUALITY, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
