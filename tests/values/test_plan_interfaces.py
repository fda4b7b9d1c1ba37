"""Plans of how interfaces are found: what the planner takes, what the others save, and where they are refused."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import (
    DIAMOND,
    NO_STORAGE,
    OPEN,
    ORDERED,
    SCENES,
    TORUS,
    WINE,
    body,
    plan_over_backdrop,
    scene,
    sheet,
)
from translucent.planning.interfaces import INTERFACES, ONE_INTERFACE, TRACE_COST, InterfaceMode
from translucent.planning.passes import NoteKind, PassName
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities

TRACED, SCREEN, FRONT = tl.TracedInterfaces(), tl.ScreenInterfaces(), tl.FrontInterface()
CHOICES: list[InterfaceMode] = [TRACED, SCREEN, FRONT]
#: What the planner takes where light bends.
USUAL = tl.TracedInterfaces(depth=24)
ALWAYS: list[Any] = [None, tl.SignedDepth(), *ORDERED]


@pytest.mark.parametrize("method", ALWAYS)
@pytest.mark.parametrize("capabilities", [Capabilities(), NO_STORAGE], ids=["storage", "no storage"])
def test_interfaces_of_solid_bodies_are_traced_if_nobody_asks(method: Any, capabilities: Capabilities) -> None:
    if method is not None and method.needs_storage and not capabilities.shader_storage:
        return
    for objects in ([body(DIAMOND)], [body(DIAMOND), sheet(DIAMOND, x=3)], [body(), body(DIAMOND, OPEN, x=3)]):
        found = plan(scene(*objects), method, capabilities)
        assert found.interfaces == USUAL
        assert found == plan(scene(*objects), method, capabilities, interfaces=USUAL)
        assert found.has(PassName.TRACED)
        assert not found.has(PassName.SURFACES)


@pytest.mark.parametrize("method", ALWAYS)
def test_one_interface_saves_a_draw_and_says_what_it_costs(method: Any) -> None:
    asked = scene(body(DIAMOND), body(None, TORUS))
    both, front = plan(asked, method, interfaces=SCREEN), plan(asked, method, interfaces=FRONT)
    assert (both.interfaces, front.interfaces) == (SCREEN, FRONT)
    assert [step.name for step in both.passes] == [step.name for step in front.passes]
    assert front.geometry_passes == both.geometry_passes - 1
    assert front.cost < both.cost
    assert ONE_INTERFACE in front.unmodelled
    assert tuple(note for note in front.unmodelled if note != ONE_INTERFACE) == both.unmodelled
    assert "approximation: FrontInterface: rays refract only where they enter a body" in str(front)
    assert front.summary()["interfaces"] == "FrontInterface()"


@pytest.mark.parametrize(
    ("objects", "method"), [([body()], None), ([sheet(DIAMOND)], None), ([body(DIAMOND)], tl.ThinLayer())]
)
def test_one_interface_changes_nothing_where_nothing_bends(objects: list[tl.Object], method: Any) -> None:
    assert plan(scene(*objects), method, interfaces=FRONT) == plan(scene(*objects), method, interfaces=SCREEN)


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
    touching = scene(body(DIAMOND), body(WINE, x=0.5))
    found = plan(touching, method, capabilities, interfaces=SCREEN)
    assert found.says(NoteKind.TOUCHING_INTERFACES) is told
    assert not plan(touching, method, capabilities).says(NoteKind.TOUCHING_INTERFACES)


def test_one_interface_needs_no_order_where_bodies_touch() -> None:
    touching = scene(body(DIAMOND), body(WINE, x=0.5))
    assert plan(touching, interfaces=SCREEN).ordered
    assert not plan(touching, interfaces=FRONT).ordered


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
        assert plan(asked, interfaces=FRONT).interfaces == FRONT
        return
    message = r"^FrontInterface\(\); rays start inside .*; use ScreenInterfaces\(\), or move the camera outside$"
    with pytest.raises(tl.InputError, match=message):
        plan(asked, interfaces=FRONT)
    assert plan(asked).interfaces == (USUAL if camera.fov_y is not None else SCREEN)


def test_an_eye_in_the_hole_of_a_ring_is_outside() -> None:
    ring = tl.Scene([body(DIAMOND, TORUS)], tl.Camera.look_at((0, 0, 0), (1, 0, 0)))
    assert plan(ring, interfaces=FRONT).interfaces == FRONT


@pytest.mark.parametrize(
    ("asked", "do"),
    [
        ("both", "write interfaces=tl.ScreenInterfaces()"),
        ("front", "write interfaces=tl.FrontInterface()"),
        *(
            (other, f"give tl.{TRACED}, tl.{SCREEN} or tl.{FRONT}")
            for other in ("back", ["front"], tl.FrontInterface, 8)
        ),
    ],
)
def test_what_is_no_choice_of_interfaces_is_refused(asked: Any, do: str) -> None:
    message = f"^{re.escape(f'interfaces {asked!r}; this is not a choice of interfaces; {do}')}$"
    for make in (plan, plan_over_backdrop, planned_on_the_cpu):
        with pytest.raises(tl.InputError, match=message):
            make(scene(body()), interfaces=asked)


def planned_on_the_cpu(asked: tl.Scene, *, interfaces: Any) -> tl.RenderPlan:
    with tl.Renderer("cpu") as renderer:
        return renderer.plan(asked, interfaces=interfaces)


@pytest.mark.parametrize(
    ("objects", "method"),
    [([sheet(DIAMOND)], None), ([sheet(DIAMOND), body()], None), ([body(DIAMOND)], tl.ThinLayer())],
)
def test_sheets_have_one_interface_and_bend_no_ray(objects: list[tl.Object], method: Any) -> None:
    chosen = plan(scene(*objects), method)
    assert chosen.interfaces == SCREEN
    assert chosen == plan(scene(*objects), method, interfaces=SCREEN)
    found = {step.name: step for step in chosen.passes}
    assert found["interfaces"].reason.endswith("normal and position of the first sheet on each ray")
    assert found["interfaces"].geometry_passes == 1
    assert (
        found["surfaces"].reason == "interfaces reflect the environment (ior above 1); rays go straight through sheets"
    )
    solid = {step.name: step for step in plan(scene(body(DIAMOND)), interfaces=SCREEN).passes}
    assert solid["interfaces"].geometry_passes == 2
    assert 0 < found["interfaces"].cost < solid["interfaces"].cost


def test_one_interface_names_the_sheets_too() -> None:
    asked = scene(sheet(DIAMOND, OPEN), body(DIAMOND))
    for interfaces in CHOICES:
        (step,) = (step for step in plan(asked, interfaces=interfaces).passes if step.name == "interfaces")
        assert step.reason.startswith("'open box', 'box': ")


@pytest.mark.parametrize("kind", SCENES)
def test_scenes_without_interfaces_have_one_plan(kind: str) -> None:
    for capabilities in (Capabilities(), NO_STORAGE):
        found = [plan(SCENES[kind], None, capabilities, interfaces=one) for one in (None, *CHOICES)]
        assert found == found[:1] * 4
        assert found[0].interfaces is None


def test_each_way_of_finding_interfaces_has_a_name_and_traits_of_its_own() -> None:
    assert [type(one) for one in CHOICES] == list(INTERFACES.values())
    for one in CHOICES:
        assert all(step.reason and step.cost > 0 for step in one.passes(scene(body(DIAMOND)), straight=False))
    assert [(one.traced, one.finds_exits, one.one_interface) for one in CHOICES] == [
        (True, False, False),
        (False, True, False),
        (False, False, True),
    ]


@pytest.mark.parametrize(("what", "least", "most", "example"), [("depth", 1, 64, 8), ("forks", 0, 4, 2)])
def test_depth_and_forks_are_whole_numbers_in_range(what: str, least: int, most: int, example: int) -> None:
    assert tl.TracedInterfaces(**{what: least}) != tl.TracedInterfaces(**{what: most})
    assert tl.TracedInterfaces() == tl.TracedInterfaces(depth=8, forks=2)
    for wrong in (least - 1, most + 1, 2.0, True, None, "3", np.nan):
        message = (
            f"TracedInterfaces {what} {wrong!r}; the value must be a whole number in {least} to {most}; "
            f"use a value such as {example}"
        )
        with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
            tl.TracedInterfaces(**{what: wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ALWAYS)
def test_traced_interfaces_draw_the_first_and_trace_the_others(method: Any) -> None:
    asked = scene(body(DIAMOND), body(None, TORUS))
    drawn, traced = plan(asked, method, interfaces=SCREEN), plan(asked, method, interfaces=TRACED)
    assert [step.name for step in traced.passes] == [
        PassName.TRACED if step.name is PassName.SURFACES else step.name for step in drawn.passes
    ]
    steps = {step.name: step for step in traced.passes}
    front = {step.name: step for step in plan(asked, method, interfaces=FRONT).passes}
    assert (steps[PassName.INTERFACES].geometry_passes, steps[PassName.INTERFACES].objects) == (1, (0,))
    assert steps[PassName.INTERFACES].cost == front[PassName.INTERFACES].cost
    assert steps[PassName.TRACED].cost == TRACE_COST
    assert (
        "at most 8 interfaces, and twice along the weaker of the reflected and the refracted ray"
        in steps[PassName.TRACED].reason
    )
    assert traced.interfaces == TRACED
    assert traced.limits == drawn.limits
    assert traced.summary()["interfaces"] == "TracedInterfaces(depth=8, forks=2)"


@pytest.mark.parametrize(
    ("depth", "forks", "told"),
    [
        (3, 1, "3 interfaces, or follow the weaker of the reflected and the refracted ray more often than once, "),
        (
            12,
            3,
            "12 interfaces, or follow the weaker of the reflected and the refracted ray more often than 3 times, ",
        ),
        (1, 0, "1 interface, or follow the weaker of the reflected and the refracted ray, "),
    ],
)
def test_traced_interfaces_tell_what_they_cut_off_and_no_more(depth: int, forks: int, told: str) -> None:
    (note,) = plan(scene(body(DIAMOND)), interfaces=tl.TracedInterfaces(depth, forks)).unmodelled
    assert note.kind is NoteKind.CUT_OFF_PATHS
    assert note.startswith(f"rays that cross more than {told}")


def test_traced_interfaces_need_no_order_where_bodies_touch() -> None:
    touching = scene(body(DIAMOND), body(WINE, x=0.5))
    for method in (None, tl.SignedDepth(), tl.DepthPeeling()):
        found = plan(touching, method, interfaces=TRACED)
        assert found.ordered is (method == tl.DepthPeeling())
        assert not found.says(NoteKind.TOUCHING_INTERFACES)


CRYSTAL, RED = tl.Medium(absorption=0.1, ior=1.5), tl.Medium(absorption=(1, 2, 3), ior=1.33)


@pytest.mark.parametrize("capabilities", [Capabilities(), NO_STORAGE], ids=["storage", "no storage"])
def test_wine_in_a_glass_is_a_sum_unless_bodies_take_each_others_place(capabilities: Capabilities) -> None:
    """The rays find where they leave; thickness needs the order only where overlaps do not add up."""
    glass, wine = body(CRYSTAL, priority=1), body(RED, x=0.5)
    added = plan(scene(glass, wine, overlap="add"), None, capabilities)
    assert (added.method, added.interfaces) == (tl.SignedDepth(), USUAL)
    for overlap in ("union", "priority"):
        found = plan(scene(glass, wine, overlap=overlap), None, capabilities)
        assert isinstance(found.method, tl.FragmentLists if capabilities.shader_storage else tl.DepthPeeling)
        assert found.interfaces == USUAL
        assert found.unmodelled[0].kind is NoteKind.CUT_OFF_PATHS
        assert not found.says(NoteKind.TOUCHING_INTERFACES)
    emitting = scene(glass, body(tl.Medium(1.0, emission=1.0, ior=1.33), x=0.5))
    assert plan(emitting, None, capabilities).ordered


INSIDE = tl.Scene([body(DIAMOND)], tl.Camera.look_at((0, 0, 0.2), (0, 0, -1)))
CUT = tl.Scene([body(DIAMOND)], tl.Camera.orthographic((0, 0, 0.2), (0, 0, -1), height=1))
DENSITY = scene(body(DIAMOND, density=tl.LinearDensity(1, 0.1, 2.0)))
UNTRACED = {
    "cut": (CUT, "the image plane of the orthographic camera, where rays start, cuts 'box'"),
    "density": (DENSITY, "'box': the density varies, but traced rays cross each medium in one step"),
}


def test_traced_rays_may_start_inside_a_body() -> None:
    assert plan(INSIDE, interfaces=TRACED).interfaces == TRACED


@pytest.mark.parametrize(("asked", "why"), UNTRACED.values(), ids=UNTRACED)
def test_what_rays_cannot_be_traced_through_is_refused_or_drawn(asked: tl.Scene, why: str) -> None:
    with pytest.raises(tl.InputError, match=rf"^{re.escape(f'{TRACED}; {why}; use {SCREEN}')}"):
        plan(asked, interfaces=TRACED)
    drawn = plan(asked, interfaces=SCREEN)
    found = plan(asked)
    assert found.interfaces == SCREEN
    assert [step.name for step in found.passes] == [step.name for step in drawn.passes]
    (shading,) = (step for step in found.passes if step.name is PassName.SURFACES)
    assert shading.reason.endswith(f"; in screen space, because {why}")


def test_bodies_that_a_picture_cuts_do_not_matter_as_sheets_or_without_interfaces() -> None:
    assert plan(CUT, tl.ThinLayer(), interfaces=TRACED).interfaces == TRACED
    assert plan(tl.Scene([body()], CUT.camera), interfaces=TRACED).interfaces is None


def test_nothing_is_traced_before_a_backdrop() -> None:
    asked = scene(body(DIAMOND))
    with pytest.raises(tl.InputError, match=r"have no mesh that a ray could hit; use ScreenInterfaces\(\) instead$"):
        plan_over_backdrop(asked, interfaces=TRACED)
    assert plan_over_backdrop(asked).interfaces == SCREEN
    assert plan_over_backdrop(asked, interfaces=FRONT).interfaces == FRONT


def test_rays_without_opengl_follow_interfaces_whatever_is_asked_for() -> None:
    """Traced ones as asked; the others do not exist there, and the plan says what it does in their place."""
    without, deep = Capabilities(opengl=False), tl.TracedInterfaces(depth=20, forks=3)
    for asked, followed in ((None, USUAL), (deep, deep), (SCREEN, USUAL), (FRONT, USUAL)):
        found = plan(scene(body(DIAMOND)), None, without, interfaces=asked)
        assert found.interfaces == followed
        assert {note.kind for note in found.unmodelled} == {NoteKind.CUT_OFF_PATHS}
        assert f"more than {followed.depth} interfaces" in found.unmodelled[0]
        instead = f"{followed} in place of {asked}"
        assert any(instead in step.reason for step in found.passes) is (asked in (SCREEN, FRONT))
    assert plan(scene(sheet(DIAMOND)), None, without).interfaces == USUAL
    assert plan(scene(body()), None, without, interfaces=deep).interfaces is None
