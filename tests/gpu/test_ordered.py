"""Ordered intervals: peeling, fragment lists and k-buffer against the float64 reference, and against each other."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests import references
from tests.scans import scan
from translucent.assets import mesh_path
from translucent.frames.metrics import interior
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.constants import PEEL_BATCH
from translucent.gpu.pass_costs import PassTimer
from translucent.gpu.targets import Storage

SIZE = (112, 84)
#: For pictures in which a pixel of that size would see past an edge without its neighbors telling.
FINE = (320, 240)
METHODS = {
    "lists": tl.FragmentLists(),
    "peeling": tl.DepthPeeling(max_layers=256),
    "front-to-back": tl.DepthPeeling(max_layers=256, order="front-to-back"),
    "back-to-front": tl.DepthPeeling(max_layers=256, order="back-to-front"),
    "k-buffer": tl.KBuffer(k=32),
}
POLICIES = ("add", "union", "priority")
EPS = float(np.finfo(np.float32).eps)

AMBER = tl.Medium(absorption=(0.5, 1.0, 2.0), emission=(1.0, 0.2, 0.1))
AZURE = tl.Medium(absorption=(2.0, 0.5, 0.2), emission=(0.1, 0.3, 1.0))
JADE = tl.Medium(absorption=(1.0, 0.2, 1.0), emission=(0.0, 0.5, 0.0))


#: To be put above other parameters, so that it varies first: the reference's picture is made once for all methods.
each_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


def moved(
    mesh: tl.Mesh, medium: tl.Medium | None, position: Any = (0, 0, 0), scale: float = 1.0, **kw: Any
) -> tl.Object:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = position
    return tl.Object(mesh, medium, matrix, **kw)


def assert_equal_to_reference(renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int], method: Any) -> tl.Frame:
    """Thickness p99.9 within 1e-5 of the diagonal, radiance within 1e-5, no invalid pixel, and the layers counted."""
    frame, truth = renderer.render(scene, size, method), references.render(scene, size)
    counts = references.hit_counts(scene, size)
    inside = interior(counts)
    errors = tl.compare(frame, truth, mask=inside)
    radiance = np.abs(frame.radiance - truth.radiance)[inside]
    print(f"{errors}; radiance p99.9 {np.quantile(radiance, 0.999):.1e}")
    assert frame.valid.all()
    assert errors.p999 <= 1e-5 * scene.diagonal
    assert np.quantile(radiance, 0.999) <= 1e-5 * max(1.0, float(truth.radiance.max()))
    assert errors.coverage_mismatch <= 3e-4
    # An orthographic picture within the bodies has surfaces behind it, which the methods count, too.
    if scene.camera.fov_y is not None or np.linalg.norm(scene.camera.eye) > 2:
        np.testing.assert_array_equal(frame.layers[inside], counts[inside])
    assert (frame.truncated == 0).all()
    return frame


# On meshes


@each_method
@pytest.mark.parametrize("name", ["bunny.obj", "armadillo.obj", "mengerSponge3.glb"])
def test_scans_equal_the_reference(renderer: tl.Renderer, assets: Path, name: str, method: Any) -> None:
    mesh = scan(assets / "meshes_clean" / name)
    size = (160, 160)
    scene = tl.Scene(
        [tl.Object(mesh, tl.Medium(absorption=1.0 / mesh.diagonal))], tl.Camera.framing(mesh.vertices, size)
    )
    frame = assert_equal_to_reference(renderer, scene, size, method)
    signed = renderer.render(scene, size)
    assert isinstance(signed.plan.method, tl.SignedDepth)
    off = np.abs(frame.thickness - signed.thickness)[interior(references.hit_counts(scene, size))]
    assert np.quantile(off, 0.999) <= 1e-5 * mesh.diagonal


@each_method
@pytest.mark.parametrize("policy", POLICIES)
def test_wine_in_a_goblet(renderer: tl.Renderer, method: Any, policy: Any) -> None:
    """The wine's surface reaches a little into the wall of the glass, which displaces it where priorities rule."""
    goblet, wine = (tl.load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    glow = tl.Medium.from_color("#7b1e3a", distance=0.01)
    red = tl.Medium(absorption=glow.absorption, emission=(3.0, 0.5, 0.5))
    glass = tl.Medium(absorption=(4.0, 2.0, 3.0), emission=(0.0, 0.4, 0.2))
    camera = tl.Camera.framing(goblet.vertices, SIZE)
    scene = tl.Scene([tl.Object(goblet, glass, priority=1), tl.Object(wine, red)], camera, overlap=policy)
    assert_equal_to_reference(renderer, scene, SIZE, method)


@each_method
def test_volumes_of_two_balls_that_overlap(renderer: tl.Renderer, assets: Path, method: Any) -> None:
    balls = [scan(assets / "meshes_clean" / f"ball{letter}.off") for letter in "AB"]
    truth = json.loads((assets / "truth" / "boolean.json").read_text())
    volumes = {}
    size, height = (450, 450), 24.0
    center = np.mean([ball.bounds.mean(axis=0) for ball in balls], axis=0)
    camera = tl.Camera.orthographic(center + (3, 4, 50), center, height=height)
    for policy in ("add", "union"):
        scene = tl.Scene([tl.Object(ball, tl.Medium(absorption=0.1)) for ball in balls], camera, overlap=policy)
        frame = renderer.render(scene, size, method)
        assert frame.valid.all()
        volumes[policy] = float(frame.thickness.sum(dtype=np.float64)) * (height / size[1]) ** 2
    print(volumes)
    # A sum over pixels is off by about the perimeter's pixels' half: 1e-3 at most, and 1e-4 as measured.
    assert volumes["add"] == pytest.approx(2802.21, rel=1e-3)
    assert volumes["union"] == pytest.approx(truth["union"], rel=1e-3)
    assert volumes["add"] - volumes["union"] == pytest.approx(truth["intersection"], rel=5e-3)


# Policies, order, emission


#: Each method with each view and with each policy, and each policy with each view.
VIEWS = [
    (view, POLICIES[(i + j) % len(POLICIES)], method)
    for i, view in enumerate(("outside", "orthographic", "inside", "cut"))
    for j, method in enumerate(METHODS)
]


@pytest.mark.parametrize(("view", "policy", "method"), VIEWS)
def test_emission_of_overlapping_media(renderer: tl.Renderer, method: str, policy: Any, view: str) -> None:
    camera = {
        "outside": tl.Camera.look_at((1, 2, 6), (0, 0, 0)),
        "orthographic": tl.Camera.orthographic((1, 2, 6), (0, 0, 0), height=4),
        "inside": tl.Camera.look_at((-0.9, 0.1, 0.2), (0.5, 0, 0), fov_y=90),
        "cut": tl.Camera.orthographic((0.1, 0.2, 0.1), (-1, -0.5, -0.7), height=3),
    }[view]
    ball, box = Sphere().tessellate(64), Box().tessellate()
    objects = [
        moved(ball, AMBER, (-0.5, 0, 0), priority=1),
        moved(ball, AZURE, (0.5, 0.1, 0.2)),
        moved(box, JADE, (0, -0.6, -0.3), priority=2),
    ]
    assert_equal_to_reference(renderer, tl.Scene(objects, camera, overlap=policy), SIZE, METHODS[method])


@each_method
def test_what_is_in_front_dims_what_is_behind(renderer: tl.Renderer, method: Any) -> None:
    """Two slabs, one of which only emits and one only absorbs: their order decides."""
    slab = Box.slab((4.0, 4.0), 0.5).tessellate()
    light, dark = tl.Medium(emission=(1.0, 1.0, 1.0)), tl.Medium(absorption=(2.0, 2.0, 2.0))
    environment = tl.Environment.constant((0.0, 0.0, 0.0))
    seen = []
    for first, second in ((light, dark), (dark, light)):
        objects = [moved(slab, first, (0, 0, 1)), moved(slab, second)]
        scene = tl.Scene(objects, tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=1.0), environment=environment)
        seen.append(renderer.render(scene, (8, 8), method).radiance)
    np.testing.assert_allclose(seen[0], 0.5, rtol=1e-6)
    np.testing.assert_allclose(seen[1], 0.5 * np.exp(-1.0), rtol=1e-6)


@each_method
@pytest.mark.parametrize("policy", POLICIES)
def test_two_bodies_that_share_a_face_neither_leak_nor_flicker(renderer: tl.Renderer, method: Any, policy: Any) -> None:
    """The same wall, once as the exit of one body and once as the entry of the other, under a transform that rounds."""
    low, high = Box(low=(-1, -1, -1), high=(1, 1, 0)).tessellate(), Box(low=(-1, -1, 0), high=(1, 1, 1)).tessellate()
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
    objects = [tl.Object(low, AMBER, turn, priority=1), tl.Object(high, AZURE, turn)]
    scene = tl.Scene(objects, tl.Camera.look_at((1, 2, 5), (0, 0, 0)), overlap=policy)
    size = (160, 120)
    frame = assert_equal_to_reference(renderer, scene, size, method)
    one = tl.Scene([tl.Object(Box(low=(-1, -1, -1), high=(1, 1, 1)).tessellate(), AMBER, turn)], scene.camera)
    whole = renderer.render(one, size)
    same = interior(references.hit_counts(scene, size))
    np.testing.assert_allclose(frame.thickness[same], whole.thickness[same], atol=20 * EPS * scene.diagonal)


@each_method
def test_coplanar_double_walls_count_twice(renderer: tl.Renderer, method: Any) -> None:
    """Faces at the same place with the same side: peeling must not lose one of them."""
    cube = Box().tessellate()
    twice = tl.Mesh(cube.vertices, np.concatenate([cube.faces, cube.faces]), name="double")
    camera = tl.Camera.look_at((1.5, 1, 3), (0, 0, 0))
    frame = renderer.render(tl.Scene([tl.Object(twice, AMBER)], camera), SIZE, method)
    single = renderer.render(tl.Scene([tl.Object(cube, AMBER)], camera), SIZE, method)
    np.testing.assert_array_equal(frame.layers, 2 * single.layers)
    assert (frame.truncated == 0).all()
    np.testing.assert_allclose(frame.thickness, 2 * single.thickness, rtol=1e-6)


@each_method
def test_faces_that_are_alike_in_the_middle_of_a_ray(renderer: tl.Renderer, method: Any) -> None:
    """Two entries in one place between another entry and three exits in one: the last that peeling finds, and two."""
    outer, inner = (Box(low=(-1, -1, -1), high=(1, 1, top)).tessellate() for top in (1.0, 0.5))
    camera = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2.5)
    scene = tl.Scene([tl.Object(mesh, AMBER) for mesh in (outer, inner, inner)], camera)
    frame = assert_equal_to_reference(renderer, scene, SIZE, method)
    assert frame.layers.max() == 6
    assert frame.thickness.max() == pytest.approx(5.0, rel=1e-5)


# Layers


def shells(count: int) -> tl.Scene:
    """Nested boxes, each a body of its own, seen so that only their front and back walls show."""
    cube = Box(low=(-1, -1, -1), high=(1, 1, 1)).tessellate()
    media = (tl.Medium(absorption=0.01, emission=(0.1, 0, 0)), tl.Medium(absorption=0.02, emission=(0, 0.1, 0)))
    objects = [tl.Object(cube, media[i % 2], np.diag([1, 1, 1.0 - i / (count + 1), 1])) for i in range(count)]
    return tl.Scene(objects, tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2.5))


def test_a_hundred_nested_shells(renderer: tl.Renderer) -> None:
    """Lists and buffers hold them at once; peeling holds no more than a batch, whatever their number."""
    scene, size = shells(100), (24, 18)
    for method in (tl.FragmentLists(), tl.KBuffer(k=200)):
        frame = assert_equal_to_reference(renderer, scene, size, method)
        assert frame.layers.max() == 200


@pytest.mark.parametrize(
    "method",
    [
        tl.DepthPeeling(max_layers=8),
        tl.DepthPeeling(max_layers=8, order="front-to-back"),
        tl.DepthPeeling(max_layers=8, order="back-to-front"),
        tl.KBuffer(k=8),
    ],
    ids=str,
)
def test_more_layers_than_asked_for_are_marked_not_wrong(renderer: tl.Renderer, method: Any) -> None:
    scene, size = shells(100), (24, 18)
    counts = references.hit_counts(scene, size)
    truth = references.render(scene, size)
    with pytest.warns(
        tl.TranslucentWarning, match="pixels whose rays cross more than 8 surfaces are marked as invalid"
    ):
        frame = renderer.render(scene, size, method)
    inside = interior(counts)
    np.testing.assert_array_equal(frame.layers[inside], counts[inside])
    np.testing.assert_array_equal(frame.truncated, np.maximum(frame.layers - 8, 0))
    np.testing.assert_array_equal(frame.valid, frame.layers <= 8)
    sound = inside & frame.valid
    np.testing.assert_allclose(frame.thickness[sound], truth.thickness[sound], atol=1e-5 * scene.diagonal)
    assert np.isfinite(frame.radiance).all()


@each_method
def test_pixels_without_anything_have_no_layers(renderer: tl.Renderer, method: Any) -> None:
    camera = tl.Camera.look_at((0, 0, 5), (0, 0, 9))
    frame = renderer.render(tl.Scene([tl.Object(Box().tessellate(), AMBER)], camera), (16, 16), method)
    assert (frame.layers == 0).all()
    assert frame.valid.all()
    assert not frame.coverage.any()


def test_peeling_goes_on_in_batches(renderer: tl.Renderer) -> None:
    """Twelve shells need more passes than are folded at a time, and windings that wait in textures."""
    scene, size = shells(12), (48, 36)
    assert 2 * len(scene.objects) > 2 * PEEL_BATCH, "three batches"
    for order in ("both-ends", "front-to-back", "back-to-front"):
        assert_equal_to_reference(renderer, scene, size, tl.DepthPeeling(max_layers=100, order=order))


# Eyes at hard places


@each_method
@pytest.mark.parametrize("where", ["face", "edge", "corner"])
def test_an_eye_on_the_surface(renderer: tl.Renderer, method: Any, where: str) -> None:
    box = Box(low=(-1, -1, -1), high=(1, 1, 1))
    eye = {"face": (0.0, 0.0, 1.0), "edge": (0.0, 1.0, 1.0), "corner": (1.0, 1.0, 1.0)}[where]
    inner = moved(Box(low=(-0.3, -0.3, -0.3), high=(0.3, 0.3, 0.3)).tessellate(), AZURE)
    for target in ((0.1, 0.2, -3.0), (0.3, 0.1, 5.0)):
        camera = tl.Camera.look_at(eye, target, fov_y=70)
        scene = tl.Scene([tl.Object(box.tessellate(), AMBER), inner], camera)
        frame = renderer.render(scene, (90, 60), method)
        truth = references.render(scene, (90, 60))
        assert frame.valid.all()
        off = np.abs(frame.thickness - truth.thickness)
        assert np.quantile(off, 0.99) <= 1e-5 * scene.diagonal


@each_method
def test_a_camera_10_000_diameters_away(renderer: tl.Renderer, method: Any) -> None:
    ball = Sphere().tessellate(64)
    objects = [moved(ball, AMBER, (-0.5, 0, 0)), moved(ball, AZURE, (0.5, 0.1, 0.2))]
    eye = np.array([0.5, 0.4, 0.77]) * 3e4
    camera = tl.Camera.look_at(eye, (0, 0, 0), fov_y=float(np.degrees(1.2e-4)))
    assert_equal_to_reference(renderer, tl.Scene(objects, camera), SIZE, method)


# What the scene is made of


@each_method
@pytest.mark.parametrize("count", [3, 16])
def test_many_media(renderer: tl.Renderer, method: Any, count: int) -> None:
    ball = Sphere().tessellate(24)
    rng = np.random.default_rng(3)
    objects = [
        moved(ball, tl.Medium(absorption=rng.uniform(0, 1, 3), emission=rng.uniform(0, 1, 3)), rng.uniform(-1, 1, 3))
        for _ in range(count)
    ]
    scene = tl.Scene(objects, tl.Camera.look_at((1, 2, 7), (0, 0, 0)))
    size = (64, 48)
    frame = renderer.render(scene, size, method)
    truth = references.render(scene, size)
    inside = interior(references.hit_counts(scene, size))
    assert frame.valid.all()
    assert np.quantile(np.abs(frame.radiance - truth.radiance)[inside], 0.99) <= 1e-5 * float(truth.radiance.max())


@each_method
def test_an_open_body_is_marked_where_its_hole_shows(renderer: tl.Renderer, method: Any) -> None:
    cube = Box().tessellate()
    open_box = tl.Mesh(cube.vertices, cube.faces[2:], name="open box")
    scene = tl.Scene(
        [tl.Object(open_box, AMBER), moved(cube, AZURE, (1.5, 0, 0))], tl.Camera.look_at((1, 2, 5), (0, 0, 0))
    )
    with pytest.warns(tl.TranslucentWarning, match="'open box'"):
        frame = renderer.render(scene, FINE, method)
    truth = references.render(scene, FINE)
    inside = interior(references.hit_counts(scene, FINE))
    np.testing.assert_array_equal(frame.valid[inside], truth.valid[inside])
    sound = inside & truth.valid
    np.testing.assert_allclose(frame.thickness[sound], truth.thickness[sound], atol=1e-5 * scene.diagonal)
    # An invalid pixel still shows the open faces as sheets.
    assert (frame.thickness[~frame.valid & inside] > 0).all()


@each_method
def test_union_counts_the_medium_of_an_open_body_once(renderer: tl.Renderer, method: Any) -> None:
    cube = Box().tessellate()
    open_box = tl.Mesh(cube.vertices, cube.faces[2:], name="open box")
    objects = [moved(cube, AMBER), moved(open_box, AMBER, (0.3, 0.1, 0.2)), moved(cube, AZURE, (0, 0.4, 0))]
    scene = tl.Scene(objects, tl.Camera.look_at((1, 2, 5), (0, 0, 0)), overlap="union")
    with pytest.warns(tl.TranslucentWarning, match="'open box'"):
        frame = renderer.render(scene, FINE, method)
    truth = references.render(scene, FINE)
    sound = interior(references.hit_counts(scene, FINE)) & truth.valid & frame.valid
    assert sound.sum() > 1250
    np.testing.assert_allclose(frame.optical_depth[sound], truth.optical_depth[sound], atol=5e-5)


@each_method
def test_sheets_keep_thickness_and_transmittance_exact(renderer: tl.Renderer, method: Any) -> None:
    ball, pane = Sphere().tessellate(64), Box.slab((3.0, 3.0), 0.1).tessellate()
    objects = [
        moved(ball, AMBER, (-0.3, 0, 0)),
        moved(ball, AZURE, (0.4, 0, 0)),
        moved(pane, tl.Medium(absorption=(100.0, 50.0, 20.0)), (0, 0, 2), sheet_thickness=1e-3),
    ]
    scene = tl.Scene(objects, tl.Camera.look_at((0.5, 0.4, 6), (0, 0, 0)))
    frame, truth = renderer.render(scene, SIZE, method), references.render(scene, SIZE)
    inside = interior(references.hit_counts(scene, SIZE))
    for name in ("thickness", "transmittance"):
        off = np.abs(getattr(frame, name) - getattr(truth, name))[inside]
        assert np.quantile(off, 0.99) <= 1e-5, name
    assert any("sheets among media that emit light" in limit for limit in frame.plan.limits)


# Buffers


def test_lists_grow_until_everything_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    from translucent.gpu.passes import fragment_lists

    monkeypatch.setattr(fragment_lists, "_FIRST_NODES_PER_PIXEL", 0)
    with tl.Renderer() as renderer:
        assert_equal_to_reference(renderer, shells(12), (96, 72), tl.FragmentLists())
        grown = renderer.gpu._targets.buffers.get("nodes", 0)  # type: ignore[union-attr]
        renderer.render(shells(12), (96, 72), tl.FragmentLists())
        assert renderer.gpu._targets.buffers.get("nodes", 0) is grown  # type: ignore[union-attr]


def test_lists_that_no_buffer_holds_are_made_in_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    size = (96, 72)
    with tl.Renderer() as renderer:
        whole = renderer.render(shells(12), size, tl.FragmentLists())
    monkeypatch.setattr(Storage, "largest", property(lambda _: 4 * 96 * 72 + 8))
    with tl.Renderer() as renderer:
        banded = renderer.render(shells(12), size, tl.FragmentLists())
    for name in ("radiance", "thickness", "layers", "valid"):
        np.testing.assert_array_equal(getattr(banded, name), getattr(whole, name))


def test_a_buffer_that_opengl_cannot_hold_is_one_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Storage, "largest", property(lambda _: 1000))
    with (
        tl.Renderer() as renderer,
        pytest.raises(tl.RenderError, match=r"not have enough memory for 2 MB of surface lists.*DepthPeeling"),
    ):
        renderer.render(shells(3), (160, 120), tl.KBuffer(k=31))


@each_method
def test_several_samples_average_light_and_leave_layers_at_the_centers(renderer: tl.Renderer, method: Any) -> None:
    scene, size = shells(4), (48, 36)
    one, many = renderer.render(scene, size, method), renderer.render(scene, size, method, samples=4)
    for name in ("thickness", "layers", "truncated", "valid", "optical_depth"):
        np.testing.assert_array_equal(getattr(one, name), getattr(many, name))
    assert (one.radiance != many.radiance).any()


def test_without_shader_storage_the_planner_peels(monkeypatch: pytest.MonkeyPatch) -> None:
    from translucent.gpu import renderer as module

    monkeypatch.setattr(module, "SHADER_STORAGE", 1000)
    with tl.Renderer() as renderer:
        frame = renderer.render(shells(3), (32, 24))
        assert frame.plan.method == tl.DepthPeeling()
        with pytest.raises(
            tl.InputError, match=r"FragmentLists; this OpenGL has no shader storage.*use the method DepthPeeling"
        ):
            renderer.render(shells(3), (32, 24), tl.FragmentLists())


def test_the_summary_counts_layers(renderer: tl.Renderer) -> None:
    with pytest.warns(tl.TranslucentWarning, match="more than 4 surfaces"):
        summary = renderer.render(shells(3), (32, 24), tl.KBuffer(k=4)).summary()
    assert summary["layers"]["max"] == 6
    assert summary["layers"]["truncated_pixels"] == summary["invalid_pixels"] > 0
    assert "layers" not in renderer.render(shells(1), (32, 24), tl.SignedDepth()).summary()


def test_a_saved_frame_holds_its_layers(renderer: tl.Renderer, tmp_path: Path) -> None:
    frame = renderer.render(shells(3), (32, 24))
    frame.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as stored:
        np.testing.assert_array_equal(stored["layers"], frame.layers)
        np.testing.assert_array_equal(stored["truncated"], frame.truncated)
    renderer.render(
        tl.Scene([tl.Object(Box().tessellate(), AMBER)], tl.Camera.look_at((1, 2, 3), (0, 0, 0))), (8, 8)
    ).save(tmp_path / "b.npz")
    with np.load(tmp_path / "b.npz") as stored:
        assert "layers" not in stored


@pytest.mark.parametrize("corner", [(-1, -1), (1, -1), (-1, 1), (1, 1)])
def test_peeling_goes_on_for_the_one_pixel_that_needs_it(renderer: tl.Renderer, corner: tuple[int, int]) -> None:
    """A stack of plates in a corner of a picture whose size no tile divides, and a box everywhere else."""
    camera = tl.Camera.orthographic((0, 0, 10), (0, 0, 0), height=37.0)  # a pixel is 1 m
    spot = np.array(corner) * (25, 18)
    plates = [
        tl.Object(Box((spot[0] - 0.4, spot[1] - 0.4, z), (spot[0] + 0.4, spot[1] + 0.4, z + 0.5)).tessellate(), AMBER)
        for z in range(7)
    ]
    wide = tl.Object(Box((-20, -15, -2), (20, 15, -1)).tessellate(), AMBER)
    frame = renderer.render(tl.Scene([*plates, wide], camera), (51, 37), tl.DepthPeeling())
    assert frame.valid.all()
    assert frame.layers is not None
    assert frame.layers.max() == 14
    np.testing.assert_allclose(frame.thickness.max(), 3.5, rtol=1e-5)


@pytest.mark.parametrize("method", [tl.FragmentLists(), tl.KBuffer(k=4)], ids=["lists", "k-buffer"])
def test_no_face_hides_what_others_have_written_to_buffers(monkeypatch: pytest.MonkeyPatch, method: Any) -> None:
    """Faces fill whole tiles of the picture. While a timer runs, llvmpipe draws what they hide, too: here none does."""
    monkeypatch.setattr(PassTimer, "measure", lambda *_: contextlib.nullcontext())
    scene = tl.Scene(
        [tl.Object(Box.slab((4.0, 4.0), 1.0).tessellate(), AMBER)], tl.Camera.orthographic((0, 0, 5), (0, 0, 0))
    )
    with tl.Renderer() as renderer:
        frame = renderer.render(scene, (256, 256), method)
    assert frame.valid.all()
    assert (frame.layers == 2).all()
