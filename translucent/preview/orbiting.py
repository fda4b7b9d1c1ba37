"""Movement of an orbiting camera: around its target, across the picture, and towards the cursor."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.preview.document import MAX_PITCH, Orbit
from translucent.scene.camera import MAX_COORDINATE, Camera
from translucent.scene.scene import Object
from translucent.scene.showcase import framing
from translucent.scene.stages import world_vertices

#: Factor by which an orthographic camera stands farther back, so that a model around the target is before it.
_STEP_BACK = 4.0

#: Smallest and largest distance of zooming, in metres.
_NEAREST, _FARTHEST = 1e-9, 1e12


def towards_camera(orbit: Orbit) -> Array:
    """(3,): unit vector from the target to the camera."""
    yaw, pitch = math.radians(orbit.yaw), math.radians(orbit.pitch)
    return np.array([math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)])


def camera_of(orbit: Orbit) -> Camera:
    """Camera of an orbit."""
    target = np.asarray(orbit.target)
    if orbit.orthographic:
        eye = target + _STEP_BACK * orbit.distance * towards_camera(orbit)
        return Camera.orthographic(eye, target, height=height_at_target(orbit))
    return Camera.look_at(target + orbit.distance * towards_camera(orbit), target, fov_y=orbit.fov_y)


def height_at_target(orbit: Orbit) -> float:
    """Height of the picture at the target in metres."""
    return 2.0 * orbit.distance * math.tan(math.radians(orbit.fov_y) / 2)


def turned(orbit: Orbit, right: float, up: float) -> Orbit:
    """Turn the camera to the right and upwards around the target, by degrees."""
    pitch = min(max(orbit.pitch + up, -MAX_PITCH), MAX_PITCH)
    return dataclasses.replace(orbit, yaw=math.remainder(orbit.yaw + right, 360.0), pitch=pitch)


def panned(orbit: Orbit, right: float, down: float) -> Orbit:
    """Pan the picture to the right and down, by shares of its height."""
    camera = camera_of(orbit)
    step = height_at_target(orbit) * (down * camera.up - right * camera.right)
    target = np.clip(np.asarray(orbit.target) + step, -MAX_COORDINATE, MAX_COORDINATE)
    return dataclasses.replace(orbit, target=tuple(target.tolist()))


def zoomed(orbit: Orbit, factor: float, at: tuple[float, float] = (0.0, 0.0)) -> Orbit:
    """Zoom by a factor; what is in the target's plane at `at` (heights right and down of the center) stays there."""
    distance = min(max(orbit.distance / factor, _NEAREST), _FARTHEST)
    camera = camera_of(orbit)
    shift = height_at_target(orbit) * (1.0 - distance / orbit.distance)
    target = np.asarray(orbit.target) + shift * (at[0] * camera.right - at[1] * camera.up)
    target = np.clip(target, -MAX_COORDINATE, MAX_COORDINATE)
    return dataclasses.replace(orbit, target=tuple(target.tolist()), distance=distance)


def framed(orbit: Orbit | None, objects: Sequence[Object], size: tuple[int, int]) -> Orbit:
    """Orbit that frames all of the objects, from the same side as before."""
    side = orbit or Orbit(yaw=math.degrees(math.atan2(0.45, 1.0)), pitch=math.degrees(math.atan2(0.35, 1.097)))
    corners = np.concatenate([world_vertices(item) for item in objects]) if orbit else None
    if corners is None:
        camera = framing(objects, size, fov_y=side.fov_y)  # as translucent render frames it
    else:
        camera = Camera.framing(corners, size, direction=-towards_camera(side), fov_y=side.fov_y)
    center = np.mean([item.bounds.mean(axis=0) for item in objects], axis=0)
    return dataclasses.replace(orbit_of(camera, center), orthographic=side.orthographic)


def orbit_of(camera: Camera, center: npt.ArrayLike) -> Orbit:
    """Orbit with the view of a camera, without its roll, around the point of its axis nearest to `center`."""
    axis = -camera.forward
    offset = np.asarray(center, dtype=np.float64) - camera.eye
    distance = max(float(offset @ camera.forward), 1e-3 * float(np.linalg.norm(offset)), _NEAREST)
    target = camera.eye + distance * camera.forward
    pitch = math.degrees(math.asin(min(max(float(axis[1]), -1.0), 1.0)))
    yaw = math.degrees(math.atan2(axis[0], axis[2]))
    fov = camera.fov_y if camera.fov_y is not None else 30.0
    if camera.height is not None:
        distance = camera.height / (2.0 * math.tan(math.radians(fov) / 2))
    return Orbit(
        tuple(target.tolist()), yaw, min(max(pitch, -MAX_PITCH), MAX_PITCH), distance, fov, camera.fov_y is None
    )
