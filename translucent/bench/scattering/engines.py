"""Ways of engines to show light that is scattered many times, as counter-examples: NumPy stands for their shaders.

Each takes the mirror of its interface, and what passes unscattered, from our own frames: it is the scattering that
differs. Shadows of the body on itself are exact.

References
----------
Kubelka & Munk 1931, "Ein Beitrag zur Optik der Farbanstriche"; Christensen & Burley 2015, "Approximate reflectance
profiles for efficient subsurface scattering"; Barré-Brisebois & Bouchard 2011, "Approximating translucency for a fast,
cheap and convincing subsurface scattering look".
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from scipy.optimize import lsq_linear

from translucent.arrays import Array
from translucent.bench.scattering.shot import RAYS, Shot, cosine_directions
from translucent.formulas.two_stream import (
    two_stream_absorption,
    two_stream_reflectance,
    two_stream_scattering,
    two_stream_transmittance,
)
from translucent.scene.lights import PositionalLight

#: Largest weight of a term in a fit: an artist would not give more.
MOST = 5.0


@dataclass(frozen=True)
class Engine:
    """A way in which engines show light that is scattered many times.

    Attributes
    ----------
    name, promise : str
        As of a row.
    """

    name: ClassVar[str]
    promise: ClassVar[str]

    def light(self, shot: Shot) -> Array:
        """Radiance (k, 3) that leaves the visible points, on top of what is mirrored and passes."""
        raise NotImplementedError

    def fitted(self, shot: Shot, truth: Array) -> Self:
        """The settings of least squared error against the truth (h, w, 3); itself where there are none."""
        return self


@dataclass(frozen=True)
class PaintLayer(Engine):
    """Layer of paint as thick as the body along the ray (Kubelka & Munk 1931), without mirrors at its interfaces."""

    name: ClassVar[str] = "layer without inner mirrors"
    promise: ClassVar[str] = "none: what its interfaces mirror back inside is left out; computed here in NumPy"

    def light(self, shot: Shot) -> Array:
        """Light of the layer, as it leaves where the interface lets light in."""
        depth = shot.thickness[:, None]
        absorbed = two_stream_absorption(shot.medium.absorption) * depth
        turned = two_stream_scattering(shot.medium.scattering, shot.medium.anisotropy) * depth
        with np.errstate(under="ignore"):
            through = two_stream_transmittance(absorbed, turned)
            seen = np.minimum(np.exp(-np.minimum(np.asarray(shot.medium.extinction) * depth, 700.0)), through)
            back = two_stream_reflectance(absorbed, turned) * _falling(shot, shot.normals)
            return np.asarray(shot.entering * (back + (through - seen) * _falling(shot, -shot.normals)) / np.pi)


def _falling(shot: Shot, normals: Array) -> Array:
    """Irradiance (k, 3) on the visible points from a side, unshadowed as layers have it."""
    found = shot.scene.environment.irradiance_on(normals)
    for light in shot.scene.lights:
        found = found + light.irradiance_on(shot.points, normals)
    return np.asarray(found)


@dataclass(frozen=True)
class NormalizedDiffusion(Engine):
    """Burley's normalized diffusion: a profile of two exponentials, fitted to Monte Carlo simulation of flat bodies.

    R(r) = A s / (8 pi l r) (exp(-s r / l) + exp(-s r / (3 l))), with the mean free path l = 1 / sigma_t', the diffuse
    color A of a half-space, and for light that enters diffusely s = 1.9 - A + 3.5 (A - 0.8)^2 (equation 6 there). It
    blurs the light that enters over samples of the whole surface, by distances straight through the body; weights are
    normalized, as screen-space implementations do.

    Parameters
    ----------
    samples : int
        On the surface.
    """

    name: ClassVar[str] = "Burley's normalized diffusion"
    promise: ClassVar[str] = "none: exact for flat bodies as wide and thick as it takes; computed here in NumPy"

    samples: int = 3000

    def light(self, shot: Shot) -> Array:
        """Blurred light of the samples."""
        points, normals = shot.surface.samples(self.samples)
        entered = shot.entering * shot.irradiance(points, normals)
        color, extinction = shot.diffuse_color, shot.reduced[0]
        rate = (1.9 - color + 3.5 * (color - 0.8) ** 2) * extinction
        # What is nearer than samples are apart is one of them: R has no end at r = 0.
        area = (
            0.5
            * np.linalg.norm(
                np.cross(*np.moveaxis(np.diff(shot.surface.mesh.vertices[shot.surface.mesh.faces], axis=1), 1, 0)),
                axis=1,
            ).sum()
        )
        nearest = 0.5 * np.sqrt(area / np.pi / self.samples)
        found = np.empty((len(shot.points), 3))
        with np.errstate(under="ignore"):
            for begin in range(0, len(shot.points), 512):
                some = slice(begin, begin + 512)
                away = np.maximum(np.linalg.norm(shot.points[some, None] - points, axis=-1), nearest)
                for channel in range(3):
                    way = np.minimum(rate[channel] * away, 700.0)
                    weight = (np.exp(-way) + np.exp(-way / 3.0)) / away
                    # Beside small mean free paths no sample is near enough: the nearest one counts then.
                    weight += 1e-30 * (away == away.min(axis=1, keepdims=True))
                    found[some, channel] = weight @ entered[:, channel] / weight.sum(axis=1)
        return np.asarray(color * found / np.pi)


@dataclass(frozen=True)
class Frostbite(Engine):
    """Translucency of Frostbite: wrapped light in front, and light from behind by a baked local thickness.

    Light (pow(max(V . -(L + N distortion), 0), power) scale + ambient) exp(-thickness / reach), with the local
    thickness as ambient occlusion of inverted normals finds it: the mean distance to the far side below a point. Its
    settings are fitted to the truth of each scene, of all channels together, which nobody has beforehand.

    Parameters
    ----------
    wrap, distortion : float
    power : float
    reach : float
        Times the mean thickness of the body.
    front, scale, ambient : float
    """

    name: ClassVar[str] = "Frostbite's translucency"
    promise: ClassVar[str] = "none: its settings are the best ones for this picture; computed here in NumPy"

    wrap: float = 0.5
    distortion: float = 0.2
    power: float = 4.0
    reach: float = 0.3
    front: float = 1.0
    scale: float = 1.0
    ambient: float = 0.2

    def light(self, shot: Shot) -> Array:
        """Sum of its three terms."""
        terms = self._terms(shot, _local_thickness(shot))
        return np.asarray(np.tensordot([self.front, self.scale, self.ambient], terms, 1))

    def fitted(self, shot: Shot, truth: Array) -> Self:
        """The best of settings on a grid, with the best weights of the terms for each."""
        wanted = truth.reshape(-1, 3)[shot.pixels] - shot.base.radiance.reshape(-1, 3)[shot.pixels]
        thickness = _local_thickness(shot)
        lamps = bool(shot.scene.lights)
        grid = itertools.product(
            (0.0, 0.5), (0.0, 0.3) if lamps else (0.0,), (2.0, 8.0) if lamps else (2.0,), (0.3, 1.0, 3.0)
        )
        found: list[tuple[float, Self]] = []
        for wrap, distortion, power, reach in grid:
            one = replace(self, wrap=wrap, distortion=distortion, power=power, reach=reach)
            terms = one._terms(shot, thickness)
            best = lsq_linear(terms.reshape(3, -1).T, wanted.ravel(), (0.0, MOST))
            front, scale, ambient = (round(float(weight), 3) for weight in best.x)
            found.append((float(best.cost), replace(one, front=front, scale=scale, ambient=ambient)))
        return min(found, key=lambda each: each[0])[1]

    @np.errstate(under="ignore")
    def _terms(self, shot: Shot, thickness: Array) -> Array:
        """(3, k, 3): light in front, from lamps behind, and from all around behind, each times the diffuse color."""
        color = shot.entering * shot.diffuse_color / np.pi
        thin = np.exp(-thickness / (self.reach * shot.scene.objects[0].mean_thickness))[:, None]
        front = shot.scene.environment.irradiance_on(shot.normals)
        behind = np.zeros_like(front)
        for light in shot.scene.lights:
            if isinstance(light, PositionalLight):
                away = np.asarray(light.position) - shot.points
                distance = np.linalg.norm(away, axis=1, keepdims=True)
                strength = light.intensity_along(-away / distance) / distance**2
            else:
                away, strength = -np.asarray(light.direction)[None], np.asarray(light.irradiance)
            towards = away / np.linalg.norm(away, axis=1, keepdims=True)
            wrapped = ((shot.normals * towards).sum(axis=1) + self.wrap) / (1.0 + self.wrap) ** 2
            front = front + np.maximum(wrapped, 0.0)[:, None] * strength
            bent = towards + self.distortion * shot.normals
            seen = np.maximum((shot.directions * bent).sum(axis=1), 0.0)  # V . -(L + N distortion), V towards the eye
            behind = behind + (seen**self.power)[:, None] * strength
        around = shot.scene.environment.irradiance_on(-shot.normals)
        return np.stack([color * front, color * thin * behind, color * thin * around])


def _local_thickness(shot: Shot) -> Array:
    """(k,): mean distance to the far side below the visible points, by the cosine to the inverted normal, in metres."""
    below = cosine_directions(-shot.normals).reshape(-1, 3)
    inwards = np.repeat(-shot.normals, RAYS, axis=0)
    found = shot.surface.distance(np.repeat(shot.points, RAYS, axis=0), below, inwards)
    return np.asarray(np.where(np.isfinite(found), found, 0.0).reshape(-1, RAYS).mean(axis=1))
