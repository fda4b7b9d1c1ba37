"""Surfaces on rays that no interface bends: opaque objects, thin sheets and layers, with their textures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.formulas import optics
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.planning.methods import Method
from translucent.reference.hits import Hits, Rays, world_normals
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import LEAST_COVER, SMOOTH
from translucent.scene.texture import Texture


def color_and_opacity(body: Object, face: Integers, barycentric: Array) -> Array:
    """(k, 4): color and opacity of texture and vertices on faces (k,), at barycentric coordinates (k, 3)."""
    found = sampled(body, face, barycentric, None if body.surface is None else body.surface.color_texture)
    colors = body.mesh.colors
    return found if colors is None else found * _across(body, face, barycentric, colors)


def sampled(body: Object, face: Integers, barycentric: Array, texture: Texture | None) -> Array:
    """(k, 4): a texture's values; 1 without one."""
    values = np.ones((len(face), 4))
    if texture is not None and body.mesh.uv is not None:
        found = texture.sample(_across(body, face, barycentric, body.mesh.uv))
        values[:, : found.shape[1]] = found
    return values


def interface_surfaces(scene: Scene, item: Integers, face: Integers, barycentric: Array) -> tuple[Array, Array, Array]:
    """Roughness (k,), transmission (k,) and base color (k, 3) of interfaces, with their textures.

    Parameters
    ----------
    scene : Scene
    item, face : (k,) int64
        Index into `Scene.objects`, and into the faces of its mesh.
    barycentric : (k, 3) float64
        Weights of the face's corners.
    """
    roughness, transmission, color = np.zeros(len(item)), np.ones(len(item)), np.ones((len(item), 3))
    for i in np.unique(item):
        own = np.flatnonzero(item == i)
        body, surface = scene.objects[i], scene.objects[i].surface or SMOOTH
        place = body, face[own], barycentric[own]
        roughness[own] = surface.roughness * sampled(*place, surface.roughness_texture)[:, 1]
        transmission[own] = surface.transmission * sampled(*place, surface.transmission_texture)[:, 0]
        color[own] = np.asarray(surface.color) * color_and_opacity(*place)[:, :3]
    return roughness, transmission, color


def without_cut_out(body: Object, hits: Hits) -> Hits:
    """Hits of an opaque object outside its holes (`Surface.alpha_cutoff`)."""
    if body.surface is None or body.surface.alpha_cutoff <= 0:
        return hits
    return hits.where(color_and_opacity(body, hits.face, hits.barycentric)[:, 3] >= body.surface.alpha_cutoff)


def _across(body: Object, face: Integers, barycentric: Array, values: Array) -> Array:
    """(k, n): vertex attributes (v, n) interpolated."""
    return np.asarray(np.einsum("kc,kcn->kn", barycentric, values[body.mesh.faces[face]]))


#: Irradiance (k, 3) on surfaces at points (k, 3), in metres from the eye, with unit normals (k, 3).
Irradiance = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class OpaqueHits:
    """Nearest opaque surface on each ray, seen from either side.

    Attributes
    ----------
    distance : (n,) float64
        In metres along the ray, >= 0; inf where there is none.
    item : (n,) int64
        Index into `Scene.objects`; -1 where there is none.
    face : (n,) int64
        Index into the mesh's faces.
    barycentric : (n, 3) float64
        Weights of the face's corners.
    """

    distance: Array
    item: Integers
    face: Integers
    barycentric: Array

    def where(self, chosen: Integers) -> OpaqueHits:
        """Selection of rays by indices."""
        return OpaqueHits(self.distance[chosen], self.item[chosen], self.face[chosen], self.barycentric[chosen])


def nearest_opaque(scene: Scene, hits: Sequence[Hits], pixels: int) -> OpaqueHits:
    """Find the first opaque surface ahead of each origin, past holes; of several at one distance, that of the first
    object.

    Parameters
    ----------
    scene : Scene
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them.
    pixels : int
        Number of rays.
    """
    across = np.zeros((pixels, 3))
    nearest = OpaqueHits(np.full(pixels, np.inf), np.full(pixels, -1), np.full(pixels, -1), across)
    for i, body in enumerate(scene.objects):
        if body.medium is None:
            closer = without_cut_out(body, hits[i].before(nearest.distance))
            pixel, first = np.unique(closer.pixel, return_index=True)
            nearest.distance[pixel], nearest.item[pixel] = closer.distance[first], i
            nearest.face[pixel], across[pixel] = closer.face[first], closer.barycentric[first]
    return nearest


def reflected_radiance(scene: Scene, rays: Rays, nearest: OpaqueHits, irradiance: Irradiance) -> Array:
    """Diffusely reflected radiance of opaque surfaces towards the origins, and emission, (n, 3); 0 on rays without one.

    Lambert: color / pi times the irradiance on the visible side, as `SurfaceLight.on_opaque` gives it.
    """
    radiance = np.zeros((len(rays), 3))
    visible = np.flatnonzero(nearest.item >= 0)
    if visible.size:
        hits, directions = nearest.where(visible), rays.directions[visible]
        normals, color, emitted = lambert_surfaces(scene, directions, hits)
        # From the eye, as the rays are, so that the vector to a light keeps its digits far from the world's origin.
        points = rays.origins[visible] + hits.distance[:, None] * directions
        with np.errstate(under="ignore"):
            radiance[visible] = color / np.pi * irradiance(points, normals) + emitted
    return radiance


def lambert_surfaces(scene: Scene, directions: Array, hits: OpaqueHits) -> tuple[Array, Array, Array]:
    """Normals of opaque surfaces towards the rays that hit them, their base colors, and emitted radiance, (k, 3) each.

    `directions`: (k, 3), in which the rays travel.
    """
    normals, color, emitted = np.zeros((3, *directions.shape))
    for i in np.unique(hits.item):
        own = np.flatnonzero(hits.item == i)
        normals[own], color[own], emitted[own] = _lambert(scene.objects[i], directions[own], hits.where(own))
    return normals, color, emitted


def _lambert(body: Object, directions: Array, hits: OpaqueHits) -> tuple[Array, Array, Array]:
    """`lambert_surfaces` of one object."""
    normals = world_normals(body, hits.face)
    normals[np.einsum("ki,ki->k", normals, directions) > 0] *= -1.0
    color = body.base_color * color_and_opacity(body, hits.face, hits.barycentric)[:, :3]
    emitted = np.zeros_like(color)
    if body.surface is not None and body.surface.glows:
        texture = sampled(body, hits.face, hits.barycentric, body.surface.emissive_texture)
        emitted = np.asarray(body.surface.emissive) * texture[:, :3]
    return normals, color, emitted


#: Transmittance of an opaque layer: the smallest that float32 can hold.
_LEAST_LEFT = 1e-37


def without_holes(body: Object, hits: Hits) -> Hits:
    """Hits of a sheet outside its holes, on its visible sides."""
    if body.surface is None or not (body.covers or body.has_holes):
        return hits
    if body.covers and not body.surface.double_sided:
        hits = hits.where(hits.sign > 0)
    alpha = color_and_opacity(body, hits.face, hits.barycentric)[:, 3]
    return hits.where(alpha >= (body.surface.alpha_cutoff or LEAST_COVER))


def layer_depth(body: Object, hits: Hits) -> Array:
    """(k,): optical depth of a layer at its hits; 0 if the object is not a layer."""
    if body.surface is None or body.surface.opacity is None:
        return np.zeros(len(hits.pixel))
    return np.asarray(
        -np.log(
            np.maximum(
                1.0 - body.surface.opacity * color_and_opacity(body, hits.face, hits.barycentric)[:, 3], _LEAST_LEFT
            )
        )
    )


def layer_radiance(body: Object, hits: Hits, rays: Rays, irradiance: Irradiance) -> Array:
    """(k, 3): radiance of a layer at its hits: diffuse, as opaque objects are here, plus emission."""
    if body.surface is None or not body.covers:
        return np.zeros((len(hits.pixel), 3))
    directions = rays.directions[hits.pixel]
    normals = world_normals(body, hits.face)
    normals[np.einsum("ki,ki->k", normals, directions) > 0] *= -1.0
    points = rays.origins[hits.pixel] + hits.distance[:, None] * directions
    emitted = (
        np.asarray(body.surface.emissive)
        * sampled(body, hits.face, hits.barycentric, body.surface.emissive_texture)[:, :3]
    )
    with np.errstate(under="ignore"):
        lit = irradiance(points, normals) / np.pi
        return np.asarray(body.base_color * color_and_opacity(body, hits.face, hits.barycentric)[:, :3] * lit + emitted)


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings of rays with sheets: flat arrays.

    Attributes
    ----------
    pixel : (k,) int64
        Number of the ray.
    distance : (k,) float64
        In metres along the ray, >= 0.
    path : (k,) float64
        Metres inside the sheet.
    body : (k,) int64
        Index into `Scene.objects`.
    covered : (k,) float64
        Optical depth of a layer there, besides that of a medium.
    radiance : (k, 3) float64
        Radiance of the layer.
    """

    pixel: Integers
    distance: Array
    path: Array
    body: Integers
    covered: Array
    radiance: Array


def sheet_thicknesses(scene: Scene, method: Method | None = None) -> tuple[float | None, ...]:
    """Sheet thickness in metres of each of `Scene.objects`; None for a solid.

    `ThinLayer` makes a sheet of every mesh that declares no thickness of its own. Opaque objects are never sheets.
    """
    usual = None if method is None else method.usual_thickness
    return tuple(
        None if body.medium is None else usual if body.sheet_thickness is None else body.sheet_thickness
        for body in scene.objects
    )


def sheet_hits(scene: Scene, body: Object, hits: Hits, end: Array) -> Hits:
    """Surfaces of a sheet that rays cross before they stop at `end` (pixels,), or on the surface that stops them."""
    last = end[hits.pixel] + SHEET_ON_OPAQUE * scene.diagonal
    return without_holes(body, hits.where((hits.distance >= 0) & (hits.distance <= last)))


def scene_crossings(
    scene: Scene,
    rays: Rays,
    hits: Sequence[Hits],
    sheets: Sequence[float | None],
    end: Array,
    irradiance: Irradiance | None,
) -> Crossings:
    """Crossings of rays with all sheets of a scene.

    Parameters
    ----------
    scene : Scene
    rays : Rays
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them.
    sheets : sequence of float or None
        As `sheet_thicknesses` gives them.
    end : (n,) float64
        Where an opaque surface stops each ray, in metres; inf where none does.
    irradiance : callable, optional
        On layers; without it they are left out.
    """
    none: tuple[npt.NDArray[np.generic], ...]
    none = (np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0, np.int64), np.empty(0), np.empty((0, 3)))
    parts = [none]
    for i, (body, metres) in enumerate(zip(scene.objects, sheets, strict=True)):
        if metres is not None and (irradiance is not None or not body.covers):
            crossed = sheet_hits(scene, body, hits[i], end)
            path = _paths(body, metres, crossed, rays.directions[crossed.pixel])
            radiance = (
                np.zeros((len(path), 3)) if irradiance is None else layer_radiance(body, crossed, rays, irradiance)
            )
            parts.append(
                (crossed.pixel, crossed.distance, path, np.full(len(path), i), layer_depth(body, crossed), radiance)
            )
    return Crossings(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _paths(body: Object, metres: float, hits: Hits, directions: Array) -> Array:
    """(k,): path in metres through the sheet at each hit, by the normal of its face."""
    # The normals look to the side from which the faces are counter-clockwise: towards the viewer at a front face.
    outwards = -1 if body.mesh.diagnosis.inverted else 1
    cosine = -outwards * hits.sign * np.einsum("ki,ki->k", world_normals(body, hits.face), directions)
    return optics.thin_layer_thickness(metres, cosine, body.medium.ior if body.medium else 1.0)
