"""Check of a thickness map: a body shaded with the map, as in a glTF viewer, and with its true thickness.

A rasterizing viewer looks the thickness up where the view ray meets the front of the surface, and takes it for the way
of the light: t = map(uv of the first hit), whatever the direction of the view, and nothing for the bodies behind. The
truth is the path inside along the ray. Both pass light by exp(-sigma_t t), straight on.

Source of the lookup: KHR_materials_volume, "Thickness Texture"; as in rasterizers without refraction, since here too
light goes straight.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bake.gltf.maps import wrapping
from translucent.cpu.renderer import CpuRenderer
from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, compare
from translucent.geometry.embree import EmbreeMesh
from translucent.geometry.mesh import Mesh
from translucent.gltf.textures import sample
from translucent.media.medium import Medium
from translucent.planning.plan import plan
from translucent.scene.camera import Camera
from translucent.scene.showcase import showcase

#: Distance within which surfaces coincide, as a share of the diagonal.
SAME_POINT = 1e-4


class NotSeenError(InputError):
    """Error for a map whose surface no pixel shows."""


@dataclass(frozen=True, eq=False)
class MapCheck:
    """Check of a map: a body shaded with it and with the true thickness, from one view.

    Attributes
    ----------
    baked, true : Frame
    thickness, transmittance : Errors
        Of `baked` against `true`: metres, and 0..1 over the three channels.
    mean_thickness : float
        True one, over the same pixels, in metres.
    background : (h, w, 3)
        Radiance without the body.
    empty : float
        Share of these pixels at which the map has no value.
    """

    baked: Frame
    true: Frame
    thickness: Errors
    transmittance: Errors
    mean_thickness: float
    background: Array
    empty: float = 0.0

    def summary(self) -> dict[str, Any]:
        """Errors as values that JSON can hold."""
        return {
            "thickness": dataclasses.asdict(self.thickness),
            "transmittance": dataclasses.asdict(self.transmittance),
            "mean_thickness": self.mean_thickness,
            "empty": self.empty,
        }

    def __str__(self) -> str:
        share = 100.0 / self.mean_thickness
        found, passed = self.thickness, self.transmittance
        bare = f"\n{self.empty:.1%} of what is seen has no value in the map" if self.empty else ""
        return (
            f"thickness      rms {found.rms:.4g} m, {share * found.rms:.3g} % of the mean {self.mean_thickness:.4g} m; "
            f"median {found.median:.4g} m, p99 {found.p99:.4g} m, bias {found.bias:+.4g} m\n"
            f"transmittance  rms {passed.rms:.4g}, median {passed.median:.4g}, p99 {passed.p99:.4g}, "
            f"bias {passed.bias:+.4g}{bare}"
        )


def check_map(
    mesh: Mesh,
    values: npt.ArrayLike,
    medium: Medium | None = None,
    size: tuple[int, int] = (480, 480),
    camera: Camera | None = None,
    body: Mesh | None = None,
) -> MapCheck:
    """Compare shading with a thickness map to the truth.

    Parameters
    ----------
    mesh : Mesh
        With the uv that the map belongs to.
    values : array_like (h, w)
        Thickness in metres; row 0 is v = 1. Read bilinearly; beyond 0..1 it repeats.
    medium : Medium, optional
        Default: that of `showcase`.
    size : (width, height)
        Of the picture in pixels.
    camera : Camera, optional
        Default: from the front right and above, the whole mesh in view.
    body : Mesh, optional
        The closed body that the mesh is a part of; pixels that show other parts of it do not count.

    Raises
    ------
    InputError
        If the mesh has no uv, or no pixel shows both; `NotSeenError` if the rest of the body hides the mesh.
    RenderError
        If embreex is missing.
    """
    scene = showcase(body or mesh, medium, size, camera, stage="none")
    renderer = CpuRenderer()
    true = renderer.render(scene, size, plan(scene, None, renderer.capabilities), 1)
    renderer.close()
    directions = scene.camera.rays(size)[1]
    background = scene.environment.radiance(directions, _backdrop(size))
    inside = scene.bodies[0].medium
    assert inside is not None  # a showcase has one
    seen = true.coverage & true.valid
    found = first_uv(mesh, scene.camera, size, body)
    covered = seen & np.isfinite(found).all(axis=-1)
    if body is not None and not covered.any():
        raise NotSeenError(f"check of {mesh.name!r}", "other parts of its body hide it", "give another camera")
    thickness = np.zeros(covered.shape)
    thickness[covered] = look_up(mesh, values, found[covered])
    with np.errstate(under="ignore"):
        depth = thickness[..., None] * inside.extinction
        passed = np.exp(-depth)
    baked = dataclasses.replace(
        true,
        thickness=thickness,
        optical_depth=depth,
        transmittance=passed,
        radiance=background * passed,
        coverage=covered,
    )
    errors = [compare(baked, true, quantity) for quantity in ("thickness", "transmittance")]
    mean = float(true.thickness[covered].mean(dtype=np.float64))
    empty = float(np.mean(thickness[covered] == 0))
    return MapCheck(baked, true, errors[0], errors[1], mean, background, empty)


def look_up(mesh: Mesh, values: npt.ArrayLike, uv: Array) -> Array:
    """(n,): a map at uv (n, 2), v upwards, as textures are read: between texels linearly."""
    coordinates = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
    return sample(np.asarray(values, dtype=np.float64), coordinates, wrapping(mesh))


def first_uv(mesh: Mesh, camera: Camera, size: tuple[int, int], body: Mesh | None = None) -> Array:
    """(h, w, 2): uv where the ray of each pixel first meets the mesh, v upwards; NaN where it does not.

    Nor where other parts of the body are in front of it.

    Raises
    ------
    InputError
        If the mesh has no uv.
    """
    if mesh.uv is None:
        raise InputError(f"mesh {mesh.name!r}", "it has no uv", "bake a map first; its mesh has them")
    face, distance = first_hits(mesh, camera, size)
    hit = face >= 0
    if body is not None:
        with np.errstate(invalid="ignore"):
            hit &= distance <= first_hits(body, camera, size)[1] + SAME_POINT * body.diagonal
    origins, directions = (part.reshape(-1, 3)[hit] for part in camera.rays(size))
    corners = mesh.faces[face[hit]]
    weights = barycentric(mesh.vertices[corners], origins + distance[hit, None] * directions)
    found = np.full((len(hit), 2), np.nan)
    found[hit] = np.einsum("kc,kci->ki", weights, mesh.uv[corners])
    return found.reshape(size[1], size[0], 2)


def first_hits(mesh: Mesh, camera: Camera, size: tuple[int, int]) -> tuple[npt.NDArray[np.int64], Array]:
    """(k,), (k,): the face that the ray of each pixel first meets, and the way to it in metres; -1 and inf for none."""
    traced = EmbreeMesh(mesh)
    origins, directions = (part.reshape(-1, 3) for part in camera.rays(size))
    starts = (origins - traced.center) / traced.radius
    # A far eye costs float32 its digits; begin where the ray comes near.
    ahead = np.maximum(-np.einsum("ki,ki->k", starts, directions) - 1.01, 0.0)
    face, distance = traced.first_hits(starts + ahead[:, None] * directions, directions)
    return face, np.where(face >= 0, traced.radius * (ahead + distance), np.inf)


def barycentric(corners: Array, points: Array) -> Array:
    """(k, 3): weights of the corners (k, 3, 3) at points (k, 3) of their triangles, each in 0..1."""
    a, b, c = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (np.einsum("ki,ki->k", x, y) for x, y in ((a, a), (a, b), (b, b)))
    ca, cb = (np.einsum("ki,ki->k", c, x) for x in (a, b))
    area = aa * bb - ab * ab
    area[area <= 0] = np.inf  # Embree hits no triangle without area; the first corner would do
    second, third = (bb * ca - ab * cb) / area, (aa * cb - ab * ca) / area
    weights = np.clip(np.column_stack([1.0 - second - third, second, third]), 0.0, 1.0)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _backdrop(size: tuple[int, int]) -> Array:
    """(h, w, 2): positions of pixel centers in the picture, in units of its height."""
    across, down = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return np.stack([across, down], axis=-1) / size[1]
