"""Rough interfaces: random walks of light among the microfacets of a GGX surface (Heitz et al. 2016).

"Multiple-scattering microfacet BSDFs with the Smith model": heights of the microfacets are not correlated, each one
reflects or refracts by Fresnel and Snell, and no light is lost. Normals as they are visible are sampled as in Heitz
2018, "Sampling the GGX distribution of visible normals".
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.formulas import optics
from translucent.formulas.interface import ggx_distribution, reflected_direction, refracted_direction

#: Number of interactions with microfacets after which light counts as lost; at a roughness of 1 one in a million gets
#: as far.
MOST_INTERACTIONS = 100

#: Reflectance (n, 3) of microfacets with films, given rays (n,), whether these come from above (n,), the reflectance
#: without films, the cosine of incidence and the relative index, (n,) each.
Films = Callable[[Integers, Mask, Array, Array, Array], Array]

#: Largest slope of directions that stay at their height.
LEVEL = 1e-6


def scattered_at_interface(
    directions: Array, normals: Array, ior: Array, alpha: Array, rng: np.random.Generator
) -> tuple[Array, Mask]:
    """Random directions (n, 3) of light that leaves a rough interface, and whether it is transmitted (n,).

    Parameters
    ----------
    directions : (n, 3) float64
        In which it arrives; unit vectors.
    normals : (n, 3) float64
        Unit, to the side that it comes from.
    ior : (n,) float64
        Of the other side relative to this one.
    alpha : (n,) float64
        Square of the roughness, above 0.

    Returns
    -------
    directions : (n, 3) float64
        Zero where light is lost.
    passed : (n,) bool
    """
    found, passed, _, _ = lit_at_interface(directions, normals, ior, alpha, np.empty((0, *directions.shape)), rng)
    return found, passed


def lit_at_interface(
    directions: Array,
    normals: Array,
    ior: Array,
    alpha: Array,
    to_lights: Array,
    rng: np.random.Generator,
    films: Films | None = None,
) -> tuple[Array, Mask, Array, Array]:
    """Random directions like `scattered_at_interface`, with the weight (n, 3) of the light, which is 1 without films.

    And an estimate (lights, n, 3) in 1/sr of how much light is scattered to each of `to_lights`.

    At each microfacet, as much as it sends there and as gets past the others (Heitz et al. 2016, section 5.3); the
    density of the random directions, if they were many.

    Parameters
    ----------
    to_lights : (lights, n, 3) float64
        Unit vectors to point, spot and directional lights, on either side.
    films : callable, optional
        See `Films`.
    """
    axes = _axes(normals)
    found, densities = np.zeros_like(directions), np.zeros(to_lights.shape)
    weight = np.ones_like(directions)
    lights = np.einsum("kij,lkj->lki", axes, to_lights)
    above = np.ones(len(directions), dtype=bool)
    ray = np.arange(len(directions))
    direction = np.einsum("kij,kj->ki", axes, directions)
    height = np.ones(len(directions))
    for _ in range(MOST_INTERACTIONS):
        # Below the surface everything is as above it, turned upside down.
        side = np.where(above[ray], 1.0, -1.0)[:, None]
        height, leaves = _next_height(side * direction, height, alpha[ray], rng)
        found[ray[leaves]] = direction[leaves]
        ray, direction, height, side = ray[~leaves], direction[~leaves], height[~leaves], side[~leaves]
        if not ray.size:
            break
        relative = np.where(above[ray], ior[ray], 1.0 / ior[ray])
        for light, own in zip(lights, densities, strict=True):
            density, reflects, cosine = _density_towards(
                side * light[ray], side * direction, height, relative, alpha[ray]
            )
            reflectance = _reflectance(ray, above, cosine, relative, films)
            with np.errstate(under="ignore"):
                own[ray] += weight[ray] * density[:, None] * np.where(reflects[:, None], reflectance, 1.0 - reflectance)
        facet = side * _visible_normals(-side * direction, alpha[ray], rng)
        cosine = np.clip(-np.einsum("ki,ki->k", direction, facet), 0.0, 1.0)
        reflectance = _reflectance(ray, above, cosine, relative, films)
        # Chosen with the mean probability of the colors; weights make each color right on its own.
        chance = reflectance.mean(axis=1)
        passed = rng.random(len(direction)) >= chance
        if films is not None:
            passing = (1.0 - reflectance) / np.where(chance < 1.0, 1.0 - chance, 1.0)[:, None]
            weight[ray] *= np.where(
                passed[:, None], passing, reflectance / np.where(chance > 0.0, chance, 1.0)[:, None]
            )
        direction = np.where(
            passed[:, None], refracted_direction(direction, facet, relative), reflected_direction(direction, facet)
        )
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        above[ray] ^= passed
        # Heights count upwards on either side.
        height = np.where(passed, 1.0 - height, height)
    return np.einsum("kji,kj->ki", axes, found), ~above, weight, densities


def _reflectance(ray: Integers, above: Mask, cosine: Array, ior: Array, films: Films | None) -> Array:
    """(k, 3): reflectance of microfacets hit by rays (k,), from `above` (n,) the surface or from below."""
    bare = optics.fresnel_dielectric(cosine, ior)
    return np.repeat(bare[:, None], 3, axis=1) if films is None else films(ray, above[ray], bare, cosine, ior)


@np.errstate(under="ignore")
def _density_towards(
    light: Array, direction: Array, height: Array, ior: Array, alpha: Array
) -> tuple[Array, Mask, Array]:
    """Density (n,) in 1/sr with which microfacets at `height` may turn light from `direction` (n, 3) to `light` (n, 3).

    It is to be multiplied by what they reflect, where they do (n,), or let pass, at a cosine of incidence (n,).

    Visible normals have the density (m.w) D / (Lambda w_z); Walter et al. 2007, eq. 13 to 17, make one of directions.
    """
    back, across = light[:, 2] > 0, np.where(light[:, 2] > 0, 1.0, ior)
    half = -direction + across[:, None] * light
    length = np.linalg.norm(half, axis=1)
    half *= (np.where(half[:, 2] < 0, -1.0, 1.0) / np.where(length > 0, length, 1.0))[:, None]
    cos_incident, cos_light = -np.einsum("ki,ki->k", direction, half), np.einsum("ki,ki->k", light, half)
    area = _lambda(direction[:, 2], alpha) * direction[:, 2]
    valid = (cos_incident > 0) & ((cos_light > 0) == back) & (length > LEVEL) & (area > 0)
    stretch = across * across * np.abs(cos_light) / np.where(valid, length, 1.0) ** 2
    density = cos_incident * ggx_distribution(np.abs(half[:, 2]), alpha) * stretch
    leaves = np.where(back, height, 1.0 - height) ** _lambda(np.maximum(np.abs(light[:, 2]), LEVEL), alpha)
    return np.where(valid, density * leaves / np.where(valid, area, 1.0), 0.0), back, np.clip(cos_incident, 0.0, 1.0)


@np.errstate(under="ignore", over="ignore", divide="ignore")
def _next_height(direction: Array, height: Array, alpha: Array, rng: np.random.Generator) -> tuple[Array, Mask]:
    """Heights (n,) of the next microfacets on light's path, and whether it leaves the surface instead.

    Heights are evenly spread from 0 to 1: of all facets, the fraction `height` is lower.
    """
    chance = 1.0 - rng.random(len(direction))
    slope = _lambda(direction[:, 2], alpha)
    level = np.abs(direction[:, 2]) < LEVEL
    upwards = (direction[:, 2] > 0) & ~level
    leaves = upwards & (chance <= height**slope)
    # G1 = C1(h)^Lambda: the fraction of light still in flight at height h', C1(h)^Lambda / C1(h')^Lambda, is `chance`.
    moved = height * chance ** (-1.0 / np.where(slope == 0.0, 1.0, slope))
    return np.where(level, height, np.clip(moved, 0.0, 1.0)), leaves


def _lambda(z: Array, alpha: Array) -> Array:
    """Smith's Lambda of GGX, (n,): (sqrt(1 + alpha^2 tan^2) - 1) / 2 upwards, (-sqrt(...) - 1) / 2 downwards."""
    up = np.clip(np.abs(z), LEVEL, 1.0)
    sine = alpha * alpha * (1.0 - up) * (1.0 + up)
    upwards = 0.5 * sine / (up * (np.sqrt(up * up + sine) + up))
    return np.asarray(np.where(z > 0, upwards, -1.0 - upwards))


def _visible_normals(towards: Array, alpha: Array, rng: np.random.Generator) -> Array:
    """Random visible normals (n, 3) of microfacets from unit directions (n, 3), from above or from below."""
    stretched = towards * np.stack([alpha, alpha, np.ones_like(alpha)], axis=1)
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    first, second, _ = np.moveaxis(_axes(stretched), 1, 0)
    radius, angle = np.sqrt(rng.random(len(towards))), 2.0 * np.pi * rng.random(len(towards))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    fraction = 0.5 * (1.0 + stretched[:, 2])
    y = (1.0 - fraction) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + fraction * y
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    on_sphere = x[:, None] * first + y[:, None] * second + z[:, None] * stretched
    normals = on_sphere * np.stack([alpha, alpha, np.ones_like(alpha)], axis=1)
    normals[:, 2] = np.maximum(normals[:, 2], 0.0)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _axes(upwards: Array) -> Array:
    """(n, 3, 3): rows are a right-handed frame whose last axis is `upwards` (n, 3) and whose first is level."""
    x, y = upwards[:, 0], upwards[:, 1]
    across = np.hypot(x, y)
    flat = across < 1e-12
    first = np.stack([np.where(flat, 1.0, -y), np.where(flat, 0.0, x), np.zeros_like(x)], axis=1)
    first /= np.where(flat, 1.0, across)[:, None]
    return np.stack([first, np.cross(upwards, first), upwards], axis=1)
