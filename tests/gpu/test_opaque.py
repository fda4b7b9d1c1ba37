"""Opaque objects: what lies behind them is not crossed, and they are seen through what lies in front."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests import references
from translucent.frames.metrics import interior
from translucent.geometry.solids import Box, Sphere

SIZE = (88, 66)
BODY = Box(low=(-1, -1, -1), high=(1, 1, 1)).tessellate()
WALL = Box.slab((6.0, 6.0), 0.2).tessellate()
BALL = Sphere().tessellate(48)
GROUND = Box((-40, -1.3, -40), (40, -1.1, 40)).tessellate()
RED = (0.8, 0.2, 0.1)
WINE = tl.Medium.from_color("#7b1e3a", distance=1.0)
EMBER = tl.Medium(absorption=(0.5, 1.0, 2.0), emission=(1.0, 0.2, 0.1))
LIGHTS = [tl.PointLight((2, 3, 4), (8, 8, 6)), tl.DirectionalLight((-1, -1, -0.5), (1, 1, 1))]
SKY = tl.Environment.gradient((0.2, 0.2, 0.2), (0.6, 0.7, 1.0))

METHODS = {
    "signed": tl.SignedDepth(),
    "back-face": tl.BackFaceDepth(),
    "thin": tl.ThinLayer(0.01),
    "lists": tl.FragmentLists(),
    "peeling": tl.DepthPeeling(),
    "front-to-back": tl.DepthPeeling(order="front-to-back"),
    "back-to-front": tl.DepthPeeling(order="back-to-front"),
    "k-buffer": tl.KBuffer(k=8),
}
CAMERAS = {
    "perspective": tl.Camera.look_at((1.5, 1.0, 6), (0, 0, 0)),
    "orthographic": tl.Camera.orthographic((1.5, 1.0, 6), (0, 0, 0), height=4),
    "inside": tl.Camera.look_at((0.2, 0.1, 0.9), (0, 0, -1), fov_y=70),
}


#: To be put above other parameters, so that it varies first: the reference's picture is made once for all methods.
each_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


def opaque(mesh: tl.Mesh, position: Any = (0, 0, 0), scale: float = 1.0) -> tl.Object:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = position
    return tl.Object(mesh, None, matrix, color=RED)


POSITIONS = {
    "in front": opaque(BALL, (0.2, 0.1, 2.0), 0.6),
    "inside": opaque(BALL, (0.2, 0.1, -0.1), 0.5),
    "half inside": opaque(BALL, (0.9, 0.1, 0.2), 0.6),
    "behind": opaque(WALL, (0, 0, -2)),
    "across": opaque(WALL),
    "touching": opaque(WALL, (0, 0, -1.1)),
    "around": opaque(BALL, scale=8.0),
}


#: Each method with each position and with each camera, and each position with each camera.
PLACES = sorted(
    (position, list(CAMERAS)[(i + j) % len(CAMERAS)], method)
    for i, position in enumerate(POSITIONS)
    for j, method in enumerate(METHODS)
)


def thin(method: Any) -> tl.ThinLayer | None:
    """The one method that changes what is true: all others are ways to the same."""
    return method if isinstance(method, tl.ThinLayer) else None


def assert_equal(renderer: tl.Renderer, scene: tl.Scene, method: Any, opaque_edges: float = 0.03) -> tl.Frame:
    """Equal to the reference but at most at edges of opaque objects and of shadows, which no counts of layers tell."""
    frame, truth = renderer.render(scene, SIZE, method), references.render(scene, SIZE, thin(method))
    assert frame.valid.all()
    # Interior to both: no edge of a body, nor of the opaque object, within a pixel.
    inside = interior(references.hit_counts(scene, SIZE))
    # Shadows are interpolated between texels: of a ball's path, with curvature 10 and 4 mm wide, 3e-5 at an extinction
    # of 1.5.
    for name, most in (("thickness", 1e-5), ("transmittance", 1e-5), ("radiance", 5e-5)):
        off = np.abs(getattr(frame, name) - getattr(truth, name))[inside]
        scale = max(1.0, float(np.abs(getattr(truth, name)).max()))
        assert np.median(off) <= 3e-7 * scale, name
        assert np.quantile(off, 1 - opaque_edges) <= most * scale, name
    mismatch = (frame.coverage != truth.coverage)[inside].mean()
    assert mismatch <= opaque_edges
    return frame


@pytest.mark.parametrize(("position", "camera", "method"), PLACES)
@pytest.mark.filterwarnings("ignore::translucent.errors.TranslucentWarning")
def test_where_the_opaque_object_is(renderer: tl.Renderer, method: str, position: str, camera: str) -> None:
    scene = tl.Scene([tl.Object(BODY, WINE), POSITIONS[position]], CAMERAS[camera], lights=LIGHTS, environment=SKY)
    assert_equal(renderer, scene, METHODS[method])


@each_method
def test_coincident_with_the_body(renderer: tl.Renderer, method: Any) -> None:
    """The same mesh, once opaque: no path within it is left; sheets on it are seen."""
    scene = tl.Scene([tl.Object(BODY, WINE), opaque(BODY)], CAMERAS["perspective"], environment=SKY)
    frame = renderer.render(scene, SIZE, method)
    truth = references.render(scene, SIZE, thin(method))
    alone = references.hit_counts(tl.Scene(scene.objects[:1], scene.camera), SIZE)
    inside = interior(alone)
    assert frame.valid.all()
    if isinstance(method, tl.ThinLayer):
        seen = inside & truth.coverage
        np.testing.assert_allclose(frame.thickness[seen], truth.thickness[seen], rtol=1e-5)
        return
    assert (frame.thickness[inside] <= 2e-6 * scene.diagonal).all()
    assert frame.coverage[inside].mean() <= 0.02  # rounding, of less than a millionth
    seen = inside & (alone > 0)
    off = np.abs(frame.radiance - truth.radiance)[seen]
    assert np.quantile(off, 0.98) <= 1e-5


@pytest.mark.parametrize("method", [None, tl.DepthPeeling(), tl.KBuffer()], ids=["lists", "peeling", "k-buffer"])
@pytest.mark.parametrize("position", POSITIONS)
def test_emission_in_front_of_an_opaque_object(renderer: tl.Renderer, method: Any, position: str) -> None:
    inner = tl.Object(BALL, tl.Medium(absorption=2.0, emission=(0, 0.5, 1)), np.diag([0.7, 0.7, 0.7, 1]))
    item = POSITIONS[position]
    if position in (
        "behind",
        "touching",
    ):  # such a wall is a ground, which emission lights; in the reference it does not
        item = replace(item, color=(0, 0, 0))
    scene = tl.Scene([tl.Object(BODY, EMBER), inner, item], CAMERAS["perspective"], lights=LIGHTS, environment=SKY)
    assert_equal(renderer, scene, method)


CUP = tl.Mesh(BODY.vertices, BODY.faces[~(BODY.vertices[BODY.faces][..., 2] == -1).all(axis=1)], name="cup")
_BACK = (BODY.vertices[BODY.faces][..., 2] == -1).all(axis=1)
CUP = tl.Mesh(BODY.vertices, BODY.faces[~_BACK], name="cup")
TURNED = tl.Mesh(BODY.vertices, np.where(_BACK[:, None], BODY.faces[:, ::-1], BODY.faces), name="turned")

#: Of what is solid: each may end inside a body at an opaque surface.
SOLID = {name: method for name, method in METHODS.items() if name != "thin"} | {"marched": tl.RayMarched(steps=4)}


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
@pytest.mark.parametrize("mesh", [CUP, TURNED], ids=["open", "turned"])
@pytest.mark.parametrize("ends", ["wall", "ground", "backdrop"])
@pytest.mark.parametrize("method", [None, *SOLID.values()], ids=["chosen", *SOLID])
def test_a_hole_before_an_opaque_surface_is_marked(
    renderer: tl.Renderer, method: Any, ends: str, mesh: tl.Mesh
) -> None:
    """A ray that comes out through the open back of a box, or one that looks inwards, is not in the box where it ends.

    Media go on behind the opaque surface.
    """
    camera = tl.Camera.look_at((0.5, 2.5, 5), (0, 0, 0))
    beyond = np.eye(4)
    beyond[:3, 3] = -2, -9, -18
    bodies = [tl.Object(mesh, WINE), tl.Object(BODY, WINE, beyond)]
    around = {"wall": [opaque(WALL, (0, 0, -3), 4.0)], "ground": [opaque(GROUND)], "backdrop": []}[ends]
    backdrop = tl.Backdrop(np.zeros((*SIZE[::-1], 3)), np.full(SIZE[::-1], 9.0)) if ends == "backdrop" else None
    alone = renderer.render(tl.Scene(bodies, camera), SIZE, method)
    frame = renderer.render(tl.Scene([*bodies, *around], camera), SIZE, method, backdrop=backdrop)
    assert (~alone.valid).sum() > 300
    assert not (frame.valid & ~alone.valid).any()


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
def test_bent_rays_that_end_in_an_open_body_are_marked(renderer: tl.Renderer) -> None:
    """A box of glass without a bottom: straight rays leave it through its sides, bent ones by way of the ground."""
    open_below = tl.Mesh(BODY.vertices, BODY.faces[~(BODY.vertices[BODY.faces][..., 1] == -1).all(axis=1)])
    glass = tl.Medium(absorption=0.1, ior=1.5)
    camera = tl.Camera.look_at((0.5, 3.5, 5), (0, 0, 0), fov_y=30)
    marked = []
    for objects in ([], [opaque(GROUND)]):
        scene = tl.Scene([tl.Object(open_below, glass), *objects], camera)
        straight = renderer.render(tl.Scene([tl.Object(open_below, WINE), *objects], camera), SIZE)
        for frame in (renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)):
            bent = straight.valid & ~frame.valid & interior(straight.valid)
            assert bent.sum() > 180
            marked.append(bent)
    alone, truly_alone, grounded, truly_grounded = marked
    assert (alone & ~grounded).sum() <= 0.02 * alone.sum()
    assert (truly_alone & ~truly_grounded).sum() <= 0.02 * alone.sum()


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
def test_a_ground_is_marked_where_it_mirrors_a_hole(renderer: tl.Renderer, few_shadows: None) -> None:
    """Nothing of the body is seen there directly."""
    camera = tl.Camera.look_at((0.5, 0.6, 6), (0, -0.8, 0), fov_y=35)
    frames = []
    for mesh in (BODY, CUP):
        scene = tl.staged(tl.Scene([tl.Object(mesh, tl.Medium(absorption=0.1, ior=1.5))], camera), "night")
        frames.append(renderer.render(scene, (56, 42)))
    closed, cup = frames
    assert closed.valid.all()
    assert (~closed.coverage & ~cup.valid).sum() > 25


def test_an_opaque_object_in_a_closed_body_beside_an_open_one_is_trusted(renderer: tl.Renderer) -> None:
    aside = np.eye(4)
    aside[0, 3] = 20
    unseen = tl.Object(CUP, tl.Medium(absorption=0.1, ior=1.5), aside)
    glass = tl.Object(BODY, tl.Medium(absorption=0.1, ior=1.5))
    camera = tl.Camera.look_at((0.1, 0.2, 6), (0, 0, 0), fov_y=12)
    scene = tl.Scene([glass, opaque(BALL, scale=0.9), unseen], camera)
    assert renderer.render(scene, SIZE).valid.all()


def test_a_hole_behind_the_wall_does_not_matter_to_lists(renderer: tl.Renderer) -> None:
    """Bodies behind an opaque surface are not looked at: an open body whose hole is there is sound."""
    camera = tl.Camera.look_at((0.1, 0.2, 6), (0, 0, 0))
    for wall, valid in (((0, 0, 0), True), ((0, 0, -4), False)):
        scene = tl.Scene([tl.Object(CUP, WINE), opaque(WALL, wall)], camera)
        if valid:
            frame = renderer.render(scene, SIZE, tl.FragmentLists())
        else:
            with pytest.warns(tl.TranslucentWarning, match="'cup'"):
                frame = renderer.render(scene, SIZE, tl.FragmentLists())
        assert frame.valid.all() == valid


def test_the_nearest_of_many_opaque_objects_is_seen(renderer: tl.Renderer) -> None:
    """Also with a floor a thousand times as large as the body, and with the eye close to a wall."""
    floor = tl.Object(Box.slab((2000.0, 2000.0), 1.0).tessellate(), None, _lying((0, -1.5, 0)), color=(0.3, 0.6, 0.3))
    objects = [tl.Object(BODY, WINE), floor, *POSITIONS.values()]
    scene = tl.Scene(objects[:-1], CAMERAS["perspective"], lights=LIGHTS, environment=SKY)
    frame, truth = renderer.render(scene, SIZE), references.render(scene, SIZE)
    off = np.abs(frame.radiance - truth.radiance).max(axis=-1)
    # Edges of opaque objects may be drawn a pixel apart.
    assert np.quantile(off, 0.95) <= 1e-5
    assert frame.valid.all()


def _lying(position: Any) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    matrix[:3, 3] = position
    return matrix


@pytest.mark.parametrize(
    ("lights", "environment"),
    [
        ([], SKY),
        ([LIGHTS[0]], tl.Environment.constant((0.5, 0.6, 0.7))),
        ([LIGHTS[1]], tl.Environment.checkerboard((1, 1, 1), (0, 0, 0))),
        (LIGHTS * 16, SKY),
    ],
    ids=["gradient", "point, constant", "sun, checkerboard", "32, gradient"],
)
def test_opaque_objects_are_lit(renderer: tl.Renderer, lights: list[Any], environment: tl.Environment) -> None:
    scene = tl.Scene([tl.Object(BODY, WINE), POSITIONS["in front"]], CAMERAS["perspective"], lights, environment)
    assert_equal(renderer, scene, None)


def test_too_many_lights_are_refused(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(BODY, WINE), POSITIONS["in front"]], CAMERAS["perspective"], LIGHTS * 17)
    with pytest.raises(tl.InputError, match="34 lights; use at most 32"):
        renderer.render(scene, SIZE)


def test_a_scene_of_opaque_objects_only_is_refused(renderer: tl.Renderer) -> None:
    with pytest.raises(
        tl.InputError,
        match=r"none of these objects has a medium; give at least one object a medium: medium=tl\.Medium\(\.\.\.\)",
    ):
        renderer.render(tl.Scene([opaque(BODY)], CAMERAS["perspective"]), SIZE)


def test_several_samples_smooth_the_edges_of_opaque_objects(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(BODY, WINE), POSITIONS["in front"]], CAMERAS["perspective"], LIGHTS, SKY)
    one, many = (renderer.render(scene, SIZE, samples=n) for n in (1, 16))
    np.testing.assert_array_equal(one.thickness, many.thickness)
    assert len(np.unique(many.radiance)) > len(np.unique(one.radiance))


def test_of_coincident_opaque_objects_the_first_is_seen(renderer: tl.Renderer) -> None:
    objects = [tl.Object(BODY, None, color=color) for color in ((1, 0, 0), (0, 0, 1))]
    scene = tl.Scene([tl.Object(BALL, WINE, np.diag([0.5, 0.5, 0.5, 1])), *objects], CAMERAS["perspective"])
    frame, truth = renderer.render(scene, SIZE), references.render(scene, SIZE)
    assert frame.radiance[..., 0][60, 80] > 0.5
    assert (np.abs(frame.radiance - truth.radiance) > 1e-3).mean() <= 0.02


def test_lights_that_shine_on_nothing_opaque_are_not_counted(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(BODY, WINE)], CAMERAS["perspective"], LIGHTS * 17)
    assert renderer.render(scene, SIZE).valid.all()


@pytest.mark.parametrize("z", [0.0, -2.0])
def test_a_sheet_behind_an_orthographic_picture_is_not_seen(renderer: tl.Renderer, z: float) -> None:
    matrix = np.eye(4)
    matrix[2, 3] = z
    bubble = tl.Object(BALL, WINE, matrix, sheet_thickness=0.01)
    camera = tl.Camera.orthographic((0.1, 0.2, 0.1), (0.1, 0.2, 5), height=3)
    scene = tl.Scene([bubble], camera)
    frame, truth = renderer.render(scene, SIZE), references.render(scene, SIZE)
    inside = interior(references.hit_counts(scene, SIZE))
    assert np.quantile(np.abs(frame.thickness - truth.thickness)[inside], 0.98) <= 1e-4
    assert frame.coverage.any() == (z == 0.0)
