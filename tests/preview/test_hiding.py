"""Objects hidden, isolated and shown again: in documents, scenes, sessions and recipes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.preview.test_library import two_bodies
from tests.preview.waiting import wait
from translucent.geometry.solids import Box
from translucent.preview.actions import Hide, History, Open, apply
from translucent.preview.document import Document, Orbit
from translucent.preview.exports import Recipe, command_line, python_code
from translucent.preview.scenes import Loaded, material_of, scene_of
from translucent.preview.session import from_table, load_session, save_session, to_table
from translucent.preview.workspace import Workspace
from translucent.scene.showcase import DEFAULT_COLOR, DEFAULT_REACH

SEEN = dataclasses.replace(Document(), orbit=Orbit())


def test_what_is_hidden_is_not_in_the_scene_and_the_others_stay_the_same_objects() -> None:
    loaded = two_bodies()
    whole = scene_of(SEEN, loaded)
    part = scene_of(apply(SEEN, Hide((1,))), loaded)
    assert [id(item) for item in part.objects] == [id(whole.objects[0]), id(whole.objects[2])]
    assert apply(apply(SEEN, Hide((1,))), Open("other.glb")).hidden == ()


def test_hiding_is_a_step_of_undo_and_kept_in_sessions(tmp_path: Path) -> None:
    history = History(SEEN).done(Hide((2, 0))).done(Hide(()))
    assert len(history.past) == 2
    hidden = history.undone().present
    assert hidden.hidden == (0, 2)
    save_session(tmp_path / "a.toml", hidden)
    assert load_session(tmp_path / "a.toml") == hidden
    with pytest.raises(tl.InputError, match=r"give a list of object numbers, such as \[0, 2\]"):
        from_table({**to_table(SEEN), "hidden": [True]}, "session")


def test_an_object_is_isolated_and_the_last_one_is_not_hidden(work: Workspace) -> None:
    states = pytest.importorskip("translucent.preview.window_state", reason="the extra 'ui' is not installed")
    state = states.WindowState(work, None)
    loaded = dataclasses.replace(two_bodies(), model=work.document.model)
    work._keep(loaded)
    state.isolate(1)
    assert work.document.hidden == (0, 2)
    scene = work.scene()
    assert scene is not None
    assert [item.mesh for item in scene.objects] == [loaded.scene.objects[1].mesh]
    found: list[int | None] = []
    state.view = type("View", (), {"viewport": type("Viewport", (), {"size": (48, 32)})})()
    work.frame(1)
    state.pick((0.5, 0.5), found.append)
    wait(work, lambda: bool(found))
    assert found == [1], "its number in the model identifies it"
    state.hide(1)
    assert "no other object is visible" in work.messages[-1].text
    shot = Recipe(work.document, loaded, scene, (48, 32))
    assert "hidden objects" in command_line(shot)[1]
    assert "if i not in [0, 2]" in python_code(shot)
    state.isolate(1)
    assert work.document.hidden == ()
    work.do(Hide((0, 1, 2)))
    assert work.document.hidden == (), "a picture of nothing is none"


def test_a_model_of_opaque_objects_is_filled_with_what_is_seen(tmp_path: Path) -> None:
    """And not with a medium that does nothing: its objects would be invisible."""
    box = Box().tessellate()
    scene = tl.Scene([tl.Object(box)], tl.Camera.look_at((0, 0, 5), (0, 0, 0)))
    loaded = Loaded(Document().model, scene, material_of(scene))
    filled = scene_of(dataclasses.replace(SEEN, material=loaded.material), loaded).objects[0].medium
    assert filled is not None
    left = filled.transmittance(DEFAULT_REACH * scene.diagonal)
    assert np.allclose(left, DEFAULT_COLOR)
