"""Check of baked scattered light: a body shaded with it, and with the light that diffuses in it in pictures.

Both show what is given back of scattered light alone, where each view ray first meets the surface; mirror reflection
and light that passes unscattered are not part of a bake. nRMSE is the root of the mean square of the difference, over
the mean of the diffused light.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.bake.check import barycentric, first_hits, look_up
from translucent.bake.gltf.bodies import PrimitiveKey
from translucent.bake.scatter.files import MAP_SUFFIX, positions_of, read_scatter_exr, read_scatter_glb
from translucent.bake.scatter.job import Baked
from translucent.bake.scatter.result import ScatterMap
from translucent.bake.surface import blend
from translucent.diffusion.harmonics import LitAlone, exit_radiance
from translucent.formulas import optics
from translucent.formulas.spherical_harmonics import COUNT, exit_lobe, scattered_radiance
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals
from translucent.gltf.file import read_gltf
from translucent.scene.environment import Environment
from translucent.scene.scene import Object
from translucent.scene.showcase import showcase
from translucent.scene.surface import Surface

#: Largest distance from a body's surface at which what is behind it still counts as that surface, over its diagonal.
_SAME_POINT = 1e-4


@dataclass(frozen=True, eq=False)
class ScatterLook:
    """A body in one environment.

    Attributes
    ----------
    baked, true : (h, w, 3) float64
        Radiance towards the eye; 0 where the body is not seen.
    seen : (h, w) bool
    mean_error : float
        nRMSE of the mean radiance, flux over pi: of what is baked.
    error : float
        nRMSE of the radiance towards the eye, `exit_lobe` against the angles of diffused light.
    """

    baked: Array
    true: Array
    seen: Mask
    mean_error: float
    error: float


#: By environment.
ScatterCheck = dict[str, ScatterLook]


def environments() -> dict[str, Environment]:
    """Environments of a check by name: of the first band, of the first two, and of all."""
    return {
        "uniform": Environment.constant((1, 1, 1)),
        "from-above": Environment.gradient((0, 0, 0), (1, 1, 1)),
        "studio": Environment.studio(),
    }


def check_scatter_output(path: Path, results: dict[PrimitiveKey, Baked]) -> dict[str, ScatterCheck]:
    """Checks of all bodies of a file, read back; by the names of their meshes, without those that nothing shows.

    Raises
    ------
    InputError
        If the file is another one.
    """
    found: dict[str, ScatterCheck] = {}
    for key, one in results.items():
        values = read_scatter_exr(path)[0] if path.suffix.lower() == MAP_SUFFIX else _at_vertices(path, key, one)
        name = one.result.mesh.name if one.result.mesh.name not in found else f"{one.result.mesh.name} ({key[0]})"
        if check := check_scatter(one, values):
            found[name] = check
    return found


def check_scatter(one: Baked, values: Floats, size: tuple[int, int] = (320, 320)) -> ScatterCheck:
    """Compare shading with baked values to light that diffuses; empty if the rest of the body hides the mesh.

    Parameters
    ----------
    one : Baked
        The mesh, its body, and what they were baked for.
    values : (h, w, 9, 3) or (n, 9, 3) float32
        Of texels or vertices.
    size : (width, height)
        Of the picture in pixels.
    """
    baked = one.result
    camera = showcase(one.body, baked.medium, size, stage="none").camera
    face, distance = first_hits(baked.mesh, camera, size)
    hit = face >= 0
    with np.errstate(invalid="ignore"):
        hit &= distance <= first_hits(one.body, camera, size)[1] + _SAME_POINT * one.body.diagonal
    if not hit.any():
        return {}
    origins, directions = (part.reshape(-1, 3)[hit] for part in camera.rays(size))
    points = origins + distance[hit, None] * directions
    corners = baked.mesh.faces[face[hit]].astype(np.int64)
    weights = barycentric(baked.mesh.vertices[corners], points)
    normals = blend(corner_normals(baked.mesh).reshape(-1, 3, 3)[face[hit]], weights)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    outside = np.clip(-(normals * directions).sum(axis=1), 0.0, 1.0)
    looked_up = _looked_up(baked.mesh, values, corners, weights, texels=isinstance(baked, ScatterMap))
    surface = Surface(roughness=baked.roughness)
    alone = LitAlone(Object(one.body, medium=baked.medium, surface=surface), baked.resolution)
    looks = {}
    for name, environment in environments().items():
        field, ior = alone.field(environment), baked.medium.ior
        mean, true_mean = scattered_radiance(looked_up, environment.harmonics()), exit_radiance(field, points)
        passed = 1.0 - optics.fresnel_dielectric(outside, ior)
        true = field.radiance(points, optics.refracted_cosine(outside, ior)) * passed[:, None]
        seen = mean * exit_lobe(outside, ior, baked.entering)[:, None]
        pictures = _picture(hit, seen, size), _picture(hit, true, size)
        looks[name] = ScatterLook(*pictures, hit.reshape(size[::-1]), _nrmse(mean, true_mean), _nrmse(seen, true))
    return looks


def summary(check: ScatterCheck) -> dict[str, Any]:
    """Errors as values that JSON can hold."""
    return {name: {"mean_nrmse": look.mean_error, "nrmse": look.error} for name, look in check.items()}


def lines(check: ScatterCheck) -> list[str]:
    """Lines of text about a check."""
    return [
        f"{name:12} nRMSE {100 * look.mean_error:.2g} % of the mean radiance, {100 * look.error:.2g} % towards the eye"
        for name, look in check.items()
    ]


def _looked_up(mesh: Mesh, values: Floats, corners: Integers, weights: Array, *, texels: bool) -> Array:
    """(k, 9, 3): values at points of the faces with these corners (k, 3), between texels or vertices linearly."""
    if not texels:
        return np.asarray(np.einsum("kv,kvic->kic", weights, values[corners].astype(np.float64)))
    assert mesh.uv is not None
    uv = blend(mesh.uv[corners], weights)
    columns = [look_up(mesh, values[..., i, k], uv) for i in range(COUNT) for k in range(3)]
    return np.stack(columns, axis=1).reshape(-1, COUNT, 3)


def _at_vertices(path: Path, key: PrimitiveKey, one: Baked) -> Floats:
    """Values of a .glb in the order of the mesh that was baked."""
    from scipy.spatial import cKDTree

    file = read_gltf(path)
    with np.errstate(under="ignore"):
        _, nearest = cKDTree(positions_of(file, key) @ one.scale.T).query(one.result.mesh.vertices)
    return np.ascontiguousarray(read_scatter_glb(file, key)[nearest])


def _picture(hit: Mask, values: Array, size: tuple[int, int]) -> Array:
    found = np.zeros((size[1] * size[0], 3))
    found[hit] = values
    return found.reshape(size[1], size[0], 3)


def _nrmse(found: Array, true: Array) -> float:
    return float(np.sqrt(((found - true) ** 2).mean()) / max(float(true.mean()), np.finfo(np.float64).tiny))
