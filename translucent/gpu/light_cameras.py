"""Cameras that look from the lights of a scene, and keys by which views from lights are kept while these see the same.

Lists of crossings (`LightViewsPass`) and maps of shadows (`ShadowMapsPass`) have views of their own: lists fit the
media, where their texels count, and maps all that throws shadows, large as it may be.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import numpy as np

from translucent.arrays import Array
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
            seen = (points - position) @ pose[:3, :3]  # right, up, backward
            aside, ahead = np.abs(seen[:, :2]).max(axis=1), -seen[:, 2]
            with np.errstate(over="ignore"):
                return np.asarray(np.divide(aside, ahead, out=np.full(len(seen), np.inf), where=ahead > 0.0)[:, None])

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
    """Key of where a light is, and where it shines."""
    if isinstance(light, DirectionalLight):
        return DirectionalLight, np.asarray(light.direction).tobytes()
    # The view of a spot is no wider than its cone.
    return type(light), np.asarray(light.position).tobytes(), light.cone.tobytes()


def objects_key(scene: Scene) -> tuple[object, ...]:
    """Key of where the objects of a scene are, equal for scenes in which lights meet the same; keeps nothing alive.

    It does not tell media apart.
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
