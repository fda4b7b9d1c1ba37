"""The library of materials: small pictures, own presets, and materials of single objects. No window."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import wait
from tests.processes import until
from translucent.preview import library
from translucent.preview.actions import Assign, ChoosePreset, History, Open, apply, preset_material
from translucent.preview.document import Document, Material, Orbit
from translucent.preview.exports import Recipe, command_line, python_code
from translucent.preview.library import Library, ThumbnailCache
from translucent.preview.measuring import first_object
from translucent.preview.scenes import Loaded, material_of, medium_of, scene_of
from translucent.preview.session import from_table, load_session, save_session, to_table
from translucent.preview.tasks import Lane
from translucent.preview.workspace import Workspace

PICTURE = np.full((2, 3, 3), 7, dtype=np.uint8)


@pytest.fixture
def lane() -> Iterator[Lane]:
    made = Lane("thumbnails")
    yield made
    made.close()


def settle(cache: ThumbnailCache, ask: Callable[[], Any]) -> Any:
    """Answer of a cache to a request that is made in every frame."""

    def answer() -> Any:
        cache.begin_frame(idle=True)
        cache.lane.poll(print)
        return ask()

    until(lambda: answer() is not None)
    return ask()


def two_bodies() -> Loaded:
    """A model of two bodies and a rock, with the media of a file."""
    ball = tl.Mesh(np.eye(4, 3), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    media = tl.Medium((1, 2, 3)), tl.Medium((4, 5, 6), ior=1.5), None
    objects = [tl.Object(dataclasses.replace(ball), medium) for medium in media]
    scene = tl.Scene(objects, tl.Camera.look_at((0, 0, 9), (0, 0, 0)))
    return Loaded(Document().model, scene, material_of(scene))


def test_a_picture_is_made_once_and_kept_on_disk(lane: Lane, tmp_path: Path) -> None:
    made: list[str] = []

    def make(_: object, name: str) -> np.ndarray:
        made.append(name)
        return PICTURE

    cache = ThumbnailCache(lane, make, tmp_path)
    assert cache.picture("a", "a") is None
    for _ in range(3):
        cache.begin_frame(idle=False)
        assert cache.picture("a", "a") is None
    assert lane.task is None, "while the picture of the window is drawn, no others are"
    np.testing.assert_array_equal(settle(cache, lambda: cache.picture("a", "a")), PICTURE)
    again = ThumbnailCache(lane, make, tmp_path)
    np.testing.assert_array_equal(again.picture("a", "a"), PICTURE)
    assert made == ["a"]


def test_what_nobody_sees_any_more_is_not_made(lane: Lane, tmp_path: Path) -> None:
    cache = ThumbnailCache(lane, lambda _, name: PICTURE, tmp_path)
    cache.picture("seen", "seen")
    cache.begin_frame(idle=False)
    assert cache.busy
    cache.begin_frame(idle=False)
    assert not cache.busy


def test_few_are_read_in_a_frame_and_what_cannot_be_made_has_no_picture(lane: Lane, tmp_path: Path) -> None:
    asked = []

    def fail(_: object, name: str) -> np.ndarray:
        asked.append(name)
        raise tl.InputError("environment 'a.hdr'", "no picture")

    cache = ThumbnailCache(lane, fail, tmp_path)
    (tmp_path / "0.png").write_bytes(b"half")
    for number in range(500):
        cache.picture(str(number), str(number))
    cache.begin_frame(idle=True)
    assert len(cache._queue) == 4, "a folder of 500 files stops no frame"

    def tried() -> bool:
        cache.picture("0", "0")
        cache.begin_frame(idle=True)
        lane.poll(print)
        return "0" in cache._known

    until(tried)
    for _ in range(3):
        assert tried()
        assert lane.task is None, "it is tried once"
    assert asked == ["0"]


def test_a_ball_fills_its_picture_on_the_default_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tl.Scene] = []

    class Recorder:
        def render(self, scene: tl.Scene, size: tuple[int, int], **_: Any) -> Any:
            seen.append(scene)
            return self

        def to_srgb8(self, *_: object) -> np.ndarray:
            return PICTURE

    monkeypatch.setattr(library, "worker_renderer", Recorder)
    assert library.draw_ball(tl.preset("wax")) is not None
    ball, ground = seen[0].objects
    assert (ball.medium, ball.surface.roughness) == (tl.preset("wax").medium, 0.35)  # type: ignore[union-attr]
    assert ground.shadow_catcher
    origins, ways = seen[0].camera.rays((9, 9))
    towards = ball.bounds.mean(axis=0) - origins
    past = np.linalg.norm(np.cross(towards, ways), axis=-1).reshape(9, 9)
    assert (past[4, 1:8] < library.RADIUS).all()
    assert past[0, 0] > library.RADIUS


def test_an_environment_is_drawn_in_all_directions() -> None:
    assert library.draw_panorama("studio").shape == (64, 128, 3)
    assert (library.draw_panorama("#ff0000")[..., 0] > 200).all()
    low, high = library.draw_panorama("light-table")[[-1, 0], 5].astype(int)
    assert (high > low + 20).all(), "the light table is white above"


def test_keys_are_of_the_content() -> None:
    jade = tl.preset("jade")
    assert library.ball_key(jade) == library.ball_key(dataclasses.replace(jade, name="stone", note="another"))
    assert library.ball_key(jade) != library.ball_key(dataclasses.replace(jade, roughness=0.5))


def test_a_material_is_saved_and_found(tmp_path: Path) -> None:
    refused: list[Exception] = []
    own = Library(refused.append, tmp_path / "presets")
    material = dataclasses.replace(preset_material(Material(), "marble"), roughness=0.25, dispersion=0.5)
    path, left_out = own.save("My Marble", material)
    assert (path.name, left_out) == ("my_marble.toml", ["dispersion"])
    found = own.find("my_marble")
    assert found is not None
    assert (found.medium, found.roughness, found.group) == (medium_of(material), 0.25, "own")
    first = next(iter(own.groups().items()))
    assert first == ("popular", [tl.preset(name) for name in ("jade", "wax", "whole_milk", "red_wine", "clear_glass")])
    own.search = "wax"
    assert next(iter(own.groups().values()))[0].name == "wax"
    own.search = "my marb"
    assert list(own.groups()) == ["own"]
    with pytest.raises(tl.InputError, match="a built-in preset already has this name"):
        own.save("Marble", material)
    (tmp_path / "presets" / "bad.toml").write_text('[a]\nkind = "guessed"\n')
    own._checked = -1e9
    assert own.find("my_marble") is not None
    assert "bad.toml', line 1, [a]; the preset has no key" in str(refused[0])
    assert len(refused) == 1


def test_an_object_may_have_a_material_of_its_own(tmp_path: Path) -> None:
    loaded = two_bodies()
    merlot = preset_material(material_of(loaded.scene, 1), "merlot")
    document = apply(dataclasses.replace(Document(), orbit=Orbit()), Assign(1, merlot))
    assert document.own_material(1) == merlot
    assert document.own_material(0) is None
    scene = scene_of(document, loaded)
    media = [item.medium for item in scene.objects]
    assert media == [loaded.scene.objects[0].medium, tl.preset("merlot").medium, None]
    everywhere = scene_of(apply(document, ChoosePreset("honey")), loaded)
    assert [item.medium for item in everywhere.objects][:2] == [tl.preset("honey").medium, tl.preset("merlot").medium]
    save_session(tmp_path / "a.toml", document)
    assert load_session(tmp_path / "a.toml") == document
    assert apply(document, Assign(1, None)).assigned == ()
    assert apply(document, Open("other.glb")).assigned == ()


def test_the_object_under_the_mouse_is_the_first_on_its_ray() -> None:
    ball = tl.Mesh(np.eye(4, 3) - 0.25, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    nearer = np.eye(4)
    nearer[2, 3] = 2.0
    objects = [tl.Object(ball, tl.Medium(1.0)), tl.Object(ball, None, nearer)]
    scene = tl.Scene(objects, tl.Camera.look_at((0, 0, 9), (0, 0, 0)))
    assert first_object(scene, (161, 97), (80, 48)) == 1
    assert first_object(scene, (161, 97), (0, 0)) is None
    assert first_object(dataclasses.replace(scene, objects=objects[:1]), (161, 97), (80, 48)) == 0


def test_a_drag_on_an_object_is_one_step() -> None:
    history = History()
    for roughness in (0.1, 0.2, 0.3):
        history = history.done(Assign(0, Material(roughness=roughness), drag=4))
    assert len(history.past) == 1
    assert history.undone().present == Document()


@pytest.mark.parametrize("entry", [3, {"object": 0}, {"object": -1, "material": {}}, {"object": True, "material": {}}])
def test_a_session_with_half_an_assignment_is_refused(entry: object) -> None:
    table = {**to_table(Document()), "assigned": [entry]}
    with pytest.raises(tl.InputError, match="the entry names no object and no material"):
        from_table(table, "session")


def test_a_preset_on_the_selected_object_leaves_the_others(work: Workspace) -> None:
    states = pytest.importorskip("translucent.preview.window_state", reason="the extra 'ui' is not installed")
    state = states.WindowState(work, None)
    state.select(0)
    state.choose_preset("merlot")
    assert work.document.material.preset == "merlot", "a model of one object has one material"
    work._keep(dataclasses.replace(two_bodies(), model=work.document.model))
    state.select(1)
    state.choose_preset("honey")
    state.change("material.roughness", 0.5)
    assert (state.get("material.roughness"), state.material.preset) == (0.5, "honey")
    assert work.document.own_material(0) is None
    work.undo()
    work.undo()
    assert work.document.assigned == ()
    state.select(None)
    assert state.get("material.preset") == "merlot"
    state.select(1)
    state.choose_preset("no such")
    assert "no preset has this name" in work.messages[-1].text
    wait(work, lambda: True)


def test_a_recipe_says_the_materials_of_single_objects(work: Workspace) -> None:
    loaded = dataclasses.replace(two_bodies(), model=work.document.model)
    names = ("cup", "wine", "cup")
    objects = [
        dataclasses.replace(item, mesh=dataclasses.replace(item.mesh, name=name))
        for item, name in zip(loaded.scene.objects, names, strict=True)
    ]
    loaded = dataclasses.replace(loaded, scene=dataclasses.replace(loaded.scene, objects=objects))
    work._keep(loaded)
    for number in (1, 2):
        work.do(Assign(number, preset_material(Material(), "merlot")))
    scene = work.scene()
    assert scene is not None
    shot = Recipe(work.document, loaded, scene, (48, 32))
    text, left_out = command_line(shot)
    assert "--object wine --preset merlot" in text
    assert left_out == ["the material of object 2"]
    code = python_code(shot)
    assert "[scene.objects[1]])" in code
    assert "if item is scene.objects[2] else item" in code
    compile(code, "recipe", "exec")
