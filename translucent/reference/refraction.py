"""Pictures with refraction: one ray per pixel, or many where interfaces are rough."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Mask
from translucent.errors import InputError
from translucent.formulas.sampling import sample_shifts
from translucent.planning.methods import Method
from translucent.reference.light_paths import LightPaths
from translucent.reference.rays import Rays, pixel_rays
from translucent.reference.refracted import FAINTEST, RefractedLight, RefractedRays
from translucent.reference.sheets import sheet_thicknesses
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.scene import Scene

#: Default number of interfaces that a ray may meet.
BOUNCES = 8

#: Default number of rays per pixel before rough interfaces.
PATHS = 64

#: Smallest share of each color that one of several rays over a pixel must carry to be followed: behind a row of lenses
#: that leaves out 0.07 % of the light, in half of the time that the default of one ray takes.
FAINTEST_OF_MANY = 1e-4

#: Number of rays that are averaged together: the working arrays stay below 500 MB.
BATCH = 1 << 16


def bends(scene: Scene) -> bool:
    """True if any interface of the scene changes light, so that not all rays are straight."""
    return any(body.has_interface for body in scene.bodies)


def refracted_light(
    scene: Scene,
    size: tuple[int, int],
    method: Method | None = None,
    tolerance: float = 1e-6,
    bounces: int = BOUNCES,
    paths: int = PATHS,
    seed: int = 0,
) -> tuple[RefractedLight, Array]:
    """Radiance of a picture's pixels along refracted rays, row by row from the top left.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    method : Method, optional
        As for `render`.
    tolerance : float
        Relative error of light that media scatter once.
    bounces : int
        Interfaces that a ray may meet, from 0.
    paths : int
        Rays of each pixel, from 2, if some interface is rough; else one sees all.
    seed : int
        Of the random numbers.

    Returns
    -------
    light : RefractedLight
    standard_error : (n, 3) float64
        Of the radiance; 0 if all interfaces are polished.

    Raises
    ------
    InputError
        If an argument is not in its range, or a surface has textures.
    """
    _check(scene, bounces, paths)
    rays, rough = pixel_rays(scene.camera, size), _is_rough(scene)
    rng = np.random.default_rng(seed) if rough else None
    refracted = _refracted(scene, size, method, tolerance, bounces, rng, FAINTEST)
    return _mean(refracted, rays, paths) if rough else (refracted.see(rays), np.zeros((len(rays), 3)))


def light_over_pixels(
    scene: Scene,
    size: tuple[int, int],
    pixels: Mask,
    paths: int,
    tolerance: float = 1e-6,
    bounces: int = BOUNCES,
    seed: int = 0,
) -> tuple[Array, Mask]:
    """Radiance of pixels as a camera with a box filter takes it: the mean over rays that are spread over each.

    They are the points of samples, moved in each pixel by an offset of its own (Cranley & Patterson 1976,
    "Randomization of number theoretic methods for multiple integration"). So the mean has no bias, with any number of
    rays, and with two seeds its errors have nothing to do with each other. Rays that carry less than `FAINTEST_OF_MANY`
    of each color are not followed.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    pixels : (h, w) bool
        Those that are wanted.
    paths : int
        Rays of each.
    tolerance, bounces, seed
        As of `refracted_light`.

    Returns
    -------
    radiance : (k, 3) float64
        Of the pixels, row by row.
    valid : (k,) bool
        All rays of a pixel are.
    """
    check_untextured(scene, "use refracted_light along the centers")
    rng = np.random.default_rng(seed)
    moves = rng.random((2, *pixels.shape))
    chosen = np.flatnonzero(pixels)
    rays = []
    for shift in sample_shifts(paths):
        right, down = (shift[:, None, None] + moves) % 1.0 - 0.5
        rays.append(pixel_rays(scene.camera, size, (right, down)).where(chosen))
    refracted = _refracted(scene, size, None, tolerance, bounces, rng if _is_rough(scene) else None, FAINTEST_OF_MANY)
    found = refracted.see(Rays.joined(rays))
    with np.errstate(under="ignore"):
        radiance = found.radiance.reshape(paths, -1, 3).mean(axis=0)
    return radiance, np.asarray(found.valid.reshape(paths, -1).all(axis=0))


def _is_rough(scene: Scene) -> bool:
    return any(body.surface is not None and body.surface.roughness > 0 for body in scene.bodies)


def _refracted(
    scene: Scene,
    size: tuple[int, int],
    method: Method | None,
    tolerance: float,
    bounces: int,
    rng: np.random.Generator | None,
    faintest: float,
) -> RefractedRays:
    light = SurfaceLight(LightPaths(scene, sheet_thicknesses(scene, method)))
    scatter = bool(scene.lights) and light.paths.volume.scatters
    return RefractedRays(light, size[0] / size[1], bounces, scatter, tolerance, rng, faintest)


def _mean(refracted: RefractedRays, rays: Rays, paths: int) -> tuple[RefractedLight, Array]:
    """Mean over several rays for each of `rays`, and its standard error."""
    each = max(BATCH // paths, 1)
    parts, spreads = [], []
    for begin in range(0, len(rays), each):
        some = np.arange(begin, min(begin + each, len(rays)))
        found = refracted.see(rays.where(np.repeat(some, paths)))
        radiance, residual = (array.reshape(len(some), paths, 3) for array in (found.radiance, found.residual))
        valid = found.valid.reshape(len(some), paths).all(axis=1)
        with np.errstate(under="ignore"):
            parts.append((radiance.mean(axis=1), residual.mean(axis=1), valid))
            spreads.append(radiance.std(axis=1, ddof=1))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return RefractedLight(*columns), np.concatenate(spreads) / np.sqrt(paths)


def _check(scene: Scene, bounces: int, paths: int) -> None:
    if bounces < 0:
        raise InputError(f"{bounces} bounces", "below 0", "use for example 8")
    if paths < 2:
        raise InputError(f"{paths} paths through rough interfaces", "no spread without two", "use for example 64")
    check_untextured(scene, "use refraction=False")


def check_untextured(scene: Scene, instead: str, *, random: bool = False) -> None:
    """Check that interfaces are the same all over each body, and what lies on them is polished.

    Errors say what to do `instead`. `random`: paths are followed by chance, which know films on rough interfaces of
    solids, and polished coats on these.
    """
    for body in scene.bodies:
        if body.covers or not body.has_interface:
            continue
        if body.surface is not None and any(texture is not None for texture in body.surface.textures):
            what = f"reference of {body.mesh.name!r}"
            raise InputError(what, "its surface has textures", f"give it a surface without, or {instead}")
        surface = body.surface
        if surface is not None and (surface.iridescence or surface.clearcoat):
            rough = surface.clearcoat_roughness if surface.clearcoat else 0.0
            walks = random and body.sheet_thickness is None
            if max(0.0 if walks else surface.roughness, rough) > 0.0:
                what = f"reference of {body.mesh.name!r}"
                raise InputError(
                    what, "a film or a clear coat on it that is rough", f"give it a polished one, or {instead}"
                )
        if body.mesh.colors is not None:
            what = f"reference of {body.mesh.name!r}"
            raise InputError(what, "its vertices have colors", f"give it a mesh without, or {instead}")
