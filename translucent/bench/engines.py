"""Approximations of multiple scattering in game engines, as counter-examples: their shaders, in NumPy.

Each takes reflections at the interface, and unscattered light, from our own frames: only the scattering differs.
Shadows of the body on itself are exact.

References
----------
Kubelka & Munk 1931, "Ein Beitrag zur Optik der Farbanstriche"; Christensen & Burley 2015, "Approximate reflectance
profiles for efficient subsurface scattering"; Barré-Brisebois & Bouchard 2011, "Approximating translucency for a fast,
cheap and convincing subsurface scattering look".
"""

from __future__ import annotations

import dataclasses
import itertools
import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from scipy.optimize import lsq_linear

from translucent.arrays import Array, Integers
from translucent.errors import InputError, TranslucentWarning
from translucent.formulas.diffuse_interface import diffuse_interface, half_space_reflectance
from translucent.formulas.two_stream import (
    two_stream_absorption,
    two_stream_reflectance,
    two_stream_scattering,
    two_stream_transmittance,
)
from translucent.frames.frame import Frame
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals
from translucent.geometry.ray_caster import RayCaster
from translucent.media.medium import Medium
from translucent.planning.scattering import SingleScattering
from translucent.reference import camera_hits
from translucent.renderer import Renderer
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Light, Scene

#: Rays from each point that find the shadow of the environment, and the thickness of the body below.
RAYS = 48

#: Distance of their starts from the surface, as a fraction of the diagonal.
OFF = 1e-4

#: Largest weight of a term in a fit: an artist would not give more.
MOST = 5.0


@dataclass(frozen=True, eq=False)
class VisiblePoints:
    """Surface of a body in a picture, as shaders of engines get it.

    Attributes
    ----------
    scene : Scene
    medium : Medium
    mesh : Mesh
        In world coordinates.
    base : Frame
        Of the same body if it only absorbed, as much as it scatters and absorbs: its reflections and unscattered light.
    pixels : (k,) int
        Of the picture's, row by row, that show the body.
    points, normals, directions : (k, 3) float64
        In metres; smooth normals; from the eye.
    """

    scene: Scene
    medium: Medium
    mesh: Mesh
    base: Frame
    pixels: Integers
    points: Array
    normals: Array
    directions: Array

    @property
    def thickness(self) -> Array:
        """(k,): along the rays of the picture, in metres."""
        return self.base.thickness.reshape(-1)[self.pixels].astype(np.float64)

    @property
    def reduced_extinction(self) -> Array:
        """(3,): of the similar medium that scatters isotropically, in 1/m."""
        scattering = np.asarray(self.medium.scattering) * (1.0 - self.medium.anisotropy)
        return np.asarray(scattering + np.asarray(self.medium.absorption))

    @property
    def diffuse_color(self) -> Array:
        """(3,): reflectance of a half-space of the medium in diffuse light; exact."""
        albedo = np.asarray(self.medium.scattering) / self.medium.extinction
        return np.array([half_space_reflectance(float(w), self.medium.ior, self.medium.phase_function) for w in albedo])

    @property
    def entering(self) -> float:
        """Transmittance of the interface for diffuse light from outside."""
        return diffuse_interface(self.medium.ior).entering

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh)

    def distance(self, points: Array, directions: Array, sides: Array) -> Array:
        """(k,): distance from points of the surface, on the side of `sides` (k, 3), to where rays hit it again."""
        return self._caster.nearest(points + OFF * self.mesh.diagonal * sides, directions)[1]

    def irradiance(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points of the surface, shadowed by the body; light that it sends to itself left out."""
        directions = cosine_directions(normals).reshape(-1, 3)
        there, sides = np.repeat(points, RAYS, axis=0), np.repeat(normals, RAYS, axis=0)
        free = ~np.isfinite(self.distance(there, directions, sides))
        sky = self.scene.environment.lighting(directions) * free[:, None]
        found = np.pi * sky.reshape(-1, RAYS, 3).mean(axis=1)
        for light in self.scene.lights:
            towards, far = _towards(light, points)
            visible = self.distance(points, towards, normals) > far * (1.0 - 1e-6)
            found = found + light.irradiance_on(points, normals) * (visible | ~np.isfinite(far))[:, None]
        return np.asarray(found)

    def frame(self, light: Array) -> Frame:
        """The base frame with this light (k, 3) added at the surface."""
        radiance = self.base.radiance.copy()
        radiance.reshape(-1, 3)[self.pixels] += light.astype(np.float32)
        return dataclasses.replace(self.base, radiance=radiance)


def visible_points(renderer: Renderer, scene: Scene, size: tuple[int, int]) -> VisiblePoints:
    """Visible points in a picture of a scene of one body.

    Raises
    ------
    InputError
        If there are more bodies, or objects without a medium.
    """
    if len(scene.objects) != 1 or (medium := scene.objects[0].medium) is None:
        raise InputError(
            "comparison with game engines",
            f"the scene has {len(scene.objects)} objects",
            "use a scene with one body in a medium",
        )
    body = scene.objects[0]
    dark = replace(body, medium=Medium(medium.extinction, 0.0, medium.emission, ior=medium.ior))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)
        base = renderer.render(replace(scene, objects=[dark]), size, scattering=SingleScattering())
    mesh = Mesh(body.world_vertices, body.mesh.faces)
    hits = camera_hits(mesh, np.eye(4), scene.camera, size)
    _, nearest = np.unique(hits.pixel, return_index=True)
    first = hits.where(nearest[base.coverage.reshape(-1)[hits.pixel[nearest]]])
    points = np.einsum("kc,kci->ki", first.barycentric, mesh.vertices[mesh.faces[first.face]])
    normals = np.einsum("kc,kci->ki", first.barycentric, corner_normals(mesh)[first.face])
    directions = np.broadcast_to(scene.camera.rays(size)[1], (*size[::-1], 3)).reshape(-1, 3)[first.pixel]
    return VisiblePoints(scene, medium, mesh, base, first.pixel, points, _unit(normals), directions)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _towards(light: Light, points: Array) -> tuple[Array, Array]:
    """Directions (k, 3) from points to a light, and its distances (k,), infinite where it is far away."""
    if isinstance(light, PositionalLight):
        away = np.asarray(light.position) - points
        return _unit(away), np.linalg.norm(away, axis=1)
    return _unit(np.tile(-np.asarray(light.direction), (len(points), 1))), np.full(len(points), np.inf)


def cosine_directions(normals: Array) -> Array:
    """(k, RAYS, 3): cosine-weighted directions around normals (k, 3), rotated by another angle for each."""
    number = np.arange(RAYS)
    height = np.sqrt((number + 0.5) / RAYS)
    across = _unit(np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))))
    along = np.cross(normals, across)
    turn = 2.0 * np.pi * (0.6180339887498949 * number + (0.7548776662466927 * np.arange(len(normals)))[:, None])
    level = np.sqrt(1.0 - height**2)
    flat = (level * np.cos(turn))[..., None] * across[:, None] + (level * np.sin(turn))[..., None] * along[:, None]
    return np.asarray(flat + height[:, None] * normals[:, None])


@dataclass(frozen=True)
class Engine:
    """Approximation of multiple scattering in a game engine."""

    name: ClassVar[str]
    promise: ClassVar[str]

    def light(self, visible: VisiblePoints) -> Array:
        """Radiance (k, 3) that leaves the visible points, on top of reflections and unscattered light."""
        raise NotImplementedError

    def fitted(self, visible: VisiblePoints, truth: Array) -> Self:
        """The settings of least squared error against the truth (h, w, 3); itself where there are none."""
        return self


@dataclass(frozen=True)
class PaintLayer(Engine):
    """Two-stream layer as thick as the body along the ray (Kubelka & Munk 1931), without internal reflections."""

    name: ClassVar[str] = "layer without inner mirrors"
    promise: ClassVar[str] = "none: what its interfaces mirror back inside is left out; computed here in NumPy"

    def light(self, visible: VisiblePoints) -> Array:
        """Radiance of the layer: light enters and leaves by the diffuse transmittance of the interface."""

        def falling(normals: Array) -> Array:  # unshadowed, as layers have it
            lights = sum(light.irradiance_on(visible.points, normals) for light in visible.scene.lights)
            return np.asarray(visible.scene.environment.irradiance_on(normals) + lights)

        medium, depth = visible.medium, visible.thickness[:, None]
        absorbed = two_stream_absorption(medium.absorption) * depth
        turned = two_stream_scattering(medium.scattering, medium.anisotropy) * depth
        with np.errstate(under="ignore"):
            through = two_stream_transmittance(absorbed, turned)
            unscattered = np.minimum(np.exp(-np.minimum(np.asarray(medium.extinction) * depth, 700.0)), through)
            back = two_stream_reflectance(absorbed, turned) * falling(visible.normals)
            return np.asarray(visible.entering * (back + (through - unscattered) * falling(-visible.normals)) / np.pi)


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

    def light(self, visible: VisiblePoints) -> Array:
        """Blurred light of the samples."""
        points, normals, area = self._samples(visible.mesh)
        entered = visible.entering * visible.irradiance(points, normals)
        color = visible.diffuse_color
        rate = (1.9 - color + 3.5 * (color - 0.8) ** 2) * visible.reduced_extinction
        # What is nearer than samples are apart is one of them: R has no end at r = 0.
        nearest = 0.5 * np.sqrt(area / np.pi / self.samples)
        found = np.empty((len(visible.points), 3))
        with np.errstate(under="ignore"):
            for begin in range(0, len(visible.points), 512):
                some = slice(begin, begin + 512)
                away = np.maximum(np.linalg.norm(visible.points[some, None] - points, axis=-1), nearest)
                for channel in range(3):
                    exponent = np.minimum(rate[channel] * away, 700.0)
                    weight = (np.exp(-exponent) + np.exp(-exponent / 3.0)) / away
                    # Beside small mean free paths no sample is near enough: the nearest one counts then.
                    weight += 1e-30 * (away == away.min(axis=1, keepdims=True))
                    found[some, channel] = weight @ entered[:, channel] / weight.sum(axis=1)
        return np.asarray(color * found / np.pi)

    def _samples(self, mesh: Mesh) -> tuple[Array, Array, float]:
        """Evenly spread points on a surface, their face normals, and its area."""
        corners = mesh.vertices[mesh.faces]
        double = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        ends, number = np.cumsum(double), np.arange(self.samples)
        face = np.minimum(np.searchsorted(ends, (number + 0.5) / self.samples * ends[-1]), len(ends) - 1)
        u, v = ((0.5 + number[:, None] * [0.7548776662466927, 0.5698402909980532]) % 1.0).T
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        points = np.einsum("sc,sci->si", np.stack([1.0 - u - v, u, v], axis=1), corners[face])
        return points, mesh.face_normals[face], 0.5 * float(ends[-1])


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

    def light(self, visible: VisiblePoints) -> Array:
        """Sum of its three terms."""
        terms = self._terms(visible, _local_thickness(visible))
        return np.asarray(np.tensordot([self.front, self.scale, self.ambient], terms, 1))

    def fitted(self, visible: VisiblePoints, truth: Array) -> Self:
        """The best of settings on a grid, with the best weights of the terms for each."""
        requested = truth.reshape(-1, 3)[visible.pixels] - visible.base.radiance.reshape(-1, 3)[visible.pixels]
        thickness = _local_thickness(visible)
        lights = bool(visible.scene.lights)
        grid = itertools.product(
            (0.0, 0.5), (0.0, 0.3) if lights else (0.0,), (2.0, 8.0) if lights else (2.0,), (0.3, 1.0, 3.0)
        )
        found: list[tuple[float, Self]] = []
        for wrap, distortion, power, reach in grid:
            one = replace(self, wrap=wrap, distortion=distortion, power=power, reach=reach)
            best = lsq_linear(one._terms(visible, thickness).reshape(3, -1).T, requested.ravel(), (0.0, MOST))
            front, scale, ambient = (round(float(weight), 3) for weight in best.x)
            found.append((float(best.cost), replace(one, front=front, scale=scale, ambient=ambient)))
        return min(found, key=lambda each: each[0])[1]

    @np.errstate(under="ignore")
    def _terms(self, visible: VisiblePoints, thickness: Array) -> Array:
        """(3, k, 3): light in front, from lights behind, and from all around behind, each times the diffuse color."""
        color = visible.entering * visible.diffuse_color / np.pi
        thin = np.exp(-thickness / (self.reach * visible.scene.objects[0].mean_thickness))[:, None]
        front = visible.scene.environment.irradiance_on(visible.normals)
        behind = np.zeros_like(front)
        for light in visible.scene.lights:
            towards, far = _towards(light, visible.points)
            if isinstance(light, PositionalLight):
                strength = light.intensity_along(-towards) / far[:, None] ** 2
            else:
                strength = np.asarray(light.irradiance)
            wrapped = ((visible.normals * towards).sum(axis=1) + self.wrap) / (1.0 + self.wrap) ** 2
            front = front + np.maximum(wrapped, 0.0)[:, None] * strength
            bent = towards + self.distortion * visible.normals
            ahead = np.maximum((visible.directions * bent).sum(axis=1), 0.0)  # V . -(L + N distortion), V to the eye
            behind = behind + (ahead**self.power)[:, None] * strength
        around = visible.scene.environment.irradiance_on(-visible.normals)
        return np.stack([color * front, color * thin * behind, color * thin * around])


def _local_thickness(visible: VisiblePoints) -> Array:
    """(k,): mean distance to the far side below the visible points, by the cosine to the inverted normal, in metres."""
    below = cosine_directions(-visible.normals).reshape(-1, 3)
    inwards = np.repeat(-visible.normals, RAYS, axis=0)
    found = visible.distance(np.repeat(visible.points, RAYS, axis=0), below, inwards)
    return np.asarray(np.where(np.isfinite(found), found, 0.0).reshape(-1, RAYS).mean(axis=1))
