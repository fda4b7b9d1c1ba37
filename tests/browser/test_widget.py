"""The widget of `tl.view` in headless Chromium: the real viewer, and a model that stands for a notebook's."""

from __future__ import annotations

import base64
import gzip
import json
from pathlib import Path

import pytest
import trimesh

import translucent as tl
from tests.browser.pages import WebPage
from translucent.page.container import header_of
from translucent.page.payload import payload
from translucent.page.plans import plan_page

SIZE, HEIGHT = (48, 36), 140

#: A model as anywidget's protocol has it: what `change:NAME` listeners hear, and what is saved.
MODEL = """
async ([script, data, height]) => {
  const url = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
  const { default: widget } = await import(url);
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const values = {
    _payload: new DataView(bytes.buffer), _height: height, _label: "Interactive view", _media: [], _camera: {},
    _moved: false, problem: "",
  };
  const heard = new Map();
  window.saved = 0;
  window.model = {
    get: (name) => values[name],
    set: (name, value) => { values[name] = value; },
    save_changes: () => { window.saved += 1; },
    on: (name, listener) => heard.set(name, listener),
    off: (name) => heard.delete(name),
    change: (name, value) => { values[name] = value; heard.get(`change:${name}`)?.(); },
    heard: () => heard.size,
  };
  window.end = widget.render({ model: window.model, el: document.body });
  window.viewer = await window.end.ready;
  return Boolean(window.viewer);
}
"""


@pytest.fixture(scope="module")
def data() -> bytes:
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    medium = tl.Medium.from_color((0.2, 0.05, 0.1), 0.01)
    scene = tl.showcase(tl.Mesh(box.vertices, box.faces, name="box"), medium, SIZE, stage="none")
    return payload(plan_page(scene), "box", SIZE, 1, 0.0, "none")


def begin(page: WebPage, script: Path, data: bytes) -> bool:
    found: bool = page.run(MODEL, [script.read_text(), base64.b64encode(data).decode(), HEIGHT])
    return found


def test_material_and_camera_go_both_ways(web_page: WebPage, web_dist: Path, data: bytes) -> None:
    assert begin(web_page, web_dist / "widget.js", data)
    page = web_page.page
    assert page.get_by_role("region", name="Interactive view").count() == 1
    assert page.locator("canvas").first.bounding_box()["height"] <= HEIGHT  # type: ignore[index]
    page.wait_for_function("window.viewer.painted")
    wanted = {"extinction": [10, 20, 30], "ior": 1, "roughness": 0, "distance": 0.02}
    state = web_page.run("(m) => { model.change('_media', [m]); return viewer.state(); }", wanted)
    assert {key: state["media"][0][key] for key in wanted} == wanted
    camera = {"eye": [0.1, 0, 0], "target": [0, 0, 0], "up": [0, 1, 0]}
    state = web_page.run("(c) => { model.change('_camera', c); return viewer.state(); }", camera)
    assert state["camera"]["forward"] == pytest.approx([-1, 0, 0], abs=1e-12)
    page.wait_for_timeout(200)
    assert web_page.run("() => saved") == 0  # what came from Python is not sent back
    web_page.run("() => { viewer.setMaterial({ extinction: [1, 2, 3] }); viewer.setCamera({ eye: [0, 0, 0.1] }); }")
    page.wait_for_function("saved > 0")
    assert web_page.run("() => model.get('_media')") == [{**wanted, "extinction": [1, 2, 3]}]
    assert web_page.run("() => model.get('_camera').eye") == pytest.approx([0, 0, 0.1])
    assert web_page.run("() => { end(); return [model.heard(), document.body.children.length]; }") == [0, 0]


def test_what_the_browser_cannot_show_is_told(web_page: WebPage, web_dist: Path, data: bytes) -> None:
    broken = gzip.compress(b"TLPAGE99" + gzip.decompress(data)[8:])
    assert not begin(web_page, web_dist / "widget.js", broken)
    told = web_page.page.get_by_role("alert").inner_text()
    assert told.startswith("This scene cannot be shown: ")
    assert web_page.run("() => model.get('problem')") in told


def test_the_header_is_what_the_browser_reads(data: bytes) -> None:
    header = header_of(data)
    assert header["name"] == "box"
    assert json.dumps(header["scene"]["media"][0]["editable"]) == "true"
