"""The planner, row by row: for each kind of scene the passes, their reasons, and what is refused. No GPU."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from typing import Any, get_args

import pytest
import trimesh

import translucent as tl
from translucent.plan import COSTS, plan, plan_over_backdrop
from translucent.plan_borders import ONE_BORDER
from translucent.render_plan import Borders, Capabilities, RenderPlan

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces, name="box")
OPEN = tl.Mesh(_BOX.vertices, _BOX.faces[1:], name="open box")
_TORUS = trimesh.creation.torus(1.0, 0.25, major_sections=12, minor_sections=8)
TORUS = tl.Mesh(_TORUS.vertices, _TORUS.faces, name="torus")
_APART = _BOX.vertices + (5, 0, 0)
#: One part looks outwards, the other inwards, and neither is inside the other.
INSIDE_OUT = tl.Mesh([*_BOX.vertices, *_APART], [*_BOX.faces, *_BOX.faces[:, ::-1] + 8], name="half flipped")
DOUBLED = tl.Mesh(_BOX.vertices, [*_BOX.faces, *_BOX.faces[:, ::-1]], name="walls")
CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))

GLASS, WINE = tl.Medium(absorption=1.0), tl.Medium(absorption=(1, 2, 3))
FIRE, EMBER = tl.Medium(absorption=1.0, emission=(3, 1, 0)), tl.Medium(absorption=1.0, emission=(1, 1, 0))
MILK, DIAMOND = tl.Medium(scattering=1.0), tl.Medium(absorption=1.0, ior=2.4)
NO_STORAGE = Capabilities(shader_storage=False)
ORDERED = [tl.DepthPeeling(), tl.FragmentLists(), tl.KBuffer()]


def body(medium: tl.Medium | None = GLASS, mesh: tl.Mesh = BOX, x: float = 0.0, **options: Any) -> tl.Object:
    return tl.Object(mesh, medium, trimesh.transformations.translation_matrix((x, 0, 0)), **options)


def sheet(medium: tl.Medium = GLASS, mesh: tl.Mesh = BOX, x: float = 0.0) -> tl.Object:
    return body(medium, mesh, x, sheet_thickness=1e-3)


def scene(*objects: tl.Object, **options: Any) -> tl.Scene:
    return tl.Scene(objects, CAMERA, **options)


def names(found: RenderPlan) -> list[str]:
    return [step.name for step in found.passes]


# The table of the planner: what a scene has, the passes it gets, how often geometry is drawn, and whether that is exact


@pytest.mark.parametrize(
    ("objects", "method", "passes", "spectral", "geometry_passes"),
    [
        pytest.param([sheet()], None, "thin_layer", False, 1, id="a declared sheet"),
        pytest.param([sheet(mesh=OPEN)], None, "thin_layer", False, 1, id="an open sheet"),
        pytest.param([sheet(), sheet(WINE)], None, "thin_layer", True, 1, id="sheets of two media"),
        pytest.param([body()], None, "signed_depth", False, 1, id="a convex body"),
        pytest.param([body(mesh=TORUS)], None, "signed_depth", False, 1, id="a concave body"),
        pytest.param([body(), body(x=0.5)], None, "signed_depth", False, 1, id="overlaps that add up"),
        pytest.param([body(), body(WINE)], None, "signed_depth", True, 1, id="two media"),
        pytest.param([body(FIRE)], None, "signed_depth", False, 1, id="emission"),
        pytest.param([body(FIRE), body(FIRE, x=0.5)], None, "signed_depth", False, 1, id="emission of one medium"),
        pytest.param([body(FIRE), sheet(FIRE)], None, "signed_depth thin_layer", False, 2, id="emission and its sheet"),
        pytest.param([body(), sheet()], None, "signed_depth thin_layer", False, 2, id="a sheet beside a body"),
        pytest.param([body(), body(None)], None, "opaque signed_depth", False, 2, id="an opaque object"),
        pytest.param([body(None), sheet()], None, "opaque thin_layer", False, 2, id="an opaque object and a sheet"),
        pytest.param([body(FIRE), body(None)], None, "opaque signed_depth", False, 2, id="opaque and emission"),
        pytest.param([body(), body(None), body(WINE)], None, "opaque signed_depth", True, 2, id="opaque and two media"),
        pytest.param([body(FIRE), body(WINE)], None, "fragment_lists", True, 1, id="emission among media"),
        pytest.param([body(FIRE), body(EMBER)], None, "fragment_lists", True, 1, id="two emitting media"),
        pytest.param(
            [body(FIRE), body(WINE), body(None)], None, "opaque fragment_lists", True, 2, id="opaque, emission in order"
        ),
        pytest.param([body()], tl.BackFaceDepth(), "back_face_depth", False, 2, id="convex, and asked for"),
    ],
)
def test_a_scene_and_its_exact_plan(
    objects: list[tl.Object], method: Any, passes: str, spectral: bool, geometry_passes: int
) -> None:
    found = plan(scene(*objects), method)
    assert names(found) == [*passes.split(), "transmittance"]
    assert (found.exact, found.limits, found.spectral) == (True, (), spectral)
    assert found.geometry_passes == geometry_passes
    kinds = {"thin_layer": tl.ThinLayer, "fragment_lists": tl.FragmentLists, "back_face_depth": tl.BackFaceDepth}
    first = passes.removeprefix("opaque ").split()[0]
    assert type(found.method) is kinds.get(first, tl.SignedDepth)


@pytest.mark.parametrize("overlap", ["union", "priority"])
@pytest.mark.parametrize(
    ("objects", "ordered"),
    [
        pytest.param([body()], False, id="alone"),
        pytest.param([body(), body(x=3)], False, id="apart, one medium"),
        pytest.param([body(), body(WINE, x=3)], False, id="apart, two media"),
        pytest.param([body(), body(WINE, x=1.0)], False, id="they touch, and share no volume"),
        pytest.param([body(FIRE), body(FIRE, x=1.0)], False, id="one emitting medium, no volume shared"),
        pytest.param([body(), sheet(x=0.5)], False, id="a sheet adds to what it stands in"),
        pytest.param([sheet(), sheet(WINE, x=0.5)], False, id="only sheets"),
        pytest.param([body(), body(None, TORUS, 0.5)], False, id="an opaque object"),
        pytest.param([body(), body(x=0.5)], True, id="overlap, one medium"),
        pytest.param([body(), body(WINE, x=0.5, priority=1)], True, id="overlap, two media"),
        pytest.param([body(), body()], True, id="the same body twice"),
        pytest.param([body(), body(x=9), body(x=0.5)], True, id="overlap, with one apart between them"),
        pytest.param([body(mesh=TORUS)], True, id="concave: may overlap itself"),
    ],
)
def test_an_overlap_policy_needs_order_where_bodies_may_overlap(
    overlap: Any, objects: list[tl.Object], ordered: bool
) -> None:
    found = plan(scene(*objects, overlap=overlap))
    assert found.ordered is ordered
    assert found.exact
    assert ("fragment_lists" in names(found)) is ordered
    assert not plan(scene(*objects)).ordered  # with overlap="add"


@pytest.mark.parametrize("capabilities", [None, Capabilities(), Capabilities(shader_storage=True)])
def test_a_machine_that_can_all_gets_fragment_lists(capabilities: Capabilities | None) -> None:
    assert plan(scene(body(FIRE), body(WINE)), None, capabilities).method == tl.FragmentLists()


@pytest.mark.parametrize(
    "objects", [[body()], [body(), body(WINE)], [sheet()], [body(None), body()], [body(mesh=OPEN)]]
)
def test_only_order_asks_for_shader_storage(objects: list[tl.Object]) -> None:
    assert plan(scene(*objects), None, NO_STORAGE) == plan(scene(*objects))


def test_convex_is_what_back_face_depth_is_exact_for() -> None:
    assert plan(scene(body()), tl.BackFaceDepth()).exact
    assert not plan(scene(body(mesh=TORUS)), tl.BackFaceDepth()).exact
    assert not plan(scene(body(), body(x=3)), tl.BackFaceDepth()).exact


@pytest.mark.parametrize(
    ("objects", "effects"),
    [
        ([body()], []),
        ([body(MILK)], ["in-scattered light: scattering only removes light"]),
        ([body(DIAMOND)], ["refraction and reflection beyond the first interval"]),
        ([body(), body(None)], ["shadows: light reaches opaque objects through everything"]),
        ([body(MILK), body(DIAMOND), body(None)], ["in-scattered light", "refraction", "shadows"]),
    ],
)
@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.ThinLayer(), *ORDERED])
def test_an_effect_that_no_pass_renders_is_told(objects: list[tl.Object], effects: list[str], method: Any) -> None:
    found = plan(scene(*objects), method)
    assert len(found.unmodelled) == len(effects)
    for told, effect in zip(found.unmodelled, effects, strict=True):
        assert told.startswith(effect)
    # Thickness and transmittance along straight rays are exact all the same.
    assert found.exact == (method != tl.ThinLayer())


# One border


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), *ORDERED])
def test_one_border_saves_a_draw_and_says_what_it_costs(method: Any) -> None:
    asked = scene(body(DIAMOND), body(None, TORUS))
    both, front = plan(asked, method), plan(asked, method, borders="front")
    assert plan(asked, method, borders="both") == both
    assert (both.borders, front.borders) == ("both", "front")
    assert [step.name for step in both.passes] == [step.name for step in front.passes]
    assert front.geometry_passes == both.geometry_passes - 1
    assert front.cost < both.cost
    assert front.unmodelled == (*both.unmodelled, ONE_BORDER)
    assert 'not modelled: borders="front": bends once, where a ray enters; leaves without bending' in str(front)
    assert front.summary()["borders"] == "front"


@pytest.mark.parametrize(
    ("objects", "method"), [([body()], None), ([sheet(DIAMOND)], None), ([body(DIAMOND)], tl.ThinLayer())]
)
def test_one_border_changes_nothing_where_nothing_bends(objects: list[tl.Object], method: Any) -> None:
    assert plan(scene(*objects), method, borders="front") == plan(scene(*objects), method)


@pytest.mark.parametrize(
    ("objects", "method"),
    [([sheet(DIAMOND)], None), ([sheet(DIAMOND), body()], None), ([body(DIAMOND)], tl.ThinLayer())],
)
def test_sheets_have_one_border_and_bend_no_ray(objects: list[tl.Object], method: Any) -> None:
    found = {step.name: step for step in plan(scene(*objects), method).passes}
    assert found["interfaces"].reason.endswith("normal and place of the sheet that a ray meets first")
    assert found["interfaces"].geometry_passes == 1
    assert found["surfaces"].reason == "borders mirror the environment (ior above 1); rays go straight through sheets"
    solid = {step.name: step for step in plan(scene(body(DIAMOND))).passes}
    assert solid["interfaces"].geometry_passes == 2
    assert 0 < found["interfaces"].cost < solid["interfaces"].cost


def test_one_border_names_the_sheets_too() -> None:
    asked = scene(sheet(DIAMOND, OPEN), body(DIAMOND))
    for borders in get_args(Borders):
        (step,) = (step for step in plan(asked, borders=borders).passes if step.name == "interfaces")
        assert step.reason.startswith("'open box', 'box': ")


def test_one_border_needs_no_order_where_bodies_touch() -> None:
    touching = scene(body(DIAMOND), body(WINE, x=0.5))
    assert plan(touching).ordered
    assert not plan(touching, borders="front").ordered


@pytest.mark.parametrize(
    ("camera", "inside"),
    [
        (tl.Camera.look_at((0, 0, 0.2), (0, 0, -1)), True),
        (tl.Camera.look_at((0, 0, 5), (0, 0, -1)), False),
        (tl.Camera.look_at((0, 0, -5), (0, 0, -9)), False),
        (tl.Camera.orthographic((0, 0, 0.2), (0, 0, -1), height=1), True),
        (tl.Camera.orthographic((0, 0, 5), (0, 0, -1), height=1), False),
    ],
)
def test_one_border_cannot_be_entered_from_inside(camera: tl.Camera, inside: bool) -> None:
    asked = tl.Scene([body(DIAMOND)], camera)
    if not inside:
        assert plan(asked, borders="front").borders == "front"
        return
    message = r'^borders="front"; rays start inside .*; use borders="both", or move the camera outside$'
    with pytest.raises(tl.InputError, match=message):
        plan(asked, borders="front")
    assert plan(asked).borders == "both"


def test_an_eye_in_the_hole_of_a_ring_is_outside() -> None:
    ring = tl.Scene([body(DIAMOND, TORUS)], tl.Camera.look_at((0, 0, 0), (1, 0, 0)))
    assert plan(ring, borders="front").borders == "front"


def test_borders_that_are_not_known_are_refused() -> None:
    with pytest.raises(tl.InputError, match=r"^borders 'back'; not known; use one of both, front$"):
        plan(scene(body()), borders="back")  # type: ignore[arg-type]
    with tl.Renderer("cpu") as renderer, pytest.raises(tl.InputError, match=r"^borders \['front'\]; not known"):
        renderer.plan(scene(body()), borders=["front"])  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ["RayMarched", "signed-depth", tl.ThinLayer, 3])
def test_what_is_no_method_is_refused(method: Any) -> None:
    with pytest.raises(tl.InputError, match=r"^method .*; not a thickness method; give for example tl.SignedDepth\(\)"):
        plan(scene(body()), method)


@pytest.mark.parametrize("mesh", [OPEN, INSIDE_OUT, DOUBLED])
def test_a_sheet_needs_no_inside(mesh: tl.Mesh) -> None:
    assert [limit for limit in plan(scene(sheet(mesh=mesh))).limits if "duplicated" not in limit] == []
    assert plan(scene(body(mesh=mesh))).limits


# Bodies that are not closed


@pytest.mark.parametrize(
    ("method", "passes"),
    [
        (None, ["signed_depth", "thin_layer_fallback", "signed_depth_fallback"]),
        (tl.SignedDepth(), ["signed_depth", "thin_layer_fallback", "signed_depth_fallback"]),
        (tl.BackFaceDepth(), ["back_face_depth", "thin_layer_fallback", "signed_depth_fallback"]),
        (tl.DepthPeeling(), ["thin_layer_fallback", "signed_depth_fallback", "depth_peeling"]),
        (tl.FragmentLists(), ["thin_layer_fallback", "signed_depth_fallback", "fragment_lists"]),
        (tl.KBuffer(32), ["thin_layer_fallback", "signed_depth_fallback", "k_buffer"]),
    ],
)
def test_an_open_body_is_marked_and_falls_back_to_a_sheet(method: Any, passes: list[str]) -> None:
    found = plan(scene(body(), body(mesh=OPEN, x=3)), method)
    assert names(found) == [*passes, "transmittance"]
    steps = {step.name: step for step in found.passes}
    assert steps["thin_layer_fallback"].objects == (1,)
    assert steps["signed_depth_fallback"].objects == (0,)
    for name, step in steps.items():
        assert step.target == ("fallback" if name.endswith("fallback") else "accumulated")
        assert step.objects == (0, 1) or step.target == "fallback" or name == "transmittance"
    assert steps["thin_layer_fallback"].reason == (
        "'open box' not closed: pixels that enter and leave unequally often get sheets of 1% of the diagonal, and are "
        "marked invalid"
    )
    assert found.limits[0] == (
        "'open box': 3 open edges (first: vertices (0, 1), (0, 3), (1, 3)): close it, or declare it a sheet "
        "(sheet_thickness=..., --method thin-layer)"
    )
    assert not found.exact


def test_sheets_are_drawn_in_the_fallback_too() -> None:
    found = plan(scene(sheet(), body(mesh=OPEN), body(None)))
    assert [(step.name, step.objects) for step in found.passes] == [
        ("opaque", (2,)),
        ("signed_depth", (1,)),
        ("thin_layer", (0,)),
        ("thin_layer_fallback", (1, 0)),
        ("transmittance", ()),
    ]


def test_an_open_mesh_drawn_as_a_sheet_needs_no_fallback() -> None:
    found = plan(scene(body(mesh=OPEN)), tl.ThinLayer())
    assert (names(found), found.exact) == (["thin_layer", "transmittance"], True)


# Limits: where a plan is not exact


@pytest.mark.parametrize(
    ("objects", "method", "limits"),
    [
        ([body()], tl.SignedDepth(anchored=False), ["distances count from the camera: float32 loses digits"]),
        ([body(mesh=TORUS)], tl.BackFaceDepth(), ["'torus' not convex: pixels with more than one entry are marked in"]),
        ([body(), body(x=3)], tl.BackFaceDepth(), ["several bodies: pixels that cross more than one are marked inval"]),
        ([body(mesh=OPEN)], tl.BackFaceDepth(), ["'open box': 3 open edges", "'open box' not convex: pixels with"]),
        ([body()], tl.ThinLayer(), ["'box' closed, but drawn as sheets: what is inside is left out"]),
        ([sheet(), body(), body(mesh=TORUS), body(mesh=OPEN)], tl.ThinLayer(), ["'box', 'torus' closed, but drawn as"]),
        ([body(mesh=DOUBLED)], None, ["'walls': 12 duplicated faces, which count twice or cancel"]),
        ([sheet(mesh=DOUBLED)], None, ["'walls': 12 duplicated faces, which count twice or cancel"]),
        ([body(mesh=INSIDE_OUT)], None, ["'half flipped': 1 closed parts inside out: their pixels are marked invalid"]),
        ([body(mesh=INSIDE_OUT)], tl.FragmentLists(), ["'half flipped': 1 closed parts inside out: their pixels are"]),
        ([body(mesh=INSIDE_OUT)], tl.ThinLayer(), ["'half flipped' closed, but drawn as sheets"]),
        ([sheet(mesh=INSIDE_OUT), body()], None, []),
    ],
)
def test_a_plan_that_is_not_exact_says_where(objects: list[tl.Object], method: Any, limits: list[str]) -> None:
    found = plan(scene(*objects), method)
    assert found.exact is not bool(limits)
    assert len(found.limits) == len(limits)
    for told, limit in zip(found.limits, limits, strict=True):
        assert told.startswith(limit)


# Reasons


@pytest.mark.parametrize(
    ("objects", "method", "step", "reason"),
    [
        (
            [body()],
            None,
            0,
            "1 body in one unsorted draw each: exits minus entries add up to thickness, since all bodi",
        ),
        ([body(), body(WINE)], None, 0, "2 bodies in one unsorted draw each: exits minus entries add up to optical de"),
        ([body()], None, -1, "Beer-Lambert: what is behind, through exp(-optical depth)"),
        ([body(FIRE)], None, -1, "Beer-Lambert, and the emission of the one medium in closed form, q / sigma_t (1 - T"),
        (
            [body(FIRE), body(WINE)],
            None,
            -1,
            "Beer-Lambert: what is behind, through exp(-optical depth), and what the i",
        ),
        ([sheet()], None, 0, "every face of 1 mesh is a sheet: their paths add up, t / max(0.001, n.v) each"),
        ([sheet(), sheet()], None, 0, "every face of 2 meshes is a sheet: their paths add up"),
        ([body(), sheet()], None, 1, "1 mesh declared thin: paths through faces add up, t / max(0.001, n.v) each"),
        (
            [body(), body(None)],
            None,
            0,
            "1 opaque object: depth and color of the nearest, where rays through the media",
        ),
        ([body(), body(None), body(None)], None, 0, "2 opaque objects: depth and color of the nearest"),
        ([body()], tl.BackFaceDepth(), 0, "asked for: nearest front face, then farthest back face"),
        ([body(mesh=OPEN), body()], None, 2, "closed bodies, in those pixels, too"),
        ([body(FIRE), body(WINE)], None, 0, "emission among several media: what is in front dims what is behind; one "),
        ([body()], tl.FragmentLists(), 0, "asked for; one draw into a list for each pixel, sorted afterwards"),
        ([body()], tl.KBuffer(5), 0, "asked for; one draw, of which each pixel keeps the 5 nearest surfaces"),
        ([body()], tl.DepthPeeling(), 0, "asked for; two layers with each draw, until all are found"),
        ([body()], tl.DepthPeeling(8), 0, "asked for; two layers with each draw"),
        ([body()], tl.DepthPeeling(order="front-to-back"), 0, "asked for; a layer with each draw, until all are found"),
        ([body()], tl.DepthPeeling(order="back-to-front"), 0, "asked for; a layer with each draw"),
    ],
)
def test_a_pass_says_why_the_scene_needs_it(objects: list[tl.Object], method: Any, step: int, reason: str) -> None:
    assert plan(scene(*objects), method).passes[step].reason.startswith(reason)


def test_a_last_pass_speaks_of_emission_only_where_there_is_some() -> None:
    assert "emi" not in plan(scene(body()), tl.FragmentLists()).passes[-1].reason


@pytest.mark.parametrize(
    ("objects", "cause"),
    [
        ([body(), body(mesh=TORUS, x=0.5)], "'box' and 'torus' may overlap, and a sum would count both; one draw into"),
        ([body(x=9), body(), body(mesh=TORUS, x=0.5)], "'box' and 'torus' may overlap, and a sum would count both"),
        ([body(x=9), body(mesh=TORUS)], "'torus' may overlap itself, and a sum would count it twice; one draw into a"),
    ],
)
@pytest.mark.parametrize("overlap", ["union", "priority"])
def test_an_ordered_pass_names_the_bodies_for_whose_sake_it_runs(
    objects: list[tl.Object], cause: str, overlap: Any
) -> None:
    found = plan(scene(*objects, overlap=overlap))
    assert found.passes[0].reason.startswith(f'overlap="{overlap}": {cause}')


# Which objects a pass draws


def test_every_pass_draws_its_own_kind_of_object() -> None:
    found = plan(scene(sheet(), body(), body(None), body(mesh=OPEN), body(WINE), body(None)))
    assert {step.name: step.objects for step in found.passes} == {
        "opaque": (2, 5),
        "signed_depth": (1, 3, 4),
        "thin_layer": (0,),
        "thin_layer_fallback": (3, 0),
        "signed_depth_fallback": (1, 4),
        "transmittance": (),
    }
    assert plan(scene(body(None), sheet(), body()), tl.ThinLayer()).passes[1].objects == (1, 2)
    assert plan(scene(body(None), body()), tl.BackFaceDepth()).passes[1].objects == (1,)


def test_the_order_of_three_media_does_not_hide_a_difference() -> None:
    assert plan(scene(body(GLASS), body(GLASS), body(WINE))).spectral
    assert plan(scene(body(GLASS), body(WINE), body(GLASS))).spectral
    # What scatters or absorbs alike dims alike.
    assert not plan(scene(body(GLASS), body(MILK, x=3), body(DIAMOND, x=6))).spectral
    assert not plan(scene(body(GLASS), body(None), body(GLASS))).spectral


# What nothing can render


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer(), *ORDERED])
def test_a_scene_of_opaque_objects_is_refused(method: Any) -> None:
    message = "rendering 'box', 'torus'; nothing there has a medium; give an object one: medium=tl.Medium(...)"
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        plan(scene(body(None), body(None, TORUS)), method)


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer()])
def test_sheets_of_several_media_that_emit_are_refused(method: Any) -> None:
    with pytest.raises(tl.InputError, match=r"^rendering 'box', 'torus'; emission among several media.*; give all sh"):
        plan(scene(sheet(FIRE), sheet(WINE, TORUS)), method)
    # Of one medium, what they emit adds up.
    assert plan(scene(sheet(FIRE), sheet(FIRE, TORUS))).exact


@pytest.mark.parametrize(
    ("objects", "options", "method", "message"),
    [
        (
            [body(FIRE), body(WINE)],
            {},
            tl.SignedDepth(),
            "SignedDepth; emission among several media: what is in front dims what is behind; use FragmentLists, or "
            "leave the choice to the planner",
        ),
        ([body(FIRE), body(WINE)], {}, tl.ThinLayer(), "ThinLayer; emission among several media"),
        ([body(FIRE), body(EMBER)], {}, tl.BackFaceDepth(), "BackFaceDepth; emission among several media"),
        (
            [body(), body(mesh=TORUS, x=0.5)],
            {"overlap": "union"},
            tl.SignedDepth(),
            "SignedDepth; overlap=\"union\": 'box' and 'torus' may overlap, and a sum would count both; use Frag",
        ),
        (
            [body(mesh=TORUS)],
            {"overlap": "priority"},
            tl.SignedDepth(),
            "SignedDepth; overlap=\"priority\": 'torus' may",
        ),
        (
            [body(), body(WINE)],
            {},
            tl.BackFaceDepth(),
            "BackFaceDepth; bodies with different media; use SignedDepth, which tells them apart",
        ),
        (
            [body(), sheet(mesh=TORUS)],
            {},
            tl.BackFaceDepth(),
            "BackFaceDepth; 'torus' declared a sheet; use SignedDepth or ThinLayer",
        ),
        *(
            ([sheet()], {}, method, f"{type(method).__name__}; all bodies are declared sheets, which have no inside; u")
            for method in ORDERED
        ),
    ],
)
def test_a_method_that_cannot_render_the_scene_is_refused(
    objects: list[tl.Object], options: dict[str, Any], method: Any, message: str
) -> None:
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}"):
        plan(scene(*objects, **options), method)


@pytest.mark.parametrize("overlap", ["union", "priority"])
def test_methods_that_count_no_place_twice_know_no_overlap_policy(overlap: Any) -> None:
    # Sheets have no inside; and back-face depth marks pixels that enter twice.
    found = plan(scene(body(), body(mesh=TORUS, x=0.5), overlap=overlap), tl.BackFaceDepth())
    assert any("cross more than one are marked invalid" in limit for limit in found.limits)
    assert names(plan(scene(body(), body(x=0.5), overlap=overlap), tl.ThinLayer())) == ["thin_layer", "transmittance"]


# A picture drawn elsewhere, in place of opaque objects


@pytest.mark.parametrize(
    ("objects", "method"), [([body()], None), ([body(FIRE), body(WINE)], None), ([body()], tl.KBuffer())]
)
def test_a_backdrop_is_a_pass_before_all_others(objects: list[tl.Object], method: Any) -> None:
    found, alone = plan_over_backdrop(scene(*objects), method), plan(scene(*objects), method)
    assert found.passes[0].name == "backdrop"
    assert "drawn elsewhere" in found.passes[0].reason
    assert (found.passes[1:], found.method, found.limits) == (alone.passes, alone.method, alone.limits)
    assert found.cost > alone.cost
    assert found.geometry_passes == alone.geometry_passes


def test_a_backdrop_takes_the_place_of_opaque_objects() -> None:
    with pytest.raises(tl.InputError, match=r"^a backdrop; the scene has opaque objects of its own: 'torus'"):
        plan_over_backdrop(scene(body(), body(None, TORUS)))


def test_a_backdrop_keeps_to_what_the_machine_can_do() -> None:
    found = plan_over_backdrop(scene(body(FIRE), body(WINE)), None, NO_STORAGE)
    assert names(found) == ["backdrop", "depth_peeling", "transmittance"]


# Text, JSON, and no OpenGL


@pytest.mark.parametrize(
    ("objects", "method"),
    [([body()], None), ([body(MILK), sheet(), body(mesh=OPEN), body(None)], None), ([body(mesh=TORUS)], tl.KBuffer(2))],
)
def test_a_plan_goes_into_json(objects: list[tl.Object], method: Any) -> None:
    found = plan(scene(*objects), method)
    told = json.loads(json.dumps(found.summary()))
    assert sorted(told) == ["borders", "cost", "exact", "limits", "method", "passes", "unmodelled"]
    assert (told["method"], told["exact"], told["cost"]) == (str(found.method), found.exact, round(found.cost, 2))
    assert (told["limits"], told["unmodelled"]) == (list(found.limits), list(found.unmodelled))
    assert told["borders"] == found.borders
    for step, spec in zip(told["passes"], found.passes, strict=True):
        assert (step["name"], step["reason"]) == (spec.name, spec.reason)
        assert (step["geometry_passes"], step["cost"]) == (spec.geometry_passes, round(spec.cost, 2))


def test_a_plan_prints_a_line_for_each_thing_to_know() -> None:
    found = plan(scene(body(MILK), body(mesh=OPEN), body(None)))
    lines = str(found).splitlines()
    assert lines[0] == (
        f"SignedDepth(anchored=True): not exact everywhere, at about the cost of {found.cost:.1f} depth-only draws"
    )
    assert lines[1].startswith("  1. opaque: 1 opaque object")
    assert [line.split(":")[0].strip() for line in lines[1:]] == [
        *(f"{i}. {step.name}" for i, step in enumerate(found.passes, 1)),
        *["limit"] * len(found.limits),
        *["not modelled"] * len(found.unmodelled),
    ]
    assert lines[-1] == "  not modelled: shadows: light reaches opaque objects through everything"
    assert str(plan(scene(body()))).startswith("SignedDepth(anchored=True): exact, at about the cost of ")


def test_a_printed_line_is_ascii_and_without_a_break() -> None:
    found = plan(scene(body(FIRE), body(WINE), sheet(), body(mesh=OPEN), body(None)), tl.KBuffer(2))
    for text in (*found.limits, *found.unmodelled, *(step.reason for step in found.passes)):
        assert text.isascii()
        assert "\n" not in text


def test_importing_and_planning_loads_no_opengl() -> None:
    code = """
import sys
import translucent as tl
from translucent.render_plan import Capabilities
mesh = tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
assert tl.plan(tl.showcase(mesh)).exact
body, fire = tl.Object(mesh, tl.Medium(1.0)), tl.Object(mesh, tl.Medium(emission=1.0))
scene = tl.Scene([body, fire, tl.Object(mesh)], tl.Camera.look_at((0, 0, 9), (0, 0, 0)))
assert tl.plan(scene).ordered
assert tl.plan(scene, None, Capabilities(shader_storage=False)).ordered
found = {"moderngl", "glcontext", "OpenGL", "translucent.gpu"} & set(sys.modules)
assert not found, found
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_every_cost_is_above_zero() -> None:
    assert min(COSTS.values()) > 0
