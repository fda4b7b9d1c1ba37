"""Pages of ``translucent page`` in headless Chromium against the renderer: errors of the same scenes and choices.

``python tools/measure_pages.py`` writes the pages of a few scenes, draws each with 16 samples of a pixel, and prints
the root mean square error over mean radiance against the renderer's picture of the same size, and what turning the
camera by 1/32 of a pixel changes in the renderer's own. ``--angle gl-egl`` takes Mesa in place of Chromium's
SwiftShader, whose grid of vertices is 16 times coarser. It needs ``make web`` and a Chromium.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from measure_browser import launch  # noqa: E402

import translucent as tl  # noqa: E402
from tests.browser.pages import WebPage, decoded  # noqa: E402
from translucent.assets import mesh_path  # noqa: E402

SAMPLES = 16

#: Mesh, preset, stage, and size of each scene.
SCENES = (
    ("knot", None, "none", (160, 100)),
    ("goblet", "bottle_glass", "none", (160, 100)),
    ("goblet", "bottle_glass", "none", (480, 300)),
    ("bear", "bottle_glass", "none", (480, 300)),
    ("goblet", "bottle_glass", "studio", (160, 100)),
    ("bear", "jade", "none", (240, 150)),
    ("bear", "skim_milk", "none", (240, 150)),
)

_READ = """async ({ size, samples }) => {
  const viewer = await translucent;
  const bytes = new Uint8Array(viewer.render({ size, samples }).buffer);
  let text = "";
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
}"""


def main() -> None:
    """Print a line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--angle", default="swiftshader", help="what Chromium draws with")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of scenes, from 0")
    arguments = parser.parse_args()
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder, tl.Renderer() as renderer:
        browser = launch(playwright, arguments.angle)
        for number, (mesh, preset, stage, size) in enumerate(SCENES):
            if arguments.only is not None and number not in arguments.only:
                continue
            scene = _scene(mesh, preset, stage, size)
            drawn = _drawn(renderer, scene, size)
            path = Path(folder) / f"{number}.html"
            tl.write_page(scene, path, size=size)
            page = WebPage(browser, (480, 300))
            page.open(path)
            found = decoded(page.run(_READ, {"size": size, "samples": SAMPLES}))
            found = found.reshape(size[1], size[0], 4)[..., :3]
            page.close()
            turned = _drawn(renderer, _turned(scene, size), size)
            print(
                f"{mesh}, {preset or 'absorbing'}, stage {stage}, {size[0]} x {size[1]}: {_error(found, drawn):.1e}; "
                f"turned by 1/32 of a pixel {_error(turned, drawn):.1e}",
                flush=True,
            )
        browser.close()


def _scene(mesh: str, preset: str | None, stage: str, size: tuple[int, int]) -> tl.Scene:
    medium = tl.preset(preset).medium if preset else tl.Medium.from_color((0.18, 0.62, 0.35), 0.02)
    return tl.showcase(tl.load_mesh(mesh_path(mesh)), medium, size=size, stage=stage)


def _turned(scene: tl.Scene, size: tuple[int, int]) -> tl.Scene:
    """The scene before a camera that is turned to the right by 1/32 of a pixel, about its middle."""
    camera = scene.camera
    angle = 2.0 * np.tan(0.5 * np.radians(camera.fov_y or 0.0)) / size[1] / 32.0
    turn = np.eye(4)
    turn[:3, :3] = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    return dataclasses.replace(scene, camera=dataclasses.replace(camera, pose=camera.pose @ turn))


def _drawn(renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    return np.asarray(renderer.render(scene, size, samples=SAMPLES, adaptive=False).radiance, np.float64)


def _error(found: npt.NDArray[np.floating], truth: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(np.square(found - truth).mean()) / truth.mean())


if __name__ == "__main__":
    main()
