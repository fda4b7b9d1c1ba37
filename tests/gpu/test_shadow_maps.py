"""Shadows on opaque objects on the GPU: maps against the float64 reference, texel by texel and in pictures."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt
import pytest
import trimesh

import translucent as tl
from translucent.assets import mesh_path
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.light_cameras import ShadowOccluders, support_of
from translucent.gpu.shaders import CompileBudget, PostponedError
from translucent.gpu.shadow_atlas import LEAST_TEXELS, MOST_BYTES, ShadowViews
from translucent.scene.grounds import lit_side
from translucent.scene.stages import staged

SIZE = (72, 54)
DARK = tl.Environment.constant((0, 0, 0))
CAMERA = tl.Camera.look_at((0, 3.5, 7), (0, -0.3, 0), fov_y=30)
WINE, LEAF = tl.Medium(absorption=(0.5, 2, 1)), tl.Medium(absorption=(2, 0.3, 1))
SUN = tl.DirectionalLight((1, -1.5, -0.4), (2.5, 2.5, 2.5))
LAMPS = {
    "sun": SUN,
    "lamp": tl.PointLight((-2, 3, 1), (20, 20, 20)),
    "close": tl.PointLight((0.2, 1.2, 0.1), (3, 3, 3)),
    "inside": tl.PointLight((0.2, 0.3, 0.1), (3, 3, 3)),
    "spot": tl.SpotLight((-2, 3, 1), (2, -3.2, -1.2), (20, 20, 20), 15, 25),
    "on the surface": tl.PointLight((0, 1, 0), (3, 3, 3)),
    "far": tl.PointLight((2e4, 4e4, 1e4), (1e9, 1e9, 1e9)),
}


def ground(y: float = -1.0, half: float = 6.0) -> tl.Object:
    corners = [(-half, y, -half), (half, y, -half), (half, y, half), (-half, y, half)]
    return tl.Object(tl.Mesh(corners, [(0, 2, 1), (0, 3, 2)], name="ground"), color=(0.7, 0.7, 0.7))


def moved(
    mesh: tl.Mesh, place: tuple[float, float, float], medium: tl.Medium | None = None, **options: Any
) -> tl.Object:
    return tl.Object(mesh, medium, trimesh.transformations.translation_matrix(place), **options)


BALL = Sphere().tessellate(32)
CUBE = Box((-0.4, -0.4, -0.4), (0.4, 0.4, 0.4)).tessellate()
STONE = moved(Sphere(radius=0.5).tessellate(32), (1.6, -0.3, 0.4), color=(0.6, 0.4, 0.7))
SCENES: dict[str, dict[str, Any]] = {
    "ball": {"objects": [tl.Object(BALL, WINE), ground()]},
    "two media and a stone": {"objects": [tl.Object(BALL, WINE), moved(CUBE, (0, 0.9, 0), LEAF), STONE, ground()]},
    "opaque inside": {"objects": [tl.Object(BALL, WINE), moved(CUBE, (0.1, 0, 0)), ground()]},
    "ground through the body": {"objects": [tl.Object(BALL, WINE), ground(-0.3)]},
    "on the ground": {"objects": [moved(CUBE, (0, -0.6, 0), WINE), ground()]},
    "union": {"objects": [tl.Object(BALL, WINE), moved(CUBE, (0, 0.9, 0), LEAF), ground()], "overlap": "union"},
    "sheet": {"objects": [tl.Object(BALL, WINE, sheet_thickness=0.05), ground()]},
}


def scene(name: str, *lights: str, environment: tl.Environment = DARK, **options: Any) -> tl.Scene:
    return tl.Scene(
        camera=CAMERA, lights=[LAMPS[light] for light in lights], environment=environment, **SCENES[name], **options
    )


def relative(frame: tl.Frame, truth: tl.Frame) -> npt.NDArray[np.float64]:
    """(n,): errors of radiance over its mean, in valid pixels."""
    assert frame.valid.all()
    error = np.abs(frame.radiance - truth.radiance).max(axis=-1)
    return np.sort(error.ravel() / truth.radiance.mean())


@pytest.mark.parametrize("light", LAMPS)
def test_a_ball_throws_the_reference_s_shadow(renderer: tl.Renderer, light: str) -> None:
    """But within a texel of edges, which few pixels are."""
    shown = scene("ball", light)
    error = relative(renderer.render(shown, SIZE), tl.reference.render(shown, SIZE))
    assert np.median(error) < 2e-6  # float32, in shadows and in light up to ten times the mean
    assert np.quantile(error, 0.98) < 1e-4


@pytest.mark.parametrize("name", list(SCENES)[1:])
def test_what_else_throws_shadows_does_so_as_in_the_reference(renderer: tl.Renderer, name: str) -> None:
    shown = scene(name, "sun", "lamp")
    error = relative(renderer.render(shown, SIZE), tl.reference.render(shown, SIZE))
    assert np.median(error) < 2e-6  # float32, in shadows and in light up to ten times the mean
    assert np.quantile(error, 0.95) < 1e-4


def test_layers_throw_no_shadow_and_change_none(renderer: tl.Renderer) -> None:
    clear = tl.Surface(opacity=0.5)
    layer = moved(CUBE, (1.5, 0, 0), tl.Medium(), sheet_thickness=1e-3, surface=clear)
    ball, floor = SCENES["ball"]["objects"]
    shown = replace(scene("ball", "sun"), objects=[layer, ball, floor])
    frame, alone = renderer.render(shown, SIZE), renderer.render(scene("ball", "sun"), SIZE)
    beside = ~renderer.render(replace(shown, objects=[layer, floor]), SIZE).coverage
    assert np.quantile(np.abs(frame.radiance - alone.radiance)[beside], 0.99) < 1e-4
    assert alone.radiance[beside & ~alone.coverage].min() < 0.7 * alone.radiance.max()


@pytest.mark.parametrize(
    ("mesh", "light"), [("bear", "lamp"), ("knot", "sun"), ("shell", "lamp"), ("goblet", "sun"), ("bangle", "lamp")]
)
def test_each_texel_has_the_transmittance_of_its_ray(renderer: tl.Renderer, mesh: str, light: str) -> None:
    """Away from edges, where texels as wide as a pixel of the light's picture see other faces."""
    body = tl.load_mesh(mesh_path(mesh))
    size, diagonal, center = 128, body.diagonal, body.center
    low = float(body.bounds[0, 1]) - 0.02 * diagonal
    floor = moved(ground(0.0, 8.0 * diagonal).mesh, (center[0], low, center[2]))
    lamps = {
        "sun": tl.DirectionalLight((0.9, -1, -0.4), (1, 1, 1)),
        "lamp": tl.PointLight(center + np.array([-1.2, 1.6, 0.7]) * diagonal, (1, 1, 1)),
    }
    item = tl.Object(body, tl.Medium(absorption=np.array([1, 2, 4]) / diagonal))
    shown = tl.Scene([item, floor], CAMERA, [lamps[light]], DARK)
    renderer.render(shown, (8, 8), shadows=tl.ShadowMaps(size))
    camera = ShadowOccluders(lamps[light], shown, [support_of(item) for item in shown.objects]).cameras()[0]
    origins, ways = camera.rays((size, size))
    ways = np.broadcast_to(ways, (size, size, 3))
    path = _held(renderer)[::-1, :, 0] * np.linalg.norm(ways / (ways @ camera.forward)[..., None], axis=-1)
    found = np.exp(-path[..., None] * item.medium.extinction)
    points = origins + ((low - origins[..., 1]) / ways[..., 1])[..., None] * ways
    truth = tl.reference.light_transmittance(shown, 0, points.reshape(-1, 3)).reshape(found.shape)
    inside = tl.interior(tl.reference.hit_counts(replace(shown, objects=[item], camera=camera), (size, size)))
    error = np.abs(found - truth).max(axis=-1)[inside]
    print(f"median {np.median(error):.1e}, p99.9 {np.quantile(error, 0.999):.1e} of {error.size} texels")
    assert truth[inside].min() < 0.7
    assert np.quantile(error, 0.999) < 1e-5


def _held(renderer: tl.Renderer) -> npt.NDArray[np.float32]:
    """(h, w, 2): sums in the atlas, the bottom row first."""
    atlas = renderer.gpu._resources.shadows
    with renderer.gpu.context.current():
        texture: moderngl.Texture = atlas.sums.color_attachments[0]
        return np.frombuffer(texture.read(), np.float32).reshape(*texture.size[::-1], texture.components)


@pytest.mark.parametrize("name", ["ball", "two media and a stone"])
def test_edges_get_sharper_with_the_size_of_the_map(renderer: tl.Renderer, name: str) -> None:
    """Wrong is what is within a texel of an edge, so the mean error falls as texels do."""
    shown = scene(name, "sun")
    truth = tl.reference.render(shown, SIZE)
    sizes = 2 ** np.arange(6, 11)
    errors = [relative(renderer.render(shown, SIZE, shadows=tl.ShadowMaps(int(size))), truth).mean() for size in sizes]
    slope = -np.polyfit(np.log2(sizes), np.log2(errors), 1)[0]
    print(f"order {slope:.2f}: {errors}")
    assert 0.75 < slope < 1.8
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("size", [64, 512])
def test_opaque_objects_do_not_shadow_their_lit_side(renderer: tl.Renderer, size: int) -> None:
    """No acne: with whatever map, what faces the light by more than a few degrees has all of it."""
    bear = tl.load_mesh(mesh_path("bear"))
    scale = np.diag([*np.full(3, 2.0 / bear.diagonal), 1.0])
    scale[:3, 3] = -2.0 / bear.diagonal * bear.center
    stones = tl.Object(BALL, color=(1, 1, 1)), tl.Object(bear, None, scale)
    drop = moved(CUBE, (0, -2, 0), WINE)  # below
    camera = tl.Camera.look_at((3, 3, 3), (0, 0, 0), fov_y=25)
    for light in (SUN, tl.PointLight((-1.5, 3, 1), (9, 9, 9))):
        for stone in stones:
            shown = tl.Scene([stone, drop], camera, [light], DARK)
            frame = renderer.render(shown, SIZE, shadows=tl.ShadowMaps(size))
            truth = tl.reference.render(shown, SIZE).radiance
            lit = truth.max(axis=-1) > 0.25 * truth.max()
            lost = (truth - frame.radiance).max(axis=-1)[lit] / truth.max()
            assert lit.sum() > 100
            # Of the bear, whose ears shadow it, few pixels are within a texel of an edge.
            print(f"{stone.mesh.name} {size}: {(lost > 1e-4).mean():.4f}")
            assert (lost > 1e-4).mean() < (0 if stone.mesh is BALL else 0.15 if size == 64 else 0.03) + 1e-9


def test_nothing_leaks_through_what_stands_on_the_ground(renderer: tl.Renderer) -> None:
    """Beneath and behind a block the ground is black but for a texel at its edge, as the map has them."""
    block = moved(CUBE, (0, -0.6, 0))
    shown = tl.Scene([block, ground(), moved(BALL, (-3, 3, 0), tl.Medium())], CAMERA, [SUN], DARK)
    frame, truth = renderer.render(shown, (192, 144)), tl.reference.render(shown, (192, 144))
    dark = truth.radiance.max(axis=-1) == 0
    assert dark.sum() > 500
    assert (frame.radiance.max(axis=-1)[dark] > 0).mean() < 0.02


@pytest.mark.parametrize("where", [0.0, 1e6])
def test_a_thin_slab_and_a_scene_far_from_the_origin_keep_their_digits(renderer: tl.Renderer, where: float) -> None:
    """A slab of 1e-4 m, dense enough to let through 1 / e: the path through it keeps three digits in the map."""
    place = (where, 0.0, 0.0)
    slab = Box((-1, 0, -1), (1, 1e-4, 1)).tessellate()
    floor = moved(ground().mesh, place)
    camera = tl.Camera.look_at((where, 3.5, 7), (where, -0.3, 0), fov_y=30)
    light = tl.DirectionalLight((0.3, -1, 0), (1, 1, 1))
    shown = tl.Scene([moved(slab, place, tl.Medium(absorption=1e4)), floor], camera, [light], DARK)
    error = relative(renderer.render(shown, SIZE), tl.reference.render(shown, SIZE))
    assert np.quantile(error, 0.95) < 1e-3


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_do_not_matter(renderer: tl.Renderer, unit: float) -> None:
    shown = scene("two media and a stone", "sun")
    scaled = [
        replace(
            item,
            transform=np.diag([unit, unit, unit, 1.0]) @ item.matrix,
            medium=None if item.medium is None else tl.Medium(absorption=np.asarray(item.medium.absorption) / unit),
        )
        for item in shown.objects
    ]
    camera = tl.Camera.look_at((0, 3.5 * unit, 7 * unit), (0, -0.3 * unit, 0), fov_y=30)
    small, usual = (renderer.render(one, SIZE) for one in (replace(shown, objects=scaled, camera=camera), shown))
    assert np.quantile(np.abs(small.radiance - usual.radiance), 0.99) < 1e-5


@pytest.mark.parametrize("name", ["ball", "two media and a stone"])
def test_the_environment_throws_the_shadows_of_its_directions(renderer: tl.Renderer, name: str) -> None:
    environment = tl.Environment.gradient((0.2, 0.2, 0.2), (1, 1, 1.2))
    shown = scene(name, environment=environment, environment_shadows=8)
    frame, truth = renderer.render(shown, SIZE, shadows=tl.ShadowMaps(2048)), tl.reference.render(shown, SIZE)
    error = relative(frame, truth)
    assert np.median(error) < 1e-6
    assert error.mean() < 3e-3
    open_sky = renderer.render(replace(shown, environment_shadows=0), SIZE).radiance
    assert (open_sky - frame.radiance).mean() > 0.02 * open_sky.mean()


def test_samples_of_a_pixel_together_look_at_each_direction_once(renderer: tl.Renderer) -> None:
    """On a floor that fills the picture, where the samples' other difference, the place, hardly matters."""
    environment = tl.Environment.gradient((0.2, 0.2, 0.2), (1, 1, 1.2))
    camera = tl.Camera.orthographic((2.5, 3, 0), (2.5, 0, 0), up=(0, 0, 1), height=0.2)
    shown = replace(scene("ball", environment=environment, environment_shadows=15), camera=camera)
    one, four, many = (renderer.render(shown, (8, 8), samples=n).radiance.mean() for n in (1, 4, 32))
    assert one < 0.98 * renderer.render(replace(shown, environment_shadows=0), (8, 8)).radiance.mean()
    np.testing.assert_allclose((four, many), one, rtol=5e-3)


CATCHER = replace(ground(), shadow_catcher=True)
BELOW = tl.Camera.look_at((0, -4.5, 7), (0, -0.7, 0), fov_y=30)


def test_directions_below_a_ground_have_maps_where_its_lower_side_is_seen(renderer: tl.Renderer) -> None:
    """And without them the picture from above is the same to the last bit."""
    environment = tl.Environment.gradient((0.2, 0.2, 0.2), (1, 1, 1.2))
    above = tl.Scene([tl.Object(BALL, WINE), CATCHER], CAMERA, [], environment, environment_shadows=16)
    frame = renderer.render(above, SIZE)
    atlas = renderer.gpu.shadows
    assert atlas.views is not None
    sky = set(atlas.views.sky)
    assert atlas.drawn == {view for view in sky if view.camera.forward[1] < 0}
    assert 0 < len(atlas.drawn) < 16
    below = renderer.render(replace(above, camera=BELOW), SIZE)
    assert atlas.drawn == sky  # earlier ones are kept
    np.testing.assert_array_equal(renderer.render(above, SIZE).radiance, frame.radiance)
    # Seen from below the ball is behind the ground, and takes next to nothing of its light.
    truth = tl.reference.render(replace(above, camera=BELOW), SIZE)
    assert np.median(relative(below, truth)) < 1e-6


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param({"camera": BELOW}, id="seen from below"),
        pytest.param({"objects": [moved(BALL, (0, -0.5, 0), WINE), CATCHER]}, id="sunk"),
        pytest.param({"objects": [tl.Object(BALL, WINE), STONE, CATCHER]}, id="not alone"),
        pytest.param({"objects": [tl.Object(BALL, WINE), ground()]}, id="no ground"),
        pytest.param(
            {"objects": [tl.Object(BALL, WINE), replace(CATCHER, surface=tl.Surface(diffuse_transmission=0.5))]},
            id="thin",
        ),
    ],
)
def test_grounds_lit_from_both_sides(changed: dict[str, Any]) -> None:
    shown = tl.Scene([tl.Object(BALL, WINE), CATCHER], CAMERA, [], DARK)
    side = lit_side(shown)
    assert side is not None
    np.testing.assert_allclose(side, (0, 1, 0), atol=1e-12)
    assert lit_side(replace(shown, **changed)) is None


def test_32_directions_are_within_a_few_percent_of_256(renderer: tl.Renderer) -> None:
    """And errors fall faster than with the square root of the number of directions."""
    environment = tl.Environment.gradient((0.2, 0.2, 0.2), (1, 1, 1.2))
    shown = scene("two media and a stone", environment=environment)
    maps = tl.ShadowMaps(128)
    many, *few = (renderer.render(replace(shown, environment_shadows=n), (48, 36), shadows=maps) for n in (256, 8, 32))
    floor = ~many.coverage
    coarse, fine = (
        np.sqrt(((frame.radiance - many.radiance)[floor] ** 2).mean()) / many.radiance[floor].mean() for frame in few
    )
    assert fine < 0.05
    assert fine < 0.5 * coarse


def test_few_of_the_directions_show_the_shadow_of_all(renderer: tl.Renderer) -> None:
    """Pictures that move have 8 of 128 directions, or 4: of a bear in the studio 1.9 % off."""
    scene = staged(tl.showcase(tl.load_mesh(mesh_path("bear")), tl.Medium((50.0, 20.0, 40.0)), stage="none"), "studio")
    assert scene.environment_shadows == 128
    every, eight, four = (
        renderer.render(scene, (64, 64), shadows=tl.ShadowMaps(512, count)).radiance for count in (None, 8, 4)
    )
    none = renderer.render(replace(scene, environment_shadows=0), (64, 64)).radiance
    errors = [np.sqrt(((found - every) ** 2).mean()) / every.mean() for found in (eight, four, none)]
    assert max(errors[:2]) < 0.02
    assert max(errors[:2]) < 0.8 * errors[2]


def test_paths_and_traced_rays_see_the_same_shadows(renderer: tl.Renderer) -> None:
    """Through a ball of glass without color, and beside it."""
    glass = moved(BALL, (-1.5, 0, 0), tl.Medium(ior=1.5))
    shown = tl.Scene([glass, *SCENES["ball"]["objects"]], CAMERA, [SUN], DARK)
    plain = replace(shown, objects=shown.objects[1:])
    seen, alone = renderer.render(shown, SIZE), renderer.render(plain, SIZE)
    with pytest.warns(tl.TranslucentWarning, match="caustics"):
        paths = renderer.render(shown, SIZE, method=tl.PathTraced(paths=2))
    beside = ~seen.coverage
    # Glass that bends rays throws no shadow by itself: it takes nothing from straight ones.
    for frame in (seen, paths):
        assert np.median(np.abs(frame.radiance - alone.radiance)[beside]) < 1e-6
    open_ground = renderer.render(replace(shown, objects=[glass, shown.objects[2]]), SIZE).radiance
    through = seen.coverage & ~alone.coverage
    assert (seen.radiance[through] < open_ground[through] - 1e-3).any()


def test_maps_are_rendered_when_something_changes(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    from translucent.gpu.passes.shadow_maps import ShadowMapsPass

    rendered: list[int] = []
    render = ShadowMapsPass._render
    monkeypatch.setattr(ShadowMapsPass, "_render", lambda *given: rendered.append(1) or render(*given))
    shown = scene("ball", "sun")
    brighter = replace(SUN, irradiance=(9, 9, 9))
    denser = [tl.Object(BALL, LEAF), shown.objects[1]]
    for changed, count in (
        (shown, 1),
        (shown, 0),
        (replace(shown, camera=tl.Camera.look_at((1, 3, 6), (0, 0, 0))), 0),
        (replace(shown, lights=[brighter]), 0),
        (replace(shown, lights=[LAMPS["lamp"]]), 1),
        (replace(shown, objects=denser), 1),
        (replace(shown, objects=[denser[0], moved(denser[1].mesh, (0, -0.1, 0))]), 1),
    ):
        rendered.clear()
        renderer.render(changed, (16, 12), samples=2)
        assert len(rendered) == count


def test_a_window_finds_what_one_light_sees_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame without time looks from one light, or draws one map, and the next goes on; of many vertices all of them
    would take half a second.
    """
    looked = 0
    cameras = ShadowOccluders.cameras

    def looks(occluders: ShadowOccluders) -> list[tl.Camera]:
        nonlocal looked
        looked += 1
        return cameras(occluders)

    monkeypatch.setattr(ShadowOccluders, "cameras", looks)
    shown = scene("ball", "sun", environment=tl.Environment.gradient(0.2, 1.0), environment_shadows=8)
    with tl.Renderer() as own:
        own.gpu.context.gl.extra = budget = CompileBudget()
        own.render(shown, (16, 12))
        plan = own.plan(replace(shown, lights=[LAMPS["lamp"]]))
        budget.postpones, budget.elsewhere, looked = True, set(budget.needed), 0
        frame = None
        for _ in range(100):
            budget.begin_frame(-1.0)
            before = looked
            with suppress(PostponedError):
                frame = own.gpu.render(plan, (16, 12))
                break
            assert looked <= before + 1
        assert (frame is not None, looked) == (True, 9)
        with tl.Renderer() as new:
            np.testing.assert_array_equal(frame.radiance, new.gpu.render(plan, (16, 12)).radiance)


def test_maps_of_two_media_are_paths_and_stay_when_these_change(renderer: tl.Renderer) -> None:
    """Maps hold paths for two media, optical depths for three; clear bodies count as none."""
    clear = moved(CUBE, (-1.5, 0.0, 0.0), tl.Medium())
    objects = [tl.Object(BALL, LEAF), clear, moved(CUBE, (0, 0.9, 0), WINE), ground()]
    shown, atlas = replace(scene("ball", "sun"), objects=objects), renderer.gpu._resources.shadows
    renderer.render(shown, SIZE)
    held = atlas.held
    assert (atlas.two_media, atlas.spectral) == (True, False)
    jade = tl.Medium(absorption=(3, 0.1, 2))
    changed = replace(shown, objects=[replace(objects[0], medium=jade), *objects[1:]])
    error = relative(renderer.render(changed, SIZE), tl.reference.render(changed, SIZE))
    assert atlas.held is held
    assert np.median(error) < 2e-6
    assert np.quantile(error, 0.95) < 1e-4
    renderer.render(replace(changed, objects=[changed.objects[0], replace(clear, medium=LEAF), *objects[2:]]), (8, 8))
    assert (atlas.two_media, atlas.spectral) == (False, True)


def test_a_layer_that_becomes_a_sheet_throws_its_shadow(renderer: tl.Renderer) -> None:
    """Nothing but the surface tells one from the other."""
    _, floor = SCENES["ball"]["objects"]
    sheet = moved(CUBE, (0, 0.5, 0), LEAF, sheet_thickness=0.1)
    ball = tl.Object(BALL, LEAF)
    shown = replace(scene("ball", "sun"), objects=[sheet, ball, floor])
    with tl.Renderer() as fresh:
        expected = fresh.render(shown, SIZE).radiance
    layer = replace(sheet, surface=tl.Surface(opacity=0.5))
    before = renderer.render(replace(shown, objects=[layer, ball, floor]), SIZE).radiance
    assert (before != expected).any()
    np.testing.assert_array_equal(renderer.render(shown, SIZE).radiance, expected)


def test_maps_that_do_not_fit_are_smaller(renderer: tl.Renderer) -> None:
    """As for many lights in the middle of a room: each takes six maps."""
    cameras = [CAMERA] * 6
    views = ShadowViews.of([(cameras, (0,), np.zeros(3))] * 32, [([CAMERA], (0,), np.zeros(3))] * 256, 8192, 16384)
    assert views.lights[0][0].size == 256
    assert len({view.corner for group in views.lights for view in group}) == 192
    boxes = {(*view.corner, view.size) for view in views}
    assert len(boxes) == 192 + 256
    assert max(x + size for x, _, size in boxes) <= views.extent[0]
    assert max(y + size for _, y, size in boxes) <= views.extent[1]
    assert 24 * views.extent[0] * views.extent[1] <= MOST_BYTES
    with pytest.raises(tl.RenderError, match=r"shadows of 1 lights and 0 directions .* use fewer"):
        ShadowViews.of([(cameras, (0,), np.zeros(3))], [], 1024, LEAST_TEXELS)
    crowd = replace(scene("ball"), lights=[LAMPS["sun"]] * 64)
    with pytest.raises(tl.InputError, match="64 lights; use at most 32"):
        renderer.render(crowd, (16, 12))


@pytest.mark.parametrize("size", [0, 63, 8193, 100.0, True, "large"])
def test_sizes_that_are_none_are_refused(size: Any) -> None:
    with pytest.raises(tl.InputError, match=r"ShadowMaps size .* the size must be a whole number in 64 to 8192"):
        tl.ShadowMaps(size)


def test_other_choices_of_shadows_are_refused(renderer: tl.Renderer) -> None:
    with pytest.raises(tl.InputError, match="shadows 1024; this is not a choice of shadows; give for example"):
        renderer.render(scene("ball", "sun"), (16, 12), shadows=1024)  # type: ignore[arg-type]


def test_grounds_are_not_in_the_way() -> None:
    """A floor is none of what throws shadows, unless it is lit from behind; a bowl that shadows itself does."""
    supports = [support_of(item) for item in (SCENES["ball"]["objects"])]
    shown = scene("ball", "sun")
    found = ShadowOccluders(SUN, shown, supports)
    assert found.grounds == (1,)
    assert not found.blocking
    below = ShadowOccluders(tl.DirectionalLight((0, 1, 0.2), (1, 1, 1)), shown, supports)
    assert below.blocking == (1,)
    stone = replace(shown, objects=[*shown.objects, STONE])
    assert ShadowOccluders(SUN, stone, [support_of(item) for item in stone.objects]).blocking == (2,)
