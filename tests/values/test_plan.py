"""The planner: for each scene the passes, their reasons, and what it refuses. No GPU."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.plan import RenderPlan, plan
from translucent.thickness import METHODS, method_from_name

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces, name="box")
OPEN = tl.Mesh(_BOX.vertices, _BOX.faces[1:], name="open box")
_TORUS = trimesh.creation.torus(1.0, 0.25, major_sections=12, minor_sections=8)
TORUS = tl.Mesh(_TORUS.vertices, _TORUS.faces, name="torus")
CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))

GLASS, WINE = tl.Medium(absorption=1.0), tl.Medium(absorption=(1, 2, 3))
FIRE, EMBER = tl.Medium(absorption=1.0, emission=(3, 1, 0)), tl.Medium(absorption=1.0, emission=(1, 1, 0))
MILK, DIAMOND = tl.Medium(scattering=1.0), tl.Medium(absorption=1.0, ior=2.4)


def body(medium: tl.Medium | None = GLASS, mesh: tl.Mesh = BOX, x: float = 0.0, **options: Any) -> tl.Object:
    return tl.Object(mesh, medium, trimesh.transformations.translation_matrix((x, 0, 0)), **options)


def scene(*objects: tl.Object, **options: Any) -> tl.Scene:
    return tl.Scene(objects, CAMERA, **options)


def names(found: RenderPlan) -> list[str]:
    return [step.name for step in found.passes]


@pytest.mark.parametrize(
    ("bodies", "method", "passes", "spectral", "geometry_passes"),
    [
        ([body()], None, ["signed_depth"], False, 1),
        ([body(), body(x=3)], None, ["signed_depth"], False, 1),
        ([body(), body(WINE)], None, ["signed_depth"], True, 1),
        ([body(FIRE)], None, ["signed_depth"], False, 1),
        ([body(FIRE), body(FIRE, x=0.5)], None, ["signed_depth"], False, 1),
        ([body(mesh=TORUS)], tl.SignedDepth(), ["signed_depth"], False, 1),
        ([body(sheet_thickness=1e-3)], None, ["thin_layer"], False, 1),
        ([body(sheet_thickness=1e-3), body(WINE, sheet_thickness=1e-3)], None, ["thin_layer"], True, 1),
        ([body(), body(sheet_thickness=1e-3)], None, ["signed_depth", "thin_layer"], False, 2),
        ([body(mesh=OPEN)], tl.ThinLayer(0.01), ["thin_layer"], False, 1),
        ([body()], tl.BackFaceDepth(), ["back_face_depth"], False, 2),
    ],
)
def test_a_plan_that_is_exact(
    bodies: list[tl.Object], method: Any, passes: list[str], spectral: bool, geometry_passes: int
) -> None:
    found = plan(scene(*bodies), method)
    assert names(found) == [*passes, "transmittance"]
    assert (found.exact, found.limits, found.spectral) == (True, (), spectral)
    assert found.geometry_passes == geometry_passes
    assert all(step.reason for step in found.passes)
    assert type(found.method) is (type(method) if method else tl.ThinLayer if "thin" in passes[0] else tl.SignedDepth)


@pytest.mark.parametrize(
    ("bodies", "method", "options", "limit"),
    [
        ([body(mesh=OPEN)], None, {}, "'open box': 3 open edges (first: vertices (0, 1), (0, 3), (1, 3))"),
        ([body()], tl.SignedDepth(anchored=False), {}, "distances count from the camera: float32 loses digits"),
        ([body(mesh=TORUS)], tl.BackFaceDepth(), {}, "torus not convex: pixels with more than one entry are marked"),
        ([body(), body(x=3)], tl.BackFaceDepth(), {}, "several bodies: pixels that cross more than one are marked"),
        ([body(mesh=TORUS)], None, {"overlap": "union"}, 'overlap="union": where a mesh overlaps itself, its medium'),
    ],
)
def test_a_plan_that_is_not_exact_says_where(
    bodies: list[tl.Object], method: Any, options: dict[str, Any], limit: str
) -> None:
    found = plan(scene(*bodies, **options), method)
    assert not found.exact
    assert len(found.limits) == 1
    assert found.limits[0].startswith(limit)


@pytest.mark.parametrize(
    ("medium", "effect"),
    [
        (MILK, "in-scattered light: scattering only removes light"),
        (DIAMOND, "refraction and reflection: rays go straight, though ior is above 1"),
    ],
)
@pytest.mark.parametrize("method", [None, tl.BackFaceDepth()])
def test_an_effect_that_no_pass_renders_is_told(medium: tl.Medium, effect: str, method: Any) -> None:
    found = plan(scene(body(medium)), method)
    assert found.unmodelled == (effect,)
    assert found.exact  # thickness and transmittance along straight rays are
    assert plan(scene(body()), method).unmodelled == ()


def test_thin_sheets_are_exact_by_definition_of_the_model() -> None:
    assert plan(scene(body(mesh=OPEN, sheet_thickness=1e-3))).exact
    assert plan(scene(body(mesh=OPEN)), tl.ThinLayer()).exact


def test_an_open_solid_gets_a_marked_fallback() -> None:
    found = plan(scene(body(), body(mesh=OPEN, x=3)))
    assert names(found) == ["signed_depth", "thin_layer_fallback", "signed_depth_fallback", "transmittance"]
    assert [step.objects for step in found.passes] == [(0, 1), (1,), (0,), ()]
    assert [step.target for step in found.passes] == ["accumulated", "fallback", "fallback", "accumulated"]
    assert "close it, or declare it a sheet" in found.limits[0]
    assert "'open box' not closed" in found.passes[1].reason
    assert "marked invalid" in found.passes[1].reason


def test_sheets_are_drawn_as_sheets_beside_solids() -> None:
    found = plan(scene(body(sheet_thickness=1e-3), body()))
    assert found.passes[0].objects == (1,)
    assert found.passes[1].objects == (0,)


@pytest.mark.parametrize(
    ("bodies", "step", "words"),
    [
        (
            [body()],
            0,
            "1 body in one unsorted draw each: exits minus entries add up to thickness, since all bodies share",
        ),
        (
            [body(), body(WINE)],
            0,
            "2 bodies in one unsorted draw each: exits minus entries add up to optical depth per channel",
        ),
        ([body()], 1, "Beer-Lambert: the background through exp(-optical depth)"),
        ([body(FIRE)], 1, "the emission of the one medium in closed form, q / sigma_t (1 - T)"),
        (
            [body(sheet_thickness=1e-3)],
            0,
            "every face of 1 mesh is a sheet: their paths add up, t / max(0.001, n.v) each",
        ),
    ],
)
def test_a_pass_says_why_the_scene_needs_it(bodies: list[tl.Object], step: int, words: str) -> None:
    assert words in plan(scene(*bodies)).passes[step].reason


@pytest.mark.parametrize("overlap", ["union", "priority"])
def test_bodies_apart_may_have_any_overlap_policy(overlap: Any) -> None:
    assert plan(scene(body(), body(WINE, x=3), overlap=overlap)).exact


@pytest.mark.parametrize(
    ("objects", "options", "method", "message"),
    [
        ([body(None)], {}, None, "rendering 'box'; opaque objects are not supported yet; give each object a medium"),
        ([body(), body(None)], {}, None, "rendering 'box'; opaque objects are not supported yet"),
        ([body(FIRE), body(WINE)], {}, None, "rendering emission among several media; their order along the ray"),
        ([body(FIRE), body(EMBER)], {}, None, "rendering emission among several media"),
        ([body(FIRE), body(EMBER)], {}, tl.ThinLayer(), "rendering emission among several media"),
        ([body(), body(WINE)], {}, tl.BackFaceDepth(), "BackFaceDepth; bodies with different media; use SignedDepth"),
        (
            [body(), body(mesh=TORUS, x=0.5)],
            {"overlap": "union"},
            None,
            "overlap=\"union\"; 'box' and 'torus' may overlap, which needs ordered intervals",
        ),
        ([body(), body(x=1.0)], {"overlap": "priority"}, None, "overlap=\"priority\"; 'box' and 'box' may overlap"),
    ],
)
def test_a_scene_that_nothing_can_render_exactly_is_refused(
    objects: list[tl.Object], options: dict[str, Any], method: Any, message: str
) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        plan(scene(*objects, **options), method)


def test_the_order_of_three_media_does_not_hide_a_difference() -> None:
    assert plan(scene(body(GLASS), body(GLASS), body(WINE))).spectral
    assert not plan(scene(body(GLASS), body(tl.Medium(scattering=1.0)), body(GLASS))).spectral


def test_a_plan_prints_and_goes_into_json() -> None:
    found = plan(scene(body(MILK)))
    lines = str(found).splitlines()
    assert lines[0] == "SignedDepth(anchored=True): exact"
    assert lines[1].startswith("  1. signed_depth: 1 body")
    assert lines[-1] == "  not modelled: in-scattered light: scattering only removes light"
    assert "  limit: 'open box'" in str(plan(scene(body(mesh=OPEN))))
    told = json.loads(json.dumps(found.summary()))
    assert [step["name"] for step in told["passes"]] == names(found)
    assert told["exact"] is True
    assert (told["limits"], told["unmodelled"]) == ([], list(found.unmodelled))


# Methods by name


@pytest.mark.parametrize("name", sorted(METHODS))
def test_a_method_has_a_name(name: str) -> None:
    for written in (name, name.upper(), name.replace("-", "_")):
        assert method_from_name(written) == METHODS[name]()


def test_an_unknown_method_names_the_known_ones() -> None:
    with pytest.raises(tl.InputError, match="method 'magic'; not a known method; use one of signed-depth, back-face"):
        method_from_name("magic")


@pytest.mark.parametrize("thickness", [0, -1.0, np.nan, np.inf])
def test_a_sheet_has_a_positive_thickness(thickness: float) -> None:
    with pytest.raises(tl.InputError, match=re.escape(f"ThinLayer thickness {thickness}; not above 0")):
        tl.ThinLayer(thickness)


def test_importing_and_planning_loads_no_opengl() -> None:
    code = """
import sys
import translucent as tl
mesh = tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
assert tl.plan(tl.showcase(mesh)).exact
found = {"moderngl", "glcontext", "OpenGL", "translucent.gpu"} & set(sys.modules)
assert not found, found
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_closed_body_drawn_as_sheets_is_a_limit() -> None:
    found = plan(scene(body()), tl.ThinLayer())
    assert not found.exact
    assert "closed, but drawn as sheets" in found.limits[0]


def test_back_face_depth_refuses_sheets() -> None:
    with pytest.raises(tl.InputError, match="declared a sheet; use SignedDepth or ThinLayer"):
        plan(scene(body(sheet_thickness=1e-3)), tl.BackFaceDepth())


@pytest.mark.parametrize("method", ["signed-depth", tl.ThinLayer, 3])
def test_what_is_no_method_is_refused(method: object) -> None:
    with pytest.raises(tl.InputError, match="not a thickness method; give for example"):
        plan(scene(body()), method)  # type: ignore[arg-type]


def test_duplicated_faces_are_a_limit() -> None:
    cube = body().mesh
    doubled = tl.Mesh(cube.vertices, [*cube.faces.tolist(), *cube.faces[:, ::-1].tolist()], name="walls")
    found = plan(scene(body(mesh=doubled)))
    assert not found.exact
    assert "'walls': 12 duplicated faces" in found.limits[0]
