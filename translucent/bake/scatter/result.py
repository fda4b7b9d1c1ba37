"""Results of a bake of scattered light: a map, or values at vertices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats, Mask
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.gltf.export import mesh_file
from translucent.bake.record import Record, add_record, fingerprint, write_record
from translucent.bake.scatter.files import (
    MAP_SUFFIX,
    VERTEX_SUFFIX,
    fill_scatter_exr,
    positions_of,
    write_scatter_glb,
)
from translucent.bake.writing import add_uv_file, check_map_output
from translucent.files.paths import OutputFiles
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.spherical_harmonics import scattered_radiance
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile
from translucent.media.medium import Medium

#: What the numbers are.
DEFINITION = (
    "T: mean radiance (flux / pi) that the surface gives back of light scattered inside, for a unit of each spherical "
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


@dataclass(frozen=True, eq=False)
class BakedScatter:
    """Common part of maps and of values at vertices.

    Attributes
    ----------
    values : (..., 9, 3) float32
        T_i for each channel, in sr^-1/2: radiance that is given back, over coefficients of the radiance that arrives.
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
        """Share of diffuse light that the polished interface lets through, for `exit_lobe`."""
        return diffuse_interface(self.medium.ior).entering

    def radiance(self, light: npt.ArrayLike) -> Array:
        """Mean radiance (..., 3) that is given back in light with these coefficients (9, 3), in the frame of the mesh.

        Those of an environment are `Environment.harmonics`.
        """
        return scattered_radiance(self.values, light)

    def meaning(self) -> Record:
        """Description of the values and of what they were made for, as values that JSON can hold."""
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
        mesh = {"name": self.mesh.name, "vertices": len(self.mesh.vertices), "faces": len(self.mesh.faces)}
        # In light of radiance 1 from everywhere the coefficient of the first harmonic is sqrt(4 pi).
        mean = np.sqrt(4.0 * np.pi) * self._counted[:, 0].mean(axis=0, dtype=np.float64)
        return {**self.meaning(), "mean_in_uniform_light": mean.tolist(), "mesh": mesh, "warnings": list(self.warnings)}

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

    def at(self, positions: Array) -> Floats:
        """Values (k, 9, 3) of the vertices that are nearest to positions (k, 3) in metres."""
        from scipy.spatial import cKDTree

        with np.errstate(under="ignore"):
            _, nearest = cKDTree(self.mesh.vertices).query(positions)
        return np.ascontiguousarray(self.values[nearest])


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
