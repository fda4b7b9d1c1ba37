"""Passes of each method for every kind of scene and machine, and how far it reaches."""

from __future__ import annotations

import re
from typing import Any

import pytest

import translucent as tl
from tests.values.plan_scenes import (
    COLUMNS,
    FIRE,
    GLASS,
    NO_STORAGE,
    OPEN,
    SCENES,
    TORUS,
    WINE,
    body,
    names,
    scene,
    sheet,
)
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities

FACES = len(TORUS.faces)


# Every method in every kind of scene


#: Passes before the last; * is the ordered pass, ! a refusal with these words. A column for each of `COLUMNS`, and one
#: for the methods that find ordered intervals.
FALLBACKS = "thin_layer_fallback signed_depth_fallback"
DIFFER, ORDER, SHEET = (
    "! different media",
    "! leave the choice to the planner",
    "! this method cannot render thin-walled sheets",
)
PASSES = {
    "convex": ("signed_depth", "signed_depth", "back_face_depth", "thin_layer", "*"),
    "concave": ("signed_depth", "signed_depth", "back_face_depth", "thin_layer", "*"),
    "sheets": ("thin_layer", "thin_layer", DIFFER, "thin_layer", "! use the method ThinLayer"),
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
        "sheets among media that emit light: a sheet dims all light on its ray, even light in front of it, and "
        "emits none",
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
        f"{type(method).__name__}; this OpenGL has no shader storage buffers, which need version 4.3; "
        "use the method DepthPeeling"
    )
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        plan(scene(body()), method, NO_STORAGE)
    assert plan(scene(body()), method, Capabilities()).method == method
    assert plan(scene(body()), tl.DepthPeeling(), NO_STORAGE).exact


def test_a_refusal_tells_of_a_method_that_works_here() -> None:
    for capabilities, method in ((Capabilities(), "FragmentLists"), (NO_STORAGE, "DepthPeeling")):
        with pytest.raises(tl.InputError, match=f"; use {method}, or leave the choice to the planner$"):
            plan(SCENES["union"], tl.SignedDepth(), capabilities)


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
        f"pixels whose rays cross more than {layers - 1} surfaces are marked as invalid",
    )
    assert plan(scene(*objects), tl.FragmentLists()).limits == ()


def test_the_faces_of_an_open_body_count_too() -> None:
    # A box without a face is not known to be convex: 11 faces.
    assert len(plan(scene(body(mesh=OPEN)), tl.KBuffer(11)).limits) == 1
    assert (
        plan(scene(body(mesh=OPEN)), tl.KBuffer(10)).limits[1]
        == "pixels whose rays cross more than 10 surfaces are marked as invalid"
    )


def test_peeling_that_the_planner_picks_tells_its_limit() -> None:
    assert plan(scene(body(mesh=TORUS), overlap="union"), None, NO_STORAGE).limits == (
        "pixels whose rays cross more than 64 surfaces are marked as invalid",
    )
    assert plan(scene(body(), body(WINE), overlap="union"), None, NO_STORAGE).exact


# Without OpenGL, and what no pass does


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.KBuffer(k=2), tl.ThinLayer(0.01)], ids=str)
def test_without_opengl_rays_find_all_intervals_whatever_the_method(method: Any) -> None:
    found = plan(scene(body(FIRE), body(WINE, x=0.5), body(None), overlap="union"), method, Capabilities(opengl=False))
    assert names(found) == ["intersect", "shade"]
    assert found.passes[0].objects == (0, 1, 2)
    assert "no OpenGL" in found.passes[0].reason
    # Of all that the methods could leave out, only what ThinLayer means to is.
    assert found.exact == (not isinstance(method, tl.ThinLayer))


@pytest.mark.parametrize(
    ("method", "runs", "reason"),
    [
        (None, "all surfaces on each ray, in float64", "no OpenGL: all surfaces on each ray, in float64"),
        (
            tl.KBuffer(k=2),
            "all surfaces on each ray, in float64",
            "in place of the requested KBuffer(k=2, light_points=8)",
        ),
        (tl.ThinLayer(0.01), "all surfaces on each ray, in float64, as sheets of 0.01 m", "no OpenGL"),
    ],
    ids=str,
)
def test_without_opengl_a_plan_says_what_runs_and_not_what_was_asked_for(method: Any, runs: str, reason: str) -> None:
    found = plan(scene(body()), method, Capabilities(opengl=False))
    assert found.runs == found.summary()["method"] == runs
    assert str(found).startswith(f"{runs}: ")
    assert reason in found.passes[0].reason
    drawn = plan(scene(body()), method or tl.SignedDepth())
    assert drawn.runs == str(drawn.method)


def test_without_opengl_slots_and_emitting_sheets_are_no_limit() -> None:
    media = [tl.Medium(absorption=i + 1.0, emission=1.0) for i in range(20)]
    assert plan(scene(*[body(medium) for medium in media]), None, Capabilities(opengl=False)).exact
    assert plan(scene(*[sheet(medium) for medium in media]), None, Capabilities(opengl=False)).exact


@pytest.mark.parametrize(
    ("scattering", "told"),
    [(True, "light that is scattered more than once"), (False, "this method leaves out the light")],
)
def test_without_opengl_light_may_be_followed_or_not(scattering: bool, told: str) -> None:
    lit = scene(body(tl.Medium(scattering=1.0)), lights=[tl.DirectionalLight((0, -1, 0), (1, 1, 1))])
    found = plan(lit, None, Capabilities(opengl=False, scattering=scattering), scattering=tl.SingleScattering())
    assert found.unmodelled[0].startswith(told)
