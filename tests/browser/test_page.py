"""Pages of `translucent page` in headless Chromium, opened from disk, against the renderer with the same choices."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

import translucent as tl
from tests.browser.pages import WebPage, decoded
from tests.browser.thickness import Truth, framing, rounded
from translucent.assets import mesh_path
from translucent.formulas.color import to_hex
from translucent.formulas.diffuse_interface import half_space_reflectance
from translucent.page.albedos import with_albedo
from translucent.scene.showcase import with_roughness

SIZE = (160, 100)

#: Root mean square error over mean radiance that a page may have.
BAR = 1e-3

_READ = """async ({ size, samples }) => {
  const viewer = await translucent;
  return encoded(viewer.render({ size, samples }));
}"""


@pytest.fixture(scope="module")
def renderer() -> Iterator[tl.Renderer]:
    with tl.Renderer() as made:
        yield made


@pytest.fixture(scope="module")
def tools() -> str:
    return """globalThis.encoded = (values) => {
      const bytes = new Uint8Array(values.buffer);
      let text = "";
      for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
      return btoa(text);
    };"""


def radiance(page: WebPage, size: tuple[int, int] = SIZE, samples: int = 16) -> npt.NDArray[np.float64]:
    text = page.run(_READ, {"size": size, "samples": samples})
    return decoded(text, "f4").reshape(size[1], size[0], 4)[..., :3].astype(np.float64)


def error(found: npt.NDArray[np.float64], frame: tl.Frame) -> float:
    """Root mean square error over mean radiance.

    SwiftShader puts vertices down on 1/16 of a pixel, OpenGL here on 1/256: pixels at outlines cover a little more or
    less, by whatever bent rays make of it.
    """
    return float(np.sqrt(np.square(found - frame.radiance).mean()) / frame.radiance.mean())


def ball(medium: tl.Medium, **more: Any) -> tl.Object:
    made = trimesh.creation.icosphere(4, 0.02)
    return tl.Object(tl.Mesh(made.vertices, made.faces, name="ball.ply"), medium, **more)


def scene_of(body: tl.Object, camera: tl.Camera | None = None, **more: Any) -> tl.Scene:
    camera = camera or tl.Camera.look_at((0.03, 0.03, 0.09), (0, 0, 0), fov_y=30)
    return tl.Scene([body], camera, environment=SKY, **more)


SKY = tl.Environment.gradient((0.3, 0.4, 0.5), (1.0, 0.9, 0.8))
RED = tl.Medium.from_color((0.7, 0.2, 0.1), 0.02)
GLASS = tl.Medium.from_color((0.5, 0.8, 0.6), 0.02, ior=1.5)


def opened(page: WebPage, scene: tl.Scene, folder: Path, tools: str, **choices: Any) -> None:
    """A page of a scene, that draws nothing of its own accord, and no more than it is asked for."""
    file = folder / "page.html"
    tl.write_page(scene, file, size=SIZE, **choices)
    page.page.add_init_script(tools)
    page.open(file)


def test_absorbing_body(web_page: WebPage, web_dist: Path, renderer: tl.Renderer, tmp_path: Path, tools: str) -> None:
    scene = scene_of(ball(RED))
    opened(web_page, scene, tmp_path, tools)
    assert error(radiance(web_page), renderer.render(scene, SIZE, samples=16)) < BAR


def test_traced_glass_before_opaque(
    web_page: WebPage, web_dist: Path, renderer: tl.Renderer, tmp_path: Path, tools: str
) -> None:
    """Rays bent twice, onto a floor with the colored shadow of the ball."""
    floor = trimesh.creation.box((0.1, 0.002, 0.1))
    floor.apply_translation((0, -0.022, 0))
    ground = tl.Object(tl.Mesh(floor.vertices, floor.faces, name="floor.ply"), None, color=(0.6, 0.5, 0.4))
    scene = scene_of(ball(GLASS), lights=[tl.DirectionalLight((-0.4, -1, -0.3), 2.0)])
    scene = dataclasses.replace(scene, objects=[*scene.objects, ground])
    opened(web_page, scene, tmp_path, tools, shadows=tl.ShadowMaps(256))
    frame = renderer.render(scene, SIZE, shadows=tl.ShadowMaps(256))
    found = radiance(web_page, samples=1)
    # What is sharp, outlines, their refracted images and the highlight, depends on the grid of vertices; see `error`.
    difference = np.abs(found - frame.radiance).max(axis=-1) / frame.radiance.mean()
    assert np.quantile(difference, 0.95) < BAR
    assert np.quantile(difference, 0.99) < 10 * BAR


def test_rough_glass_on_a_stage(
    web_page: WebPage, web_dist: Path, renderer: tl.Renderer, tmp_path: Path, tools: str, few_shadows: None
) -> None:
    """Each sample has microfacets of its own; the ground has a map of shadows, which follows the medium."""
    size, samples = (48, 36), 4
    for color in ("#b0e0c0", "#30c060"):
        medium = tl.Medium.from_color(color, 0.01, ior=1.5)
        scene = with_roughness(tl.showcase(ball(medium).mesh, medium, size), 0.4)
        if color == "#b0e0c0":
            opened(web_page, scene, tmp_path, tools, samples=samples)
        else:
            web_page.run("async () => (await translucent).setMaterial({ color: '#30c060', distance: 0.01 })")
        frame = renderer.render(scene, size, samples=samples, adaptive=False, caustics=tl.Caustics(0))
        found = radiance(web_page, size, samples)
        difference = np.abs(found - frame.radiance).max(axis=-1) / frame.radiance.mean()
        assert np.median(difference) < 0.5 * BAR
        assert np.quantile(difference, 0.9) < 3 * BAR


def test_material_of_the_panel(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    """A material that is set gives, pixel by pixel, what a page has that was written with it; so does one set back."""
    medium = tl.Medium.from_color("#30c060", 0.01, ior=1.4)
    rough = scene_of(ball(medium, surface=tl.Surface(roughness=0.4)))
    opened(web_page, rough, tmp_path, tools)
    first = radiance(web_page, samples=1)
    web_page.run("async () => (await translucent).setMaterial({ ior: 1, roughness: 0 })")
    clear = radiance(web_page, samples=1)
    opened(web_page, scene_of(ball(RED)), tmp_path, tools)
    red = radiance(web_page, samples=1)
    web_page.run("async () => (await translucent).setMaterial({ color: '#30c060', distance: 0.01 })")
    np.testing.assert_array_equal(radiance(web_page, samples=1), clear)
    web_page.run("async () => (await translucent).setMaterial({ ior: 1.4, roughness: 0.4 })")
    np.testing.assert_array_equal(radiance(web_page, samples=1), first)
    web_page.run("async () => (await translucent).resetMaterial()")
    np.testing.assert_array_equal(radiance(web_page, samples=1), red)


def test_turning_probing_and_loss(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    """Keys and the panel; the probe against the ball's thickness; a context that is lost and comes back."""
    opened(web_page, scene_of(ball(RED)), tmp_path, tools)
    page = web_page.page
    page.evaluate("async () => { window.viewer = await translucent; }")
    page.wait_for_function("() => viewer.still")
    where = "viewer.state().camera.eye"
    start = page.evaluate(where)
    page.keyboard.press("ArrowRight")
    turned = page.evaluate(where)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(start))
    angles = [np.arctan2(eye[0], eye[2]) for eye in (start, turned)]
    assert angles[0] - angles[1] == pytest.approx(np.pi / 36)
    page.keyboard.press("+")
    assert np.linalg.norm(page.evaluate(where)) < 0.95 * np.linalg.norm(start)
    page.keyboard.press("r")
    assert page.evaluate(where) == pytest.approx(start)
    page.keyboard.press("t")
    found = probed(page)
    assert found["valid"]
    assert found["count"] == 0
    assert found["thickness"] == pytest.approx(0.04, rel=2e-3)
    assert found["transmittance"] == pytest.approx(RED.transmittance(found["thickness"]), rel=1e-4)
    scale = page.locator(".scale .marks").inner_text()
    assert "39.97" in scale
    assert scale.endswith("mm")
    page.keyboard.press("t")
    page.locator("#color").fill("#3070c0")
    held = page.evaluate("viewer.state().media[0]")
    assert held["extinction"] == pytest.approx(tl.Medium.from_color("#3070c0", held["distance"]).extinction)
    fields_show_what_is_kept(page)
    page.evaluate("(window.loser = viewer.gl.getExtension('WEBGL_lose_context')).loseContext()")
    page.wait_for_function("() => viewer.lost")
    assert "graphics card" in page.locator(".told").inner_text()
    page.evaluate("window.before = viewer.player")
    page.evaluate("loser.restoreContext()")
    page.wait_for_function("() => !viewer.lost && viewer.player !== before")
    assert probed(page)["covered"]


def probed(page: Any) -> Any:
    """Values in the middle of the whole picture: it may move once more as the page finds its size."""
    return page.wait_for_function("() => viewer.still && viewer.probe(0.5, 0.5)").json_value()


PROBED = """(places) => {
  const [width, height] = viewer.size;
  return places.map(([row, column]) => viewer.probe((column + 0.5) / width, (row + 0.5) / height).thickness);
}"""


def test_the_probe_is_exact_by_edges_of_faces(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    """A software WebGL moves edges in pictures by up to 1/32 of a pixel; the probe is exact there."""
    mesh = rounded(tl.load_mesh(mesh_path("knot")))
    camera = tl.Camera.look_at(1.2 * mesh.diagonal * np.array((0.5, 0.35, 1.0)), (0, 0, 0), fov_y=45)
    opened(web_page, scene_of(tl.Object(mesh, RED), camera=camera), tmp_path, tools)
    web_page.page.evaluate("async () => { window.viewer = await translucent; }")
    web_page.page.wait_for_function("() => viewer.still && viewer.done === viewer.page.samples")
    size = tuple(web_page.run("() => viewer.size"))
    fov_y = web_page.run("() => viewer.view.camera(viewer.view.widened(viewer.size)).fov_y")
    truth = Truth.of(mesh, dataclasses.replace(camera, fov_y=fov_y), size)
    places = np.argwhere(tl.interior(truth.crossed) & truth.on_edge)[::5]
    assert len(places) > 40
    found = np.array(web_page.run(PROBED, places.tolist()))
    assert np.abs(found - truth.thickness[tuple(places.T)]).max() < 2e-5 * mesh.diagonal


def test_an_absorber_that_scatters_a_little_has_its_thickness(
    web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str
) -> None:
    """Pages follow no light into media: what little is scattered is left out and told, and nothing is invalid."""
    merlot = tl.preset("merlot")
    assert merlot.medium.scatters
    scene = scene_of(
        ball(merlot.medium, transform=np.diag((0.5, 0.5, 0.5, 1.0))),
        lights=[tl.DirectionalLight((-0.4, -1, -0.3), 2.0)],
    )
    opened(web_page, scene, tmp_path, tools)
    page = web_page.page
    page.evaluate("async () => { window.viewer = await translucent; }")
    # The picture may move once more as the page finds its size: until it is still there is nothing to read.
    found = page.wait_for_function("() => viewer.probe(0.5, 0.5)").json_value()
    assert found["valid"]
    # On slow machines pixels are as large as a tenth of it.
    assert found["thickness"] == pytest.approx(0.02, rel=0.04)
    assert found["transmittance"] == pytest.approx(merlot.medium.transmittance(found["thickness"]), rel=1e-4)
    notes = page.locator(".notes li").all_text_contents()
    assert any("'ball.ply': scattered light is missing" in note for note in notes)
    preset = page.locator("#preset")
    chosen = "(field) => field.selectedOptions[0].text"
    assert preset.evaluate(chosen) == "merlot, as written"
    assert preset.is_enabled()
    page.locator("#ior-number").fill("1.2")
    page.keyboard.press("Enter")
    assert preset.evaluate(chosen) == "of your own"
    page.locator(".stage canvas").press("m")
    assert preset.evaluate(chosen) == "merlot, as written"


def fields_show_what_is_kept(page: Any) -> None:
    """Numbers out of range, and presets that something else has changed, do not stay on the panel."""
    for field, entered, shown in (
        ("#ior-number", "99", "3"),
        ("#ior-number", "", "3"),
        ("#exposure-number", "50", "10"),
    ):
        page.locator(field).fill(entered)
        page.keyboard.press("Enter")
        assert page.locator(field).input_value() == shown
    distance = page.locator("#distance").input_value()
    page.locator("#distance").fill("-5")
    page.keyboard.press("Enter")
    assert page.locator("#distance").input_value() == distance
    preset = page.locator("#preset")
    preset.select_option("whisky")
    assert preset.input_value() == "whisky"
    page.locator("#roughness-number").fill("0.3")
    page.keyboard.press("Enter")
    assert preset.input_value() == ""
    preset.select_option("whisky")
    page.locator(".stage canvas").press("m")
    assert preset.input_value() == ""


def test_touch_on_a_phone(chromium: Any, web_dist: Path, tmp_path: Path) -> None:
    """On a narrow page the panel lies below the picture; a finger turns, and none of it scrolls."""
    file = tmp_path / "page.html"
    tl.write_page(scene_of(ball(RED)), file, size=SIZE)
    page = WebPage(chromium, (390, 844), has_touch=True, is_mobile=True)
    try:
        page.open(file)
        page.page.evaluate("async () => { window.viewer = await translucent; }")
        page.page.wait_for_function("() => viewer.still")
        canvas, panel = (page.page.locator(name).bounding_box() for name in (".stage canvas", ".panel"))
        assert canvas
        assert panel
        assert canvas["y"] + canvas["height"] <= panel["y"]
        before = page.run("() => viewer.state().camera.eye")
        touch = page.page.context.new_cdp_session(page.page)
        for kind, at in (("touchStart", 100), ("touchMove", 140), ("touchMove", 200), ("touchEnd", None)):
            points = [] if at is None else [{"x": at, "y": 200}]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        page.page.wait_for_function("(eye) => Math.abs(viewer.state().camera.eye[0] - eye[0]) > 1e-3", arg=before)
        assert page.run("() => document.documentElement.scrollHeight") <= 844
        line = page.page.locator(".at")
        assert "Point at the model, or tap it" in line.inner_text()  # a finger that turns reads nothing
        page.page.wait_for_function("() => viewer.still")
        page.page.touchscreen.tap(canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2)
        page.page.wait_for_function("() => viewer.still && viewer.panel.pointer")
        thickness = probed(page.page)["thickness"]
        assert thickness == pytest.approx(0.04, rel=2e-3)
        assert f"{1e3 * thickness:.2f} mm" in line.inner_text()
        # It stays: no finger is there any more, and what is read follows the view.
        page.run("() => viewer.setCamera({ eye: [0.05, 0.06, 0.12], target: [0, 0, 0], up: [0, 1, 0] })")
        page.page.wait_for_function("() => viewer.still")
        assert "mm" in line.inner_text()
        assert page.errors == []
    finally:
        page.close()


def answer_null(page: WebPage, of: str, method: str, where: str) -> None:
    """Let a method of the browser give null for some names, before any script runs."""
    page.page.add_init_script(
        f"const own = {of}.prototype.{method};"
        f"{of}.prototype.{method} = function (name, ...more) {{"
        f" return {where} ? null : own.call(this, name, ...more); }};"
    )


def test_without_webgl2(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    answer_null(web_page, "HTMLCanvasElement", "getContext", "name === 'webgl2'")
    opened(web_page, scene_of(ball(RED)), tmp_path, tools)
    web_page.run("async () => (await translucent).failed")
    assert "no WebGL2" in web_page.page.locator(".told").inner_text()
    assert is_seen(web_page.page, ".told")
    assert any("no WebGL2" in text for text in web_page.messages)
    assert web_page.page.locator("#ior").is_disabled()


def test_without_decompression(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    """The script is packed, too: the page itself says what the browser lacks."""
    web_page.page.add_init_script("delete globalThis.DecompressionStream")
    opened(web_page, scene_of(ball(RED)), tmp_path, tools)
    assert web_page.run("async () => (await translucent) === undefined")
    assert "no DecompressionStream" in web_page.page.locator(".failed").inner_text()


def is_seen(page: Any, name: str) -> bool:
    """Tell whether nothing lies over the middle of an element, such as the poster."""
    return bool(
        page.locator(name).evaluate(
            "(found) => { const box = found.getBoundingClientRect();"
            " const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];"
            " return found.getRootNode().elementFromPoint(x, y) === found; }"
        )
    )


def test_without_targets_of_floats(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    answer_null(web_page, "WebGL2RenderingContext", "getExtension", "name.startsWith('EXT_color_buffer')")
    opened(web_page, scene_of(ball(RED)), tmp_path, tools)
    web_page.run("async () => (await translucent).failed")
    assert "pictures of floats" in web_page.page.locator(".told").inner_text()


def test_half_floats_are_told(web_page: WebPage, web_dist: Path, tmp_path: Path, tools: str) -> None:
    """Thickness is added up in 16 bits without blending of 32-bit floats, and the page says so."""
    answer_null(web_page, "WebGL2RenderingContext", "getExtension", "name === 'EXT_float_blend'")
    opened(web_page, scene_of(ball(RED)), tmp_path, tools)
    web_page.page.evaluate("async () => { window.viewer = await translucent; }")
    assert probed(web_page.page)["thickness"] == pytest.approx(0.04, rel=5e-3)
    assert "16 bits" in web_page.page.locator(".notes").inner_text()


def test_color_of_a_medium_that_scatters(
    web_page: WebPage, web_dist: Path, renderer: tl.Renderer, tmp_path: Path, tools: str
) -> None:
    """Light at another color is what is solved for it, about as near as the page says; set back, nothing is changed."""
    wax = tl.Medium((40.0, 60.0, 90.0), (900.0, 800.0, 700.0), anisotropy=0.3, ior=1.4)
    made = trimesh.creation.icosphere(3, 0.02)
    egg = tl.Mesh(made.vertices * (1.0, 1.6, 0.7), made.faces)
    scene = scene_of(tl.Object(egg, wax), lights=[tl.DirectionalLight((-0.4, -1, -0.3), 2.0)])
    coarse = tl.Diffusion(resolution=16)
    opened(web_page, scene, tmp_path, tools, scattering=coarse)
    before = radiance(web_page, samples=1)
    page = web_page.page
    page.evaluate("async () => { window.viewer = await translucent; }")
    page.locator("#color").fill("#4aa8c0")
    assert page.locator("#color").is_enabled()
    assert page.locator("#roughness").is_disabled()
    albedos = page.evaluate("({ error: viewer.page.albedos.error, found: viewer.state().media[0].albedo })")
    assert page.locator(".albedo-error").inner_text() == f"of thick parts, within {100 * albedos['error']:.2g} %"
    # A page stores every second cell of the grid. This causes three quarters of the error: with all cells, it is .008.
    assert albedos["error"] < 0.035
    found = np.array(albedos["found"])
    color = [half_space_reflectance(float(one), wax.ior) for one in found]
    assert to_hex(color) == "#4aa8c0"
    other = dataclasses.replace(scene, objects=[dataclasses.replace(scene.objects[0], medium=with_albedo(wax, found))])
    true = renderer.render(other, SIZE, samples=1, scattering=coarse)
    shown = radiance(web_page, samples=1)
    mean = true.radiance[true.coverage].mean(axis=0)
    off, was = (np.abs(one - true.radiance)[true.coverage] / mean for one in (shown, before))
    # Highlights at outlines apart: see `error`.
    assert (np.median(off, axis=0) < albedos["error"]).all()
    assert (np.quantile(off, 0.95, axis=0) < 2 * albedos["error"]).all()
    assert (np.median(was, axis=0) > 0.2).all()
    page.evaluate("viewer.resetMaterial()")
    np.testing.assert_array_equal(radiance(web_page, samples=1), before)


_MEASURED = """async ({ size }) => {
  const viewer = await translucent;
  const drawn = (what) => encoded(viewer.render({ size, samples: 1, what }));
  return [drawn("flags"), drawn("thickness"), viewer.marked];
}"""


@pytest.mark.parametrize(("name", "ahead"), [("bear", (0.5, 0.35, 1.0)), ("armadillo.obj", (-1.0, 0.2, 0.4))])
def test_pixels_that_a_rasterizer_misplaces_are_marked(
    web_page: WebPage, web_dist: Path, request: pytest.FixtureRequest, tmp_path: Path, tools: str, name: str, ahead: Any
) -> None:
    """Pixels that a grid of 1/16 pixel makes wrong by 1e-3 of the diagonal are invalid, and no others."""
    path = request.getfixturevalue("assets") / "meshes_clean" / name if "." in name else mesh_path(name)
    mesh, size = rounded(tl.load_mesh(path)), (512, 512)
    floor = trimesh.creation.box(mesh.diagonal * np.array([2.0, 0.02, 2.0]))
    floor.apply_translation((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2 - (0, mesh.diagonal, 0))
    ground = tl.Object(tl.Mesh(floor.vertices, floor.faces, name="floor.ply"), None)
    camera = framing(mesh, ahead)
    green = tl.Medium.from_color("#30c060", mesh.diagonal / 4)
    opened(web_page, tl.Scene([tl.Object(mesh, green), ground], camera, environment=SKY), tmp_path, tools)
    *drawn, marked = web_page.run(_MEASURED, {"size": size})
    flags, metres = (decoded(text, "f4").reshape(*size, 4)[..., 0] for text in drawn)
    truth = Truth.of(mesh, camera, size)
    wrong = np.abs(metres - truth.thickness) > 1e-3 * mesh.diagonal
    assert wrong.sum() == marked > 0
    np.testing.assert_array_equal((flags.astype(int) & 2) == 0, wrong)
