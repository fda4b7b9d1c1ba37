"""Features of frames, by their scenes and plans, without OpenGL."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import DIAMOND, EMBER, FIRE, GLASS, MILK, NO_STORAGE, OPEN, WINE, body, scene, sheet
from translucent.gpu.features import FrameFeatures
from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.interfaces import InterfaceMode
from translucent.planning.methods import Method
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities

FLAGS = (
    "has_opaque",
    "has_surfaces",
    "has_layers",
    "accumulates",
    "has_fallback",
    "has_unlit",
    "scatters",
    "scatters_again",
    "varies",
    "one_interface",
    "traced",
    "finds_exits",
    "marches",
    "emits",
)
LIGHT = tl.DirectionalLight((0, 0, -1), (1, 1, 1))
LAYER = tl.Object(OPEN, tl.Medium(), sheet_thickness=1e-5, surface=tl.Surface(opacity=0.5, ior=1.0, roughness=1.0))
SCREEN = tl.ScreenInterfaces()
VARYING = body(density=tl.LinearDensity(1, 0.1, 2.0))


def features(
    found: tl.Scene,
    method: Method | None = None,
    capabilities: Capabilities | None = None,
    interfaces: InterfaceMode | None = None,
) -> FrameFeatures:
    return FrameFeatures(plan(found, method, capabilities or Capabilities(), interfaces=interfaces))


def flags(found: FrameFeatures) -> set[str]:
    return {name for name in FLAGS if getattr(found, name)}


CASES: dict[str, tuple[FrameFeatures, set[str], str]] = {
    "absorber": (features(scene(body())), {"accumulates"}, "transmittance"),
    "emitter": (features(scene(body(FIRE))), {"accumulates", "emits"}, "transmittance"),
    "opaque": (features(scene(body(), body(None, x=2.0))), {"accumulates", "has_opaque"}, "transmittance"),
    "emitters": (features(scene(body(FIRE), body(EMBER))), {"emits"}, "transmittance"),
    "with a sheet": (features(scene(body(FIRE), body(EMBER), sheet(x=3.0))), {"accumulates", "emits"}, "transmittance"),
    "open": (features(scene(body(mesh=OPEN))), {"accumulates", "has_fallback"}, "transmittance"),
    "interfaces": (
        features(scene(body(DIAMOND))),
        {"accumulates", "has_surfaces", "one_interface", "traced"},
        "traced_interfaces",
    ),
    "interfaces of sheets": (features(scene(sheet(DIAMOND))), {"accumulates", "has_surfaces"}, "surfaces"),
    "interfaces on the screen": (
        features(scene(body(DIAMOND)), interfaces=SCREEN),
        {"accumulates", "has_surfaces"},
        "surfaces",
    ),
    "one interface": (
        features(scene(body(DIAMOND)), interfaces=tl.FrontInterface()),
        {"accumulates", "has_surfaces", "one_interface"},
        "surfaces",
    ),
    "interfaces in order": (
        features(scene(body(DIAMOND)), tl.FragmentLists(), interfaces=SCREEN),
        {"has_surfaces", "finds_exits"},
        "surfaces",
    ),
    "interfaces peeled": (
        features(scene(body(DIAMOND)), tl.DepthPeeling(), interfaces=SCREEN),
        {"has_surfaces"},
        "surfaces",
    ),
    "traced in order": (
        features(scene(body(DIAMOND)), tl.FragmentLists()),
        {"has_surfaces", "one_interface", "traced", "finds_exits"},
        "traced_interfaces",
    ),
    "traced and peeled": (
        features(scene(body(DIAMOND)), tl.DepthPeeling()),
        {"has_surfaces", "one_interface", "traced"},
        "traced_interfaces",
    ),
    "lit": (features(scene(body(MILK), lights=[LIGHT]), tl.FragmentLists()), {"scatters"}, "transmittance"),
    "fog": (
        features(scene(body(MILK), lights=[LIGHT])),
        {"scatters", "scatters_again", "varies", "marches"},
        "transmittance",
    ),
    "unlit": (
        features(scene(body(MILK), lights=[LIGHT]), tl.SignedDepth(), capabilities=NO_STORAGE),
        {"accumulates", "has_unlit"},
        "transmittance",
    ),
    "marched": (features(scene(VARYING), tl.RayMarched()), {"marches", "varies"}, "transmittance"),
    "layers": (features(scene(body(), LAYER)), {"accumulates", "has_layers"}, "layers"),
}


@pytest.mark.parametrize(("found", "expected", "last"), CASES.values(), ids=CASES)
def test_a_frame_has_what_its_scene_asks_for(found: FrameFeatures, expected: set[str], last: str) -> None:
    assert flags(found) == expected
    assert found.last_pass == last


def test_sheets_are_as_thick_as_declared_or_as_the_method_says() -> None:
    found = scene(body(), sheet(x=2.0), body(None, x=4.0), sheet(WINE, x=6.0))
    assert features(found).sheets == {1: 1e-3, 3: 1e-3}
    assert features(found, tl.ThinLayer(0.02)).sheets == {0: 0.02, 1: 1e-3, 3: 1e-3}


def test_a_body_that_is_no_sheet_falls_back_to_a_share_of_its_size() -> None:
    found = scene(body(mesh=OPEN))
    assert features(found).sheets == {}
    assert features(found).sheet_thicknesses[0] == pytest.approx(FALLBACK_SHEET * np.sqrt(3.0))


def test_bodies_of_one_medium_share_a_slot() -> None:
    found = scene(body(GLASS), body(WINE, x=2.0), body(GLASS, x=4.0))
    assert [slot.objects for slot in features(found).slots] == [(0, 2), (1,)]
