"""Headless Chromium for tests: one for the session, without a network, on files from disk."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.browser.pages import CHROMIUM_OPTIONS, MILLISECONDS, WebPage, find_chromium
from tests.browser.thickness import prepare

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """The browser; skips where Chromium, Playwright or npm are not here."""
    executable = find_chromium()
    if executable is None:
        pytest.skip("no Chromium on this machine (apt-get install chromium, or CHROMIUM=/path/to/it)")
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="Playwright is not installed (dependency group test)"
    )
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=CHROMIUM_OPTIONS, timeout=MILLISECONDS)
        yield browser
        browser.close()


@pytest.fixture(autouse=True)
def quick_pages(quick_packing: None) -> None:
    """Pages are packed quickly."""


@pytest.fixture
def web_page(chromium: Browser) -> Iterator[WebPage]:
    """An empty page of 300 x 150 CSS pixels, in which `WebPage` opens files. It must be left without errors."""
    page = WebPage(chromium, (300, 150))
    yield page
    page.close()
    assert page.errors == []


@pytest.fixture(scope="module")
def three_page_of_module(chromium: Browser, web_dist: Path) -> Iterator[WebPage]:
    page = WebPage(chromium, (300, 150))
    prepare(page, web_dist)
    yield page
    page.close()


@pytest.fixture
def three_page(three_page_of_module: WebPage) -> Iterator[WebPage]:
    """A page with the bundle of three.js and this module, and tools.js; shared by the tests of a file."""
    yield three_page_of_module
    errors, three_page_of_module.errors[:] = list(three_page_of_module.errors), []
    assert errors == []


@pytest.fixture(scope="session")
def web_dist() -> Path:
    """The folder web/dist; skips where it was not built."""
    folder = ROOT / "web" / "dist"
    if not (folder / "translucent-three.browser.js").is_file():
        why = "npm is not here" if shutil.which("npm") is None else "run `make web`"
        pytest.skip(f"web/dist is not built ({why})")
    return folder
