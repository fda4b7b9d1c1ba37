"""The ground truth of a picture: float64, on the CPU, from exact intervals."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from translucent import optics
from translucent.camera import check_size
from translucent.frame import Frame
from translucent.plan import plan
from translucent.reference.hits import Hits, camera_hits
from translucent.reference.intervals import scene_intervals
from translucent.scene import Object, Scene
from translucent.thickness import Method, ThinLayer

Array = npt.NDArray[np.float64]

#: A body's thickness may be this share of the scene's diagonal below 0 by rounding.
ROUNDING = 1e-9


class _Paths(NamedTuple):
    """What the rays cross: thickness (objects, pixels) in metres; covered and valid pixels (pixels,)."""

    thickness: Array
    coverage: npt.NDArray[np.bool_]
    valid: npt.NDArray[np.bool_]


def render(scene: Scene, size: tuple[int, int], method: Method | None = None) -> Frame:
    """True thickness, transmittance and radiance of a scene.

    Parameters
    ----------
    scene : Scene
        Overlapping bodies add up.
    size : (width, height)
        In pixels.
    method : Method, optional
        `ThinLayer` makes every surface a sheet; a sheet's own declared thickness goes first. All other methods are
        ways to the same true thickness.

    Returns
    -------
    Frame
        Of float64 arrays. Invalid are pixels where entries and exits of a solid do not balance, or where faces wound
        inwards make a thickness negative.

    Raises
    ------
    InputError
        If the size is not one, or the planner refuses the scene.
    """
    start = time.perf_counter()
    size = check_size(size)
    chosen = plan(scene, method if isinstance(method, ThinLayer) else None)
    paths = _paths(scene, size, [_sheet_thickness(body, method) for body in scene.objects])
    crossed = time.perf_counter()
    arrays = {
        name: np.ascontiguousarray(array.reshape(size[::-1] + array.shape[1:]))
        for name, array in _shade(scene, size, paths).items()
    }
    end = time.perf_counter()
    return Frame(
        **arrays,
        plan=chosen,
        seconds={"intersect": crossed - start, "shade": end - crossed, "total": end - start},
        provenance={"backend": "reference", "numpy": np.__version__},
    )


def hit_counts(scene: Scene, size: tuple[int, int]) -> npt.NDArray[np.int64]:
    """(h, w): how many surfaces of all objects each pixel's ray crosses."""
    width, height = check_size(size)
    counts = np.zeros(width * height, dtype=np.int64)
    for body in scene.objects:
        counts += np.bincount(camera_hits(body.mesh, body.matrix, scene.camera, size).pixel, minlength=len(counts))
    return counts.reshape(height, width)


def _sheet_thickness(body: Object, method: Method | None) -> float | None:
    """Thickness of the sheet that an object is, in metres; None for a solid."""
    if body.sheet_thickness is None and isinstance(method, ThinLayer):
        return method.thickness
    return body.sheet_thickness


def _paths(scene: Scene, size: tuple[int, int], sheets: Sequence[float | None]) -> _Paths:
    """Thickness of each object along each ray; `sheets` tells what each is, as `_sheet_thickness` does."""
    pixels = size[0] * size[1]
    intervals, bad = scene_intervals(scene, size, [i for i, sheet in enumerate(sheets) if sheet is None])
    cell = intervals.body * pixels + intervals.pixel
    cells = len(scene.objects) * pixels
    thickness: Array = np.bincount(cell, intervals.thickness, cells).reshape(-1, pixels).astype(np.float64)
    coverage = bad.copy()
    coverage[intervals.pixel] = True
    bad |= ~(thickness >= -ROUNDING * scene.diagonal).all(axis=0)
    for i, (body, sheet) in enumerate(zip(scene.objects, sheets, strict=True)):
        if sheet is not None:
            hits = camera_hits(body.mesh, body.matrix, scene.camera, size)
            thickness[i] = np.bincount(hits.pixel, _sheet_paths(scene, size, body, hits, sheet), pixels)
            coverage[hits.pixel] = True
    return _Paths(thickness, coverage, ~bad)


def _sheet_paths(scene: Scene, size: tuple[int, int], body: Object, hits: Hits, metres: float) -> Array:
    """(k,): path in metres through the sheet at each hit, by the normal of its face."""
    _, directions = scene.camera.rays(size)
    normals = body.mesh.face_normals[hits.face] @ np.linalg.inv(body.matrix[:3, :3])
    length = np.linalg.norm(normals, axis=1)
    normals /= np.where(length > 0, length, 1.0)[:, None]
    # The normals look to the side from which the faces are counter-clockwise: towards the viewer at a front face.
    outwards = -1 if body.mesh.diagnosis.inverted else 1
    cosine = -outwards * hits.sign * np.einsum("ki,ki->k", normals, directions.reshape(-1, 3)[hits.pixel])
    return optics.thin_layer_thickness(metres, cosine, body.medium.ior if body.medium else 1.0)


def _shade(scene: Scene, size: tuple[int, int], paths: _Paths) -> dict[str, npt.NDArray[np.generic]]:
    """The arrays of the frame, pixel by pixel: (pixels,) or (pixels, 3)."""
    media = [body.medium for body in scene.bodies if body.medium is not None]
    clamped = np.maximum(paths.thickness, 0.0)
    depth = np.einsum("bp,bc->pc", clamped, np.stack([medium.extinction for medium in media]))
    total = clamped.sum(axis=0)
    transmittance = optics.transmittance(depth)
    _, directions = scene.camera.rays(size)
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    backdrop = (np.stack([column, row], axis=-1) + 0.5) / size[1]
    radiance = scene.environment.radiance(directions.reshape(-1, 3), backdrop) * transmittance
    if media[0].emits:
        # The planner lets emission pass only where all media are alike, so their order does not matter.
        radiance += optics.emitted_radiance(media[0].emission, media[0].extinction, total[:, None])
    return {
        "radiance": radiance,
        "transmittance": transmittance,
        "optical_depth": depth,
        "thickness": total,
        "coverage": paths.coverage,
        "valid": paths.valid & np.isfinite(depth).all(axis=1),
    }
