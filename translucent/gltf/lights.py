"""Lights of KHR_lights_punctual that nodes place.

A point light's candela is read as W/sr, a directional light's lux as W/m^2: the file's number times its color, per
channel, and so is that of a spot light. `range` has no effect, since light falls off with the inverse square.
"""

from __future__ import annotations

import math

from translucent.arrays import Array
from translucent.gltf.cameras import require_regular
from translucent.gltf.fields import extension, label, number, numbers, refused, section
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.left_out import LeftOut
from translucent.scene.lights import NARROWEST_CONE, DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light

LIGHTS = "KHR_lights_punctual"

#: A right angle in radians, and some roundings of float32.
_RIGHT_ANGLE = 0.5 * math.pi * (1.0 + 1e-6)


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
    listed = extension(file, "the file", file.tree, LIGHTS).get("lights", [])
    found: list[Light] = []
    for node, matrix in transforms.items():
        name = label(nodes, node)
        where = f"light of node {name}"
        if not (placed := extension(file, where, nodes[node], LIGHTS)):
            continue
        index = placed.get("light")
        if not isinstance(listed, list) or isinstance(index, bool) or not isinstance(index, int):
            raise refused(file, f"{where}: light {index!r} is not one of its lights")
        if not 0 <= index < len(listed) or not isinstance(listed[index], dict):
            raise refused(file, f"{where}: light {index} is not one of {len(listed)}")
        require_regular(file, where, matrix[:3, :3])
        found.append(_light(file, where, name, listed[index], matrix, metres, left_out))
    return found


def _light(
    file: GltfFile, where: str, name: str, entry: Json, matrix: Array, metres: float, left_out: LeftOut
) -> Light:
    color = numbers(file, where, entry, "color", (1.0, 1.0, 1.0))
    strength = number(file, where, entry, "intensity", 1.0)
    if strength < 0 or (color < 0).any():
        raise refused(file, f"{where}: intensity {strength:g}, color {color.tolist()}: below 0", "mend the file")
    kind = entry.get("type")
    if kind == "directional":
        return DirectionalLight(-matrix[:3, 2], strength * color)
    if kind not in ("point", "spot"):
        raise refused(file, f"{where}: type {kind!r} is neither point, directional nor spot")
    if "range" in entry:
        left_out.add("ranges of lights", name)
    position, intensity = matrix[:3, 3] * metres, strength * color * metres**2
    if kind == "point":
        return PointLight(position, intensity)
    return SpotLight(position, -matrix[:3, 2], intensity, *_cones(file, where, section(file, where, entry, "spot")))


def _cones(file: GltfFile, where: str, spot: Json) -> tuple[float, float]:
    """Half angles of the inner and the outer cone in degrees."""
    inner = number(file, where, spot, "innerConeAngle", 0.0)
    outer = number(file, where, spot, "outerConeAngle", math.pi / 4.0)
    # A right angle of float32 is a little more.
    degrees = math.degrees(inner), min(math.degrees(outer), 90.0) if outer < _RIGHT_ANGLE else math.degrees(outer)
    if not (0.0 <= degrees[0] < degrees[1] <= 90.0 and degrees[1] >= NARROWEST_CONE):
        found = f"innerConeAngle {inner:g}, outerConeAngle {outer:g}: not 0 <= inner < outer <= pi / 2"
        raise refused(file, f"{where}: {found}", "mend the file")
    return degrees
