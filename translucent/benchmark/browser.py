"""Renderers of the web in headless Chromium: a page without a network, with packages of npm from a folder."""

from __future__ import annotations

import base64
import importlib.util
import json
import mimetypes
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.benchmark.scenes import BenchmarkScene
from translucent.errors import RenderError
from translucent.files.paths import cache_folder

#: Names of Chromium.
_CHROMIUM = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

#: Options of Chromium: WebGL, in software where there is no graphics card; no sandbox, since tests may run as root.
_OPTIONS = (
    "--no-sandbox",
    "--ignore-gpu-blocklist",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)

#: Where the page seems to lie; nothing of it goes through a network.
_HOME = "http://benchmark.invalid/"

#: Milliseconds for a picture.
_LIMIT = 240_000


@dataclass(frozen=True)
class WebRenderer:
    """A renderer of the web.

    Attributes
    ----------
    name : str
        Of its script in ``peers/``, without .js.
    packages : dict
        Of npm, with the module that each bare import stands for.
    """

    name: str
    packages: dict[str, str]

    def missing(self) -> str:
        """Reason why the renderer cannot run on this machine; empty if it can."""
        if chromium() is None:
            return "Chromium is not installed; apt-get install chromium, or set CHROMIUM to its path"
        absent = [name for name in self.npm() if not (npm_folder() / "node_modules" / name).is_dir()]
        if absent:
            return f"{', '.join(absent)} not in {npm_folder()}; npm install --prefix {npm_folder()} {' '.join(absent)}"
        if importlib.util.find_spec("playwright") is None:
            return "playwright is not installed; pip install playwright"
        return ""

    def npm(self) -> list[str]:
        """Names of the renderer's npm packages."""
        paths = [path.split("/") for path in self.packages.values()]
        return sorted({"/".join(parts[: 2 if parts[0].startswith("@") else 1]) for parts in paths})

    def version(self) -> str:
        """Version of the renderer's first npm package."""
        package = npm_folder() / "node_modules" / self.npm()[0] / "package.json"
        return str(json.loads(package.read_text(encoding="utf-8"))["version"])


def chromium() -> str | None:
    """Path of Chromium, or the one that the variable CHROMIUM names."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _CHROMIUM)), None)


def npm_folder() -> Path:
    """Folder with node_modules: the one that TRANSLUCENT_NPM names, or one in the cache."""
    named = os.environ.get("TRANSLUCENT_NPM")
    return Path(named) if named else cache_folder() / "benchmark-npm"


class WebSession:
    """An open page of a renderer."""

    def __init__(self, page: Any, device: str, errors: list[str]) -> None:
        self._page, self.device, self._errors = page, device, errors
        self.folder = Path()

    def draw(self, scene: BenchmarkScene, folder: Path) -> tuple[npt.NDArray[np.float32], float | None]:
        """Linear radiance (h, w, 3) of a scene in a folder, and its seconds, if the page measures them."""
        self.folder = folder
        self._errors.clear()
        width, height = scene.size
        try:
            drawn = self._page.evaluate("(order) => window.drawScene(order)", {"home": _HOME + "scene/", "size": width})
        except Exception as error:
            said = "; ".join([*self._errors[:2], str(error).splitlines()[0]])
            raise RenderError(
                f"drawing {scene.name!r} in a browser", said, "look for the error in translucent/benchmark/peers"
            ) from error
        values = np.frombuffer(base64.b64decode(drawn["pixels"]), np.float32)
        side = round((values.size / 3) ** 0.5)
        fine = values.reshape(side, side, 3)
        parts = side // width
        return fine.reshape(height, parts, width, parts, 3).mean(axis=(1, 3)), drawn["seconds"]


@contextmanager
def open_page(renderer: WebRenderer) -> Iterator[WebSession]:
    """Open the page of a renderer in Chromium."""
    playwright = importlib.import_module("playwright.sync_api")
    errors: list[str] = []
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium(), args=list(_OPTIONS))
        page = browser.new_context(viewport={"width": 600, "height": 600}, service_workers="block").new_page()
        session = WebSession(page, "", errors)
        page.set_default_timeout(_LIMIT)
        page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.route("**/*", lambda route: _answer(route, renderer, session))
        page.goto(_HOME)
        try:
            page.wait_for_function("window.drawScene !== undefined", timeout=60_000)
        except Exception as error:
            raise RenderError(
                "a browser", "; ".join(errors[:3]) or str(error), "check the packages of the browser"
            ) from error
        session.device = str(page.evaluate("window.deviceName ? window.deviceName() : ''"))
        yield session
        browser.close()


def _answer(route: Any, renderer: WebRenderer, session: WebSession) -> None:
    """Answer a request of the page from disk; all else is refused."""
    url = route.request.url.partition("?")[0]
    if not url.startswith(_HOME):
        route.abort()
        return
    name = url[len(_HOME) :]
    if name == "":
        imports = {"imports": {key: f"/npm/{path}" for key, path in renderer.packages.items()}}
        head = f'<script type="importmap">{json.dumps(imports)}</script>'
        body = f'<canvas id="canvas"></canvas><script type="module" src="/peers/{renderer.name}.js"></script>'
        route.fulfill(body=f"<!DOCTYPE html><meta charset=utf-8>{head}<body>{body}", content_type="text/html")
        return
    room, _, rest = name.partition("/")
    places = {
        "npm": npm_folder() / "node_modules",
        "peers": Path(str(files("translucent.benchmark").joinpath("peers"))),
        "scene": session.folder,
    }
    path = places[room] / rest if room in places else None
    if path is None or ".." in rest or not path.is_file():
        route.fulfill(status=404, body="")
        return
    kind = "text/javascript" if path.suffix in (".js", ".mjs") else mimetypes.guess_type(path.name)[0]
    route.fulfill(body=path.read_bytes(), content_type=kind or "application/octet-stream")


THREE = WebRenderer(
    "three",
    {
        "three": "three/build/three.module.js",
        "three/addons/": "three/examples/jsm/",
    },
)
BABYLON = WebRenderer("babylon", {"@babylonjs/core/": "@babylonjs/core/", "@babylonjs/loaders/": "@babylonjs/loaders/"})
MODEL_VIEWER = WebRenderer(
    "model-viewer",
    {
        "@google/model-viewer": "@google/model-viewer/dist/model-viewer-module.min.js",
        "three": "three/build/three.module.js",
    },
)
FILAMENT = WebRenderer("filament", {"filament": "filament/filament.js", "gl-matrix": "gl-matrix/gl-matrix-min.js"})
