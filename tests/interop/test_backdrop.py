"""Pictures drawn elsewhere in place of opaque objects: the same frame as with the objects, from arrays and textures."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests.values.plan_scenes import plan_over_backdrop
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import TextureBackdrop
from translucent.gpu.placement import AxialRange
from translucent.planning.request import RenderRequest

Array = npt.NDArray[Any]

SIZE = (64, 48)
EPS = float(np.finfo(np.float32).eps)
MEDIUM = tl.Medium(absorption=(1.0, 3.0, 0.2), emission=(0.1, 0.0, 0.2))
BOX = Box(low=(-0.5, -0.4, -0.3), high=(0.5, 0.4, 0.3)).tessellate()
BALL = Sphere(center=(0.3, 0.1, 0.2), radius=0.35).tessellate(24)
WALL = tl.Mesh([(-2, -2, -0.2), (2, -2, -0.2), (2, 2, -1.0)], [(0, 1, 2)], name="wall")
PERSPECTIVE = tl.Camera.look_at((0.6, 0.8, 3.5), (0.0, 0.0, 0.0), fov_y=40)
ORTHOGRAPHIC = tl.Camera.orthographic((0.6, 0.8, 3.5), (0.0, 0.0, 0.0), height=2.0)
GRADIENT = tl.Environment.gradient((0.1, 0.2, 0.3), (1.0, 0.8, 0.6))

METHODS = [
    tl.SignedDepth(),
    tl.BackFaceDepth(),
    tl.ThinLayer(1e-2),
    tl.DepthPeeling(),
    tl.FragmentLists(),
    tl.KBuffer(k=4),
]


def with_objects(camera: tl.Camera) -> tl.Scene:
    opaque = [tl.Object(BALL, color="orange"), tl.Object(WALL, color="teal")]
    lights = [tl.PointLight((2.0, 3.0, 2.0), 20.0)]
    return tl.Scene([tl.Object(BOX, medium=MEDIUM), *opaque], camera, lights, GRADIENT)


def bodies_of(scene: tl.Scene) -> tl.Scene:
    return dataclasses.replace(scene, objects=scene.bodies)


def opaque_picture(renderer: tl.Renderer, scene: tl.Scene, method: Any = None) -> tuple[Array, Array]:
    """Radiance, and metres along the forward axis, of what the pass of opaque objects draws."""
    # As `render` plans it: the size of shadow maps follows from the pixels of a picture.
    request = RenderRequest(method, pixels=SIZE[0] * SIZE[1])
    with renderer.gpu.context.current():
        job = renderer.gpu.prepare(renderer.plan_requested(scene, request), SIZE)
        renderer.gpu.run(job)
        target = job.targets["opaque"]
        axial_depth, radiance = (
            np.frombuffer(target.read(components=count, attachment=i, dtype="f4"), np.float32)
            .reshape(*SIZE[::-1], count)[::-1]
            .astype(np.float64)
            for i, count in enumerate((1, 4))
        )
        job.release()
    seen = axial_depth[..., 0] < float(CONSTANTS["NOTHING"])
    metres = np.full(SIZE[::-1], np.inf)
    metres[seen] = axial_depth[seen, 0] * job.placed.media.length + job.placed.media.near
    return np.where(seen[..., None], radiance[..., :3], 0.0), metres


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_backdrop_is_as_good_as_the_objects_on_it(renderer: tl.Renderer, method: Any, camera: tl.Camera) -> None:
    scene = with_objects(camera)
    radiance, depth = opaque_picture(renderer, scene, method)
    assert 0.1 < np.isfinite(depth).mean() < 0.9
    backdrop = tl.Backdrop(radiance, depth, coverage=np.isfinite(depth))
    # The picture has its shadows already, which are those of sheets where bodies are drawn so.
    unlit = dataclasses.replace(bodies_of(scene), lights=())
    frame = renderer.render(unlit, SIZE, method, backdrop=backdrop)
    expected = renderer.render(scene, SIZE, method)
    # In float64 an axial depth becomes metres and the same axial depth again.
    for name in ("thickness", "optical_depth", "transmittance", "radiance", "valid"):
        np.testing.assert_array_equal(getattr(frame, name), getattr(expected, name), err_msg=name)


def test_without_depth_the_picture_is_behind_everything(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(BOX, medium=tl.Medium(absorption=(1.0, 2.0, 3.0)))], PERSPECTIVE, environment=GRADIENT)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    radiance = np.stack([rows / 10.0, columns / 10.0, rows * columns / 100.0], axis=-1)
    backdrop = tl.Backdrop(radiance, np.full(SIZE[::-1], np.inf))
    frame, alone = renderer.render(scene, SIZE, backdrop=backdrop), renderer.render(scene, SIZE)
    np.testing.assert_array_equal(frame.thickness, alone.thickness)
    # Row 0 is the top row: a picture upside down would not be this one.
    # The shader's transmittance and that of NumPy are two roundings apart, and so are their products.
    np.testing.assert_allclose(frame.radiance, radiance.astype(np.float32) * frame.transmittance, rtol=4 * EPS)


def test_where_a_picture_has_no_coverage_the_environment_is_seen(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(BOX, medium=MEDIUM)], PERSPECTIVE, environment=GRADIENT)
    coverage = np.arange(SIZE[0]) < 20
    backdrop = tl.Backdrop(
        np.full((*SIZE[::-1], 3), 7.0), np.full(SIZE[::-1], 100.0), np.broadcast_to(coverage, SIZE[::-1])
    )
    frame, alone = renderer.render(scene, SIZE, backdrop=backdrop), renderer.render(scene, SIZE)
    np.testing.assert_array_equal(frame.radiance[:, ~coverage], alone.radiance[:, ~coverage])
    outside = ~frame.coverage & coverage
    assert outside.sum() > 100
    np.testing.assert_array_equal(frame.radiance[outside], 7.0)


def test_a_body_far_away_is_cut_where_the_picture_says(renderer: tl.Renderer) -> None:
    """Metres rounded to float32 would be 2e-4 of the body off, 1e4 of its diameters away."""
    camera = tl.Camera.look_at((0.0, 0.0, 1e4), (0.0, 0.0, 0.0), fov_y=0.005)
    scene = tl.Scene([tl.Object(BOX, medium=MEDIUM)], camera)
    depth = np.full(SIZE[::-1], 1e4 - 0.1234567)  # the box ends 0.3 ahead of the origin
    frame = renderer.render(scene, SIZE, backdrop=tl.Backdrop(np.zeros((*SIZE[::-1], 3)), depth))
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE)) & frame.coverage
    assert inside.sum() > 100
    # Axial depth is counted from the near side of the box, in float32.
    np.testing.assert_allclose(frame.thickness[inside], 0.3 - 0.1234567, atol=4 * EPS)


def test_all_samples_of_a_pixel_see_the_same_picture(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(BOX, medium=MEDIUM)], PERSPECTIVE)
    radiance = np.random.default_rng(1).uniform(0.0, 2.0, (*SIZE[::-1], 3))
    frame = renderer.render(scene, SIZE, samples=8, backdrop=tl.Backdrop(radiance, np.full(SIZE[::-1], np.inf)))
    untouched = (frame.transmittance == 1.0).all(axis=-1)
    assert untouched.sum() > 1000
    np.testing.assert_allclose(frame.radiance[untouched], radiance[untouched], rtol=9 * EPS)


@pytest.mark.parametrize(("far", "orthographic"), [(40.0, False), (np.inf, False), (40.0, True)])
def test_depth_of_textures_becomes_metres(renderer: tl.Renderer, far: float, orthographic: bool) -> None:
    near, gamma = 0.5, 2.2
    scene = tl.Scene([tl.Object(BOX, medium=MEDIUM)], PERSPECTIVE)
    depth = np.linspace(0.0, 1.0, SIZE[0] * SIZE[1]).astype(np.float32).reshape(SIZE[::-1])
    encoded = np.random.default_rng(2).integers(0, 256, (*SIZE[::-1], 4), dtype=np.uint8)
    with renderer.gpu.context.current() as gl:
        color, z = gl.texture(SIZE, 4, encoded.tobytes()), gl.depth_texture(SIZE, depth.tobytes())
        z.compare_func = ""
        backdrop = TextureBackdrop(color, z, near, far, orthographic, gamma)
        job = renderer.gpu.prepare(renderer.plan(scene, over_backdrop=True), SIZE, backdrop)
        renderer.gpu.run(job)
        target = job.targets["opaque"]
        axial_depth = np.frombuffer(target.read(components=1, attachment=0, dtype="f4"), np.float32).reshape(SIZE[::-1])
        radiance = np.frombuffer(target.read(components=4, attachment=1, dtype="f4"), np.float32)
        job.release()
        color.release()
        z.release()
    share = depth[depth < 1.0].astype(np.float64)
    if orthographic:
        metres, slope = near + share * (far - near), np.full_like(share, far - near)
    elif far == np.inf:
        metres, slope = near / (1.0 - share), near / (1.0 - share) ** 2
    else:
        metres = near * far / (far - share * (far - near))
        slope = metres**2 * (far - near) / (near * far)
    media = AxialRange.of(scene.bodies, scene.camera)
    found = axial_depth[depth < 1.0] * media.length + media.near
    # A depth buffer of 24 bits, and four roundings to float32.
    assert (np.abs(found - metres) <= slope * 2.0**-24 + 4 * EPS * (metres + media.near)).all()
    behind = axial_depth[depth == 1.0]
    assert behind.size
    assert ((behind > 1e20) & (behind < float(CONSTANTS["NOTHING"]))).all()
    # The power of GLSL is exact to a few units of the last place of its exponent, which is at most 2.2 * 8 bits.
    np.testing.assert_allclose(
        radiance.reshape(-1, 4)[:, :3], (encoded.reshape(-1, 4)[:, :3] / 255.0) ** gamma, rtol=64 * EPS, atol=1e-30
    )


def test_the_plan_says_where_opaque_objects_come_from(renderer: tl.Renderer) -> None:
    scene = bodies_of(with_objects(PERSPECTIVE))
    chosen = renderer.plan(scene, over_backdrop=True)
    assert [step.name for step in chosen.passes] == ["shadow_maps", "backdrop", "signed_depth", "transmittance"]
    assert "1. shadow_maps: 1 light on the backdrop" in str(chosen)
    assert "2. backdrop: a backdrop (a picture with depth) replaces opaque objects" in str(chosen)
    assert "approximation: objects in the backdrop cast no shadows onto media" in str(chosen)
    assert chosen == plan_over_backdrop(scene)
    assert "backdrop" not in str(renderer.plan(scene))


def test_bad_backdrops_are_refused() -> None:
    radiance, depth = np.ones((4, 5, 3)), np.ones((4, 5))
    nan = np.where(np.eye(4, 5) > 0, np.nan, 1.0)
    for arguments, message in (
        ((radiance, depth[0]), r"the depth has shape \(5,\); use the shape \(h, w\)"),
        ((radiance[1:], depth), r"the radiance has shape \(3, 5, 3\), and the depth has shape \(4, 5\)"),
        ((radiance[..., 0], depth), r", and the depth has shape \(4, 5\)"),
        ((-radiance, depth), "60 numbers of the radiance are outside 0 to 1e"),
        ((1e40 * radiance, depth), "60 numbers of the radiance"),
        ((radiance * nan[..., None], depth), "12 numbers of the radiance"),
        ((radiance, nan), "the depth is not above 0 in 4 pixels; .* and inf for pixels without a surface"),
        ((radiance, 0.0 * depth), "the depth is not above 0 in 20 pixels"),
        (("red", depth), "the values of radiance are not numbers"),
        ((radiance, depth, depth), r"the coverage has the shape \(4, 5\) and the type float64"),
        ((radiance, depth, depth[0] > 0), r"the coverage has the shape \(5,\)"),
        ((np.ones((0, 5, 3)), np.ones((0, 5))), r"the depth has shape \(0, 5\)"),
    ):
        with pytest.raises(tl.InputError, match=message):
            tl.Backdrop(*arguments)


def test_a_backdrop_cannot_be_changed_afterwards() -> None:
    depth = np.ones((4, 5))
    backdrop = tl.Backdrop(np.ones((4, 5, 3)), depth)
    depth[:] = 2.0
    assert (backdrop.depth == 1.0).all()
    with pytest.raises(ValueError, match="read-only"):
        backdrop.depth[0, 0] = 3.0
    assert repr(backdrop) == "Backdrop(5x4, 20 pixels end rays)"


def test_backdrops_that_do_not_fit_are_refused(renderer: tl.Renderer) -> None:
    scene = with_objects(PERSPECTIVE)
    backdrop = tl.Backdrop(np.ones((*SIZE[::-1], 3)), np.full(SIZE[::-1], np.inf))
    with pytest.raises(tl.InputError, match=r"a backdrop; the scene itself has opaque objects: .*'wall'"):
        renderer.render(scene, SIZE, backdrop=backdrop)
    with pytest.raises(
        tl.InputError, match="backdrop of 64x48; the frame has 48x64 pixels; render both in the same size"
    ):
        renderer.render(bodies_of(scene), SIZE[::-1], backdrop=backdrop)
    with pytest.raises(tl.InputError, match=r"of type ndarray; give an object of type tl\.Backdrop"):
        renderer.render(bodies_of(scene), SIZE, backdrop=backdrop.depth)  # type: ignore[arg-type]
    pytest.importorskip("embreex")
    with (
        tl.Renderer("cpu") as without,
        pytest.raises(
            tl.RenderError,
            match='a backdrop; this renderer works on the CPU, and has no OpenGL; use a backend other than "cpu"',
        ),
    ):
        without.render(bodies_of(scene), SIZE, backdrop=backdrop)
