"""Triangle meshes: immutable values with their geometry in float64."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError, TranslucentWarning
from translucent.frozen import Frozen
from translucent.geometry.diagnosis import Diagnosis, diagnose
from translucent.geometry.grouping import equal_rows, used_vertices
from translucent.geometry.repair import WELD_EDGE_SHARE, WELD_TOLERANCE, orient, weld
from translucent.geometry.winding import winding_number

#: Largest index of a vertex.
MAX_INDEX = 2**31 - 1

#: Largest coordinate in metres whose square still fits into float32.
MAX_COORDINATE = 1e18
#: Smallest diagonal in metres whose square is not lost in float32.
MIN_DIAGONAL = 1e-18


@dataclass(frozen=True, eq=False)
class Mesh(Frozen):
    """Triangle mesh with shared vertices. Compared by identity; its arrays are read-only.

    Parameters
    ----------
    vertices : array_like (n, 3)
        Positions in metres.
    faces : array_like (m, 3)
        Vertex indices, counter-clockwise seen from outside.
    uv : array_like (n, 2), optional
        Texture coordinates, v upwards.
    name : str
        What messages call the mesh.
    repairs : tuple of str
        What `load_mesh` has mended, for the record.
    colors : array_like (n, 4), optional
        Linear RGB and opacity of the vertices, 0 to 1, which multiply those of a surface.

    Raises
    ------
    InputError
        If a shape is wrong, there is no face, or an index points at no vertex.
    """

    vertices: Array
    faces: npt.NDArray[np.int32]
    uv: Array | None = None
    name: str = "mesh"
    repairs: tuple[str, ...] = ()
    colors: Array | None = None

    def __post_init__(self) -> None:
        vertices = self._array("vertices", self.vertices, np.float64, 3)
        faces = self._array("faces", self.faces, np.int32, 3)
        if len(faces) == 0:
            raise InputError(f"mesh {self.name!r}", "it has no faces", "give a triangle mesh")
        if faces.min() < 0 or faces.max() >= len(vertices):
            bad = int(np.flatnonzero((faces < 0).any(axis=1) | (faces >= len(vertices)).any(axis=1))[0])
            raise InputError(
                f"mesh {self.name!r}",
                f"face {bad} = {tuple(faces[bad].tolist())} points outside the {len(vertices)} vertices",
                "export the mesh again",
            )
        self._freeze("vertices", vertices)
        self._freeze("faces", faces)
        for field, columns in (("uv", 2), ("colors", 4)):
            if (given := getattr(self, field)) is None:
                continue
            values = self._array(field, given, np.float64, columns)
            if len(values) != len(vertices):
                found = f"{len(values)} {field} for {len(vertices)} vertices"
                raise InputError(f"mesh {self.name!r}", found, "give one per vertex")
            self._freeze(field, values)
        if self.colors is not None and not ((self.colors >= 0) & (self.colors <= 1)).all():
            raise InputError(
                f"mesh {self.name!r}", "a color of a vertex is not in 0 to 1", "give linear RGB and opacity"
            )

    def _array(self, field: str, value: Any, dtype: Any, columns: int) -> npt.NDArray[Any]:
        try:
            array = np.array(value, order="C")
            if dtype is np.int32 and array.size and (array.dtype.kind not in "iu" or np.abs(array).max() > MAX_INDEX):
                raise ValueError
            array = array.astype(dtype)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"mesh {self.name!r}", f"{field} are not numbers of {np.dtype(dtype)}", "check the arrays"
            ) from None
        if array.size == 0:
            array = array.reshape(0, columns)
        if array.ndim != 2 or array.shape[1] != columns:
            raise InputError(f"mesh {self.name!r}", f"{field} of shape {array.shape}", f"give shape (n, {columns})")
        return array

    def _freeze(self, field: str, array: npt.NDArray[Any]) -> None:
        array.setflags(write=False)
        object.__setattr__(self, field, array)

    def __repr__(self) -> str:
        return f"Mesh({self.name!r}, {len(self.vertices)} vertices, {len(self.faces)} faces)"

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Diagnosis of the mesh: its defects, and whether it bounds a solid."""
        return diagnose(self.vertices, self.faces)

    @cached_property
    def bounds(self) -> Array:
        """(2, 3): smallest and largest coordinates of the vertices that faces use."""
        used = self.vertices[used_vertices(self.faces)]
        bounds = np.stack([used.min(axis=0), used.max(axis=0)])
        bounds.setflags(write=False)
        return bounds

    @cached_property
    def center(self) -> Array:
        """(3,): center of the bounding box."""
        center = np.asarray(0.5 * self.bounds[0] + 0.5 * self.bounds[1])
        center.setflags(write=False)
        return center

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box in metres."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def volume(self) -> float:
        """Signed volume in cubic metres."""
        return self.diagnosis.volume

    @cached_property
    def face_normals(self) -> Array:
        """(m, 3): unit normals of the faces, towards the side from which they are counter-clockwise; 0 without area."""
        a, b, c = self.vertices[self.faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        return np.asarray(
            normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        )

    @cached_property
    def vertex_normals(self) -> Array:
        """(n, 3): unit normals, the mean of the face normals weighted by the angle at the vertex."""
        corners = self.vertices[self.faces]
        normals = np.zeros_like(self.vertices)
        for i in range(3):
            a, b = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
            np.add.at(normals, self.faces[:, i], self.face_normals * angle[:, None])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.where(length > 0, normals / np.where(length > 0, length, 1.0), (0.0, 0.0, 1.0))

    def winding_number(self, point: npt.ArrayLike) -> float:
        """Winding number of the surface around `point`: 0 outside, 1 inside, a fraction on it or near a hole."""
        return winding_number(self.vertices[self.faces], point)

    def is_near(self, point: npt.ArrayLike, distance: float) -> bool:
        """Whether the surface comes within `distance` metres of `point`."""
        from trimesh.triangles import closest_point

        corners, target = self.vertices[self.faces], np.asarray(point, dtype=np.float64)
        near = ((corners.min(axis=1) <= target + distance) & (corners.max(axis=1) >= target - distance)).all(axis=1)
        if not near.any():
            return False
        nearest = closest_point(corners[near], np.broadcast_to(target, (int(near.sum()), 3)))
        return bool((np.linalg.norm(nearest - target, axis=1) <= distance).any())

    def summary(self) -> dict[str, object]:
        """Summary of the mesh as values that JSON can hold; lengths in metres."""
        found = self.diagnosis
        return {
            "name": self.name,
            "vertices": len(self.vertices),
            "faces": len(self.faces),
            "bounds": self.bounds.tolist(),
            "volume": found.volume if found.solid else None,
            "solid": found.solid,
            "convex": found.convex,
            "components": found.components,
            "problems": list(found.problems),
            "repairs": list(self.repairs),
        }

    def require_finite(self) -> None:
        """Raise `InputError` if coordinates are not finite, or the mesh is too large or small for float32."""
        if self._refusal is not None:
            raise InputError(f"mesh {self.name!r}", *self._refusal)

    @cached_property
    def _refusal(self) -> tuple[str, str] | None:
        """Reason why coordinates cannot be used, and advice; found once for all objects that share the mesh."""
        bad = np.flatnonzero(~np.isfinite(self.vertices).all(axis=1))
        if len(bad):
            return f"{len(bad)} vertices are not finite (first: {bad[0]})", "export the mesh again"
        if (largest := float(np.abs(self.vertices).max())) > MAX_COORDINATE:
            found = f"a coordinate of {largest:.3g} m, beyond {MAX_COORDINATE:g} m"
            return found, "give the file's unit (--unit), or scale the mesh"
        if self.diagonal < MIN_DIAGONAL:
            return "all its vertices are at one point", "export the mesh again"
        return None


def mended(raw: Mesh) -> Mesh:
    """Weld `raw` and wind it consistently, with its repairs on record."""
    corners = raw.vertices[raw.faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    # A stray vertex far away makes the diagonal huge; what is short beside the usual edge is still one point.
    same = weld(raw.vertices, min(WELD_TOLERANCE * raw.diagonal, WELD_EDGE_SHARE * float(np.median(edges))))
    faces, flipped, turned = orient(raw.vertices, same[raw.faces].astype(np.int32))
    reversed_face = (faces != same[raw.faces]).any(axis=1)
    split_faces = np.where(reversed_face[:, None], raw.faces[:, ::-1], raw.faces)
    repairs = []
    positions = raw.vertices[same]
    carried = [values for values in (raw.uv, raw.colors) if values is not None]
    index, vertices, uv, colors = same, positions, raw.uv, raw.colors
    if carried:
        groups = equal_rows(np.column_stack([same, *carried]))
        index = groups.first[groups.of]
    kept = used_vertices(index[split_faces])
    renumbered = np.zeros(len(index), dtype=np.int32)
    renumbered[kept] = np.arange(len(kept))
    if (merged := len(raw.vertices) - len(kept)) > 0:
        repairs.append(f"welded {merged} of {len(raw.vertices)} vertices (within {WELD_TOLERANCE:g} of the diagonal)")
    if flipped:
        repairs.append(f"turned {flipped} of {len(faces)} faces to agree with their neighbors")
    if turned:
        repairs.append(f"turned {turned} closed part{'s' if turned > 1 else ''} outwards")
    if flipped or turned:
        warnings.warn(
            f"mesh {raw.name!r}: {'; '.join(repairs[-(bool(flipped) + bool(turned)) :])}",
            TranslucentWarning,
            stacklevel=3,
        )
    return Mesh(
        vertices[kept],
        renumbered[index[split_faces]],
        None if uv is None else uv[kept],
        name=raw.name,
        repairs=tuple(repairs),
        colors=None if colors is None else colors[kept],
    )
