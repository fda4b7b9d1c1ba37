"""The stage in the window: as render draws it, kept while other things change, and out of the way of quantities."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels, wait
from translucent.cli import main
from translucent.frames.animation import on_stage
from translucent.gpu.passes import shadow_maps
from translucent.gpu.shaders import PostponedError
from translucent.planning.request import RenderRequest
from translucent.preview import quality
from translucent.preview.actions import ChoosePreset, OrbitBy, SetField
from translucent.preview.document import AUTO, Document, Look, Model, framed, orbit_of
from translucent.preview.exports import Recipe, command_line, python_code
from translucent.preview.scenes import request_of, stage_name, tone_of
from translucent.preview.session import Preferences, load_session, save_session
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace
from translucent.scene import stages
from translucent.scene.showcase import framing
from translucent.scene.stages import stage_named

SMALL = (48, 32)


@pytest.fixture(autouse=True)
def few_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without a GPU takes a while for 128 maps."""
    monkeypatch.setattr(stages, "ENVIRONMENT_SHADOWS", 16)


@pytest.fixture
def staged() -> Iterator[Workspace]:
    """A workspace whose ball stands in the studio."""
    made = Workspace(Document(Model("sphere"), look=Look(stage=AUTO)))
    made.size = SIZE
    wait(made, lambda: made.loaded is not None)
    made.prepare()
    wait(made, lambda: on_stage(made.scene()))  # type: ignore[arg-type]
    yield made
    made.close()


def shot(work: Workspace) -> Recipe:
    scene = work.picture()
    assert scene is not None
    assert work.loaded is not None
    return Recipe(work.document, work.loaded, scene, SMALL)


def plain(work: Workspace) -> tl.Scene:
    """The scene on show without interfaces, which is quick to draw."""
    scene = work.scene()
    assert scene is not None
    ball, ground = scene.objects
    return dataclasses.replace(scene, objects=[dataclasses.replace(ball, medium=tl.Medium((50.0, 20.0, 40.0))), ground])


def test_a_stage_comes_after_the_first_picture_and_stays(staged: Workspace, tmp_path: Path) -> None:
    waiting = Workspace(Document(Model("sphere"), look=Look(stage="studio")))
    wait(waiting, lambda: waiting.loaded is not None)
    scene = waiting.scene()
    assert scene is not None
    assert not on_stage(scene), "the first picture waits for no stage"
    assert waiting.document.material.ior == 1.0
    waiting.close()

    first = staged.scene()
    assert first is not None
    assert (staged.document.material.ior, tone_of(staged.document.look, first)) == (1.5, "neutral")
    for action in (OrbitBy(30.0, 5.0), ChoosePreset("merlot"), SetField("material.ior", 1.4)):
        staged.do(action)
        scene = staged.scene()
        assert scene is not None
        assert scene.objects[-1] is first.objects[-1], "the ground is the same one"
        assert (scene.lights, scene.environment) == (first.lights, first.environment)
    staged.do(SetField("look.stage", "none"))
    assert not on_stage(staged.scene())  # type: ignore[arg-type]
    staged.undo()
    assert on_stage(staged.scene())  # type: ignore[arg-type]
    assert staged.document.material.ior == 1.4
    save_session(tmp_path / "a.toml", staged.document)
    assert load_session(tmp_path / "a.toml") == staged.document


@pytest.mark.parametrize(("field", "value"), [("display.mode", "thickness"), ("display.compare", "error")])
def test_quantities_are_those_of_the_model_alone(staged: Workspace, field: str, value: str) -> None:
    staged.do(SetField(field, value))
    scene = staged.scene()
    assert scene is not None
    assert not on_stage(scene)
    assert scene.environment_shadows == 0
    assert on_stage(staged.picture())  # type: ignore[arg-type]


def test_auto_is_what_render_takes(staged: Workspace) -> None:
    look, loaded = Look(stage=AUTO), staged.loaded
    assert loaded is not None
    assert stage_name(look, loaded) == "studio"
    for own in ({"environment": "studio"}, {"background": "#ffffff"}, {"stage": "none"}):
        assert stage_name(dataclasses.replace(look, **own), loaded) == "none"
    lit = dataclasses.replace(loaded, scene=dataclasses.replace(loaded.scene, lights=[tl.PointLight((0, 1, 0), 1.0)]))
    assert stage_name(look, lit) == "none"
    seen = orbit_of(framing(loaded.scene.objects, SIZE, stage=stage_named("studio")), loaded.scene.bounds.mean(axis=0))
    assert staged.document.orbit == framed(seen, loaded.scene.objects, SIZE), "as F frames it, from where render looks"


def test_the_picture_is_the_one_that_render_makes(staged: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the shadow maps of a window: those of large pictures, so that they stay when it grows or the eye comes near.

    Render chooses the same ones for a picture of a usual window, and smaller ones only where less can be seen.
    """
    monkeypatch.setattr(quality, "STRIDES", (1, 1, 1))  # parts of a picture see the ground's texture more blurred
    view = ViewportRenderer()
    staged.do(SetField("display.antialias", False))
    finish(view, staged)
    scene = staged.scene()
    assert scene is not None
    with view.current():
        frame = view.renderer.render(scene, SIZE, shadows=tl.ShadowMaps())
        large = view.renderer.plan_requested(scene, dataclasses.replace(request_of(staged.document), pixels=960 * 720))
    assert view.plans[0] is not None
    assert view.plans[0].shadows == large.shadows == tl.ShadowMaps()
    assert np.abs(pixels(view) - frame.to_srgb8(0.0, "neutral").astype(int)).max() <= 1
    staged.do(OrbitBy(20.0, 0.0))
    view.draw(staged, SIZE)
    assert view.simpler
    assert view._moving is not None
    assert view._moving.shadows.directions == 8
    assert view.state.startswith("moving")
    staged.do(SetField("look.rotation", 20.0))  # which takes new maps
    view.draw(staged, SIZE)
    assert view._moving.shadows.directions == 4
    view.close()


def test_maps_that_take_several_frames_are_those_of_one(staged: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shadow maps drawn four at once equal maps drawn all at once. Every fourth request ends a frame."""
    scene, asked = plain(staged), 0
    with tl.Renderer() as renderer:
        expected = renderer.render(scene, SMALL).radiance

    def impatient(*_: object) -> None:
        nonlocal asked
        asked += 1
        if asked % 4 == 0:
            raise PostponedError(None)

    monkeypatch.setattr(shadow_maps, "before_making", impatient)
    monkeypatch.setattr(shadow_maps, "_AT_ONCE", 4)
    with tl.Renderer() as renderer:
        for _ in range(10):
            try:
                found = renderer.render(scene, SMALL).radiance
                break
            except PostponedError:
                continue
    # By a light and all directions; the light's map, and those of 11 directions above the ground in three portions.
    seen, drawn = 1 + scene.environment_shadows, 1 + 3
    assert asked == seen + drawn + 6, "once for what each sees and for each portion, and 6 frames that ended early"
    np.testing.assert_array_equal(found, expected)


def test_few_directions_are_as_bright_as_all(staged: Workspace) -> None:
    scene = plain(staged)
    with tl.Renderer() as renderer:
        every, few = (renderer.render(scene, SMALL, shadows=tl.ShadowMaps(directions=n)).radiance for n in (None, 4))
        painted = renderer.render(dataclasses.replace(scene, environment_shadows=0), SMALL).radiance
    open_ground = np.abs(every - painted).max(axis=2) < 1e-6
    assert open_ground.mean() > 0.1
    # But where a shadow of one of the few falls on what those of all spare.
    assert np.isclose(few[open_ground], every[open_ground], rtol=1e-5).mean() > 0.95
    assert np.abs(few - every).max() > 1e-3
    with pytest.raises(tl.InputError, match="ShadowMaps directions 0"):
        tl.ShadowMaps(directions=0)


class Drawn:
    """Frame that is none, and knows how it is saved."""

    def save(self, path: str, exposure: float, tone: str) -> None:
        saved.add((str(path), exposure, tone))


drawn: list[tuple[tl.Scene, tuple[int, int], int]] = []
saved: set[tuple[str, float, str]] = set()


@pytest.fixture
def told_only(monkeypatch: pytest.MonkeyPatch, in_tmp_path: Path, tmp_path: Path) -> None:
    """Pictures are not drawn, but taken down."""
    drawn.clear()
    saved.clear()

    def render(_: tl.Renderer, scene: tl.Scene, size: tuple[int, int], **ways: int) -> Drawn:
        drawn.append((scene, size, ways["samples"]))
        return Drawn()

    def render_requested(
        renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int], request: RenderRequest, **_: object
    ) -> Drawn:
        return render(renderer, scene, size, samples=request.samples)

    monkeypatch.setattr(tl.Renderer, "render", render)
    monkeypatch.setattr(tl.Renderer, "render_requested", render_requested)


def assert_alike(scene: tl.Scene, expected: tl.Scene) -> None:
    """Assert that scenes show the same, but for the rounding of numbers in texts."""
    np.testing.assert_allclose(scene.camera.pose, expected.camera.pose, rtol=1e-9, atol=1e-9)
    assert (scene.camera.fov_y, scene.camera.height) == pytest.approx((expected.camera.fov_y, expected.camera.height))
    assert len(scene.objects) == len(expected.objects)
    for item, other in zip(scene.objects, expected.objects, strict=True):
        np.testing.assert_allclose(item.bounds, other.bounds, rtol=1e-9)
        assert (item.medium is None, item.shadow_catcher) == (other.medium is None, other.shadow_catcher)
        if item.medium is not None and other.medium is not None:
            np.testing.assert_allclose(item.medium.extinction, other.medium.extinction, rtol=1e-9)
            assert item.medium.ior == other.medium.ior
            one, two = item.surface or tl.Surface(), other.surface or tl.Surface()
            assert (one.roughness, one.dispersion, one.opacity) == (two.roughness, two.dispersion, two.opacity)
    assert len(scene.lights) == len(expected.lights)
    for light, other in zip(scene.lights, expected.lights, strict=True):
        np.testing.assert_allclose(light.direction, other.direction, atol=1e-7)
        np.testing.assert_allclose(light.irradiance, other.irradiance)
    assert scene.environment.map is expected.environment.map
    assert scene.environment.rotation == pytest.approx(expected.environment.rotation, abs=1e-5)
    assert scene.environment_shadows == expected.environment_shadows
    np.testing.assert_array_equal(scene.environment.seen.mean, expected.environment.seen.mean)


@pytest.mark.usefixtures("told_only")
def test_recipes_make_the_same_picture(staged: Workspace, capsys: pytest.CaptureFixture[str]) -> None:
    for action in (OrbitBy(40.0, 5.0), SetField("look.rotation", 30.0), SetField("look.exposure", 0.5)):
        staged.do(action)
    told = shot(staged)
    command, left_out = command_line(told)
    assert left_out == []
    assert "--stage studio,-10 --exposure 0.5 --tone neutral" in command
    main(shlex.split(command)[1:])
    exec(python_code(told), {})
    assert len(drawn) == 2
    for scene, size, samples in drawn:
        assert (size, samples) == (SMALL, 16)
        assert_alike(scene, told.scene)
    assert saved == {("sphere.png", 0.5, "neutral")}
    capsys.readouterr()


@pytest.mark.usefixtures("told_only")
def test_what_no_option_says_is_told_and_python_says_it(staged: Workspace) -> None:
    changes = {"look.stage": "none", "material.ior": 1.3, "material.color": [0.2, 0.5, 0.6], "material.dispersion": 0.5}
    changes |= {"look.light": True, "orbit.orthographic": True, "look.background": "#204060"}
    for name, value in changes.items():
        staged.do(SetField(name, value))
    told = shot(staged)
    words, left_out = command_line(told)
    assert " --ior 1.3 " in words
    assert left_out == ["dispersion", "the orthographic camera", "the directional light"]
    exec(python_code(told), {})
    assert_alike(drawn[0][0], told.scene)


def test_the_last_stage_is_remembered(tmp_path: Path, own_config: Path) -> None:
    assert Preferences.read().stage == AUTO
    Preferences(stage="night").write()
    assert Preferences.read().stage == "night"
    (tmp_path / "translucent" / "stage.txt").write_text("moon")
    assert Preferences.read().stage == AUTO


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("preview", "leaf", "--stage", "studo"), "did you mean studio"),
        (("render", "leaf", "-o", "a.png", "--stage", "studio,left"), "'left' is not a number of degrees"),
        (("render", "leaf", "-o", "a.png", "--stage", "studio,inf"), "the angle must be finite"),
    ],
)
def test_stages_that_are_none_are_refused(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(list(arguments)) == 2
    assert message in capsys.readouterr().err


def test_quick_shadows_need_no_more_maps_than_they_read(staged: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """Maps of all directions above the ground, if these are there; else of a few: environments can be turned.

    One of the four directions of quick shadows is below the ground, and has no map.
    """
    scene, every, quick, made = plain(staged), tl.ShadowMaps(), tl.ShadowMaps(directions=4), []
    add_up = shadow_maps.ShadowMapsPass._add_up
    monkeypatch.setattr(
        shadow_maps.ShadowMapsPass, "_add_up", lambda it, job: made.extend(job._views) or add_up(it, job)
    )
    turned = dataclasses.replace(scene, environment=dataclasses.replace(scene.environment, rotation=70.0))
    with tl.Renderer() as renderer:
        pictures = []
        for shown, shadows, count in (
            (scene, quick, 3),
            (scene, quick, 0),
            (scene, every, 11),
            (scene, quick, 0),
            (turned, quick, 3),
            (turned, every, 11),
        ):
            made.clear()
            pictures.append(renderer.render(shown, SMALL, shadows=shadows).radiance)
            assert len(made) == count
    np.testing.assert_allclose(pictures[3], pictures[0], rtol=1e-4, atol=1e-6)
