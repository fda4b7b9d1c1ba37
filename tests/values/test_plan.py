"""The planner, row by row: for each kind of scene the passes, their reasons, text and JSON. No GPU."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import (
    DIAMOND,
    EMBER,
    FIRE,
    GLASS,
    MILK,
    NO_STORAGE,
    OPEN,
    TORUS,
    WINE,
    body,
    names,
    plan_over_backdrop,
    scene,
    sheet,
)
from translucent.planning.assembly import COSTS
from translucent.planning.methods import METHODS
from translucent.planning.plan import plan, plan_scene
from translucent.planning.render_plan import Capabilities
from translucent.planning.rendered import occluder_scene, occluders
from translucent.planning.request import RenderRequest
from translucent.scene.camera import Window

ONCE = tl.SingleScattering()

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


# Reasons


@pytest.mark.parametrize(
    ("objects", "method", "step", "reason"),
    [
        (
            [body()],
            None,
            0,
            "1 body in one unsorted draw each: distances of exits minus distances of entries add up to thi",
        ),
        (
            [body(), body(WINE)],
            None,
            0,
            "2 bodies in one unsorted draw each: distances of exits minus",
        ),
        ([body()], None, -1, "Beer-Lambert: light from behind, times exp(-optical depth)"),
        (
            [body(FIRE)],
            None,
            -1,
            "Beer-Lambert, plus the emission of the single medium in closed form, q / sigma_t (1 - T",
        ),
        (
            [body(FIRE), body(WINE)],
            None,
            -1,
            "Beer-Lambert: light from behind, times exp(-optical depth), plus the",
        ),
        (
            [sheet()],
            None,
            0,
            "every face of 1 mesh is a sheet: sum of their paths, t / max(0.001, n.v) each",
        ),
        ([sheet(), sheet()], None, 0, "every face of 2 meshes is a sheet: sum of their paths"),
        (
            [body(), sheet()],
            None,
            1,
            "1 mesh, thin-walled: sum of paths through all faces, t / max(0.001, n.v) each",
        ),
        (
            [body(), body(None)],
            None,
            0,
            "1 opaque object: depth and color of the nearest surface, where rays through",
        ),
        ([body(), body(None), body(None)], None, 0, "2 opaque objects: depth and color of the nearest"),
        ([body()], tl.BackFaceDepth(), 0, "requested: nearest front face, then farthest back face"),
        (
            [body(mesh=OPEN), body()],
            None,
            2,
            "pixels that open meshes cover also need the thickness of the closed bodies",
        ),
        ([body(FIRE), body(WINE)], None, 0, "emission among several media: a medium dims the emission behind it; one "),
        ([body()], tl.FragmentLists(), 0, "requested; one draw fills a list for each pixel, which is then sorted"),
        ([body()], tl.KBuffer(5), 0, "requested; one draw; each pixel keeps the 5 nearest surfaces"),
        ([body()], tl.DepthPeeling(), 0, "requested; each draw finds two layers, until none is left"),
        ([body()], tl.DepthPeeling(8), 0, "requested; each draw finds two layers"),
        (
            [body()],
            tl.DepthPeeling(order="front-to-back"),
            0,
            "requested; each draw finds one layer, until none is left",
        ),
        ([body()], tl.DepthPeeling(order="back-to-front"), 0, "requested; each draw finds one layer"),
    ],
)
def test_a_pass_says_why_the_scene_needs_it(objects: list[tl.Object], method: Any, step: int, reason: str) -> None:
    assert plan(scene(*objects), method).passes[step].reason.startswith(reason)


def test_a_last_pass_speaks_of_emission_only_where_there_is_some() -> None:
    assert "emi" not in plan(scene(body()), tl.FragmentLists()).passes[-1].reason


@pytest.mark.parametrize(
    ("objects", "cause"),
    [
        (
            [body(), body(mesh=TORUS, x=0.5)],
            "'box' and 'torus' may overlap, and a sum would count both; one draw fills",
        ),
        ([body(x=9), body(), body(mesh=TORUS, x=0.5)], "'box' and 'torus' may overlap, and a sum would count both"),
        ([body(x=9), body(mesh=TORUS)], "'torus' may overlap itself, and a sum would count it twice; one draw fills a"),
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
    assert not plan(scene(body(GLASS), body(MILK, x=3), body(DIAMOND, x=6)), scattering=ONCE).spectral
    assert not plan(scene(body(GLASS), body(None), body(GLASS))).spectral


# A backdrop in place of opaque objects


@pytest.mark.parametrize(
    ("objects", "method"), [([body()], None), ([body(FIRE), body(WINE)], None), ([body()], tl.KBuffer())]
)
def test_a_backdrop_is_a_pass_before_all_others(objects: list[tl.Object], method: Any) -> None:
    found, alone = plan_over_backdrop(scene(*objects), method), plan(scene(*objects), method)
    assert found.passes[0].name == "backdrop"
    assert "replaces opaque objects" in found.passes[0].reason
    assert (found.passes[1:], found.method, found.limits) == (alone.passes, alone.method, alone.limits)
    assert found.cost > alone.cost
    assert found.geometry_passes == alone.geometry_passes


def test_a_backdrop_takes_the_place_of_opaque_objects() -> None:
    with pytest.raises(tl.InputError, match=r"^a backdrop; the scene itself has opaque objects: 'torus'"):
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
    keys = [
        "caustics",
        "cost",
        "exact",
        "given_back",
        "hits",
        "interfaces",
        "limits",
        "method",
        "passes",
        "remarks",
        "unmodelled",
    ]
    assert sorted(told) == keys
    assert (told["method"], told["exact"], told["cost"]) == (str(found.method), found.exact, round(found.cost, 2))
    assert (told["limits"], told["unmodelled"]) == (list(found.limits), list(found.unmodelled))
    assert told["interfaces"] == (found.interfaces and str(found.interfaces))
    for step, spec in zip(told["passes"], found.passes, strict=True):
        assert (step["name"], step["reason"]) == (spec.name, spec.reason)
        assert (step["geometry_passes"], step["cost"]) == (spec.geometry_passes, round(spec.cost, 2))


def test_a_plan_prints_a_line_for_each_thing_to_know() -> None:
    found = plan(scene(body(MILK), body(mesh=OPEN), body(None)), scattering=ONCE)
    lines = str(found).splitlines()
    assert lines[0] == (
        f"SignedDepth(anchored=True): not exact everywhere, at about the cost of {found.cost:.1f} depth-only draws"
    )
    assert lines[1].startswith("  1. opaque: 1 opaque object")
    assert [line.split(":")[0].strip() for line in lines[1:]] == [
        *(f"{i}. {step.name}" for i, step in enumerate(found.passes, 1)),
        *["limit"] * len(found.limits),
        *["approximation"] * len(found.unmodelled),
    ]
    text = "the environment casts no shadows on opaque objects, so a ground is up to twice as bright beside"
    assert lines[-1].startswith(f"  approximation: {text}")
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
from translucent.planning.render_plan import Capabilities
mesh = tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
assert tl.plan(tl.showcase(mesh, stage="none")).exact
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
    assert all(method.cost > 0 for method in METHODS.values())


@pytest.mark.parametrize("medium", [GLASS, MILK, tl.Medium(scattering=5.0, ior=1.4)], ids=["glass", "fog", "wax"])
def test_a_plan_does_not_keep_the_scene_that_it_is_for(medium: tl.Medium) -> None:
    """Renderers keep plans for as long as scenes live."""
    given = scene(body(medium), body(None, TORUS, x=3), lights=[tl.DirectionalLight((0, -1, 0), 1.0)])
    found, alive = plan(given), weakref.ref(given)
    del given
    gc.collect()
    assert alive() is None
    assert len(found.scene.objects) == 2


def test_maps_of_shadows_are_planned_for_those_objects_that_end_them() -> None:
    """As if each map had been planned by itself."""
    sun = tl.DirectionalLight((0, -1, 0), 1.0)
    given = scene(body(None, x=-3), body(GLASS, OPEN), body(None, x=3), body(WINE, x=6), lights=[sun])
    (maps,) = plan(given).maps
    for opaque in ({0, 2}, {0}, {2}, set[int]()):
        found = maps.of(given, opaque)
        alone = plan(occluder_scene(given, occluders(given, opaque)))
        assert [(step.name, step.objects) for step in found.passes] == [
            (step.name, step.objects) for step in alone.passes
        ]
        assert (found.method, found.spectral) == (alone.method, alone.spectral)
        assert [item.mesh for item in found.scene.objects] == [item.mesh for item in alone.scene.objects]
        assert not any(item.has_interface for item in found.scene.objects)
    bent = scene(body(tl.Medium(ior=1.5)), body(None, TORUS, x=3), lights=[sun])
    assert len(plan(bent).maps) == 1
    assert len(plan(bent, caustics=tl.Caustics(10)).maps) == 2  # bodies are dark to lights, and clear to the sky
    assert plan(scene(body())).maps == ()


def test_shadows_of_many_open_surfaces_are_sums_in_narrower_maps() -> None:
    """Sorted lists serve to find invalid pixels, which shadow maps do not have."""
    sun, sizes = tl.DirectionalLight((0, -1, 0), 1.0), (1.0, 0.99, 0.98, 0.97, 0.96)
    vertices = [vertex * size for size in sizes for vertex in OPEN.vertices]
    faces = [face + 8 * i for i in range(len(sizes)) for face in OPEN.faces]
    mesh = tl.Mesh(vertices, faces, name="many walls")
    found = plan(scene(body(mesh=mesh), body(None, x=3), lights=[sun]))
    assert isinstance(found.method, tl.FragmentLists)
    drawn = [step.name for step in found.maps[0].passes if step.geometry_passes]
    assert drawn == ["opaque", "signed_depth", "thin_layer_fallback"]
    assert found.shadows.size == tl.ShadowMaps().size // 2  # 5 cubes: 8.8 surfaces, as each lacks a face of 12
    (note,) = (note for note in found.unmodelled if "texels wide" in note)
    assert "cross 9 surfaces on average" in note
    asked = plan(scene(body(mesh=mesh), body(None, x=3), lights=[sun]), shadows=tl.ShadowMaps(512))
    assert asked.shadows.size == 512
    assert note not in asked.unmodelled


def test_shadow_maps_are_as_fine_as_the_picture_can_show() -> None:
    """Two texels a pixel: here the picture is twice as high as what throws shadows, whatever the ground."""
    floor = tl.Mesh([(-99, -9, -99), (99, -9, -99), (99, -9, 99), (-99, -9, 99)], [(0, 2, 1), (0, 3, 2)])
    low, high = body().bounds
    camera = tl.Camera.orthographic((0, 0, 9), (0, 0, 0), height=2.0 * float(np.linalg.norm(high - low)))
    objects, sun = [body(), tl.Object(floor, shadow_catcher=True)], tl.DirectionalLight((0, -1, 0), 1.0)
    seen = replace(scene(*objects, lights=[sun]), camera=camera)
    sizes = [plan_scene(seen, RenderRequest(pixels=side * side)).shadows.size for side in (0, 64, 400, 800)]
    assert sizes == [1024, 256, 512, 1024]
    part = replace(seen, camera=replace(camera, window=Window(0, 0, (800, 800))))
    assert plan_scene(part, RenderRequest(pixels=64 * 64)).shadows.size == 1024
    # What is in a backdrop may be nearer to the eye than all bodies.
    assert plan_over_backdrop(replace(seen, objects=[body()]), pixels=64 * 64).shadows == tl.ShadowMaps()


def test_shadows_on_a_backdrop_are_as_requested() -> None:
    lit = scene(body(), lights=[tl.DirectionalLight((0, -1, 0), 1.0)])
    assert plan_over_backdrop(lit, shadows=tl.ShadowMaps(256)).shadows == tl.ShadowMaps(256)
    assert plan_over_backdrop(lit).shadows == tl.ShadowMaps()
