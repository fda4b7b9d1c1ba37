"""Cameras and lights that the nodes of a glTF file place. Source: glTF 2.0, section 3.10; KHR_lights_punctual.

A camera's aspect ratio is left to the frame, and there are no clipping planes. Scale in its transform has no effect.

A point light's candela is read as W/sr, a directional light's lux as W/m^2: the file's number times its color, per
channel, and so is that of a spot light. `range` has no effect, since light falls off with the inverse square.
"""

from __future__ import annotations

import math

import numpy as np

from translucent.arguments import brief
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gltf.file import GltfFile, JsonFields, LeftOut, label
from translucent.scene.camera import Camera
from translucent.scene.lights import NARROWEST_CONE, DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light

LIGHTS = "KHR_lights_punctual"

#: A right angle in radians, and some roundings of float32.
_RIGHT_ANGLE = 0.5 * math.pi * (1.0 + 1e-6)


def scene_camera(
    file: GltfFile, transforms: dict[int, Array], index: int | None, metres: float, left_out: LeftOut
) -> Camera | None:
    """Camera of this index; None if none is requested, or if the first is requested and the file has none.

    Parameters
    ----------
    file : GltfFile
    transforms : dict
        Node to world (4x4) of the nodes of the scene.
    index : int or None
        Among the cameras that nodes of the scene place, in the order of the file's list of cameras.
    metres : float
        Per unit of the file.
    left_out : LeftOut
        Gets what the camera does not hold.

    Raises
    ------
    InputError
        If there is no such camera, it is wrong, or its node's transform is singular.
    """
    nodes, cameras = file.items("nodes"), file.items("cameras")
    placed = []
    for node in transforms:
        if "camera" in nodes[node]:
            file.item("cameras", nodes[node]["camera"])
            placed.append((nodes[node]["camera"], node))
    placed.sort()
    if index is None or (isinstance(index, int) and index == 0 and not placed):
        return None
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(placed):
        listed = ", ".join(f"{i} of node {label(nodes, node)}" for i, (_, node) in enumerate(placed))
        raise InputError(
            f"camera {brief(index)} of {str(file.path)!r}",
            f"it has {listed}" if placed else "it has no cameras",
            "give one of these numbers" if placed else "leave the camera out: all objects are in view then",
        )
    camera, node = placed[index]
    where = f"camera {label(cameras, camera)} of node {label(nodes, node)}"
    matrix = transforms[node]
    pose = np.eye(4)
    pose[:3, :3] = _axes(file, where, matrix[:3, :3])
    pose[:3, 3] = matrix[:3, 3] * metres
    if np.linalg.det(matrix[:3, :3] / np.abs(matrix[:3, :3]).max()) < 0:
        left_out.add("mirroring cameras", label(nodes, node))
    return _camera(JsonFields(file, where, cameras[camera]), pose, metres)


def _axes(file: GltfFile, where: str, linear: Array) -> Array:
    """Right, up and backward as columns: the view is along the node's -Z, with its +Y upwards, whatever its scale."""
    require_regular(file, where, linear)
    y, z = (linear[:, i] / np.abs(linear[:, i]).max() for i in (1, 2))
    backward = z / np.linalg.norm(z)
    right = np.cross(y / np.linalg.norm(y), backward)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(backward, right), backward])


def require_regular(file: GltfFile, where: str, linear: Array) -> None:
    """Raise `InputError` if a transform (3, 3) is singular."""
    if np.linalg.matrix_rank(linear) < 3:
        raise file.refused(
            f"{where}: its transform is singular (a scale of 0, in it or above it)",
            "give every axis a scale other than 0",
        )


def _camera(fields: JsonFields, pose: Array, metres: float) -> Camera:
    kind = fields.values.get("type")
    if kind == "perspective":
        angle = math.degrees(fields.section(kind).number("yfov"))
        if not 0 < angle < 180:
            fields.refuse(f"yfov of {angle:g} degrees is not between 0 and 180", "mend the file")
        return Camera(pose, fov_y=angle)
    if kind == "orthographic":
        return Camera(pose, fov_y=None, height=2.0 * metres * fields.section(kind).number("ymag", low=0.0, above=True))
    raise fields.file.refused(f"{fields.where}: type {kind!r} is neither perspective nor orthographic")


def scene_lights(file: GltfFile, transforms: dict[int, Array], metres: float, left_out: LeftOut) -> list[Light]:
    """The lights of a scene.

    Parameters
    ----------
    file : GltfFile
    transforms : dict
        Node to world (4x4) of the nodes of the scene.
    metres : float
        Per unit of the file. Intensities change with its square, so that the light on the objects is the same.
    left_out : LeftOut
        Gets what the lights do not hold.

    Raises
    ------
    InputError
        If a light is wrong, or its node's transform is singular.
    """
    nodes = file.items("nodes")
    listed = JsonFields(file, "the file", file.tree).extension(LIGHTS).values.get("lights", [])
    found: list[Light] = []
    for node, matrix in transforms.items():
        name = label(nodes, node)
        where = f"light of node {name}"
        if not (placed := JsonFields(file, where, nodes[node]).extension(LIGHTS).values):
            continue
        index = placed.get("light")
        if not isinstance(listed, list) or isinstance(index, bool) or not isinstance(index, int):
            raise file.refused(f"{where}: light {index!r} is not one of its lights")
        if not 0 <= index < len(listed) or not isinstance(listed[index], dict):
            raise file.refused(f"{where}: light {index} is not one of {len(listed)}")
        require_regular(file, where, matrix[:3, :3])
        light = listed[index]
        if "range" in light and light.get("type") != "directional":
            left_out.add("ranges of lights", name)
        found.append(_light(JsonFields(file, where, light), matrix, metres))
    return found


def _light(fields: JsonFields, matrix: Array, metres: float) -> Light:
    color = np.array(fields.numbers("color", (1.0, 1.0, 1.0)))
    strength = fields.number("intensity", 1.0)
    if strength < 0 or (color < 0).any():
        fields.refuse(f"intensity {strength:g}, color {color.tolist()}: below 0", "mend the file")
    kind = fields.values.get("type")
    if kind not in ("point", "directional", "spot"):
        fields.refuse(f"type {kind!r} is neither point, directional nor spot")
    if kind == "directional":
        return DirectionalLight(-matrix[:3, 2], strength * color)
    position, intensity = matrix[:3, 3] * metres, strength * color * metres**2
    if kind == "point":
        return PointLight(position, intensity)
    return SpotLight(position, -matrix[:3, 2], intensity, *_cones(fields.section("spot")))


def _cones(spot: JsonFields) -> tuple[float, float]:
    """Half angles of the inner and the outer cone in degrees."""
    inner, outer = spot.number("innerConeAngle", 0.0), spot.number("outerConeAngle", math.pi / 4.0)
    # A right angle of float32 is a little more.
    degrees = math.degrees(inner), min(math.degrees(outer), 90.0) if outer < _RIGHT_ANGLE else math.degrees(outer)
    if not (0.0 <= degrees[0] < degrees[1] <= 90.0 and degrees[1] >= NARROWEST_CONE):
        found = f"innerConeAngle {inner:g}, outerConeAngle {outer:g}: not 0 <= inner < outer <= pi / 2"
        spot.refuse(found, "mend the file")
    return degrees
