"""Cameras that the nodes of a glTF file place. Source: glTF 2.0, section 3.10.

The aspect ratio is left to the frame, and there are no clipping planes. Scale in a camera's transform has no effect.
"""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gltf.fields import label, number, refused, section
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.left_out import LeftOut
from translucent.scene.camera import Camera


def scene_camera(
    file: GltfFile, transforms: dict[int, Array], index: int | None, metres: float, left_out: LeftOut
) -> Camera | None:
    """Camera of this index; None if none is asked for, or if the first is asked for and the file has none.

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
    if index is None or (index == 0 and not placed):
        return None
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(placed):
        listed = ", ".join(f"{i} of node {label(nodes, node)}" for i, (_, node) in enumerate(placed))
        raise InputError(
            f"camera {index!r} of {str(file.path)!r}",
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
    return _camera(file, where, cameras[camera], pose, metres)


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
        raise refused(
            file,
            f"{where}: its transform is singular (a scale of 0, in it or above it)",
            "give every axis a scale other than 0",
        )


def _camera(file: GltfFile, where: str, entry: Json, pose: Array, metres: float) -> Camera:
    kind = entry.get("type")
    if kind == "perspective":
        angle = np.degrees(number(file, where, section(file, where, entry, kind), "yfov"))
        if not 0 < angle < 180:
            raise refused(file, f"{where}: yfov of {angle:g} degrees is not between 0 and 180", "mend the file")
        return Camera(pose, fov_y=float(angle))
    if kind == "orthographic":
        half = number(file, where, section(file, where, entry, kind), "ymag")
        if not half > 0:
            raise refused(file, f"{where}: ymag {half:g} is not above 0", "mend the file")
        return Camera(pose, fov_y=None, height=2.0 * half * metres)
    raise refused(file, f"{where}: type {kind!r} is neither perspective nor orthographic")
