"""All intersections of any rays with the objects of a scene, in float64.

Light paths do not come in pictures, so each ray has a plane of its own: shifted to its origin and sheared along it, a
mesh is seen as in `translucent.reference.hits`, and the same exact edge functions decide (Woop et al. 2013).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.geometry.bvh import curve_order
from translucent.geometry.ray_caster import point_from
from translucent.reference.hits import Hits, cross_triangles, sorted_hits
from translucent.scene.scene import Object, Scene

#: Number of children of a node.
BRANCHES = 8

#: Number of lines that walk down the tree together: the working arrays stay below 100 MB.
LINES_AT_A_TIME = 1 << 12

#: Pairs of a line and a node that are tested together: what NumPy keeps of them stays in the caches of a processor.
PAIRS = 1 << 10

#: Enlargement of boxes as a share of the distances, so that rounding loses no triangle.
BOX_MARGIN = 1e-13

#: Half size of an empty box, which no line meets.
_NOTHING = -1e300


@dataclass(frozen=True, eq=False)
class Lines:
    """Line segments, each from one distance to another.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In metres, and of unit length.
    start, end : (n,) float64
        Distances from the origin in metres; -inf and inf for all of the line.
    """

    origins: Array
    directions: Array
    start: Array
    end: Array

    def __len__(self) -> int:
        return len(self.directions)

    def where(self, chosen: Integers | slice) -> Lines:
        """Selection of lines by indices or a slice, renumbered."""
        return Lines(self.origins[chosen], self.directions[chosen], self.start[chosen], self.end[chosen])


@dataclass(frozen=True, eq=False)
class BoxTree:
    """Bounding volume hierarchy of triangles.

    Attributes
    ----------
    order : (m,) int64
        The triangle in each box of the lowest level.
    levels : tuple of (nodes, 6, 8) float64
        From the lowest level up: center and half size of the children of each node.
    """

    order: Integers
    levels: tuple[Array, ...]

    @classmethod
    def of(cls, corners: Array) -> BoxTree:
        """Build the tree of triangles (m, 3, 3), in the order of a space-filling curve (Morton 1966)."""
        low, high = corners.min(axis=1), corners.max(axis=1)
        order = curve_order(low, high)
        low, high = low[order], high[order]
        levels = []
        while True:
            starts = np.arange(0, len(low), BRANCHES)
            levels.append(_grouped(0.5 * (low + high), 0.5 * (high - low), len(starts)))
            low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
            if len(starts) == 1:
                return cls(order, tuple(levels))

    def candidates(self, lines: Lines) -> Iterator[tuple[Integers, Integers]]:
        """Chunks of pairs (k,), (k,) of a line and a triangle that may meet; all that do are among them."""
        for begin in range(0, len(lines), LINES_AT_A_TIME):
            line, triangle = self._walk(lines.where(slice(begin, begin + LINES_AT_A_TIME)))
            yield line + begin, triangle

    @np.errstate(under="ignore", over="ignore")
    def _walk(self, lines: Lines) -> tuple[Integers, Integers]:
        line, node = np.arange(len(lines)), np.zeros(len(lines), dtype=np.int64)
        slack = BOX_MARGIN * (
            np.abs(lines.origins).sum(axis=1) + np.abs(self.levels[-1][0]).max(where=self._real, initial=0)
        )
        for level in reversed(self.levels):
            met = [np.empty((2, 0), np.int64)]
            for begin in range(0, len(line), PAIRS):
                some, nodes = line[begin : begin + PAIRS], node[begin : begin + PAIRS]
                pair, child = np.nonzero(_meets(lines.where(some), level[nodes], slack[some]))
                met.append(np.array([some[pair], nodes[pair] * BRANCHES + child]))
            line, node = np.concatenate(met, axis=1)
        return line, self.order[node]

    @property
    def _real(self) -> npt.NDArray[np.bool_]:
        """(6, 8): mask of the children that the root has."""
        return np.broadcast_to(self.levels[-1][0, 3] != _NOTHING, (6, BRANCHES))


def _meets(lines: Lines, boxes: Array, slack: Array) -> npt.NDArray[np.bool_]:
    """(k, 8): whether lines may meet boxes (k, 6, 8), by the axes that could separate them (Gottschalk et al. 1996)."""
    x, y, z = (boxes[:, i] - lines.origins[:, i, None] for i in range(3))
    a, b, c = (boxes[:, i] for i in range(3, 6))
    u, v, w = (lines.directions[:, i, None] for i in range(3))
    p, q, r, s = np.abs(u), np.abs(v), np.abs(w), slack[:, None]
    along, reach = x * u + y * v + z * w, a * p + b * q + c * r + s
    meets = (along + reach >= lines.start[:, None]) & (along - reach <= lines.end[:, None])
    meets &= np.abs(y * w - z * v) <= b * r + c * q + s
    meets &= np.abs(z * u - x * w) <= c * p + a * r + s
    meets &= np.abs(x * v - y * u) <= a * q + b * p + s
    return np.asarray(meets)


def _grouped(center: Array, half: Array, nodes: int) -> Array:
    """(nodes, 6, 8): centers and half sizes (n, 3) of neighbors together; the last node may lack some."""
    children = np.zeros((nodes * BRANCHES, 6))
    children[:, 3:] = _NOTHING
    children[: len(center)] = np.hstack([center, half])
    return np.ascontiguousarray(children.reshape(nodes, BRANCHES, 6).transpose(0, 2, 1))


#: Enlargement of the scene's bounding sphere, as a share.
MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class TracedObject:
    """Object for ray casting, in metres from the eye.

    Attributes
    ----------
    body : Object
    corners : (m, 3, 3) float64
        Of its faces.
    """

    body: Object
    corners: Array

    @classmethod
    def of(cls, body: Object, eye: Array) -> TracedObject:
        """Object relative to `eye` (3,)."""
        x, y, z = (body.mesh.vertices - body.mesh.center).T[:, :, None] * body.matrix[:3, :3].T[:, None]
        # The mesh keeps its shape to the last digit wherever it is: only the one offset to the eye is large.
        corners = (x + y + z + point_from(body.mesh.center, body.matrix, eye))[body.mesh.faces]
        return cls(body, corners)

    @cached_property
    def tree(self) -> BoxTree:
        """Bounding volume hierarchy of the faces."""
        return BoxTree.of(self.corners)

    def hits(self, lines: Lines) -> Hits:
        """All surfaces on the lines; `Hits.pixel` is the number of the line."""
        hits = self.crossings(lines, self.tree.candidates(lines))
        return hits.where((hits.distance >= lines.start[hits.pixel]) & (hits.distance <= lines.end[hits.pixel]))

    def crossings(self, lines: Lines, candidates: Iterable[tuple[Integers, Integers]]) -> Hits:
        """Intersections of candidate pairs (k,), (k,) of a line and a face, anywhere on the line."""
        parts = []
        for line, face in candidates:
            seen = _sheared(self.corners[face] - lines.origins[line, None], lines.directions[line])
            keep, *found = cross_triangles(seen, np.ones(seen.shape[:2]), np.zeros((len(seen), 2)), perspective=False)
            parts.append((line[keep], face[keep], *found))
        return sorted_hits(parts, -1 if self.body.faces_inwards else 1)


class Tracer:
    """Ray caster for all objects of a scene.

    Parameters
    ----------
    scene : Scene
        Points are in metres from the eye of its camera, along the axes of the world.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.objects = [TracedObject.of(body, scene.camera.eye) for body in scene.objects]
        low = np.min([traced.corners.min(axis=(0, 1)) for traced in self.objects], axis=0)
        high = np.max([traced.corners.max(axis=(0, 1)) for traced in self.objects], axis=0)
        self.center = 0.5 * (low + high)
        self.radius = 0.5 * float(np.linalg.norm(high - low)) * (1.0 + MARGIN)

    def hits(self, lines: Lines) -> list[Hits]:
        """The surfaces of each object on the lines."""
        return [traced.hits(lines) for traced in self.objects]

    def ball(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Entry and exit of lines in the scene's bounding sphere: distances (n,), equal for lines that miss it."""
        to_center = self.center - origins
        middle = np.einsum("ki,ki->k", to_center, directions)
        across = np.linalg.norm(to_center - middle[:, None] * directions, axis=1)
        half = np.sqrt(np.maximum((self.radius - across) * (self.radius + across), 0.0))
        return middle - half, middle + half


def _sheared(vectors: Array, directions: Array) -> Array:
    """(k, 3, 3): vectors (k, 3, 3) in the frame of unit directions (k, 3): right, up, and the distance along the ray.

    Equal vectors give bit-equal results whatever triangle they belong to.
    """
    rows = np.arange(len(directions))
    forward = np.abs(directions).argmax(axis=1)
    right, up = (forward + 1) % 3, (forward + 2) % 3
    # As a camera does, look along -z of a right-handed frame.
    away = directions[rows, forward] > 0
    right, up = np.where(away, up, right), np.where(away, right, up)
    depth = directions[rows, forward][:, None]
    x, y, z = (vectors[rows, :, axis] for axis in (right, up, forward))
    with np.errstate(under="ignore"):
        distance = z / depth
        shear = directions[rows, right][:, None], directions[rows, up][:, None]
        return np.stack([x - shear[0] * distance, y - shear[1] * distance, distance], axis=-1)
