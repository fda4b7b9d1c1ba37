"""Scenes and frames in notebooks: what they show, in words as well; the widget's traits, in both directions."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from translucent.formulas.color import to_hex
from translucent.notebook import view as showing

BOX = trimesh.creation.box((0.02, 0.02, 0.02))
WINE = tl.Medium.from_color((0.2, 0.05, 0.1), 0.01)
SIZE = (48, 36)


@pytest.fixture
def scene() -> tl.Scene:
    return tl.showcase(tl.Mesh(BOX.vertices, BOX.faces, name="box"), WINE, SIZE, stage="none")


@pytest.fixture(autouse=True)
def one_renderer(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(showing, "_renderer", lambda: renderer)


def pictures(text: str) -> list[tuple[Image.Image, str]]:
    """Pictures of HTML, each with the text in its place."""
    found = re.findall(r'<img src="data:image/png;base64,([^"]+)" alt="([^"]+)"', text)
    assert text.count("<img") == len(found)
    return [(Image.open(io.BytesIO(base64.b64decode(data))), alt) for data, alt in found]


# Pictures


def test_a_frame_shows_its_picture_and_its_thickness_with_a_scale(scene: tl.Scene, renderer: tl.Renderer) -> None:
    frame = renderer.render(scene, SIZE, samples=1)
    data, metadata = frame._repr_mimebundle_()
    assert data["text/plain"] == repr(frame)
    (picture, said), (thickness, lengths) = pictures(data["text/html"])
    np.testing.assert_array_equal(np.asarray(picture), frame.to_srgb8())
    assert thickness.width == SIZE[0]
    assert thickness.height > SIZE[1]  # the scale
    covered = f"{frame.coverage.mean():.0%}"
    most = f"{1000 * frame.thickness.max():.3g} mm at most"
    for alt in (said, lengths, data["text/html"]):
        assert f"48 x 36 pixels; media cover {covered}" in alt
        assert most in alt
    assert base64.b64decode(data["image/png"]) == frame._repr_png_()
    assert metadata["image/png"]["alt"] == said
    assert frame._repr_html_() == data["text/html"]


def test_a_scene_shows_a_small_picture_once_and_says_what_it_took(
    scene: tl.Scene, renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, metadata = scene._repr_mimebundle_()
    ((picture, said),) = pictures(data["text/html"])
    assert picture.size == showing.SIZE
    assert np.ptp(np.asarray(picture)) > 50
    assert re.search(r"240 x 180 pixels, 1 sample, drawn in \d+\.\d s by \w+</figcaption>", data["text/html"])
    wine = f"box: white light is {to_hex(WINE.transmittance(0.02 / 3))} after 6.67 mm, ior 1"
    for text in (said, data["text/plain"], data["text/html"], metadata["image/png"]["alt"]):
        assert wine in text
    monkeypatch.setattr(showing, "_renderer", None)
    assert scene._repr_html_() == data["text/html"]  # and is not drawn again


def test_what_would_take_long_is_told_and_not_drawn(scene: tl.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(showing, "_renderer", None)
    monkeypatch.setattr(showing, "MANY_TRIANGLES", 11)
    data, metadata = scene._repr_mimebundle_()
    assert (set(data), metadata) == ({"text/plain", "text/html"}, {})
    assert "No picture, because it has 0.0 million triangles; use renderer.render(scene, size)." in data["text/html"]


def test_where_nothing_draws_it_says_why(scene: tl.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> tl.Renderer:
        raise tl.RenderError("rendering", "no <driver>", "install one")

    monkeypatch.setattr(showing, "_renderer", fail)
    assert "No picture: rendering; no &lt;driver&gt;; install one" in scene._repr_html_()


# The widget


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module that stands for the viewer, which these tests do not run."""
    from translucent.notebook import view

    path = tmp_path / "widget.js"
    path.write_text("export default { render() {} };")
    monkeypatch.setattr(view, "web_path", lambda name: path)
    return path


@pytest.fixture(scope="module")
def data() -> bytes:
    """Data of the scene for the browser, made once."""
    from translucent.page.payload import payload
    from translucent.page.plans import plan_page

    scene = tl.showcase(tl.Mesh(BOX.vertices, BOX.faces, name="box"), WINE, SIZE, stage="none")
    return payload(plan_page(scene), "box", SIZE, 1, 0.0, "none")


@pytest.fixture
def view(scene: tl.Scene, script: Path, data: bytes, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra notebook)")
    monkeypatch.setattr("translucent.notebook.view.payload", lambda *_: data)
    made = tl.view(scene, SIZE)
    yield made
    made.close()


def test_the_widget_brings_all_that_the_browser_needs(view: Any, script: Path) -> None:
    state = view.get_state()
    assert state["_esm"] == script.read_text()
    assert state["_payload"][:2] == b"\x1f\x8b"
    assert state["_height"] == SIZE[1]
    assert state["_label"].startswith("Interactive view of a scene of 1 objects")
    (told,) = state["_media"]
    assert set(told) == {"extinction", "ior", "roughness", "distance"}
    assert told["extinction"] == pytest.approx(WINE.extinction)
    assert view.media == ("box",)
    np.testing.assert_allclose(
        WINE.transmittance(view.distance), tl.Medium.from_color(view.color, 1).transmittance(1), atol=0.01
    )


def test_the_material_is_in_the_state_that_marimo_shows_as_a_value(view: Any) -> None:
    def shown() -> list[Any]:
        state = view.get_state()
        return [state[name] for name in ("medium", "color", "distance", "ior", "roughness", "preset")]

    assert shown() == [0, view.color, view.distance, 1.0, 0.0, None]
    view.preset = "whisky"
    whisky = tl.preset("whisky")
    assert shown()[3:] == [whisky.medium.ior, whisky.roughness, "whisky"]
    # A change in the browser, where only what is kept of each medium comes from.
    view.set_state({"_media": [{**view._media[0], "ior": 1.7}]})
    assert shown()[3:] == [1.7, whisky.roughness, None]


def test_a_view_of_a_preset_that_hardly_scatters_has_its_name_and_keeps_its_scene(script: Path) -> None:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra notebook)")
    merlot = tl.preset("merlot").medium
    assert merlot.scatters
    scene = tl.showcase(
        tl.Mesh(BOX.vertices, BOX.faces, name="box"), merlot, SIZE, lights=[tl.DirectionalLight((0, -1, 0), 1)]
    )
    made = tl.view(scene, SIZE)
    assert made.preset == "merlot"
    assert made.scene.objects[0].medium is merlot
    made.ior = 1.5
    assert made.preset is None
    assert made.scene.objects[0].medium == tl.Medium(merlot.extinction, ior=1.5)
    made.close()


def test_a_material_of_python_goes_to_the_browser(view: Any) -> None:
    view.set_material(color=(0.3, 0.5, 0.9), distance=0.02, ior=1.3, roughness=0.25)
    (told,) = view.get_state("_media")["_media"]
    assert told["extinction"] == pytest.approx(-np.log([0.3, 0.5, 0.9]) / 0.02, rel=1e-12)
    assert (told["ior"], told["roughness"], told["distance"]) == (1.3, 0.25, 0.02)
    view.distance = 0.04  # the color stays, and the medium thins
    assert view._media[0]["extinction"] == pytest.approx(-np.log([0.3, 0.5, 0.9]) / 0.04, rel=1e-12)
    view.color = "#7b1e3a"
    assert view.color == "#7b1e3a"
    view.preset = "whisky"
    whisky = tl.preset("whisky").medium
    assert view._media[0]["extinction"] == pytest.approx(whisky.extinction)
    assert (view.ior, view.preset) == (whisky.ior, "whisky")
    view.roughness = 0.5
    assert view.preset is None


def test_a_material_of_the_browser_comes_to_python(view: Any) -> None:
    heard: list[str] = []
    view.observe(lambda change: heard.append(change["name"]), ["color", "ior", "camera"])
    sigma = [100.0, 200.0, 300.0]
    view.set_state({"_media": [{"extinction": sigma, "ior": 1.5, "roughness": 0.5, "distance": 0.01}]})
    assert sorted(heard) == ["color", "ior"]
    assert (view.ior, view.roughness, view.distance) == (1.5, 0.5, 0.01)
    np.testing.assert_allclose(
        tl.Medium.from_color(view.color, 0.01).extinction, sigma, rtol=0.05
    )  # as near as eight bits
    assert view._media[0]["extinction"] == sigma  # and no echo
    (body,) = view.scene.objects
    assert body.medium.extinction.tolist() == sigma
    assert (body.medium.ior, body.surface.roughness) == (1.5, 0.5)


def test_the_camera_is_one_in_both_directions(view: Any, scene: tl.Scene) -> None:
    assert view.camera is scene.camera
    assert view.scene.objects == scene.objects  # nothing has changed
    told = {"eye": [0.1, 0.0, 0.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0]}
    view.set_state({"_camera": told})
    assert view.camera.forward == pytest.approx([-1, 0, 0])
    assert view.camera.fov_y == scene.camera.fov_y
    assert view._camera == told
    view.camera = tl.Camera.look_at((0, 0, 0.2), (0, 0, 0), fov_y=30.0)
    assert view.get_state("_camera")["_camera"]["eye"] == pytest.approx([0, 0, 0.2])
    assert view.get_state("_camera")["_camera"]["target"] == pytest.approx([0, 0, 0])
    assert view.scene.camera is view.camera


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("ior", 3.5, "ior 3.5; the value must be in 1 to 3"),
        ("roughness", -1, "roughness -1; the value must be in 0 to 1"),
        ("distance", 0, "distance 0; the value must be above 0 and finite"),
        ("color", "#12", "color '#12'"),
        ("color", (2, 0, 0), "a channel of the color is outside 0..1"),
        (
            "preset",
            "wax",
            "preset 'wax' in a view; this preset scatters or emits light, but a view supports only media that absorb",
        ),
        ("preset", "vine", "vine"),
        ("medium", 1, "medium 1; the scene has 1"),
    ],
)
def test_wrong_values_are_refused_and_change_nothing(view: Any, name: str, value: Any, told: str) -> None:
    before = view.get_state("_media")
    with pytest.raises(tl.InputError, match=re.escape(told)):
        setattr(view, name, value)
    assert view.get_state("_media") == before


def test_a_medium_that_the_viewer_keeps_is_told(script: Path, data: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra notebook)")
    from translucent.notebook import view as module

    told = [{"extinction": [51, 51, 51], "ior": 1, "roughness": 0, "distance": 0.01, "preset": ""}] * 2
    monkeypatch.setattr(module, "payload", lambda *_: data)
    monkeypatch.setattr(module, "header_of", lambda _: {"scene": {"media": told}})
    mesh, moved = tl.Mesh(BOX.vertices, BOX.faces, name="box"), trimesh.transformations.translation_matrix((0.1, 0, 0))
    milk = tl.Object(mesh, medium=tl.Medium(absorption=1, scattering=50), transform=moved)
    view = tl.view(tl.Scene([tl.Object(mesh, medium=WINE), milk], tl.Camera.look_at((0, 0, 1), (0, 0, 0))), SIZE)
    view.color = "#7b1e3a"
    assert view._media[0] != told[0]
    assert view._media[1] == {key: told[1][key] for key in view._media[1]}
    view.medium = 1
    assert view.color == to_hex(tl.Medium(absorption=51).transmittance(0.01))
    with pytest.raises(tl.InputError, match=r"medium 1 of a view; This medium scatters light"):
        view.color = "#7b1e3a"
    view.close()


def test_what_is_missing_is_named(scene: tl.Scene, script: Path, uninstalled: Callable[[str], None]) -> None:
    uninstalled("anywidget")
    with pytest.raises(
        tl.InputError, match=r"anywidget is not installed; pip install 'translucent-shading\[notebook\]'"
    ):
        tl.view(scene)
