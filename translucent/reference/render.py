"""Ground truth of a picture: float64, on the CPU, from exact intervals."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked_but
from translucent.arrays import slices
from translucent.errors import InputError
from translucent.files.reading import require_memory
from translucent.formulas import optics
from translucent.frames.frame import Frame
from translucent.planning.limits import STRAIGHT
from translucent.planning.methods import Method
from translucent.planning.methods.base import check_method
from translucent.planning.passes import NoteKind
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.reference.compositing import composite, emission_of_mixtures
from translucent.reference.hits import Hits, Rays, line_hits, pixel_rays
from translucent.reference.intervals import scene_intervals
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.refracted import BOUNCES, PATHS, bends, refracted_light
from translucent.reference.scattering import scattered_once
from translucent.reference.surfaces import (
    OpaqueHits,
    nearest_opaque,
    reflected_radiance,
    scene_crossings,
    sheet_hits,
    sheet_thicknesses,
)
from translucent.reference.volume import Segments, Volume, volume_segments
from translucent.scene.camera import check_size
from translucent.scene.scene import Scene, check_scene

#: Number of surfaces, times objects, that are sorted at a time: the working arrays stay below 500 MB.
CHUNK = 1 << 24

#: Capabilities of the reference for the planner: rays are traced, and light is followed into media.
TRACED = Capabilities(shader_storage=False, opengl=False)

#: Bytes of memory that each pixel takes, at least: its ray, and what is found on it, in float64.
_PIXEL_BYTES = 200

#: Default relative error of scattered light.
TOLERANCE = 1e-6


@checked_but("scene", "size", "method")
def render(
    scene: Scene,
    size: tuple[int, int],
    method: Method | None = None,
    tolerance: float = TOLERANCE,
    refraction: bool | None = None,
    bounces: int = BOUNCES,
    paths: int = PATHS,
    seed: int = 0,
) -> Frame:
    """Render true thickness, transmittance and radiance of a scene.

    Radiance holds what is behind, what media emit, what they scatter of `Scene.ambient`, and the light of all lights
    that solid media scatter once; not what they scatter out of the environment, what sheets scatter out of lights, or
    what is scattered twice (`path_trace` has it all).
    Lights reach media and opaque objects through all bodies, straight on, and opaque objects throw shadows: bodies
    color them. So does the environment on opaque objects, in `Scene.environment_shadows` directions.

    Where light changes at the interfaces of bodies (`Object.has_interface`), radiance is that of rays that bend and
    split there; see `translucent.reference.refracted`. All else is that of the straight rays, also then. Lights reach
    media straight on. Of `Surface`, multiple scattering is left to `path_trace`, and surfaces of bodies do not emit.
    Layers (`Surface.opacity`) have their place in the order, and what they show is matt, as are opaque objects, which
    have their textures and holes.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    method : Method, optional
        `ThinLayer` makes every surface of a medium a sheet; a sheet's own declared thickness goes first. All other
        methods lead to the same true thickness.
    tolerance : float
        Relative error of scattered light, at most, 1e-12 to 1. All else is exact.
    refraction : bool, optional
        Whether rays bend. Default: if some object has an interface.
    bounces : int
        Interfaces that a refracted ray may hit.
    paths : int
        Rays of each pixel if an interface is rough; the error falls with their square root.
    seed : int
        Of the random numbers for these.

    Returns
    -------
    Frame
        Of float64 arrays; `shade_hits` says what is valid. Also invalid is a pixel whose scattered light misses the
        tolerance, since its ray hits a point light inside a medium, or comes through the hole of a body. With
        scattered light, ``provenance["scattering error"]`` is the largest estimated error of a valid pixel, relative to
        its brightest channel. With refracted rays, ``provenance["residual"]`` is the largest fraction of light in a
        valid pixel that was not followed to its end, and ``provenance["standard error"]`` the largest of a valid pixel.

    Raises
    ------
    InputError
        If the size is not one or takes more memory than is free, a number is not in its range, an interface has
        textures, or the planner refuses the scene.
    """
    start = time.perf_counter()
    check_scene(scene)
    size = check_size(size)
    check_method(method)
    if not 1e-12 <= tolerance <= 1:
        raise InputError(
            f"tolerance {tolerance}", "the tolerance must lie in 1e-12 to 1", f"use a value such as {TOLERANCE:g}"
        )
    bent = bends(scene) if refraction is None else refraction
    chosen = plan(scene, method if method is not None and method.makes_sheets else None, TRACED)
    chosen = _with_own_interfaces(chosen, bent)
    hits = scene_hits(scene, size)
    crossed = time.perf_counter()
    rays, sheets = pixel_rays(scene.camera, size), sheet_thicknesses(scene, method)
    scatters = scene.lights and not bent and Volume(scene).scatters
    light_paths = LightPaths(scene, sheets)
    light = SurfaceLight(light_paths)
    found = []
    surfaces = np.sum([np.bincount(line.pixel, minlength=len(rays)) for line in hits], axis=0)
    for part in slices(surfaces * len(hits), CHUNK):
        chosen_rays = np.arange(part.start, part.stop)
        own = rays.where(part), [line.on_rays(chosen_rays, len(rays)) for line in hits]
        shaded = shade_hits(scene, *own, sheets, light)
        if scatters:
            _add_scattered(shaded, *own, light, tolerance)
        found.append(shaded)
    arrays = {name: np.concatenate([shaded[name] for shaded in found]) for name in found[0]}
    provenance = {"backend": "reference", "numpy": np.__version__}
    if scatters:
        error = arrays.pop("error")[arrays["valid"]]
        provenance["scattering error"] = f"{error.max(initial=0.0):.1e}"
    if bent:
        refracted, noise = refracted_light(scene, size, method, tolerance, bounces, paths, seed)
        arrays["radiance"], arrays["valid"] = refracted.radiance, arrays["valid"] & refracted.valid
        for name, array in (("residual", refracted.residual), ("standard error", noise)):
            provenance[name] = f"{array[arrays['valid']].max(initial=0.0):.1e}"
    end = time.perf_counter()
    return Frame(
        **{name: array.reshape(size[::-1] + array.shape[1:]) for name, array in arrays.items()},
        plan=chosen,
        seconds={"intersect": crossed - start, "shade": end - crossed, "total": end - start},
        provenance=provenance,
        scene=scene,
    )


def _with_own_interfaces(chosen: RenderPlan, bent: bool) -> RenderPlan:
    """The plan with notes on interfaces as the reference treats them: by the whole ray tree, or not at all."""
    notes = [note for note in chosen.unmodelled if note.kind is not NoteKind.CUT_OFF_PATHS]
    if len(notes) < len(chosen.unmodelled) and not bent:
        notes.append(STRAIGHT)
    return replace(chosen, interfaces=None, unmodelled=tuple(notes))


def shade_hits(
    scene: Scene,
    rays: Rays,
    hits: Sequence[Hits],
    sheets: Sequence[float | None],
    light: SurfaceLight | None = None,
) -> dict[str, npt.NDArray[Any]]:
    """Shade rays from all surfaces on them, however these were found.

    Parameters
    ----------
    scene : Scene
    rays : Rays
        Of the scene's camera: all of a picture, or any of them.
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them: the surfaces behind the origins, too, and sorted.
        `Hits.pixel` is a number among `rays`.
    sheets : sequence of float or None
        Thickness in metres of the sheet that each object is, or None for a solid: see `sheet_thicknesses`.
    light : SurfaceLight, optional
        On surfaces of the scene. Default: one made for these rays.

    Returns
    -------
    dict of str to ndarray
        The arrays of a frame by their names, (n,) or (n, 3), float64 and bool. Covered is a ray that crosses a medium
        before an opaque surface stops it. Invalid is one that leaves a solid less often than it enters, or more often,
        also behind the opaque surface unless all holes of the solid are there; that a solid's faces wind around a
        negative number of times, or whose optical depth overflows.
    """
    light = light or SurfaceLight(LightPaths(scene, tuple(sheets)))
    media = crossed_media(light, rays, hits, sheets)
    segments, defective = media.segments, media.defective
    emitted, depth = composite(segments, len(rays))
    transmittance = optics.transmittance(depth)
    behind = radiance_behind(light, rays, media.wall)
    coverage = defective.copy()
    coverage[segments.pixel] = True
    with np.errstate(under="ignore"):
        radiance = behind * transmittance + emitted
    return {
        "radiance": radiance,
        "transmittance": transmittance,
        "optical_depth": depth,
        "thickness": np.bincount(segments.pixel, segments.count * segments.length, len(rays)).astype(np.float64),
        "coverage": coverage,
        "valid": ~defective & np.isfinite(depth).all(axis=1),
    }


@dataclass(frozen=True, eq=False)
class CrossedMedia:
    """Media and surfaces on rays up to the first opaque surface.

    Attributes
    ----------
    wall : OpaqueHits
        What stops them.
    segments : Segments
    filling : (k, n) float64
        What fills each segment; `Volume` explains it.
    defective : (n,) bool
        Rays on which some body shows a hole or faces wound wrongly.
    """

    wall: OpaqueHits
    segments: Segments
    filling: npt.NDArray[np.float64]
    defective: npt.NDArray[np.bool_]


def crossed_media(
    light: SurfaceLight, rays: Rays, hits: Sequence[Hits], sheets: Sequence[float | None]
) -> CrossedMedia:
    """Media on rays, from all surfaces on them; parameters as for `shade_hits`."""
    scene, volume = light.scene, light.paths.volume
    wall = nearest_opaque(scene, hits, len(rays))
    solids = [i for i, body in enumerate(scene.objects) if body.medium is not None and sheets[i] is None]
    intervals, defective = scene_intervals(scene, rays, hits, solids, wall.distance)
    crossings = scene_crossings(scene, rays, hits, sheets, wall.distance, light.on_interfaces)
    segments, filling = volume_segments(scene, volume, rays, intervals, crossings)
    segments = emission_of_mixtures(volume, rays, segments, filling)
    return CrossedMedia(wall, segments, filling, defective)


def radiance_behind(light: SurfaceLight, rays: Rays, wall: OpaqueHits) -> npt.NDArray[np.float64]:
    """(n, 3): radiance behind all media, of the environment or of the opaque surface."""
    return np.where(
        np.isinf(wall.distance)[:, None],
        light.scene.environment.radiance(rays.directions, rays.backdrop),
        reflected_radiance(light.scene, rays, wall, light.on_opaque),
    )


def _add_scattered(
    shaded: dict[str, npt.NDArray[Any]],
    rays: Rays,
    hits: Sequence[Hits],
    light: SurfaceLight,
    tolerance: float,
) -> None:
    """Add singly scattered light to the arrays of `shade_hits`, and its relative ``error`` (n,)."""
    media = crossed_media(light, rays, hits, light.paths.sheets)
    found = scattered_once(light.paths, rays, media.segments, media.filling, tolerance)
    brightest = found.radiance.max(axis=1)
    shaded["radiance"] = shaded["radiance"] + found.radiance
    shaded["valid"] = shaded["valid"] & found.valid
    shaded["error"] = found.error.max(axis=1) / np.where(brightest > 0, brightest, 1.0)


def hit_counts(scene: Scene, size: tuple[int, int]) -> npt.NDArray[np.int64]:
    """(h, w): number of surfaces of media on each pixel's ray before the first opaque one."""
    width, height = check_size(size)
    hits = scene_hits(scene, (width, height))
    end = nearest_opaque(scene, hits, width * height).distance
    counts = np.zeros(width * height, dtype=np.int64)
    for body, line in zip(scene.objects, hits, strict=True):
        if body.medium is not None:
            crossed = line.before(end) if body.sheet_thickness is None else sheet_hits(scene, body, line, end)
            counts += np.bincount(crossed.pixel, minlength=len(counts))
    return counts.reshape(height, width)


def opaque_counts(scene: Scene, size: tuple[int, int]) -> tuple[npt.NDArray[np.int64], ...]:
    """Two images (h, w): number of opaque surfaces on each pixel's ray, and index of the object of the nearest.

    Where neither changes, no edge of an opaque object is visible. Empty, if the scene has none.
    """
    if not scene.opaque:
        return ()
    width, height = check_size(size)
    hits = scene_hits(scene, (width, height))
    counts = np.zeros(width * height, dtype=np.int64)
    for body, line in zip(scene.objects, hits, strict=True):
        if body.medium is None:
            counts += np.bincount(line.pixel, minlength=len(counts))
    nearest = nearest_opaque(scene, hits, width * height).item
    return counts.reshape(height, width), nearest.reshape(height, width)


def scene_hits(scene: Scene, size: tuple[int, int]) -> list[Hits]:
    """All surfaces of each object on the pixel rays, as `line_hits` gives them."""
    width, height = check_size(size)
    found = f"{width * height / 1e6:.0f} million pixels"
    require_memory(f"frame size {width}x{height}", found, _PIXEL_BYTES * width * height, "give a smaller size")
    return [line_hits(body.mesh, body.matrix, scene.camera, size) for body in scene.objects]
