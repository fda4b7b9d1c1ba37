"""Photons in the still picture: the same light at any number, more and more of them, and none while things move."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels, wait
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.passes import caustics as caustics_pass
from translucent.gpu.refinement import PhotonPicture
from translucent.gpu.viewport import Viewport
from translucent.planning import caustics
from translucent.planning.rendered import Treatment
from translucent.planning.request import RenderRequest
from translucent.preview import quality
from translucent.preview.actions import OrbitBy, SetField
from translucent.preview.document import Document, Model
from translucent.preview.exports import write_picture
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace

#: A ball of glass on a floor, under the sun.
GLASS = tl.Object(Sphere().tessellate(32), tl.Medium((0.1, 0.2, 0.4), ior=1.5))
FLOOR = tl.Object(Box((-4.0, -1.2, -4.0), (4.0, -1.1, 4.0)).tessellate(), color=(0.7, 0.7, 0.7))
SUN = tl.DirectionalLight((0.4, -1.0, 0.2), 3.0)
LIT = tl.Scene([GLASS, FLOOR], tl.Camera.look_at((0, 3, 6), (0, -0.5, 0)), [SUN], tl.Environment.constant("#202020"))
ROUND = 1 << 12


@pytest.fixture
def view() -> Iterator[ViewportRenderer]:
    made = ViewportRenderer()
    yield made
    made.close()


@pytest.fixture
def points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Photons are points: their squares are the smaller the more have been followed with them."""
    monkeypatch.setattr(caustics_pass, "neighbors", lambda *given: (3, 6, np.inf))


@pytest.mark.usefixtures("points")
def test_rounds_add_up_to_the_photons_of_one_frame(view: ViewportRenderer) -> None:
    """Energy is right in few or many; all in one step are the same photons, and the picture is drawn in parts."""
    plan = view.renderer.plan(LIT, caustics=tl.Caustics(ROUND))
    with view.current():
        viewport = Viewport(view.renderer.gpu)
        viewport.resize(SIZE)
        light = PhotonPicture(view.renderer.gpu, plan, viewport.size)
        errors, lights = [], []
        for rounds in (4, 8, 16):
            while light.rounds < rounds:
                light._at_once = 4
                light.step(0.0)
            light.show()
            errors.append(light.error)
            lights.append(light._before[1])
        assert light.photons == 16 * ROUND
        whole = PhotonPicture(view.renderer.gpu, plan, viewport.size)
        whole._at_once = 16
        whole.step(0.0)
        whole.show()
        lights.append(whole._before[1])
        for _ in range(4):
            viewport.step(0, plan, 2, photons=whole.texture)
        side = viewport._side(0, SIZE)
        kept = np.frombuffer(side.light.read(components=4, dtype="f4"), np.float32).reshape(SIZE[1], SIZE[0], 4)
        place = [side.kept(x, y) for y in range(SIZE[1]) for x in range(SIZE[0])]
        shown = np.array([kept[y, x, :3] for x, y in place]).reshape(SIZE[1], SIZE[0], 3)
        assert viewport.mean_radiance() == pytest.approx(shown.mean(), rel=1e-5)
        frame = view.renderer.render(LIT, SIZE, caustics=tl.Caustics(16 * ROUND))
        light.release()
        whole.release()
        viewport.release()
    # What is seen through glass is looked up in each part of the picture; silhouettes may fall to either side.
    off = np.abs(shown - frame.radiance) > 1e-5 + 1e-4 * frame.radiance
    assert off[~frame.coverage].mean() < 1e-3
    means = [values.mean(dtype=np.float64) for values in lights]
    assert means[0] > 0
    np.testing.assert_allclose(means, means[-1], rtol=0.02)  # 16,384 photons: 1 / sqrt(n) of them is 0.8 %
    assert errors[0] == np.inf
    assert np.inf > errors[1] > errors[2] > 0
    truth = float(np.sqrt(np.square(lights[1] - lights[2], dtype=np.float64).mean()))
    assert errors[2] == pytest.approx(truth, rel=1e-6)


@pytest.mark.usefixtures("points")
def test_photons_light_the_still_picture_until_something_changes(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {"ROUND": ROUND, "MOST_PHOTONS": 8 * ROUND, "SHARE": 0.0}.items():
        monkeypatch.setattr(quality, name, value)
    assert work.loaded is not None
    monkeypatch.setattr(work, "scene", lambda: LIT)
    finish(view, work)
    without = pixels(view)
    work.do(SetField("display.caustics", True))
    told = []
    while view.draw(work, SIZE):
        told.append(view.photons.note)
    told.append(view.photons.note)
    assert view.problem == ""
    assert any(text.startswith("caustics: not in the picture yet; ") for text in told)
    # Two pictures tell the noise; a quick machine follows all these photons for the first.
    pictures = {text.split(" photons")[0] for text in told if "photons in the picture" in text}
    assert any("photons in the picture, standard error" in text for text in told) or len(pictures) == 1
    assert view.photons.note.startswith(f"caustics: {view.photons.light.photons:,} photons in the picture")  # type: ignore[union-attr]
    count = view.photons.light.photons  # type: ignore[union-attr]
    with view.current():
        frame = view.renderer.render(LIT, SIZE, caustics=tl.Caustics(count))
    # Photons are as evenly divided between reflection and refraction in each step: the noise is another one.
    assert np.abs(pixels(view) - frame.to_srgb8().astype(int))[~frame.coverage].mean() < 0.5
    assert np.abs(pixels(view) - without).mean() > 0.5
    work.do(SetField("display.caustics", False))
    finish(view, work)
    assert view.photons.note == ""
    assert (np.abs(pixels(view) - without)[~frame.coverage] > 1).mean() < 2e-3


def test_what_has_no_caustics_says_why_and_keeps_its_picture(view: ViewportRenderer, work: Workspace) -> None:
    work.do(SetField("display.antialias", True))
    work.do(SetField("display.caustics", True))
    finish(view, work)
    assert view.photons.note.startswith("no caustics; the scene has no lights")
    assert view.viewport.steps(0) > view._strides.of[0] ** 2  # edges become smooth all the same
    work.do(OrbitBy(10.0, 0.0))
    assert view.draw(work, SIZE)
    work.do(SetField("display.mode", "thickness"))
    finish(view, work)
    assert view.photons.note == ""


def test_files_have_the_photons(tmp_path: Path) -> None:
    photons = tl.Caustics(ROUND)
    write_picture(str(tmp_path / "a.png"), LIT, (32, 24), request=RenderRequest(caustics=photons))
    with tl.Renderer() as renderer:
        frame = renderer.render(LIT, (32, 24), samples=16, caustics=photons)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), frame.to_srgb8())


def test_a_model_on_a_stage_is_measured_without_it() -> None:
    from translucent.preview.measuring import straight

    made = Workspace(Document(Model("sphere")))
    wait(made, lambda: made.loaded is not None)
    assert made.loaded is not None
    seen = straight(tl.staged(made.loaded.scene, "night"))
    made.close()
    assert len(seen.objects) == 1
    assert seen.environment_shadows == 0


def test_photons_in_media_are_followed_aside(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before others; with nothing that these could land on, the picture is one without rounds."""
    if not view.renderer.gpu.capabilities.shader_storage:
        pytest.skip("this OpenGL has no shader storage buffers, without which nothing marches")
    monkeypatch.setattr(caustics, "LEAST_IN_MEDIA", 1 << 10)
    monkeypatch.setattr(quality, "ROUND", 1 << 10)
    fog = tl.Object(Box((-1.5, -3.0, -1.5), (1.5, -1.2, 1.5)).tessellate(), tl.Medium(scattering=0.5))
    scene = replace(LIT, objects=[tl.Object(Sphere().tessellate(16), tl.Medium(ior=1.5)), fog])
    found, lane = quality.PhotonRefinement(), work.lanes["diffuse"]

    def ready() -> bool:
        request = RenderRequest(scattering=tl.Diffusion(8))
        return found.ready(work, scene, view.renderer, view.viewport, request, 0.1, 0.0)

    with view.current():
        assert not ready()
        assert found.note == "caustics: tracing photons in media"
        assert found.show_media(view.viewport) is None
        wait(work, lambda: lane.task is None)
        assert not ready()
        assert found.note == "caustics: 1,024 photons in media"
        shown = found.show_media(view.viewport)
        assert shown is not None
        assert shown.treated(Treatment.VOLUME) == (1,)
        assert found.show_media(view.viewport) is None
        assert found.stop(view.viewport)
    assert found.note == ""
