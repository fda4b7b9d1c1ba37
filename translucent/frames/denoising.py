"""Denoising of pictures by Open Image Denoise, with features seen through clear glass.

A denoiser blurs across what it takes for noise and keeps edges of its features: the albedo and the normal at each
pixel. Renderers commonly give those of the first surface, which for glass say nothing of what is behind it. Here rays
go on through smooth interfaces of clear media, up to the first surface that scatters light in many directions.

Of light that media scatter, random paths have much noise, and no feature shows it. There another picture helps, by
diffusion, without noise: paths are divided by it, and the denoised quotient multiplied by it again. Such demodulation
is common for the albedo of surfaces (Bako et al. 2017).
"""

from __future__ import annotations

import dataclasses
import time
from importlib.metadata import version

import numpy as np

from translucent.arrays import Array, Floats, Integers
from translucent.extras import require_package
from translucent.formulas.sampling import sample_shifts
from translucent.frames.frame import Frame
from translucent.geometry.ray_caster import SceneRayCaster, dot
from translucent.scene.scene import Object, Scene

#: Rays through each pixel for its features, and the interfaces that they pass.
FEATURE_SAMPLES, MOST_INTERFACES = 8, 8

#: Roughness up to which an interface shows what is behind it, and not a blur of that.
CLEAR = 0.05

#: Radiance below which a guide does not divide, as a fraction of its mean.
DARKEST_GUIDE = 1e-3

#: Albedo of bodies that scatter light, and of rough interfaces: what they show has no color of its own.
SCATTERED_ALBEDO = 0.8


def denoised(frame: Frame, scene: Scene, guide: Floats | None = None) -> Frame:
    """Frame with denoised radiance, and without a standard error, which is unknown for denoised pictures.

    Parameters
    ----------
    frame : Frame
    scene : Scene
    guide : (h, w, 3) float32, optional
        See `denoised_radiance`.

    Raises
    ------
    RenderError
        If pyoidn is not installed.
    """
    oidn = require_package("pyoidn", "denoise", "render with more samples")
    began = time.perf_counter()
    made = denoised_radiance(frame.radiance, scene, guide)
    library, binding = oidn.version.oidn_version, version("pyoidn")
    provenance = {**frame.provenance, "denoiser": f"Open Image Denoise {library} (pyoidn {binding})"}
    seconds = {**frame.seconds, "denoise": time.perf_counter() - began}
    return dataclasses.replace(
        frame, radiance=made, standard_error=None, provenance=provenance, seconds=seconds, scene=frame.scene
    )


def denoised_radiance(radiance: Floats, scene: Scene, guide: Floats | None = None) -> Floats:
    """Radiance (h, w, 3) of a scene without its noise.

    Parameters
    ----------
    radiance : (h, w, 3) float32
    scene : Scene
    guide : (h, w, 3) float32, optional
        Radiance of the scene by another method that has hardly any noise. What the other method has wrong over many
        pixels does not stay in the picture.

    Raises
    ------
    RenderError
        If pyoidn is not installed.
    """
    oidn = require_package("pyoidn", "denoise", "render with more samples")
    albedo, normals = features(scene, (radiance.shape[1], radiance.shape[0]))
    radiance = np.ascontiguousarray(np.maximum(radiance, 0.0), dtype=np.float32)
    if guide is None:
        made = oidn.denoise(radiance, albedo, normals, hdr=True)
    else:
        floor = max(DARKEST_GUIDE * float(guide.mean()), float(np.finfo(np.float32).tiny))
        divisor = np.maximum(guide, floor).astype(np.float32)
        made = divisor * oidn.denoise(radiance / divisor, albedo, normals, hdr=True, clean_aux=True)
    return np.where(np.isfinite(made).all(axis=-1, keepdims=True), made, radiance)


def features(scene: Scene, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Albedo and normals (h, w, 3) of the surfaces seen through clear glass, averaged over the rays of each pixel."""
    caster = SceneRayCaster(scene.objects)
    found = np.zeros((2, size[0] * size[1], 3))
    for right, down in sample_shifts(FEATURE_SAMPLES):
        origins, directions = (part.reshape(-1, 3) for part in scene.camera.rays(size, (float(right), float(down))))
        rays = _Rays(scene, caster, (origins - caster.center) / caster.radius, directions.copy())
        found += np.stack(rays.followed()) / FEATURE_SAMPLES
    albedo, normals = found.reshape(2, size[1], size[0], 3).astype(np.float32)
    return np.ascontiguousarray(np.clip(albedo, 0.0, 1.0)), np.ascontiguousarray(np.clip(normals, -1.0, 1.0))


class _Rays:
    """Camera rays on their way through clear glass; lengths in radii of the caster.

    Parameters
    ----------
    scene : Scene
    caster : SceneRayCaster
        Of its objects.
    origins, directions : (n, 3) float64
    """

    def __init__(self, scene: Scene, caster: SceneRayCaster, origins: Array, directions: Array) -> None:
        self.scene, self.caster, self.origins, self.directions = scene, caster, origins, directions
        count = len(origins)
        self.last = np.full((count, caster.groups), -1)
        self.throughput = np.ones((count, 3))
        self.albedo, self.normals = np.zeros((count, 3)), np.zeros((count, 3))
        self.clear = np.array([_is_clear(item) for item in scene.objects])
        media = [item.medium for item in scene.objects]
        self.ior = np.array([1.0 if medium is None else medium.ior for medium in media])
        self.extinction = np.array([np.zeros(3) if medium is None else medium.extinction for medium in media])

    def followed(self) -> tuple[Array, Array]:
        """Albedo and normal (n, 3) where each ray ends."""
        live = np.arange(len(self.origins))
        for _ in range(MOST_INTERFACES):
            live = self._advanced(live)
            if not live.size:
                break
        self.albedo[live] = self.throughput[live]
        return self.albedo, self.normals

    def _advanced(self, live: Integers) -> Integers:
        """Rays (k,) that go on, of these, after the next surface."""
        faces, distances = self.caster.nearest(self.origins[live], self.directions[live], self.last[live])
        group = distances.argmin(axis=1)
        face, distance = faces[np.arange(len(live)), group], distances[np.arange(len(live)), group]
        missed = face < 0
        self._escape(live[missed])
        live, face, distance, group = live[~missed], face[~missed], distance[~missed], group[~missed]
        directions, item = self.directions[live], self.caster.faces.item[face]
        points = self.origins[live] + distance[:, None] * directions
        normals, _ = self.caster.facing_normals(face, points, directions)
        inside = dot(self.caster.faces.outward[face], directions) > 0
        with np.errstate(under="ignore", over="ignore"):
            path = distance * self.caster.radius * inside
            self.throughput[live] *= np.exp(-self.extinction[item] * path[:, None])
        unset = ~self.normals[live].any(axis=1)
        ends = ~self.clear[item]
        self._end(live[ends], face[ends], points[ends], normals[ends])
        self.normals[live[unset & ~ends]] = normals[unset & ~ends]
        ratio = np.where(inside, self.ior[item], 1.0 / self.ior[item])
        live, goes = live[~ends], ~ends
        self.directions[live] = _refracted(directions[goes], normals[goes], ratio[goes])
        self.origins[live] = points[goes]
        self.last[live, group[goes]] = face[goes]
        return live

    def _escape(self, live: Integers) -> None:
        """End rays in the environment, whose radiance is its albedo up to 1."""
        radiance = self.scene.environment.seen.lighting(self.directions[live])
        self.albedo[live] = self.throughput[live] * np.minimum(radiance, 1.0)

    def _end(self, live: Integers, face: Integers, points: Array, normals: Array) -> None:
        """End rays at surfaces that are opaque, rough, or around a medium that scatters."""
        self.normals[live] = normals
        own = np.full((len(live), 3), SCATTERED_ALBEDO)
        item, weights = self.caster.faces.item[face], self.caster.barycentric(face, points)
        for number in np.unique(item):
            body = self.scene.objects[number]
            if body.medium is None:
                here = item == number
                own[here] = _base_colors(body, self.caster.faces.number[face[here]], weights[here])
        self.albedo[live] = self.throughput[live] * own


def _base_colors(body: Object, face: Integers, weights: Array) -> Array:
    """(k, 3): base color on faces (k,) of an opaque object, at barycentric coordinates (k, 3)."""
    colors, corners = np.tile(body.base_color, (len(face), 1)), body.mesh.faces[face]
    texture = None if body.surface is None else body.surface.color_texture
    if texture is not None and body.mesh.uv is not None:
        colors *= texture.sample(np.einsum("kc,kcn->kn", weights, body.mesh.uv[corners]))[:, :3]
    if body.mesh.colors is not None:
        colors *= np.einsum("kc,kcn->kn", weights, body.mesh.colors[corners])[:, :3]
    return colors


def _is_clear(item: Object) -> bool:
    """True if a body is clear enough to see through."""
    if item.medium is None or item.covers:
        return False
    rough = item.surface is not None and (item.surface.roughness > CLEAR or item.surface.transmission < 1)
    return not rough and not item.medium.scatters


def _refracted(directions: Array, normals: Array, ratio: Array) -> Array:
    """(k, 3): directions behind interfaces, or after total internal reflection; `ratio` (k,) of the indices."""
    cosine = -dot(directions, normals)
    squared = 1.0 - ratio**2 * (1.0 - cosine**2)
    through = ratio[:, None] * directions + (ratio * cosine - np.sqrt(np.maximum(squared, 0.0)))[:, None] * normals
    back = directions + 2.0 * cosine[:, None] * normals
    turned = np.where((squared > 0)[:, None], through, back)
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))
