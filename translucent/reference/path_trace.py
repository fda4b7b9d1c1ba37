"""Monte Carlo path tracing through media and interfaces: all light that finds its way, with error bars."""

from __future__ import annotations

import time

import numpy as np

from translucent.arrays import Array, Integers
from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.planning.methods import SignedDepth
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.reference.interface_paths import InterfacePaths
from translucent.reference.interfaces import Optics
from translucent.reference.light_paths import LightPaths
from translucent.reference.rays import Rays, pixel_rays
from translucent.reference.refracted import RayEnds
from translucent.reference.refraction import check_untextured
from translucent.reference.render import scene_hits, shade_hits
from translucent.reference.sheets import sheet_thicknesses
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.camera import check_size
from translucent.scene.scene import Scene

#: Number of paths that are followed together: the working arrays stay below 500 MB.
BENT_BATCH = 1 << 16

#: Largest optical depth of a scene without a limit on events: light is scattered about as often as its square.
MAX_DEPTH = 1e4


def path_trace(
    scene: Scene, size: tuple[int, int], paths: int = 64, seed: int = 0, max_events: int | None = None
) -> tuple[Frame, Array]:
    """Path trace a scene, with multiple scattering of all lights, of the environment and of emission.

    Where interfaces change light (`Object.has_interface`), each path is reflected or refracted by chance: by Fresnel
    between the media of its interior list (Schmidt & Budge 2002), at rough interfaces by a walk among GGX microfacets
    that loses nothing (Heitz et al. 2016). Sheets, tints, diffuse bases, dispersion and smooth normals are what they
    are for `render`, without a limit of bounces. Radiance is basic radiance L / n^2, as there.

    Point and directional lights are followed straight on, and through the microfacets of rough interfaces. What
    polished interfaces bend of them no path finds: caustics, and light in media behind such interfaces. The plan tells
    where this leaves out something. Light of the environment is all there.

    Opaque surfaces and diffuse bases reflect as they do for `render`, and a backdrop fixed to the picture lights like
    the mean of its squares. Light inside a medium has no finite variance: there the error bars say little. Nor do they
    with few paths before rare bright reflections.

    Parameters
    ----------
    scene : Scene
        Its bodies are closed or sheets, and no sheet scatters.
    size : (width, height)
        In pixels.
    paths : int
        Of each pixel and channel, from 2; the error falls with their square root.
    seed : int
        Of the random numbers.
    max_events : int, optional
        Light scattered more often is left out; 1 is single scattering. Default: no limit.

    Returns
    -------
    frame : Frame
        Of float64 arrays; all but the radiance is exact.
    standard_error : (h, w, 3) float64
        Of the radiance.

    Raises
    ------
    InputError
        If an argument is not in its range, a body is open, a sheet scatters, an interface has textures, the media are
        too deep, or radiance is ambient.
    """
    began = time.perf_counter()
    width, height = check_size(size)
    _check(scene, paths, max_events)
    light = LightPaths(scene, sheet_thicknesses(scene))
    with np.errstate(over="ignore"):
        depth = 2.0 * light.tracer.radius * float(light.volume.extinction.max())
    if max_events is None and depth > MAX_DEPTH:
        raise InputError(
            "path tracing", f"media up to {depth:.0e} deep, in which light is lost for ages", "give max_events"
        )
    rays = pixel_rays(scene.camera, (width, height))
    surface = SurfaceLight(light)
    arrays = shade_hits(scene, rays, scene_hits(scene, (width, height)), light.sheets, surface)
    rng = np.random.default_rng(seed)
    radiance, error = np.zeros((2, len(rays), 3))
    optics = [Optics(scene, light.sheets, channel) for channel in range(3)]
    ends = RayEnds(surface, width / height)
    for channels in _alike(np.concatenate([light.volume.scattering, np.stack([own.iors for own in optics], axis=1)])):
        tracer = InterfacePaths(surface, ends, optics[channels[0]], channels, max_events, rng)
        radiance[:, channels], error[:, channels] = _estimate(tracer, rays, paths)
    arrays["radiance"] = radiance
    reason = (
        f"asked for: {paths} paths for each pixel, scattered {'without limit' if max_events is None else max_events}"
    )
    frame = Frame(
        **{name: array.reshape(height, width, *array.shape[1:]) for name, array in arrays.items()},
        plan=RenderPlan(
            scene,
            SignedDepth(),
            (PassSpec(PassName.PATH_TRACE, reason),),
            limits=(Note(NoteKind.NOISE, "radiance has noise"),),
            unmodelled=_left_out(scene),
        ),
        seconds={"total": time.perf_counter() - began},
        provenance={"backend": "reference", "numpy": np.__version__},
        scene=scene,
    )
    return frame, error.reshape(height, width, 3)


def _check(scene: Scene, paths: int, max_events: int | None) -> None:
    if scene.scatters_ambient:
        raise InputError(
            "path tracing with ambient radiance",
            "it stands for what paths find by themselves: light of the environment, and light scattered often",
            "leave ambient out",
        )
    if paths < 2:
        raise InputError(f"path tracing with {paths} paths", "no spread without two", "use for example 64")
    if max_events is not None and max_events < 0:
        raise InputError(f"max_events {max_events}", "below 0", "use 1 for single scattering, None for no limit")
    check_untextured(scene, "use tl.reference.render with refraction=False", random=True)
    for body in scene.bodies:
        if body.sheet_thickness is None and not body.mesh.diagnosis.solid:
            raise InputError(f"path tracing {body.mesh.name!r}", "not closed", "use tl.reference.render")
        if body.sheet_thickness is not None and body.medium is not None and body.medium.scatters:
            raise InputError(f"path tracing {body.mesh.name!r}", "a sheet that scatters", "use tl.reference.render")


def _left_out(scene: Scene) -> tuple[Note, ...]:
    """Notes on light that no path finds."""
    polished = [
        body
        for body in scene.bodies
        if body.has_interface
        and body.medium is not None
        and body.medium.ior != 1.0
        and (body.surface is None or body.surface.roughness == 0.0 or body.sheet_thickness is not None)
    ]
    if not scene.lights or not polished:
        return ()
    text = "light that polished interfaces refract or reflect on its way from lights: in media, and as caustics"
    return (Note(NoteKind.LIGHTS_LEFT_OUT, text),)


def _alike(columns: Array) -> list[Integers]:
    """Groups of channels with equal columns (n, 3): one path serves all of a group."""
    _, group = np.unique(columns, axis=1, return_inverse=True)
    return [np.flatnonzero(group.ravel() == number) for number in np.unique(group)]


def _estimate(tracer: InterfacePaths, rays: Rays, paths: int) -> tuple[Array, Array]:
    """Mean (n, c) over the paths of each ray, and its standard error."""
    mean, spread = np.zeros((2, len(rays), len(tracer.channels)))
    each = max(BENT_BATCH // paths, 1)
    for begin in range(0, len(rays), each):
        some = np.arange(begin, min(begin + each, len(rays)))
        found = tracer.radiance(rays.where(np.repeat(some, paths))).reshape(len(some), paths, -1)
        mean[some] = found.mean(axis=1)
        with np.errstate(under="ignore"):
            spread[some] = found.std(axis=1, ddof=1)
    return mean, spread / np.sqrt(paths)
