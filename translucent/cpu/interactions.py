"""Interactions of rays with interfaces: microfacets, reflection and refraction, highlights and diffuse reflection."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.caster import Caster, dot, unit
from translucent.cpu.interior_list import Branches
from translucent.formulas import optics
from translucent.formulas.bsdf import (
    Lobes,
    below_coat,
    diffuse_radiance,
    interface_lobes,
    kept_on_side,
    microfacet_value,
    thin_wall_exitance,
)
from translucent.formulas.interface import CLEARCOAT_IOR, reflected_direction, refracted_direction
from translucent.reference.interfaces import EDGE_ON, Optics
from translucent.reference.rays import Rays
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.lights import PositionalLight

#: Interfaces of a ray that have points of their own; those behind take them again, with other offsets.
INTERFACES = 8


class Spread:
    """Points of one sample of all pixels.

    Parameters
    ----------
    number : int
        Of the sample, from 0.
    samples : int
        At least 2.

    Attributes
    ----------
    samples : int
    blurred : float
        Share of the variance of microfacets that is left to the blur of the environment: few samples would show noise,
        and many need no blur (as in Krivanek & Colbert 2008, "Real-time shading with filtered importance sampling").
    """

    def __init__(self, number: int, samples: int) -> None:
        self.samples, self.blurred = samples, samples**-0.25
        self._points = _sobol(samples)[number]

    def at(self, pixel: Integers, interface: Integers) -> tuple[Array, Array]:
        """Two numbers (k,) in 0 to 1 for a pixel (k,) at the interface (k,) of its ray, counted from 0."""
        column = 2 * (interface % INTERFACES)
        key = (pixel.astype(np.uint32) * np.uint32(2 * INTERFACES) + column.astype(np.uint32)) ^ (
            (interface // INTERFACES).astype(np.uint32) * np.uint32(0x9E3779B9)
        )
        return (
            np.asarray((self._points[column] + _hashed(key)) % 1.0),
            np.asarray((self._points[column + 1] + _hashed(key ^ np.uint32(0x85EBCA6B))) % 1.0),
        )


def visible_normals(directions: Array, normals: Array, alpha: Array, points: tuple[Array, Array]) -> Array:
    """Normals (k, 3) of microfacets that light meets in directions (k, 3), around the normals (k, 3) of a surface."""
    first, second = _frame(normals)
    towards = np.stack([-dot(directions, first), -dot(directions, second), -dot(directions, normals)], axis=1)
    stretch = np.stack([alpha, alpha, np.ones_like(alpha)], axis=1)
    seen = unit(towards * stretch)
    one, other = _frame(seen)
    radius, angle = np.sqrt(points[0]), 2.0 * np.pi * points[1]
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    # Of the half of the disk that the hemisphere hides, the part that it does not (Heitz 2018, listing 1).
    share = 0.5 * (1.0 + seen[:, 2])
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    facet = (x[:, None] * one + y[:, None] * other + z[:, None] * seen) * stretch
    facet[:, 2] = np.maximum(facet[:, 2], 0.0)
    facet = unit(facet)
    return np.asarray(facet[:, :1] * first + facet[:, 1:2] * second + facet[:, 2:] * normals)


def _frame(normals: Array) -> tuple[Array, Array]:
    """Two unit vectors (k, 3) across each normal (Duff et al. 2017, "Building an orthonormal basis, revisited")."""
    x, y, z = normals.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1),
        np.stack([b, sign + y * y * a, -y], axis=1),
    )


@lru_cache(maxsize=4)
def _sobol(samples: int) -> Array:
    """(samples, 2 INTERFACES): scrambled, so that they are not those of the pixel's own samples."""
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # SciPy warns of numbers other than powers of 2, which are still well spread.
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(qmc.Sobol(2 * INTERFACES, scramble=True, seed=1).random(samples))


def _hashed(key: npt.NDArray[np.uint32]) -> Array:
    """(k,): numbers in 0 to 1 that look random (Wellons 2018, "lowbias32")."""
    with np.errstate(over="ignore"):
        key = (key ^ (key >> np.uint32(16))) * np.uint32(0x7FEB352D)
        key = (key ^ (key >> np.uint32(15))) * np.uint32(0x846CA68B)
        key = key ^ (key >> np.uint32(16))
    return key.astype(np.float64) * 2.0**-32


#: Share of light below which a microfacet counts as blocked.
LEAST_LET_OUT = 1e-6


@dataclass(frozen=True, eq=False)
class InterfaceHits:
    """InterfaceHits at which branches meet interfaces, one for each branch.

    Attributes
    ----------
    item : (k,) int64
        Whose interface it is.
    face : (k,) int64
        Of `Caster.faces`.
    before, after : (k,) int64
        Bodies that light is in on this side and on the other, or `AIR`; equal for a sheet.
    """

    item: Integers
    face: Integers
    before: Integers
    after: Integers


@dataclass(frozen=True, eq=False)
class InterfaceInteractions:
    """Reflection and refraction at interfaces.

    Attributes
    ----------
    item, before : (k,) int64
        Whose interfaces these are, and the bodies that the branches come from, or `AIR`.
    normals : (k, 3) float64
        For shading, towards where the branches come from.
    ior, alpha : (k,) float64
        Index of the other side relative to this one, and width of the microfacets' distribution.
    reflected, refracted : (k, 3) float64
        Directions.
    reflectance, passed : (k, 3) float64
        Shares of light that are mirrored, and not.
    passing : (k, 3) float64
        Share that is refracted: what paint leaves of `passed`.
    emitted : (k, 3) float64
        Radiance that sheets emit.
    blur_reflected, blur_refracted : (k,) float64
        What is added to `Branches.blur`.
    coated : (k,) float64
        Share of light mirrored by clear coats that are not as rough as what is below; that of others is in
        `reflectance`.
    coat, coat_roughness : (k,) float64
        Share of the interface that has a clear coat which light comes to from outside, and the roughness of that.
    """

    item: Integers
    before: Integers
    normals: Array
    ior: Array
    alpha: Array
    reflected: Array
    refracted: Array
    reflectance: Array
    passed: Array
    passing: Array
    emitted: Array
    blur_reflected: Array
    blur_refracted: Array
    coated: Array
    coat: Array
    coat_roughness: Array


class Interfaces:
    """Interfaces of a scene for one color of light, or for all together.

    Parameters
    ----------
    caster : Caster
    own : Optics
    """

    def __init__(self, caster: Caster, own: Optics) -> None:
        self.caster, self.own = caster, own
        surfaces = own.surfaces
        self.alpha = np.array([surface.roughness for surface in surfaces]) ** 2
        self.coat_roughness = np.array([surface.clearcoat_roughness for surface in surfaces])
        self.transmission = np.array([surface.transmission for surface in surfaces])
        self.color = np.array([surface.color for surface in surfaces], dtype=np.float64)
        self.metres = np.array([metres or 0.0 for metres in own.sheets])
        media = [body.medium for body in own.scene.objects]
        self.extinction = np.array([np.zeros(3) if m is None else m.extinction for m in media])
        self.emission = np.stack([own.scene.source(body) for body in own.scene.objects])
        self.films = films_of(own)

    def interact(
        self, branches: Branches, places: InterfaceHits, pixel: Integers, spread: Spread | None
    ) -> InterfaceInteractions:
        """Reflection and refraction of branches that have come to places, on microfacets if there is a `spread`."""
        own, directions = self.own, branches.directions
        sheet = places.before == places.after
        ior = own.iors[np.where(sheet, places.item, places.after)] / own.iors[places.before]
        normals, flat = self._normals(places.face, branches)
        alpha = np.where(ior != 1.0, self.alpha[places.item], 0.0)
        facets, share = normals, optics.fresnel_dielectric(_facing(directions, normals), ior)
        rough = np.flatnonzero(alpha > 0)
        if spread is not None and rough.size:
            facets, points = normals.copy(), spread.at(pixel[rough], branches.met[rough])
            sampled = alpha[rough] * np.sqrt(1.0 - spread.blurred)
            facets[rough] = visible_normals(directions[rough], normals[rough], sampled, points)
            facets[rough], share[rough] = _at_facets(
                directions[rough], normals[rough], facets[rough], ior[rough], alpha[rough]
            )
        cosine = _facing(directions, facets)
        lobes, emitted = self._lobes(places, share, cosine, ior, sheet)
        enters = sheet | (places.item == places.after)
        coat = np.where(enters, own.coats[places.item], 0.0)
        coated = (coat * optics.fresnel_dielectric(_facing(directions, normals), CLEARCOAT_IOR))[:, None]
        lobes, emitted = below_coat(lobes, coated), (1.0 - coated) * emitted
        alike = self.coat_roughness[places.item] ** 2 == alpha
        reflectance = lobes.reflection + np.where(alike[:, None], coated, 0.0)
        tint = np.where(enters[:, None], self.color[places.item], 1.0) * self.transmission[places.item, None]
        reflected = kept_on_side(reflected_direction(directions, facets), flat)
        refracted = kept_on_side(refracted_direction(directions, facets, ior), -flat)
        refracted = np.where(sheet[:, None], directions, refracted)
        blurred = (1.0 if spread is None else spread.blurred) * alpha * alpha
        # A facet turns a mirror image by twice its angle, which a ray that leaves magnifies; refraction, seen from
        # outside, turns it by n - 1 times that.
        wide = np.where(ior < 1.0, 1.0 / ior, 1.0)
        narrow = 0.5 * (np.maximum(ior, 1.0 / ior) - 1.0)
        # Light goes straight on through a sheet: its two interfaces do no more than to blur.
        shares = reflectance, lobes.transmission, lobes.transmission * tint, emitted
        narrow_blur = np.where(sheet, 2.0 * alpha * alpha, blurred)
        return InterfaceInteractions(
            places.item,
            places.before,
            normals,
            ior,
            alpha,
            reflected,
            refracted,
            *shares,
            blurred * wide**2,
            narrow_blur * narrow**2,
            np.where(alike, 0.0, coated[:, 0]),
            coat,
            self.coat_roughness[places.item],
        )

    def _lobes(self, places: InterfaceHits, bare: Array, cosine: Array, ior: Array, sheet: Mask) -> tuple[Lobes, Array]:
        """Lobes of interfaces that reflect `bare` (k,), and the radiance (k, 3) that thin walls emit."""
        item = places.item
        path = optics.thin_layer_thickness(self.metres[item], cosine, ior)[:, None]
        with np.errstate(over="ignore", under="ignore"):
            depth = self.extinction[item] * path
            lobes, front = interface_lobes(
                bare, cosine, ior, self.films[item], self.own.iors[places.before], sheet, depth
            )
            emitted = np.zeros((len(item), 3))
            if (wall := np.flatnonzero(sheet)).size:
                leaving = thin_wall_exitance(front[wall], bare[wall], depth[wall])
                own = optics.emitted_radiance(self.emission[item[wall]], self.extinction[item[wall]], path[wall])
                emitted[wall] = leaving * own
        return lobes, emitted

    def _normals(self, face: Integers, branches: Branches) -> tuple[Array, Array]:
        """Unit normals (k, 3) against the branches: for shading, and of the faces."""
        caster, directions = self.caster, branches.directions
        weights = caster.barycentric(face, branches.origins)
        smooth = np.einsum("kij,ki->kj", caster.smooth[face], weights)
        flat = caster.faces.outward[face].copy()
        away = dot(flat, directions) > 0
        flat[away] *= -1.0
        smooth[away] *= -1.0
        smooth = unit(smooth)
        facing = dot(smooth, directions)
        edge_on = np.flatnonzero(facing > -EDGE_ON)
        smooth[edge_on] -= (facing[edge_on] + EDGE_ON)[:, None] * directions[edge_on]
        smooth[edge_on] = unit(smooth[edge_on])
        return smooth, flat


def _at_facets(directions: Array, normals: Array, facets: Array, ior: Array, alpha: Array) -> tuple[Array, Array]:
    """Microfacets (k, 3) that light leaves, and the share (k,) that they reflect.

    Light that other microfacets would block leaves by the other branch: each has the part of Fresnel's share that
    Smith's masking lets out (Heitz 2014, eq. 43), and together they have all. Where nothing is let out, the surface
    itself takes the place of the microfacet.
    """
    share = optics.fresnel_dielectric(_facing(directions, facets), ior)
    back = _let_out(dot(reflected_direction(directions, facets), normals), alpha) * share
    on = _let_out(-dot(refracted_direction(directions, facets, ior), normals), alpha) * (1.0 - share)
    both = back + on
    blocked = both <= LEAST_LET_OUT
    smooth = optics.fresnel_dielectric(_facing(directions, normals), ior)
    share = np.where(blocked, smooth, back / np.where(blocked, 1.0, both))
    return np.where(blocked[:, None], normals, facets), share


def _let_out(cosine: Array, alpha: Array) -> Array:
    """Smith's masking 2 / (1 + sqrt(1 + alpha^2 tan^2)) of GGX in a direction, by its cosine to the side it goes to."""
    c = np.maximum(cosine, 0.0)
    with np.errstate(under="ignore"):
        root = np.sqrt(c * c + alpha * alpha * (1.0 - c) * (1.0 + c))
    return np.asarray(2.0 * c / (c + root))


def _facing(directions: Array, normals: Array) -> Array:
    return np.clip(-dot(normals, directions), 0.0, 1.0)


def films_of(own: Optics) -> Array:
    """(objects, 3): thin films of the surfaces of a scene, as `filmed_reflectance` takes them."""
    return np.array([(s.iridescence, s.iridescence_ior, s.iridescence_thickness) for s in own.surfaces], np.float64)


class InterfaceLight:
    """Light of the interfaces of a scene.

    Parameters
    ----------
    own : Optics
    light : SurfaceLight
        On paint, and mirrored in rough interfaces.
    """

    def __init__(self, own: Optics, light: SurfaceLight) -> None:
        self.own, self.scene, self.light = own, own.scene, light
        surfaces = own.surfaces
        self._diffuse = np.array([1.0 - surface.transmission for surface in surfaces])
        self._color = np.array([surface.color for surface in surfaces], dtype=np.float64)
        self._through = np.array([surface.diffuse_transmission for surface in surfaces])
        self._through_color = np.array([surface.diffuse_transmission_color for surface in surfaces], dtype=np.float64)
        media = [body.medium for body in own.scene.objects]
        # Of sheets, straight through.
        self._depth = np.array(
            [
                (metres or 0.0) * (np.zeros(3) if medium is None else medium.extinction)
                for metres, medium in zip(own.sheets, media, strict=True)
            ]
        )
        self._is_sheet = np.array([metres is not None for metres in own.sheets])
        self._films = films_of(own)

    def radiance(self, rays: Rays, met: InterfaceInteractions) -> Array:
        """(k, 3): radiance at the origins of rays, in metres from the eye, against their directions."""
        found = met.emitted.copy()
        if self._diffuse.any():
            self._add_diffuse(found, rays, met)
        rough = np.flatnonzero(met.alpha > 0) if self.scene.lights else np.empty(0, np.int64)
        if rough.size:
            coat = met.coat[rough] * optics.fresnel_dielectric(_cosines(rays, met, rough), CLEARCOAT_IOR)
            self._add_highlights(found, rays, met, rough, met.alpha[rough], 1.0 - coat)
        coats = np.flatnonzero((met.coat > 0) & (met.coat_roughness > 0)) if self.scene.lights else rough[:0]
        if coats.size:
            self._add_highlights(found, rays, met, coats, met.coat_roughness[coats] ** 2, None)
        return found

    def _add_diffuse(self, found: Array, rays: Rays, met: InterfaceInteractions) -> None:
        share = met.passed * self._diffuse[met.item, None]
        painted = np.flatnonzero((share > 0.0).any(axis=1))
        item, points, normals = met.item[painted], rays.origins[painted], met.normals[painted]
        through = self._through[item]
        front, back = (self.light.on_interfaces(points, side * normals) for side in (1.0, -1.0))
        with np.errstate(under="ignore"):
            behind = through[:, None] * self._through_color[item]
            found[painted] += share[painted] * diffuse_radiance(front, back, self._color[item], behind, through)

    def _add_highlights(
        self, found: Array, rays: Rays, met: InterfaceInteractions, rough: Integers, alpha: Array, below: Array | None
    ) -> None:
        """Add single reflections of lights, as far as their light reaches the interfaces straight on.

        `below` is what clear coats leave (k,) of those; without it they are of the coats.
        """
        points, normals, to_eye = rays.origins[rough], met.normals[rough], -rays.directions[rough]
        cos_view = _cosines(rays, met, rough)
        for light in self.light.paths.lights:
            if isinstance(light, PositionalLight):
                to_light = unit(np.asarray(light.position) - points)
            else:
                to_light = np.broadcast_to(-np.asarray(light.direction), points.shape)
            half = unit(to_eye + to_light)
            cos_half, cos_light = (np.clip(dot(normals, way), 0.0, 1.0) for way in (half, to_light))
            cos_facet = np.clip(dot(half, to_eye), 0.0, 1.0)
            if below is None:
                share = (
                    met.coat[rough, None] * optics.fresnel_dielectric(cos_facet, CLEARCOAT_IOR)[:, None] * np.ones(3)
                )
            else:
                share = below[:, None] * self._mirrored(met, rough, cos_facet)
            value = microfacet_value(cos_half, cos_light, cos_view, alpha)
            with np.errstate(under="ignore"):
                mirrored = share * value[:, None] * light.irradiance_on(points, normals)
                lit = np.flatnonzero(mirrored.any(axis=1))
                found[rough[lit]] += mirrored[lit] * self.light.to_interfaces(light, points[lit])

    def _mirrored(self, met: InterfaceInteractions, rough: Integers, cosine: Array) -> Array:
        """(k, 3): share of light that microfacets of `rough` interfaces mirror, those of sheets from both sides."""
        item, ior = met.item[rough], met.ior[rough]
        bare = optics.fresnel_dielectric(cosine, ior)
        before = self.own.iors[met.before[rough]]
        with np.errstate(over="ignore"):
            depth = self._depth[item] * optics.thin_layer_thickness(1.0, cosine, ior)[:, None]
        lobes, _ = interface_lobes(bare, cosine, ior, self._films[item], before, self._is_sheet[item], depth)
        return lobes.reflection


def _cosines(rays: Rays, met: InterfaceInteractions, chosen: Integers) -> Array:
    """(k,): cosines between the normals of interfaces and the ways back to the eye."""
    return np.clip(-dot(met.normals[chosen], rays.directions[chosen]), 0.0, 1.0)
