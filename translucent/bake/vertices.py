"""Baking thickness per vertex."""

from __future__ import annotations

import dataclasses
import time
import warnings
from contextlib import closing
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bake.bake import check_threads, escape_warnings
from translucent.bake.baked import BakeReport
from translucent.bake.measure import Measure, Measured
from translucent.bake.settings import BakeSettings, settings_from
from translucent.bake.surface import Surface
from translucent.bake.thickness_map import VertexThickness
from translucent.bake.work import Progress, in_order
from translucent.errors import InputError, TranslucentWarning
from translucent.geometry.grouping import position_ids
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_angles

#: Distance from its vertex of the point that stands for a face's corner, as a share of the way to the other two.
CORNER = 1e-3

#: Settings without meaning for vertices.
_OF_MAPS: dict[str, Any] = {"size": 1, "supersample": 1, "padding": 0, "tile": None, "high_distance": None}

#: Number of corners that a thread takes at a time.
PART = 1 << 13


def bake_vertex_thickness(
    mesh: Mesh,
    settings: BakeSettings | str | None = None,
    *,
    threads: int | None = None,
    progress: Progress | None = None,
    **given: Any,
) -> VertexThickness:
    """Bake the thickness of a mesh under each vertex.

    A vertex has the mean over the corners of its faces, weighted by their angles; rays start in each of them, very near
    the vertex. So vertices on hard edges are defined, and vertices at the same position are equal.

    Parameters
    ----------
    mesh : Mesh
    settings : BakeSettings, optional
        How to bake; rays are per corner, and what is of maps has no effect. A text is short for its `mode`.
    threads : int, optional
        Default: as many as there are processors.
    progress : callable, optional
        Called in this thread with (corners done, all corners, rays traced).
    **given
        Fields of `BakeSettings` by name, instead of those of `settings`; none that is of maps.

    Returns
    -------
    VertexThickness

    Raises
    ------
    InputError
        If a setting is outside its range, or all faces look inwards or have no area.
    RenderError
        If embreex is not installed.

    Warns
    -----
    TranslucentWarning
        If rays escape through holes.
    """
    started = time.perf_counter()
    if wrong := sorted(set(_OF_MAPS) & set(given)):
        raise InputError("thickness per vertex", f"{wrong[0]} is of maps", "leave it out")
    settings = dataclasses.replace(settings_from(settings, "mode", given), **_OF_MAPS)
    threads = check_threads(threads)
    surface = Surface.of(mesh)
    parts = _measure_corners(surface, settings, threads, progress)
    corner = np.concatenate([part.values for part in parts]), np.concatenate([part.errors for part in parts])
    values, errors = _at_vertices(mesh, surface, *corner)
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces[surface.faces]] = True
    report = _report(mesh, surface, parts, errors[used], time.perf_counter() - started)
    for text in report.warnings:
        warnings.warn(f"mesh {mesh.name!r}: {text}", TranslucentWarning, stacklevel=2)
    return VertexThickness(values, errors, mesh, settings, report)


def _measure_corners(
    surface: Surface, settings: BakeSettings, threads: int, progress: Progress | None
) -> list[Measured]:
    measure, count = Measure.of(surface, settings), 3 * len(surface.faces)
    parts: list[Measured] = []

    def bake(begin: int) -> Measured:
        face, corner = np.divmod(np.arange(begin, min(begin + PART, count)), 3)
        weights = np.full((len(face), 3), CORNER)
        weights[np.arange(len(face)), corner] = 1.0 - 2.0 * CORNER
        return measure.at(surface.points(face, weights))

    with closing(in_order(bake, range(0, count, PART), threads, measure.stop)) as baked:
        for part in baked:
            parts.append(part)
            if progress is not None:
                progress(sum(len(one.values) for one in parts), count, sum(one.traced for one in parts))
    return parts


def _at_vertices(
    mesh: Mesh, surface: Surface, values: Array, errors: Array
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """(n,), (n,): means over the corners (3 m,) at each position, and their standard errors."""
    position = position_ids(mesh.vertices)
    at = position[mesh.faces[surface.faces]].ravel()
    angle = corner_angles(surface.corners).ravel()
    count = len(mesh.vertices)
    with np.errstate(under="ignore"):
        total = np.bincount(at, weights=angle, minlength=count)
        total = np.where(total > 0, total, 1.0)
        mean = np.bincount(at, weights=angle * values, minlength=count) / total
        error = np.sqrt(np.bincount(at, weights=(angle * errors) ** 2, minlength=count)) / total
        return mean[position].astype(np.float32), error[position].astype(np.float32)


def _report(
    mesh: Mesh, surface: Surface, parts: list[Measured], errors: npt.NDArray[np.float32], seconds: float
) -> BakeReport:
    traced, cast, escaped, above = (
        sum(getattr(part, name) for part in parts) for name in ("traced", "cast", "escaped", "above")
    )
    degenerate = len(mesh.faces) - len(surface.faces)
    said = escape_warnings(escaped / cast, mesh.diagnosis.closed)
    if degenerate:
        said.append(f"{degenerate} faces without area are left out")
    if above:
        said.append(f"{above} samples stay above the tolerance with the most rays that they may have")
    return BakeReport(
        rays=traced,
        seconds=seconds,
        mrays_per_second=traced / seconds / 1e6,
        samples=3 * len(surface.faces),
        texels=0,
        overlapping_texels=0,
        faces_without_texel=0,
        degenerate_faces=degenerate,
        udim_tiles=(),
        uv_from="",
        escaped=escaped / cast,
        missed=0.0,
        mean_standard_error=float(errors.mean()),
        max_standard_error=float(errors.max()),
        above_tolerance=above,
        warnings=tuple(said),
    )
