"""Triangle meshes: immutable values with their geometry in float64."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked, vectors
from translucent.arrays import Array, Frozen, Integers
from translucent.errors import InputError, TranslucentWarning
from translucent.geometry.diagnosis import Diagnosis, diagnose
from translucent.geometry.foreign import foreign_name, foreign_parts, unit_of
from translucent.geometry.grouping import CHUNK, equal_rows, extent, use_mask
from translucent.geometry.repair import WELD_EDGE_FRACTION, WELD_TOLERANCE, all_apart, orient, weld
from translucent.geometry.winding import winding_number
from translucent.threads import import_trimesh
from translucent.units import size_note

#: Largest index of a vertex.
MAX_INDEX = 2**31 - 1

#: Largest coordinate in metres whose square still fits into float32.
MAX_COORDINATE = 1e18
#: Smallest diagonal in metres whose square is not lost in float32.
MIN_DIAGONAL = 1e-18

#: Least part of a mesh's area that is called a plane.
LEAST_PLANE = 1.0 / 256.0

#: Steps of the normals of planes, and of their heights in radii of the mesh, up to 1: coarser than float32 rounds.
PLANE_STEPS = 20_000

#: Bytes of memory that welding, winding and diagnosing take at most for each triangle, with the mesh itself.
PER_TRIANGLE = 150

#: Key under which `mended` notes what `diagnose` then need not find out again; no field, since copies may differ.
_ONE_CLOSED_PART = "_one_closed_part"


@checked
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
    assumed_unit : str
        Unit that `load_mesh` took coordinates to be in, since neither their file nor its caller named one.

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
    assumed_unit: str = ""

    def __post_init__(self) -> None:
        self._settle(copy=True)

    def _settle(self, copy: bool) -> None:
        """Check all arguments, and store them as read-only arrays."""
        vertices = self._array("vertices", self.vertices, np.float64, 3, copy)
        faces = self._array("faces", self.faces, np.int32, 3, copy)
        if len(faces) == 0:
            raise InputError(f"mesh {self.name!r}", "the mesh has no faces", "use a mesh of triangles")
        if faces.min() < 0 or faces.max() >= len(vertices):
            bad = int(np.flatnonzero((faces < 0).any(axis=1) | (faces >= len(vertices)).any(axis=1))[0])
            raise InputError(
                f"mesh {self.name!r}",
                f"face {bad} = {tuple(faces[bad].tolist())} refers to points outside the {len(vertices)} vertices",
                "export the mesh again",
            )
        self._freeze("vertices", vertices)
        self._freeze("faces", faces)
        for field, columns in (("uv", 2), ("colors", 4)):
            if (given := getattr(self, field)) is None:
                continue
            values = self._array(field, given, np.float64, columns, copy)
            if len(values) != len(vertices):
                found = f"{len(values)} {field} for {len(vertices)} vertices"
                raise InputError(f"mesh {self.name!r}", found, "give one value per vertex")
            self._freeze(field, values)
        if self.colors is not None and not ((self.colors >= 0) & (self.colors <= 1)).all():
            raise InputError(
                f"mesh {self.name!r}", "a vertex color is outside 0 to 1", "give linear RGB, and opacity if present"
            )

    def _array(self, field: str, value: Any, dtype: Any, columns: int, copy: bool) -> npt.NDArray[Any]:
        try:
            array = np.asarray(value, order="C")
            if dtype is np.int32 and array.size and (array.dtype.kind not in "iu" or _beyond_indices(array)):
                raise ValueError
            array = array.astype(dtype, order="C", copy=copy)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"mesh {self.name!r}",
                f"the values of {field} cannot be converted to {np.dtype(dtype)}",
                "check the arrays of the mesh",
            ) from None
        if array.size == 0:
            array = array.reshape(0, columns)
        if array.ndim != 2 or array.shape[1] != columns:
            raise InputError(
                f"mesh {self.name!r}", f"{field} has the shape {array.shape}", f"use the shape (n, {columns})"
            )
        return array

    @classmethod
    def _adopted(cls, thing: Any) -> Mesh | None:
        """Mesh of one of another library, for `checked`: all public functions that take a mesh take these, too."""
        return mesh_of(thing)

    def __repr__(self) -> str:
        about = f"{len(self.vertices)} vertices, {len(self.faces)} faces"
        return f"Mesh({self.name!r}, {about}{f'; {size}' if (size := size_note(self, way='argument')) else ''})"

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Diagnosis of the mesh: its defects, and whether it bounds a solid."""
        return diagnose(self.vertices, self.faces, self.__dict__.get(_ONE_CLOSED_PART, False))

    @cached_property
    def bounds(self) -> Array:
        """(2, 3): smallest and largest coordinates of the vertices that faces use."""
        bounds = extent(self._used)
        bounds.setflags(write=False)
        return bounds

    @property
    def _used(self) -> Array:
        used = use_mask(self.faces, len(self.vertices))
        return self.vertices if used.all() else self.vertices[used]

    @cached_property
    def center(self) -> Array:
        """(3,): center of the bounding box."""
        center = np.asarray(0.5 * self.bounds[0] + 0.5 * self.bounds[1])
        center.setflags(write=False)
        return center

    @cached_property
    def radius(self) -> float:
        """Distance of the farthest vertex from the center of the bounding box in metres."""
        away = self._used - self.center
        return float(np.sqrt(np.einsum("ij,ij->i", away, away).max()))

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box in metres."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def volume(self) -> float:
        """Signed volume in cubic metres."""
        return self.diagnosis.volume

    @cached_property
    def area(self) -> float:
        """Area of the surface in square metres."""
        return surface_area(self.vertices, self.faces)

    @cached_property
    def face_normals(self) -> Array:
        """(m, 3): unit normals of the faces, towards the side from which they are counter-clockwise; 0 without area."""
        return unit_normals(self.vertices, self.faces)

    @cached_property
    def planes(self) -> tuple[Integers, ...]:
        """Numbers of the faces in each plane that holds at least `LEAST_PLANE` of the area."""
        first = self.vertices[self.faces[:, 0]]
        height = np.einsum("ij,ij->i", first - self.center, self.face_normals) / self.radius
        steps = np.rint(np.column_stack([self.face_normals, height]) * PLANE_STEPS).astype(np.int64) + PLANE_STEPS
        _, group = np.unique(steps @ (2 * PLANE_STEPS + 1) ** np.arange(4), return_inverse=True)
        across, along = (self.vertices[self.faces[:, i]] - first for i in (1, 2))
        area = np.bincount(group, 0.5 * np.linalg.norm(np.cross(across, along), axis=1))
        return tuple(np.flatnonzero(group == one) for one in np.flatnonzero(area >= LEAST_PLANE * self.area))

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

    @checked
    def winding_number(self, point: npt.ArrayLike) -> float:
        """Winding number of the surface around `point`: 0 outside, 1 inside, a fraction on it or near a hole."""
        return winding_number(self.vertices[self.faces], _point(point))

    @checked
    def is_near(self, point: npt.ArrayLike, distance: float) -> bool:
        """True if the surface comes within `distance` metres of `point`."""
        triangles = import_trimesh("trimesh.triangles")

        corners, target = self.vertices[self.faces], _point(point)
        near = ((corners.min(axis=1) <= target + distance) & (corners.max(axis=1) >= target - distance)).all(axis=1)
        if not near.any():
            return False
        nearest = triangles.closest_point(corners[near], np.broadcast_to(target, (int(near.sum()), 3)))
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
        largest = float(np.abs(extent(self.vertices)).max())
        if not math.isfinite(largest):
            bad = np.flatnonzero(~np.isfinite(self.vertices).all(axis=1))
            return f"{len(bad)} vertices are not finite (first: {bad[0]})", "export the mesh again"
        if largest > MAX_COORDINATE:
            found = f"a coordinate is {largest:.3g} m, beyond the limit of {MAX_COORDINATE:g} m"
            return found, "state the unit of the file (--unit), or scale the mesh"
        if self.diagonal < MIN_DIAGONAL:
            return "all vertices of the mesh are at one point", "export the mesh again"
        return None


def _point(point: npt.ArrayLike) -> Array:
    found = vectors("point", point)
    if found.ndim != 1:
        raise InputError(
            f"point of shape {found.shape}", "the array holds more than one point", "give one point (x, y, z)"
        )
    return found


def surface_area(vertices: Array, faces: npt.NDArray[np.integer]) -> float:
    """Sum of the areas of triangles by their vertices (n, 3) and faces (m, 3)."""
    first = vertices[faces[:, 0]]
    across = np.cross(vertices[faces[:, 1]] - first, vertices[faces[:, 2]] - first)
    return 0.5 * float(np.linalg.norm(across, axis=1).sum())


def unit_normals(vertices: Array, faces: npt.NDArray[np.integer]) -> Array:
    """(m, 3): unit normals of faces, as `Mesh.face_normals`."""
    found = np.empty(faces.shape)
    for begin in range(0, len(faces), CHUNK):
        a, b, c = vertices[faces[begin : begin + CHUNK]].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        length = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        found[begin : begin + CHUNK] = normals / length
    return found


def _beyond_indices(array: npt.NDArray[Any]) -> bool:
    return int(array.max()) > MAX_INDEX or int(array.min()) < -MAX_INDEX


def adopted(vertices: Array, faces: npt.NDArray[np.int32], uv: Array | None, name: str, **others: Any) -> Mesh:
    """Make a mesh that takes ownership of arrays, which are checked but not copied."""
    given = {"uv": uv, "name": name, "repairs": (), "colors": None, "assumed_unit": ""} | others
    mesh = object.__new__(Mesh)
    mesh.__dict__.update(vertices=vertices, faces=faces, **given)
    mesh._settle(copy=False)
    return mesh


def mesh_of(thing: object, unit: str | None = None) -> Mesh | None:
    """Mesh of one of another library, welded and wound; None if the object is none. See `translucent.load_mesh`."""
    if (parts := foreign_parts(thing)) is None:
        return None
    name, (metres, assumed) = foreign_name(thing), unit_of(thing, unit)
    vertices, faces, uv = joined(parts, f"mesh {name!r}")
    raw = adopted(vertices * metres, faces, uv, name, assumed_unit=assumed)
    raw.require_finite()
    return mended(raw)


def mended(raw: Mesh) -> Mesh:
    """Weld `raw` and wind it consistently, with its repairs on record."""
    same = _welded(raw)
    welded = raw.faces if same is None else same[raw.faces].astype(np.int32)
    faces, flipped, turned, one_closed_part = orient(raw.vertices, welded)
    split_faces = raw.faces
    if flipped or turned:
        split_faces = np.where((faces != welded).any(axis=1)[:, None], raw.faces[:, ::-1], raw.faces)
    index = same
    if same is not None and (carried := [values for values in (raw.uv, raw.colors) if values is not None]):
        groups = equal_rows(np.column_stack([same, *carried]))
        index = groups.first[groups.of]
    used = use_mask(split_faces if index is None else index[split_faces], len(raw.vertices))
    one_closed_part &= index is same
    if used.all() and not flipped and not turned:
        raw.__dict__[_ONE_CLOSED_PART] = one_closed_part
        return raw
    kept, repairs = np.flatnonzero(used), []
    if (merged := len(used) - len(kept)) > 0:
        repairs.append(f"welded {merged} of {len(raw.vertices)} vertices (within {WELD_TOLERANCE:g} of the diagonal)")
    if flipped:
        repairs.append(f"flipped {flipped} of {len(faces)} faces to match their neighbors")
    if turned:
        repairs.append(f"flipped {turned} closed part{'s' if turned > 1 else ''} outwards")
    if flipped or turned:
        warnings.warn(
            f"mesh {raw.name!r}: {'; '.join(repairs[-(bool(flipped) + bool(turned)) :])}",
            TranslucentWarning,
            stacklevel=4,
        )
    if merged:
        renumbered = np.cumsum(used, dtype=np.int32) - np.int32(1)
        split_faces = renumbered[split_faces if index is None else index[split_faces]]
    # Of vertices that are welded to one, its position is the first one's.
    positions = raw.vertices[kept if same is None else same[kept]]
    uv, colors = (None if values is None else values[kept] for values in (raw.uv, raw.colors))
    mesh = adopted(
        positions,
        split_faces,
        uv,
        raw.name,
        repairs=tuple(repairs),
        colors=colors,
        assumed_unit=raw.assumed_unit,
    )
    mesh.__dict__[_ONE_CLOSED_PART] = one_closed_part
    return mesh


def _welded(raw: Mesh) -> npt.NDArray[np.int64] | None:
    """(n,): the vertex that replaces each one; None where all stay."""
    reach = WELD_TOLERANCE * raw.diagonal
    if all_apart(raw.vertices, reach):
        return None
    # A stray vertex far away makes the diagonal huge; what is short beside the usual edge is still one point.
    return weld(raw.vertices, reach, lambda: WELD_EDGE_FRACTION * _median_edge(raw))


def _median_edge(mesh: Mesh) -> float:
    """Median length of the sides of all faces."""
    lengths = np.empty((len(mesh.faces), 3))
    for begin in range(0, len(lengths), CHUNK):
        corners = mesh.vertices.take(mesh.faces[begin : begin + CHUNK], axis=0)
        lengths[begin : begin + CHUNK] = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(lengths, overwrite_input=True))


#: Raw triangles: vertices (n, 3), faces (m, 3), and texture coordinates (n, 2) if there are some.
Triangles = tuple[Array, npt.NDArray[np.int32], Array | None]


def joined(parts: list[Triangles], requested: str) -> Triangles:
    """Concatenate the triangles of all parts; raises `InputError` if there are none."""
    if not parts:
        raise InputError(requested, "the mesh has no faces", "use a mesh of triangles, not of points or lines")
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts[:-1])])
    faces = [part.astype(np.int64) + start for (_, part, _), start in zip(parts, starts.tolist(), strict=True)]
    uv = [coordinates for _, _, coordinates in parts if coordinates is not None]
    return (
        np.concatenate([vertices for vertices, _, _ in parts]),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(uv) if len(uv) == len(parts) else None,
    )
