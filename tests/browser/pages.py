"""Pages in headless Chromium, opened from disk: what they said, and arrays out of them."""

from __future__ import annotations

import base64
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tests.processes import PATIENCE

if TYPE_CHECKING:
    from playwright.sync_api import Browser

#: WebGL2 and WebGPU (over Vulkan) in software, no sandbox (tests may run as root), nothing that asks for a network.
CHROMIUM_OPTIONS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
]

#: Time after which a page that does not get ready fails its test.
MILLISECONDS = 1e3 * PATIENCE

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def find_chromium() -> str | None:
    """Path of the system's Chromium, or the one that the variable CHROMIUM names."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _NAMES)), None)


class WebPage:
    """A page without a network.

    Parameters
    ----------
    browser : Browser
    size : (width, height)
        Of the window's inside, in CSS pixels.
    ratio : float
        Device pixels for each of them.
    **context
        Other options of Playwright's `new_context`, such as has_touch.

    Attributes
    ----------
    page : Page
        Playwright's own.
    errors : list of str
        Errors that the page told its console, exceptions that nothing caught, and what it asked a network for.
    messages : list of str
        All else that it told its console.
    """

    def __init__(self, browser: Browser, size: tuple[int, int], ratio: float = 1.0, **context: Any) -> None:
        viewport = {"width": size[0], "height": size[1]}
        self._context = browser.new_context(viewport=viewport, device_scale_factor=ratio, offline=True, **context)  # type: ignore[arg-type]
        self.page = self._context.new_page()
        self.page.set_default_timeout(MILLISECONDS)
        self.errors: list[str] = []
        self.messages: list[str] = []
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", self._see)

    def _hear(self, message: Any) -> None:
        (self.errors if message.type == "error" else self.messages).append(message.text)

    def _see(self, request: Any) -> None:
        if not request.url.startswith(("file:", "data:", "blob:")):
            self.errors.append(f"asked for {request.url}")

    def open(self, path: Path) -> None:
        """Open a file, and wait until it is loaded."""
        self.page.goto(path.resolve().as_uri())

    def add_script(self, path: Path) -> None:
        """Run a script of a file in the page."""
        self.page.add_script_tag(content=path.read_text(encoding="utf-8"))

    def run(self, script: str, argument: object = None) -> Any:
        """Value of a JavaScript function, called with an argument that JSON can hold."""
        return self.page.evaluate(script, argument)

    def close(self) -> None:
        """Close the page."""
        self._context.close()


def encoded(values: npt.ArrayLike, dtype: str) -> str:
    """Array for a page: base64 of its bytes, little-endian; `decoded` of tests/browser/tools.js takes it."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(dtype).newbyteorder("<")).tobytes()).decode()


def decoded(text: str, dtype: str = "f4") -> npt.NDArray[Any]:
    """Flat array that a page gives as base64."""
    return np.frombuffer(base64.b64decode(text), np.dtype(dtype).newbyteorder("<"))
