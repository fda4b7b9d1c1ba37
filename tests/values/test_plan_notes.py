"""Types of what plans say: names of passes, and kinds of notes, so that no program has to read sentences for."""

from __future__ import annotations

import copy
import json
import pickle
from typing import Any

import pytest

import translucent as tl
from tests.values.plan_scenes import (
    COLUMNS,
    DIAMOND,
    MILK,
    NO_STORAGE,
    OPEN,
    ORDERED,
    SCENES,
    WINE,
    body,
    scene,
    sheet,
)
from translucent.planning.interfaces import ONE_INTERFACE
from translucent.planning.passes import Note, NoteKind, PassName
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities, RenderPlan

METAL, LAMP = tl.Surface(metallic=1.0), tl.Surface(emissive=(1, 1, 1))
LIT = [tl.PointLight((0, 0, 5), (1, 1, 1))]
TRACED = Capabilities(shader_storage=False, opengl=False)


def plans(of: tl.Scene) -> list[RenderPlan]:
    """By all methods and machines that can render the scene."""
    found = []
    for method in (*COLUMNS, *ORDERED, tl.RayMarched()):
        for machine in (Capabilities(), NO_STORAGE, TRACED):
            try:
                found.append(plan(of, method, machine))
            except tl.InputError:
                continue
    return found


@pytest.mark.parametrize("kind", SCENES)
def test_every_pass_has_a_name_and_every_note_a_kind(kind: str) -> None:
    found = plans(SCENES[kind])
    assert found
    for one in found:
        assert {type(step.name) for step in one.passes} == {PassName}
        notes = (*one.limits, *one.unmodelled)
        assert all(type(note) is Note and type(note.kind) is NoteKind for note in notes)
        assert {step.name for step in one.passes} == {name for name in PassName if one.has(name)}
        assert {note.kind for note in notes} == {kind for kind in NoteKind if one.says(kind)}


@pytest.mark.parametrize(
    ("asked", "method", "machine", "kind"),
    [
        (scene(body(mesh=OPEN)), None, Capabilities(), NoteKind.OPEN_MESH),
        (scene(body()), tl.ThinLayer(), Capabilities(), NoteKind.CLOSED_AS_SHEETS),
        (scene(body()), tl.KBuffer(1), Capabilities(), NoteKind.LAYER_LIMIT),
        (scene(body()), tl.RayMarched(), Capabilities(), NoteKind.STEPS),
        (scene(body()), tl.SignedDepth(anchored=False), Capabilities(), NoteKind.DISTANCE_FROM_CAMERA),
        (scene(body(), body(x=3)), tl.BackFaceDepth(), Capabilities(), NoteKind.SEVERAL_BODIES),
        (scene(body(MILK), lights=LIT), tl.DepthPeeling(), NO_STORAGE, NoteKind.UNLIT),
        (scene(body(MILK), lights=LIT), tl.SignedDepth(), Capabilities(), NoteKind.LIGHTS_LEFT_OUT),
        (scene(body(MILK), lights=LIT), tl.FragmentLists(), Capabilities(), NoteKind.SCATTERED_AGAIN),
        (scene(body(MILK)), tl.FragmentLists(), Capabilities(), NoteKind.ONLY_REMOVES),
        (scene(body(MILK), ambient=(1, 1, 1)), None, Capabilities(), NoteKind.DIMMED_AMBIENT),
        (scene(body(WINE), lights=LIT), None, Capabilities(), NoteKind.UNUSED_LIGHTS),
        (scene(body(DIAMOND)), None, Capabilities(), NoteKind.CUT_OFF_PATHS),
        (scene(body(DIAMOND)), None, TRACED, NoteKind.CUT_OFF_PATHS),
        (scene(sheet(DIAMOND)), None, Capabilities(), NoteKind.LATER_REFRACTION),
        (scene(body(DIAMOND)), tl.ThinLayer(), Capabilities(), NoteKind.LATER_REFRACTION),
        (scene(body(), body(None)), None, Capabilities(), NoteKind.SHADOWS),
        (scene(body(tl.Medium())), None, Capabilities(), NoteKind.INVISIBLE),
        (scene(body(DIAMOND), body(None, OPEN)), None, Capabilities(), NoteKind.REFLECTED_LIGHT),
        (scene(body(DIAMOND), body(None, surface=METAL)), None, Capabilities(), NoteKind.REFLECTED_LIGHT),
        (
            scene(body(DIAMOND), body(None, x=9), body(None, x=5, surface=LAMP)),
            None,
            Capabilities(),
            NoteKind.REFLECTED_LIGHT,
        ),
        (scene(body(MILK), lights=[tl.SphereLight((0, 0, 5), 1.0, 0.5)]), None, Capabilities(), NoteKind.SPHERE_LIGHTS),
        (scene(body(), body(x=3, priority=1)), None, Capabilities(), NoteKind.UNUSED_PRIORITIES),
    ],
    ids=lambda value: value.name if isinstance(value, NoteKind) else "",
)
def test_a_plan_says_what_kind_of_thing_it_leaves_out(
    asked: tl.Scene, method: Any, machine: Capabilities, kind: NoteKind
) -> None:
    assert plan(asked, method, machine).says(kind)
    cavity = scene(body(DIAMOND), body(tl.Medium(), priority=1), body(None), overlap="priority")
    for clean in (scene(sheet()), *([cavity] if kind in (NoteKind.INVISIBLE, NoteKind.REFLECTED_LIGHT) else [])):
        assert not plan(clean, None, Capabilities()).says(kind)


def test_each_way_of_finding_interfaces_tells_what_it_leaves_out() -> None:
    asked = scene(body(DIAMOND))
    left_out = {
        tl.TracedInterfaces(): {NoteKind.CUT_OFF_PATHS},
        tl.ScreenInterfaces(): {NoteKind.LATER_REFRACTION},
        tl.FrontInterface(): {NoteKind.LATER_REFRACTION, ONE_INTERFACE.kind},
    }
    for interfaces, kinds in left_out.items():
        assert {note.kind for note in plan(asked, interfaces=interfaces).unmodelled} == kinds


def test_lights_through_bodies_onto_bodies_are_told_where_no_rays_are_traced() -> None:
    glass, front = body(tl.Medium(ior=1.5), x=3), tl.FrontInterface()
    one, clear = scene(body(DIAMOND), lights=LIT), scene(glass, glass, lights=LIT)
    dimmed = scene(body(DIAMOND), body(WINE, x=3), lights=LIT)
    found = [plan(asked, interfaces=front).says(NoteKind.SHADOWS) for asked in (one, clear, dimmed)]
    assert found == [False, False, True]
    assert not plan(dimmed).says(NoteKind.SHADOWS)
    assert ["straight rays to the lights" in plan(asked).passes[-1].reason for asked in (one, dimmed)] == [False, True]
    assert not plan(dimmed, None, TRACED).says(NoteKind.SHADOWS)
    assert not plan(scene(body(DIAMOND), body(WINE, x=3)), interfaces=front).says(NoteKind.SHADOWS)
    painted = scene(body(DIAMOND, surface=tl.Surface(transmission=0.5)), environment_shadows=8)
    assert plan(painted).says(NoteKind.SHADOWS)
    assert not plan(painted, None, TRACED).says(NoteKind.SHADOWS)


def test_lights_that_shine_on_highlights_or_paint_are_of_use() -> None:
    assert plan(scene(body(WINE), lights=LIT)).says(NoteKind.UNUSED_LIGHTS)
    assert not plan(scene(body(DIAMOND), lights=LIT)).says(NoteKind.UNUSED_LIGHTS)


def test_ambient_light_takes_the_place_of_light_that_is_only_removed() -> None:
    assert not plan(scene(body(MILK), ambient=(1, 1, 1))).says(NoteKind.ONLY_REMOVES)


def test_a_note_is_the_text_that_it_was() -> None:
    note = Note(NoteKind.SHADOWS, "shadows: none")
    assert (note, str(note), hash(note)) == ("shadows: none", "shadows: none", hash("shadows: none"))
    assert type(str(note)) is str
    assert "; ".join((note, "more")) == "shadows: none; more"
    assert note in ("shadows: none",)
    assert note.startswith("shadows")
    assert (repr(note), json.dumps([note])) == ("'shadows: none'", '["shadows: none"]')


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda plan: pickle.loads(pickle.dumps(plan))])
def test_a_plan_keeps_its_kinds_when_it_is_copied(copied: Any) -> None:
    found = plan(scene(body(mesh=OPEN), body(None)))
    again = copied(found)
    assert again == found
    assert [note.kind for note in (*again.limits, *again.unmodelled)] == [NoteKind.OPEN_MESH, NoteKind.SHADOWS]
    assert all(step.name is PassName(step.name.value) for step in again.passes)


def test_the_name_of_a_pass_is_the_word_that_it_was() -> None:
    assert {PassName.SIGNED_DEPTH: 1.0}["signed_depth"] == 1.0  # type: ignore[index]
    assert (repr(PassName.OPAQUE), str(PassName.OPAQUE), f"{PassName.OPAQUE}") == ("'opaque'", "opaque", "opaque")
    assert json.dumps({PassName.OPAQUE: [PassName.LAYERS]}) == '{"opaque": ["layers"]}'


def test_a_plan_has_any_of_the_passes_asked_for() -> None:
    found = plan(scene(body(), body(None)))
    assert found.has(PassName.OPAQUE)
    assert found.has(PassName.BACKDROP, PassName.OPAQUE)
    assert not found.has(PassName.BACKDROP, PassName.SURFACES)
    assert not found.has()


def test_few_texture_units_leave_shadows_on_interfaces_out() -> None:
    glass = body(tl.Medium(absorption=1.0, ior=1.5))
    lit = scene(glass, body(None, x=3), lights=[tl.PointLight((0, 5, 0), (1, 1, 1))])
    texts = [str(note) for note in plan(lit, capabilities=Capabilities(texture_units=16)).unmodelled]
    assert any("in a shader, and this OpenGL allows 16" in text for text in texts)
    assert not any("in a shader" in str(note) for note in plan(lit).unmodelled)
    straight = scene(body(), body(None, x=3), lights=lit.lights)
    found = plan(straight, capabilities=Capabilities(texture_units=16))
    assert not any("in a shader" in str(note) for note in found.unmodelled)
