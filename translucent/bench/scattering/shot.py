"""Properties of the surface of a body in a picture, as shaders of engines get it: points, normals, falling light."""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.errors import InputError, TranslucentWarning
from translucent.formulas.diffuse_interface import diffuse_interface, half_space_reflectance
from translucent.frames.frame import Frame
from translucent.geometry.embree import EmbreeMesh
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals
from translucent.media.medium import Medium
from translucent.planning.scattering import SingleScattering
from translucent.reference import pixel_rays
from translucent.renderer import Renderer
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Object, Scene

#: Rays from each point that find what shadows the environment, and how thick the body is below.
RAYS = 48

#: Distance of their starts from the surface, as a share of the diagonal.
OFF = 1e-4


@dataclass(frozen=True, eq=False)
class Shot:
    """Visible points of a body.

    Attributes
    ----------
    scene : Scene
    medium : Medium
    base : Frame
        Of the same body if it only absorbed, as much as it scatters and absorbs: what is mirrored, and what passes
        unscattered.
    pixels : (k,) int
        Of the picture's, row by row, that see the body.
    points, normals : (k, 3) float64
        In metres; smooth normals.
    directions : (k, 3) float64
        From the eye.
    surface : Casting
    """

    scene: Scene
    medium: Medium
    base: Frame
    pixels: Integers
    points: Array
    normals: Array
    directions: Array
    surface: Casting

    @property
    def thickness(self) -> Array:
        """(k,): along the rays of the picture, in metres."""
        return self.base.thickness.reshape(-1)[self.pixels].astype(np.float64)

    @property
    def reduced(self) -> tuple[Array, Array]:
        """Reduced extinction (3,) in 1/m, and albedo (3,), of a medium that scatters isotropically and is alike."""
        scattering = np.asarray(self.medium.scattering) * (1.0 - self.medium.anisotropy)
        extinction = scattering + np.asarray(self.medium.absorption)
        return extinction, scattering / extinction

    @property
    def diffuse_color(self) -> Array:
        """(3,): of diffuse light that enters a half-space of the medium, the share that it gives back; exact."""
        albedo = np.asarray(self.medium.scattering) / self.medium.extinction
        return np.array([half_space_reflectance(float(w), self.medium.ior, self.medium.phase_function) for w in albedo])

    @property
    def entering(self) -> float:
        """Share of diffuse light that the interface lets in."""
        return diffuse_interface(self.medium.ior).entering

    def irradiance(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points of the surface, shadowed by the body; light that it sends to itself left out."""
        directions = cosine_directions(normals)
        there = np.repeat(points, RAYS, axis=0)
        free = ~np.isfinite(self.surface.distance(there, directions.reshape(-1, 3), np.repeat(normals, RAYS, axis=0)))
        sky = self.scene.environment.lighting(directions.reshape(-1, 3)) * free[:, None]
        found = np.pi * sky.reshape(-1, RAYS, 3).mean(axis=1)
        for light in self.scene.lights:
            away = (
                np.asarray(light.position) - points
                if isinstance(light, PositionalLight)
                else -np.asarray(light.direction)
            )
            away = np.broadcast_to(away, points.shape)
            far = np.linalg.norm(away, axis=1) if isinstance(light, PositionalLight) else np.full(len(points), np.inf)
            towards = away / np.linalg.norm(away, axis=1, keepdims=True)
            seen = self.surface.distance(points, towards, normals) > far * (1.0 - 1e-6)
            found = found + light.irradiance_on(points, normals) * (seen | ~np.isfinite(far))[:, None]
        return np.asarray(found)

    def frame(self, light: Array) -> Frame:
        """The base with this light (k, 3) that leaves the surface."""
        radiance = self.base.radiance.copy()
        radiance.reshape(-1, 3)[self.pixels] += light.astype(np.float32)
        return dataclasses.replace(self.base, radiance=radiance)


class Casting:
    """The surface of a body in world coordinates, ready for rays."""

    def __init__(self, body: Object) -> None:
        vertices = body.mesh.vertices @ body.matrix[:3, :3].T + body.matrix[:3, 3]
        self.mesh = Mesh(vertices, body.mesh.faces)
        self._embree = EmbreeMesh(self.mesh)

    def first(self, origins: Array, directions: Array) -> tuple[Integers, Array]:
        """Faces (k,) that rays meet first, -1 for none, and their distances in metres."""
        face, distance = self._embree.first_hits((origins - self.mesh.center) / self._embree.radius, directions)
        return face, np.where(face >= 0, distance * self._embree.radius, np.inf)

    def distance(self, points: Array, directions: Array, sides: Array) -> Array:
        """(k,): distance from points of the surface, on the side of `sides` (k, 3), to where rays meet it again."""
        return self.first(points + OFF * self.mesh.diagonal * sides, directions)[1]

    def samples(self, count: int) -> tuple[Array, Array]:
        """Even points (count, 3) on the surface, and their face normals; each stands for as large an area."""
        corners = self.mesh.vertices[self.mesh.faces]
        double = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        ends = np.cumsum(double)
        number = np.arange(count)
        face = np.minimum(np.searchsorted(ends, (number + 0.5) / count * ends[-1]), len(ends) - 1)
        u, v = ((0.5 + number[:, None] * [0.7548776662466927, 0.5698402909980532]) % 1.0).T
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        points = np.einsum("sc,sci->si", np.stack([1.0 - u - v, u, v], axis=1), corners[face])
        return points, self.mesh.face_normals[face]


def shot_of(renderer: Renderer, scene: Scene, size: tuple[int, int]) -> Shot:
    """Surface properties in a picture of a scene of one body.

    Raises
    ------
    InputError
        If there are more bodies, or objects without a medium.
    """
    if len(scene.objects) != 1 or (medium := scene.objects[0].medium) is None:
        raise InputError("what engines show", f"{len(scene.objects)} objects", "give a scene of one body")
    body = scene.objects[0]
    dark = dataclasses.replace(body, medium=Medium(medium.extinction, 0.0, medium.emission, ior=medium.ior))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)
        base = renderer.render(dataclasses.replace(scene, objects=[dark]), size, scattering=SingleScattering())
    surface = Casting(body)
    rays = pixel_rays(scene.camera, size)
    eye = scene.camera.pose[:3, 3]
    face, distance = surface.first(rays.origins + eye, rays.directions)
    pixels = np.flatnonzero((face >= 0) & base.coverage.reshape(-1))
    directions = rays.directions[pixels]
    points = rays.origins[pixels] + eye + distance[pixels, None] * directions
    return Shot(scene, medium, base, pixels, points, _normals(surface.mesh, face[pixels], points), directions, surface)


def cosine_directions(normals: Array) -> Array:
    """(k, RAYS, 3): directions about normals (k, 3), by the cosine; turned for each point."""
    number = np.arange(RAYS)
    height = np.sqrt((number + 0.5) / RAYS)
    aside = np.where(np.abs(normals[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(normals, aside)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normals, across)
    turn = 2.0 * np.pi * (0.6180339887498949 * number + (0.7548776662466927 * np.arange(len(normals)))[:, None])
    level = np.sqrt(1.0 - height**2)
    flat = (level * np.cos(turn))[..., None] * across[:, None] + (level * np.sin(turn))[..., None] * along[:, None]
    return np.asarray(flat + height[:, None] * normals[:, None])


def _normals(mesh: Mesh, face: Integers, points: Array) -> Array:
    """Smooth normals (k, 3) at points of faces."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[face]], 1, 0)
    area = np.einsum("ki,ki->k", np.cross(b - a, c - a), mesh.face_normals[face])
    weights = [
        np.einsum("ki,ki->k", np.cross(p - points, q - points), mesh.face_normals[face]) for p, q in ((b, c), (c, a))
    ]
    shares = np.stack([*weights, area - weights[0] - weights[1]], axis=1) / area[:, None]
    corners: npt.NDArray[np.float64] = corner_normals(mesh).reshape(-1, 3, 3)[face]
    found = np.einsum("kc,kci->ki", shares, corners)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))
