"""Adaptive sampling: the picture of all samples, from rays of the samples that matter."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
import translucent.gpu.job as job_module
import translucent.gpu.renderer as renderer_module
from translucent.geometry.ray_caster import RayCaster
from translucent.geometry.solids import Box, Sphere
from translucent.gpu import adaptive
from translucent.gpu.adaptive import isolated_pixels, lattice_variance, uneven_part, wanted_samples
from translucent.gpu.job import FrameJob
from translucent.gpu.placement import FaceExtents, Part
from translucent.gpu.targets import read_floats
from translucent.scene.camera import Window
from translucent.scene.showcase import showcase
from translucent.scene.stages import STAGES

Floats = npt.NDArray[np.float32]

SIZE = (40, 32)
CAMERA = tl.Camera.look_at((0.3, 0.4, 5.0), (0, 0, 0), fov_y=30.0)
SKY = tl.Environment.gradient((0.1, 0.2, 0.4), (1.0, 0.9, 0.7))
GLASS = tl.Medium(absorption=(0.2, 0.5, 0.9), ior=1.5)


def ball(**rest: object) -> tl.Scene:
    return tl.Scene([tl.Object(Sphere().tessellate(24), GLASS, **rest)], CAMERA, environment=SKY)  # type: ignore[arg-type]


def traced(frame: tl.Frame) -> float:
    return float(frame.provenance["traced_samples"].split()[0])


def on_a_floor() -> tl.Scene:
    floor = tl.Object(Box((-4.0, -1.3, -4.0), (4.0, -1.2, 4.0)).tessellate(1), None, color=(0.6, 0.4, 0.3))
    return dataclasses.replace(ball(), objects=[*ball().objects, floor])


def lit_from_behind() -> tl.Scene:
    """A coated ball that scatters along straight rays, without a highlight."""
    hazy = dataclasses.replace(GLASS, scattering=(0.1, 0.2, 0.15), emission=(0.1, 0.0, 0.2))
    scene = ball(surface=tl.Surface(color=(0.7, 0.9, 0.9), clearcoat=0.5))
    lights = [tl.DirectionalLight((0.0, 0.0, 1.0), (3.0, 3.0, 3.0))]
    return dataclasses.replace(scene, objects=[dataclasses.replace(scene.objects[0], medium=hazy)], lights=lights)


@pytest.mark.parametrize("scene", [on_a_floor(), lit_from_behind()], ids=["on a floor", "scattering"])
def test_the_picture_is_that_of_all_samples(renderer: tl.Renderer, scene: tl.Scene) -> None:
    scattering = tl.SingleScattering() if scene.lights else None
    few, every = (
        renderer.render(scene, SIZE, samples=16, adaptive=adaptive, scattering=scattering) for adaptive in (True, False)
    )
    assert traced(few) < 5.5
    for name in ("transmittance", "optical_depth", "thickness", "coverage", "valid", "normals"):
        np.testing.assert_array_equal(few.arrays[name], every.arrays[name], err_msg=name)
    mean = every.radiance[every.coverage].mean()
    off = (few.radiance - every.radiance)[every.coverage]
    # Much less than the error that does not show.
    assert np.sqrt(np.square(off, dtype=np.float64).mean()) < 0.6 * adaptive.ERROR * mean
    assert abs(off.mean(dtype=np.float64)) < 0.002 * mean  # in pixels as coarse as these
    assert np.abs(off).max() < 0.13 * mean
    np.testing.assert_allclose(few.radiance[~every.coverage], every.radiance[~every.coverage], atol=1e-6)


def test_a_smooth_interior_is_traced_once(renderer: tl.Renderer) -> None:
    """The window is flat, and larger than the picture: no edge is in it."""
    window = tl.Object(Box((-9.0, -9.0, -0.2), (9.0, 9.0, 0.2)).tessellate(1), GLASS)
    scene = tl.Scene([window], tl.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=20.0), environment=SKY)
    few, every = (renderer.render(scene, SIZE, samples=16, adaptive=adaptive) for adaptive in (True, False))
    assert few.provenance["traced_samples"] == "1.0 of 16"
    np.testing.assert_allclose(few.radiance, every.radiance, rtol=5e-3)


def on_a_polished_ground() -> tl.Scene:
    corners = np.array([(-9.0, -1.05, -9.0), (9.0, -1.05, -9.0), (9.0, -1.05, 9.0), (-9.0, -1.05, 9.0)])
    coat = tl.Surface(color=(0.02, 0.02, 0.02), roughness=0.25, double_sided=False)
    ground = tl.Object(tl.Mesh(corners, np.array([(0, 2, 1), (0, 3, 2)], np.int32)), surface=coat, shadow_catcher=True)
    camera = tl.Camera.look_at((0.3, 0.4, 7.0), (0, -0.7, 0), fov_y=30.0)
    return dataclasses.replace(ball(), objects=[*ball().objects, ground], camera=camera)


def test_what_a_ground_mirrors_is_that_of_all_samples(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """In few of them: the ground is dark, so that a third of its light is the mirror image of the ball."""
    scene, taken = on_a_polished_ground(), []
    read = renderer_module.read_averages

    def counted(job: FrameJob, samples: int) -> tuple[Floats, Floats, Floats]:
        taken.append(read_floats(job.targets["mirrored"], 0, 4)[..., 3] if job.bent_apart else None)
        return read(job, samples)

    monkeypatch.setattr(renderer_module, "read_averages", counted)
    few, every = (renderer.render(scene, SIZE, samples=16, adaptive=adaptive) for adaptive in (True, False))
    beside = ~every.coverage
    mean = every.radiance[beside].mean()
    off = (few.radiance - every.radiance)[beside]
    # Both are 0.0106 from the mean of 256 samples, and 0.126 in one pixel.
    assert np.sqrt(np.square(off, dtype=np.float64).mean()) < 0.006 * mean
    assert np.abs(off).max() < 0.1 * mean
    plain = dataclasses.replace(scene, objects=[scene.objects[0], _without_a_coat(scene.objects[1])])
    unmirrored = renderer.render(plain, SIZE, samples=16).radiance
    assert np.abs(every.radiance - unmirrored)[beside].max() > 0.2 * mean  # there is a mirror image
    assert taken[0] is not None
    assert taken[0][taken[0] > 0].mean() < 13.0


def test_a_ground_that_fills_the_picture_is_that_of_all_samples(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond the bodies it is drawn once, and counts as all samples; no target has to be cleared there again."""
    above = tl.Camera.look_at((0.3, 6.0, 3.0), (0.0, -0.7, 0.0), fov_y=40.0)
    scene = dataclasses.replace(on_a_polished_ground(), camera=above)
    few, every = (renderer.render(scene, SIZE, samples=16, adaptive=adaptive) for adaptive in (True, False))
    off = np.abs(few.radiance / every.radiance - 1.0)[~every.coverage]
    assert np.quantile(off, 0.9) < 1e-3  # but in the mirror image of the ball
    np.testing.assert_allclose(few.transmittance, every.transmittance, rtol=1e-6)
    monkeypatch.setattr(FrameJob, "rest_is_clear", property(lambda job: False, lambda job, value: None))
    cleared = renderer.render(scene, SIZE, samples=16)
    for name in ("radiance", "transmittance", "normals"):
        np.testing.assert_array_equal(few.arrays[name], cleared.arrays[name], err_msg=name)


def _without_a_coat(ground: tl.Object) -> tl.Object:
    assert ground.surface is not None
    return dataclasses.replace(ground, surface=dataclasses.replace(ground.surface, ior=1.0))


@pytest.mark.filterwarnings("ignore:.*not valid")
def test_pixels_whose_light_is_lost_take_no_further_samples(renderer: tl.Renderer) -> None:
    """Open box of glass, viewed from above: where a ray leaves through its hole, the light is unknown."""
    faces = Box((-1, -1, -1), (1, 1, 1)).tessellate(1)
    below = faces.face_normals[:, 1] > -0.5
    box = tl.Mesh(faces.vertices, faces.faces[below])
    scene = tl.Scene([tl.Object(box, GLASS)], tl.Camera.look_at((0.3, 5, 0.4), (0, 0, 0), fov_y=40.0), environment=SKY)
    few, every = (renderer.render(scene, SIZE, samples=16, adaptive=adaptive) for adaptive in (True, False))
    np.testing.assert_array_equal(few.valid, every.valid)
    assert (every.coverage & ~every.valid).mean() > 0.1
    assert traced(few) < 6.0


def test_the_edge_of_a_body_takes_all_samples(renderer: tl.Renderer) -> None:
    """The mean is that of every sample where some meet the body, up to the order of the sum."""
    few, every = (renderer.render(ball(), SIZE, samples=8, adaptive=adaptive) for adaptive in (True, False))
    alone = [renderer.render(dataclasses.replace(ball(), camera=moved), SIZE).coverage for moved in around(CAMERA)]
    edge = np.any(alone, axis=0) & ~np.all(alone, axis=0)
    assert 20 < edge.sum() < 300
    some = edge & (np.abs(every.transmittance - 1.0).max(axis=-1) > 0.0)
    # An eighth of these pixels show the body in every sample.
    assert np.quantile(np.abs(few.radiance - every.radiance)[some], 0.8) < 1e-6


def around(camera: tl.Camera) -> list[tl.Camera]:
    """The camera turned so that the picture moves by less than half a pixel."""
    step = 0.45 * 2.0 * np.tan(np.radians(15.0)) / SIZE[1] * 5.0
    eye, target = camera.eye, camera.eye + 5.0 * camera.forward
    ends = [target + x * step * camera.right + y * step * camera.up for x in (-1, 1) for y in (-1, 1)]
    return [tl.Camera.look_at(eye, end, fov_y=30.0) for end in ends]


def test_the_same_scene_makes_the_same_picture(renderer: tl.Renderer) -> None:
    one, other = (renderer.render(ball(), SIZE, samples=8) for _ in range(2))
    np.testing.assert_array_equal(one.radiance, other.radiance)


@pytest.mark.parametrize(
    ("scene", "samples"),
    [
        (dataclasses.replace(ball(), camera=tl.Camera.look_at((0, 0, 0), (0, 0, -1))), 8),
        (ball(), 2),
    ],
    ids=["from inside", "two samples"],
)
def test_views_from_inside_and_few_samples_take_all(renderer: tl.Renderer, scene: tl.Scene, samples: int) -> None:
    few, every = (renderer.render(scene, SIZE, samples=samples, adaptive=adaptive) for adaptive in (True, False))
    assert "traced_samples" not in few.provenance
    np.testing.assert_array_equal(few.radiance, every.radiance)


def test_rough_interfaces_take_samples_where_they_are_noisy(renderer: tl.Renderer) -> None:
    """The error of the picture is that of all samples, and its mean theirs."""
    scene = ball(surface=tl.Surface(roughness=0.3))
    few, every = (renderer.render(scene, SIZE, samples=16, adaptive=adaptive) for adaptive in (True, False))
    truth = renderer.render(scene, SIZE, samples=96, adaptive=False)
    inside = every.coverage
    errors = [np.square(frame.radiance - truth.radiance, dtype=np.float64)[inside].mean() for frame in (few, every)]
    assert errors[0] < 1.1 * errors[1]
    assert traced(few) < 14.0
    off = (few.radiance - every.radiance)[inside].mean(dtype=np.float64)
    assert abs(off) < 0.003 * every.radiance[inside].mean()


def test_wanted_samples_leave_the_error_of_the_same_number_everywhere() -> None:
    """The mean square of sigma n^(-3/4)."""
    deviations = np.exp(np.random.default_rng(3).normal(size=10_000)).astype(np.float32)
    samples = wanted_samples(deviations, 16) * deviations**0.8
    errors = deviations / samples**0.75, deviations / 16**0.75
    assert np.mean(errors[0] ** 2) == pytest.approx(np.mean(errors[1] ** 2), rel=1e-4)
    assert samples.mean() < 10.0
    assert wanted_samples(np.zeros(4, np.float32), 16) == 0.0


def test_isolated_pixels_are_found_and_edges_are_not() -> None:
    level = 1.0 + 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, (24, 32)).astype(np.float32)
    level[:, 16:] *= 3.0  # an edge
    level[8, :16] += 0.5  # a line
    for row, column, factor in ((4, 5, 1.3), (15, 8, 0.8), (12, 25, 1.2)):
        level[row, column] *= factor
    level[20, 20] = 9.0
    inside = np.ones(level.shape, bool)
    inside[19, 20] = False
    found = {(int(row), int(column)) for row, column in np.argwhere(isolated_pixels(level, inside))}
    assert found == {(4, 5), (15, 8), (12, 25)}
    errors = np.full(level.shape, np.inf)
    # Half of what the first pixel is off, 0.3, is more than three errors. Half of 0.2 is less.
    errors[4, 5] = errors[15, 8] = 0.04
    assert isolated_pixels(level, inside, errors)[4, 5] == 0.0
    assert (isolated_pixels(level, inside, errors) > 0.0).sum() == 2


def test_the_error_of_a_block_counts_with_lines_along_its_rows() -> None:
    random = np.random.default_rng(4)
    noise = random.standard_normal((4000, 8, 8))
    found = np.mean([lattice_variance(parts) for parts in noise])
    assert 1.0 / 64.0 < found < 1.5 / 64.0  # the larger of two estimates that are right in the mean
    slope = np.add.outer(np.arange(8.0), 2.0 * np.arange(8.0))
    assert lattice_variance(slope) < 0.1 * slope.mean(axis=0).var(ddof=1) / 8.0
    # A line of random place, as wide as 1.3 rows: it is in one row or in two.
    rows = np.arange(8.0)[:, None] + 0.5
    places = random.uniform(2.0, 6.0, 500)
    lines = [np.repeat(np.where(np.abs(rows - place) < 0.65, 1.0, 0.0), 8, axis=1) for place in places]
    off = np.square([line.mean() - 1.3 / 8.0 for line in lines]).mean()
    for turned in (False, True):
        estimates = [lattice_variance(line.T if turned else line) for line in lines]
        assert np.mean(estimates) > off
        assert min(estimates) > 4.0 * lines[0].var() / 64.0


@pytest.mark.parametrize(
    "camera",
    [
        CAMERA,
        tl.Camera.orthographic((0.3, 0.4, 5.0), (0, 0, 0), height=1.7),
        dataclasses.replace(CAMERA, window=Window(12.3, 7.0, (60, 50))),
        tl.Camera.look_at((0.2, 0.1, 0.5), (0, 0, 0), fov_y=120.0),
    ],
    ids=["whole", "orthographic", "part", "inside"],
)
def test_faces_are_found_over_the_pixels_that_they_cover(camera: tl.Camera) -> None:
    body = tl.Object(Sphere().tessellate(24), GLASS, np.diag([1.0, -0.7, 1.2, 1.0]))
    extents, (width, height) = FaceExtents.of(body, camera, SIZE), SIZE
    vertices, chosen = body.world_vertices, np.random.default_rng(3).integers(0, width * height, 100)
    caster = RayCaster(tl.Mesh(vertices, body.mesh.faces))
    for right, down in ((0.0, 0.0), (0.5, -0.5), (-0.5, 0.4)):
        origins, directions = (part.reshape(-1, 3) for part in camera.rays(SIZE, (right, down)))
        hit, _ = caster.nearest(origins, directions)
        rows, columns = np.divmod(np.arange(width * height), width)
        for pixel in np.flatnonzero(hit >= 0)[::7]:
            assert hit[pixel] in extents.over(columns[[pixel]], rows[[pixel]])
        over = extents.over(columns[chosen], rows[chosen])
        assert np.isin(hit[chosen][hit[chosen] >= 0], over).all()
    if camera is CAMERA:
        assert len(extents.over(np.array([20]), np.array([16]))) < 0.1 * len(body.mesh.faces)


def test_light_is_uneven_beside_edges_alone() -> None:
    rows, columns = np.mgrid[0:40, 0:60].astype(np.float32)
    light = np.repeat((1.0 + 0.02 * columns + 0.01 * rows)[..., None], 3, axis=-1)
    assert not uneven_part(light, 0.01)
    light[10:20, 30:33] *= 0.5
    assert uneven_part(light, 0.01) == Part(28, 8, 35, 22)
    light[0] = 9.0  # an edge of the picture
    assert uneven_part(light, 0.01) == Part(0, 0, 60, 22)


def test_isolated_pixels_are_right(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """A highlight smaller than a pixel: 64 samples of its pixel are nearer to a finer picture.

    Only the faces over pixels that take further samples are drawn, which changes nothing.
    """
    light = tl.DirectionalLight((-0.5, -0.6, -0.7), (3.0, 3.0, 3.0))
    scene, (width, height) = dataclasses.replace(ball(), lights=[light]), (48, 36)
    whole = renderer.render(scene, (width, height), samples=16, interfaces=tl.TracedInterfaces(hits="embree")).radiance
    monkeypatch.setattr(job_module, "MANY_FACES", 0)
    embree, shaders = (
        renderer.render(scene, (width, height), samples=16, interfaces=tl.TracedInterfaces(hits=hits)).radiance
        for hits in ("embree", "gl")
    )
    np.testing.assert_array_equal(embree, whole)
    np.testing.assert_allclose(embree, shaders, rtol=1e-3, atol=1e-3)
    monkeypatch.setattr(adaptive, "ISOLATED", 1e9)
    before = renderer.render(scene, (width, height), samples=16, interfaces=tl.TracedInterfaces(hits="embree")).radiance
    finer = renderer.render(scene, (4 * width, 4 * height), samples=16).radiance
    truth = finer.reshape(height, 4, width, 4, 3).mean(axis=(1, 3))
    changed = (embree != before).any(axis=-1)
    assert 0 < changed.sum() < 10
    off = [np.abs(found - truth)[changed].max() for found in (embree, before)]
    assert off[0] < 0.5 * off[1]


def test_bubbles_smaller_than_a_pixel_take_more_blocks(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few of the 64 samples of a pixel see a bubble: more blocks bring it nearer to a finer picture."""
    ice, (width, height) = Box((-0.03,) * 3, (0.03,) * 3).tessellate(), (64, 48)
    scene = showcase(ice, "ice", (width, height), environment=STAGES["studio"].environment())
    finer = renderer.render(scene, (4 * width, 4 * height), samples=16).radiance
    truth = finer.reshape(height, 4, width, 4, 3).mean(axis=(1, 3))
    more = renderer.render(scene, (width, height), samples=16).radiance
    monkeypatch.setattr(adaptive, "ROUNDS_AGAIN", 1)
    once = renderer.render(scene, (width, height), samples=16).radiance
    changed = (more != once).any(axis=-1)
    assert 0 < changed.sum() < 20
    off = [np.square(found - truth)[changed].mean() for found in (more, once)]
    assert off[0] < 0.5 * off[1]


def test_no_pixel_of_frosted_glass_is_far_off_its_neighbors(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Isolated pixels take all samples, and then more; the mean of the picture stays where it is."""
    frosted = ball(surface=tl.Surface(roughness=0.35))
    scene = dataclasses.replace(frosted, environment=tl.Environment.studio())
    none, apart, isolated = 1e9, adaptive.APART, adaptive.ISOLATED
    pictures = []
    for chosen in ((none, none), (apart, none), (apart, isolated)):
        for name, value in zip(("APART", "ISOLATED"), chosen, strict=True):
            monkeypatch.setattr(adaptive, name, value)
        pictures.append(renderer.render(scene, (96, 72), samples=16))
    monkeypatch.undo()
    count = [
        np.count_nonzero(isolated_pixels(one.radiance.sum(axis=-1), one.coverage.astype(bool))) for one in pictures
    ]
    assert count[0] > 10
    assert count[1] < 0.7 * count[0]
    assert count[2] < 0.2 * count[0]
    means = [one.radiance[one.coverage].mean(dtype=np.float64) for one in pictures]
    np.testing.assert_allclose(means, means[0], rtol=2e-3)
