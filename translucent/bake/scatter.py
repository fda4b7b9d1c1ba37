"""Baked subsurface light of bodies, as coefficients of the light around them, in maps or at vertices.

Diffusion is linear in the light. A harmonic has both signs, and light has one: the body is solved for in uniform light
and in light that is uniform plus a harmonic, and the difference is what belongs to the harmonic (Sloan, Kautz & Snyder
2002, "Precomputed radiance transfer for real-time rendering in dynamic, low-frequency lighting environments"). It is
read at texels or vertices. Each file appears complete, with its record, or not at all:

======  =============================================================================================
file    holds
======  =============================================================================================
.exr    float32 ``SH0.R``, ``SH0.G`` to ``SH8.B``, ``coverage.Y``; what they mean in its header
.glb    attributes ``_SCATTER_SH0`` to ``_SCATTER_SH8`` of the vertices, FLOAT VEC3; what they mean in the ``extras``
        of their primitive, as ``translucent_scatter``
======  =============================================================================================
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked, vectors
from translucent.arrays import Array, Floats, Mask
from translucent.bake.atlas import Atlas, pad, unwrap
from translucent.bake.gltf_builder import GlbBuilder, mesh_file
from translucent.bake.gltf_targets import PrimitiveKey, nearest, positions_of
from translucent.bake.rays import blend
from translucent.bake.record import Record, add_record, fingerprint, mesh_record, plain, write_record
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import add_uv_file, check_map_output
from translucent.diffusion.entering import MAP_HEIGHT
from translucent.diffusion.field import DiffusingBody, DiffusionField
from translucent.diffusion.lit_body import lit_body
from translucent.diffusion.sides import GridPlacement
from translucent.errors import InputError, TranslucentWarning
from translucent.files.images import read_exr, write_exr
from translucent.files.paths import OutputFiles, require_file
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.spherical_harmonics import BAND_0, COUNT, real_harmonics, scattered_radiance
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals, vertex_normals
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile, write_gltf
from translucent.media.medium import Medium
from translucent.planning.scattering import LEAST_DEPTH, Diffusion
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

#: Suffix of images, and of values at vertices.
MAP_SUFFIX, VERTEX_SUFFIX = ".exr", ".glb"

#: Names of the attributes of vertices, and key of what they mean in the extras of a primitive.
ATTRIBUTES, EXTRAS = tuple(f"_SCATTER_SH{i}" for i in range(COUNT)), "translucent_scatter"

_CHANNELS = {f"SH{i}.{color}": (i, k) for i in range(COUNT) for k, color in enumerate("RGB")}


#: What the numbers are.
DEFINITION = (
    "T: mean radiance (flux / pi) of light scattered inside that leaves the surface, for a unit of each spherical "
    "harmonic of the radiance around it; radiance = sum_i T_i L_i, times (1 - F(cos)) / entering in a direction"
)

#: What the nine coefficients are, for records and headers.
HARMONICS: Record = {
    "order": 2,
    "basis": "real, orthonormal, without the sign (-1)^m",
    "index": "i = l (l + 1) + m",
    "polynomials": [
        "0.282095", "0.488603 y", "0.488603 z", "0.488603 x", "1.092548 x y", "1.092548 y z",
        "0.315392 (3 z^2 - 1)", "1.092548 x z", "0.546274 (x^2 - y^2)",
    ],
    "frame": "the object's own axes; directions towards the light",
}  # fmt: skip

#: Texels whose values are read at a time.
BLOCK = 1 << 16

#: Uniform radiance that is above every harmonic's least value, -0.63.
UNIFORM = 0.7


@dataclass(frozen=True, eq=False)
class Transfer:
    """Transfer of a body on a grid of cells around its surface.

    Attributes
    ----------
    values : (6, x, y, z, 9, 3) float32
        See `at`.
    placement : GridPlacement
    cells : int
        In the system.
    """

    values: Floats
    placement: GridPlacement
    cells: int

    def at(self, points: Array, normals: Array) -> Array:
        """(k, 9, 3): mean subsurface radiance of points of the surface, normals (k, 3), for a unit of each harmonic."""
        flat = self.values.reshape(*self.values.shape[:4], -1)
        return self.placement.read(flat, points, normals).reshape(-1, COUNT, 3)


def exit_radiance(field: DiffusionField, points: Array, normals: Array) -> Array:
    """(k, 3): mean radiance, flux over pi, that the diffused light has outside at points with normals (k, 3)."""
    return field.exit_share / np.pi * field.at_surface(field.fluence, points, normals)


class LitAlone:
    """Solver of the subsurface light of a single body in an environment.

    Parameters
    ----------
    body : Object
        With a medium.
    resolution : int
        See `translucent.Diffusion`.

    Raises
    ------
    InputError
        If its light cannot diffuse, or the medium does not scatter, or emits.
    """

    def __init__(self, body: Object, resolution: int) -> None:
        diffusion = Diffusion(resolution)
        _check_body(body, diffusion)
        assert body.medium is not None
        roughness = 0.0 if body.surface is None else body.surface.roughness
        self._body = body
        self._camera = Camera.look_at((0, 0, 1), (0, 0, 0))  # which the light does not depend on
        geometry = lit_body(body, None, diffusion.cell_size(body))
        self._diffusing = DiffusingBody(geometry, body.medium, roughness, warm_starts=True)

    def field(self, environment: Environment) -> DiffusionField:
        """Subsurface light of the body."""
        return self._diffusing.field(Scene([self._body], self._camera, (), environment), 0)

    def transfer(self) -> Transfer:
        """Transfer of the body.

        Raises
        ------
        RenderError
            If the solver does not get there.
        """
        uniform = self.field(Environment.constant((1, 1, 1)))
        values = np.empty((*uniform.fluence.shape[:4], COUNT, 3), np.float32)
        with np.errstate(under="ignore"):
            values[..., 0, :] = BAND_0 * uniform.fluence
            for i in range(1, COUNT):
                values[..., i, :] = self.field(_harmonic(i)).fluence - UNIFORM * uniform.fluence
            values *= uniform.exit_share / np.pi
        return Transfer(values, uniform.placement, uniform.cells)


def _harmonic(index: int) -> Environment:
    """Light of a harmonic and `UNIFORM`, white, at the texels that the samples of a body look up."""

    def radiance(directions: Array) -> Array:
        return np.repeat(UNIFORM + real_harmonics(directions)[..., index, None], 3, axis=-1)

    return Environment.image(EnvironmentMap.from_formula(radiance, MAP_HEIGHT))


def _check_body(body: Object, diffusion: Diffusion) -> None:
    requested, medium = f"scattered light of {body.mesh.name!r}", body.medium
    if medium is None or not medium.scatters:
        do = "give a medium that scatters, such as --preset wax, or tl.scattering_medium('#f2e0b8', 0.002)"
        raise InputError(
            requested,
            "the medium of the body does not scatter light" if medium is not None else "the body has no medium",
            do,
        )
    if np.asarray(medium.emission).any():
        raise InputError(
            requested,
            "the medium emits light, which a scatter bake cannot store because it does not depend on the environment",
            "use a medium without emission",
        )
    if (why := diffusion.refusal(body)) is not None:
        raise InputError(requested, why, "use a closed mesh, a thicker body, or a higher resolution")


def fill_scatter_exr(path: Path, values: Floats, coverage: Mask, meaning: Record) -> None:
    """Write a map (h, w, 9, 3) with its metadata as an OpenEXR file; raises `OSError` if it cannot be written."""
    channels = {name: values[:, :, i, k] for name, (i, k) in _CHANNELS.items()} | {"coverage.Y": coverage}
    header = {"comments": str(meaning["definition"]), "scatter": json.dumps(plain(meaning), ensure_ascii=False)}
    write_exr(path, channels, header)


def read_scatter_exr(path: Path) -> tuple[Floats, Mask, Record]:
    """Map (h, w, 9, 3), coverage (h, w) and metadata of a file that `fill_scatter_exr` wrote.

    Raises
    ------
    InputError
        If it is another file.
    RenderError
        If the OpenEXR package is missing.
    """
    requested = f"scatter map {str(path)!r}"
    require_file(path, requested)
    header, channels = read_exr(path, requested)
    if missing := [name for name in (*_CHANNELS, "coverage.Y") if name not in channels]:
        raise InputError(
            requested,
            f"the file has no channel {missing[0]}",
            "give a file that `translucent bake --mode scatter` wrote",
        )
    values = np.stack([channels[name] for name in _CHANNELS], axis=-1).astype(np.float32)
    meaning: Record = json.loads(header.get("scatter", "{}"))
    return values.reshape(*values.shape[:2], COUNT, 3), channels["coverage.Y"] > 0, meaning


def write_scatter_glb(
    path: Path,
    builder: GlbBuilder,
    values: Mapping[PrimitiveKey, Floats],
    meanings: Mapping[PrimitiveKey, Record],
) -> None:
    """Write a .glb whose vertices have these values (n, 9, 3), in the order of the file, with their metadata.

    Raises
    ------
    InputError
        If the file's data are wrong.
    RenderError
        If the file cannot be written.
    """
    for key, found in values.items():
        primitive = builder.primitive(*key)
        for i, name in enumerate(ATTRIBUTES):
            primitive["attributes"][name] = builder.add_accessor(np.ascontiguousarray(found[:, i], np.float32))
        extras = primitive.get("extras")
        known: dict[str, Any] = extras if isinstance(extras, dict) else {}
        primitive["extras"] = {**known, EXTRAS: plain(meanings[key])}
    write_gltf(builder.file(), path)


def read_scatter_glb(file: GltfFile, key: PrimitiveKey) -> Floats:
    """Values (n, 9, 3) at the vertices of a primitive; raises `InputError` if it has none."""
    accessors, attributes = Accessors(file), _attributes(file, key)
    columns = [accessors.vectors(attributes.get(name), "VEC3") for name in ATTRIBUTES]
    return np.stack(columns, axis=1).astype(np.float32)


def _attributes(file: GltfFile, key: PrimitiveKey) -> dict[str, Any]:
    found: dict[str, Any] = file.item("meshes", key[0])["primitives"][key[1]]["attributes"]
    return found


@dataclass(frozen=True, eq=False)
class BakedScatter:
    """Base class of baked scattered light in maps and at vertices.

    Attributes
    ----------
    values : (..., 9, 3) float32
        T_i for each channel, in sr^-1/2: subsurface exitance over pi, per coefficient of the radiance that arrives.
    mesh : Mesh
        In metres.
    medium : Medium
    roughness : float
        Of the surface.
    resolution, cells : int
        Of the grid, as `translucent.Diffusion` has it; and its cells.
    warnings : tuple of str
    """

    values: Floats
    mesh: Mesh
    medium: Medium
    roughness: float
    resolution: int
    cells: int
    warnings: tuple[str, ...]

    @property
    def entering(self) -> float:
        """Fraction of diffuse light that the polished interface lets through, for `exit_lobe`."""
        return diffuse_interface(self.medium.ior).entering

    def radiance(self, light: npt.ArrayLike) -> Array:
        """Mean subsurface radiance (..., 3) in light with these coefficients (9, 3), in the frame of the mesh.

        Those of an environment are `Environment.harmonics`.
        """
        return scattered_radiance(self.values, light)

    def meaning(self) -> Record:
        """Metadata of the values, such as definition, medium and settings, as values that JSON can hold."""
        medium = self.medium
        return {
            "mode": "scatter",
            "definition": DEFINITION,
            "unit": "sr^-1/2",
            "harmonics": HARMONICS,
            "absorption": np.asarray(medium.absorption).tolist(),
            "scattering": np.asarray(medium.scattering).tolist(),
            "anisotropy": float(medium.anisotropy),
            "ior": float(medium.ior),
            "roughness": float(self.roughness),
            "entering": self.entering,
            "resolution": self.resolution,
            "cells": self.cells,
            "metres": np.ptp(self.mesh.bounds, axis=0).tolist(),
        }

    def summary(self) -> Record:
        """Record of the bake: its meaning, and of the values range and mesh."""
        # In light of radiance 1 from everywhere the coefficient of the first harmonic is sqrt(4 pi).
        mean = np.sqrt(4.0 * np.pi) * self._counted[:, 0].mean(axis=0, dtype=np.float64)
        return {
            **self.meaning(),
            "mean_in_uniform_light": mean.tolist(),
            "mesh": mesh_record(self.mesh),
            "warnings": list(self.warnings),
        }

    @property
    def _counted(self) -> Floats:
        """(k, 9, 3): values of the surface itself."""
        return self.values


@dataclass(frozen=True, eq=False)
class ScatterMap(BakedScatter):
    """Map of scattered light, from `translucent.bake_scatter`: nine coefficients of each channel for each texel.

    Attributes
    ----------
    values : (h, w, 9, 3) float32
        T_i: `radiance` says what they are for. Row 0 is the top of the image: v = 1 as trimesh and OBJ count, v = 0 in
        glTF. Padded beyond `coverage`; 0 elsewhere.
    coverage : (h, w) bool
        Texels that a triangle touches, before padding.
    mesh : Mesh
        With the uv that the map belongs to; new ones where the mesh that was given had none.
    uv_from : str
        "mesh" or "xatlas".
    medium, roughness, resolution, cells, warnings
        See `translucent.VertexScatter`.
    """

    coverage: Mask
    uv_from: str

    @property
    def _counted(self) -> Floats:
        return self.values[self.coverage]

    @checked
    def save(self, path: str | Path, about: Record | None = None) -> Record:
        """Write the map as .exr, its record beside it, and if its uv are new, ``FILE.uv.glb``; returns the record.

        Raises
        ------
        InputError
            If the suffix is another one, or the folder is missing.
        RenderError
            If the file cannot be written.
        """
        return save_scatter_map(self, path, about, mesh_file(self.mesh) if self.uv_from == "xatlas" else None)


@dataclass(frozen=True, eq=False)
class VertexScatter(BakedScatter):
    """Scattered light at vertices, from `translucent.bake_vertex_scatter`.

    Attributes
    ----------
    values : (n, 9, 3) float32
        T_i: `radiance` says what they are for.
    mesh : Mesh
    medium : Medium
    roughness : float
        Of the surface.
    resolution, cells : int
        Of the grid, as `translucent.Diffusion` has it; and its cells.
    warnings : tuple of str
    """

    @checked
    def save(self, path: str | Path, about: Record | None = None) -> Record:
        """Write the mesh with the values as attributes of its vertices, .glb, its record beside it; returns the record.

        Raises
        ------
        InputError
            If the suffix is another one, or the folder is missing.
        RenderError
            If the file cannot be written.
        """
        path = Path(path)
        check_map_output(path, (VERTEX_SUFFIX,))
        builder, key = GlbBuilder(mesh_file(self.mesh)), (0, 0)
        values = self.at(positions_of(builder.file(), key))
        write_scatter_glb(path, builder, {key: values}, {key: self.meaning()})
        return write_record(path, {**(about or {}), "kind": "vertex scatter", **self.summary()})

    @checked
    def at(self, positions: Array) -> Floats:
        """Values (k, 9, 3) of the vertices that are nearest to positions (k, 3) in metres."""
        return np.ascontiguousarray(self.values[nearest(self.mesh.vertices, vectors("positions", positions))])


def save_scatter_map(result: ScatterMap, path: str | Path, about: Record | None, model: GltfFile | None) -> Record:
    """Write a map as `ScatterMap.save` does, with a model beside it, if any, that has new uv; returns the record."""
    path = Path(path)
    check_map_output(path, (MAP_SUFFIX,))
    about = dict(about or {})
    size = {"kind": "scatter map", "size": [result.values.shape[1], result.values.shape[0]]}
    fill = partial(fill_scatter_exr, values=result.values, coverage=result.coverage, meaning=result.meaning())
    with OutputFiles() as files:
        if model is not None:
            about["uv_file"] = add_uv_file(files, model, path)
        filled = files.write(path, fill)
        return add_record(files, path, {**fingerprint(path, filled), **about, **size, **result.summary()})


@checked
def bake_scatter(
    mesh: Mesh,
    medium: Medium,
    size: int = 256,
    *,
    resolution: int = 32,
    roughness: float = 0.0,
    padding: int = 16,
    body: Mesh | None = None,
) -> ScatterMap:
    """Bake the subsurface radiance of a body in the light around it, for each texel of its UVs.

    Light diffuses in the body as `translucent.Diffusion` has it in pictures, the shadows that it casts on itself
    included. It is linear in the light around, which nine spherical harmonics represent: subsurface radiance =
    sum_i T_i L_i. Mirror reflection, and light that passes unscattered, are not in it.

    Parameters
    ----------
    mesh : Mesh
        In metres, closed. With uv, or xatlas makes them.
    medium : Medium
        That scatters. The result is for this medium in a body of this size alone.
    size : int
        Texels along each side of the map.
    resolution : int
        Of the grid of cells, 8 to 128; see `translucent.Diffusion`.
    roughness : float
        Of the surface, 0 to 1.
    padding : int
        Texels around each chart.
    body : Mesh, optional
        The closed body that the mesh is a part of.

    Returns
    -------
    ScatterMap

    Raises
    ------
    InputError
        If the medium does not scatter, or emits; if light cannot diffuse in the body: it is not closed, or too thin for
        cells of this size; if there are no uv and no xatlas, or they cannot be used.
    RenderError
        If embreex is missing, or the solver does not get there.

    Warns
    -----
    TranslucentWarning
        If texture coordinates overlap, or lie outside 0..1; if little of the scattered light is scattered again.
    """
    BakeSettings(size=size, padding=padding)
    transfer, said = _transfer(body or mesh, medium, resolution, roughness)
    unwrapped = unwrap(mesh, size, None)
    values, coverage = np.zeros((size, size, COUNT, 3), np.float32), np.zeros((size, size), bool)
    corners, atlas = unwrapped.mesh.vertices[unwrapped.mesh.faces], Atlas(unwrapped.uv, size, size)
    normals = corner_normals(unwrapped.mesh).reshape(-1, 3, 3)
    rows, overlapping = max(1, BLOCK // size), 0
    for begin in range(0, size, rows):
        texels = atlas.strip(begin, min(begin + rows, size))
        points, towards = (blend(at[texels.face], texels.barycentric) for at in (corners, normals))
        values[texels.row, texels.column] = transfer.at(points, towards)
        coverage[texels.row, texels.column] = True
        overlapping += int(texels.overlapping.sum())
    pad(values, coverage, padding)
    said += unwrapped.warnings
    if overlapping:
        said.append(f"{overlapping} texels lie in several triangles in UV space, and use the first triangle")
    _warn(mesh, said)
    return ScatterMap(
        values=values,
        mesh=unwrapped.mesh,
        medium=medium,
        roughness=roughness,
        resolution=resolution,
        cells=transfer.cells,
        warnings=tuple(said),
        coverage=coverage,
        uv_from=unwrapped.made_by,
    )


@checked
def bake_vertex_scatter(
    mesh: Mesh, medium: Medium, *, resolution: int = 32, roughness: float = 0.0, body: Mesh | None = None
) -> VertexScatter:
    """Bake the subsurface radiance of a body in the light around it, for each vertex.

    As `bake_scatter`, with the same parameters, without texture coordinates.

    Parameters
    ----------
    mesh : Mesh
    medium : Medium
    resolution : int
    roughness : float
    body : Mesh, optional

    Returns
    -------
    VertexScatter

    Raises
    ------
    InputError, RenderError
        As `bake_scatter`.

    Warns
    -----
    TranslucentWarning
        If little of the scattered light is scattered again.
    """
    transfer, said = _transfer(body or mesh, medium, resolution, roughness)
    _warn(mesh, said)
    values = transfer.at(mesh.vertices, vertex_normals(mesh)).astype(np.float32)
    return VertexScatter(values, mesh, medium, roughness, resolution, transfer.cells, tuple(said))


def _transfer(mesh: Mesh, medium: Medium, resolution: int, roughness: float) -> tuple[Transfer, list[str]]:
    """Light transfer of a body: coefficients of the light that leaves it; and warnings."""
    mesh.require_finite()
    body = Object(mesh, medium=medium, surface=Surface(roughness=roughness))
    alone = LitAlone(body, resolution)
    depth = float((np.asarray(medium.scattering) * (1.0 - medium.anisotropy)).max() * body.mean_thickness)
    if depth > LEAST_DEPTH:
        return alone.transfer(), []
    note = f"light is scattered only {depth:.2g} times inside the body; diffusion needs at least {LEAST_DEPTH:g}"
    return alone.transfer(), [note]


def _warn(mesh: Mesh, said: list[str]) -> None:
    for text in said:
        warnings.warn(f"mesh {mesh.name!r}: {text}", TranslucentWarning, stacklevel=4)
