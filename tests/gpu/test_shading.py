"""From thickness to the picture: media, emission, backgrounds, sheets, invalid pixels, antialiasing, presenting."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from tests.solids import Box, Sphere, Torus

SIZE = (96, 64)
CAMERA = tl.Camera.look_at((0.6, 0.8, 3.5), (0.0, 0.0, 0.0), fov_y=50)
BOX = Box(low=(-0.5, -0.4, -0.3), high=(0.5, 0.4, 0.3))
EPS = float(np.finfo(np.float32).eps)


#: A pixel at the bodies, in metres. Rasterizers decide coverage on a grid of 1/256 pixel: a center that lies nearer
#: than that to an edge may get the neighboring face, extended. Faces of these bodies bend by less than slope 4.
SNAP = 4 / 256 * 2 * float(np.tan(np.radians(25))) / SIZE[1] * 4.5


def _close(frame: tl.Frame, truth: tl.Frame, inside: np.ndarray) -> None:
    for name in ("thickness", "optical_depth", "transmittance", "radiance"):
        difference = np.abs(getattr(frame, name) - getattr(truth, name))[inside]
        assert np.quantile(difference, 0.99) <= 1e-5, name
        assert difference.max() <= 10 * SNAP, name  # extinctions here are up to 10 per metre


def _equal_off_edges(found: np.ndarray, exact: np.ndarray, rtol: float) -> None:
    """Faces of a sheet meet at an angle: pixels within 1/256 pixel of an edge, 1 in 100, may get the neighbor's."""
    wrong = np.abs(found - exact) > rtol * np.abs(exact)
    assert wrong.mean() <= 0.02, f"{wrong.sum()} of {wrong.size}"


ENVIRONMENTS = {
    "constant": tl.Environment.constant((0.2, 0.5, 0.9)),
    "gradient": tl.Environment.gradient((0.1, 0.2, 0.3), (1.0, 0.8, 0.6)),
    "checkerboard": tl.Environment.checkerboard((1.0, 0.9, 0.8), (0.1, 0.2, 0.3), tiles=7),
}


@pytest.mark.parametrize("environment", ENVIRONMENTS.values(), ids=ENVIRONMENTS)
@pytest.mark.parametrize("camera", [CAMERA, tl.Camera.orthographic((0.5, 1.0, 3.0), (0.0, 0.0, 0.0), height=2.0)])
def test_the_background_is_seen_through_the_body(
    renderer: tl.Renderer, environment: tl.Environment, camera: tl.Camera
) -> None:
    medium = tl.Medium.from_color("#7b1e3a", distance=0.4)
    scene = tl.Scene([tl.Object(BOX.tessellate(), medium=medium)], camera, environment=environment)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    _close(renderer.render(scene, SIZE), tl.reference.render(scene, SIZE), inside)


@pytest.mark.parametrize("absorption", [0.0, 1e-6, 2.0, 1e4, 1e30], ids=str)
def test_emission_in_closed_form_at_every_density(renderer: tl.Renderer, absorption: float) -> None:
    medium = tl.Medium(absorption=absorption, emission=(0.5, 1.0, 2.0))
    scene = tl.Scene([tl.Object(BOX.tessellate(), medium=medium)], CAMERA)
    frame, truth = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)
    assert np.isfinite(frame.radiance).all()
    inside = frame.coverage == truth.coverage
    # At 1e4 per metre a silhouette pixel's transmittance turns on thickness errors of 1e-5 m.
    tolerance = 1e-5 + 4 * EPS * BOX.tessellate().diagonal * min(absorption, 1e4)
    np.testing.assert_allclose(frame.radiance[inside], truth.radiance[inside], rtol=1e-4, atol=tolerance)


def test_optical_depths_of_different_media_add_up_in_any_order(renderer: tl.Renderer) -> None:
    sphere = Sphere(center=(0.3, 0.1, 0.2), radius=0.5).tessellate(48)
    bodies = [
        tl.Object(BOX.tessellate(), medium=tl.Medium(absorption=(1.0, 2.0, 3.0))),
        tl.Object(sphere, medium=tl.Medium(absorption=(5.0, 0.1, 0.0), scattering=(0.0, 0.4, 0.0))),
    ]
    frames = []
    for order in (bodies, bodies[::-1]):
        scene = tl.Scene(order, CAMERA)
        frame = renderer.render(scene, SIZE, scattering=tl.SingleScattering())
        assert frame.plan.spectral
        _close(frame, tl.reference.render(scene, SIZE), tl.interior(tl.reference.hit_counts(scene, SIZE)))
        frames.append(frame)
    np.testing.assert_allclose(frames[0].optical_depth, frames[1].optical_depth, atol=16 * EPS)


def test_opaque_density_is_black_and_never_nan(renderer: tl.Renderer) -> None:
    bodies = [
        tl.Object(BOX.tessellate(), medium=tl.Medium(absorption=(1e38, 0.0, 1.0))),
        tl.Object(Sphere(radius=0.6).tessellate(), medium=tl.Medium(absorption=(1e300, 1.0, 0.0))),
    ]
    for scene in (tl.Scene(bodies, CAMERA), tl.Scene(bodies[:1], CAMERA), tl.Scene(bodies[1:], CAMERA)):
        frame = renderer.render(scene, SIZE)
        for name in ("radiance", "transmittance", "optical_depth", "thickness"):
            assert np.isfinite(getattr(frame, name)).all(), name
        assert (frame.transmittance[frame.thickness > 1e-3][:, 0] == 0).all()


@pytest.mark.parametrize("ior", [1.0, 1.5])
@pytest.mark.parametrize("declared", [False, True])
def test_sheets_equal_the_reference(renderer: tl.Renderer, ior: float, declared: bool) -> None:
    mesh = Sphere().tessellate(64)
    medium = tl.Medium(absorption=(10.0, 200.0, 30.0), ior=ior)
    body = tl.Object(mesh, medium=medium, sheet_thickness=2e-3 if declared else None)
    scene = tl.Scene([body], CAMERA)
    method = None if declared else tl.ThinLayer(thickness=2e-3)
    frame, truth = renderer.render(scene, SIZE, method), tl.reference.render(scene, SIZE, method)
    assert frame.valid.all()
    facing = tl.interior(tl.reference.hit_counts(scene, SIZE)) & (truth.thickness < 0.05)
    _equal_off_edges(frame.thickness[facing], truth.thickness[facing], 1e-4)
    _equal_off_edges(frame.transmittance[facing], truth.transmittance[facing], 1e-4)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 0.5, 1.3), (-1.0, 1.5, 0.7)])
def test_sheets_follow_rotated_nonuniform_and_mirrored_transforms(
    renderer: tl.Renderer, scale: tuple[float, float, float]
) -> None:
    """A normal turns with the inverse transpose, not with the matrix: the sheet's own thickness stays as declared."""
    angle = 0.6
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn @ np.diag(scale) @ turn
    body = tl.Object(Sphere().tessellate(64), medium=tl.Medium(absorption=10.0), transform=matrix, sheet_thickness=2e-3)
    scene = tl.Scene([body], tl.Camera.look_at((1.5, 2.0, 7.0), (0.0, 0.0, 0.0), fov_y=50))
    frame, truth = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)
    facing = tl.interior(tl.reference.hit_counts(scene, SIZE)) & truth.coverage & (truth.thickness < 0.02)
    assert facing.sum() > 100
    _equal_off_edges(frame.thickness[facing], truth.thickness[facing], 1e-3)


def test_sharp_and_doubled_sheets_have_the_normals_of_their_faces(renderer: tl.Renderer) -> None:
    """A cube's corner is no reason to see its sides edge-on, nor is a quad with a face on either side."""
    cube = Box(low=(-0.5, -0.5, -0.5), high=(0.5, 0.5, 0.5)).tessellate()
    camera = tl.Camera.look_at((0.3, 0.2, 6.0), (0.0, 0.0, 0.0))
    frame = renderer.render(
        tl.Scene([tl.Object(cube, medium=tl.Medium(absorption=1.0))], camera), SIZE, tl.ThinLayer(0.01)
    )
    assert np.median(frame.thickness[frame.coverage]) == pytest.approx(0.02, rel=0.01)
    quad = tl.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]])
    camera = tl.Camera.orthographic((3.0, 0.0, 3.0), (0.0, 0.0, 0.0), height=0.1)
    body = tl.Object(quad, medium=tl.Medium(absorption=1.0), sheet_thickness=0.01)
    frame = renderer.render(tl.Scene([body], camera), (4, 4))
    np.testing.assert_allclose(frame.thickness, 0.02 * np.sqrt(2), rtol=1e-5)


def test_a_tilted_sheet_is_its_thickness_over_the_cosine(renderer: tl.Renderer) -> None:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    sheet = tl.Mesh(corners, [[0, 1, 2], [0, 2, 3]])
    for angle in (0.0, 60.0, 80.0):
        eye = 5.0 * np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
        for side in (1.0, -1.0):
            camera = tl.Camera.orthographic(eye * side, (0.0, 0.0, 0.0), height=0.1)
            scene = tl.Scene([tl.Object(sheet, medium=tl.Medium(absorption=1.0), sheet_thickness=1e-3)], camera)
            frame = renderer.render(scene, (4, 4))
            np.testing.assert_allclose(frame.thickness, 1e-3 / np.cos(np.radians(angle)), rtol=1e-5)


def test_a_sheet_and_a_solid_add_up_in_one_frame(renderer: tl.Renderer) -> None:
    solid = tl.Object(BOX.tessellate(), medium=tl.Medium(absorption=(1.0, 2.0, 3.0)))
    sheet = tl.Object(
        Sphere(radius=0.8).tessellate(64), medium=tl.Medium(absorption=(9.0, 0.5, 4.0)), sheet_thickness=5e-3
    )
    scene = tl.Scene([solid, sheet], CAMERA)
    frame, truth = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE)) & (truth.thickness < 2.0)
    _equal_off_edges(frame.optical_depth[inside], truth.optical_depth[inside], 1e-4)


def _broken(missing: int | None = None, flipped: int | None = None) -> tl.Mesh:
    mesh = Sphere().tessellate(24)
    faces = mesh.faces.copy()
    if flipped is not None:
        faces[flipped] = faces[flipped, ::-1]
    if missing is not None:
        faces = np.delete(faces, missing, axis=0)
    return tl.Mesh(mesh.vertices, faces, name="broken")


@pytest.mark.parametrize("defect", [{"missing": 100}, {"flipped": 100}], ids=["hole", "flipped face"])
def test_a_hole_marks_its_pixels_and_only_those(renderer: tl.Renderer, defect: dict[str, int]) -> None:
    broken, whole = _broken(**defect), _broken()
    # Look straight at the defect, in its middle third.
    middle = whole.vertices[whole.faces[100]].mean(axis=0)
    camera = tl.Camera.look_at(4 * middle / np.linalg.norm(middle), (0.0, 0.0, 0.0), up=(0.1, 0.2, 0.9), fov_y=30)
    scenes = [tl.Scene([tl.Object(mesh, medium=tl.Medium(absorption=1.0))], camera) for mesh in (broken, whole)]
    with pytest.warns(tl.TranslucentWarning, match=r"\d+ pixels are not valid .* edges") as caught:
        frame = renderer.render(scenes[0], SIZE)
    assert len(caught) == 1
    truth = tl.reference.render(scenes[0], SIZE)
    intact = tl.reference.render(scenes[1], SIZE)
    assert 0 < (~frame.valid).sum() < 0.1 * frame.coverage.sum()
    inner = tl.interior(tl.reference.hit_counts(scenes[0], SIZE))
    assert (frame.valid == truth.valid)[inner].all()
    assert np.isfinite(frame.thickness).all()
    kept = frame.valid & inner
    np.testing.assert_allclose(frame.thickness[kept], intact.thickness[kept], atol=SNAP)
    # Where nothing can be trusted, sheets stand in, so that the picture has no black holes.
    assert (frame.thickness[~frame.valid & frame.coverage] > 0).any()


def _open_box(missing: slice, shift: float) -> tl.Object:
    mesh = Box(low=(-0.5, -0.5, -0.5 + shift), high=(0.5, 0.5, 0.5 + shift)).tessellate()
    normals = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
    side = 1.0 if missing.start is None else -1.0
    faces = mesh.faces[normals[:, 2] * side <= 0]
    return tl.Object(tl.Mesh(mesh.vertices, faces, name="open box"), medium=tl.Medium(absorption=1.0))


FRONT_MISSING, BACK_MISSING = slice(None), slice(1)


def test_holes_of_two_bodies_do_not_cancel(renderer: tl.Renderer) -> None:
    """One box without its front, one without its back: together the ray enters as often as it leaves."""
    scene = tl.Scene(
        [_open_box(FRONT_MISSING, 0.0), _open_box(BACK_MISSING, -2.0)],
        tl.Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=10),
    )
    with pytest.warns(tl.TranslucentWarning, match="not valid"):
        frame = renderer.render(scene, (16, 16))
    assert not frame.valid[8, 8]
    assert not tl.reference.render(scene, (16, 16)).valid[8, 8]


@pytest.mark.parametrize("missing", [FRONT_MISSING, BACK_MISSING])
@pytest.mark.parametrize("plane", [3.0, 0.2])
def test_orthographic_holes_are_found_wherever_the_plane_is(
    renderer: tl.Renderer, missing: slice, plane: float
) -> None:
    camera = tl.Camera.orthographic((0.01, 0.02, plane), (0.01, 0.02, -9.0), height=0.5)
    with pytest.warns(tl.TranslucentWarning, match="not valid"):
        frame = renderer.render(tl.Scene([_open_box(missing, 0.0)], camera), (16, 16))
    assert not frame.valid.any()


def test_an_open_body_does_not_erase_a_closed_one(renderer: tl.Renderer) -> None:
    closed = tl.Object(
        Box(low=(-0.5, -0.5, -3.5), high=(0.5, 0.5, -2.5)).tessellate(), medium=tl.Medium(absorption=1.0)
    )
    scene = tl.Scene([_open_box(FRONT_MISSING, 0.0), closed], tl.Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=5))
    with pytest.warns(tl.TranslucentWarning, match="not valid"):
        frame = renderer.render(scene, (8, 8))
    assert not frame.valid[4, 4]
    assert 1.0 < frame.thickness[4, 4] < 1.1


def test_an_inverted_mesh_is_as_thick_as_its_right_way_copy(renderer: tl.Renderer) -> None:
    mesh = Sphere().tessellate(32)
    inverted = tl.Mesh(mesh.vertices, mesh.faces[:, ::-1])
    frames = [
        renderer.render(tl.Scene([tl.Object(m, medium=tl.Medium(absorption=1.0))], CAMERA), SIZE)
        for m in (mesh, inverted)
    ]
    assert frames[1].valid.all()
    difference = np.abs(frames[1].thickness - frames[0].thickness)
    assert np.quantile(difference, 0.99) <= 1e-6
    assert difference.max() <= SNAP


def test_an_inverted_part_is_marked_invalid(renderer: tl.Renderer) -> None:
    """Two spheres, one inside out: its pixels balance, yet their thickness is negative."""
    good, bad = Sphere((-1.0, 0.0, 0.0), 0.6).tessellate(32), Sphere((1.0, 0.0, 0.0), 0.4).tessellate(32)
    mesh = tl.Mesh(
        np.concatenate([good.vertices, bad.vertices]),
        np.concatenate([good.faces, bad.faces[:, ::-1] + len(good.vertices)]),
    )
    assert mesh.diagnosis.solid
    assert mesh.diagnosis.inside_out_parts == 1
    scene = tl.Scene([tl.Object(mesh, medium=tl.Medium(absorption=1.0))], tl.Camera.look_at((0, 0.4, 4), (0, 0, 0)))
    assert not tl.plan(scene).exact
    with pytest.warns(tl.TranslucentWarning, match="1 closed parts are inside out"):
        frame = renderer.render(scene, SIZE)
    inverted = Sphere((1.0, 0.0, 0.0), 0.4).chord(*scene.camera.rays(SIZE)) > 0.1
    assert not frame.valid[inverted].any()
    assert frame.valid[:, : SIZE[0] // 2].all()


def test_doubled_faces_are_marked_and_cancelled_walls_are_empty(renderer: tl.Renderer) -> None:
    mesh = BOX.tessellate()
    doubled = tl.Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:2]]))
    with pytest.warns(tl.TranslucentWarning, match="not valid"):
        frame = renderer.render(
            tl.Scene(
                [tl.Object(doubled, medium=tl.Medium(absorption=1.0))], tl.Camera.look_at((-3, 0.1, 0.2), (0, 0, 0))
            ),
            SIZE,
        )
    assert not frame.valid.all()
    walls = tl.Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))
    frame = renderer.render(tl.Scene([tl.Object(walls, medium=tl.Medium(absorption=1.0))], CAMERA), SIZE)
    assert frame.valid.all()
    np.testing.assert_allclose(frame.thickness, 0, atol=1e-5)


def test_samples_tell_their_share_one_by_one(renderer: tl.Renderer) -> None:
    shares: list[float] = []
    ball = tl.Object(Sphere().tessellate(12), tl.Medium(absorption=1.0, ior=1.5))
    scene = tl.Scene([ball], tl.Camera.look_at((0, 0, 5), (0, 0, 0)))
    renderer.render(scene, (8, 8), samples=4, adaptive=False, progress=shares.append)
    assert shares == [0.25, 0.5, 0.75, 1.0]
    adaptive: list[float] = []
    renderer.render(scene, (8, 8), samples=4, progress=adaptive.append)
    assert adaptive == sorted(adaptive)
    assert adaptive[:4] == [0.125, 0.25, 0.375, 0.5]
    assert 0.5 < adaptive[-1] <= 1.0


def test_samples_average_transmittance_not_thickness(renderer: tl.Renderer) -> None:
    """An edge of an opaque box through a pixel: the mean of 0 and 1 is its share, exp(-mean) would be black."""
    medium = tl.Medium(absorption=1e6)
    camera = tl.Camera.orthographic(
        (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), height=0.9
    )  # 9 pixels of 0.1: edges at +-0.5 miss
    mesh = Box(low=(-0.325, -0.325, -0.3), high=(0.325, 0.325, 0.3)).tessellate()
    scene = tl.Scene([tl.Object(mesh, medium=medium)], camera)
    samples = 64
    frame = renderer.render(scene, (9, 9), samples=samples)
    edges = np.arange(9) * 0.1 - 0.45
    share = np.clip(np.minimum(edges + 0.1, 0.325) - np.maximum(edges, -0.325), 0, 0.1) / 0.1
    # 64 Sobol points in a square miss the area of an axis-parallel box by less than 2 points.
    np.testing.assert_allclose(frame.transmittance[..., 0], 1 - np.outer(share, share), atol=2.0 / samples)
    single = renderer.render(scene, (9, 9))
    np.testing.assert_array_equal(frame.thickness, single.thickness)
    assert set(np.unique(single.transmittance)) <= {0.0, 1.0}


@pytest.mark.parametrize("tone", ["none", "neutral", "agx"])
def test_present_shows_the_picture_that_save_writes(renderer: tl.Renderer, tone: str) -> None:
    scene = tl.showcase(BOX.tessellate(), size=SIZE, stage="none")
    with renderer.gpu.context.current() as gl:
        window = gl.framebuffer([gl.texture(SIZE, 4)])
    plan = renderer.draw(scene, window, exposure=0.5, tone=tone)
    with renderer.gpu.context.current():
        shown = np.frombuffer(window.read(components=3, alignment=1), np.uint8).reshape(SIZE[1], SIZE[0], 3)[::-1]
    frame = renderer.render(scene, SIZE)
    assert plan.passes == frame.plan.passes
    assert np.abs(shown.astype(int) - frame.to_srgb8(exposure=0.5, tone=tone)).max() <= 1


def test_arrays_are_contiguous_and_the_callers_own(renderer: tl.Renderer) -> None:
    scene = tl.showcase(BOX.tessellate(), size=SIZE, stage="none")
    frame = renderer.render(scene, SIZE)
    kept = frame.thickness.copy()
    for name, dtype in (
        ("radiance", np.float32),
        ("thickness", np.float32),
        ("coverage", np.bool_),
        ("valid", np.bool_),
    ):
        array = getattr(frame, name)
        assert array.flags.c_contiguous
        assert array.dtype == dtype
        array[:] = 0
    np.testing.assert_array_equal(renderer.render(scene, SIZE).thickness, kept)
    assert frame.seconds.keys() == {"signed_depth", "transmittance", "total"}
    assert {"backend", "renderer", "driver", "numpy", "moderngl"} <= frame.provenance.keys()


@pytest.mark.parametrize("method", [tl.SignedDepth(), tl.FragmentLists(), tl.DepthPeeling(), tl.KBuffer()], ids=str)
def test_faces_that_a_silhouette_swaps_are_not_inside_out(renderer: tl.Renderer, method: tl.Method) -> None:
    """The rasterizer moves vertices by up to 1/512 of a pixel, and in a pixel or two steep faces change places here."""
    mesh = Torus().tessellate(64)
    direction = np.random.default_rng(10).normal(size=3)
    camera = tl.Camera.look_at(mesh.diagonal * 1.2 * direction / np.linalg.norm(direction), (0, 0, 0), fov_y=45)
    frame = renderer.render(tl.Scene([tl.Object(mesh, tl.Medium(absorption=1.0))], camera), (512, 512), method)
    assert frame.valid.all()
