"""Scenes for the exact thickness pass in a page, and its pixels beside the float64 truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import translucent as tl
from tests.browser.pages import WebPage, decoded, encoded
from translucent.reference.hits import camera_hits

Array = npt.NDArray[Any]
TOOLS = Path(__file__).with_name("tools.js")

#: Errors above this share of the diagonal are wrong numbers, away from edges.
WRONG = 1e-3


@dataclass(frozen=True)
class Measured:
    """What the pass gave, top row first."""

    thickness: Array
    count: Array
    valid: Array
    covered: Array

    @classmethod
    def of(cls, pixels: dict[str, Any]) -> Measured:
        """From what `tools.pixels` gives."""
        shape = pixels["height"], pixels["width"]
        kinds = {"thickness": "f4", "count": "f4", "valid": "u1", "covered": "u1"}
        arrays = {name: decoded(pixels[name], kind).reshape(shape) for name, kind in kinds.items()}
        return cls(arrays["thickness"], arrays["count"], arrays["valid"] > 0, arrays["covered"] > 0)


@dataclass(frozen=True)
class Truth:
    """Metres inside a mesh along the rays of pixels, in float64, and how many surfaces each crosses."""

    thickness: Array
    crossed: Array

    @classmethod
    def of(cls, mesh: tl.Mesh, camera: tl.Camera, size: tuple[int, int], matrix: npt.ArrayLike | None = None) -> Truth:
        """Of one closed mesh that the eye is outside of."""
        hits = camera_hits(mesh, np.eye(4) if matrix is None else matrix, camera, size)
        pixels, shape = size[0] * size[1], size[::-1]
        sums = np.bincount(hits.pixel, -hits.sign * hits.distance, pixels).reshape(shape)
        return cls(sums, np.bincount(hits.pixel, minlength=pixels).reshape(shape))


@dataclass(frozen=True)
class Errors:
    """Errors as shares of the diagonal, where the 3 x 3 neighborhood of a pixel crosses equally many surfaces."""

    median: float
    p999: float
    wrong: int
    marked: int
    coverage: float
    pixels: int

    @classmethod
    def of(cls, found: Measured, truth: Truth, diagonal: float) -> Errors:
        """Of a picture; coverage is the share of covered pixels that one covers and the other does not."""
        inside = tl.interior(truth.crossed) & (truth.crossed > 0)
        error = np.abs(found.thickness.astype(np.float64) - truth.thickness)[inside & found.valid] / diagonal
        covered = truth.thickness > 0
        return cls(
            median=float(np.median(error)),
            p999=float(np.quantile(error, 0.999)),
            wrong=int((error > WRONG).sum()),
            marked=int((~found.valid).sum()),
            coverage=float((found.covered != covered).sum() / covered.sum()),
            pixels=error.size,
        )


def rounded(mesh: tl.Mesh) -> tl.Mesh:
    """The mesh as a page has it: positions in float32."""
    return tl.Mesh(mesh.vertices.astype(np.float32).astype(np.float64), mesh.faces)


def described(mesh: tl.Mesh, matrix: npt.ArrayLike | None = None) -> dict[str, Any]:
    """Mesh for `tools.mesh`."""
    told: dict[str, Any] = {"positions": encoded(mesh.vertices, "f4"), "index": encoded(mesh.faces, "u4")}
    if matrix is not None:
        told["matrix"] = np.asarray(matrix, dtype=np.float64).tolist()
    return told


def described_camera(camera: tl.Camera, size: tuple[int, int], **others: float) -> dict[str, Any]:
    """Camera for `tools.camera`."""
    aspect = size[0] / size[1]
    return {
        "pose": camera.pose.tolist(),
        "fov_y": camera.fov_y,
        "height": camera.height,
        "aspect": aspect,
        **others,
    }


MEASURE = """({ meshes, camera, size, options, context }) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const renderer = tools.renderer(...size, context);
    const scene = new THREE.Scene();
    const bodies = meshes.map((one) => tools.mesh(one));
    scene.add(...bodies);
    const pass = new ExactThicknessPass(renderer, { bodies, ...options });
    pass.render(scene, tools.camera(camera));
    const found = { ...tools.pixels(pass), precision: pass.precision };
    pass.dispose();
    renderer.dispose();
    renderer.forceContextLoss();
    renderer.domElement.remove();
    return found;
}"""


def prepare(page: WebPage, dist: Path) -> None:
    """Load the bundle and the tools into a page."""
    page.add_script(dist / "translucent-three.browser.js")
    page.add_script(TOOLS)


def measure(
    page: WebPage,
    meshes: Sequence[dict[str, Any]],
    camera: tl.Camera,
    size: tuple[int, int],
    camera_options: dict[str, float] | None = None,
    context: dict[str, Any] | None = None,
    **options: Any,
) -> Measured:
    """What the pass gives for meshes before a camera, in a page that is prepared."""
    told = described_camera(camera, size, **(camera_options or {}))
    asked = {"meshes": list(meshes), "camera": told, "size": size, "options": options, "context": context or {}}
    return Measured.of(page.run(MEASURE, asked))
