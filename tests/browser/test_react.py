"""ExactThickness and TranslucentMaterial of react-three-fiber in headless Chromium: the example, opened from disk."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.browser.pages import WebPage
from tests.processes import until

EXAMPLE = Path(__file__).resolve().parents[2] / "web" / "examples" / "react" / "index.html"


def test_a_scene_is_measured_before_each_picture(web_page: WebPage, web_dist: Path) -> None:
    if not (web_dist / "example-react.js").is_file():
        pytest.skip("web/dist has no example of react-three-fiber: run `make web`")
    web_page.open(EXAMPLE)
    page = web_page.page
    page.wait_for_function("() => globalThis.pass?.texture")
    thickest = "() => pass.read().thickness.reduce((a, b) => Math.max(a, b), 0)"
    # The tube of the knot is 12 mm thick, and rays cross it several times at most.
    assert 0.011 < page.evaluate(thickest) < 0.06
    # All but a few by edges of outlines, where the grid of a rasterizer in software decides.
    assert page.evaluate("() => pass.read().valid.filter((one) => one === 0).length") < 30
    # A click pours another drink: a prop reaches the material, and the pass is the same one.
    page.evaluate("() => { globalThis.first = pass; }")
    assert hue(web_page) == pytest.approx(WINE, abs=0.1)
    page.mouse.click(150, 75)
    until(lambda: hue(web_page) == pytest.approx(WHISKY, abs=0.1))
    assert page.evaluate("() => pass === first")


#: Mean green and blue over red of the knot.
WINE, WHISKY = (0.06, 0.29), (0.67, 0.33)


def hue(page: WebPage) -> tuple[float, float]:
    pixels = np.asarray(Image.open(io.BytesIO(page.page.screenshot())).convert("RGB"), float).reshape(-1, 3)
    red, green, blue = pixels[np.abs(pixels - pixels[0]).max(axis=1) > 60].mean(axis=0)
    return green / red, blue / red
