"""Baking thickness: from a mesh to a map over its texture coordinates, or to a value per vertex, in metres."""

from __future__ import annotations

import dataclasses
import time
import warnings
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array, Floats
from translucent.bake.atlas import Atlas, Unwrapped, in_tile, pad, unwrap
from translucent.bake.measure import Measure, Measured
from translucent.bake.rays import PreparedMesh
from translucent.bake.settings import BakeSettings, settings_from
from translucent.bake.strips import Canvas, Checkpoint, Progress, Projection, Strips, bake_key, bake_strips, in_order
from translucent.bake.thickness_map import BakeReport, ThicknessMap, VertexThickness
from translucent.errors import InputError, TranslucentWarning
from translucent.files.paths import require_output
from translucent.geometry.grouping import position_ids
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_angles
from translucent.threads import processors

#: Fraction of the surface that may have no texel of its own before a warning, and how many texels per face a map
#: has that could show all.
MOST_HIDDEN, ENOUGH_TEXELS = 0.1, 4

#: Distance from a vertex to the point where the corner of a face is measured, as a fraction of that to the others.
CORNER = 1e-3

#: Settings without meaning for vertices.
_OF_MAPS: dict[str, Any] = {"size": 1, "supersample": 1, "padding": 0, "tile": None, "high_distance": None}

#: Number of corners that a thread takes at a time.
PART = 1 << 13


@checked
def bake_thickness(
    mesh: Mesh,
    settings: BakeSettings | int | None = None,
    *,
    high: Mesh | None = None,
    cage: Mesh | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    **given: Any,
) -> ThicknessMap:
    """Bake the thickness of a mesh under each texel of its texture coordinates.

    Each texel shows the point of the mesh at its center, or the nearest point of a triangle that touches it. Rays go
    from there into the mesh, around the inward smooth normal; the mode of
    the settings makes one number of their lengths.

    Parameters
    ----------
    mesh : Mesh
        With uv, or xatlas makes them. It should be closed; see `ThicknessMap.escaped`.
    settings : BakeSettings, optional
        How to bake; an integer is short for its `size`.
    high : Mesh, optional
        Detailed mesh whose thickness is baked to the texture coordinates of `mesh`.
    cage : Mesh, optional
        `mesh` with its vertices moved outwards: points of `high` are looked for from there, through the point of
        `mesh`, and as far again behind it.
    threads : int, optional
        Default: as many as there are processors.
    progress : callable, optional
        Called in this thread with (texels done, all texels of the map, rays traced).
    checkpoint : Path, optional
        File that keeps finished parts of the map, every few seconds, until it is done. A bake with the same mesh and
        settings that finds it goes on from there.
    **given
        Fields of `BakeSettings` by name, instead of those of `settings`.

    Returns
    -------
    ThicknessMap

    Raises
    ------
    InputError
        If a setting is outside its range; if there are no texture coordinates and no xatlas, or they cannot be used; if
        all faces look inwards or have no area; if the checkpoint is of another bake.
    RenderError
        If embreex is not installed, or the checkpoint cannot be written.

    Warns
    -----
    TranslucentWarning
        If rays escape through holes, texture coordinates overlap, or parts of the mesh get no value.
    """
    started = time.perf_counter()
    settings = settings_from(settings, "size", given)
    _check_high(high, cage, settings.high_distance)
    threads = check_threads(threads)
    if checkpoint is not None:
        require_output(Path(checkpoint), f"checkpoint {str(checkpoint)!r}")
    unwrapped = unwrap(mesh, settings.size, settings.tile)
    strips = _strips(mesh, unwrapped, settings, high, cage)
    canvas = Canvas(settings.size, len(strips.low.faces), -(-settings.size // strips.rows))
    kept = None if checkpoint is None else Checkpoint(Path(checkpoint), bake_key(settings, mesh, high, cage))
    if kept is not None:
        kept.read(canvas)
    before = canvas.count("traced")
    bake_strips(strips, canvas, threads, progress, kept)
    pad(canvas.values, canvas.valued, settings.padding)
    traced = canvas.count("traced") - before
    report = _map_report(unwrapped, strips, canvas, traced, time.perf_counter() - started)
    if kept is not None:
        kept.remove()
    for text in report.warnings:
        warnings.warn(f"mesh {mesh.name!r}: {text}", TranslucentWarning, stacklevel=3)
    return ThicknessMap(canvas.values, canvas.coverage, canvas.errors, report.escaped, unwrapped.mesh, settings, report)


def _check_high(high: Mesh | None, cage: Mesh | None, high_distance: float | None) -> None:
    if high is None and (cage is not None or high_distance is not None):
        raise InputError(
            "a cage or a ray distance is set",
            "no detailed mesh (high) is given",
            "give the detailed mesh with high=, or omit cage and ray distance",
        )
    if cage is not None and high_distance is not None:
        raise InputError(
            "both a cage and a ray distance are set",
            "each of them determines where rays search for the detailed mesh",
            "give either the cage or the distance",
        )


def _strips(mesh: Mesh, unwrapped: Unwrapped, settings: BakeSettings, high: Mesh | None, cage: Mesh | None) -> Strips:
    low = PreparedMesh.of(unwrapped.mesh)
    uv = unwrapped.uv[low.faces]
    charted = np.arange(len(uv)) if settings.tile is None else np.flatnonzero(in_tile(uv, settings.tile))
    side = settings.size * settings.supersample
    atlas = Atlas(uv[charted], side, side)
    if high is None:
        return Strips(low, charted, atlas, Measure(low, settings), None)
    detailed = PreparedMesh.of(high)
    projection = Projection.of(low, unwrapped, detailed, mesh, cage, settings.high_distance)
    return Strips(low, charted, atlas, Measure(detailed, settings), projection)


@checked
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
        raise InputError(
            "thickness is baked per vertex", f"{wrong[0]} applies only to thickness maps", "omit this setting"
        )
    settings = dataclasses.replace(settings_from(settings, "mode", given), **_OF_MAPS)
    threads = check_threads(threads)
    surface = PreparedMesh.of(mesh)
    parts = _measure_corners(surface, settings, threads, progress)
    corner = np.concatenate([part.values for part in parts]), np.concatenate([part.errors for part in parts])
    values, errors = _at_vertices(mesh, surface, *corner)
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces[surface.faces]] = True
    counts = {name: sum(getattr(part, name) for part in parts) for name in ("traced", "cast", "escaped", "above")}
    counts["samples"] = 3 * len(surface.faces)
    degenerate = len(mesh.faces) - len(surface.faces)
    report = _report(mesh, errors[used], counts, degenerate, time.perf_counter() - started, [])
    for text in report.warnings:
        warnings.warn(f"mesh {mesh.name!r}: {text}", TranslucentWarning, stacklevel=3)
    return VertexThickness(values, errors, mesh, settings, report)


def _measure_corners(
    surface: PreparedMesh, settings: BakeSettings, threads: int, progress: Progress | None
) -> list[Measured]:
    measure, count = Measure(surface, settings), 3 * len(surface.faces)
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
    mesh: Mesh, surface: PreparedMesh, values: Array, errors: Array
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


def check_threads(threads: Any) -> int:
    """Number of threads to use; raises `InputError` for less than one."""
    if threads is None:
        return processors()
    if not (hasattr(threads, "__index__") and threads >= 1):
        raise InputError(
            f"threads {threads!r}",
            "the number of threads must be a whole number above 0",
            "omit the setting to use all processors",
        )
    return int(threads)


def _map_report(unwrapped: Unwrapped, strips: Strips, canvas: Canvas, traced: int, seconds: float) -> BakeReport:
    doubts = []
    if overlapping := canvas.count("overlapping"):
        doubts.append(f"{overlapping} texels lie in several triangles in UV space, and use the first triangle")
    hidden = ~canvas.owners[strips.shown]
    a, b, c = strips.low.corners[strips.shown].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    fraction = float(area[hidden].sum() / area.sum())
    if fraction > MOST_HIDDEN and canvas.size**2 > ENOUGH_TEXELS * len(hidden):
        count = f"{hidden.sum()} of {len(hidden)} faces, {fraction:.0%} of the surface,"
        doubts.append(f"{count} have no texel: they are too small in UV space, or overlap other faces there")
    if missed := canvas.count("missed") / max(canvas.count("samples"), 1):
        doubts.append(f"{missed:.2%} of the samples missed the detailed mesh, and use values of neighbors")
    report = _report(
        unwrapped.mesh if strips.projection is None else None,
        canvas.errors[canvas.valued],
        {name: canvas.count(name) for name in ("samples", "cast", "escaped", "above")} | {"traced": traced},
        len(unwrapped.mesh.faces) - len(strips.low.faces),
        seconds,
        doubts,
    )
    return dataclasses.replace(
        report,
        texels=int(canvas.coverage.sum()),
        overlapping_texels=overlapping,
        faces_without_texel=int(hidden.sum()),
        udim_tiles=tuple(tile for tile in unwrapped.tiles if tile),
        uv_from=unwrapped.made_by,
        missed=missed,
        warnings=(*unwrapped.warnings, *report.warnings),
    )


def _report(
    mesh: Mesh | None, errors: Floats, counts: dict[str, int], degenerate: int, seconds: float, doubts: list[str]
) -> BakeReport:
    """Report on rays from points of a mesh; with None, holes are not searched for."""
    said, escaped = [], counts["escaped"] / max(counts["cast"], 1)
    if escaped:
        holes = mesh is not None and not mesh.diagnosis.closed
        reason = "the mesh has holes" if holes else "faces are missing or point inwards"
        said = [f"{escaped:.2%} of the rays found no exit ({reason}): they count as max_distance, or not at all"]
    said += doubts
    if degenerate:
        said.append(f"{degenerate} faces without an area were left out")
    if counts["above"]:
        said.append(f"{counts['above']} samples have an error above the tolerance even with the largest number of rays")
    return BakeReport(
        rays=counts["traced"],
        seconds=seconds,
        mrays_per_second=counts["traced"] / seconds / 1e6,
        samples=counts["samples"],
        degenerate_faces=degenerate,
        escaped=escaped,
        mean_standard_error=float(errors.mean()) if errors.size else 0.0,
        max_standard_error=float(errors.max()) if errors.size else 0.0,
        above_tolerance=counts["above"],
        warnings=tuple(said),
    )
