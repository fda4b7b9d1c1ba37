"""Baking of scattered light: the body is solved for once for each harmonic, and read at texels or vertices."""

from __future__ import annotations

import warnings

import numpy as np

from translucent.bake.padding import pad
from translucent.bake.scatter.result import ScatterMap, VertexScatter
from translucent.bake.settings import BakeSettings
from translucent.bake.surface import blend
from translucent.bake.texels import Atlas
from translucent.bake.unwrap import unwrap
from translucent.diffusion.harmonics import LitAlone, Transfer
from translucent.errors import TranslucentWarning
from translucent.formulas.spherical_harmonics import COUNT
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.planning.scattering.choice import LEAST_DEPTH
from translucent.scene.scene import Object
from translucent.scene.surface import Surface

#: Texels whose values are read at a time.
BLOCK = 1 << 16


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
    """Bake what a body gives back of the light around it after scattering, for each texel of its UVs.

    Light diffuses in the body as `translucent.Diffusion` has it in pictures, the shadows that it casts on itself
    included. It is linear in the light around, which nine spherical harmonics stand for: radiance that is given back =
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
    rows, overlapping = max(1, BLOCK // size), 0
    for begin in range(0, size, rows):
        texels = atlas.strip(begin, min(begin + rows, size))
        values[texels.row, texels.column] = transfer.at(blend(corners[texels.face], texels.barycentric))
        coverage[texels.row, texels.column] = True
        overlapping += int(texels.overlapping.sum())
    pad(values, coverage, padding)
    said += unwrapped.warnings
    if overlapping:
        said.append(f"{overlapping} texels lie in several triangles in UV; the first triangle has them")
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


def bake_vertex_scatter(
    mesh: Mesh, medium: Medium, *, resolution: int = 32, roughness: float = 0.0, body: Mesh | None = None
) -> VertexScatter:
    """Bake what a body gives back of the light around it after scattering, for each vertex.

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
    values = transfer.at(mesh.vertices).astype(np.float32)
    return VertexScatter(values, mesh, medium, roughness, resolution, transfer.cells, tuple(said))


def _transfer(mesh: Mesh, medium: Medium, resolution: int, roughness: float) -> tuple[Transfer, list[str]]:
    """Transfer of a body, and what to warn of."""
    mesh.require_finite()
    body = Object(mesh, medium=medium, surface=Surface(roughness=roughness))
    alone = LitAlone(body, resolution)
    depth = float((np.asarray(medium.scattering) * (1.0 - medium.anisotropy)).max() * body.mean_thickness)
    if depth > LEAST_DEPTH:
        return alone.transfer(), []
    told = f"light is scattered {depth:.2g} times on its way through, where diffusion wants {LEAST_DEPTH:g} and more"
    return alone.transfer(), [told]


def _warn(mesh: Mesh, said: list[str]) -> None:
    for text in said:
        warnings.warn(f"mesh {mesh.name!r}: {text}", TranslucentWarning, stacklevel=3)
