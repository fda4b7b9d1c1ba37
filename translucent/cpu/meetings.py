"""Light at the interfaces that beams meet: normals, reflected and refracted shares, and their directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers
from translucent.cpu.beams import Beams
from translucent.cpu.caster import Caster
from translucent.cpu.facets import Spread, visible_normals
from translucent.cpu.vectors import dot, unit
from translucent.formulas import optics
from translucent.formulas.interface import (
    reflected_direction,
    refracted_direction,
)
from translucent.formulas.thin_film import film_slab_reflectance, film_slab_transmittance
from translucent.reference.interfaces import EDGE_ON, Optics

#: Share of light below which a microfacet counts as blocked.
LEAST_LET_OUT = 1e-6


@dataclass(frozen=True, eq=False)
class Places:
    """Places at which beams meet interfaces, one for each beam.

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
class Meetings:
    """Reflection and refraction at interfaces.

    Attributes
    ----------
    item, before : (k,) int64
        Whose interfaces these are, and the bodies that the beams come from, or `AIR`.
    normals : (k, 3) float64
        For shading, towards where the beams come from.
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
        What is added to `Beams.blur`.
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

    def meet(self, beams: Beams, places: Places, pixel: Integers, spread: Spread | None) -> Meetings:
        """Reflection and refraction of beams that have come to places, on microfacets if there is a `spread`."""
        own, directions = self.own, beams.directions
        sheet = places.before == places.after
        ior = own.iors[np.where(sheet, places.item, places.after)] / own.iors[places.before]
        normals, flat = self._normals(places.face, beams)
        alpha = np.where(ior != 1.0, self.alpha[places.item], 0.0)
        facets, share = normals, optics.fresnel_dielectric(_facing(directions, normals), ior)
        rough = np.flatnonzero(alpha > 0)
        if spread is not None and rough.size:
            facets, points = normals.copy(), spread.at(pixel[rough], beams.met[rough])
            sampled = alpha[rough] * np.sqrt(1.0 - spread.blurred)
            facets[rough] = visible_normals(directions[rough], normals[rough], sampled, points)
            facets[rough], share[rough] = _at_facets(
                directions[rough], normals[rough], facets[rough], ior[rough], alpha[rough]
            )
        cosine = _facing(directions, facets)
        bare, share = share[:, None], own.filmed(share, places.item, places.before, cosine, ior)
        passed, emitted = 1.0 - share, np.zeros((len(beams), 3))
        refracted = _towards(refracted_direction(directions, facets, ior), -flat)
        chosen = np.flatnonzero(sheet)
        if chosen.size:
            share[chosen], passed[chosen], emitted[chosen] = self._slabs(
                places.item[chosen], share[chosen], bare[chosen], cosine[chosen], ior[chosen]
            )
            refracted[chosen] = directions[chosen]
        enters = sheet | (places.item == places.after)
        coated = own.coated(places.item, enters, _facing(directions, normals))[:, None]
        share, passed, emitted = (1.0 - coated) * share, (1.0 - coated) * passed, (1.0 - coated) * emitted
        alike = self.coat_roughness[places.item] ** 2 == alpha
        share = share + np.where(alike[:, None], coated, 0.0)
        tint = np.where(enters[:, None], self.color[places.item], 1.0) * self.transmission[places.item, None]
        reflected = _towards(reflected_direction(directions, facets), flat)
        blurred = (1.0 if spread is None else spread.blurred) * alpha * alpha
        # A facet turns a mirror image by twice its angle, which a ray that leaves magnifies; refraction, seen from
        # outside, turns it by n - 1 times that.
        wide = np.where(ior < 1.0, 1.0 / ior, 1.0)
        narrow = 0.5 * (np.maximum(ior, 1.0 / ior) - 1.0)
        # Light goes straight on through a sheet: its two interfaces do no more than to blur.
        shares, narrow_blur = (share, passed, passed * tint, emitted), np.where(sheet, 2.0 * alpha * alpha, blurred)
        return Meetings(
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
            np.where(enters, own.coats[places.item], 0.0),
            self.coat_roughness[places.item],
        )

    def _slabs(
        self, item: Integers, front: Array, bare: Array, cosine: Array, ior: Array
    ) -> tuple[Array, Array, Array]:
        """Reflectance, transmittance and emitted radiance (k, 3) of sheets.

        Their surfaces reflect `front` (k, 3), which has a film, and `bare` (k, 1).
        """
        path = optics.thin_layer_thickness(self.metres[item], cosine, ior)[:, None]
        with np.errstate(over="ignore", under="ignore"):
            depth = self.extinction[item] * path
            again = bare * optics.transmittance(depth)
            kept = 1.0 - front * optics.transmittance(depth) * again
            # What a sheet emits goes back and forth in it, too.
            leaving = np.where(kept > 0.0, (1.0 - front) * (1.0 + again) / np.where(kept > 0.0, kept, 1.0), 0.0)
            emitted = leaving * optics.emitted_radiance(self.emission[item], self.extinction[item], path)
            back, on = (f(front, bare[:, 0], depth) for f in (film_slab_reflectance, film_slab_transmittance))
        return back, on, emitted

    def _normals(self, face: Integers, beams: Beams) -> tuple[Array, Array]:
        """Unit normals (k, 3) towards where beams come from: for shading, as they face the beams, and of the faces."""
        caster, directions = self.caster, beams.directions
        weights = caster.barycentric(face, beams.origins)
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


def _towards(directions: Array, side: Array) -> Array:
    """Directions (k, 3), reflected to the `side` (k, 3) of a face where other normals mislead them."""
    across = np.minimum(dot(directions, side), 0.0)
    return np.asarray(directions - 2.0 * across[:, None] * side)
