"""Makes the pictures of docs/gallery/ from the project's own meshes: ``python tools/gallery.py [NAME ...]``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

ROOT = Path(__file__).resolve().parents[1]
SIZE = (960, 720)
SAMPLES = 16

STUDIO = tl.Environment.studio(rotation=0.0)


def mesh(name: str) -> tl.Mesh:
    return tl.load_mesh(mesh_path(name))


def turned(degrees: float, axis: int = 1, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A rotation about an axis, and then a shift in metres."""
    angle = np.radians(degrees)
    matrix = np.eye(4)
    a, b = [k for k in range(3) if k != axis]
    matrix[[a, a, b, b], [a, b, a, b]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    matrix[:3, 3] = shift
    return matrix


def medium(name: str) -> tl.Medium:
    return tl.preset(name).medium


def wine() -> tl.Scene:
    """A young red wine, whose color changes from the edge to the middle, in a crystal glass."""
    red = tl.Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    camera = tl.Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
    objects = [tl.Object(mesh("goblet"), medium("crystal"), priority=1), tl.Object(mesh("wine"), red)]
    return tl.Scene(objects, camera, environment=STUDIO, overlap="priority")


def jade() -> tl.Scene:
    """A jade bangle leaning towards the eye."""
    body = tl.Object(
        mesh("bangle"),
        tl.scattering_medium((0.07, 0.34, 0.17), 0.003, ior=1.6),
        transform=turned(-28.0),
        surface=tl.Surface(roughness=0.18, multiple_scattering=True),
    )
    camera = tl.Camera.look_at((0.02, 0.09, 0.24), (0.0, 0.036, 0.0), fov_y=24.0)
    return tl.Scene([body], camera, [tl.DirectionalLight((0.5, -0.4, 0.9), 1.2)], STUDIO)


def soap() -> tl.Scene:
    """A bar of soap, lit from behind its far edge."""
    body = tl.Object(
        mesh("soap"),
        tl.scattering_medium((0.9, 0.66, 0.34), 0.006, ior=1.45),
        turned(24.0),
        surface=tl.Surface(roughness=0.35, multiple_scattering=True),
    )
    camera = tl.Camera.look_at((0.0, 0.13, 0.21), (0.0, 0.012, 0.0), fov_y=24.0)
    return tl.Scene([body], camera, [tl.DirectionalLight((-0.3, -0.5, 0.8), 1.5)], STUDIO)


def bears() -> tl.Scene:
    """Three gummy bears."""
    colors = ((0.75, 0.03, 0.05), (0.9, 0.55, 0.02), (0.1, 0.62, 0.08))
    places = ((-0.0135, 0.0, 0.001), (0.0, 0.0, 0.004), (0.0135, 0.0, 0.0))
    surface = tl.Surface(roughness=0.22)
    objects = [
        tl.Object(
            mesh("bear"),
            tl.Medium.from_color(color, 0.006, ior=1.4),
            turned(-18.0 + 18.0 * i, shift=place),
            surface=surface,
        )
        for i, (color, place) in enumerate(zip(colors, places, strict=True))
    ]
    camera = tl.Camera.look_at((0.0, 0.03, 0.09), (0.0, 0.0092, 0.0), fov_y=24.0)
    return tl.Scene(objects, camera, environment=STUDIO)


def amber() -> tl.Scene:
    """A polished piece of amber."""
    resin = tl.Medium.from_color((0.93, 0.46, 0.06), 0.02, ior=1.54)
    camera = tl.Camera.look_at((0.0, 0.06, 0.15), (0.0, 0.0145, 0.0), fov_y=24.0)
    return tl.Scene([tl.Object(mesh("amber"), resin, turned(35.0))], camera, environment=STUDIO)


def candle() -> tl.Scene:
    """A wax candle, lit by its own flame and from behind."""
    wax = tl.Object(
        mesh("candle"),
        tl.scattering_medium((0.95, 0.88, 0.72), 0.002, ior=1.44),
        surface=tl.Surface(roughness=0.45, multiple_scattering=True),
        priority=0,
    )
    fire = tl.Object(mesh("flame"), tl.Medium(absorption=20.0, emission=(900.0, 480.0, 130.0)))
    wick = tl.Object(mesh("wick"), None, color=(0.03, 0.02, 0.02))
    lights = [
        tl.PointLight((0.0, 0.08, 0.0), np.array((1.0, 0.55, 0.2)) * 0.012),
        tl.DirectionalLight((0.4, -0.3, 1.0), np.array((1.0, 0.9, 0.8)) * 1.0),
    ]
    camera = tl.Camera.look_at((0.0, 0.13, 0.32), (0.0, 0.044, 0.0), fov_y=24.0)
    dim = tl.Environment.studio(exposure=-2.5)
    return tl.Scene([wax, wick, fire], camera, lights, dim)


GALLERY: dict[str, Callable[[], tl.Scene]] = {
    "wine": wine,
    "jade": jade,
    "soap": soap,
    "bears": bears,
    "amber": amber,
    "candle": candle,
}


def main(names: list[str]) -> None:
    folder = ROOT / "docs" / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    with tl.Renderer() as renderer:
        for name in names or GALLERY:
            frame = renderer.render(GALLERY[name](), SIZE, samples=SAMPLES)
            frame.save(folder / f"{name}.png", tone="neutral")
            print(f"{name}: {frame.plan}\n", flush=True)
    write_overview(folder)


def write_overview(folder: Path) -> None:
    """All pictures in one, for the README."""
    from PIL import Image

    tile = (SIZE[0] // 3, SIZE[1] // 3)
    overview = Image.new("RGB", (3 * tile[0], 2 * tile[1]))
    for i, name in enumerate(GALLERY):
        with Image.open(folder / f"{name}.png") as picture:
            overview.paste(picture.resize(tile, Image.Resampling.LANCZOS), (i % 3 * tile[0], i // 3 * tile[1]))
    overview.save(folder / "overview.png", optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
