"""Balls in which light diffuses against photons: in the sun, zone by zone, and white milk with rays that start inside.

Usage: python tools/measure_balls.py [--photons 40000] [--only sun|milk]

The first table is the flux that leaves balls of wax, as shares of that of photons, in eight zones of equal area from
the back to the sun. The second is the share of uniform light that a ball of milk sends back, by photons, and by
photons that start 9e-5 m below the surface, as rays do in some renderers.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy import sparse

import translucent as tl
from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.diffusion.entering import Occluders, from_light
from translucent.diffusion.lit_body import lit_body
from translucent.diffusion.solution import BodySystem
from translucent.formulas import interface, optics
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.geometry.solids import Sphere

WAX = tl.Medium(absorption=(80, 160, 350), scattering=(870, 800, 550), anisotropy=0.2, ior=1.44)
ZONES, OFFSET = 8, 9e-5
#: Weight below which photons end by chance, and the share of these that live on.
FAINT, LIVING = 0.05, 0.2


def photons(medium: tl.Medium, channel: int, radius: float, count: int, offset: float = 0.0) -> tuple[Array, float]:
    """Scattered flux in zones from the back to the sun, of 1 W/m^2, and share of parallel light that leaves."""
    rng = np.random.default_rng(0)
    absorption, scattering = float(medium.absorption[channel]), float(medium.scattering[channel])
    across, turn = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    normal = np.stack([across * np.cos(turn), across * np.sin(turn), np.sqrt(1 - across**2)], axis=1)
    mirrored = optics.fresnel_dielectric(normal[:, 2], medium.ior)
    way = interface.refracted_direction(np.tile([0.0, 0.0, -1.0], (count, 1)), normal, np.full(count, medium.ior))
    place, weight, events = (radius - offset) * normal, 1 - mirrored, np.zeros(count, bool)
    zones, out = np.zeros(ZONES), float(mirrored.sum())
    while len(place):
        along = (place * way).sum(axis=1)
        far = np.sqrt(np.maximum(along**2 - (place**2).sum(axis=1) + radius**2, 0.0)) - along
        step = rng.exponential(1 / (absorption + scattering), len(place))
        hit = step >= far
        place = place + np.minimum(step, far)[:, None] * way
        outward = place / np.maximum(np.linalg.norm(place, axis=1, keepdims=True), 1e-30)
        slope = (way * outward).sum(axis=1)
        inside = optics.fresnel_dielectric(np.clip(slope, 0, 1), 1 / medium.ior)
        left = np.where(hit, weight * (1 - inside), 0.0)
        out += float(left.sum())
        zones += np.histogram(outward[events, 2], ZONES, (-1, 1), weights=left[events])[0]
        weight = weight * np.where(hit, inside, scattering / (absorption + scattering))
        back = way - 2 * slope[:, None] * outward
        way = np.where(hit[:, None], back, scattered(way, medium.anisotropy, rng))
        place = np.where(hit[:, None], place - offset * outward, place)
        events = events | ~hit
        lives = (weight >= FAINT) | (rng.random(len(weight)) < LIVING)
        weight = np.where(weight < FAINT, weight / LIVING, weight)
        place, way, weight, events = place[lives], way[lives], weight[lives], events[lives]
    return zones / count * ZONES / 4, out / count


def scattered(way: Array, anisotropy: float, rng: np.random.Generator) -> Array:
    """Directions after an event, by Henyey and Greenstein."""
    first, second = rng.random((2, len(way)))
    g = anisotropy if abs(anisotropy) > 1e-6 else 1e-6
    cosine = (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * first)) ** 2) / (2 * g)
    cosine = np.clip(cosine, -1, 1) if abs(anisotropy) > 1e-6 else 2 * first - 1
    aside = np.where(np.abs(way[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(way, aside)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    level, turn = np.sqrt(1 - cosine**2)[:, None], 2 * np.pi * second[:, None]
    turned = cosine[:, None] * way + level * (np.cos(turn) * across + np.sin(turn) * np.cross(way, across))
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def diffused(medium: tl.Medium, radius: float) -> Array:
    """(3, zones): flux that leaves by diffusion, with the cells of resolution 32."""
    body = tl.Object(Sphere(radius=radius).tessellate(64), medium)
    grid = lit_body(body, None, tl.Diffusion(32).cell_size(body)).grid
    skin, sun = diffuse_interface(medium.ior), tl.DirectionalLight((0, 0, -1), (1, 1, 1))
    rays = from_light(grid, Occluders(body), sun, medium.ior, skin)
    dark = np.zeros((len(grid.points), 3))
    nothing = sparse.csr_array((len(dark), len(dark)))
    found = BodySystem(grid, medium, 0.0).solved(dark, nothing, np.zeros((grid.count, 3)), [rays])
    zone = np.clip((0.5 * ZONES * (grid.points[:, 2] / radius + 1)).astype(int), 0, ZONES - 1)
    sums = [np.bincount(zone, column, ZONES) for column in (skin.exit_share * found.fluence).T]
    return np.asarray(sums / np.bincount(zone, minlength=ZONES))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--photons", type=int, default=40000)
    parser.add_argument("--only", choices=("sun", "milk"))
    asked = parser.parse_args()
    for radius in (0.006, 0.002) if asked.only != "milk" else ():
        found = diffused(WAX, radius)
        for channel, name in enumerate(("red", "green", "blue")):
            exact = photons(WAX, channel, radius, asked.photons)[0]
            shares = " ".join(f"{share:5.2f}" for share in found[channel] / exact)
            print(f"wax, {1e3 * radius:.0f} mm, {name:5}: {shares}; in all {found[channel].sum() / exact.sum():.3f}")
    if asked.only != "sun":
        milk, ball = tl.preset("whole_milk").medium, tl.load_mesh(mesh_path("sphere"))
        radius = 0.5 * float(np.ptp(ball.bounds[:, 0]))
        for channel, name in enumerate(("red", "green", "blue")):
            shares = [photons(milk, channel, radius, asked.photons, offset)[1] for offset in (0.0, OFFSET)]
            print(f"milk, {name:5}: {shares[0]:.4f}; of rays that start inside {shares[1]:.4f}")


if __name__ == "__main__":
    main()
