"""Interactions of light with interfaces: reflectance, transmittance, directions, diffuse reflection; path segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.formulas import optics
from translucent.formulas.interface import (
    ggx_distribution,
    ggx_visibility,
    reflected_direction,
    refracted_direction,
    slab_reflectance,
)
from translucent.formulas.thin_film import film_slab_reflectance, film_slab_transmittance
from translucent.reference.hits import Lines, Rays
from translucent.reference.interfaces import FirstInterfaces, Inside, Optics, interface_normals
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.microfacets import lit_at_interface, scattered_at_interface
from translucent.reference.surfaces import interface_surfaces
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Light


@dataclass(frozen=True, eq=False)
class LiveRays:
    """Rays that are still followed: the current straight segments of paths that refract and reflect.

    Attributes
    ----------
    rays : Rays
        Origin and direction of each segment.
    owner : (k,) int64
        Number of the ray of the picture that the path belongs to.
    throughput : (k, 3) float64
        Product of all factors along the path so far.
    inside : Inside
        Interior list at the origin.
    bent : (k,) bool
        Whether an interface has changed the direction.
    reflected : (k,) bool
        Whether an interface has reflected it.
    """

    rays: Rays
    owner: Integers
    throughput: Array
    inside: Inside
    bent: Mask
    reflected: Mask

    def __len__(self) -> int:
        return len(self.owner)

    def where(self, chosen: Integers | Mask) -> LiveRays:
        """Selection of ray segments by indices or a mask."""
        index = np.flatnonzero(chosen) if chosen.dtype == bool else np.asarray(chosen, np.int64)
        return LiveRays(
            self.rays.where(index),
            self.owner[index],
            self.throughput[index],
            self.inside.where(index),
            self.bent[index],
            self.reflected[index],
        )

    def redirected(
        self, directions: Array, weight: Array, inside: Inside, *, bent: bool, reflected: Mask | bool
    ) -> LiveRays:
        """Ray segments from the same origins in other directions (k, 3), with a weight (k, 3)."""
        rays = Rays(self.rays.origins, directions, self.rays.backdrop)
        with np.errstate(under="ignore"):
            throughput = self.throughput * weight
        return LiveRays(rays, self.owner, throughput, inside, self.bent | bent, self.reflected | reflected)


def joined(parts: Sequence[LiveRays]) -> LiveRays:
    """Concatenate ray segments; at least one part."""
    windings, since = (np.concatenate([getattr(part.inside, name) for part in parts]) for name in ("windings", "since"))
    own = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("owner", "throughput", "bent", "reflected")
    )
    owner, throughput, bent, reflected = own
    rays = Rays.joined([part.rays for part in parts])
    return LiveRays(rays, owner, throughput, Inside(windings, since), bent, reflected)


#: Number of passages through a rough sheet after which light counts as lost.
MOST_PASSAGES = 64


@dataclass(frozen=True, eq=False)
class Outcome:
    """Branches of light behind interfaces, and the radiance that these add.

    Attributes
    ----------
    branches : tuple of LiveRays
        In which it goes on.
    radiance : (k, 3) float64
        That the interfaces add themselves.
    """

    branches: tuple[LiveRays, ...]
    radiance: Array


class Interactions:
    """Interactions of ray segments with the interfaces at their ends.

    Parameters
    ----------
    own : Optics
    live : LiveRays
        With their origins moved to the interfaces.
    interfaces : Interfaces
    light : SurfaceLight
        On diffuse bases, and reflected in rough interfaces.
    rng : Generator, optional
        Chooses between reflection and refraction; without it both are followed.
    lights : StraightLight, optional
        Adds the light of `Scene.lights` that rough interfaces of solids scatter into the rays, on either side, where no
        interface on its path bends it. Without it, and at sheets, that light is reflected once, and interfaces on its
        path do not bend it.
    """

    def __init__(
        self,
        own: Optics,
        live: LiveRays,
        interfaces: FirstInterfaces,
        light: SurfaceLight,
        rng: np.random.Generator | None,
        lights: StraightLight | None = None,
    ) -> None:
        self.own, self.live, self.interfaces, self.light = own, live, interfaces, light
        self.rng, self.lights = rng, lights
        self.normals, self.faces = interface_normals(own, interfaces, live.rays.directions)
        self.cosine = np.clip(-np.einsum("ki,ki->k", self.normals, live.rays.directions), 0.0, 1.0)
        self.is_sheet = interfaces.before == interfaces.after
        beyond = np.where(self.is_sheet, interfaces.item, interfaces.after)
        self.ior = own.iors[beyond] / own.iors[interfaces.before]
        place = interfaces.item, interfaces.face, interfaces.barycentric
        roughness, transmission, self.color = interface_surfaces(own.scene, *place)
        self.alpha, self.transmission = roughness**2, transmission[:, None]
        self.bare = optics.fresnel_dielectric(self.cosine, self.ior)
        #: (k, 3): with the films on the interfaces, of sheets that of their side towards the light.
        self.reflectance = own.filmed(self.bare, interfaces.item, interfaces.before, self.cosine, self.ior)
        outside = self.is_sheet | (interfaces.item == interfaces.after)
        self.coated = own.coated(interfaces.item, outside, self.cosine)[:, None]

    def outcome(self) -> Outcome:
        """Outcome of all ray segments."""
        rough = (self.alpha > 0) & (self.ior != 1.0)
        methods = (
            (~self.is_sheet & (~rough if self.rng is None else np.ones_like(rough)), self._at_interfaces),
            (self.is_sheet & ~rough, self._at_sheets),
            (self.is_sheet & rough, self._at_rough_sheets),
        )
        self.radiance = np.zeros((len(self.live), 3))
        self._add_highlights(np.flatnonzero(rough & (self.is_sheet | (self.lights is None))))
        branches: list[LiveRays] = []
        for mask, method in methods:
            chosen = np.flatnonzero(mask)
            if chosen.size:
                found, passed = method(chosen)
                branches.extend(found)
                self._add_diffuse(chosen, passed)
        return Outcome(tuple(branches), self.radiance)

    def _table(self, name: str) -> Array:
        return np.array([getattr(surface, name) for surface in self.own.surfaces], dtype=np.float64)[
            self.interfaces.item
        ]

    def _passing(self, chosen: Integers) -> Array:
        """(k, 3): fraction of light continuing past the interface: the base color tints light that enters a body."""
        enters = self.is_sheet[chosen] | (self.interfaces.item[chosen] == self.interfaces.after[chosen])
        return self.transmission[chosen] * np.where(enters[:, None], self.color[chosen], 1.0)

    def _at_interfaces(self, chosen: Integers) -> tuple[list[LiveRays], Array]:
        """Branches at interfaces of solids, and the fraction (k, 1) of light that passes."""
        live, here, there = self.live.where(chosen), self.interfaces.here, self.interfaces.there
        directions, normals = live.rays.directions, self.normals[chosen]
        reflected_directions = reflected_direction(directions, normals)
        refracted_directions = refracted_direction(directions, normals, self.ior[chosen])
        reflectance = self._under_coat(chosen, self.reflectance[chosen])
        transmittance = 1.0 - reflectance
        if self.rng is not None:
            chance = reflectance.mean(axis=1)
            passed = self.rng.random(len(chosen)) >= chance
            rough = np.flatnonzero((self.alpha[chosen] > 0) & (self.ior[chosen] != 1.0))
            coated = self.coated[chosen[rough], 0]
            mirrored = self.rng.random(len(rough)) < coated if coated.any() else np.zeros(len(rough), dtype=bool)
            passed[rough], weight = False, np.ones((len(rough), 3))
            walking = rough[~mirrored]
            reflected_directions[walking], passed[walking], weight[~mirrored] = self._at_microfacets(
                chosen[walking], self.rng
            )
            refracted_directions[rough] = reflected_directions[rough]
            reflectance, transmittance = _by_chance(reflectance, chance, passed, rough, weight)
        back, on = np.flatnonzero((reflectance > 0.0).any(axis=1)), np.flatnonzero((transmittance > 0.0).any(axis=1))
        passing = (transmittance * self._passing(chosen))[on]
        reflected_directions, refracted_directions = (
            _towards(reflected_directions, self.faces[chosen]),
            _towards(refracted_directions, -self.faces[chosen]),
        )
        reflected = live.where(back).redirected(
            reflected_directions[back], reflectance[back], here.where(chosen[back]), bent=True, reflected=True
        )
        refracted = live.where(on).redirected(
            refracted_directions[on], passing, there.where(chosen[on]), bent=True, reflected=False
        )
        return [reflected, refracted], transmittance

    def _at_microfacets(self, chosen: Integers, rng: np.random.Generator) -> tuple[Array, Mask, Array]:
        """Directions from rough interfaces, whether they pass, and weights (k, 3); adds what lights emit."""
        directions, normals, points = self.live.rays.directions[chosen], self.normals[chosen], self.live.rays.origins
        lights = np.empty((0, len(chosen), 3)) if self.lights is None else self.lights.at_interfaces(points[chosen])
        item, sides = self.interfaces.item[chosen], (self.interfaces.after[chosen], self.interfaces.before[chosen])

        def films(ray: Integers, above: Mask, bare: Array, cosine: Array, ior: Array) -> Array:
            before = np.where(above, sides[1][ray], sides[0][ray])
            return self.own.filmed(bare, item[ray], before, cosine, ior)

        found = directions, normals, self.ior[chosen], self.alpha[chosen]
        filmed = films if self._table("iridescence")[chosen].any() else None
        scattered, passed, weight, densities = lit_at_interface(*found, lights, rng, filmed)
        for number, to_light in enumerate(lights):
            across, by_face = (np.einsum("ki,ki->k", to_light, n) for n in (normals, self.faces[chosen]))
            for side, passing, inside in (
                (1.0, np.ones((len(chosen), 3)), self.interfaces.here),
                (-1.0, self._passing(chosen), self.interfaces.there),
            ):
                # Light that comes from the other side of the face than of the smooth surface does not exist.
                some = np.flatnonzero((densities[number] > 0).any(axis=1) & (side * across > 0) & (side * by_face > 0))
                to_eye = passing[some] * densities[number, some]
                self.radiance[chosen[some]] += self._arriving(number, chosen[some], inside, to_eye)
        return scattered, passed, weight

    def _arriving(self, number: int, chosen: Integers, inside: Inside, weight: Array) -> Array:
        """(k, 3): radiance by one light: its irradiance times a bsdf `weight` (k, 3)."""
        assert self.lights is not None
        arriving = self.lights.irradiance(
            number, self.live.rays.origins[chosen], inside.where(chosen), self.own.tolerance
        )
        with np.errstate(under="ignore"):
            return arriving * weight

    def _at_sheets(self, chosen: Integers) -> tuple[list[LiveRays], Array]:
        """Branches at polished sheets, as `_at_interfaces`: both sides of each at once."""
        live, inside = self.live.where(chosen), self.interfaces.here.where(chosen)
        metres, extinction, emission = self._matter(chosen)
        front, behind, ior = self.reflectance[chosen], self.bare[chosen], self.ior[chosen]
        path = optics.thin_layer_thickness(metres, self.cosine[chosen], ior)[:, None]
        with np.errstate(over="ignore", under="ignore"):
            depth = extinction * path
            back = self._under_coat(chosen, film_slab_reflectance(front, behind, depth))
            on = (1.0 - self.coated[chosen]) * film_slab_transmittance(front, behind, depth)
            again = behind[:, None] * optics.transmittance(depth)
            kept = 1.0 - front * optics.transmittance(depth) * again
            # What a sheet emits goes back and forth in it, too.
            leaving = np.where(kept > 0.0, (1.0 - front) * (1.0 + again) / np.where(kept > 0.0, kept, 1.0), 0.0)
            leaving = (1.0 - self.coated[chosen]) * leaving
            self.radiance[chosen] += leaving * optics.emitted_radiance(emission, extinction, path)
        mirrored = _towards(reflected_direction(live.rays.directions, self.normals[chosen]), self.faces[chosen])
        branches = [
            live.redirected(mirrored, back, inside, bent=True, reflected=True),
            live.redirected(live.rays.directions, on * self._passing(chosen), inside, bent=False, reflected=False),
        ]
        return branches, on

    def _at_rough_sheets(self, chosen: Integers) -> tuple[list[LiveRays], Array]:
        """Branches at rough sheets, as `_at_interfaces`: light goes from one side to the other until it leaves."""
        assert self.rng is not None
        live, inside, normals = self.live.where(chosen), self.interfaces.here.where(chosen), self.normals[chosen]
        metres, extinction, emission = self._matter(chosen)
        ior, alpha = self.ior[chosen], self.alpha[chosen]
        scattered, entered = scattered_at_interface(live.rays.directions, normals, ior, alpha, self.rng)
        weight, emitted = np.ones((len(chosen), 3)), np.zeros((len(chosen), 3))
        within = np.flatnonzero(entered)
        for _ in range(MOST_PASSAGES):
            if not within.size:
                break
            across = np.einsum("ki,ki->k", scattered[within], normals[within])
            path = (metres[within] / np.maximum(np.abs(across), optics.MIN_THIN_LAYER_COSINE))[:, None]
            with np.errstate(over="ignore", under="ignore"):
                emitted[within] += weight[within] * optics.emitted_radiance(emission[within], extinction[within], path)
                weight[within] *= optics.transmittance(extinction[within] * path)
            facing = np.where(across[:, None] < 0, normals[within], -normals[within])
            scattered[within], leaves = scattered_at_interface(
                scattered[within], facing, 1.0 / ior[within], alpha[within], self.rng
            )
            within = within[~leaves & scattered[within].any(axis=1)]
        scattered[within] = 0.0
        self.radiance[chosen] += emitted
        passed = np.einsum("ki,ki->k", scattered, normals) < 0
        scattered = _towards(scattered, np.where(passed[:, None], -1.0, 1.0) * self.faces[chosen])
        with np.errstate(under="ignore"):
            throughput = weight * np.where(passed[:, None], self._passing(chosen), 1.0)
        return [live.redirected(scattered, throughput, inside, bent=True, reflected=~passed)], weight * passed[:, None]

    def _under_coat(self, chosen: Integers, reflectance: Array) -> Array:
        """(k, 3): reflectance of interfaces with their clear coats, from the reflectance (k, 3) below these."""
        return np.asarray(reflectance + self.coated[chosen] * (1.0 - reflectance))

    def _matter(self, chosen: Integers) -> tuple[Array, Array, Array]:
        """Thickness (k,) in metres, extinction and emission (k, 3) of sheets."""
        own, item = self.own, self.interfaces.item[chosen]
        media = [body.medium for body in own.scene.objects]
        metres = np.array([thickness or 0.0 for thickness in own.sheets])
        rows = np.array([(m.extinction, m.emission) if m is not None else np.zeros((2, 3)) for m in media])
        return metres[item], rows[item, 0], rows[item, 1]

    def _add_diffuse(self, chosen: Integers, passed: Array) -> None:
        """Add diffuse reflection of the fraction `passed` (k, 1 or 3) of the light."""
        fraction = passed * (1.0 - self.transmission[chosen])
        diffuse_hits = np.flatnonzero((fraction > 0.0).any(axis=1))
        chosen, fraction = chosen[diffuse_hits], fraction[diffuse_hits]
        if not chosen.size:
            return
        points, normals = self.live.rays.origins[chosen], self.normals[chosen]
        through = self._table("diffuse_transmission")[chosen, None]
        front, back = (self.light.on_interfaces(points, side * normals) for side in (1.0, -1.0))
        behind = through * self._table("diffuse_transmission_color")[chosen] * back
        with np.errstate(under="ignore"):
            self.radiance[chosen] += fraction / np.pi * (self.color[chosen] * (1.0 - through) * front + behind)

    def _add_highlights(self, rough: Integers) -> None:
        """Add highlights of `Scene.lights` in rough interfaces, by single reflection."""
        points, normals = self.live.rays.origins[rough], self.normals[rough]
        to_eye = -self.live.rays.directions[rough]
        for light in self.light.paths.lights if rough.size else ():
            if isinstance(light, PositionalLight):
                to_light = np.asarray(light.position) - points
                to_light /= np.maximum(np.linalg.norm(to_light, axis=1, keepdims=True), np.finfo(np.float64).tiny)
            else:
                to_light = np.broadcast_to(-np.asarray(light.direction), points.shape)
            half = to_eye + to_light
            half = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), np.finfo(np.float64).tiny)
            cos_half, cos_light = (
                np.clip(np.einsum("ki,ki->k", normals, direction), 0.0, 1.0) for direction in (half, to_light)
            )
            cos_facet = np.clip(np.einsum("ki,ki->k", half, to_eye), 0.0, 1.0)
            reflectance = optics.fresnel_dielectric(cos_facet, self.ior[rough])[:, None] * np.ones(3)
            sheet = np.flatnonzero(self.is_sheet[rough])
            metres, extinction, _ = self._matter(rough[sheet])
            path = optics.thin_layer_thickness(metres, cos_facet[sheet], self.ior[rough[sheet]])[:, None]
            reflectance[sheet] = slab_reflectance(reflectance[sheet], extinction * path)
            density = ggx_distribution(cos_half, self.alpha[rough])
            visible = ggx_visibility(cos_light, self.cosine[rough], self.alpha[rough])
            with np.errstate(under="ignore"):
                mirrored = reflectance * (density * visible)[:, None] * light.irradiance_on(points, normals)
                lit = np.flatnonzero(mirrored.any(axis=1))
                self.radiance[rough[lit]] += mirrored[lit] * self.light.to_interfaces(light, points[lit])


def _by_chance(back: Array, chance: Array, passed: Mask, rough: Integers, weight: Array) -> tuple[Array, Array]:
    """Weights (k, 3) of reflected and of transmitted light, where one was chosen: reflection with a `chance` (k,).

    Walks at `rough` interfaces have a `weight` (rough, 3).
    """
    reflectance = np.where(passed[:, None], 0.0, back / np.where(chance > 0.0, chance, 1.0)[:, None])
    transmittance = np.where(passed[:, None], (1.0 - back) / np.where(chance < 1.0, 1.0 - chance, 1.0)[:, None], 0.0)
    reflectance[rough], transmittance[rough] = weight * ~passed[rough, None], weight * passed[rough, None]
    return reflectance, transmittance


def _towards(directions: Array, side: Array) -> Array:
    """Directions (k, 3), reflected to the `side` (k, 3) of a face where smooth normals mislead them."""
    across = np.einsum("ki,ki->k", directions, side)
    return np.where((across < 0)[:, None], directions - 2.0 * across[:, None] * side, directions)


class StraightLight:
    """Light of point, spot and directional lights, as far as no interface bends it.

    A path that polished interfaces bend hits such a light with probability 0, so that nothing random finds it.

    Parameters
    ----------
    light : LightPaths
    own : Optics
    """

    def __init__(self, light: LightPaths, own: Optics) -> None:
        self.light, self.own = light, own

    def at_interfaces(self, points: Array) -> Array:
        """(lights, k, 3): unit vectors from points (k, 3) to all lights."""
        found = [_towards_light(light, points)[0] for light in self.light.lights]
        return np.array(found).reshape(len(found), len(points), 3)

    def scattered(self, live: LiveRays, weights: Array, channel: int) -> Array:
        """(k, 3): in-scattered radiance of lights at the origins of `live`, over the scattering coefficient there.

        Parameters
        ----------
        live : LiveRays
        weights : (k, n) float64
            What fills the places, as `Volume.at` gives it.
        channel : int
            One of those whose media scatter alike.
        """
        volume, rays = self.light.volume, live.rays
        radiance = np.zeros((len(live), 3))
        total = weights @ volume.scattering[:, channel]
        for number, to_light in enumerate(self.at_interfaces(rays.origins)):
            arriving = self.irradiance(number, rays.origins, live.inside)
            cosine = np.einsum("ki,ki->k", to_light, rays.directions)
            phase = volume.source(weights, cosine)[:, channel] / np.where(total > 0, total, 1.0)
            with np.errstate(under="ignore"):
                radiance += arriving * phase[:, None]
        return radiance

    def on_surfaces(self, live: LiveRays, normals: Array, start: float) -> Array:
        """(k, 3): irradiance of all lights on opaque surfaces with unit normals (k, 3) at the origins of `live`."""
        found = np.zeros((len(live), 3))
        for number, to_light in enumerate(self.at_interfaces(live.rays.origins)):
            cosine = np.einsum("ki,ki->k", to_light, normals)
            lit = np.flatnonzero(cosine > 0.0)
            arriving = self.irradiance(number, live.rays.origins[lit], live.inside.where(lit), start)
            with np.errstate(under="ignore"):
                found[lit] += cosine[lit, None] * arriving
        return found

    def irradiance(self, number: int, points: Array, inside: Inside, start: float = 0.0) -> Array:
        """Irradiance (k, 3) of one light, straight on, at points (k, 3) `inside` bodies.

        Parameters
        ----------
        number : int
            Index into `LightPaths.lights`.
        points : (k, 3) float64
        inside : Inside
        start : float
            Distance in metres from the points within which no surface counts: that they lie on.
        """
        light, found = self.light.lights[number], np.zeros((len(points), 3))
        transmittance = self._transmittance(light, points, inside, start)
        some = np.flatnonzero(transmittance.any(axis=1))
        with np.errstate(under="ignore"):
            found[some] = transmittance[some] * self.light.arrival(light, points[some]).irradiance
        return found

    def _transmittance(self, light: Light, points: Array, inside: Inside, start: float) -> Array:
        """(k, 3): fraction of a light that all interfaces on its path transmit; media are not counted."""
        directions, distance = _towards_light(light, points)
        lines = Lines(points, directions, np.full(len(points), start), distance)
        hits, transmittance = self.light.tracer.hits(lines), np.ones((len(points), 3))
        while True:
            interfaces = self.own.first_interfaces(hits, inside)
            hit = np.flatnonzero(np.isfinite(interfaces.distance))
            if not hit.size:
                return transmittance
            first = interfaces.where(hit)
            before, after, item = first.before, first.after, first.item
            sheet = before == after
            bends = self.own.iors[before] != self.own.iors[np.where(sheet, item, after)]
            _, passing, color = interface_surfaces(self.own.scene, item, first.face, first.barycentric)
            tint = np.where((sheet | (item == after))[:, None], color, 1.0)
            transmittance[hit] *= np.where(bends[:, None], 0.0, passing[:, None] * tint)
            passed = np.full(len(points), np.inf)
            passed[hit] = np.where(bends, np.inf, interfaces.distance[hit] + self.own.tolerance)
            hits = [line.where(line.distance > passed[line.pixel]) for line in hits]
            inside = interfaces.there


def _towards_light(light: Light, points: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 3) from points (k, 3) to a light, and how far it is (k,)."""
    if not isinstance(light, PositionalLight):
        return np.tile(-np.asarray(light.direction), (len(points), 1)), np.full(len(points), np.inf)
    to_light = np.asarray(light.position) - points
    distance = np.linalg.norm(to_light, axis=1)
    return to_light / np.where(distance > 0, distance, 1.0)[:, None], distance
