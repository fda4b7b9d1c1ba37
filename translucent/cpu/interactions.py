"""Interactions of rays with interfaces: microfacets, reflection and refraction, highlights and diffuse reflection."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.interior_list import Branches
from translucent.diffusion.interfaces import InterfaceTable
from translucent.formulas import optics
from translucent.formulas.bsdf import Interaction, below_coat, diffuse_radiance, microfacet_normal, microfacet_value
from translucent.formulas.interface import CLEARCOAT_IOR, reflected_direction, refracted_direction
from translucent.formulas.light import disc_peak, highlight_disc, nearest_on_disc
from translucent.geometry.ray_caster import SceneRayCaster, dot, unit
from translucent.planning.bodies import textured_at_hits
from translucent.reference.hits import Rays
from translucent.reference.light_paths import SurfaceLight
from translucent.reference.surfaces import interface_surfaces
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Light

#: Interfaces of a ray that have points of their own; later interfaces take them again, with other offsets.
INTERFACES = 8


class MicrofacetSamples:
    """Random points for the microfacets of one sample of all pixels.

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
        Fraction of the variance of microfacets that is left to the blur of the environment: few samples would show
        noise, and many need no blur (as in Krivanek & Colbert 2008, "Real-time shading with filtered importance
        sampling").
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


@lru_cache(maxsize=4)
def _sobol(samples: int) -> Array:
    """(samples, 2 INTERFACES): Sobol points, scrambled to be independent of the pixel samples."""
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


#: Alpha of the microfacets in which polished interfaces mirror sphere lights, as on the GPU.
SMALLEST_HIGHLIGHT = 1e-3

#: Of a light's irradiance, in 1/sr, for which occluders are not looked for, as on the GPU.
FAINTEST_HIGHLIGHT = 1e-6

#: Fraction of light below which a microfacet counts as blocked.
LEAST_LET_OUT = 1e-6


@dataclass(frozen=True, eq=False)
class InterfaceHits:
    """Interfaces that the branches of a ray tree hit, one for each branch.

    Attributes
    ----------
    item : (k,) int64
        Whose interface it is.
    face : (k,) int64
        Of `SceneRayCaster.faces`.
    before, after : (k,) int64
        Bodies that light is in on this side and on the other, or `AIR`; equal for a sheet.
    """

    item: Integers
    face: Integers
    before: Integers
    after: Integers


@dataclass(frozen=True, eq=False)
class BranchInteractions:
    """Reflection and refraction of the branches of a ray tree at interfaces.

    Attributes
    ----------
    item : (k,) int64
        Whose interfaces these are.
    at : Interaction
    alpha : (k,) float64
        Width of the distribution of microfacets.
    transmission, color : (k,), (k, 3) float64
        Of the base.
    reflected, refracted : (k, 3) float64
        Directions.
    reflectance, transmittance : (k, 3) float64
        Fractions of light that are reflected, and that pass below the clear coat.
    passing : (k, 3) float64
        Fraction that is refracted: what the diffuse base leaves of `transmittance`.
    emitted : (k, 3) float64
        Radiance that sheets emit.
    blur_reflected, blur_refracted : (k,) float64
        What is added to `Branches.blur`.
    coated : (k,) float64
        Fraction reflected by clear coats that are not as rough as what is below; that of others is in `reflectance`.
    coat_roughness : (k,) float64
    """

    item: Integers
    at: Interaction
    alpha: Array
    transmission: Array
    color: Array
    reflected: Array
    refracted: Array
    reflectance: Array
    transmittance: Array
    passing: Array
    emitted: Array
    blur_reflected: Array
    blur_refracted: Array
    coated: Array
    coat_roughness: Array


def interact(
    table: InterfaceTable,
    channel: int,
    caster: SceneRayCaster,
    branches: Branches,
    places: InterfaceHits,
    pixel: Integers,
    spread: MicrofacetSamples | None,
) -> BranchInteractions:
    """Reflect and refract branches at interfaces, at random microfacets if there is a `spread`."""
    directions, item = branches.directions, places.item
    normals = caster.facing_normals(places.face, branches.origins, directions)
    at = table.interaction(item, places.before, places.after, channel, directions, normals)
    alpha, transmission, color = table.alpha[item], table.transmission[item], table.color[item]
    if textured_at_hits(table.scene):
        weights = caster.barycentric(places.face, branches.origins)
        face = caster.faces.number[places.face]
        roughness, transmission, color = interface_surfaces(table.scene, item, face, weights)
        alpha = roughness**2
        enters = at.thin_walled | (item == places.after)
        at = at._replace(base=np.where(enters[:, None], color, 1.0) * transmission[:, None])
    alpha = np.where(at.ior != 1.0, alpha, 0.0)
    facets, bare = at.normal, optics.fresnel_dielectric(at.cosine(at.normal), at.ior)
    rough = np.flatnonzero(alpha > 0)
    if spread is not None and rough.size:
        facets, points = facets.copy(), spread.at(pixel[rough], branches.depth[rough])
        sampled = alpha[rough] * np.sqrt(1.0 - spread.blurred)
        found = microfacet_normal(at.normal[rough], directions[rough], sampled, np.stack(points, axis=1))
        facets[rough], bare[rough] = _at_facets(at.where(rough), found, alpha[rough])
    coat, coat_roughness = at.coat_reflectance(), table.coat_roughness[item]
    lobes, emitted = at.lobes(bare, at.cosine(facets))
    lobes = below_coat(lobes, coat)
    alike = coat_roughness**2 == alpha
    blurred = (1.0 if spread is None else spread.blurred) * alpha * alpha
    # A facet rotates a reflected image by twice its angle, which a ray that leaves magnifies; refraction, from
    # outside, rotates it by n - 1 times that.
    wide = np.where(at.ior < 1.0, 1.0 / at.ior, 1.0)
    narrow = 0.5 * (np.maximum(at.ior, 1.0 / at.ior) - 1.0)
    return BranchInteractions(
        item,
        at,
        alpha,
        transmission,
        color,
        at.reflected(facets),
        at.refracted(facets),
        lobes.reflection + np.where(alike[:, None], coat, 0.0),
        lobes.transmission,
        lobes.transmission * at.base,
        (1.0 - coat) * emitted,
        blurred * wide**2,
        # Light goes straight on through a sheet: its two interfaces do no more than to blur.
        np.where(at.thin_walled, 2.0 * alpha * alpha, blurred) * narrow**2,
        np.where(alike, 0.0, coat[:, 0]),
        coat_roughness,
    )


def _at_facets(at: Interaction, facets: Array, alpha: Array) -> tuple[Array, Array]:
    """Microfacets (k, 3) whose light is not masked, and the fraction (k,) that they reflect.

    Light that other microfacets would block leaves by the other branch: each has the part of the Fresnel reflectance
    that Smith's masking lets out (Heitz 2014, eq. 43), and together they have all. Where nothing is let out, the
    surface itself takes the place of the microfacet.
    """
    fresnel = optics.fresnel_dielectric(at.cosine(facets), at.ior)
    back = _let_out(dot(reflected_direction(at.direction, facets), at.normal), alpha) * fresnel
    on = _let_out(-dot(refracted_direction(at.direction, facets, at.ior), at.normal), alpha) * (1.0 - fresnel)
    both = back + on
    blocked = both <= LEAST_LET_OUT
    smooth = optics.fresnel_dielectric(at.cosine(at.normal), at.ior)
    fraction = np.where(blocked, smooth, back / np.where(blocked, 1.0, both))
    return np.where(blocked[:, None], at.normal, facets), fraction


def _let_out(cosine: Array, alpha: Array) -> Array:
    """Smith's masking 2 / (1 + sqrt(1 + alpha^2 tan^2)) of GGX in a direction, by its cosine to the side it goes to."""
    c = np.maximum(cosine, 0.0)
    with np.errstate(under="ignore"):
        root = np.sqrt(c * c + alpha * alpha * (1.0 - c) * (1.0 + c))
    return np.asarray(2.0 * c / (c + root))


class InterfaceLight:
    """Light that interfaces reflect diffusely and in highlights, and that sheets emit.

    Parameters
    ----------
    table : InterfaceTable
    light : SurfaceLight
        On diffuse bases, and reflected in interfaces.
    """

    def __init__(self, table: InterfaceTable, light: SurfaceLight) -> None:
        self.table, self.light = table, light
        self._spheres = [one for one in light.paths.lights if isinstance(one, PositionalLight) and one.disc[3] > 0.0]
        self._through = table.column("diffuse_transmission")
        self._through_color = table.column("diffuse_transmission_color")

    def radiance(self, rays: Rays, found: BranchInteractions, first: Mask) -> Array:
        """(k, 3): radiance at the origins of rays, in metres from the eye, against their directions.

        Polished interfaces mirror sphere lights where they are the `first` (k,) on the ray of the camera.
        """
        radiance, at = found.emitted.copy(), found.at
        if (found.transmission < 1.0).any():
            self._add_diffuse(radiance, rays, found)
        if not self.light.scene.lights:
            return radiance
        rough = np.flatnonzero(found.alpha > 0)
        if rough.size:
            below = at.where(rough)
            left = 1.0 - below.coat_reflectance()
            self._add_highlights(radiance, rays, below, rough, found.alpha[rough], left)
        coats = np.flatnonzero((at.coat > 0) & (found.coat_roughness > 0))
        if coats.size:
            self._add_highlights(radiance, rays, at.where(coats), coats, found.coat_roughness[coats] ** 2, None)
        if self._spheres:
            self._add_mirrored_spheres(radiance, rays, found, first)
        return radiance

    def _add_mirrored_spheres(self, radiance: Array, rays: Rays, found: BranchInteractions, first: Mask) -> None:
        polished = np.flatnonzero(first & (found.alpha == 0.0) & (found.at.ior != 1.0))
        if polished.size:
            below, alpha = found.at.where(polished), np.full(len(polished), SMALLEST_HIGHLIGHT)
            left = 1.0 - below.coat_reflectance()
            self._add_highlights(radiance, rays, below, polished, alpha, left, self._spheres)
        coats = np.flatnonzero(first & (found.at.coat > 0) & (found.coat_roughness == 0))
        if coats.size:
            alpha = np.full(len(coats), SMALLEST_HIGHLIGHT)
            self._add_highlights(radiance, rays, found.at.where(coats), coats, alpha, None, self._spheres)

    def _add_diffuse(self, radiance: Array, rays: Rays, found: BranchInteractions) -> None:
        weight = found.transmittance * (1.0 - found.transmission[:, None])
        diffuse = np.flatnonzero((weight > 0.0).any(axis=1))
        item, points, normals = found.item[diffuse], rays.origins[diffuse], found.at.normal[diffuse]
        through = self._through[item]
        front, back = (self.light.on_interfaces(points, side * normals) for side in (1.0, -1.0))
        with np.errstate(under="ignore"):
            behind = through[:, None] * self._through_color[item]
            color = found.color[diffuse]
            radiance[diffuse] += weight[diffuse] * diffuse_radiance(front, back, color, behind, through)

    def _add_highlights(
        self,
        radiance: Array,
        rays: Rays,
        at: Interaction,
        chosen: Integers,
        alpha: Array,
        below: Array | None,
        lights: Sequence[Light] | None = None,
    ) -> None:
        """Add single reflections of lights, as far as their light reaches the `chosen` interfaces straight on.

        `below` is the fraction (k, 1) that clear coats leave of those; without it they are of the coats. Without
        `lights`, it is all of them.
        """
        points, to_eye = rays.origins[chosen], -at.direction
        for light in self.light.paths.lights if lights is None else lights:
            if isinstance(light, PositionalLight):
                to_light = unit(np.asarray(light.position) - points)
            else:
                to_light = np.broadcast_to(-np.asarray(light.direction), points.shape)
            reflected_at, peak = to_light, np.ones(len(points))
            if isinstance(light, PositionalLight) and light.disc[3] > 0.0:
                to_disc = np.asarray(light.position) + light.disc[:3] - points
                away = np.maximum(np.sqrt(dot(to_disc, to_disc)), 1e-18)
                disc = np.column_stack([to_disc / away[:, None], np.minimum(light.disc[3] / away, 0.9)])
                cos_view = dot(to_eye, at.normal)
                image = 2.0 * cos_view[:, None] * at.normal - to_eye
                disc = highlight_disc(to_light, disc, alpha)
                reflected_at = nearest_on_disc(disc, image)
                peak = disc_peak(alpha, disc[:, 3], np.maximum(cos_view, 1e-3))
            half = unit(to_eye + reflected_at)
            cos_half, cos_light = (np.clip(dot(at.normal, direction), 0.0, 1.0) for direction in (half, to_light))
            cos_facet = at.cosine(half)
            if below is None:
                reflectance = (at.coat * optics.fresnel_dielectric(cos_facet, CLEARCOAT_IOR))[:, None] * np.ones(3)
            else:
                reflectance = below * at.lobes(optics.fresnel_dielectric(cos_facet, at.ior), cos_facet)[0].reflection
            value = microfacet_value(cos_half, cos_light, at.cosine(at.normal), alpha) * peak
            with np.errstate(under="ignore"):
                share = reflectance * value[:, None]
                reflected = share * light.irradiance_on(points, at.normal)
                lit = np.flatnonzero((share > FAINTEST_HIGHLIGHT).any(axis=1) & reflected.any(axis=1))
                radiance[chosen[lit]] += reflected[lit] * self.light.to_interfaces(light, points[lit])
