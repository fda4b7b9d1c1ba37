"""Truth about pixels for tools/fuzz_validity.py: every face against every ray, in float64.

It shares no code with the renderers, the reference or the planner. It counts entries and exits on the whole ray, also
behind opaque surfaces, and knows what a mesh was before faces were taken out or turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import translucent as tl

Numbers = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

#: Pairs of a ray and a face that are looked at together.
PAIRS = 1 << 21


@dataclass(frozen=True, eq=False)
class Damaged:
    """A mesh, and what it was before.

    Attributes
    ----------
    mesh : Mesh
    intact : Mesh, optional
        Before the damage; None where that is not known.
    altered : (faces,) bool
        Faces of `intact` that were taken out or turned.
    """

    mesh: tl.Mesh
    intact: tl.Mesh | None = None
    altered: Mask | None = None


@dataclass(frozen=True, eq=False)
class Lines:
    """Rays of a picture: origins from the eye, directions, and how wide a pixel is, in radians or in metres."""

    origins: Numbers
    directions: Numbers
    pixel: float
    perspective: bool

    @classmethod
    def of(cls, camera: tl.Camera, size: tuple[int, int]) -> Lines:
        """Rays through the centers of pixels, row by row."""
        width, height = size
        half = np.tan(np.radians(camera.fov_y) / 2) if camera.fov_y is not None else camera.height / 2
        x = ((np.arange(width) + 0.5) / width * 2 - 1) * half * width / height
        y = (1 - (np.arange(height) + 0.5) / height * 2) * half
        right, down = (grid.ravel()[:, None] for grid in np.meshgrid(x, y))
        across = right * camera.right + down * camera.up
        if camera.fov_y is None:
            return cls(across, np.tile(camera.forward, (len(across), 1)), 2 * half / height, False)
        directions = across + camera.forward
        length = np.linalg.norm(directions, axis=1)
        # Pixels far from the axis are seen at smaller angles.
        return cls(np.zeros_like(across), directions / length[:, None], 2 * half / height / length.max() ** 2, True)


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings of rays with faces, in no order, and rays that pass too near to an edge of one.

    Attributes
    ----------
    ray : (k,) int64
    distance : (k,) float64
        Metres from the origin; below 0 behind it.
    sign : (k,) int64
        1 for entries, -1 for exits.
    face : (k,) int64
    near_edge : (rays,) bool
    """

    ray: Integers
    distance: Numbers
    sign: Integers
    face: Integers
    near_edge: Mask

    def count(self, chosen: Mask, rays: int) -> Integers:
        """(rays,): entries minus exits among the chosen crossings (k,)."""
        return np.bincount(self.ray[chosen], self.sign[chosen], rays).astype(np.int64)


def corners_from(eye: Numbers, body: tl.Object, mesh: tl.Mesh) -> Numbers:
    """(faces, 3, 3): corners of a mesh in place of the body's own, from the eye, counter-clockwise from outside."""
    matrix = np.asarray(body.transform, dtype=np.float64)
    world = mesh.vertices @ matrix[:3, :3].T + (matrix[:3, 3] - eye)
    # Which side of a closed mesh is its outside, is a question of definition where its volume is 0 up to rounding.
    turned = body.mesh.diagnosis.inverted != (np.linalg.det(matrix[:3, :3]) < 0)
    return world[mesh.faces[:, ::-1] if turned else mesh.faces]


def cross(corners: Numbers, lines: Lines, margin: float) -> Crossings:
    """Crossings of all rays with all faces; `margin` in pixels: rays that pass an edge nearer than that are named.

    A ray passes a face if the volumes that it spans with its three edges have one sign. Each is linear in the ray's
    direction or origin, so all of them are products of matrices.
    """
    count = len(lines.directions)
    near_edge = np.zeros(count, dtype=bool)
    parts = []
    step = max(PAIRS // count, 1)
    for begin in range(0, len(corners), step):
        own = corners[begin : begin + step]
        starts, ends = own, np.roll(own, -1, axis=1)
        moment = np.cross(starts, ends)
        if lines.perspective:
            normal, offset = moment, 0.0
            volumes = np.einsum("rd,fed->fer", lines.directions, normal, optimize=True)
        else:
            along = lines.directions[0]
            # d . ((a - o) x (b - o)) = d . (a x b) - o . ((b - a) x d)
            normal = np.cross(ends - starts, along)
            offset = moment @ along
            volumes = offset[..., None] - np.einsum("rd,fed->fer", lines.origins, normal, optimize=True)
        length = np.linalg.norm(normal, axis=2)[..., None]
        with np.errstate(all="ignore"):
            pixels = volumes / (length * lines.pixel)
        pixels[~np.isfinite(pixels)] = 0.0
        lowest, highest = pixels.min(axis=1), pixels.max(axis=1)
        maybe = (lowest > -margin) | (highest < margin)
        face, ray = np.nonzero(maybe)
        sure = (lowest[face, ray] > margin) | (highest[face, ray] < -margin)
        near_edge[ray[~sure]] = True
        face, ray = face[sure], ray[sure]
        a, b, c = own[face].transpose(1, 0, 2)
        plane = np.cross(b - a, c - a)
        facing = np.einsum("kd,kd->k", plane, lines.directions[ray])
        distance = np.einsum("kd,kd->k", plane, a - lines.origins[ray]) / facing
        ahead = (distance >= 0) | (not lines.perspective)
        parts.append((ray[ahead], distance[ahead], np.where(facing < 0, 1, -1)[ahead], face[ahead] + begin))
    return Crossings(*(np.concatenate(column) for column in zip(*parts, strict=True)), near_edge)


def winding_of_eye(corners: Numbers) -> int:
    """How often faces wind around the eye, rounded: the solid angles that it sees (van Oosterom & Strackee 1983)."""
    a, b, c = corners.transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("kd,kd->k", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return round(float(np.arctan2(volume, below).sum()) / (2 * np.pi))


def rims(mesh: tl.Mesh) -> Numbers:
    """(k, 3): ends of edges that are passed more often in one direction than in the other; none of a closed mesh."""
    points, of = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = of.reshape(-1)[mesh.faces]
    faces = faces[[len(set(face)) == 3 for face in faces.tolist()]]
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges, of = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    uneven = np.bincount(of.reshape(-1), np.where(sides[:, 0] < sides[:, 1], 1, -1), len(edges)) != 0
    return points[edges[uneven].ravel()]


@dataclass(frozen=True, eq=False)
class Truth:
    """True pixels of a picture, all arrays (h, w), optical depth (h, w, 3).

    Attributes
    ----------
    thickness, optical_depth
        Up to the first opaque surface, from all faces as they are.
    intact_thickness
        The same with the first body as it was before the damage; NaN where that is not known, or where a ray passes
        more than one of the faces that were taken out or turned, which may cancel.
    broken
        Some body's faces wind a negative number of times around a part of the ray that is longer than the tolerance, or
        entries and exits on the whole ray do not balance, and not all edges of holes are behind the opaque surface.
    unclear
        The ray passes next to an edge of a face.
    counted
        Faces on the whole ray.
    """

    thickness: Numbers
    optical_depth: Numbers
    intact_thickness: Numbers
    broken: Mask
    unclear: Mask
    counted: Integers

    @classmethod
    def of(
        cls, scene: tl.Scene, size: tuple[int, int], damaged: Damaged, end: Numbers, tolerance: float, margin: float
    ) -> Truth:
        """Truth about a scene whose first body is `damaged`.

        Parameters
        ----------
        scene : Scene
        size : (width, height)
        damaged : Damaged
        end : (h, w)
            Metres along the camera's axis at which a backdrop ends rays; inf where it does not.
        tolerance : float
            Metres that faces may wind negatively around.
        margin : float
            Pixels from an edge within which a ray is unclear.
        """
        camera = scene.camera
        lines = Lines.of(camera, size)
        rays = len(lines.directions)
        advance = lines.directions @ camera.forward
        wall = end.ravel() / advance
        found = [cross(corners_from(camera.eye, body, body.mesh), lines, margin) for body in scene.objects]
        unclear = np.any([line.near_edge for line in found], axis=0)
        counted = np.sum([np.bincount(line.ray, minlength=rays) for line in found], axis=0)
        shape = size[::-1]
        for body, line in zip(scene.objects, found, strict=True):
            if body.medium is None:
                ahead = line.distance >= 0
                np.minimum.at(wall, line.ray[ahead], line.distance[ahead])
        bodies = [i for i, body in enumerate(scene.objects) if body.medium is not None]
        starts, broken = {}, np.zeros(rays, dtype=bool)
        for i in bodies:
            body, line = scene.objects[i], found[i]
            starts[i] = _start(camera, body, body.mesh, line, rays)
            total = starts[i] + line.count(line.distance >= 0, rays)
            broken |= (total != 0) & (wall * advance >= _nearest_rim(camera, body))
        own = _Walk.along(scene, {i: found[i] for i in bodies}, starts, wall)
        broken |= own.negative > tolerance
        intact = np.full(rays, np.nan)
        if damaged.intact is not None and damaged.altered is not None:
            body = scene.objects[bodies[0]]
            whole = cross(corners_from(camera.eye, body, damaged.intact), lines, margin)
            unclear |= whole.near_edge
            begun = _start(camera, body, damaged.intact, whole, rays)
            altered = np.bincount(whole.ray[damaged.altered[whole.face]], minlength=rays)
            altered += np.abs(begun - starts[bodies[0]])
            found[bodies[0]], starts[bodies[0]] = whole, begun
            walk = _Walk.along(scene, {i: found[i] for i in bodies}, starts, wall)
            intact = np.where(altered <= 1, walk.thickness, np.nan)
        return cls(
            own.thickness.reshape(shape),
            own.depth.reshape(*shape, 3),
            intact.reshape(shape),
            broken.reshape(shape),
            unclear.reshape(shape),
            counted.reshape(shape),
        )


def _start(camera: tl.Camera, body: tl.Object, mesh: tl.Mesh, line: Crossings, rays: int) -> Integers:
    """(rays,): how often a mesh winds around the origins of rays."""
    if camera.fov_y is None:
        return line.count(line.distance < 0, rays)
    return np.full(rays, winding_of_eye(corners_from(camera.eye, body, mesh)))


def _nearest_rim(camera: tl.Camera, body: tl.Object) -> float:
    """Metres along the camera's axis to the nearest edge of a hole; inf without one."""
    points = rims(body.mesh)
    if not len(points):
        return np.inf
    matrix = np.asarray(body.transform)
    ahead = (points @ matrix[:3, :3].T + (matrix[:3, 3] - camera.eye)) @ camera.forward
    return float(ahead.min())


@dataclass(frozen=True, eq=False)
class _Walk:
    """Sums along rays up to the opaque surfaces: thickness, optical depth, and metres that are inside out."""

    thickness: Numbers
    depth: Numbers
    negative: Numbers

    @classmethod
    def along(cls, scene: tl.Scene, found: dict[int, Crossings], starts: dict[int, Integers], wall: Numbers) -> _Walk:
        bodies, rays = list(found), len(wall)
        ray = np.concatenate([found[i].ray for i in bodies])
        distance = np.concatenate([found[i].distance for i in bodies])
        sign = np.concatenate([found[i].sign for i in bodies])
        column = np.concatenate([np.full(len(found[i].ray), k) for k, i in enumerate(bodies)])
        keep = (distance >= 0) & (distance < wall[ray])
        order = np.lexsort((distance[keep], ray[keep]))
        ray, distance, sign, column = (array[keep][order] for array in (ray, distance, sign, column))
        winding = np.stack([starts[i] for i in bodies], axis=1)
        at = np.zeros(rays)
        walk = cls(np.zeros(rays), np.zeros((rays, 3)), np.zeros(rays))
        first = np.searchsorted(ray, np.arange(rays + 1))
        for number in range(int(np.diff(first).max(initial=0))):
            now = np.flatnonzero(first[:-1] + number < first[1:])
            event = first[now] + number
            walk._go(scene, bodies, now, winding[now], distance[event] - at[now])
            at[now] = distance[event]
            winding[now, column[event]] += sign[event]
        stopped = np.flatnonzero(np.isfinite(wall))
        walk._go(scene, bodies, stopped, winding[stopped], wall[stopped] - at[stopped])
        return walk

    def _go(self, scene: tl.Scene, bodies: list[int], rays: Integers, winding: Integers, metres: Numbers) -> None:
        """Add a part of each of some rays."""
        inside = np.maximum(winding, 0)
        extinction = np.array([scene.objects[i].medium.extinction for i in bodies])
        if scene.overlap == "priority":
            best = np.where(inside > 0, [scene.objects[i].priority for i in bodies], -np.inf)
            inside = ((inside > 0) & (best == best.max(axis=1, keepdims=True))).astype(np.int64)
            inside[np.cumsum(inside, axis=1) > 1] = 0
        elif scene.overlap == "union":
            inside = np.minimum(inside, 1)
            for k in range(1, len(bodies)):
                for j in range(k):
                    if (extinction[j] == extinction[k]).all():
                        inside[inside[:, j] > 0, k] = 0
        times = inside.max(axis=1) if scene.overlap == "union" else inside.sum(axis=1)
        self.thickness[rays] += times * metres
        self.depth[rays] += inside @ extinction * metres[:, None]
        self.negative[rays] += np.where((winding < 0).any(axis=1), metres, 0.0)
