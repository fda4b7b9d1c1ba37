"""Analytic solids x methods x cameras: every pixel between two exact chords.

A tessellated, rasterized surface differs from the true one by an offset of at most
  sagitta            (the mesh is not the solid)
+ 16 eps diagonal    (float32: position, interpolation and sum, a few roundings each)
+ 1/256 pixel        (rasterizers snap silhouettes to a sub-pixel grid),
so its chord lies between those of the solid shrunk and grown by that offset. No pixel is left out, grazing or not.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

import translucent as tl
from tests.solids import Box, Ellipsoid, Frustum, Solid, Sphere, SphericalShell, Torus, TwoSpheres

SIZE = (80, 60)
SEGMENTS = 96
EPS = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Subject:
    solid: Solid
    grown: Callable[[float], Solid]  # by an offset in metres; negative shrinks
    inside: tuple[float, float, float]
    convex: bool = True


def _ellipsoid(offset: float) -> Solid:
    # Scaling by 1 + offset / smallest radius moves every surface point by at least the offset.
    scale = 1 + offset / 0.4
    return Ellipsoid(radii=(1.0 * scale, 0.6 * scale, 0.4 * scale))


SUBJECTS = {
    "sphere": Subject(Sphere(), lambda o: Sphere(radius=1 + o), (0.2, 0.1, 0.3)),
    "ellipsoid": Subject(Ellipsoid(radii=(1.0, 0.6, 0.4)), _ellipsoid, (0.3, 0.1, 0.1)),
    "box": Subject(
        Box(low=(-0.5, -0.4, -0.3), high=(0.5, 0.4, 0.3)),
        lambda o: Box(low=(-0.5 - o, -0.4 - o, -0.3 - o), high=(0.5 + o, 0.4 + o, 0.3 + o)),
        (0.1, 0.2, 0.1),
    ),
    "slab": Subject(
        Box.slab((1.0, 0.8), 1e-3),
        lambda o: (
            Box(low=(-0.5 - o, -0.4 - o, -5e-4 - o), high=(0.5 + o, 0.4 + o, 5e-4 + o))
            if o > -5e-4
            else Box.slab((1.0, 0.8), 1e-9)
        ),
        (0.1, 0.1, 1e-4),
    ),
    "frustum": Subject(
        Frustum(bottom_radius=0.6, top_radius=0.2, height=1.0),
        # The side leans by less than 45 degrees: twice the offset on radii and ends moves it by more than the offset.
        lambda o: Frustum(bottom_radius=0.6 + 2 * o, top_radius=0.2 + 2 * o, height=1.0 + 2 * o),
        (0.1, 0.1, 0.1),
    ),
    "torus": Subject(Torus(), lambda o: Torus(minor=0.25 + o), (1.0, 0.05, 0.05), convex=False),
    "shell": Subject(
        SphericalShell(outer=1.0, inner=0.7),
        lambda o: SphericalShell(outer=1 + o, inner=0.7 - o),
        (0.1, 0.1, 0.84),
        convex=False,
    ),
    "two spheres": Subject(
        TwoSpheres(Sphere((-0.7, 0.0, 0.0), 0.6), Sphere((0.8, 0.1, -0.2), 0.5)),
        lambda o: TwoSpheres(Sphere((-0.7, 0.0, 0.0), 0.6 + o), Sphere((0.8, 0.1, -0.2), 0.5 + o)),
        (-0.7, 0.1, 0.2),
        convex=False,
    ),
}


#: Methods that promise the exact thickness, for each solid.
CLAIMS = [
    *((tl.SignedDepth(), name) for name in SUBJECTS),
    *((tl.BackFaceDepth(), name) for name, subject in SUBJECTS.items() if subject.convex),
    *(("reference", name) for name in SUBJECTS),
]


def _inside(subject: Subject) -> tl.Camera:
    eye = np.array(subject.inside)
    return tl.Camera.look_at(eye, eye + (0.3, 0.2, -1.0), fov_y=90)


CAMERAS: dict[str, Callable[[Subject], tl.Camera]] = {
    "perspective": lambda _: tl.Camera.look_at((1.1, 1.3, 2.9), (0.05, 0.02, 0.0)),
    "along an axis": lambda _: tl.Camera.look_at((0.0, 0.0, 3.2), (0.0, 0.0, 0.0)),
    "wide": lambda _: tl.Camera.look_at((0.9, 0.8, 1.2), (0.2, 0.0, 0.0), fov_y=110),
    "far": lambda _: tl.Camera.look_at((900.0, 800.0, 1500.0), (0.0, 0.0, 0.0), fov_y=0.08),
    "orthographic": lambda _: tl.Camera.orthographic((2.0, 1.5, 3.0), (0.0, 0.0, 0.0), height=2.4),
    "inside": _inside,
    "orthographic, plane through the body": lambda s: tl.Camera.orthographic(s.inside, (-3.0, -2.0, -4.0), height=1.8),
}


def _pixel_in_metres(camera: tl.Camera, solid: Solid, directions: np.ndarray) -> np.ndarray:
    """Upper bound on the size of a pixel at the solid, in metres, per pixel."""
    step = 2 * camera.half_extent(SIZE)[1] / SIZE[1]
    if camera.fov_y is None:
        return np.full(directions.shape[:2], step)
    reach = np.linalg.norm(camera.eye) + 2.0
    return step * reach * (directions @ camera.forward)


@functools.cache
def _bounds(name: str, view: str) -> tuple[tl.Scene, np.ndarray, np.ndarray]:
    """A scene, and the chords (h, w) of the shrunk and of the grown solid, which are the same for all methods."""
    subject = SUBJECTS[name]
    camera = CAMERAS[view](subject)
    mesh = subject.solid.tessellate(SEGMENTS)
    scene = tl.Scene([tl.Object(mesh, medium=tl.Medium(absorption=1.0))], camera)
    origins, directions = camera.rays(SIZE)
    offset = subject.solid.sagitta(SEGMENTS) + 16 * EPS * mesh.diagonal
    offset += float(_pixel_in_metres(camera, subject.solid, directions).max()) / 256
    rounding = 16 * EPS * mesh.diagonal / (directions @ camera.forward)
    low = subject.grown(-offset).chord(origins, directions) - rounding
    high = subject.grown(offset).chord(origins, directions) + rounding
    return scene, low, high


@pytest.mark.parametrize("view", CAMERAS)
@pytest.mark.parametrize(("method", "name"), CLAIMS)
def test_every_pixel_is_between_the_chords_of_the_shrunk_and_the_grown_solid(
    renderer: tl.Renderer, name: str, view: str, method: object
) -> None:
    scene, low, high = _bounds(name, view)
    frame = tl.reference.render(scene, SIZE) if method == "reference" else renderer.render(scene, SIZE, method)
    assert frame.valid.all()
    assert (frame.thickness >= low).all()
    assert (frame.thickness <= high).all()
    assert frame.coverage.any()
    assert (frame.thickness[~frame.coverage] == 0).all()


@pytest.mark.parametrize("name", ["torus", "shell", "two spheres"])
def test_back_face_depth_marks_pixels_with_more_than_one_entry(renderer: tl.Renderer, name: str) -> None:
    mesh = SUBJECTS[name].solid.tessellate(48)
    camera = tl.Camera.look_at((2.5, 0.3, 1.0), (0.0, 0.0, 0.0))
    scene = tl.Scene([tl.Object(mesh, medium=tl.Medium(absorption=1.0))], camera)
    counts = tl.reference.hit_counts(scene, SIZE)
    with pytest.warns(tl.TranslucentWarning, match="not convex"):
        frame = renderer.render(scene, SIZE, tl.BackFaceDepth())
    inner = tl.interior(counts)
    assert (frame.valid[inner] == (counts[inner] <= 2)).all()
    truth = tl.reference.render(scene, SIZE)
    kept = inner & frame.valid
    difference = np.abs(frame.thickness - truth.thickness)[kept]
    assert np.quantile(difference, 0.99) <= 1e-6 * mesh.diagonal
    assert difference.max() <= 1e-4 * mesh.diagonal  # 1/256 pixel, where the rasterizer took the neighboring face
