"""Which method the planner picks, what each method makes of every kind of scene, its cost, and how far it reaches."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.plan import COSTS, plan
from translucent.render_plan import Capabilities, PassSpec, RenderPlan
from translucent.slots import medium_slots
from translucent.thickness import MAX_K, MAX_LAYERS, METHODS, method_from_name

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces, name="box")
OPEN = tl.Mesh(_BOX.vertices, _BOX.faces[1:], name="open box")
_TORUS = trimesh.creation.torus(1.0, 0.25, major_sections=12, minor_sections=8)
TORUS = tl.Mesh(_TORUS.vertices, _TORUS.faces, name="torus")
FACES = len(_TORUS.faces)
CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))

GLASS, WINE, FIRE = tl.Medium(absorption=1.0), tl.Medium(absorption=(1, 2, 3)), tl.Medium(1.0, emission=(3, 1, 0))
NO_STORAGE = Capabilities(shader_storage=False)


def body(medium: tl.Medium | None = GLASS, mesh: tl.Mesh = BOX, x: float = 0.0, **options: Any) -> tl.Object:
    return tl.Object(mesh, medium, trimesh.transformations.translation_matrix((x, 0, 0)), **options)


def sheet(medium: tl.Medium = GLASS, mesh: tl.Mesh = BOX) -> tl.Object:
    return body(medium, mesh, sheet_thickness=1e-3)


def scene(*objects: tl.Object, **options: Any) -> tl.Scene:
    return tl.Scene(objects, CAMERA, **options)


def names(found: RenderPlan) -> list[str]:
    return [step.name for step in found.passes]


# Every method in every kind of scene

SCENES = {
    "convex": scene(body()),
    "concave": scene(body(mesh=TORUS)),
    "sheets": scene(sheet(), sheet(WINE)),
    "body and sheet": scene(body(), sheet()),
    "open": scene(body(mesh=OPEN)),
    "open and closed": scene(body(mesh=OPEN), body()),
    "opaque": scene(body(), body(None)),
    "media": scene(body(), body(WINE)),
    "emission": scene(body(FIRE)),
    "emission among media": scene(body(FIRE), body(WINE)),
    "emission and sheet": scene(body(FIRE), sheet(WINE)),
    "union": scene(body(), body(x=0.5), overlap="union"),
    "union, media": scene(body(), body(WINE), overlap="union"),
    "union, emission": scene(body(FIRE), body(FIRE, x=0.5), overlap="union"),
    "union, apart": scene(body(), body(WINE, x=3), overlap="union"),
    "priority": scene(body(), body(WINE, priority=1), overlap="priority"),
    "priority, apart": scene(body(), body(WINE, x=3), overlap="priority"),
    "everything": scene(body(FIRE), sheet(), body(WINE, OPEN), body(None), overlap="union"),
}

#: The last column of the table is for methods that find ordered intervals.
COLUMNS = (None, tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer())

#: Passes before the last; * is the ordered pass, ! a refusal with these words.
FALLBACKS = "thin_layer_fallback signed_depth_fallback"
DIFFER, ORDER, SHEET = "! different media", "! leave the choice to the planner", "! declared a sheet"
PASSES = {
    "convex": ("signed_depth", "signed_depth", "back_face_depth", "thin_layer", "*"),
    "concave": ("signed_depth", "signed_depth", "back_face_depth", "thin_layer", "*"),
    "sheets": ("thin_layer", "thin_layer", DIFFER, "thin_layer", "! use ThinLayer"),
    "body and sheet": ("signed_depth thin_layer", "signed_depth thin_layer", SHEET, "thin_layer", "thin_layer *"),
    "open": (
        "signed_depth thin_layer_fallback",
        "signed_depth thin_layer_fallback",
        "back_face_depth thin_layer_fallback",
        "thin_layer",
        "thin_layer_fallback *",
    ),
    "open and closed": (
        f"signed_depth {FALLBACKS}",
        f"signed_depth {FALLBACKS}",
        f"back_face_depth {FALLBACKS}",
        "thin_layer",
        f"{FALLBACKS} *",
    ),
    "opaque": (
        "opaque signed_depth",
        "opaque signed_depth",
        "opaque back_face_depth",
        "opaque thin_layer",
        "opaque *",
    ),
    "media": ("signed_depth", "signed_depth", DIFFER, "thin_layer", "*"),
    "emission": ("signed_depth", "signed_depth", "back_face_depth", "thin_layer", "*"),
    "emission among media": ("fragment_lists", ORDER, ORDER, ORDER, "*"),
    "emission and sheet": ("thin_layer fragment_lists", ORDER, ORDER, ORDER, "thin_layer *"),
    "union": ("fragment_lists", ORDER, "back_face_depth", "thin_layer", "*"),
    "union, media": ("fragment_lists", ORDER, DIFFER, "thin_layer", "*"),
    "union, emission": ("fragment_lists", ORDER, "back_face_depth", "thin_layer", "*"),
    "union, apart": ("signed_depth", "signed_depth", DIFFER, "thin_layer", "*"),
    "priority": ("fragment_lists", ORDER, DIFFER, "thin_layer", "*"),
    "priority, apart": ("signed_depth", "signed_depth", DIFFER, "thin_layer", "*"),
    "everything": (
        f"opaque thin_layer {FALLBACKS} fragment_lists",
        ORDER,
        ORDER,
        ORDER,
        f"opaque thin_layer {FALLBACKS} *",
    ),
}


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("column", range(4))
def test_what_a_method_makes_of_a_scene(kind: str, column: int) -> None:
    expected = PASSES[kind][column]
    if expected.startswith("! "):
        with pytest.raises(tl.InputError, match=re.escape(expected[2:])):
            plan(SCENES[kind], COLUMNS[column])
        return
    found = plan(SCENES[kind], COLUMNS[column])
    assert names(found) == [*expected.split(), "transmittance"]
    assert COLUMNS[column] in (None, found.method)


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize(
    ("method", "name"),
    [
        (tl.DepthPeeling(), "depth_peeling"),
        (tl.DepthPeeling(9, "back-to-front"), "depth_peeling"),
        (tl.FragmentLists(), "fragment_lists"),
        (tl.KBuffer(12), "k_buffer"),
    ],
)
def test_what_an_ordered_method_makes_of_a_scene(kind: str, method: Any, name: str) -> None:
    expected = PASSES[kind][-1]
    if expected.startswith("! "):
        with pytest.raises(tl.InputError, match=re.escape(expected[2:])):
            plan(SCENES[kind], method)
        return
    found = plan(SCENES[kind], method)
    assert names(found) == [*expected.replace("*", name).split(), "transmittance"]
    assert found.method == method
    assert found.ordered
    solids = [i for i, item in enumerate(SCENES[kind].objects) if item.medium and item.sheet_thickness is None]
    assert found.passes[-2].objects == tuple(solids)


@pytest.mark.parametrize(("medium", "other"), [(FIRE, GLASS), (GLASS, FIRE), (FIRE, FIRE)])
def test_sheets_among_intervals_that_emit_are_a_limit(medium: tl.Medium, other: tl.Medium) -> None:
    found = plan(scene(body(medium), sheet(other)), tl.FragmentLists())
    assert found.limits == (
        "declared sheets among emitting media have no place in the order: they dim all light, and what they emit is "
        "left out",
    )
    # Without emission the order of sheets matters to nothing, and without sheets there is none.
    assert plan(scene(body(GLASS), sheet(WINE)), tl.FragmentLists()).exact
    assert plan(scene(body(medium), body(other)), tl.FragmentLists()).exact


# What the machine can do


@pytest.mark.parametrize("kind", SCENES)
def test_without_shader_storage_bodies_are_peeled(kind: str) -> None:
    here, there = plan(SCENES[kind]), plan(SCENES[kind], None, NO_STORAGE)
    assert names(there) == [name.replace("fragment_lists", "depth_peeling") for name in names(here)]
    if here.ordered:
        assert there.method == tl.DepthPeeling()
        assert there.passes[-2].reason.split(";")[0] == here.passes[-2].reason.split(";")[0]
    else:
        assert there == here


@pytest.mark.parametrize("method", [tl.FragmentLists(), tl.KBuffer()])
def test_methods_that_need_shader_storage_are_refused_without(method: Any) -> None:
    message = (
        f"{type(method).__name__}; this OpenGL has no shader storage buffers, which came with 4.3; use DepthPeeling"
    )
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        plan(scene(body()), method, NO_STORAGE)
    assert plan(scene(body()), method, Capabilities()).method == method
    assert plan(scene(body()), tl.DepthPeeling(), NO_STORAGE).exact


def test_a_refusal_tells_of_a_method_that_works_here() -> None:
    for capabilities, method in ((Capabilities(), "FragmentLists"), (NO_STORAGE, "DepthPeeling")):
        with pytest.raises(tl.InputError, match=f"; use {method}, or leave the choice to the planner$"):
            plan(SCENES["union"], tl.SignedDepth(), capabilities)


# Costs


@pytest.mark.parametrize(
    ("kind", "method", "steps"),
    [
        ("convex", None, ["signed_depth"]),
        ("media", None, ["signed_depth_spectral"]),
        ("sheets", None, ["thin_layer"]),
        ("opaque", None, ["opaque", "signed_depth"]),
        ("convex", tl.BackFaceDepth(), ["back_face_depth"]),
        ("open and closed", None, ["signed_depth", "thin_layer", "signed_depth"]),
        ("open and closed", tl.FragmentLists(), ["thin_layer", "signed_depth_spectral", "fragment_lists"]),
        ("convex", tl.KBuffer(), ["k_buffer"]),
        ("union", None, ["fragment_lists"]),
        ("everything", None, ["opaque", "thin_layer", "thin_layer", "signed_depth_spectral", "fragment_lists"]),
    ],
)
def test_a_plan_costs_what_its_passes_cost(kind: str, method: Any, steps: list[str]) -> None:
    found = plan(SCENES[kind], method)
    assert [step.cost for step in found.passes] == [COSTS[name] for name in (*steps, "resolve")]
    assert found.cost == pytest.approx(sum(COSTS[name] for name in (*steps, "resolve")), rel=1e-12)


def test_spectral_fallbacks_cost_more() -> None:
    one, two = (plan(scene(body(mesh=OPEN), body(), body(medium))) for medium in (GLASS, WINE))
    assert one.passes[2].name == two.passes[2].name == "signed_depth_fallback"
    assert (one.passes[2].cost, two.passes[2].cost) == (COSTS["signed_depth"], COSTS["signed_depth_spectral"])


@pytest.mark.parametrize(
    ("objects", "method", "draws"),
    [
        ([body()], tl.DepthPeeling(), 1),
        ([body()], tl.DepthPeeling(order="front-to-back"), 2),
        ([body()], tl.DepthPeeling(order="back-to-front"), 2),
        ([body(), body(), body()], tl.DepthPeeling(), 3),
        ([body(), body(), body()], tl.DepthPeeling(order="front-to-back"), 6),
        # Never more than the layers that were asked for, and then one draw that counts.
        ([body(), body(), body()], tl.DepthPeeling(4, "front-to-back"), 4 + 1),
        ([body(), body(), body()], tl.DepthPeeling(4), 2 + 1),
        ([body(), body(), body()], tl.DepthPeeling(3), 2 + 1),
        ([body(), body(), body()], tl.DepthPeeling(1), 1 + 1),
        # Neither sheets nor opaque objects are peeled.
        ([body(), sheet(), body(None)], tl.DepthPeeling(order="front-to-back"), 2),
    ],
)
def test_peeling_draws_once_for_every_layer_or_two(
    objects: list[tl.Object], method: tl.DepthPeeling, draws: int
) -> None:
    step = next(step for step in plan(scene(*objects), method).passes if step.name == "depth_peeling")
    assert (step.geometry_passes, step.cost) == (draws, draws * COSTS["depth_peeling"])


def test_a_concave_body_is_expected_to_have_more_layers() -> None:
    def draws(mesh: tl.Mesh) -> int:
        return plan(scene(body(mesh=mesh)), tl.DepthPeeling()).geometry_passes

    assert draws(TORUS) > draws(BOX)
    assert draws(OPEN) > draws(BOX)


@pytest.mark.parametrize(("objects", "draws"), [([body(FIRE), body(WINE)], 2), ([body(FIRE), body(WINE), body()], 3)])
def test_the_cheaper_of_the_ordered_methods_is_chosen(
    objects: list[tl.Object], draws: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for cost, name in ((draws - 0.01, "fragment_lists"), (draws + 0.01, "depth_peeling")):
        monkeypatch.setitem(COSTS, "fragment_lists", cost * COSTS["depth_peeling"])
        assert names(plan(scene(*objects))) == [name, "transmittance"]


def test_a_method_that_leaves_surfaces_out_is_never_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(COSTS, "k_buffer", 0.01)
    for given_scene in SCENES.values():
        assert not isinstance(plan(given_scene).method, tl.KBuffer)


def test_methods_by_their_costs_where_all_are_exact() -> None:
    costs = [plan(SCENES["convex"], method).cost for method in (tl.SignedDepth(), tl.BackFaceDepth())]
    costs += [plan(SCENES["convex"], method).cost for method in (tl.FragmentLists(), tl.DepthPeeling())]
    assert costs == sorted(costs)
    assert plan(SCENES["convex"]).cost == costs[0]


ITEMS = {
    "body": body(),
    "apart": body(x=3),
    "wine": body(WINE, x=0.5),
    "fire": body(FIRE),
    "torus": body(mesh=TORUS),
    "open": body(mesh=OPEN),
    "sheet": sheet(),
    "emitting sheet": sheet(FIRE),
    "rock": body(None, x=1),
}


def planned(kinds: list[str], overlap: Any, method: Any = None, capabilities: Any = None) -> RenderPlan | None:
    """The plan; None where the planner refuses the scene."""
    try:
        return plan(scene(*(ITEMS[kind] for kind in kinds), overlap=overlap), method, capabilities)
    except tl.InputError:
        return None


any_scene = st.lists(st.sampled_from(sorted(ITEMS)), min_size=1, max_size=5)
any_overlap = st.sampled_from(["add", "union"])
any_method = st.sampled_from([*COLUMNS, tl.DepthPeeling(), tl.FragmentLists(), tl.KBuffer()])
any_machine = st.sampled_from([None, NO_STORAGE])


@given(any_scene, st.sampled_from(sorted(ITEMS)), any_overlap, any_method, any_machine)
def test_nothing_that_is_added_makes_a_plan_cheaper(
    kinds: list[str], more: str, overlap: Any, method: Any, machine: Any
) -> None:
    before, after = planned(kinds, overlap, method, machine), planned([*kinds, more], overlap, method, machine)
    if before is not None and after is not None:
        assert after.cost >= before.cost - 1e-9
        assert after.geometry_passes >= before.geometry_passes
        assert len(after.limits) >= len(before.limits)


@pytest.mark.parametrize(
    ("kinds", "more"),
    [
        (["body"], "wine"),
        (["body"], "sheet"),
        (["body"], "rock"),
        (["body"], "open"),
        (["body"], "fire"),
        (["body", "open"], "wine"),
        (["fire"], "wine"),
        (["sheet"], "body"),
    ],
)
def test_what_needs_more_work_costs_more(kinds: list[str], more: str) -> None:
    before, after = planned(kinds, "add"), planned([*kinds, more], "add")
    assert before is not None
    assert after is not None
    assert after.cost > before.cost


@given(any_scene, any_overlap, any_method, any_machine)
def test_every_plan_draws_everything_and_says_why(kinds: list[str], overlap: Any, method: Any, machine: Any) -> None:
    found = planned(kinds, overlap, method, machine)
    if found is None:
        return
    drawn = [i for step in found.passes if step.target == "accumulated" for i in step.objects]
    assert sorted(drawn) == list(range(len(kinds)))
    assert found.cost == pytest.approx(sum(step.cost for step in found.passes), rel=1e-12)
    assert found.geometry_passes == sum(step.geometry_passes for step in found.passes)
    assert len(set(names(found))) == len(found.passes)
    for step in found.passes:
        assert step.reason
        assert step.cost > 0
        assert bool(step.objects) == (step.geometry_passes > 0) == (step.name != "transmittance")
    json.dumps(found.summary())
    # What the planner picks is no dearer than any other method that is exact here.
    picked = planned(kinds, overlap, None, machine)
    if found.exact and picked is not None and picked.exact:
        assert picked.cost <= found.cost + 1e-9


def test_the_cost_of_a_plan_is_the_sum_of_its_passes() -> None:
    passes = (PassSpec("a", "first", (0,), 2, cost=1.25), PassSpec("b", "second", (0, 1), 3, cost=2.5))
    found = RenderPlan(tl.SignedDepth(), passes)
    assert (found.cost, found.geometry_passes) == (3.75, 5)
    assert found.exact
    assert not RenderPlan(tl.SignedDepth(), passes, limits=("a hole",)).exact
    assert RenderPlan(tl.SignedDepth(), passes, unmodelled=("shadows",)).exact


# How far methods reach that keep so many layers and no more


@pytest.mark.parametrize(
    ("objects", "layers"),
    [
        pytest.param([body()], 2, id="a convex body"),
        pytest.param([body(), body(WINE), body(x=3)], 6, id="three convex bodies"),
        pytest.param([body(mesh=TORUS)], FACES, id="a concave body: as many as faces"),
        pytest.param([body(mesh=TORUS), body()], FACES + 2, id="a concave and a convex body"),
        pytest.param([body(), sheet(mesh=TORUS)], 2, id="a sheet has none"),
        pytest.param([body(), body(None, TORUS)], 2, id="an opaque object has none"),
    ],
)
@pytest.mark.parametrize(
    "kind", [tl.KBuffer, tl.DepthPeeling, lambda most: tl.DepthPeeling(most, "front-to-back")], ids=["k", "dual", "one"]
)
def test_a_limit_of_layers_is_told_exactly_where_there_may_be_more(
    objects: list[tl.Object], layers: int, kind: Any
) -> None:
    assert plan(scene(*objects), kind(layers)).limits == ()
    assert plan(scene(*objects), kind(layers - 1)).limits == (
        f"pixels with more than {layers - 1} surfaces are marked invalid",
    )
    assert plan(scene(*objects), tl.FragmentLists()).limits == ()


def test_the_faces_of_an_open_body_count_too() -> None:
    # A box without a face is not known to be convex: 11 faces.
    assert len(plan(scene(body(mesh=OPEN)), tl.KBuffer(11)).limits) == 1
    assert (
        plan(scene(body(mesh=OPEN)), tl.KBuffer(10)).limits[1] == "pixels with more than 10 surfaces are marked invalid"
    )


def test_peeling_that_the_planner_picks_tells_its_limit() -> None:
    assert plan(scene(body(mesh=TORUS), overlap="union"), None, NO_STORAGE).limits == (
        "pixels with more than 64 surfaces are marked invalid",
    )
    assert plan(scene(body(), body(WINE), overlap="union"), None, NO_STORAGE).exact


# Methods by name, and their parameters


@pytest.mark.parametrize("name", sorted(METHODS))
def test_a_method_has_a_name(name: str) -> None:
    for written in (name, name.upper(), name.replace("-", "_")):
        assert method_from_name(written) == METHODS[name]()


def test_a_misspelt_method_is_guessed() -> None:
    for name in ("signed depth", "Fragment-List", "kbuffer"):
        with pytest.raises(tl.InputError, match=r"not a known method; did you mean (signed-depth|fragment|k-buffer)"):
            method_from_name(name)


@pytest.mark.parametrize("name", ["magic", ""])
def test_an_unknown_method_names_the_known_ones(name: str) -> None:
    known = "signed-depth, back-face-depth, thin-layer, depth-peeling, fragment-lists, k-buffer"
    with pytest.raises(tl.InputError, match=f"^method '{name}'; not a known method; use one of {known}"):
        method_from_name(name)


def test_methods_of_equal_parameters_are_equal_and_hash_alike() -> None:
    assert len({tl.DepthPeeling(), tl.DepthPeeling(64, "both-ends"), tl.KBuffer(8), tl.KBuffer()}) == 2
    assert tl.DepthPeeling(8) != tl.DepthPeeling()
    assert tl.DepthPeeling(order="front-to-back") != tl.DepthPeeling()


@pytest.mark.parametrize("thickness", [0, -1.0, np.nan, np.inf])
def test_a_sheet_has_a_positive_thickness(thickness: float) -> None:
    with pytest.raises(tl.InputError, match=re.escape(f"ThinLayer thickness {thickness}; not above 0")):
        tl.ThinLayer(thickness)


@pytest.mark.parametrize(
    ("method", "what", "most"),
    [(tl.DepthPeeling, "DepthPeeling max_layers", MAX_LAYERS), (tl.KBuffer, "KBuffer k", MAX_K)],
)
def test_layers_are_counted_in_whole_numbers(method: Any, what: str, most: int) -> None:
    assert method(1) != method(most)
    for wrong in (0, -1, most + 1, 2.0, np.nan, np.inf, "8", None, True, [8]):
        message = f"{what} {wrong!r}; not a whole number in 1 to {most}; give for example 8"
        with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
            method(wrong)


@pytest.mark.parametrize("order", ["sideways", "", "Both-Ends", None, 2, ["both-ends"]])
def test_an_unknown_order_of_peeling_names_the_known_ones(order: Any) -> None:
    message = f"DepthPeeling order {order!r}; not known; use one of both-ends, front-to-back, back-to-front"
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        tl.DepthPeeling(order=order)


# Without OpenGL, and what no pass does


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.KBuffer(k=2), tl.ThinLayer(0.01)], ids=str)
def test_without_opengl_rays_find_all_intervals_whatever_the_method(method: Any) -> None:
    found = plan(scene(body(FIRE), body(WINE, x=0.5), body(None), overlap="union"), method, Capabilities(opengl=False))
    assert names(found) == ["intersect", "shade"]
    assert found.passes[0].objects == (0, 1, 2)
    assert "no OpenGL" in found.passes[0].reason
    # Of all that the methods could leave out, only what ThinLayer means to is.
    assert found.exact == (not isinstance(method, tl.ThinLayer))


def test_without_opengl_slots_and_emitting_sheets_are_no_limit() -> None:
    media = [tl.Medium(absorption=i + 1.0, emission=1.0) for i in range(20)]
    assert plan(scene(*[body(medium) for medium in media]), None, Capabilities(opengl=False)).exact
    assert plan(scene(*[sheet(medium) for medium in media]), None, Capabilities(opengl=False)).exact


@pytest.mark.parametrize(
    ("scattering", "told"), [(True, "light scattered more than once"), (False, "in-scattered light")]
)
def test_without_opengl_light_may_be_followed_or_not(scattering: bool, told: str) -> None:
    lit = scene(body(tl.Medium(scattering=1.0)), lights=[tl.DirectionalLight((0, -1, 0), (1, 1, 1))])
    found = plan(lit, None, Capabilities(opengl=False, scattering=scattering))
    assert found.unmodelled[0].startswith(told)


def test_marching_goes_through_the_lists() -> None:
    found = plan(scene(body(FIRE), body(WINE, x=0.5)), tl.RayMarched(steps=32))
    assert names(found) == ["fragment_lists", "transmittance"]
    assert "32 steps through each interval" in found.passes[0].reason
    assert found.cost < plan(scene(body(FIRE), body(WINE, x=0.5)), tl.RayMarched(steps=64)).cost
    with pytest.raises(tl.InputError, match="shaders hold 16 Gauss-Legendre points; use fewer steps"):
        plan(scene(body()), tl.RayMarched(steps=17, quadrature="gauss"))
    with pytest.raises(tl.InputError, match="RayMarched; this OpenGL has no shader storage"):
        plan(scene(body()), tl.RayMarched(), NO_STORAGE)


def test_marching_is_not_exact_and_says_so() -> None:
    found = plan(scene(body(FIRE)), tl.RayMarched(steps=32, quadrature="left"))
    assert found.limits == (
        "what is emitted and scattered is a sum over 32 steps in each interval (left); what lies behind a "
        "transmittance of 1e-05 is left out of it",
    )


CLOUD = tl.Medium(scattering=1.0)
SUN = [tl.DirectionalLight((0, -1, 0), (1, 1, 1))]


@pytest.mark.parametrize(
    ("density", "steps"),
    [
        (tl.LinearDensity(0, 0, 1), 64),
        (tl.DensityGrid(np.ones((2, 2, 2))), 64),
        (tl.DensityGrid(np.ones((1, 200, 3))), 200),
    ],
)
def test_where_the_density_varies_rays_march(density: Any, steps: int) -> None:
    found = plan(scene(body(density=density)))
    assert found.method == tl.RayMarched(steps=steps)
    assert names(found) == ["fragment_lists", "transmittance"]
    assert "the density varies from place to place; one draw" in found.passes[0].reason
    assert found.limits[0].startswith(f"optical depth, and what is emitted and scattered, are a sum over {steps} steps")
    lit = plan(scene(body(CLOUD, density=density), body(x=3), lights=SUN))
    assert names(lit) == ["light_views", "fragment_lists", "transmittance"]
    assert "depths from the lights are exact" in lit.limits[0]


@pytest.mark.parametrize(
    "method",
    [tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer(), tl.FragmentLists(), tl.DepthPeeling(), tl.KBuffer()],
)
def test_no_other_method_goes_through_a_density(method: Any) -> None:
    cloud = scene(body(density=tl.LinearDensity(0, 0, 1)), body(x=3))
    with pytest.raises(tl.InputError, match=f"{type(method).__name__}; 'box': the density varies, .*; use RayMarched"):
        plan(cloud, method)


def test_a_density_without_shader_storage_or_without_opengl() -> None:
    cloud = scene(body(density=tl.DensityGrid(np.ones((2, 2, 2)))))
    with pytest.raises(tl.InputError, match="rendering 'box' with a density that varies; this OpenGL has no shader st"):
        plan(cloud, None, NO_STORAGE)
    assert plan(cloud, None, Capabilities(opengl=False)).exact


def test_bodies_of_varying_density_have_slots_of_their_own() -> None:
    density = tl.LinearDensity(0, 0, 1)
    found = medium_slots(scene(body(), body(density=density), body(), body(density=density)))
    assert [slot.objects for slot in found] == [(0, 2), (1,), (3,)]
    crowd = [body(density=density) for _ in range(17)]
    with pytest.raises(tl.InputError, match="17 winding numbers for each ray"):
        plan(scene(*crowd))
