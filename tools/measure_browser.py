"""ExactThicknessPass and TranslucentMaterial in headless Chromium: errors against float64, time, three's own beside.

``python tools/measure_browser.py [MESH ...]`` takes meshes of this project by name, or files; without any, knot and
bear. Prints for each, at 512 x 512: errors of thickness as shares of the diagonal (away from outlines; p99.9 also
without rays within a tenth of a pixel of an edge, where the rasterizer's grid decides which face is shown), pixels
marked and wrong, coverage that differs; then the processor time of the pass, and of the pass with what makes metres
out of sums, over that of a depth-only pass, as medians and quartiles of rounds in turns.

``--materials PICTURE.png`` draws the picture of docs/web.md instead, and prints the errors of TranslucentMaterial and
of MeshPhysicalMaterial against the float64 reference. ``--angle gl-egl`` takes Mesa in place of SwiftShader.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw
from playwright.sync_api import Browser, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import translucent as tl  # noqa: E402
from tests.browser.pages import CHROMIUM_OPTIONS, WebPage, decoded, encoded, find_chromium  # noqa: E402
from tests.browser.thickness import (  # noqa: E402
    Errors,
    Truth,
    described,
    described_camera,
    framing,
    measure,
    prepare,
    rounded,
)
from translucent.assets import mesh_names, mesh_path  # noqa: E402

Array = npt.NDArray[Any]
SIZE = (512, 512)

# `draw(kind, n)` draws n times, then waits until the last pixel of it can be read.
TIMING = """({ mesh, camera, size, options }) => {
    const renderer = tools.renderer(...size);
    const { THREE, ExactThicknessPass } = translucentThree;
    const gl = renderer.getContext();
    const scene = new THREE.Scene();
    const floor = new THREE.MeshBasicMaterial({ colorWrite: false, side: THREE.DoubleSide });
    const body = tools.mesh(mesh, floor);
    scene.add(body);
    const seen = tools.camera(camera);
    const pass = new ExactThicknessPass(renderer, { bodies: [body], ...options });
    const target = new THREE.WebGLRenderTarget(...size);
    const texel = [new Uint8Array(4), new Float32Array(4)];
    const finish = pass.finish;
    const kinds = {
        depth() {
            renderer.setRenderTarget(target);
            renderer.clear();
            renderer.render(scene, seen);
            renderer.setRenderTarget(null);
        },
        sums() {
            pass.finish = () => {};
            pass.render(scene, seen);
            pass.finish = finish;
        },
        whole: () => pass.render(scene, seen),
    };
    const wait = () => {
        renderer.readRenderTargetPixels(target, 0, 0, 1, 1, texel[0]);
        renderer.readRenderTargetPixels(pass.result, 0, 0, 1, 1, texel[1]);
        renderer.readRenderTargetPixels(pass.sums, 0, 0, 1, 1, texel[1]);
        gl.finish();
    };
    globalThis.draw = ([name, draws]) => {
        for (let i = 0; i < draws; i++) kinds[name]();
        wait();
    };
    kinds.whole();
    globalThis.forget = () => {
        renderer.dispose();
        renderer.forceContextLoss();
        renderer.domElement.remove();
    };
}"""
KINDS = ("depth", "sums", "whole")

MATERIAL = """({ mesh, normals, camera, size, sky, medium, thickness }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass, TranslucentMaterial } = translucentThree;
    const scene = new THREE.Scene();
    const texels = new Float32Array(tools.bytes(sky.pixels));
    const map = new THREE.DataTexture(texels, ...sky.size, THREE.RGBAFormat, THREE.FloatType);
    map.mapping = THREE.EquirectangularReflectionMapping;
    map.minFilter = map.magFilter = THREE.LinearFilter;
    map.wrapS = THREE.RepeatWrapping;
    map.needsUpdate = true;
    scene.environment = scene.background = map;
    const pass = new ExactThicknessPass(renderer);
    const common = {
        ior: medium.ior,
        attenuationColor: new THREE.Color().setRGB(...medium.color),
        attenuationDistance: medium.distance,
        transmission: 1,
        roughness: 0,
        metalness: 0,
    };
    const material = thickness === null
        ? new TranslucentMaterial({ pass, ...common })
        : new THREE.MeshPhysicalMaterial({ ...common, thickness });
    const body = tools.mesh(mesh, material);
    body.geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(tools.bytes(normals)), 3));
    scene.add(body);
    const seen = tools.camera(camera);
    if (thickness === null) pass.render(scene, seen);
    const target = new THREE.WebGLRenderTarget(...size, { type: THREE.FloatType });
    renderer.setRenderTarget(target);
    renderer.render(scene, seen);
    const pixels = new Float32Array(4 * size[0] * size[1]);
    renderer.readRenderTargetPixels(target, 0, 0, ...size, pixels);
    return tools.base64(pixels);
})"""

#: What --materials shows: mesh, color after a distance in metres, index of refraction.
BODIES = {
    "ball of glass": ("sphere", (0.95, 0.97, 0.99), 0.04, 1.5),
    "knot of wine": ("knot", "#7b1e3a", 0.02, 1.33),
    "the same, no interface": ("knot", "#7b1e3a", 0.02, 1.0),
}


def load(name: str) -> tl.Mesh:
    return rounded(tl.load_mesh(mesh_path(name) if name in mesh_names() else name))


def sky(height: int = 256) -> Array:
    """(h, 2 h, 3): soft sky, ground and three soft boxes, smooth enough for the maps that three.js filters."""
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height), indexing="ij")
    polar, longitude = v * np.pi, (u - 0.5) * 2 * np.pi
    across = np.sin(polar)
    direction = np.stack([across * np.sin(longitude), np.cos(polar), -across * np.cos(longitude)], axis=-1)
    up = direction[..., 1:2]
    above = 1.0 / (1.0 + np.exp(-25.0 * up))
    blue = np.array([0.35, 0.5, 0.85]) + np.array([0.55, 0.4, 0.1]) * (1.0 - np.clip(up, 0.0, 1.0)) ** 3
    found = above * blue + (1.0 - above) * np.array([0.3, 0.27, 0.24])
    for center, width, radiance in (
        ((0.6, 0.6, 0.4), 0.25, 4.0),
        ((-0.8, 0.35, 0.2), 0.18, 3.0),
        ((0.1, 0.3, -0.9), 0.2, 2.5),
    ):
        cosine = direction @ (np.array(center) / np.linalg.norm(center))
        found = found + radiance * np.exp(-2.0 * (1.0 - cosine) / width**2)[..., None]
    return found.astype(np.float32)


def described_sky(pixels: Array) -> dict[str, Any]:
    """The same for three.js, whose pictures begin at the bottom, and at +X in their middle."""
    turned = np.roll(pixels, -pixels.shape[1] // 4, axis=1)[::-1]
    opaque = np.concatenate([turned, np.ones((*turned.shape[:2], 1), np.float32)], axis=-1)
    return {"pixels": encoded(opaque, "f4"), "size": (pixels.shape[1], pixels.shape[0])}


def compare_materials(page: WebPage, path: Path, side: int) -> None:
    """Print errors of radiance over the body, and save truth, ours and three's side by side."""
    pixels, size = sky(), (side, side)
    rows = []
    for name, (mesh_name, color, distance, ior) in BODIES.items():
        mesh = load(mesh_name)
        medium = tl.Medium.from_color(color, distance=distance, ior=ior)
        camera = framing(mesh, (0.42, 0.1, 0.85))
        scene = tl.Scene([tl.Object(mesh, medium=medium)], camera, environment=tl.Environment.image(pixels))
        truth = tl.reference.render(scene, size, bounces=12).radiance
        path_lengths = Truth.of(mesh, camera, size)
        body = path_lengths.thickness > 0
        asked = {
            "mesh": described(mesh),
            "normals": encoded(mesh.vertex_normals, "f4"),
            "camera": described_camera(camera, size),
            "size": size,
            "sky": described_sky(pixels),
            "medium": {"ior": ior, "color": medium.transmittance(distance).tolist(), "distance": distance},
        }
        row = [truth]
        for kind, thickness in (
            ("TranslucentMaterial", None),
            ("MeshPhysicalMaterial", path_lengths.thickness[body].mean()),
        ):
            given = page.run(MATERIAL, {**asked, "thickness": thickness})
            row.append(decoded(given).reshape(side, side, 4)[::-1, :, :3])
            error = (row[-1] - truth)[body]
            whole = np.sqrt((error**2).mean()) / truth[body].mean()
            median = np.median(np.abs(error).mean(axis=1)) / truth[body].mean()
            print(f"{name}: {kind}: nRMSE {whole:.3f}, median {median:.4f} of the mean radiance", flush=True)
        rows.append(np.concatenate(row, axis=1))
    shown = np.clip(tl.formulas.color.linear_to_srgb(np.clip(0.8 * np.concatenate(rows), 0.0, 1.0)), 0.0, 1.0)
    picture = Image.fromarray((255.0 * shown + 0.5).astype(np.uint8))
    for i, title in enumerate(("float64 reference", "TranslucentMaterial", "MeshPhysicalMaterial")):
        ImageDraw.Draw(picture).text((i * side + 6, 4), title, fill=(255, 255, 255))
    picture.save(path)


def measure_mesh(page: WebPage, name: str, draws: int, rounds: int, options: dict[str, int]) -> None:
    """Print errors and times of a mesh."""
    mesh = load(name)
    camera = framing(mesh)
    found = measure(page, [described(mesh)], camera, SIZE, **options)
    errors = Errors.of(found, Truth.of(mesh, camera, SIZE), mesh.diagonal)
    print(
        f"{Path(name).stem}, {len(mesh.faces)} triangles: median {errors.median:.1e}, p99.9 {errors.p999:.1e} "
        f"({errors.p999_off_edges:.1e} off edges), wrong {errors.wrong} + {errors.wrong_by_edges} by edges, "
        f"marked {errors.marked}, coverage {100 * errors.coverage:.3f} %",
        flush=True,
    )
    asked = {"mesh": described(mesh), "camera": described_camera(camera, SIZE), "size": SIZE, "options": options}
    page.run(TIMING, asked)
    took: dict[str, Any] = {kind: [] for kind in KINDS}
    for _ in range(rounds + 1):
        for kind, times in took.items():
            page.run("draw", [kind, 2])
            start = drawing_time()
            page.run("draw", [kind, draws])
            times.append(1e3 * (drawing_time() - start) / draws)
    page.run("forget")
    took = {kind: np.array(times[1:]) for kind, times in took.items()}
    ratios = {kind: np.quantile(took[kind] / took["depth"], (0.25, 0.5, 0.75)) for kind in ("sums", "whole")}
    told = ", ".join(f"{kind} {q[1]:.2f} ({q[0]:.2f} to {q[2]:.2f})" for kind, q in ratios.items())
    print(f"    depth-only {np.median(took['depth']):.1f} ms; over it: {told}", flush=True)


def drawing_time() -> float:
    """Seconds of processor time that Chromium's process for drawing has used, whatever else runs here."""
    nanoseconds = 0
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if b"--type=gpu-process" in (folder / "cmdline").read_bytes() and is_ours(int(folder.name)):
                # Of each thread: the clock of a process goes in steps of 10 ms.
                for thread in folder.glob("task/*/schedstat"):
                    nanoseconds += int(thread.read_text().split()[0])
    return 1e-9 * nanoseconds


def is_ours(pid: int) -> bool:
    """True if a process descends from this one."""
    while pid > 1 and pid != os.getpid():
        pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    return pid == os.getpid()


def launch(playwright: Any, angle: str) -> Browser:
    options = [one for one in CHROMIUM_OPTIONS if "swiftshader" not in one or angle == "swiftshader"]
    options += [] if angle == "swiftshader" else [f"--use-angle={angle}"]
    browser: Browser = playwright.chromium.launch(executable_path=find_chromium(), args=options)
    return browser


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="*", default=["knot", "bear"])
    parser.add_argument("--angle", default="swiftshader", help="what Chromium draws with")
    parser.add_argument("--refine", type=int, choices=(1, 3, 5), help="pixels along each side of a pixel")
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--materials", type=Path, help="compare materials, into this picture")
    parser.add_argument("--side", type=int, default=192, help="pixels of each of its pictures")
    arguments = parser.parse_args()
    with sync_playwright() as playwright:
        browser = launch(playwright, arguments.angle)
        page = WebPage(browser, (300, 150))
        prepare(page, ROOT / "web" / "dist")
        if arguments.materials:
            compare_materials(page, arguments.materials, arguments.side)
        else:
            for name in arguments.meshes:
                options = {"refine": arguments.refine} if arguments.refine else {}
                measure_mesh(page, name, arguments.draws, arguments.rounds, options)
        if page.errors:
            raise SystemExit(f"error: the page said {page.errors}")
        browser.close()


if __name__ == "__main__":
    main()
