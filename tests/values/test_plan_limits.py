"""Limits of plans that are not exact, and say so: bodies that are not closed, and effects that are left out."""

from __future__ import annotations

from typing import Any

import pytest

import translucent as tl
from tests.values.plan_scenes import BOX, DIAMOND, MILK, NO_STORAGE, OPEN, ORDERED, TORUS, body, names, scene, sheet
from translucent.planning.plan import plan

_APART = BOX.vertices + (5, 0, 0)
#: One part looks outwards, the other inwards, and neither is inside the other.
INSIDE_OUT = tl.Mesh([*BOX.vertices, *_APART], [*BOX.faces, *BOX.faces[:, ::-1] + 8], name="half flipped")
DOUBLED = tl.Mesh(BOX.vertices, [*BOX.faces, *BOX.faces[:, ::-1]], name="walls")


# What no pass renders

#: Stands for what the way of finding interfaces leaves out.
BENT = "refracted and reflected light"


@pytest.mark.parametrize(
    ("objects", "effects"),
    [
        ([body()], []),
        ([body(MILK)], ["scattering only removes light from rays"]),
        ([body(DIAMOND)], [BENT]),
        (
            [body(), body(None)],
            ["the environment casts no shadows on opaque objects"],
        ),
        (
            [body(MILK), body(DIAMOND, x=9), body(None)],
            ["scattering only removes", BENT, "the environment casts no shadows"],
        ),
    ],
)
@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.ThinLayer(), *ORDERED])
def test_an_effect_that_no_pass_renders_is_told(objects: list[tl.Object], effects: list[str], method: Any) -> None:
    cut_off = (
        "rays that cross more than 24 interfaces, or follow the weaker of the reflected and the refracted ray more"
    )
    first_interval = "after the first body on a ray, the ray goes straight"
    traced = first_interval if method == tl.ThinLayer() else cut_off  # sheets bend no ray
    for interfaces, bent in ((None, traced), (tl.ScreenInterfaces(), first_interval)):
        found = plan(scene(*objects), method, interfaces=interfaces, scattering=tl.SingleScattering())
        assert len(found.unmodelled) == len(effects)
        for told, effect in zip(found.unmodelled, effects, strict=True):
            assert told.startswith(bent if effect == BENT else effect)
        # Thickness and transmittance along straight rays are exact all the same.
        assert found.exact == (method != tl.ThinLayer())


# Bodies that are not closed


@pytest.mark.parametrize("mesh", [OPEN, INSIDE_OUT, DOUBLED])
def test_a_sheet_needs_no_inside(mesh: tl.Mesh) -> None:
    assert [limit for limit in plan(scene(sheet(mesh=mesh))).limits if "duplicated" not in limit] == []
    assert plan(scene(body(mesh=mesh))).limits


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
        "'open box': not closed; pixels with unequal entries and exits show sheets of 1% of the diagonal, and are "
        "marked as invalid"
    )
    assert found.limits[0] == (
        "'open box': 3 open edges (first: vertices (0, 1), (0, 3), (1, 3)): close the mesh, or declare it "
        "a thin-walled sheet (sheet_thickness=..., --method thin-layer)"
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
        ([body()], tl.SignedDepth(anchored=False), ["distances are measured from the camera, so float32 loses digits"]),
        (
            [body(mesh=TORUS)],
            tl.BackFaceDepth(),
            ["'torus': not convex, so pixels with more than one entry are marked as in"],
        ),
        ([body(), body(x=3)], tl.BackFaceDepth(), ["pixels whose rays cross more than one body are marked as inval"]),
        ([body(mesh=OPEN)], tl.BackFaceDepth(), ["'open box': 3 open edges", "'open box': not convex, so pixels with"]),
        ([body()], tl.ThinLayer(), ["'box': closed, but drawn as sheets, without the inside"]),
        (
            [sheet(), body(), body(mesh=TORUS), body(mesh=OPEN)],
            tl.ThinLayer(),
            ["'box', 'torus': closed, but drawn as"],
        ),
        ([body(mesh=DOUBLED)], None, ["'walls': 12 faces are duplicated, so their distances count twice or cancel"]),
        ([sheet(mesh=DOUBLED)], None, ["'walls': 12 faces are duplicated, so their distances count twice or cancel"]),
        (
            [body(mesh=INSIDE_OUT)],
            None,
            ["'half flipped': 1 closed parts are inside out: these pixels are marked as invalid"],
        ),
        (
            [body(mesh=INSIDE_OUT)],
            tl.FragmentLists(),
            ["'half flipped': 1 closed parts are inside out: these pixels are"],
        ),
        ([body(mesh=INSIDE_OUT)], tl.ThinLayer(), ["'half flipped': closed, but drawn as sheets"]),
        ([sheet(mesh=INSIDE_OUT), body()], None, []),
    ],
)
def test_a_plan_that_is_not_exact_says_where(objects: list[tl.Object], method: Any, limits: list[str]) -> None:
    found = plan(scene(*objects), method)
    assert found.exact is not bool(limits)
    assert len(found.limits) == len(limits)
    for told, limit in zip(found.limits, limits, strict=True):
        assert told.startswith(limit)


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.DepthPeeling()], ids=str)
def test_without_shader_storage_what_scatters_is_marked(method: tl.SignedDepth | tl.DepthPeeling | None) -> None:
    wax, dye = tl.Medium(scattering=1.0), tl.Medium(absorption=1.0)
    light = tl.DirectionalLight((0, 0, -1), (1, 1, 1))
    lit = scene(body(dye), body(wax), lights=[light])
    once = tl.SingleScattering()
    here, there = plan(lit, method, scattering=once), plan(lit, method, NO_STORAGE, scattering=once)
    assert "unlit" not in names(here)
    assert names(there)[-2:] == ["unlit", "transmittance"]
    assert there.passes[-2].objects == (1,)
    assert any("marked as invalid: their light can be rendered only by OpenGL 4.3" in limit for limit in there.limits)
    for other in (scene(body(dye), body(wax)), scene(body(dye), lights=[light])):
        assert "unlit" not in names(plan(other, method, NO_STORAGE, scattering=once))
