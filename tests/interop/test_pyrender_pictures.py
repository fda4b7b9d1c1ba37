"""Drawings of pyrender behind media: in one context and through arrays, against its own pictures, and its depth."""

from __future__ import annotations

import dataclasses
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.assets import mesh_path
from translucent.gpu.constants import CONSTANTS
from translucent.interop.pyrender import backdrop_from_pyrender, render, render_scene, scene_from_pyrender, to_pyrender
from translucent.planning.passes import PassName
from translucent.reference.hits import line_hits, world_normals
from translucent.reference.surfaces import nearest_opaque

Array = npt.NDArray[Any]

SIZE = (96, 72)
EPS = float(np.finfo(np.float32).eps)
GREEN = tl.Medium(absorption=(3.0, 0.5, 2.0))
KINDS = ["perspective", "infinite", "orthographic"]


def own_picture(pyrender: ModuleType, scene: Any, hidden: str, flags: int = 0, **arguments: Any) -> tuple[Array, Array]:
    """Colors and depth of pyrender's own renderer, without a node."""
    (node,) = scene.get_nodes(name=hidden)
    node.mesh.is_visible = False
    offscreen = pyrender.OffscreenRenderer(*SIZE)
    try:
        return offscreen.render(scene, flags, **arguments)  # type: ignore[no-any-return]
    finally:
        offscreen.delete()
        node.mesh.is_visible = True


@pytest.mark.parametrize("kind", KINDS)
def test_one_context_and_arrays_give_the_same_picture(renderer: tl.Renderer, studio: Any, kind: str) -> None:
    scene = studio.scene(kind)
    shared, copied = (
        render(scene, {"ball": GREEN}, SIZE, renderer=renderer, shared=shared) for shared in (True, False)
    )
    assert shared.coverage.mean() > 0.1
    assert shared.valid.all()
    difference = np.abs(shared.to_srgb8().astype(int) - copied.to_srgb8().astype(int))
    assert difference.max() <= 1
    np.testing.assert_allclose(shared.radiance, copied.radiance, atol=1 / 255)
    # The two differ by how 24 bits become a float: at 4 m of 12, from 0.3 on, by a step of 3e-6 m.
    np.testing.assert_allclose(shared.thickness, copied.thickness, atol=1e-5)
    assert shared.provenance["opaque"] == "pyrender 0.1.45 in the same OpenGL context"
    assert copied.provenance["opaque"] == "pyrender 0.1.45 through arrays: asked for"
    either = render(scene, {"ball": GREEN}, SIZE, renderer=renderer)
    assert either.provenance["opaque"] == shared.provenance["opaque"]
    np.testing.assert_array_equal(either.radiance, shared.radiance)


@pytest.mark.parametrize("flags", ["NONE", "SHADOWS_DIRECTIONAL"])
@pytest.mark.parametrize("shared", [True, False])
def test_beside_media_the_picture_is_that_of_pyrender_with_their_shadows(
    pyrender: ModuleType, renderer: tl.Renderer, studio: Any, shared: bool, flags: str
) -> None:
    scene, chosen = studio.scene(), getattr(pyrender.RenderFlags, flags)
    colors, _ = own_picture(pyrender, scene, "ball", chosen)
    frame = render(scene, {"ball": GREEN}, SIZE, renderer=renderer, shared=shared, flags=chosen)
    left = _left_of_light(scene, studio)
    dimmed = (left != 1.0).any(axis=-1)
    beside, alike = ~frame.coverage, tl.interior(dimmed.astype(np.int32))
    lit, shadowed = beside & alike & ~dimmed, beside & alike & dimmed
    assert lit.sum() > 1000
    assert shadowed.sum() > 100
    assert len(np.unique(colors[lit])) > 20
    encoded = np.rint(255.0 * frame.radiance.astype(np.float64) ** (1 / 2.2))
    np.testing.assert_array_equal(encoded[lit], colors[lit])
    found = frame.radiance[shadowed] / (colors[shadowed] / 255.0) ** 2.2
    assert left[shadowed].min() < 0.7
    error = np.abs(found - left[shadowed])
    # At outlines of shadows maps are off, and nobody tells where other things' shadows are in pyrender's picture.
    assert np.quantile(error, 0.85) < 1e-4


def _left_of_light(scene: Any, studio: Any) -> Array:
    """(h, w, 3): share of pyrender's light that the ball leaves, where the float64 reference sees diffuse things."""
    ours = scene_from_pyrender(scene, {"ball": GREEN}, SIZE)
    around = tl.Environment.constant(np.asarray(scene.ambient_light, dtype=np.float64))
    radiance = [
        tl.reference.render(
            dataclasses.replace(
                ours, environment=around, objects=[ball, tl.Object(studio.floor), tl.Object(studio.box)]
            ),
            SIZE,
        ).radiance.astype(np.float64)
        for ball in (ours.objects[0], tl.Object(studio.ball, tl.Medium()))
    ]
    return radiance[0] / radiance[1]


@pytest.mark.parametrize("kind", KINDS)
def test_the_floor_ends_the_path_through_the_ball(renderer: tl.Renderer, studio: Any, kind: str) -> None:
    """Against the same scene with opaque objects of the toolkit: the float64 reference sees their thickness."""
    scene = studio.scene(kind)
    frame = render(scene, {"ball": GREEN}, SIZE, renderer=renderer)
    ours = scene_from_pyrender(scene, {"ball": GREEN}, SIZE)
    opaque = [tl.Object(studio.floor), tl.Object(studio.box)]
    full = dataclasses.replace(ours, objects=[*ours.objects, *opaque])
    truth = tl.reference.render(full, SIZE)
    uncut = tl.reference.render(ours, SIZE)
    inside = tl.interior(tl.reference.hit_counts(ours, SIZE))
    cut = inside & (truth.thickness < uncut.thickness - 0.01)
    assert cut.sum() > 100
    # A step of 24 bits at 5 m, along rays up to 4 times as long as their depth through the floor. In a pixel whose
    # center is nearer to an edge than 1/256 pixel, either of two faces may be seen.
    difference = np.abs(frame.thickness - truth.thickness)[inside]
    step = 5.0**2 / 0.3 * 2.0**-24
    assert np.quantile(difference, 0.99) <= 4 * 4 * step
    assert difference.max() <= 0.01
    assert (difference > 16 * step).mean() < 0.01


def _ahead(renderer: tl.Renderer, scene: tl.Scene) -> Array:
    """Metres along the forward axis of the nearest opaque surface, as our own pass draws it."""
    with renderer.gpu.context.current():
        job = renderer.gpu.prepare(renderer.plan(scene), SIZE)
        renderer.gpu.run(job)
        texels = job.targets["opaque"].read(components=1, attachment=0, dtype="f4")
        axial_depth = np.frombuffer(texels, np.float32).reshape(SIZE[::-1])[::-1].astype(np.float64)
        job.release()
    nothing = axial_depth >= float(CONSTANTS["NOTHING"])
    return np.where(
        nothing, np.inf, np.where(nothing, 0.0, axial_depth) * job.placed.media.length + job.placed.media.near
    )


def _slopes(scene: tl.Scene) -> Array:
    """Metres ahead by which the nearest opaque surface changes from a pixel to the next, right plus up."""
    camera = scene.camera
    hits = [line_hits(item.mesh, item.matrix, camera, SIZE) for item in scene.objects]
    nearest = nearest_opaque(scene, hits, SIZE[0] * SIZE[1])
    slopes = np.zeros(SIZE[0] * SIZE[1])
    rays = camera.rays(SIZE)[1].reshape(-1, 3)
    ahead = rays @ camera.forward
    for i, item in enumerate(scene.objects):
        seen = nearest.item == i
        normals = world_normals(item, nearest.face[seen])
        across = np.abs(normals @ camera.right) + np.abs(normals @ camera.up)
        slopes[seen] = across / np.abs(np.sum(normals * rays[seen], axis=1)) * ahead[seen]
        if camera.fov_y is not None:
            slopes[seen] *= nearest.distance[seen] * ahead[seen]
    pixel = 2.0 * camera.half_extent(SIZE)[1] / SIZE[1]
    return (slopes * pixel).reshape(SIZE[::-1])


@pytest.mark.parametrize("camera", ["perspective", "orthographic"])
def test_our_depth_of_opaque_objects_is_that_of_pyrender(
    pyrender: ModuleType, renderer: tl.Renderer, studio: Any, camera: str
) -> None:
    """Both at pixel centers; pyrender's own renderer does so when it draws segments."""
    bear = tl.load_mesh(mesh_path("bear"))
    pose = studio.pose
    view = tl.Camera(pose, 40.0) if camera == "perspective" else tl.Camera(pose, None, 2.2)
    grown = np.diag((50.0, 50.0, 50.0, 1.0))
    shown = [tl.Object(bear, transform=grown), tl.Object(studio.floor), tl.Object(studio.box)]
    scene = tl.Scene([*shown, tl.Object(studio.ball, medium=GREEN)], view)
    ours = _ahead(renderer, scene)

    made = to_pyrender(scene)
    lens = made.main_camera_node.camera
    near, far = lens.znear, lens.zfar
    offscreen = pyrender.OffscreenRenderer(*SIZE)
    _, theirs = offscreen.render(made, pyrender.RenderFlags.SEG, dict.fromkeys(made.mesh_nodes, 1))
    offscreen.delete()
    seen = theirs > 0
    theirs = theirs.astype(np.float64)
    if camera == "orthographic":
        # pyrender 0.1.45 takes every depth buffer for that of a perspective camera.
        share = far * (1.0 - near / theirs[seen]) / (far - near)
        theirs[seen] = near + share * (far - near)
    assert 0.4 < seen.mean() < 0.95
    assert (np.isfinite(ours) == seen).mean() > 0.999

    both = seen & np.isfinite(ours)
    found, metres = ours[both], theirs[both]
    # What a step of 24 bits is in metres. pyrender rounds to one, and on the way there and back to float32, of which
    # a unit in the last place is as much, half a dozen times. Rasterizers move vertices by up to 1/512 pixel.
    step = 2.0**-24 * ((far - near) if camera == "orthographic" else metres**2 * (far - near) / (near * far))
    roundings = 4.0 * step + 4.0 * EPS * metres
    if camera == "orthographic":
        roundings += 2.0 * EPS * far
    difference = np.abs(found - metres)
    print(f"{camera}: median {np.median(difference / step):.2f} steps of 24 bits, max {difference.max():.2g} m")
    assert (difference <= roundings + _slopes(scene)[both] / 256).all()
    assert np.quantile(difference - roundings, 0.99) <= 0.0


def test_depth_is_that_of_pixel_centers(pyrender: ModuleType, studio: Any) -> None:
    """pyrender's segments are drawn there; its pictures have the depth of one of four samples, off the center."""
    scene = studio.scene()
    hidden = {node: 1 for node in scene.mesh_nodes if node.name != "ball"}
    _, theirs = own_picture(pyrender, scene, "ball", pyrender.RenderFlags.SEG, seg_node_map=hidden)
    ours = backdrop_from_pyrender(scene, ["ball"], SIZE).depth
    np.testing.assert_array_equal(np.isfinite(ours), theirs > 0)
    seen = theirs > 0
    # pyrender turns depth into metres in float32, in a difference of numbers of the size of the far plane.
    tolerance = 4 * EPS * theirs * (1.0 + theirs / 0.3)
    assert (np.abs(ours[seen] - theirs[seen]) <= tolerance[seen]).all()


def test_double_sided_faces_and_textures_are_drawn(pyrender: ModuleType, renderer: tl.Renderer, studio: Any) -> None:
    """A picture of two halves on a floor that is seen from behind."""
    checker = np.zeros((2, 2, 3), dtype=np.uint8)
    checker[:, 0], checker[:, 1] = (255, 0, 0), (0, 0, 255)
    material = pyrender.MetallicRoughnessMaterial(
        baseColorTexture=pyrender.Texture(
            source=checker,
            source_channels="RGB",
            sampler=pyrender.Sampler(magFilter=9728, minFilter=9728),
        ),
        metallicFactor=0.0,
        doubleSided=True,
    )
    corners = np.array([(-2, -2, -2), (2, -2, -2), (2, 2, -2), (-2, 2, -2)], dtype=np.float64)
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float64)
    wall = pyrender.Primitive(
        corners, np.tile((0.0, 0.0, 1.0), (4, 1)), texcoord_0=uv, indices=[(0, 2, 1), (0, 3, 2)], material=material
    )
    scene = pyrender.Scene(ambient_light=[1.0, 1.0, 1.0], bg_color=[0.0, 1.0, 0.0])
    scene.add(pyrender.Mesh([wall]))
    scene.add(studio.mesh(studio.ball, (1, 1, 1)), name="ball", pose=np.diag((0.1, 0.1, 0.1, 1.0)))
    scene.add(pyrender.PerspectiveCamera(0.5), pose=tl.Camera.look_at((0, 0, 2), (0, 0, 0)).pose)
    offscreen = pyrender.OffscreenRenderer(*SIZE)
    offscreen.render(scene)  # has the texture in its context from here on
    frames = [render(scene, {"ball": GREEN}, SIZE, renderer=renderer, shared=shared) for shared in (True, False, True)]
    offscreen.delete()
    for frame in frames:
        assert frame.radiance[2, 2].tolist() == [1.0, 0.0, 0.0]
        assert frame.radiance[2, -3].tolist() == [0.0, 0.0, 1.0]


def test_samples_smooth_the_media_and_leave_the_picture(renderer: tl.Renderer, studio: Any) -> None:
    scene = studio.scene()
    once, often = (render(scene, {"ball": GREEN}, SIZE, samples=n, renderer=renderer) for n in (1, 16))
    untouched = (often.transmittance == 1.0).all(axis=-1)
    assert untouched.sum() > 1000
    np.testing.assert_allclose(often.radiance[untouched], once.radiance[untouched], rtol=16 * EPS)
    assert (often.radiance != once.radiance).any(axis=-1).sum() > 50


def test_any_method_works_over_the_picture(renderer: tl.Renderer, studio: Any) -> None:
    scene = studio.scene()
    expected = render(scene, {"ball": GREEN}, SIZE, renderer=renderer)
    for method in (tl.DepthPeeling(), tl.BackFaceDepth()):
        frame = render(scene, {"ball": GREEN}, SIZE, method, renderer=renderer)
        assert frame.plan.has(PassName.BACKDROP)
        np.testing.assert_allclose(frame.radiance, expected.radiance, atol=1e-4)


def test_opaque_objects_of_the_toolkit_drawn_by_pyrender(renderer: tl.Renderer, studio: Any) -> None:
    """Its dielectrics reflect 0.9216 of the color, and a little more that is 0.04 of the light spread by roughness."""
    objects = [
        tl.Object(studio.floor, color=(0.7, 0.6, 0.5)),
        tl.Object(studio.box, color="teal"),
        tl.Object(studio.ball, medium=GREEN),
    ]
    lights = [tl.PointLight((-1.0, 2.5, 1.0), 3.0), tl.DirectionalLight((-1.0, -3.0, -0.5), 0.5)]
    environment = tl.Environment.gradient((0.1, 0.2, 0.3), (0.3, 0.4, 0.6))
    for camera in (tl.Camera(studio.pose, 40.0), tl.Camera(studio.pose, None, 2.2)):
        scene = tl.Scene(objects, camera, lights, environment)
        drawn, own = render_scene(scene, SIZE, renderer=renderer), renderer.render(scene, SIZE)
        assert drawn.provenance["opaque"] == "pyrender 0.1.45 through arrays"
        assert [step.name for step in drawn.plan.passes[:2]] == ["shadow_maps", "backdrop"]
        # The environment is seen where nothing is in front, itself and not a picture of it.
        sky = np.isinf(_ahead(renderer, scene))
        off = np.stack([np.roll(sky, shift, axis) for shift in (-1, 1) for axis in (0, 1)]).all(axis=0) & sky
        assert off.sum() > 100
        np.testing.assert_array_equal(drawn.radiance[off], own.radiance[off])
        # The box cuts off what it hides and the floor what is below it, as ours do, up to 24 bits and float32.
        assert np.quantile(np.abs(drawn.thickness - own.thickness), 0.99) <= 2e-5
        lit = ~sky & (own.transmittance == 1.0).all(axis=-1)
        assert lit.sum() > 500
        ratio = drawn.radiance[lit].mean() / own.radiance[lit].mean()
        assert 0.85 < ratio < 1.1


def test_both_sides_of_a_face_reflect_alike(renderer: tl.Renderer, studio: Any) -> None:
    turned = tl.Mesh(studio.floor.vertices, studio.floor.faces[:, ::-1])
    frames = []
    for floor in (studio.floor, turned):
        objects = [tl.Object(floor), tl.Object(studio.ball, medium=GREEN)]
        lights = [tl.DirectionalLight((-1.0, -3.0, -0.5), 2.0)]
        frames.append(render_scene(tl.Scene(objects, tl.Camera(studio.pose), lights), SIZE, renderer=renderer))
    front, back = (frame.to_srgb8().astype(int) for frame in frames)
    assert len(np.unique(front)) > 20
    assert np.abs(front - back).max() <= 1


def test_a_floor_below_the_camera_costs_no_digits(renderer: tl.Renderer, studio: Any) -> None:
    """From 1e-4 of its diagonal on, 24 bits of depth have steps of 7e-5 m at the ball; from where it is seen, 1e-6."""
    wide = tl.Mesh(50.0 * studio.floor.vertices, studio.floor.faces)
    scene = tl.Scene([tl.Object(wide), tl.Object(studio.ball, medium=GREEN)], tl.Camera(studio.pose, 30.0))
    drawn, own = render_scene(scene, SIZE, renderer=renderer), renderer.render(scene, SIZE)
    cut = own.coverage & (own.thickness < 0.9 * renderer.render(_bodies(scene), SIZE).thickness)
    assert cut.sum() > 50
    assert np.quantile(np.abs(drawn.thickness - own.thickness)[cut], 0.95) <= 1e-5


def _bodies(scene: tl.Scene) -> tl.Scene:
    return dataclasses.replace(scene, objects=scene.bodies)


def test_at_edges_the_environment_is_seen_in_part(pyrender: ModuleType) -> None:
    from translucent.interop._pyrender_bridge import PyrenderPicture

    # One pixel of three is covered by half, by a surface that is encoded as 0.8.
    colors = np.array([[[0, 0, 0, 0], [102, 102, 102, 128], [204, 204, 204, 255]]], dtype=np.uint8)
    environment = tl.Environment.constant((3.0, 2.0, 1.0))
    picture = PyrenderPicture(colors, np.array([[np.inf, 2.0, 2.0]]), (0.5, 0.5, 0.5))
    backdrop = picture.before(environment, tl.Camera(np.eye(4)))
    share, surface = 128 / 255, (102 / 128) ** 2.2
    np.testing.assert_allclose(backdrop.radiance[0, 1], share * surface + (1 - share) * np.array([3.0, 2.0, 1.0]), 1e-6)
    np.testing.assert_allclose(backdrop.radiance[0, 2], 0.8**2.2, rtol=1e-6)
    assert backdrop.coverage is not None
    assert backdrop.coverage.tolist() == [[False, True, True]]
    assert backdrop.ambient == (0.5, 0.5, 0.5)


def test_far_from_the_origin_pyrender_draws_as_well(renderer: tl.Renderer, studio: Any) -> None:
    """A million metres away float32 resolves no more than 6 cm."""
    offset = np.eye(4)
    offset[:3, 3] = (1e6 + 0.02, -1e6 - 0.01, 1e6 + 0.03)
    frames = []
    for matrix in (np.eye(4), offset):
        objects = [tl.Object(studio.floor, transform=matrix), tl.Object(studio.ball, medium=GREEN, transform=matrix)]
        frames.append(render_scene(tl.Scene(objects, tl.Camera(matrix @ studio.pose)), SIZE, renderer=renderer))
    near, far = frames
    assert np.quantile(np.abs(near.thickness - far.thickness), 0.999) <= 2e-5
    np.testing.assert_allclose(near.radiance, far.radiance, atol=2 / 255)
