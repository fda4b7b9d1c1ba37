"""Passes over pixels shade what bodies may cover, and pictures are the same to the bit as if they shaded all."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.arrays import Array
from translucent.gpu import job
from translucent.gpu.placement import Part, extents, part_of
from translucent.planning.methods import METHODS

SIZE = (53, 41)
ARRAYS = ("radiance", "transmittance", "optical_depth", "thickness", "coverage", "valid")

_BALL = trimesh.creation.icosphere(2, 1.0)
_TORUS = trimesh.creation.torus(1.0, 0.3, 12, 8)
_OPEN = trimesh.Trimesh(_BALL.vertices, _BALL.faces[10:], process=False)
MESHES = [tl.Mesh(shape.vertices, shape.faces) for shape in (_BALL, _TORUS, _OPEN)]
MEDIA = (
    tl.Medium(absorption=(0.3, 0.6, 1.0)),
    tl.Medium(absorption=(0.9, 0.2, 0.1), ior=1.5),
    tl.Medium(absorption=0.1, emission=(0.5, 0.4, 0.1)),
    tl.Medium(absorption=0.1, scattering=0.5, anisotropy=0.3, ior=1.3),
)


def camera_of(rng: np.random.Generator, kind: str) -> tl.Camera:
    """Camera far from the bodies, among them, in one, or without perspective, that looks at them, past them or away."""
    eye = np.array([0.1, 0.2, 0.15]) if kind == "inside" else rng.normal(size=3) * (2.0 if kind == "near" else 8.0)
    target = rng.normal(size=3) * (8.0 if rng.random() < 0.3 else 2.0)
    if kind == "flat":
        return tl.Camera.orthographic(eye, target, height=float(rng.uniform(2.0, 12.0)))
    return tl.Camera.look_at(eye, target, fov_y=float(rng.uniform(20.0, 90.0)))


def scene_of(seed: int, most: int, media: tuple[tl.Medium, ...]) -> tl.Scene:
    """A few bodies of any kind, alone, one in another, or beside an opaque object, before any environment."""
    rng = np.random.default_rng(seed)
    objects = []
    for i in range(int(rng.integers(1, most + 1))):
        at = trimesh.transformations.random_rotation_matrix(rng.random(3))
        at[:3, :3] *= rng.uniform(0.3, 1.2)
        at[:3, 3] = rng.normal(size=3) * (1.5 if i else 0.0)
        sheet = 1e-2 if most > 1 and rng.random() < 0.2 else None
        medium = media[int(rng.integers(len(media)))]
        objects.append(tl.Object(MESHES[int(rng.integers(len(MESHES)))], medium, at, sheet_thickness=sheet))
    if rng.random() < 0.4:
        objects.append(tl.Object(MESHES[0], None, trimesh.transformations.translation_matrix(rng.normal(size=3) * 2)))
    environment = (
        tl.Environment.constant((0.7, 0.8, 0.9)),
        tl.Environment.checkerboard((0.1, 0.2, 0.3), (0.9, 0.8, 0.7), 7),
        tl.Environment.gradient((0.1, 0.2, 0.3), (0.9, 0.8, 0.7)),
    )[seed % 3]
    lights = [tl.PointLight((3.0, 4.0, 5.0), (30.0, 30.0, 30.0))] if rng.random() < 0.5 else []
    return tl.Scene(objects, camera_of(rng, ("far", "near", "inside", "flat")[seed % 4]), lights, environment)


def shade_everything(patch: pytest.MonkeyPatch) -> None:
    def whole(boxes: Array, radii: Array, camera: tl.Camera, size: tuple[int, int]) -> Array:
        return np.tile([0.0, 0.0, *size], (len(boxes), 1)).astype(np.float64)

    patch.setattr(job, "extents", whole)


def require_equal(renderer: tl.Renderer, scene: tl.Scene, method: tl.Method | None, samples: int) -> tl.Frame:
    """Frame of a scene, which is the same where all pixels are shaded."""
    with pytest.MonkeyPatch.context() as patch:
        shade_everything(patch)
        expected = renderer.render(scene, SIZE, method, samples=samples)
    # What the frame before has left behind must not show.
    renderer.render(tl.showcase(MESHES[0], MEDIA[1], SIZE, stage="none"), SIZE, method)
    found = renderer.render(scene, SIZE, method, samples=samples)
    for name in ARRAYS:
        assert np.array_equal(getattr(found, name), getattr(expected, name), equal_nan=True), name
    for name in ("layers", "truncated", "normals"):
        first, second = getattr(found, name), getattr(expected, name)
        assert (first is None and second is None) or np.array_equal(first, second), name
    return found


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")  # invalid pixels must be the same, too
@pytest.mark.parametrize("method", [None, *(name for name, method in METHODS.items() if not method.follows_paths)])
def test_the_picture_is_as_if_all_of_it_were_shaded(method: str | None, renderer: tl.Renderer) -> None:
    chosen = None if method is None else METHODS[method]()
    # What a method refuses is kept from it.
    most = 1 if method == "back-face-depth" else 3
    media = MEDIA if chosen is None or chosen.ordered else MEDIA[:2]
    covered = []
    for seed in range(4):
        frame = require_equal(renderer, scene_of(seed, most, media), chosen, 1 + 2 * (seed % 2))
        covered.append(float(frame.coverage.mean()))
    # Little, much, and in between: else the test shows nothing.
    assert min(covered) < 0.05
    assert max(covered) > 0.2


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.DepthPeeling(), tl.FragmentLists(), tl.KBuffer()])
@pytest.mark.parametrize("medium", MEDIA)
def test_with_nothing_in_view_the_environment_is_all(
    medium: tl.Medium, method: tl.Method | None, renderer: tl.Renderer
) -> None:
    camera = tl.Camera.look_at((0, 0, 5), (0, 0, 10))
    scene = tl.Scene([tl.Object(MESHES[0], medium)], camera, environment=tl.Environment.constant((0.25, 0.5, 0.75)))
    renderer.render(tl.showcase(MESHES[0], MEDIA[1], SIZE, stage="none"), SIZE, method)
    frame = renderer.render(scene, SIZE, method)
    assert (frame.radiance == (0.25, 0.5, 0.75)).all()
    assert (frame.transmittance == 1.0).all()
    assert not frame.thickness.any()
    assert not frame.optical_depth.any()
    assert frame.valid.all()
    assert not frame.coverage.any()
    assert frame.layers is None or not frame.layers.any()


@pytest.mark.parametrize("kind", ["far", "near", "flat"])
def test_every_point_of_a_body_that_is_seen_is_within_its_extent(kind: str) -> None:
    rng = np.random.default_rng(5)
    seen = 0
    for number in range(200):
        camera = camera_of(rng, kind)
        at = trimesh.transformations.random_rotation_matrix(rng.random(3))
        at[:3, :3] *= rng.uniform(0.5, 1.5, 3)
        at[:3, 3] = rng.normal(size=3)
        body = tl.Object(MESHES[number % 2], MEDIA[0], at)
        shift = rng.uniform(-0.99, 0.99, 2)
        part = part_of(
            extents(body.bounds[None], np.array([body.radius]), camera, SIZE), (float(shift[0]), float(shift[1])), SIZE
        )
        corners = (body.mesh.vertices @ at[:3, :3].T + at[:3, 3])[body.mesh.faces]
        points = np.einsum("nk,nkj->nj", rng.dirichlet(np.ones(3), len(corners)), corners) - camera.eye
        across = points @ np.stack([camera.right, camera.up], axis=1)
        if camera.fov_y is not None:
            ahead = points @ camera.forward
            across = across[ahead > 0] / ahead[ahead > 0, None]
        # Sample points move right and down, the picture under them left and up; pixels count from the bottom left.
        pixels = (across / camera.half_extent(SIZE) + 1.0) * 0.5 * SIZE + (-shift[0], shift[1])
        pixels = pixels[((pixels > 0) & (pixels < SIZE)).all(axis=1)]
        seen += len(pixels)
        assert (pixels >= (part.left, part.bottom)).all()
        assert (pixels <= (part.right, part.top)).all()
    assert seen > 1000


@pytest.mark.parametrize("flat", [False, True])
def test_the_extent_of_a_ball_is_that_of_its_image_and_not_of_its_box(flat: bool) -> None:
    distance, aside, size = 5.0, 0.7, (1000, 1000)
    eye, target = (0, 0, distance), (0, 0, 0)
    camera = tl.Camera.orthographic(eye, target, height=4.0) if flat else tl.Camera.look_at(eye, target, fov_y=40.0)
    edges = extents(np.array([[[aside - 1.0, -1.0, -1.0], [aside + 1.0, 1.0, 1.0]]]), np.ones(1), camera, size)[0]
    away = np.hypot(distance, aside)
    turn, reach = np.arctan2(aside, distance), np.arcsin(1.0 / away)
    right = aside + 1.0 if flat else np.tan(turn + reach)
    top = 1.0 if flat else np.tan(np.arcsin(1.0 / distance))
    expected = (np.array([right, top]) / camera.half_extent(size) + 1.0) * 0.5 * size
    assert edges[2:] == pytest.approx(expected, abs=0.05)


def test_what_is_beside_or_behind_has_no_part_and_what_is_around_has_all() -> None:
    def part(eye: tuple[float, float, float], target: tuple[float, float, float]) -> Part:
        camera = tl.Camera.look_at(eye, target, fov_y=45.0)
        body = tl.Object(MESHES[0], MEDIA[0])
        return part_of(extents(body.bounds[None], np.array([body.radius]), camera, SIZE), (0.0, 0.0), SIZE)

    assert not part((0, 0, 5), (0, 0, 10))
    assert not part((0, 0, 5), (5, 0, 5))
    assert part((0, 0, 0.5), (0, 0, 10)).scissor == (0, 0, *SIZE)
    near = part((0, 0, 5), (0, 0, 0)).scissor
    # A ball of radius 1 at 5 m: the corners of its bounds are 4 m away, and as many pixels off the center as they span.
    reach = SIZE[1] / 2 / 4 / np.tan(np.radians(22.5))
    assert abs(near[3] - 2 * reach) < 4.0
    assert abs(near[2] - 2 * reach) < 4.0


@pytest.mark.parametrize("part", [Part(0, 0, 53, 41), Part(0, 0, 0, 0), Part(3, 5, 20, 41), Part(10, 0, 53, 7)])
def test_a_part_and_its_rest_are_each_pixel_once(part: Part) -> None:
    count = np.zeros(SIZE[::-1], int)
    for each in (part, *part.rest(SIZE)):
        count[each.bottom : each.top, each.left : each.right] += 1
    assert (count == 1).all()


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize(
    "interfaces", [tl.TracedInterfaces(), tl.ScreenInterfaces(), tl.FrontInterface()], ids=["traced", "screen", "front"]
)
def test_glass_changes_what_it_covers_and_nothing_else(
    interfaces: tl.TracedInterfaces | tl.ScreenInterfaces | tl.FrontInterface, samples: int, renderer: tl.Renderer
) -> None:
    camera = tl.Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=45.0)
    checks = tl.Environment.checkerboard((0.1, 0.2, 0.3), (0.9, 0.8, 0.7), 7)

    def drawn(medium: tl.Medium) -> tl.Frame:
        scene = tl.Scene([tl.Object(MESHES[1], medium)], camera, environment=checks)
        return renderer.render(scene, SIZE, samples=samples, interfaces=interfaces)

    glass, matched = drawn(tl.Medium(absorption=0.1, ior=1.5)), drawn(tl.Medium(absorption=0.1))
    # The hole of the ring is not covered either, and averaged edges are.
    away = (glass.transmittance == 1.0).all(axis=2)
    changed = (glass.radiance != matched.radiance).any(axis=2)
    assert 0.5 < away.mean() < 0.8
    assert not changed[away].any()
    assert changed[~away].mean() > 0.99
    assert (glass.radiance > 0.02).all()  # the darkest square is 0.1
