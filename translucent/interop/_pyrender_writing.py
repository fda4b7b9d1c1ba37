"""Conversion of a scene's opaque objects to a pyrender scene. Import it by the shim only."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyrender
from pyrender.constants import MAX_N_LIGHTS

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gpu.placement import depth_range
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight, SpotLight
from translucent.scene.scene import Light, Object, Scene


def written(scene: Scene, near: float | None = None) -> Any:
    """See `translucent.interop.pyrender.to_pyrender`; `near` is that of the camera, if something closer is known."""
    environment = scene.environment
    part = pyrender.Scene(bg_color=np.zeros(4), ambient_light=environment.mean)
    for item in scene.opaque:
        part.add(pyrender.Mesh([_primitive(item, scene.camera)], name=item.mesh.name))
    _add_lights(part, scene)
    _add(part, _camera(scene, near), _turned(scene.camera.pose[:3, :3]))
    return part


def _primitive(item: Object, camera: Camera) -> Any:
    """Flat faces whose normals look at the camera, as all faces reflect alike on both sides; offsets from the eye."""
    vertices = item.mesh.vertices @ item.matrix[:3, :3].T + (item.matrix[:3, 3] - camera.eye)
    corners = vertices[item.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    view = camera.forward if camera.fov_y is None else corners[:, 0]
    away = np.sum(normals * view, axis=1) > 0
    normals[away] = -normals[away]
    return pyrender.Primitive(
        corners.reshape(-1, 3),
        np.repeat(normals, 3, axis=0),
        material=pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[*item.base_color, 1.0], metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True
        ),
    )


def _add_lights(part: Any, scene: Scene) -> None:
    for kind in {type(light) for light in scene.lights}:
        if (count := sum(isinstance(light, kind) for light in scene.lights)) > MAX_N_LIGHTS:
            raise InputError(
                "drawing with pyrender", f"{count} of {kind.__name__}", f"use at most {MAX_N_LIGHTS} of each kind"
            )
    for light in scene.lights:
        pose = np.eye(4)
        if isinstance(light, SpotLight | DirectionalLight):
            backward = -np.asarray(light.direction)
            right = np.cross(np.eye(3)[np.argmin(np.abs(backward))], backward)
            right /= np.linalg.norm(right)
            pose = _turned(np.column_stack([right, np.cross(backward, right), backward]))
        if not isinstance(light, DirectionalLight):
            pose[:3, 3] = np.asarray(light.position) - scene.camera.eye
        _add(part, _light(light), pose)


def _light(light: Light) -> Any:
    if isinstance(light, DirectionalLight):
        return pyrender.DirectionalLight(color=np.asarray(light.irradiance), intensity=1.0)
    color = np.asarray(light.intensity)
    if isinstance(light, SpotLight):
        cones = np.radians((light.inner_cone, light.outer_cone))
        return pyrender.SpotLight(color, intensity=1.0, innerConeAngle=cones[0], outerConeAngle=cones[1])
    return pyrender.PointLight(color=color, intensity=1.0)


def _camera(scene: Scene, near: float | None) -> Any:
    camera = scene.camera
    closest, far = depth_range(scene.boxes[~scene.filled], camera, scene.diagonal)
    if camera.fov_y is None:
        # What is behind an orthographic picture is not seen, and what is ahead has the same precision everywhere.
        far = max(far, scene.diagonal)
        return pyrender.OrthographicCamera(1.0, 0.5 * (camera.height or 1.0), znear=1e-6 * far, zfar=far)
    return pyrender.PerspectiveCamera(np.radians(camera.fov_y), znear=near or closest, zfar=far)


def _turned(rotation: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = rotation
    return pose


def _add(part: Any, item: Any, pose: Array) -> None:
    part.set_pose(part.add(item), pose)  # as it is; nodes that are made with a matrix take it apart
