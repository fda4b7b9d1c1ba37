"""The harness itself: what a page says and gives."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from tests.browser.pages import WebPage, decoded, encoded
from tests.processes import until

TOOLS = Path(__file__).with_name("tools.js")


def test_arrays_come_and_go_as_they_are(web_page: WebPage, web_dist: Path) -> None:
    web_page.add_script(web_dist / "translucent-three.browser.js")
    web_page.add_script(TOOLS)
    sent = np.array([0.1, -1e30, 3e-41], np.float32)
    given = web_page.run("(text) => tools.base64(new Float32Array(tools.bytes(text)))", encoded(sent, "f4"))
    assert np.array_equal(decoded(given), sent)


def test_errors_of_a_page_are_heard(web_page: WebPage, tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text("<script>console.error('broken'); undefined_name();</script>", encoding="utf-8")
    web_page.open(tmp_path / "page.html")
    until(lambda: web_page.run("() => true") and len(web_page.errors) == 2)
    one, other = sorted(web_page.errors, key=len)
    assert one == "broken"
    assert "undefined_name" in other
    web_page.errors.clear()


def test_a_picture_of_the_page_can_be_taken(web_page: WebPage) -> None:
    assert struct.unpack(">II", web_page.page.screenshot()[16:24]) == (300, 150)
