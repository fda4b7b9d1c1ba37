"""Texture coordinates of a bake: the mesh's own, checked, or new ones from xatlas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.errors import InputError
from translucent.extras import require_package
from translucent.geometry.mesh import Mesh

#: Texels between the charts that xatlas makes, and the share of a small map's side that this is at most.
CHART_GAP, GAP_SHARE = 4, 1 / 128

#: Distance of texture coordinates to an integer within which they are equal to it: float32 near 1 rounds by half of it.
WHOLE = 1e-7

#: Advice about texture coordinates that no map can have.
ANEW = "make new ones with --unwrap (in Python, leave out the uv), or unwrap it in a modelling tool"

#: Largest number of tiles that one triangle may cover; more repeat a texture, which no thickness does.
MOST_TILES = 4.0


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """A mesh with texture coordinates.

    Attributes
    ----------
    mesh : Mesh
    uv : (m, 3, 2) float64
        At the corners of its faces.
    vertex : (n,) int64
        Vertex of the mesh that was given, for each vertex of this one.
    made_by : str
        "mesh" or "xatlas".
    tiles : tuple of int
        UDIM tiles in which there are faces.
    warnings : tuple of str
    """

    mesh: Mesh
    uv: Array
    vertex: Integers
    made_by: str
    tiles: tuple[int, ...]
    warnings: tuple[str, ...]


def unwrap(mesh: Mesh, size: int, tile: int | None) -> Unwrapped:
    """Texture coordinates for a map of `size` texels a side.

    Raises
    ------
    InputError
        If there are none and xatlas is not installed; if they are not finite, repeat a texture or have no area; or if
        no face lies in the UDIM tile that is asked for.
    """
    vertex = np.arange(len(mesh.vertices))
    made_by = "mesh"
    if mesh.uv is None:
        mesh, vertex = _new_uv(mesh, size)
        made_by = "xatlas"
    assert mesh.uv is not None
    _check(mesh, mesh.uv)
    near = np.round(mesh.uv)
    uv = np.where(np.abs(mesh.uv - near) <= WHOLE, near, mesh.uv)[mesh.faces]
    number, crossing = _tiles(uv)
    tiles = tuple(np.unique(number).tolist())
    return Unwrapped(mesh, uv, vertex, made_by, tiles, _doubts(mesh, uv, tiles, crossing, tile))


def in_tile(uv: Array, tile: int) -> npt.NDArray[np.bool_]:
    """(m,): mask of faces (m, 3, 2) in a UDIM tile."""
    return np.asarray(_tiles(uv)[0] == tile)


def _new_uv(mesh: Mesh, size: int) -> tuple[Mesh, Integers]:
    xatlas = require_package("xatlas", f"new texture coordinates for {mesh.name!r}", "unwrap it in a modelling tool")
    mesh.require_finite()
    one, two, three = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    if not np.cross(two - one, three - one).any():
        raise InputError(f"mesh {mesh.name!r}", "no face has an area", "export the mesh again")
    unit = ((mesh.vertices - mesh.center) / (0.5 * mesh.diagonal)).astype(np.float32)
    gap = max(1, min(CHART_GAP, round(GAP_SHARE * size)))
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(unit, mesh.faces.astype(np.uint32))
    options.resolution, options.padding, options.bilinear = size, gap, True
    atlas.generate(pack_options=options)
    vertex, faces, uv = atlas[0]
    vertex = vertex.astype(np.int64)
    made = Mesh(mesh.vertices[vertex], faces.astype(np.int32), uv.astype(np.float64), mesh.name, mesh.repairs)
    return made, vertex


def _check(mesh: Mesh, uv: Array) -> None:
    if bad := int((~np.isfinite(uv)).any(axis=1).sum()):
        raise InputError(f"mesh {mesh.name!r}", f"{bad} texture coordinates are not finite", ANEW)
    corners = uv[mesh.faces]
    # Much faster than reductions along an axis of three.
    one, two, three = corners.transpose(1, 0, 2)
    span = np.maximum(np.maximum(one, two), three) - np.minimum(np.minimum(one, two), three)
    if float(span.max()) > MOST_TILES:
        face = int(span.max(axis=1).argmax())
        raise InputError(
            f"mesh {mesh.name!r}",
            f"face {face} covers {span.max():.3g} tiles in UV: a texture repeats on it",
            ANEW,
        )
    a, b = two - one, three - one
    with np.errstate(under="ignore"):
        if not (a[:, 0] * b[:, 1] != a[:, 1] * b[:, 0]).any():
            raise InputError(f"mesh {mesh.name!r}", "no face has an area in UV", ANEW)


def _tiles(uv: Array) -> tuple[Integers, npt.NDArray[np.bool_]]:
    """(m,): UDIM tile of each face, by its middle, 0 where there is none; and whether the face leaves its tile."""
    tile = np.floor(uv.mean(axis=1)).astype(np.int64)
    crossing = ((uv < tile[:, None]) | (uv > tile[:, None] + 1)).any(axis=(1, 2))
    u, v = tile.T
    numbered = (u >= 0) & (u < 10) & (v >= 0) & (v < 900)
    return np.where(numbered, 1001 + u + 10 * v, 0), crossing


def _doubts(
    mesh: Mesh, uv: Array, tiles: tuple[int, ...], crossing: npt.NDArray[np.bool_], tile: int | None
) -> tuple[str, ...]:
    """Warnings about texture coordinates; raises if a requested tile is empty."""
    listed = ", ".join(map(str, tiles))
    if tile is not None:
        if tile not in tiles:
            raise InputError(f"UDIM tile {tile}", f"mesh {mesh.name!r} has faces in {listed}", "ask for one of these")
        return ()
    if len(tiles) > 1 and 0 not in tiles and not crossing.any():
        return (f"the texture coordinates use the UDIM tiles {listed}, which one map lays over one another: bake each",)
    if outside := int(((uv < 0) | (uv > 1)).any(axis=(1, 2)).sum()):
        return (f"{outside} of {len(uv)} faces have texture coordinates outside 0..1, where the map repeats",)
    return ()
