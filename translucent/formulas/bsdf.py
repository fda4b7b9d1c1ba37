"""Bsdfs of interfaces in float64: smooth and rough dielectrics, thin walls and films, clear coats, a diffuse base.

Functions of numbers have twins of the same name in ``shaders/lib/bsdf.glsl``. All are pure and broadcast. Reflectances
and transmittances are fractions of the light at an interface, by channel; a cosine is that of the direction which the
light comes from; ``ior`` is the index of the other side relative to this one. Directions (..., 3) are unit vectors in
which light travels; a normal looks to the side that the light comes from.

`brdf_table` is the reflectance of a rough interface under uniform light, for the split-sum approximation. With the
Fresnel term F = F0 + (F90 - F0) (1 - v.h)^5 of Schlick it is ``F0 * scale + F90 * bias``. The microfacets are GGX with
alpha = roughness^2 and height-correlated shadowing and masking (Heitz 2014, eq. 99), as in glTF 2.0, appendix B.

References
----------
Walter et al. 2007, "Microfacet models for refraction through rough surfaces"; Heitz 2014, "Understanding the masking-
shadowing function in microfacet-based BRDFs"; Belcour & Barla 2017, "A practical extension to microfacet theory for the
modeling of varying iridescence"; Schlick 1994, "An inexpensive BRDF model for physically-based rendering"; Karis 2013,
"Real Shading in Unreal Engine 4".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.formulas import interface, optics
from translucent.formulas.stored import stored
from translucent.formulas.thin_film import film_slab_reflectance, film_slab_transmittance, thin_film_reflectance

#: Rows (roughness) and columns (cosine) of the table; both ends are in it.
TABLE_SIZE = 64


class Lobes(NamedTuple):
    """Reflection and transmission lobe of interfaces: fractions (..., 3) of the light."""

    reflection: Array
    transmission: Array


def filmed_reflectance(
    bare: npt.ArrayLike, cosine: npt.ArrayLike, ior: npt.ArrayLike, film: npt.ArrayLike, ior_before: npt.ArrayLike
) -> Array:
    """Reflectance (..., 3) of interfaces that reflect `bare` (...) without the films on them.

    Parameters
    ----------
    bare, cosine, ior : array_like (...)
    film : array_like (..., 3)
        Fraction of the interface that has it, its index of refraction, and metres.
    ior_before : array_like (...)
        Index of the side that light comes from.
    """
    film = np.asarray(film, np.float64)
    scalars = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (bare, cosine, ior, ior_before)), film[..., 0])
    fraction, metres = scalars[4], np.broadcast_to(film[..., 2], scalars[0].shape)
    index = np.broadcast_to(film[..., 1], scalars[0].shape)
    found = np.repeat(scalars[0][..., None], 3, axis=-1)
    some = fraction > 0.0
    if some.any():
        _, at, relative, before, _ = (values[some] for values in scalars)
        colored = thin_film_reflectance(at, relative, index[some] / before, index[some] * metres[some])
        found[some] += fraction[some, None] * (colored - found[some])
    return found


@np.errstate(over="ignore", under="ignore")
def thin_wall_exitance(front: npt.ArrayLike, back: npt.ArrayLike, optical_depth: npt.ArrayLike) -> Array:
    """Fraction of a thin wall's emission that leaves through its front, with all reflections inside."""
    front, back = np.asarray(front, np.float64), np.asarray(back, np.float64)[..., None]
    depth = np.asarray(optical_depth, np.float64)
    kept = (1.0 - front) + front * ((1.0 - back) + back * optics.opacity(2.0 * depth))
    return np.asarray((1.0 - front) / np.maximum(kept, 1e-300) * (1.0 + back * optics.transmittance(depth)))


class Interaction(NamedTuple):
    """Interactions of light with interfaces, one a row: their geometry, and the parameters of the bsdf.

    Attributes
    ----------
    direction, normal, face_normal : (k, 3)
        Of the light, for shading, and of the face.
    ior, ior_before : (k,)
        Index of refraction of the other side relative to this one, and of this one.
    film : (k, 3)
        See `filmed_reflectance`.
    coat : (k,)
        Fraction of the interface that has a clear coat on this side.
    base : (k, 3)
        Factor of the transmitted light: what the base lets pass, with its color where light enters.
    thin_walled : (k,) bool
    thickness : (k,)
        Of thin walls, in metres.
    extinction, emission : (k, 3)
        Of thin walls, in 1/m and in radiance per metre.
    """

    direction: Array
    normal: Array
    face_normal: Array
    ior: Array
    ior_before: Array
    film: Array
    coat: Array
    base: Array
    thin_walled: Mask
    thickness: Array
    extinction: Array
    emission: Array

    def where(self, chosen: Integers) -> Interaction:
        """Selection of interactions by indices."""
        return Interaction._make(column[chosen] for column in self)

    def cosine(self, facet: Array) -> Array:
        """(k,): cosine of the light with normals (k, 3) of microfacets, 0 to 1."""
        return np.asarray(np.clip(-np.einsum("ki,ki->k", facet, self.direction), 0.0, 1.0))

    def lobes(self, bare: Array, cosine: Array) -> tuple[Lobes, Array]:
        """Lobes of interfaces without their clear coats and bases, and the radiance (k, 3) that thin walls emit.

        Parameters
        ----------
        bare : (k,)
            Reflectance without films.
        cosine : (k,)
            With the normals of microfacets.
        """
        front = filmed_reflectance(bare, cosine, self.ior, self.film, self.ior_before)
        lobes, emitted = Lobes(front, 1.0 - front), np.zeros(front.shape)
        if not self.thin_walled.any():
            return lobes, emitted
        path = optics.thin_layer_thickness(self.thickness, cosine, self.ior)[:, None]
        with np.errstate(over="ignore", under="ignore"):
            depth = self.extinction * path
            wall = film_slab_reflectance(front, bare, depth), film_slab_transmittance(front, bare, depth)
            if (own := np.flatnonzero(self.thin_walled & self.emission.any(axis=1))).size:
                leaving = thin_wall_exitance(front[own], bare[own], depth[own])
                emitted[own] = leaving * optics.emitted_radiance(self.emission[own], self.extinction[own], path[own])
        thin = self.thin_walled[:, None]
        return Lobes(*(np.where(thin, both, one) for both, one in zip(wall, lobes, strict=True))), emitted

    def coat_reflectance(self) -> Array:
        """(k, 1): fraction of the light that clear coats reflect."""
        return (self.coat * optics.fresnel_dielectric(self.cosine(self.normal), interface.CLEARCOAT_IOR))[:, None]

    def reflected(self, facet: Array) -> Array:
        """(k, 3): directions of light that microfacets with these normals (k, 3) reflect."""
        return kept_on_side(interface.reflected_direction(self.direction, facet), self.face_normal)

    def refracted(self, facet: Array) -> Array:
        """(k, 3): directions of light that microfacets refract; straight on through thin walls."""
        bent = kept_on_side(interface.refracted_direction(self.direction, facet, self.ior), -self.face_normal)
        return np.where(self.thin_walled[:, None], self.direction, bent)


def below_coat(lobes: Lobes, coat: Array) -> Lobes:
    """Lobes below clear coats that reflect a fraction (..., 1) of the light, without the reflection of the coats."""
    return Lobes((1.0 - coat) * lobes.reflection, (1.0 - coat) * lobes.transmission)


def sampled_branches(lobes: Lobes, throughput: Array, share: Array) -> tuple[Mask, Array]:
    """Sample one branch of light at each interface, as likely as the light that it carries.

    Parameters
    ----------
    lobes : Lobes
        (k, 3) each.
    throughput : (k, 3)
        Fraction of the light that has come as far.
    share : (k,)
        Random numbers, 0 to 1.

    Returns
    -------
    transmitted : (k,) bool
    weight : (k, 3)
        Factor of the throughput.
    """
    with np.errstate(under="ignore"):
        back, on = ((throughput * lobe).sum(axis=-1) for lobe in lobes)
        chance = back / np.maximum(back + on, np.finfo(np.float64).tiny)
    transmitted = share >= chance
    likely = np.where(transmitted, 1.0 - chance, np.maximum(chance, 1e-30))
    return transmitted, np.where(transmitted[:, None], lobes.transmission, lobes.reflection) / likely[:, None]


def microfacet_normal(
    normal: npt.ArrayLike, direction: npt.ArrayLike, alpha: npt.ArrayLike, shares: npt.ArrayLike
) -> Array:
    """Random visible normal (..., 3) of a GGX microfacet, from two random numbers `shares` (..., 2), 0 to 1."""
    n, d = np.asarray(normal, np.float64), np.asarray(direction, np.float64)
    axis = np.where(np.abs(n[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    aside = np.cross(n, axis)
    aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
    frame = np.stack([aside, np.cross(n, aside), n], axis=-2)
    local = interface.ggx_visible_normal(-np.einsum("...ij,...j->...i", frame, d), alpha, shares)
    return np.asarray(np.einsum("...ij,...i->...j", frame, local))


def masking_ratio(cos_in: npt.ArrayLike, cos_out: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """Fraction of the light on a microfacet that leaves the surface: G2 / G1 of Smith's masking, heights correlated."""
    into, out = interface.smith_lambda(cos_in, alpha), interface.smith_lambda(cos_out, alpha)
    return np.where(np.asarray(cos_out) > 0.0, (1.0 + into) / (1.0 + into + out), 0.0)


def kept_on_side(direction: npt.ArrayLike, side: npt.ArrayLike) -> Array:
    """Directions (..., 3), reflected to the `side` (..., 3) of a face where smooth normals turn them away from it."""
    d, s = np.asarray(direction, np.float64), np.asarray(side, np.float64)
    across = np.minimum(np.sum(d * s, axis=-1, keepdims=True), 0.0)
    return np.asarray(d - 2.0 * across * s)


def diffuse_radiance(
    front: npt.ArrayLike,
    back: npt.ArrayLike,
    color: npt.ArrayLike,
    passed: npt.ArrayLike,
    passed_share: npt.ArrayLike,
) -> Array:
    """Radiance (..., 3) of a diffuse base, for the irradiance on its front and on its back (..., 3).

    Parameters
    ----------
    front, back, color : array_like (..., 3)
    passed : array_like (..., 3)
        Fraction of the light that passes to the other side, with its color.
    passed_share : array_like (...)
        Without.
    """
    reflected = np.asarray(color) * (1.0 - np.asarray(passed_share, np.float64)[..., None])
    with np.errstate(under="ignore"):
        return np.asarray((reflected * np.asarray(front) + np.asarray(passed) * np.asarray(back)) / np.pi)


def filmed_facing(film: npt.ArrayLike, facing: npt.ArrayLike, cos_view: npt.ArrayLike) -> Array:
    """Reflectance face-on (..., 3) with which Schlick's approximation has the reflectance of a film at an angle.

    Parameters
    ----------
    film : array_like (..., 3)
        See `filmed_reflectance`.
    facing : array_like (..., 3)
        Reflectance face-on without the film.
    cos_view : array_like (...)
    """
    film, facing = np.asarray(film, np.float64), np.asarray(facing, np.float64)
    cosine = np.asarray(cos_view, np.float64)
    root = np.sqrt(np.minimum(facing, 0.9999))
    ior = (1.0 + root) / (1.0 - root)
    path = film[..., 1] * film[..., 2]
    reflected = np.stack(
        [thin_film_reflectance(cosine, ior[..., c], film[..., 1], path)[..., c] for c in range(3)], axis=-1
    )
    with np.errstate(under="ignore"):
        away = np.minimum((1.0 - cosine) ** 5, 0.99)[..., None]
    found = np.clip((reflected - away) / (1.0 - away), 0.0, 1.0)
    return np.asarray(facing + film[..., :1] * (found - facing))


def microfacet_value(
    cos_half: npt.ArrayLike, cos_light: npt.ArrayLike, cos_view: npt.ArrayLike, alpha: npt.ArrayLike
) -> Array:
    """Density of microfacets that reflect one direction into the other, times their visibility.

    A bsdf is this times their reflectance.
    """
    density = interface.ggx_distribution(np.minimum(cos_half, 1.0), alpha)
    return np.asarray(density * interface.ggx_visibility(cos_light, cos_view, alpha))


def brdf_table() -> npt.NDArray[np.float32]:
    """(64, 64, 2) float32: scale and bias at roughness i / 63 in row i and cosine j / 63 in column j; stored."""
    return stored("brdf")
