"""Plans with one interface: what they save, what they cost, and where they are refused."""

from __future__ import annotations

from typing import Any, get_args

import pytest

import translucent as tl
from tests.values.plan_scenes import DIAMOND, OPEN, ORDERED, TORUS, WINE, body, scene, sheet
from translucent.planning.interfaces import ONE_INTERFACE
from translucent.planning.notes import NoteKind
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities, Interfaces


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), *ORDERED])
def test_one_interface_saves_a_draw_and_says_what_it_costs(method: Any) -> None:
    asked = scene(body(DIAMOND), body(None, TORUS))
    both, front = plan(asked, method), plan(asked, method, interfaces="front")
    assert plan(asked, method, interfaces="both") == both
    assert (both.interfaces, front.interfaces) == ("both", "front")
    assert [step.name for step in both.passes] == [step.name for step in front.passes]
    assert front.geometry_passes == both.geometry_passes - 1
    assert front.cost < both.cost
    assert front.unmodelled == (*both.unmodelled, ONE_INTERFACE)
    assert 'not modelled: interfaces="front": bends once, where a ray enters; leaves without bending' in str(front)
    assert front.summary()["interfaces"] == "front"


@pytest.mark.parametrize(
    ("objects", "method"), [([body()], None), ([sheet(DIAMOND)], None), ([body(DIAMOND)], tl.ThinLayer())]
)
def test_one_interface_changes_nothing_where_nothing_bends(objects: list[tl.Object], method: Any) -> None:
    assert plan(scene(*objects), method, interfaces="front") == plan(scene(*objects), method)


@pytest.mark.parametrize(
    ("method", "capabilities", "told"),
    [
        (None, Capabilities(), False),
        (None, Capabilities(shader_storage=False), True),
        (tl.SignedDepth(), Capabilities(), True),
        (tl.DepthPeeling(), Capabilities(), True),
        (tl.KBuffer(), Capabilities(), False),
        (tl.ThinLayer(), Capabilities(), False),
    ],
)
def test_a_method_that_misses_where_rays_leave_touching_bodies_is_told(
    method: Any, capabilities: Capabilities, told: bool
) -> None:
    found = plan(scene(body(DIAMOND), body(WINE, x=0.5)), method, capabilities)
    assert found.says(NoteKind.TOUCHING_INTERFACES) is told


def test_one_interface_needs_no_order_where_bodies_touch() -> None:
    touching = scene(body(DIAMOND), body(WINE, x=0.5))
    assert plan(touching).ordered
    assert not plan(touching, interfaces="front").ordered


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
def test_one_interface_cannot_be_entered_from_inside(camera: tl.Camera, inside: bool) -> None:
    asked = tl.Scene([body(DIAMOND)], camera)
    if not inside:
        assert plan(asked, interfaces="front").interfaces == "front"
        return
    message = r'^interfaces="front"; rays start inside .*; use interfaces="both", or move the camera outside$'
    with pytest.raises(tl.InputError, match=message):
        plan(asked, interfaces="front")
    assert plan(asked).interfaces == "both"


def test_an_eye_in_the_hole_of_a_ring_is_outside() -> None:
    ring = tl.Scene([body(DIAMOND, TORUS)], tl.Camera.look_at((0, 0, 0), (1, 0, 0)))
    assert plan(ring, interfaces="front").interfaces == "front"


def test_interfaces_that_are_not_known_are_refused() -> None:
    with pytest.raises(tl.InputError, match=r"^interfaces 'back'; not known; use one of both, front$"):
        plan(scene(body()), interfaces="back")  # type: ignore[arg-type]
    with tl.Renderer("cpu") as renderer, pytest.raises(tl.InputError, match=r"^interfaces \['front'\]; not known"):
        renderer.plan(scene(body()), interfaces=["front"])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("objects", "method"),
    [([sheet(DIAMOND)], None), ([sheet(DIAMOND), body()], None), ([body(DIAMOND)], tl.ThinLayer())],
)
def test_sheets_have_one_interface_and_bend_no_ray(objects: list[tl.Object], method: Any) -> None:
    found = {step.name: step for step in plan(scene(*objects), method).passes}
    assert found["interfaces"].reason.endswith("normal and place of the sheet that a ray meets first")
    assert found["interfaces"].geometry_passes == 1
    assert (
        found["surfaces"].reason == "interfaces mirror the environment (ior above 1); rays go straight through sheets"
    )
    solid = {step.name: step for step in plan(scene(body(DIAMOND))).passes}
    assert solid["interfaces"].geometry_passes == 2
    assert 0 < found["interfaces"].cost < solid["interfaces"].cost


def test_one_interface_names_the_sheets_too() -> None:
    asked = scene(sheet(DIAMOND, OPEN), body(DIAMOND))
    for interfaces in get_args(Interfaces):
        (step,) = (step for step in plan(asked, interfaces=interfaces).passes if step.name == "interfaces")
        assert step.reason.startswith("'open box', 'box': ")
