"""Refusals of the planner."""

from __future__ import annotations

import re
from typing import Any

import pytest

import translucent as tl
from tests.values.plan_scenes import EMBER, FIRE, ORDERED, TORUS, WINE, body, names, scene, sheet
from translucent.planning.plan import plan


@pytest.mark.parametrize("method", ["RayMarched", "signed-depth", tl.ThinLayer, 3])
def test_what_is_no_method_is_refused(method: Any) -> None:
    with pytest.raises(
        tl.InputError, match=r"^method .*; this is not a thickness method; give for example tl.SignedDepth\(\)"
    ):
        plan(scene(body()), method)


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer(), *ORDERED])
def test_a_scene_of_opaque_objects_is_refused(method: Any) -> None:
    message = (
        "rendering 'box', 'torus'; none of these objects has a medium; "
        "give at least one object a medium: medium=tl.Medium(...)"
    )
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
            "SignedDepth; emission among several media: a medium dims the emission behind it; use FragmentLists, or "
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
            "BackFaceDepth; the bodies have different media; use SignedDepth, which supports several media",
        ),
        (
            [body(), sheet(mesh=TORUS)],
            {},
            tl.BackFaceDepth(),
            "BackFaceDepth; 'torus': this method cannot render thin-walled sheets; use SignedDepth or ThinLayer",
        ),
        *(
            (
                [sheet()],
                {},
                method,
                f"{type(method).__name__}; all bodies are declared as thin-walled sheets, which have no inside; u",
            )
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
    assert any("cross more than one body are marked as invalid" in limit for limit in found.limits)
    assert names(plan(scene(body(), body(x=0.5), overlap=overlap), tl.ThinLayer())) == ["thin_layer", "transmittance"]
