"""Cameras at the lights of a scene, and cache keys of the views from lights.

Lists of crossings (`LightViewsPass`) and maps of shadows (`ShadowMapsPass`) have views of their own: lists fit the
media, where their texels count, and maps all that throws shadows, large as it may be.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Mask
from translucent.geometry.support import Support, largest_of
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight, SpotLight
from translucent.scene.scene import Light, Object, Scene

#: Factor by which the frame of a view is larger than its content: interpolation needs neighbors.
_MARGIN = 1.02

#: Widest view of a point light, in degrees; one that needs a wider view gets six instead.
_WIDEST = 110.0

#: Smallest angle of a view, in degrees, for media as small as a point.
_NARROWEST = 1e-6

#: Directions of the six views, as `light_view_towards` in ``shaders/volume/light_views.glsl`` numbers them.
_CUBE = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


def media_sphere(scene: Scene) -> tuple[Array, float]:
    """Center (3,) and radius of a sphere around all media, in metres."""
    boxes = np.stack([body.bounds for body in scene.bodies])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low)) or 1.0


def support_of(item: Object) -> Support:
    """Support of an object in the world."""
    return Support(item.mesh, item.matrix)


def light_cameras(light: Light, scene: Scene) -> list[Camera]:
    """Cameras of a light: one that sees all media, or six where the light is among them or close by."""
    return cameras_towards([support_of(body) for body in scene.bodies], light, *media_sphere(scene))


def cameras_towards(supports: Sequence[Support], light: Light, center: Array, radius: float) -> list[Camera]:
    """Cameras of a light: one that sees objects in a ball, or six where the light is among or near them.

    One of a spot may see the cone alone, where that is narrower.
    """
    if isinstance(light, DirectionalLight):
        direction = np.asarray(light.direction)
        eye = center - 2.0 * radius * direction
        pose = Camera.orthographic(eye, center, up=_any_up(direction)).pose

        def across(points: Array) -> Array:
            sides = pose[:3, :2].T @ points.T
            return np.concatenate([-sides, sides]).T

        ends = largest_of(supports, across)
        low, high = (bound - pose[:3, :2].T @ center for bound in (-ends[:2], ends[2:]))
        middle, extent = 0.5 * (low + high), float((high - low).max()) or radius
        eye = eye + pose[:3, :2] @ middle
        return [Camera.orthographic(eye, eye + direction, up=_any_up(direction), height=extent * _MARGIN)]
    position = np.asarray(light.position)
    towards = center - position
    found = _cone_camera(light, max(float(np.linalg.norm(towards)), radius)) if isinstance(light, SpotLight) else None
    widest = _WIDEST if found is None or found.fov_y is None else found.fov_y
    if (distance := float(np.linalg.norm(towards))) > 0:
        pose = Camera.look_at(position, center, up=_any_up(towards)).pose

        def tangents(points: Array) -> Array:
            local = (points - position) @ pose[:3, :3]  # right, up, backward
            aside, ahead = np.abs(local[:, :2]).max(axis=1), -local[:, 2]
            with np.errstate(over="ignore"):
                return np.asarray(np.divide(aside, ahead, out=np.full(len(local), np.inf), where=ahead > 0.0)[:, None])

        tangent = float(largest_of(supports, tangents)[0]) * _MARGIN
        if (angle := 2.0 * float(np.degrees(np.arctan(tangent)))) < widest:
            return [Camera.look_at(position, center, up=_any_up(towards), fov_y=max(angle, _NARROWEST))]
    if found is not None:
        return [found]
    reach = max(distance, radius)
    return [
        Camera.look_at(position, position + reach * np.array(axis), up=_any_up(np.array(axis)), fov_y=91.0)
        for axis in _CUBE
    ]


def _cone_camera(light: SpotLight, reach: float) -> Camera | None:
    """Camera that sees the cone of a spot; None if that is too wide for one."""
    angle = 2.0 * float(np.degrees(np.arctan(_MARGIN * np.tan(np.radians(light.outer_cone)))))
    if angle >= _WIDEST:
        return None
    direction = np.asarray(light.direction)
    position = np.asarray(light.position)
    return Camera.look_at(position, position + reach * direction, up=_any_up(direction), fov_y=angle)


def _any_up(direction: Array) -> Array:
    """Coordinate axis that is far from a direction."""
    return np.asarray(np.eye(3)[int(np.abs(direction).argmin())])


def light_key(light: Light) -> tuple[object, ...]:
    """Key of the position and direction of a light."""
    if isinstance(light, DirectionalLight):
        return DirectionalLight, np.asarray(light.direction).tobytes()
    # The view of a spot is no wider than its cone.
    return type(light), np.asarray(light.position).tobytes(), light.cone.tobytes()


def objects_key(scene: Scene) -> tuple[object, ...]:
    """Key of where the objects of a scene are, equal for scenes in which lights hit the same; keeps nothing alive.

    Media do not count.
    """
    objects = tuple(
        (
            weakref.ref(item.mesh),
            item.matrix.tobytes(),
            item.priority,
            item.sheet_thickness,
            item.covers,
            item.medium is None,
            item.medium is None and item.surface,  # it may have holes
            None if item.density is None else weakref.ref(item.density),
        )
        for item in scene.objects
    )
    return objects, scene.overlap


#: Faces times vertices up to which an object is looked at, whether it shadows itself.
_MOST_PAIRS = 1 << 22

#: Distance behind a face, as a fraction of the scene, that is rounding.
_BEHIND = 1e-6


def holds_eye(item: Object, scene: Scene) -> bool:
    """True if the eye is in the bounds of an object, so that its inner side may be visible."""
    low, high = item.bounds
    return bool((low <= scene.camera.eye).all() and (scene.camera.eye <= high).all())


#: Opaque objects that are found to be grounds at most: each is compared with all others. Further ones throw shadows as
#: what is no ground does.
MOST_GROUNDS = 1024


class _Stack:
    """Rows of many objects in one array, which grows."""

    def __init__(self, width: int) -> None:
        self._array = np.empty((64, width))
        self._starts: list[int] = []
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, rows: Array) -> None:
        """Add the rows (n, width) of an object, one or more."""
        self._starts.append(self._count)
        self._count += len(rows)
        if self._count > len(self._array):
            self._array = np.concatenate([self.rows[: self._starts[-1]], np.empty((self._count, rows.shape[1]))])
        self._array[self._starts[-1] : self._count] = rows

    @property
    def rows(self) -> Array:
        """(n, width): of all objects."""
        return self._array[: self._count]

    def every(self, which: Mask) -> Mask:
        """(objects, ...): whether `which` (n, ...) is true of all rows of each object."""
        return np.logical_and.reduceat(which, self._starts) if self._starts else which[:0]


class _Supports:
    """Supports of many objects: the points of small ones in one array."""

    def __init__(self) -> None:
        self._few, self._many, self._small = _Stack(3), list[tuple[int, Support]](), list[int]()
        self.count = 0

    def add(self, support: Support) -> None:
        """Add the bounds of an object."""
        number = len(self._small) + len(self._many)
        if support.many:
            self._many.append((number, support))
        else:
            self._small.append(number)
            self._few.add(support.points)
        self.count += support.count

    def ahead(self, planes: Array, slack: float) -> Mask:
        """(objects, faces): whether all of an object is before each of the planes (faces, 4)."""
        found = np.empty((len(self._small) + len(self._many), len(planes)), dtype=bool)
        found[self._small] = self._few.every(_distances(self._few.rows, planes) >= -slack)
        for number, support in self._many:
            found[number] = _ahead(support, planes, slack)
        return found


def _distances(points: Array, planes: Array) -> Array:
    """(n, faces): distances of points (n, 3) before planes (faces, 4)."""
    return np.asarray(points @ planes[:, :3].T - planes[:, 3])


def _ahead(support: Support, planes: Array, slack: float) -> Mask:
    """(faces,): whether all of an object is before planes (faces, 4), but for rounding."""
    if not support.many:
        return np.asarray((_distances(support.points, planes) >= -slack).all(axis=0))
    return np.asarray(-support.largest(lambda points: -_distances(points, planes)) >= -slack)


@dataclass(frozen=True, eq=False)
class _Sides:
    """Planes of the faces of an object: normal, and its product with a point of the face.

    Attributes
    ----------
    planes : (faces, 4) float64
        Towards the light.
    lit : (n, 4) float64
        Of faces that the light reaches from outside.
    """

    planes: Array
    lit: Array


class ShadowOccluders:
    """Objects that throw shadows in the light of one light, and objects that only receive them.

    Parameters
    ----------
    light : Light
    scene : Scene
    supports : sequence of Support
        Of its objects.

    Attributes
    ----------
    grounds : tuple of int
        Opaque objects that shadow neither themselves nor one another, large as they may be.
    middle : (3,) float64
        Of all but the grounds.
    blocking : tuple of int
        Opaque objects that may be between the light and another object, or themselves: all but grounds before which
        everything is.
    """

    def __init__(self, light: Light, scene: Scene, supports: Sequence[Support]) -> None:
        self._light, self._scene, self._supports = light, scene, supports
        self._sides: dict[int, _Sides] = {}
        self._slack = _BEHIND * scene.diagonal
        self.grounds = self._found_grounds()
        everything = _Supports()
        for support in supports:
            everything.add(support)
        shadowed = {i for i in self.grounds if not self._lights(i, everything, range(len(supports)))}
        opaque = set(np.flatnonzero(~scene.filled).tolist())
        self.blocking = tuple(sorted(opaque - set(self.grounds) | shadowed))
        grounds = set(self.grounds)
        self._throwing = [support for i, support in enumerate(supports) if i not in grounds]
        bounds = np.array([support.bounds for support in self._throwing or supports])
        self._low, self._high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        self.middle = 0.5 * (self._low + self._high)

    def cameras(self) -> list[Camera]:
        """Cameras of a light that cover all objects except grounds; points outside their view are lit."""
        if not self._throwing:
            return []
        radius = 0.5 * float(np.linalg.norm(self._high - self._low)) or self._scene.diagonal or 1.0
        cameras = cameras_towards(self._throwing, self._light, self.middle, radius)
        if not isinstance(self._light, DirectionalLight):
            return cameras
        # Grounds may be nearer to the light: they end its rays there.
        (camera,) = cameras
        nearer = float(largest_of(self._supports, lambda points: ((camera.eye - points) @ camera.forward)[:, None])[0])
        pose = camera.pose.copy()
        pose[:3, 3] -= max(nearer, 0.0) * camera.forward
        return [replace(camera, pose=pose)]

    def _found_grounds(self) -> tuple[int, ...]:
        """Numbers of the grounds."""
        grounds: list[int] = []
        found, planes, most_faces = _Supports(), _Stack(4), 0
        # Large ones first: leaving those out makes the texels of maps smaller.
        sizes = {
            i: -float(np.ptp(self._supports[i].bounds, axis=0).max())
            for i in np.flatnonzero(~self._scene.filled).tolist()
        }
        for i in sorted(sizes, key=sizes.__getitem__):
            faces, own = len(self._scene.objects[i].mesh.faces), self._supports[i]
            if max(faces * (found.count + own.count), most_faces * own.count) > _MOST_PAIRS:
                continue
            if not self._lights_one(i, i) or not self._lights(i, found, grounds):
                continue
            before = planes.every(_ahead(own, planes.rows, self._slack))
            if not all(self._lights_one(grounds[k], i) for k in np.flatnonzero(~before).tolist()):
                continue
            grounds.append(i)
            found.add(own)
            planes.add(self._sides_of(i).planes)
            most_faces = max(most_faces, faces)
            if len(grounds) == MOST_GROUNDS:
                break
        return tuple(grounds)

    def _lights(self, ground: int, supports: _Supports, others: Sequence[int]) -> bool:
        """True if an object shadows none of the others, whose supports these are; see `_lights_one`."""
        item = self._scene.objects[ground]
        if len(item.mesh.faces) * supports.count > _MOST_PAIRS:
            return False
        sides = self._sides_of(ground)
        lit = supports.ahead(sides.planes, self._slack).all(axis=1)
        if lit.all():
            return True
        if not self._is_convex_from_outside(item):
            return False
        lit |= supports.ahead(sides.lit, self._slack).any(axis=1)
        return all(others[k] == ground for k in np.flatnonzero(~lit).tolist())

    def _lights_one(self, ground: int, other: int) -> bool:
        """True if an object does not shadow another: that is before the lit sides of all its faces, or, of a convex
        one that the eye is not in, of some face.
        """
        item = self._scene.objects[ground]
        sides, support = self._sides_of(ground), self._supports[other]
        if _ahead(support, sides.planes, self._slack).all():
            return True
        if not self._is_convex_from_outside(item):
            return False
        # Of a convex body what faces the light is lit.
        return other == ground or bool(_ahead(support, sides.lit, self._slack).any())

    def _is_convex_from_outside(self, item: Object) -> bool:
        """True if an object is convex, and the eye is outside of its bounds."""
        return item.mesh.diagnosis.convex and not holds_eye(item, self._scene)

    def _sides_of(self, number: int) -> _Sides:
        """Planes of the faces of an object."""
        if number not in self._sides:
            item = self._scene.objects[number]
            first, normal, cosine = self._faces(item)
            distance = (first * normal).sum(axis=1, keepdims=True)
            planes = np.concatenate([normal, distance], axis=1)
            outwards = (-planes if item.faces_inwards else planes)[(cosine < 0) == item.faces_inwards]
            self._sides[number] = _Sides(planes * np.sign(cosine)[:, None], outwards)
        return self._sides[number]

    def _faces(self, item: Object) -> tuple[Array, Array, Array]:
        """First corners (m, 3) of the faces of an object, unit normals (m, 3), and their dot products (m,)
        with the directions to the light.
        """
        vertices = item.world_vertices
        first, second, third = (vertices[item.mesh.faces[:, corner]] for corner in range(3))
        normal = np.cross(second - first, third - first)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        if isinstance(self._light, DirectionalLight):
            towards = np.broadcast_to(-np.asarray(self._light.direction), normal.shape)
        else:
            towards = np.asarray(self._light.position) - first
        return first, normal, (normal * towards).sum(axis=1)
