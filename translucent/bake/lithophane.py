"""Lithophanes: the relief of a plate through which a light shows a picture.

The tone mapping is affine in linear light, as black-point compensation is: with T the luminance of white light after a
thickness, a pixel of luminance L in 0..1 gets that at which T = T(thickest) + L (T(thinnest) - T(thickest)). Light goes
straight through; interfaces reflect the same fraction everywhere, and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.bake.check import labeled, look
from translucent.errors import InputError
from translucent.files.paths import require_output, write_atomically
from translucent.formulas.color import luminance
from translucent.frames.photographs import read_picture
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.threads import import_trimesh

#: Largest number of points of a relief.
MOST_POINTS = 4_000_000

#: Least contrast that is worth printing.
LEAST_CONTRAST = 1.2

#: Least fraction of light that is worth a thickness: it is black beside all else.
LEAST_PASSED = 1e-5

#: Thicknesses at which luminance is tabled.
_TABLED = 4097


@dataclass(frozen=True, eq=False)
class Lithophane:
    """Relief of a picture, and the picture that it shows in front of a uniform white light.

    Attributes
    ----------
    mesh : Mesh
        In metres: its flat back at z = 0, the relief towards +z, the picture's top towards +y.
    thickness : (h, w) float64
        Metres at the relief's points; row 0 is the top.
    target : (h - 1, w - 1) float64
        Luminance between the points that the tone mapping asks for, 1 where the plate is thinnest.
    shown : (h - 1, w - 1, 3) float64
        Linear color that a rendering of the mesh shows, in the same scale.
    contrast : float
        Of the thinnest to the thickest place.
    rms : float
        Of luminance shown less luminance requested: what facets between the points make of it.
    """

    mesh: Mesh
    thickness: Array
    target: Array
    shown: Array
    contrast: float
    rms: float

    @checked
    def save(self, path: str | Path) -> None:
        """Write the mesh as binary .stl in millimetres, as slicers read it.

        Raises
        ------
        InputError
            If the suffix is another.
        RenderError
            If the file cannot be written.
        """
        trimesh = import_trimesh()

        path = check_lithophane_output(Path(path))
        solid = trimesh.Trimesh(1e3 * self.mesh.vertices, self.mesh.faces, process=False)
        with np.errstate(all="ignore"):
            data = solid.export(file_type="stl")

        def fill(temporary: Path) -> None:
            temporary.write_bytes(data)

        write_atomically(path, fill)

    @checked
    def save_check(self, path: str | Path) -> None:
        """Write a .png with the requested picture beside the picture that the relief shows."""
        requested = np.repeat(self.target[..., None], 3, axis=-1)
        most = max(1.0, float(requested.max()), float(self.shown.max()))
        both = labeled(("requested", look(requested / most)), ("shown by the plate", look(self.shown / most)))
        write_atomically(Path(path), lambda temporary: both.save(temporary, format="PNG"))


def check_lithophane_output(path: Path) -> Path:
    """The path itself; raises `InputError` if a relief cannot be written to it."""
    if path.suffix.lower() != ".stl":
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "give a .stl file")
    require_output(path, f"output {str(path)!r}")
    return path


@checked
def lithophane(
    picture: str | Path | npt.ArrayLike,
    medium: Medium,
    thickness: tuple[float, float] = (0.0006, 0.003),
    width: float = 0.1,
    pitch: float = 0.00025,
) -> Lithophane:
    """Relief that shows a picture's luminance before a light.

    Parameters
    ----------
    picture : str, Path or array_like (h, w, 3)
        As `Photograph` has it; linear values are clipped to 0..1.
    medium : Medium
        Whose extinction is that of light that arrives at all: a filament's by `translucent extinction --td`.
    thickness : (least, largest)
        In metres.
    width : float
        Of the plate, in metres.
    pitch : float
        Distance of the relief's points in metres, about.

    Raises
    ------
    InputError
        If the medium scatters, or is as bright at both thicknesses; if a length is no length, or there are too many
        points.
    """
    least, largest = thickness
    if not (0 < least < largest < np.inf and 0 < pitch <= width / 2 < np.inf):
        thin, thick, wide_text, every = (f"{1e3 * metres:.6g} mm" for metres in (least, largest, width, pitch))
        found = f"{thin} to {thick} thick, {wide_text} wide, with a point every {every}"
        raise InputError("lithophane", found, "use 0 < smallest < largest, and a width of two points or more")
    linear = read_picture(picture).linear if isinstance(picture, str | Path) else np.asarray(picture, dtype=np.float64)
    if linear.ndim != 3 or linear.shape[2] != 3 or not (linear.size and np.isfinite(linear).all()):
        found = f"the picture has the shape {linear.shape}, or numbers that are not finite"
        raise InputError("lithophane", found, "give linear values (h, w, 3)")
    high, wide = linear.shape[:2]
    columns = round(width / pitch) + 1
    rows = max(round((columns - 1) * high / wide), 1) + 1
    if rows * columns > MOST_POINTS:
        raise InputError(
            "lithophane",
            f"{columns} x {rows} points are too many",
            f"use a larger --pitch: at most {MOST_POINTS} points are allowed",
        )
    passed, tabled = _passed(medium, least, largest)
    contrast = float(passed[0] / passed[-1])
    # Both scales end at 1: the picture's white, and the plate where it is thinnest.
    target = 1.0 / contrast + _resized(linear, columns, rows) * (1.0 - 1.0 / contrast)
    depth = np.interp(-np.log(target), -np.log(passed / passed[0]), tabled)
    mesh = _plate(depth, width / (columns - 1))
    between = 0.25 * (target[1:, 1:] + target[1:, :-1] + target[:-1, 1:] + target[:-1, :-1])
    rendered = _rendered(mesh, medium, (columns - 1, rows - 1)) / passed[0]
    rms = float(np.sqrt(((luminance(rendered) - between) ** 2).mean()))
    return Lithophane(mesh, depth, between, rendered, contrast, rms)


def _passed(medium: Medium, least: float, largest: float) -> tuple[Array, Array]:
    """Table of thicknesses, and the luminance of white light that passes each."""
    if medium.scatters:
        do = "give the --td of a filament, or the color of light after a sample of known thickness"
        raise InputError(
            "lithophane", ("the medium scatters, so more light passes the plate than absorption alone predicts"), do
        )
    tabled = np.linspace(least, largest, _TABLED)
    with np.errstate(under="ignore"):
        passed = np.asarray(luminance(medium.transmittance(tabled)))
    if passed[-1] < LEAST_PASSED or passed[0] < LEAST_CONTRAST * passed[-1]:
        ends = (
            f"{100 * fraction:.3g} % of light passes {1e3 * d:g} mm"
            for fraction, d in zip(passed[[0, -1]], (least, largest), strict=True)
        )
        found = ", ".join(ends)
        raise InputError("lithophane", found, "change the thickness, or choose a more or less absorbing medium")
    return passed, tabled


def _resized(linear: Array, columns: int, rows: int) -> Array:
    """Luminance (rows, columns) in 0..1 of a picture, averaged in linear light where it has more pixels."""
    from PIL import Image

    bright = np.asarray(luminance(np.clip(linear, 0.0, 1.0)), dtype=np.float32)
    resized = Image.fromarray(bright).resize((columns, rows), Image.Resampling.BILINEAR)
    return np.clip(np.asarray(resized, dtype=np.float64), 0.0, 1.0)


def _plate(depth: Array, pitch: float) -> Mesh:
    """Closed mesh of a relief (rows, columns) over a flat back, which is a fan about its middle."""
    rows, columns = depth.shape
    y, x = np.mgrid[0:rows, 0:columns]
    top = np.stack([pitch * (x - 0.5 * (columns - 1)), pitch * (0.5 * (rows - 1) - y), depth], axis=-1).reshape(-1, 3)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    # Counter-clockwise as seen from +z: down the left side, along the bottom, up the right, back along the top.
    ring = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    onward = np.roll(ring, -1)
    below = rows * columns + np.arange(len(ring))
    after, middle = np.roll(below, -1), np.full(len(ring), rows * columns + len(ring))
    faces = [(a, b, c), (a, c, d), (ring, below, after), (ring, after, onward), (middle, after, below)]
    vertices = np.concatenate([top, top[ring] * (1.0, 1.0, 0.0), np.zeros((1, 3))])
    return Mesh(vertices, np.concatenate([np.stack(face, axis=-1) for face in faces]), name="lithophane")


def _rendered(mesh: Mesh, medium: Medium, size: tuple[int, int]) -> Array:
    """Linear color of a plate in front of a uniform white light, seen from far away."""
    height = float(np.ptp(mesh.vertices[:, 1]))
    camera = Camera.orthographic((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), height=height)
    plain = Medium(absorption=medium.absorption)
    scene = Scene([Object(mesh, plain)], camera, [], Environment.constant((1.0, 1.0, 1.0)))
    with Renderer() as renderer:
        return np.asarray(renderer.render(scene, size, samples=4).transmittance, dtype=np.float64)
