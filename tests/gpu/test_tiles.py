"""Large pictures in tiles: each is its part of the picture that is rendered at once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run
from translucent.commands import render
from translucent.errors import InputError, TranslucentWarning
from translucent.geometry.solids import Sphere
from translucent.tiles import write_tiles

SIZE, TILE = (40, 28), (16, 12)
CAMERA = tl.Camera.look_at((0.3, 0.4, 5.0), (0, 0, 0), fov_y=30.0)
SKY = tl.Environment.gradient((0.1, 0.2, 0.4), (1.0, 0.9, 0.7))
SQUARES = tl.Environment.checkerboard()
GLASS = tl.Medium(absorption=(0.2, 0.5, 0.9), ior=1.5)
MATCHED = tl.Medium(absorption=(0.2, 0.5, 0.9))
FOG = tl.Medium(absorption=0.1, scattering=0.5)
BALL = Sphere().tessellate(16)


def scene(medium: tl.Medium = GLASS, camera: tl.Camera = CAMERA, environment: Any = SKY, **rest: Any) -> tl.Scene:
    return tl.Scene([tl.Object(BALL, medium)], camera, environment=environment, **rest)


def put_together(tiles: Iterator[tl.Tile]) -> dict[str, np.ndarray]:
    whole: dict[str, np.ndarray] = {}
    for tile in tiles:
        for name, values in tile.frame.arrays.items():
            into = whole.setdefault(name, np.full((*SIZE[::-1], *values.shape[2:]), 99, values.dtype))
            into[tile.top : tile.top + values.shape[0], tile.left : tile.left + values.shape[1]] = values
    return whole


FLAT = tl.Camera.orthographic((0.5, 0.6, 5.0), (0, 0, 0), height=2.4)
LAMP = tl.PointLight((2.0, 2.0, 2.0), 20.0)
CASES: dict[str, tuple[tl.Scene, dict[str, Any]]] = {
    "glass before squares": (scene(environment=SQUARES), {}),
    "orthographic": (scene(camera=FLAT, environment=SQUARES), {}),
    "fog": (scene(FOG, lights=[LAMP]), {}),
    "random paths": (scene(), {"method": tl.PathTraced(2)}),
}


@pytest.mark.parametrize("name", CASES)
def test_tiles_are_parts_of_the_whole_picture(renderer: tl.Renderer, name: str) -> None:
    shown, options = CASES[name]
    frame = renderer.render(shown, SIZE, **options)
    tiled = put_together(tl.render_tiles(renderer, shown, SIZE, TILE, **options))
    assert tiled.keys() == frame.arrays.keys()
    for kind, values in frame.arrays.items():
        scale = max(float(np.abs(values).max()), 1e-30)
        off = np.abs(tiled[kind].astype(np.float64) - values) / scale
        # Rays that bend several times magnify the rounding of their first direction.
        assert off.max() < 2e-3, kind
        assert off.mean() < 2e-5, kind


@pytest.mark.parametrize("suffix", [".exr", ".png"])
def test_a_file_written_in_tiles_is_that_of_the_frame(renderer: tl.Renderer, tmp_path: Path, suffix: str) -> None:
    if suffix == ".exr":
        pytest.importorskip("OpenEXR", reason="writes .exr files")
    write_tiles(tmp_path / f"tiles{suffix}", SIZE, tl.render_tiles(renderer, scene(), SIZE, TILE), 0.5)
    renderer.render(scene(), SIZE).save(tmp_path / f"whole{suffix}", 0.5)
    if suffix == ".png":
        from PIL import Image

        tiles, whole = (np.asarray(Image.open(tmp_path / f"{n}.png")).astype(int) for n in ("tiles", "whole"))
        assert np.abs(tiles - whole).max() <= 1
        return
    import OpenEXR

    tiles, whole = (OpenEXR.File(str(tmp_path / f"{n}.exr"), separate_channels=True) for n in ("tiles", "whole"))
    assert tiles.header()["comments"] == whole.header()["comments"]
    assert tiles.channels().keys() == whole.channels().keys()
    for name, channel in whole.channels().items():
        np.testing.assert_allclose(tiles.channels()[name].pixels, channel.pixels, atol=2e-3, err_msg=name)


def test_progress_is_that_of_all_tiles(renderer: tl.Renderer) -> None:
    shares: list[float] = []
    list(tl.render_tiles(renderer, scene(), SIZE, (20, 28), samples=4, progress=shares.append))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert any(0.3 < share < 0.7 for share in shares)


def test_invalid_pixels_are_counted_once(renderer: tl.Renderer) -> None:
    mesh = tl.Mesh(BALL.vertices, BALL.faces[30:])
    holed = tl.Scene([tl.Object(mesh, MATCHED)], CAMERA)
    with pytest.warns(TranslucentWarning) as whole:
        renderer.render(holed, SIZE)
    with pytest.warns(TranslucentWarning) as tiled:
        list(tl.render_tiles(renderer, holed, SIZE, TILE))
    assert [str(one.message) for one in tiled] == [str(one.message) for one in whole]


@pytest.mark.parametrize(
    ("options", "found"),
    [
        ({"interfaces": tl.ScreenInterfaces()}, "interfaces in screen space"),
        ({"backdrop": tl.Backdrop(np.zeros((28, 40, 3)), np.ones((28, 40)))}, "a backdrop"),
    ],
)
def test_what_needs_the_whole_picture_is_refused(renderer: tl.Renderer, options: dict[str, Any], found: str) -> None:
    with pytest.raises(InputError, match=found):
        list(tl.render_tiles(renderer, scene(), SIZE, TILE, **options))


def test_a_large_picture_is_written_in_tiles(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ("render", "knot", "--stage", "none", "--size", "48x40", "--samples", "1", "--json", "-o")
    pytest.importorskip("OpenEXR", reason="writes .exr files")
    whole = json.loads(run(*arguments, tmp_path / "whole.exr").out)
    monkeypatch.setattr(render, "TILED", 40 * 40)
    monkeypatch.setattr("translucent.tiles.TILE", TILE)
    tiled = json.loads(run(*arguments, tmp_path / "tiles.exr").out)
    for name in ("size", "covered_pixels", "invalid_pixels", "plan"):
        assert tiled[name] == whole[name]
    assert tiled["thickness"] == pytest.approx(whole["thickness"], rel=1e-4)
    refused = run(*arguments, tmp_path / "aov.exr", "--aov", tmp_path / "aov")
    assert refused.code == 2
    assert "48x40 pixels are rendered in tiles" in refused.err


def test_an_interrupted_picture_leaves_no_file(renderer: tl.Renderer, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR", reason="writes .exr files")

    def broken() -> Iterator[tl.Tile]:
        for tile in tl.render_tiles(renderer, scene(), SIZE, TILE):
            yield tile
            if tile.top:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_tiles(tmp_path / "half.exr", SIZE, broken())
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="this file format needs all arrays at once"):
        write_tiles(tmp_path / "whole.npz", SIZE, tl.render_tiles(renderer, scene(), SIZE, TILE))
