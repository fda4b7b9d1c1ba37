"""Files without the system's dialogs, environments of a folder, and the tips of knobs. No window."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.preview.waiting import wait
from translucent.assets import shader_path
from translucent.planning.flags import Flags
from translucent.preview import library
from translucent.preview.dialogs import Browser
from translucent.preview.document import (
    SURFACE_FIELDS,
    TIPS,
    AddedLight,
    Display,
    Export,
    Look,
    Material,
    Orbit,
    Placed,
    camera_of,
)
from translucent.preview.library import EnvironmentFolder, draw_panorama, model_key, model_picture, panorama_key, title
from translucent.preview.session import Preferences, put_first
from translucent.preview.workspace import Workspace


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.GLB", "a.glb", "c.txt", ".hidden.glb"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "Models").mkdir()
    return tmp_path


@pytest.fixture
def state(work: Workspace) -> Any:
    states = pytest.importorskip("translucent.preview.window_state", reason="the extra 'ui' is not installed")
    return states.WindowState(work, None)


def browser(folder: Path, *, saves: bool = False) -> Browser:
    return Browser("open", "Open", ("*.glb", "*.obj"), saves, folder)


def test_a_folder_lists_folders_first_and_files_of_the_kinds(folder: Path) -> None:
    shown = browser(folder)
    assert [one.name for one in shown.entries()] == ["Models", "a.glb", "b.GLB"]
    shown.every = True
    assert [one.name for one in shown.entries()] == ["Models", "a.glb", "b.GLB", "c.txt"]
    (folder / "d.obj").write_bytes(b"")
    os.utime(folder, (1, 1))
    assert "d.obj" in [one.name for one in shown.entries()], "a file that comes is listed"


def test_a_path_opens_a_file_or_shows_a_folder(folder: Path) -> None:
    shown = browser(folder)
    shown.text = "Models"
    assert shown.accept() is None
    assert shown.folder == folder / "Models"
    shown.text = "../a.glb"
    assert shown.accept() == str(folder / "a.glb")
    shown.text = str(folder / "none.glb")
    assert shown.accept() is None
    assert shown.problem == "none.glb: this file does not exist"
    shown.enter("/no/such/place")
    assert "this folder does not exist" in shown.problem
    assert shown.folder == folder / "Models"
    shown.text = "a\0b"
    assert shown.accept() is None


def test_a_file_is_written_over_only_if_that_is_confirmed(folder: Path) -> None:
    shown = browser(folder, saves=True)
    shown.text = "new"
    assert shown.accept() == str(folder / "new.glb"), "the suffix is added"
    shown.text = "a.glb"
    assert (shown.accept(), shown.button) == (None, "Replace")
    assert shown.accept() == str(folder / "a.glb")
    shown.text = "b.GLB"
    assert shown.button == "Save"
    assert shown.accept() is None, "another file is another question"
    shown.text = "nowhere/b.glb"
    assert shown.accept() is None
    assert "this folder does not exist" in shown.problem


def test_a_folder_that_is_gone_is_told(folder: Path) -> None:
    shown = browser(folder / "gone")
    assert shown.entries() == []
    assert "No such file" in shown.problem


def test_where_there_is_no_dialog_the_browser_asks(state: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from translucent.preview import dialogs

    monkeypatch.setattr(dialogs.shutil, "which", lambda _: None)
    monkeypatch.setattr(dialogs.sys, "platform", "linux")
    state.folders = [str(folder)]
    state.ask_file("save session")
    assert (state.browser.folder, state.browser.text, state.browser.saves) == (folder, "session.toml", True)
    state.answer()
    assert state.browser is None
    assert (folder / "session.toml").is_file()
    state.ask_file("environment")
    state.escape()
    assert state.browser is None
    state.keys_shown, state.selected = True, 0
    state.escape()
    assert (state.keys_shown, state.selected) == (False, 0), "one at a time, what is on top first"
    state.escape()
    assert state.selected is None


def test_environments_of_a_folder(tmp_path: Path, state: Any) -> None:
    for name in ("b.exr", "a.HDR", "c.png", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    shown = EnvironmentFolder()
    assert shown.files() == []
    shown.take(str(tmp_path / "b.exr"))
    assert [Path(path).name for path in shown.files()] == ["a.HDR", "b.exr"]
    (tmp_path / "empty").mkdir()
    shown.take(str(tmp_path / "empty"))
    assert shown.files() == []
    assert "no .hdr or .exr or .pic file" in shown.problem
    shown.take(str(tmp_path / "gone"))
    assert (shown.files(), "No such file" in shown.problem) == ([], True)
    assert (title(""), title("studio"), title(str(tmp_path / "a.HDR"))) == ("own", "studio", "a")
    state.change("look.environment", "studio", step=True)
    assert state.get("look.environment") == "studio"
    state.work.undo()
    assert state.get("look.environment") == ""


def test_folders_are_remembered(tmp_path: Path, own_config: Path) -> None:
    assert Preferences.read() == Preferences()
    found = put_first(str(tmp_path), ["/usr"])
    assert found == [str(tmp_path), "/usr"]
    assert put_first("/usr", found) == ["/usr", str(tmp_path)]
    assert put_first("h", list("abcdefghi")) == list("habcdefg")
    gone = str(tmp_path / "gone")
    Preferences([gone, "/usr"], [*found, gone], str(tmp_path), "night").write()
    assert Preferences.read() == Preferences(["/usr"], found, str(tmp_path), "night")
    Preferences([], [], gone).write()
    assert Preferences.read() == Preferences()


def test_a_model_leaves_a_small_picture(state: Any, folder: Path) -> None:
    class Pictured:
        read = 0

        def current(self) -> Any:
            from contextlib import nullcontext

            return nullcontext()

        @property
        def viewport(self) -> Any:
            return self

        def pixels(self) -> np.ndarray:
            self.read += 1
            return np.full((200, 300, 3), 99, dtype=np.uint8)

    state.view = Pictured()
    state.work.thumbnails.folder = folder / "pictures"
    state._keep_picture()
    assert state.view.read == 0, "the toolkit's own are in no list"
    model = dataclasses.replace(state.work.document.model, path=str(folder / "a.glb"))
    state.work.history = dataclasses.replace(
        state.work.history, present=dataclasses.replace(state.work.document, model=model)
    )
    for _ in range(3):
        state._keep_picture()
    assert state.view.read == 1
    kept = state.work.thumbnails.picture(model_key(str(folder / "a.glb")))
    assert kept.shape == (80, 120, 3)
    assert (folder / "pictures" / f"{model_key(str(folder / 'a.glb'))}.png").is_file()
    assert model_picture(np.zeros((8, 900, 3), dtype=np.uint8)).shape == (80, 120, 3)
    wait(state.work, lambda: True)


def test_every_knob_is_explained() -> None:
    silent = {"material.source", "material.preset", "material.phase"}  # set by presets and sessions
    silent |= {"orbit.target", "orbit.yaw", "orbit.pitch", "orbit.distance"}
    sections = {"material": Material, "look": Look, "display": Display, "flags": Flags, "orbit": Orbit}
    sections |= {"placed": Placed, "light": AddedLight, "export": Export}
    silent.add("placed.object")
    fields = {f"{section}.{one.name}" for section, kind in sections.items() for one in dataclasses.fields(kind)}
    assert set(TIPS) == (fields - silent) | {"model.unit", "model.up", "model.time"}
    for name in ("ior", "color", "distance", "thickness", *SURFACE_FIELDS):
        assert "glTF" in TIPS[f"material.{name}"]
        if name != "color":
            assert "Typical" in TIPS[f"material.{name}"]


@pytest.mark.parametrize("orthographic", [False, True])
def test_the_selected_object_is_marked_where_it_is_seen(orthographic: bool) -> None:
    viewport = pytest.importorskip("translucent.preview.panels.viewport", reason="the extra 'ui' is not installed")
    camera = camera_of(Orbit((0.0, 0.0, 0.0), 0.0, 0.0, 2.0, 90.0, orthographic))
    box = np.array([[-0.5, 0.0, 0.0], [0.5, 1.0, 0.0]])  # at a distance of 2, where the picture is 4 high
    places = viewport.on_screen(camera, box, (400.0, 200.0))
    np.testing.assert_allclose(places.min(axis=0), (175.0, 50.0), atol=1e-9)
    np.testing.assert_allclose(places.max(axis=0), (225.0, 100.0), atol=1e-9)
    if not orthographic:
        assert viewport.on_screen(camera, box + [0.0, 0.0, 3.0], (400.0, 200.0)) is None


def test_the_scale_of_errors_has_the_colors_of_the_picture() -> None:
    viewport = pytest.importorskip("translucent.preview.panels.viewport", reason="the extra 'ui' is not installed")
    text = shader_path("present/compare.frag").read_text()
    for color in (viewport.THINNER, viewport.THICKER):
        assert f"vec3({', '.join(f'{channel:.2f}' for channel in color)})" in text
    assert viewport.error_color(-1.0) == viewport.THINNER
    assert viewport.error_color(0.0) == (0.95, 0.95, 0.95)


def test_of_ten_dropped_files_one_model_and_one_environment_are_taken(state: Any, folder: Path) -> None:
    skies = [folder / f"sky-{i}.hdr" for i in range(4)]
    for path in skies:
        path.write_bytes(b"no picture")
    opened: list[str] = []
    state.work.open = lambda model: opened.append(Path(model.path).name)
    state.take_dropped([str(folder / name) for name in ("a.glb", "b.GLB", *(path.name for path in skies), *"cdef")])
    assert opened == ["a.glb"]
    assert state.get("look.environment") == str(skies[0])
    assert state.environments.files() == [str(path) for path in skies]
    (told,) = state.work.messages
    assert told.text.startswith("8 dropped files are ignored")


def test_of_a_folder_of_500_environments_few_are_read_in_a_frame(
    state: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for i in range(500):
        (tmp_path / f"{i:03}.hdr").write_bytes(b"no picture")
    state.environments.take(str(tmp_path))
    assert len(state.environments.files()) == 500
    monkeypatch.setattr(os, "listdir", lambda _: pytest.fail("the folder has not changed"))
    assert state.environments.files()[-1] == str(tmp_path / "499.hdr")
    cache, read = state.work.thumbnails, list[Path]()
    monkeypatch.setattr(library, "_read", lambda path: read.append(path))
    for _ in range(2):
        cache.begin_frame(idle=False)
        for path in state.environments.files():
            assert cache.picture(panorama_key(path), draw_panorama, path) is None
    assert 0 < len(read) <= 2 * library.READ_AT_ONCE
