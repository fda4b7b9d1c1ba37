"""Light that interfaces add themselves: that of paint on them, and the highlights of lights in rough ones."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Integers
from translucent.cpu.meetings import Meetings
from translucent.cpu.vectors import dot, unit
from translucent.formulas import optics
from translucent.formulas.interface import CLEARCOAT_IOR, ggx_distribution, ggx_visibility
from translucent.formulas.thin_film import film_slab_reflectance
from translucent.reference.interfaces import Optics
from translucent.reference.rays import Rays
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.lights import PositionalLight


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
        self._paint = np.array([1.0 - surface.transmission for surface in surfaces])
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

    def radiance(self, rays: Rays, met: Meetings) -> Array:
        """(k, 3): radiance at the origins of rays, in metres from the eye, against their directions."""
        found = met.emitted.copy()
        if self._paint.any():
            self._add_paint(found, rays, met)
        rough = np.flatnonzero(met.alpha > 0) if self.scene.lights else np.empty(0, np.int64)
        if rough.size:
            coat = met.coat[rough] * optics.fresnel_dielectric(_facing(rays, met, rough), CLEARCOAT_IOR)
            self._add_highlights(found, rays, met, rough, met.alpha[rough], 1.0 - coat)
        coats = np.flatnonzero((met.coat > 0) & (met.coat_roughness > 0)) if self.scene.lights else rough[:0]
        if coats.size:
            self._add_highlights(found, rays, met, coats, met.coat_roughness[coats] ** 2, None)
        return found

    def _add_paint(self, found: Array, rays: Rays, met: Meetings) -> None:
        share = met.passed * self._paint[met.item, None]
        painted = np.flatnonzero((share > 0.0).any(axis=1))
        item, points, normals = met.item[painted], rays.origins[painted], met.normals[painted]
        through = self._through[item, None]
        front, back = (self.light.on_interfaces(points, side * normals) for side in (1.0, -1.0))
        with np.errstate(under="ignore"):
            light = self._color[item] * (1.0 - through) * front + through * self._through_color[item] * back
            found[painted] += share[painted] / np.pi * light

    def _add_highlights(
        self, found: Array, rays: Rays, met: Meetings, rough: Integers, alpha: Array, below: Array | None
    ) -> None:
        """Add single reflections of lights, as far as their light reaches the interfaces straight on.

        `below` is what clear coats leave (k,) of those; without it they are of the coats.
        """
        points, normals, to_eye = rays.origins[rough], met.normals[rough], -rays.directions[rough]
        cos_view = _facing(rays, met, rough)
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
            density, visible = ggx_distribution(cos_half, alpha), ggx_visibility(cos_light, cos_view, alpha)
            with np.errstate(under="ignore"):
                mirrored = share * (density * visible)[:, None] * light.irradiance_on(points, normals)
                lit = np.flatnonzero(mirrored.any(axis=1))
                found[rough[lit]] += mirrored[lit] * self.light.to_interfaces(light, points[lit])

    def _mirrored(self, met: Meetings, rough: Integers, cosine: Array) -> Array:
        """(k, 3): share of light that microfacets of `rough` interfaces mirror, those of sheets from both sides."""
        item, ior = met.item[rough], met.ior[rough]
        bare = optics.fresnel_dielectric(cosine, ior)
        share = self.own.filmed(bare, item, met.before[rough], cosine, ior)
        path = optics.thin_layer_thickness(1.0, cosine, ior)[:, None]
        with np.errstate(over="ignore"):
            depth = self._depth[item] * path
        return np.where(self._is_sheet[item, None], film_slab_reflectance(share, bare, depth), share)


def _facing(rays: Rays, met: Meetings, chosen: Integers) -> Array:
    """(k,): cosines between the normals of interfaces and the ways back to the eye."""
    return np.clip(-dot(met.normals[chosen], rays.directions[chosen]), 0.0, 1.0)
