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
from translucent.reference.hits import Hits, PictureGrid, camera_hits, camera_vertices

Array = npt.NDArray[Any]
TOOLS = Path(__file__).with_name("tools.js")

#: Errors above this share of the diagonal are wrong numbers, away from edges.
WRONG = 1e-3

#: Pixels from the edge of a face within which a rasterizer's grid decides.
EDGE = 0.1


@dataclass(frozen=True)
class Measured:
    """Pixels that the pass gave, top row first."""

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
    """Metres inside a mesh along the rays of pixels, in float64.

    Attributes
    ----------
    thickness : (h, w) float64
    crossed : (h, w) int
        Surfaces on each ray.
    on_edge : (h, w) bool
        Rays that pass within a tenth of a pixel of the edge of a face that they meet. Rasterizers move vertices by up
        to half a step of their grid (SwiftShader: 1/16 pixel), so there they may show the face beside it.
    """

    thickness: Array
    crossed: Array
    on_edge: Array

    @classmethod
    def of(cls, mesh: tl.Mesh, camera: tl.Camera, size: tuple[int, int], matrix: npt.ArrayLike | None = None) -> Truth:
        """Thickness of one closed mesh that the eye is outside of."""
        matrix = np.eye(4) if matrix is None else np.asarray(matrix, np.float64)
        hits = camera_hits(mesh, matrix, camera, size)
        pixels, shape = size[0] * size[1], size[::-1]
        sums = np.bincount(hits.pixel, -hits.sign * hits.distance, pixels).reshape(shape)
        crossed = np.bincount(hits.pixel, minlength=pixels).reshape(shape)
        by_edge = hits.pixel[_to_edge(mesh, matrix, camera, size, hits) < EDGE]
        return cls(sums, crossed, (np.bincount(by_edge, minlength=pixels) > 0).reshape(shape))


def _to_edge(mesh: tl.Mesh, matrix: Array, camera: tl.Camera, size: tuple[int, int], hits: Hits) -> Array:
    """Pixels from each hit to the nearest edge of its face."""
    seen = camera_vertices(mesh, matrix, camera)
    weight = np.ones(len(seen)) if camera.fov_y is None else seen[:, 2]
    places = PictureGrid.of(camera, size).pixels(seen[:, :2], weight) / weight[:, None]
    corners = places[mesh.faces[hits.face]]
    row, column = np.divmod(hits.pixel, size[0])
    found = np.full(len(hits.pixel), np.inf)
    for k in range(3):
        edge, to = corners[:, (k + 1) % 3] - corners[:, k], np.stack([column, row], axis=1) - corners[:, k]
        across = np.abs(edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0])
        found = np.minimum(found, across / np.maximum(np.hypot(*edge.T), 1e-12))
    return found


@dataclass(frozen=True)
class Errors:
    """Errors as shares of the diagonal, where the 3 x 3 neighborhood of a pixel crosses equally many surfaces.

    Attributes
    ----------
    median, p999 : float
        Of all of these.
    p999_off_edges : float
        Without rays by edges of faces.
    wrong : int
        Pixels off edges, called valid, by more than WRONG.
    wrong_by_edges : int
        By edges.
    marked : int
        Pixels called invalid, anywhere.
    coverage : float
        Pixels that one covers and the other does not, as a share of those covered.
    """

    median: float
    p999: float
    p999_off_edges: float
    wrong: int
    wrong_by_edges: int
    marked: int
    coverage: float
    pixels: int

    @classmethod
    def of(cls, found: Measured, truth: Truth, diagonal: float) -> Errors:
        """Values of a picture."""
        inside = tl.interior(truth.crossed) & (truth.crossed > 0)
        used = inside & found.valid
        error = np.abs(found.thickness.astype(np.float64) - truth.thickness)[used] / diagonal
        off = ~truth.on_edge[used]
        covered = truth.thickness > 0
        return cls(
            median=float(np.median(error)),
            p999=float(np.quantile(error, 0.999)),
            p999_off_edges=float(np.quantile(error[off], 0.999)),
            wrong=int((error[off] > WRONG).sum()),
            wrong_by_edges=int((error[~off] > WRONG).sum()),
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


MEASURE = """({ meshes, opaque, camera, size, options }) => tools.withRenderer(size, (renderer) => {
    const { THREE, ExactThicknessPass } = translucentThree;
    const scene = new THREE.Scene();
    const bodies = meshes.map((one) => tools.mesh(one));
    scene.add(...bodies, ...opaque.map((one) => tools.mesh(one, new THREE.MeshBasicMaterial())));
    return tools.measured(new ExactThicknessPass(renderer, { bodies, ...options }), scene, camera);
})"""


def prepare(page: WebPage, dist: Path) -> None:
    """Load the bundle and the tools into a page."""
    page.add_script(dist / "translucent-three.browser.js")
    page.add_script(TOOLS)


def measure(
    page: WebPage,
    meshes: Sequence[dict[str, Any]],
    camera: tl.Camera,
    size: tuple[int, int],
    opaque: Sequence[dict[str, Any]] = (),
    **options: Any,
) -> Measured:
    """Measure meshes before a camera, in a page that is prepared."""
    told = described_camera(camera, size)
    asked = {"meshes": list(meshes), "opaque": list(opaque), "camera": told, "size": size, "options": options}
    return Measured.of(page.run(MEASURE, asked))


def framing(mesh: tl.Mesh, ahead: tuple[float, float, float] = (0.5, 0.35, 1.0)) -> tl.Camera:
    """Camera that sees all of a mesh, from the front right and above."""
    center = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return tl.Camera.look_at(center + mesh.diagonal * np.array(ahead), center, fov_y=45.0)
