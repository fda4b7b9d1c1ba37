"""Bake jobs of scattered light, and their check against diffusion in the renderer.

Each body is baked alone, in the size in which the first node of a glTF file shows it and in its own axes: the linear
part of a node's matrix is M = R S (polar decomposition), S is applied before, and light is to be turned by R^-1.

A check shows subsurface radiance alone, at the first hit of each view ray on the surface; mirror reflection and light
that passes unscattered are not part of a bake. nRMSE is the root of the mean square of the difference, over the mean
of the diffused light.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.bake.check import MOST_ROWS, NO_BODY, first_hits, labeled, look, look_up, stacked
from translucent.bake.gltf_builder import GlbBuilder
from translucent.bake.gltf_targets import (
    PrimitiveKey,
    Target,
    find_targets,
    first_transforms,
    left_out,
    nearest,
    positions_of,
    transformed,
)
from translucent.bake.rays import blend
from translucent.bake.record import Record, write_record
from translucent.bake.scatter import (
    MAP_SUFFIX,
    VERTEX_SUFFIX,
    LitAlone,
    ScatterMap,
    VertexScatter,
    bake_scatter,
    bake_vertex_scatter,
    exit_radiance,
    read_scatter_exr,
    read_scatter_glb,
    save_scatter_map,
    write_scatter_glb,
)
from translucent.bake.thickness_map import check_map_output
from translucent.errors import InputError
from translucent.files.paths import write_atomically
from translucent.formulas import optics
from translucent.formulas.spherical_harmonics import COUNT, exit_lobe, scattered_radiance
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals
from translucent.gltf.file import read_gltf
from translucent.gltf.load import SUFFIXES
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.scene.environment import Environment
from translucent.scene.scene import Object
from translucent.scene.showcase import showcase
from translucent.scene.surface import Surface
from translucent.units import metres_per_unit

if TYPE_CHECKING:
    from PIL import Image


#: Factor of the difference.
MAGNIFIED = 10.0


@dataclass(frozen=True)
class ScatterJob:
    """Job of one bake of scattered light: model, output and settings.

    Attributes
    ----------
    model, output : Path
        The output is an .exr for a map, or a .glb for values at vertices.
    medium : Medium
    roughness : float
    size, padding : int
        Of a map, in texels.
    resolution : int
    unit : str
        Of the model.
    unwrap : bool
        Make new texture coordinates.
    outside : bool
        Read files that a glTF model links to wherever they are.
    """

    model: Path
    output: Path
    medium: Medium
    roughness: float = 0.0
    size: int = 256
    padding: int = 16
    resolution: int = 32
    unit: str = "m"
    unwrap: bool = False
    outside: bool = False

    @property
    def makes_map(self) -> bool:
        """True if the output is an image."""
        return self.output.suffix.lower() == MAP_SUFFIX

    def bake(self, mesh: Mesh, body: Mesh | None = None) -> ScatterMap | VertexScatter:
        """Bake a mesh, the part of a body."""
        if self.makes_map:
            texels = {"size": self.size, "padding": self.padding}
            return bake_scatter(
                mesh, self.medium, resolution=self.resolution, roughness=self.roughness, body=body, **texels
            )
        return bake_vertex_scatter(mesh, self.medium, resolution=self.resolution, roughness=self.roughness, body=body)


@dataclass(frozen=True, eq=False)
class Baked:
    """Baked scattered light of one mesh, and the body that the mesh belongs to.

    Attributes
    ----------
    result : ScatterMap or VertexScatter
    body : Mesh
        Closed.
    scale : (3, 3) float64
        From positions in the file that is written, if it is a .glb, to metres.
    """

    result: ScatterMap | VertexScatter
    body: Mesh
    scale: Array


def run_scatter_job(job: ScatterJob) -> tuple[Record, dict[PrimitiveKey, Baked]]:
    """Run a job and write its files.

    Returns
    -------
    record : dict
        As it was written beside the output.
    results : dict
        By mesh and primitive of a glTF file; else one, for (0, 0).

    Raises
    ------
    InputError
        If the job or its model is wrong.
    RenderError
        If a file cannot be written, or a package is missing.
    """
    check_map_output(job.output, (MAP_SUFFIX, VERTEX_SUFFIX))
    about: Record = {"model": str(job.model), "model_unit": job.unit}
    if job.model.suffix.lower() in SUFFIXES:
        return _bake_gltf(job, about)
    mesh = load_mesh(job.model, unit=job.unit, allow_outside=job.outside)
    result = job.bake(dataclasses.replace(mesh, uv=None) if job.unwrap else mesh)
    return result.save(job.output, about), {(0, 0): Baked(result, mesh, np.eye(3))}


def _bake_gltf(job: ScatterJob, about: Record) -> tuple[Record, dict[PrimitiveKey, Baked]]:
    builder = GlbBuilder(read_gltf(job.model, job.outside))
    targets = find_targets(
        builder, metres_per_unit(job.unit), needs_uv=job.makes_map, new_uv=job.unwrap, plain_uv=True, size=job.size
    )
    if job.makes_map and len(targets) > 1:
        raise InputError(
            f"output {str(job.output)!r}",
            f"the model has {len(targets)} bodies, but this format holds only one",
            "write a .glb, which holds all bodies",
        )
    if lost := left_out(builder.file(), targets):
        about = {**about, "left_out": lost}
    stretches = _stretches(builder)
    baked = {target.key: _bake_target(job, target, stretches.get(target.key[0], np.eye(4))) for target in targets}
    if job.makes_map:
        ((target, one),) = zip(targets, baked.values(), strict=True)
        assert isinstance(one.result, ScatterMap)
        about |= {"place": list(target.key), "tex_coord": target.tex_coord}
        model = builder.file() if target.made_uv else None
        return save_scatter_map(one.result, job.output, about, model), baked
    values = {}
    for key, one in baked.items():
        assert isinstance(one.result, VertexScatter)
        values[key] = one.result.at(positions_of(builder.file(), key) @ one.scale.T)
    write_scatter_glb(job.output, builder, values, {key: one.result.meaning() for key, one in baked.items()})
    parts = [{"place": list(key), **one.result.summary()} for key, one in baked.items()]
    return write_record(job.output, {**about, "kind": "vertex scatter", "mode": "scatter", "primitives": parts}), baked


def _bake_target(job: ScatterJob, target: Target, stretch: Array) -> Baked:
    metres = metres_per_unit(job.unit)
    mesh = transformed(target.mesh, stretch, metres)
    body = mesh if target.around is None else transformed(target.around, stretch, metres)
    return Baked(job.bake(mesh, body), body, metres * stretch[:3, :3])


def _stretches(builder: GlbBuilder) -> dict[int, Array]:
    """(4, 4) of each mesh: how the first node that shows it scales it, without its rotation."""
    from scipy.linalg import polar

    found = {}
    for mesh, matrix in first_transforms(builder.file()).items():
        found[mesh] = np.eye(4)
        found[mesh][:3, :3] = polar(matrix[:3, :3])[1]
    return found


@dataclass(frozen=True, eq=False)
class ScatterLook:
    """Body in one environment, shaded with baked values and by diffusion.

    Attributes
    ----------
    baked, true : (h, w, 3) float64
        Radiance towards the eye; 0 where the body is not visible.
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


class ScatterCheck(dict[str, ScatterLook]):
    """Check of baked scattered light: looks by environment."""

    def summary(self) -> Record:
        """Errors as values that JSON can hold."""
        return {name: {"mean_nrmse": look.mean_error, "nrmse": look.error} for name, look in self.items()}

    def __str__(self) -> str:
        return "\n".join(
            f"{name:12} nRMSE {100 * look.mean_error:.2g} % of the mean radiance, {100 * look.error:.2g} % towards the "
            "eye"
            for name, look in self.items()
        )


def environments() -> dict[str, Environment]:
    """Environments of a check by name: of the first band, of the first two, and of all."""
    return {
        "uniform": Environment.constant((1, 1, 1)),
        "from-above": Environment.gradient((0, 0, 0), (1, 1, 1)),
        "studio": Environment.studio(),
    }


def check_scatter_output(path: Path, results: dict[PrimitiveKey, Baked]) -> dict[str, ScatterCheck]:
    """Checks of all bodies of a file, read back; by the names of their meshes, without hidden ones.

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
    first = first_hits(baked.mesh, camera, size, one.body)
    if not first.hit.any():
        return ScatterCheck()
    hit, points, directions, weights = first.hit, first.points, first.directions, first.weights
    corners = baked.mesh.faces[first.face].astype(np.int64)
    normals = blend(corner_normals(baked.mesh).reshape(-1, 3, 3)[first.face], weights)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    outside = np.clip(-(normals * directions).sum(axis=1), 0.0, 1.0)
    looked_up = _looked_up(baked.mesh, values, corners, weights, texels=isinstance(baked, ScatterMap))
    surface = Surface(roughness=baked.roughness)
    alone = LitAlone(Object(one.body, medium=baked.medium, surface=surface), baked.resolution)
    looks = ScatterCheck()
    for name, environment in environments().items():
        field, ior = alone.field(environment), baked.medium.ior
        mean = scattered_radiance(looked_up, environment.harmonics())
        true_mean = exit_radiance(field, points, normals)
        passed = 1.0 - optics.fresnel_dielectric(outside, ior)
        true = field.radiance(points, normals, optics.refracted_cosine(outside, ior)) * passed[:, None]
        leaving = mean * exit_lobe(outside, ior, baked.entering)[:, None]
        pictures = _picture(hit, leaving, size), _picture(hit, true, size)
        looks[name] = ScatterLook(*pictures, hit.reshape(size[::-1]), _nrmse(mean, true_mean), _nrmse(leaving, true))
    return looks


def _looked_up(mesh: Mesh, values: Floats, corners: Integers, weights: Array, *, texels: bool) -> Array:
    """(k, 9, 3): values at points of faces with corners (k, 3), interpolated linearly between texels or vertices."""
    if not texels:
        return np.asarray(np.einsum("kv,kvic->kic", weights, values[corners].astype(np.float64)))
    assert mesh.uv is not None
    uv = blend(mesh.uv[corners], weights)
    columns = [look_up(mesh, values[..., i, k], uv) for i in range(COUNT) for k in range(3)]
    return np.stack(columns, axis=1).reshape(-1, COUNT, 3)


def _at_vertices(path: Path, key: PrimitiveKey, one: Baked) -> Floats:
    """Values of a .glb in the order of the mesh that was baked."""
    file = read_gltf(path)
    found = nearest(positions_of(file, key) @ one.scale.T, one.result.mesh.vertices)
    return np.ascontiguousarray(read_scatter_glb(file, key)[found])


def _picture(hit: Mask, values: Array, size: tuple[int, int]) -> Array:
    found = np.zeros((size[1] * size[0], 3))
    found[hit] = values
    return found.reshape(size[1], size[0], 3)


def _nrmse(found: Array, true: Array) -> float:
    return float(np.sqrt(((found - true) ** 2).mean()) / max(float(true.mean()), np.finfo(np.float64).tiny))


def write_scatter_picture(checks: Collection[ScatterCheck], path: Path) -> None:
    """Write the checks below each other as a PNG, a row for each environment.

    Raises
    ------
    RenderError
        If it cannot be written.
    """
    rows = [_row(name, look) for check in checks for name, look in check.items()]
    write_atomically(path, partial(stacked(rows[:MOST_ROWS]).save, format="PNG"))


def _row(name: str, found: ScatterLook) -> Image.Image:
    # Bright bodies are shown darker, both alike.
    scale = max(float(np.quantile(found.true[found.seen], 0.99)), 1.0)
    displayed = [np.where(found.seen[..., None], look(part / scale), NO_BODY) for part in (found.baked, found.true)]
    difference = MAGNIFIED * np.abs(found.baked - found.true) / scale
    return labeled(
        (f"{name}: baked", displayed[0].astype(np.uint8)),
        ("diffusion in the renderer", displayed[1].astype(np.uint8)),
        (f"difference, {MAGNIFIED:g} times", look(difference)),
    )
