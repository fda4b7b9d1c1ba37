"""Partly transparent layers (Porter and Duff's `over`), and the holes of thin sheets.

A layer of opacity alpha that shows radiance S is a sheet of optical depth -log(1 - alpha) whose thickness emits S:
then it passes 1 - alpha, and adds S (1 - (1 - alpha)) = alpha S.
"""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.reference.hits import Hits, world_normals
from translucent.reference.opaque import Irradiance
from translucent.reference.painted import painted, sampled
from translucent.reference.rays import Rays
from translucent.scene.scene import Object
from translucent.scene.surface import LEAST_COVER

#: Transmittance of an opaque layer: the smallest that float32 can hold.
_LEAST_LEFT = 1e-37


def without_holes(body: Object, hits: Hits) -> Hits:
    """Hits of a sheet outside its holes, on its visible sides."""
    if body.surface is None or not (body.covers or body.has_holes):
        return hits
    if body.covers and not body.surface.double_sided:
        hits = hits.where(hits.sign > 0)
    alpha = painted(body, hits.face, hits.barycentric)[:, 3]
    return hits.where(alpha >= (body.surface.alpha_cutoff or LEAST_COVER))


def layer_depth(body: Object, hits: Hits) -> Array:
    """(k,): optical depth of a layer at its hits; 0 if the object is not a layer."""
    if body.surface is None or body.surface.opacity is None:
        return np.zeros(len(hits.pixel))
    return np.asarray(
        -np.log(np.maximum(1.0 - body.surface.opacity * painted(body, hits.face, hits.barycentric)[:, 3], _LEAST_LEFT))
    )


def layer_radiance(body: Object, hits: Hits, rays: Rays, irradiance: Irradiance) -> Array:
    """(k, 3): radiance of a layer at its hits: diffuse, as opaque objects are here, plus emission."""
    if body.surface is None or not body.covers:
        return np.zeros((len(hits.pixel), 3))
    directions = rays.directions[hits.pixel]
    normals = world_normals(body, hits.face)
    normals[np.einsum("ki,ki->k", normals, directions) > 0] *= -1.0
    points = rays.origins[hits.pixel] + hits.distance[:, None] * directions
    glow = (
        np.asarray(body.surface.emissive)
        * sampled(body, hits.face, hits.barycentric, body.surface.emissive_texture)[:, :3]
    )
    with np.errstate(under="ignore"):
        lit = irradiance(points, normals) / np.pi
        return np.asarray(body.base_color * painted(body, hits.face, hits.barycentric)[:, :3] * lit + glow)
