"""Bake jobs of scattered light on files: a model is read, baked and written, with the record beside it.

Each body is baked alone, in the size in which the first node of a glTF file shows it and in its own axes: the linear
part of a node's matrix is M = R S (polar decomposition), S is applied before, and light is to be turned by R^-1.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from translucent.arrays import Array
from translucent.bake.gltf.bodies import PrimitiveKey, first_transforms, transformed
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.gltf.targets import Target, find_targets, left_out
from translucent.bake.record import Record, write_record
from translucent.bake.scatter.bake import bake_scatter, bake_vertex_scatter
from translucent.bake.scatter.files import MAP_SUFFIX, VERTEX_SUFFIX, positions_of, write_scatter_glb
from translucent.bake.scatter.result import ScatterMap, VertexScatter, save_scatter_map
from translucent.bake.writing import check_map_output
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import read_gltf
from translucent.gltf.load import SUFFIXES
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.units import metres_per_unit


@dataclass(frozen=True)
class ScatterJob:
    """Task of one bake: what, and how.

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
    """Result of one body, and what it is a part of.

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
            f"output {str(job.output)!r}", f"{len(targets)} bodies in the model", "write a .glb, which holds them all"
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
