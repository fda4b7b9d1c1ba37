"""The fast path against the float64 reference, on scanned and CAD meshes, near, far and at the edges of float32."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.scans import scan
from tests.solids import Box
from translucent.frames.metrics import interior

SIZE = (160, 160)
ABSORBING = tl.Medium(absorption=1.0)
SCANS = ["bunny.obj", "armadillo.obj", "quadknot.obj", "mengerSponge3.glb"]


def _scene(mesh: tl.Mesh, camera: tl.Camera, **kwargs: object) -> tl.Scene:
    return tl.Scene([tl.Object(mesh, medium=ABSORBING, **kwargs)], camera)  # type: ignore[arg-type]


def _errors(renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int] = SIZE) -> tl.Errors:
    frame, truth = renderer.render(scene, size), tl.reference.render(scene, size)
    errors = tl.compare(frame, truth, mask=interior(tl.reference.hit_counts(scene, size)))
    print(f"diagonal {scene.diagonal:.4g} m; {errors}")  # shown by pytest -rP
    return errors


@pytest.mark.parametrize("name", SCANS)
def test_thickness_equals_the_reference(renderer: tl.Renderer, assets: Path, name: str) -> None:
    mesh = scan(assets / "meshes_clean" / name)
    errors = _errors(renderer, _scene(mesh, tl.Camera.framing(mesh.vertices, SIZE)))
    assert errors.median <= 1e-7 * mesh.diagonal
    assert errors.p999 <= 1e-5 * mesh.diagonal
    assert errors.coverage_mismatch <= 3e-4
    assert errors.invalid == 0


@pytest.mark.parametrize("name", SCANS)
def test_thickness_survives_a_camera_10_000_diameters_away(renderer: tl.Renderer, assets: Path, name: str) -> None:
    mesh = scan(assets / "meshes_clean" / name)
    direction = np.array([0.5, 0.4, 0.77])
    eye = mesh.center + direction / np.linalg.norm(direction) * 1e4 * mesh.diagonal
    camera = tl.Camera.look_at(eye, mesh.center, fov_y=float(np.degrees(1.1e-4)))
    errors = _errors(renderer, _scene(mesh, camera))
    assert errors.median <= 1e-7 * mesh.diagonal
    assert errors.p999 <= 1e-5 * mesh.diagonal
    assert errors.coverage_mismatch <= 3e-4
    assert errors.invalid == 0


@pytest.mark.parametrize("tilt", [0.0, 5e-3, 0.5])
def test_a_thin_slab_10_000_diameters_away_keeps_five_digits_and_camera_distances_do_not(
    renderer: tl.Renderer, tilt: float
) -> None:
    """A slab of relative thickness 1e-3. The unanchored variant is the proof that this test can fail.

    Vertex offsets are float32 multiples of at most eps/2 of their size. Face-on they are exact along the ray. Tilted,
    the ray crosses at depths up to 0.5 sin(tilt), so rounding is up to a few eps times that, relative to the thickness.
    """
    mesh = Box.slab((1.0, 1.0), 1e-3).tessellate()
    eye = 1e4 * mesh.diagonal * np.array([0.0, np.sin(tilt), np.cos(tilt)])
    scene = _scene(mesh, tl.Camera.look_at(eye, (0.0, 0.0, 0.0), fov_y=float(np.degrees(1.1e-4))))
    truth = tl.reference.render(scene, SIZE)
    inside = interior(tl.reference.hit_counts(scene, SIZE)) & truth.coverage
    relative = {}
    for anchored in (True, False):
        frame = renderer.render(scene, SIZE, tl.SignedDepth(anchored=anchored))
        assert frame.valid.all()
        relative[anchored] = np.quantile(np.abs(frame.thickness[inside] / truth.thickness[inside] - 1), 0.99)
    rounding = 4 * float(np.finfo(np.float32).eps) * 0.5 * np.sin(tilt) / 1e-3
    print(f"p99 relative error: anchored {relative[True]:.1e}, from the camera {relative[False]:.1e}")
    assert relative[True] <= 1e-5 + rounding
    assert relative[False] > 1e-2


@pytest.mark.parametrize("name", ["bunny.obj", "armadillo.obj", "nested_shell_Cray_left.obj", "ballA.off"])
def test_an_eye_inside_sees_the_rest_of_the_body(renderer: tl.Renderer, assets: Path, name: str) -> None:
    path = next(assets.glob(f"meshes_*/{name}"))
    mesh = scan(path)
    # A point just under some face is inside, whatever the shape.
    corners = mesh.vertices[mesh.faces[len(mesh.faces) // 3]]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    eye = corners.mean(axis=0) - 1e-3 * mesh.diagonal * normal / np.linalg.norm(normal)
    assert round(mesh.winding_number(eye)) == 1
    camera = tl.Camera.look_at(eye, eye + (0.2, -0.3, 1.0), fov_y=100)
    errors = _errors(renderer, _scene(mesh, camera), (200, 150))
    # Distances count from the eye: up to a diagonal, at up to 1 / cos(corner of the view) per unit of depth.
    assert errors.median <= 2e-7 * mesh.diagonal
    assert errors.p999 <= 1e-5 * mesh.diagonal
    assert errors.invalid == 0


def test_an_eye_inside_nested_bodies_sees_both(renderer: tl.Renderer) -> None:
    outer, inner = (
        Box(low=(-1, -1, -1), high=(1, 1, 1)).tessellate(),
        Box(low=(-0.5, -0.5, -0.5), high=(0.5, 0.5, 0.5)).tessellate(),
    )
    scene = tl.Scene(
        [tl.Object(outer, medium=ABSORBING), tl.Object(inner, medium=tl.Medium(absorption=(3.0, 2.0, 1.0)))],
        tl.Camera.look_at((0.1, 0.2, 0.3), (1.0, 0.3, -0.2), fov_y=100),
    )
    frame, truth = renderer.render(scene, (200, 150)), tl.reference.render(scene, (200, 150))
    assert frame.valid.all()
    np.testing.assert_allclose(frame.thickness, truth.thickness, atol=1e-5)
    np.testing.assert_allclose(frame.optical_depth, truth.optical_depth, rtol=1e-5)


@pytest.mark.parametrize("where", ["face", "edge", "corner"])
def test_an_eye_on_the_surface_trusts_rays_inwards_and_outwards(renderer: tl.Renderer, where: str) -> None:
    box = Box(low=(-1, -1, -1), high=(1, 1, 1))
    eye = {"face": (0.0, 0.0, 1.0), "edge": (0.0, 1.0, 1.0), "corner": (1.0, 1.0, 1.0)}[where]
    for target in ((0.1, 0.2, -3.0), (0.3, 0.1, 5.0)):
        camera = tl.Camera.look_at(eye, target, fov_y=70)
        frame = renderer.render(_scene(box.tessellate(), camera), (90, 60))
        exact = box.chord(*camera.rays((90, 60)))
        assert frame.valid.all()
        np.testing.assert_allclose(frame.thickness, exact, atol=1e-5)


@pytest.mark.parametrize("gap", [-1e-8, -1e-10, 0.0, 1e-10, 1e-8, 1e-7])
def test_an_eye_just_off_a_surface_is_no_reason_to_distrust_the_frame(renderer: tl.Renderer, gap: float) -> None:
    box = Box(low=(-1, -1, -1), high=(1, 1, 1))
    for target in ((0.1, 0.2, -3.0), (0.3, 0.1, 5.0)):
        camera = tl.Camera.look_at((0.0, 0.0, 1.0 + gap), target, fov_y=70)
        frame = renderer.render(_scene(box.tessellate(), camera), (90, 60))
        assert frame.valid.all()
        np.testing.assert_allclose(frame.thickness, box.chord(*camera.rays((90, 60))), atol=2e-5)


def _rotation(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 0.5, 1.3), (-1.0, 1.0, 1.0), (-0.7, -1.5, -2.0)])
def test_rotated_nonuniform_and_mirrored_transforms_equal_the_reference(
    renderer: tl.Renderer, assets: Path, scale: tuple[float, float, float]
) -> None:
    mesh = scan(assets / "meshes_clean" / "armadillo.obj")
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation((1, 2, 3), 0.7) @ np.diag(scale) @ _rotation((3, -1, 2), 1.1)
    matrix[:3, 3] = (10.0, -20.0, 5.0)
    body = tl.Object(mesh, medium=ABSORBING, transform=matrix)
    world = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    scene = tl.Scene([body], tl.Camera.framing(world, SIZE))
    errors = _errors(renderer, scene)
    assert errors.median <= 1e-7 * scene.diagonal
    assert errors.p999 <= 1e-5 * scene.diagonal
    assert errors.coverage_mismatch <= 3e-4
    assert errors.invalid == 0
    # The same body with its vertices moved by hand: the shape of the result does not depend on who transforms.
    faces = mesh.faces if np.linalg.det(matrix[:3, :3]) > 0 else mesh.faces[:, ::-1]
    by_hand = renderer.render(_scene(tl.Mesh(world, faces), scene.camera), SIZE)
    frame = renderer.render(scene, SIZE)
    same = interior(tl.reference.hit_counts(scene, SIZE))
    difference = np.abs(frame.thickness - by_hand.thickness)[same]
    assert np.quantile(difference, 0.999) <= 1e-5 * scene.diagonal


@pytest.mark.parametrize(
    ("unit", "shift"),
    [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-2, 1e4)],
    ids=["micrometres", "1000 km", "1e6 m from the origin", "1 cm, 10 km away"],
)
def test_units_and_distance_from_the_origin_do_not_matter(
    renderer: tl.Renderer, assets: Path, unit: float, shift: float
) -> None:
    mesh = scan(assets / "meshes_clean" / "rocker-arm.obj")
    matrix = np.diag([unit, unit, unit, 1.0])
    matrix[:3, 3] = (shift, -0.5 * shift, 0.3 * shift)
    world = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    scene = tl.Scene([tl.Object(mesh, medium=ABSORBING, transform=matrix)], tl.Camera.framing(world, SIZE))
    errors = _errors(renderer, scene)
    assert errors.median <= 1e-7 * scene.diagonal
    assert errors.p999 <= 1e-5 * scene.diagonal
    assert errors.invalid == 0


def test_vertices_far_from_the_origin_keep_their_detail(renderer: tl.Renderer, assets: Path) -> None:
    """The offset of Embree's watertightness test: float32 resolves 1.6 cm there, the mesh is 1 m."""
    mesh = scan(assets / "meshes_clean" / "rocker-arm.obj")
    moved = tl.Mesh(mesh.vertices + (148376.0, 1234.0, -223423.0), mesh.faces)
    errors = _errors(renderer, _scene(moved, tl.Camera.framing(moved.vertices, SIZE)))
    assert errors.median <= 1e-7 * mesh.diagonal
    assert errors.p999 <= 1e-5 * mesh.diagonal
    assert errors.invalid == 0


def _volume(renderer: tl.Renderer, mesh: tl.Mesh, size: int = 1024) -> tuple[float, float]:
    """Sum of thickness x pixel area in an orthographic view, and the area of a pixel's row times the depth."""
    radius = 0.51 * mesh.diagonal
    camera = tl.Camera.orthographic(
        mesh.center + np.array([0.3, 0.5, 0.8]) * 2 * radius, mesh.center, height=2 * radius
    )
    frame = renderer.render(_scene(mesh, camera), (size, size))
    assert frame.valid.all()
    pixel = (2 * radius / size) ** 2
    return float(frame.thickness.sum(dtype=np.float64) * pixel), pixel


@pytest.mark.parametrize("name", ["bunny.obj", "armadillo.obj", "torus.obj", "mengerSponge3.glb", "idler_riser.STL"])
def test_thickness_times_pixel_area_sums_to_the_volume(renderer: tl.Renderer, assets: Path, name: str) -> None:
    mesh = scan(assets / "meshes_clean" / name)
    volume, _ = _volume(renderer, mesh)
    # A sum over pixel centers errs by at most half a pixel times the sum of thickness steps along rows, and mostly
    # cancels; 1e-3 is a hundredth of one pixel along the silhouette of these shapes at 1024 pixels.
    assert volume == pytest.approx(mesh.volume, rel=1e-3)


def test_the_tray_is_as_thick_as_its_plate_and_two_balls_add_up(renderer: tl.Renderer, assets: Path) -> None:
    tray = scan(assets / "meshes_clean" / "1002_tray_bottom.STL")
    camera = tl.Camera.orthographic(tray.center + (0.0, 500.0, 0.0), tray.center, up=(0, 0, 1), height=400.0)
    frame = renderer.render(_scene(tray, camera), SIZE)
    assert np.median(frame.thickness[frame.coverage]) == pytest.approx(3.175, rel=1e-6)

    balls = [scan(assets / "meshes_clean" / f"ball{k}.off") for k in "AB"]
    points = np.concatenate([ball.vertices for ball in balls])
    center, height = points.mean(axis=0), 1.2 * float(np.linalg.norm(np.ptp(points, axis=0)))
    camera = tl.Camera.orthographic(center + (0.0, 0.0, 100.0), center, height=height)
    frame = renderer.render(tl.Scene([tl.Object(b, medium=ABSORBING) for b in balls], camera), (1024, 1024))
    assert frame.valid.all()
    total = frame.thickness.sum(dtype=np.float64) * (height / 1024) ** 2
    assert total == pytest.approx(2802.21, rel=1e-3)


@pytest.mark.parametrize("fov", [90.0, 150.0])
def test_thickness_is_along_the_ray_not_along_the_axis(renderer: tl.Renderer, fov: float) -> None:
    """The corner ray of a wide view is longer than its depth: 2.27 times at 90 degrees and 16:9."""
    box = Box(low=(-50.0, -50.0, -2.0), high=(50.0, 50.0, -1.0))
    camera = tl.Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), fov_y=fov)
    size = (160, 90)
    frame = renderer.render(_scene(box.tessellate(), camera), size)
    exact = box.chord(*camera.rays(size))
    np.testing.assert_allclose(frame.thickness, exact, rtol=2e-5)
    if fov == 90.0:
        assert frame.thickness[0, 0] == pytest.approx(2.27, abs=0.02)


@pytest.mark.parametrize("size", [(1, 1), (1, 37), (37, 1), (8192, 2)])
def test_odd_frame_sizes(renderer: tl.Renderer, size: tuple[int, int]) -> None:
    box = Box(low=(-1, -1, -1), high=(1, 1, 1))
    camera = tl.Camera.orthographic((0.3, 0.2, 4.0), (0.0, 0.0, 0.0), height=2.5 * size[1] / max(size))
    frame = renderer.render(_scene(box.tessellate(), camera), size)
    assert frame.thickness.shape == size[::-1]
    np.testing.assert_allclose(frame.thickness, box.chord(*camera.rays(size)), atol=1e-4)


def test_vertices_on_pixel_centers_and_edges_along_pixel_rows_are_counted_once(renderer: tl.Renderer) -> None:
    """A cube whose faces are grids: in this view every vertex lies on a pixel center, every edge on a row or column."""
    count = 16
    grid = np.arange(count + 1) / count
    x, y = np.meshgrid(grid, grid, indexing="ij")
    flat = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    quads = np.stack([flat[:-1, :-1], flat[1:, :-1], flat[1:, 1:], flat[:-1, 1:]], axis=-1).reshape(-1, 4)
    front = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    top = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    bottom = top - (0, 0, 1)
    rim = np.concatenate([flat[:, 0], flat[-1, 1:], flat[-2::-1, -1], flat[0, -2:0:-1]])
    after = np.roll(rim, -1)
    n = len(top)
    sides = np.concatenate([np.stack([rim + n, after + n, after], axis=1), np.stack([rim + n, after, rim], axis=1)])
    mesh = tl.Mesh(np.concatenate([top, bottom]), np.concatenate([front, front[:, ::-1] + n, sides]))
    assert mesh.diagnosis.solid
    pixels = 20  # two pixels of margin: a pixel is 1/16, and its center is on the grid
    camera = tl.Camera.orthographic(
        (0.5 + 0.5 / 16, 0.5 + 0.5 / 16, 5.0), (0.5 + 0.5 / 16, 0.5 + 0.5 / 16, 0.0), height=pixels / 16
    )
    frame = renderer.render(_scene(mesh, camera), (pixels, pixels))
    assert frame.valid.all()
    assert set(np.unique(frame.thickness)) <= {np.float32(0), np.float32(1)}
    assert frame.coverage.sum() >= count * count


def test_bodies_of_very_different_size_in_one_frame(renderer: tl.Renderer) -> None:
    big, small = (
        Box(low=(-50.0, -50.0, -60.0), high=(50.0, 50.0, -10.0)),
        Box(low=(-0.005, -0.005, -0.005), high=(0.005, 0.005, 0.005)),
    )
    camera = tl.Camera.look_at((0.001, 0.002, 0.04), (0.0, 0.0, 0.0), fov_y=40)
    scene = tl.Scene(
        [tl.Object(b.tessellate(), medium=m) for b, m in ((big, tl.Medium(absorption=1e-9)), (small, ABSORBING))],
        camera,
    )
    frame = renderer.render(scene, (96, 64))
    exact = small.chord(*camera.rays((96, 64)))
    # With different media the optical depth of each body is resolved at that body's own scale.
    np.testing.assert_allclose(
        frame.optical_depth[..., 0] - 1e-9 * big.chord(*camera.rays((96, 64))), exact, atol=1e-5 * 0.0173
    )
