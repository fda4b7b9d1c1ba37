"""Ways to show light that is scattered many times: in which bodies it diffuses, which are layers, and why."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import BOX, GLASS, MILK, NO_STORAGE, OPEN, body, many_times, names, scene, sheet
from translucent.bench.shapes import joined
from translucent.diffusion.keys import diffusion_key
from translucent.geometry.solids import Box, Sphere
from translucent.planning.bodies import MAX_SLOTS
from translucent.planning.passes import NoteKind
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities
from translucent.planning.rendered import Treatment, scatterer_of, treatment_of
from translucent.planning.scattering import (
    LEAST_DEPTH,
    LEAST_LIT_DEPTH,
    MOST_CELL_DEPTH,
    MOST_DIFFUSED,
    choose_treatments,
)

WAX = tl.Medium(absorption=0.1, scattering=5.0, ior=1.4)
LIT = [tl.PointLight((0, 0, 5), (1, 1, 1))]
INSIDE_OUT = tl.Mesh(BOX.vertices, BOX.faces[:, ::-1], name="inside out")
THIN = tl.Mesh(
    *(getattr(Box((0, 0, 0), (1, 1, 0.001)).tessellate(), part) for part in ("vertices", "faces")), name="thin"
)
DENSE = tl.Medium(scattering=500.0)  # more than a mean free path across a cell
VARYING = tl.LinearDensity(0.0, 0.5, 1.0)


@pytest.mark.parametrize("lights", [[], LIT])
def test_light_diffuses_in_closed_bodies_with_an_interface(lights: list[tl.PointLight]) -> None:
    found = plan(scene(body(WAX), lights=lights))
    assert (found.treated(Treatment.DIFFUSION), found.treated(Treatment.LAYER)) == ((0,), ())
    assert found.diffusion == tl.Diffusion()
    assert found.says(NoteKind.DIFFUSED_LIGHT)
    assert not found.says(NoteKind.SPREAD_INSIDE)
    assert not found.says(NoteKind.LAYER_INSTEAD)
    assert not found.says(NoteKind.SCATTERED_AGAIN)


@pytest.mark.parametrize(
    ("what", "why"),
    [
        (body(WAX, OPEN), "the mesh is not closed"),
        (body(WAX, INSIDE_OUT), "the mesh is inside out"),
        (
            body(tl.Medium(scattering=5e3, ior=1.4), THIN),
            "the body is everywhere thinner than 0.25 cells of 0.005 m",
        ),
    ],
    ids=["open", "inside out", "thin"],
)
def test_bodies_in_which_light_cannot_diffuse_are_layers(what: tl.Object, why: str) -> None:
    """And the plan tells why."""
    for asked in (None, tl.Diffusion()):
        found = plan(scene(what), scattering=asked)
        assert (found.treated(Treatment.DIFFUSION), found.treated(Treatment.LAYER)) == ((), (0,))
        (note,) = (note for note in found.unmodelled if note.kind is NoteKind.LAYER_INSTEAD)
        assert str(note).startswith(f"{what.mesh.name!r}: flat layers replace diffusion, because {why}")
        assert found.says(NoteKind.SPREAD_INSIDE)
        assert not found.says(NoteKind.DIFFUSED_LIGHT)


def test_smaller_cells_let_light_diffuse_in_thinner_bodies() -> None:
    """A slab 2 mm thick: cells are 10 mm wide, and 5 mm at twice the resolution."""
    slab = Box((0, 0, 0), (1, 1, 0.002)).tessellate()
    medium = tl.Medium(scattering=5e3, ior=1.4)
    assert tl.Diffusion(20).cell_size(body(medium, slab)) == pytest.approx(0.01)
    # Its mean thickness is 2 V / A = 0.004 / 2.008 m.
    assert body(medium, slab).mean_thickness == pytest.approx(0.004 / 2.008)
    for resolution, diffused in ((20, ()), (40, (0,))):
        found = plan(scene(body(medium, slab)), scattering=tl.Diffusion(resolution))
        assert found.treated(Treatment.DIFFUSION) == diffused


@pytest.mark.parametrize(
    "what",
    [
        body(tl.Medium(scattering=0.02)),
        sheet(WAX),
        body(GLASS),
        body(tl.Medium(absorption=1.0, ior=1.5)),
        body(tl.Medium(scattering=0.01), density=VARYING),
    ],
    ids=["thin", "sheet", "clear", "clear glass", "haze"],
)
def test_other_bodies_show_what_they_scatter_once(what: tl.Object) -> None:
    found = plan(scene(what, lights=LIT))
    assert not many_times(found)
    assert not found.says(NoteKind.DIFFUSED_LIGHT)
    assert not found.says(NoteKind.SPREAD_INSIDE)


@pytest.mark.parametrize(("scale", "area"), [((1, 1, 1), 6.0), ((2, 2, 2), 24.0), ((1, 2, 3), 22.0)])
def test_an_object_has_the_area_of_its_scaled_mesh(scale: tuple[int, ...], area: float) -> None:
    assert replace(body(), transform=np.diag([*map(float, scale), 1.0])).area == pytest.approx(area)


def test_little_scattering_is_shown_once() -> None:
    """By the scattering across the body in its densest channel: of a cube, a third of its side."""
    assert body().mean_thickness == pytest.approx(1 / 3)
    for share, diffused in ((0.99, ()), (1.01, (0,))):
        depth = 3 * LEAST_DEPTH * share
        for anisotropy in (0.0, 0.8):
            medium = tl.Medium(scattering=(0, 0, depth), anisotropy=anisotropy, ior=1.4)
            assert plan(scene(body(medium))).treated(Treatment.DIFFUSION) == diffused


@pytest.mark.parametrize("medium", [DENSE, tl.Medium(scattering=0.01, ior=1.4)], ids=["matched", "shallow"])
def test_what_is_asked_for_is_done_where_it_can_be(medium: tl.Medium) -> None:
    diffused = plan(scene(body(medium)), scattering=tl.Diffusion(16))
    assert (diffused.treated(Treatment.DIFFUSION), diffused.treated(Treatment.LAYER)) == ((0,), ())
    assert diffused.diffusion.resolution == 16
    layered = plan(scene(body(medium)), scattering=tl.ScatteringLayer())
    assert (layered.treated(Treatment.DIFFUSION), layered.treated(Treatment.LAYER)) == ((), (0,))
    assert layered.says(NoteKind.SPREAD_INSIDE)
    assert not layered.says(NoteKind.LAYER_INSTEAD)


@pytest.mark.parametrize("asked", [tl.Diffusion(), tl.ScatteringLayer()])
def test_sheets_are_layers_if_asked_for_and_partly_transparent_layers_nothing(asked: Any) -> None:
    found = choose_treatments(scene(sheet(WAX)), asked)
    assert found.of == {0: Treatment.LAYER}
    assert found.refusals == (((0, "the body is a sheet"),) if asked == tl.Diffusion() else ())
    lacquer = body(WAX, surface=tl.Surface(opacity=0.5), sheet_thickness=1e-3)
    assert lacquer.covers
    assert not many_times(plan(scene(lacquer), scattering=asked))


def test_each_body_has_its_own_way() -> None:
    """And a plan tells of all of them."""
    asked = scene(body(WAX), body(WAX, OPEN, x=3), body(MILK, x=6), body(GLASS, x=9), body(None, x=12))
    found = plan(asked)
    treatments = Treatment.DIFFUSION, Treatment.LAYER, Treatment.VOLUME
    assert [found.treated(one) for one in treatments] == [(0,), (1,), (2,)]
    assert choose_treatments(asked, None).refusals == ((1, "the mesh is not closed"),)
    kinds = NoteKind.DIFFUSED_LIGHT, NoteKind.SPREAD_INSIDE, NoteKind.LAYER_INSTEAD
    for kind in kinds:
        assert found.says(kind)
    rendered = found.scene.objects
    assert [treatment_of(item) for item in rendered] == [*treatments, Treatment.SINGLE, Treatment.SINGLE]
    assert [item.has_interface for item in rendered] == [True, True, False, False, False]
    assert rendered[3:] == asked.objects[3:]
    # Along rays, what scatters in them only removes light; elsewhere, media are as they were.
    assert rendered[0].medium == tl.Medium(absorption=5.1, ior=1.4)
    assert [scatterer_of(item) for item in rendered] == [item.medium for item in asked.objects]
    assert [item.medium for item in rendered[1:]] == [item.medium for item in asked.objects[1:]]


def test_two_media_of_one_extinction_are_told_apart() -> None:
    """Bodies in which light diffuses: rays see the same of both."""
    bright, dark = tl.Medium(0.1, 5.0, ior=1.4), tl.Medium(1.1, 4.0, ior=1.4)
    plans = [plan(scene(body(medium))) for medium in (bright, dark)]
    assert plans[0].scene.objects[0].medium == plans[1].scene.objects[0].medium
    assert diffusion_key(plans[0]) != diffusion_key(plans[1])
    assert diffusion_key(plans[0]) == diffusion_key(plan(scene(body(replace(bright)))))


@pytest.mark.parametrize("capabilities", [Capabilities(), NO_STORAGE])
def test_diffused_light_needs_no_views_from_lights(capabilities: Capabilities) -> None:
    found = plan(scene(body(WAX), lights=LIT), capabilities=capabilities)
    assert isinstance(found.method, tl.SignedDepth)
    assert "light_views" not in names(found)
    assert not found.says(NoteKind.UNLIT)
    asked = plan(scene(body(WAX), lights=LIT), tl.SignedDepth(), capabilities)
    assert asked.treated(Treatment.DIFFUSION) == (0,)


@pytest.mark.parametrize("points", [1, 4])
def test_single_scattering_reaches_the_method(points: int) -> None:
    found = plan(scene(body(WAX), lights=LIT), scattering=tl.SingleScattering(points))
    assert found.method == tl.FragmentLists(light_points=points)
    assert not many_times(found)
    assert found.says(NoteKind.SCATTERED_AGAIN)
    own = plan(scene(body(WAX), lights=LIT), tl.FragmentLists(light_points=2), scattering=tl.SingleScattering(points))
    assert own.method == tl.FragmentLists(light_points=2)


@pytest.mark.parametrize("asked", ["diffusion", tl.Diffusion, 3, False])
def test_what_is_no_choice_of_scattering_is_refused(asked: Any) -> None:
    message = (
        f"scattering {asked!r}; this is not a choice of scattering; give tl.Diffusion(resolution=32), "
        "tl.ScatteringLayer() or tl.SingleScattering(points=8)"
    )
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        plan(scene(body(WAX)), scattering=asked)


@pytest.mark.parametrize(
    ("resolution", "message"),
    [
        (4, "Diffusion resolution 4; the value must be a whole number in 8 to 128; use a value such as 32"),
        (8.5, "Diffusion resolution 8.5; the value must be a whole number in 8 to 128; use a value such as 32"),
        (
            512,
            "Diffusion resolution 512; at this resolution, a body would have 3.4e+07 cells "
            "and take about 134 GB of memory; "
            "use at most 128; 32 is enough for media that mainly scatter",
        ),
    ],
)
def test_resolutions_out_of_reach_are_refused(resolution: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        tl.Diffusion(resolution)


def test_layers_of_varying_density_are_refused() -> None:
    cloud = body(tl.Medium(scattering=5.0, ior=1.4), density=VARYING)
    message = "ScatteringLayer(); 'box': the density varies; use SingleScattering() instead"
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        plan(scene(cloud), scattering=tl.ScatteringLayer())
    # Beside another body, which can be a layer, it is what it is.
    assert plan(scene(cloud, body(WAX, x=3)), scattering=tl.ScatteringLayer()).treated(Treatment.LAYER) == (1,)


def test_resolutions_at_the_bounds() -> None:
    assert [tl.Diffusion(count).resolution for count in (8, 128)] == [8, 128]


def test_many_bodies_are_layers_unless_asked_for() -> None:
    """A scene of hundreds of scattering bodies would take minutes."""
    crowd = scene(*(body(WAX, x=3.0 * i) for i in range(MOST_DIFFUSED + 1)))
    found = plan(crowd)
    assert found.treated(Treatment.DIFFUSION) == ()
    assert len(found.treated(Treatment.LAYER)) == MOST_DIFFUSED + 1
    notes = [note for note in found.unmodelled if note.kind is NoteKind.LAYER_INSTEAD]
    assert len(notes) == 1
    assert "more than 32 bodies" in notes[0]
    assert len(plan(crowd, scattering=tl.Diffusion()).treated(Treatment.DIFFUSION)) == MOST_DIFFUSED + 1
    few = scene(*(body(WAX, x=3.0 * i) for i in range(MOST_DIFFUSED)))
    assert len(plan(few).treated(Treatment.DIFFUSION)) == MOST_DIFFUSED


def test_a_body_whose_bounds_are_nearly_empty_is_a_layer() -> None:
    """Two balls far apart in one mesh: cells that fit them would fill more memory than a frame may take."""
    ball = Sphere().tessellate(16)
    pair = joined([(ball.vertices, ball.faces), (ball.vertices + [2000, 2000, 2000], ball.faces)], "pair")
    found = plan(scene(body(WAX, pair)))
    assert found.treated(Treatment.LAYER) == (0,)
    assert any("mostly empty" in note for note in found.unmodelled if note.kind is NoteKind.LAYER_INSTEAD)


CLOUD = body(MILK, density=VARYING)


@pytest.mark.parametrize("lights", [[], LIT])
def test_light_is_scattered_on_where_density_varies(lights: list[tl.PointLight]) -> None:
    found = plan(scene(CLOUD, lights=lights))
    assert treatment_of(found.scene.objects[0]) is Treatment.VOLUME
    assert found.diffuses
    assert isinstance(found.method, tl.RayMarched)
    assert "is added along view rays (Diffusion(resolution=32)) in 1 body" in str(found)
    assert found.says(NoteKind.DIFFUSED_LIGHT)
    assert not found.says(NoteKind.SCATTERED_AGAIN)
    assert not found.says(NoteKind.ONLY_REMOVES)
    assert not found.scene.objects[0].has_interface


def test_light_is_scattered_on_in_fog_and_leaves_dense_bodies_through_their_surface() -> None:
    """By the reduced optical depth across a cell; with OpenGL, and unless ambient light stands for it."""
    cell = tl.Diffusion().cell_size(body())
    for share, anisotropy in ((0.9, 0.0), (1.1, 0.0), (0.9, 0.5), (1.1, 0.5)):
        medium = tl.Medium(scattering=share * MOST_CELL_DEPTH / cell / (1.0 - anisotropy), anisotropy=anisotropy)
        found = plan(scene(body(medium)))
        assert found.treated(Treatment.VOLUME if share < 1.0 else Treatment.DIFFUSION) == (0,)
    fog, dense = scene(body(MILK), lights=LIT), scene(body(DENSE), lights=LIT)
    for machine in (NO_STORAGE, Capabilities(opengl=False)):
        assert plan(fog, capabilities=machine).treated(Treatment.DIFFUSION) == (0,)
        assert plan(dense, capabilities=machine).treated(Treatment.DIFFUSION) == (0,)
        assert not many_times(plan(scene(CLOUD, lights=LIT), capabilities=replace(machine, opengl=False)))
    assert plan(fog, tl.SignedDepth(), scattering=tl.Diffusion()).treated(Treatment.DIFFUSION) == (0,)
    assert not many_times(plan(scene(body(MILK), ambient=(1, 1, 1))))
    assert isinstance(plan(fog).method, tl.RayMarched)
    assert not many_times(plan(fog, tl.FragmentLists()))
    assert not many_times(plan(dense, tl.FragmentLists()))


def test_bodies_that_a_ground_lights_show_it_through_their_surface() -> None:
    """Rays in a volume know no ground; beams, lights inside and eyes within need a volume."""
    corners = np.array([(-9, -5, -9), (-9, -5, 9), (9, -5, 9), (9, -5, -9)], dtype=np.float64)
    ground = tl.Object(tl.Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)])), color=(0.5, 0.5, 0.5))
    fog, place = body(MILK), tuple(np.mean(body(MILK).bounds, axis=0))
    assert plan(scene(fog, ground)).treated(Treatment.DIFFUSION) == (0,)
    thin = tl.Medium(scattering=0.9 * LEAST_LIT_DEPTH / fog.mean_thickness)
    away = (place[0], place[1] + 9.0, place[2])
    beam = tl.SpotLight(away, (0, -1, 0), (1, 1, 1), 0.1, 0.2)
    for kept in (
        scene(body(thin), ground),
        scene(fog, ground, lights=[tl.PointLight(place, (1, 1, 1))]),
        scene(fog, ground, lights=[beam]),
        replace(scene(fog, ground), camera=tl.Camera.look_at(place, (0.0, 0.0, -9.0))),
    ):
        assert plan(kept).treated(Treatment.VOLUME) == (0,)
        assert "light that the ground reflects into the fog" in str(plan(kept))


def test_a_march_that_is_asked_for_has_light_scattered_once() -> None:
    """As `tl.reference.march` does; unless diffusion is asked for, too."""
    march = tl.RayMarched(steps=8)
    assert not many_times(plan(scene(CLOUD, lights=LIT), march))
    assert plan(scene(CLOUD, lights=LIT), march, scattering=tl.Diffusion(8)).treated(Treatment.VOLUME) == (0,)
    assert not many_times(plan(scene(CLOUD), scattering=tl.SingleScattering()))


def test_light_of_a_density_behind_an_interface_leaves_through_it() -> None:
    """On machines that take no steps, too."""
    marbled = scene(body(WAX, density=VARYING))
    for machine in (None, Capabilities(opengl=False)):
        assert plan(marbled, capabilities=machine).treated(Treatment.DIFFUSION) == (0,)


def test_more_fogs_than_winding_numbers_give_back_light_through_their_surfaces() -> None:
    """As many as a ray keeps apart are fogs, beside what else is there; one more, and none of one density is."""
    for others, most in ((0, MAX_SLOTS), (3, MAX_SLOTS - 3)):
        rest = [body(tl.Medium(absorption=i + 1.0), x=-3.0 * i - 3) for i in range(others)]
        for count in (most, most + 1):
            found = plan(scene(*(body(MILK, x=3.0 * i) for i in range(count)), *rest))
            numbers = [len(found.treated(one)) for one in (Treatment.VOLUME, Treatment.DIFFUSION)]
            assert numbers == ([count, 0] if count == most else [0, count])


@pytest.mark.parametrize(
    ("asked", "bodies", "capabilities", "message"),
    [
        (tl.Diffusion(), body(MILK, density=VARYING), Capabilities(opengl=False), "so light needs ray marching"),
        (tl.ScatteringLayer(), body(WAX), Capabilities(opengl=False), "'box': this renderer has no flat layers"),
    ],
)
def test_what_can_be_done_for_no_body_is_refused(
    asked: Any, bodies: tl.Object, capabilities: Capabilities | None, message: str
) -> None:
    with pytest.raises(tl.InputError, match=f"{re.escape(message)}.*use SingleScattering"):
        plan(scene(bodies), capabilities=capabilities, scattering=asked)


def test_fog_is_stepped_through_at_a_few_points_but_around_a_lamp_inside() -> None:
    fog = body(MILK)
    for lamp, found in (
        ((0.0, 0.0, 3.0), tl.RayMarched(steps=16, quadrature="gauss")),
        ((0.0, 0.2, 0.1), tl.RayMarched(steps=64, quadrature="equiangular")),
    ):
        assert plan(scene(fog, lights=[tl.PointLight(lamp, (1, 1, 1))])).method == found
