"""Positions of vertices as morph targets and skins of a glTF file move them.

A morph target adds its displacements, times a weight, to the positions (glTF 2.0, section 3.7.2.2). A skin then moves
each vertex by a weighted mean of matrices: those of its joints in the world, after their inverse bind matrices
(section 3.7.3). The transform of the node with the mesh has no effect on a skinned one. Displacements of normals are
not read: normals are those of the moved mesh, and thickness is exact.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import count

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.nodes import node_transforms


class Deformer:
    """Deformer of the meshes of a file, with the nodes of the file as they stand.

    Parameters
    ----------
    file : GltfFile
    accessors : Accessors
        Of that file.
    """

    def __init__(self, file: GltfFile, accessors: Accessors) -> None:
        self._file, self._accessors = file, accessors
        self._world: dict[int, Array] | None = None

    def skins(self, node: Json) -> bool:
        """True if a skin moves the mesh of a node: its positions are then those of the world."""
        return "skin" in node

    def moves(self, node: Json, primitive: Json) -> bool:
        """True if morph targets or a skin move a primitive of the mesh of a node."""
        return self.skins(node) or bool(primitive.get("targets"))

    def positions(self, node: Json, mesh: Json, primitive: Json) -> Array:
        """(n, 3): positions of the vertices of a primitive, in the file's unit.

        Raises
        ------
        InputError
            If weights, joints or matrices are missing, of a wrong kind, or too few.
        """
        found = self._accessors.vectors(primitive["attributes"].get("POSITION"), "VEC3")
        if targets := primitive.get("targets"):
            found = self._morphed(found, targets, node.get("weights", mesh.get("weights")))
        return self._skinned(found, primitive["attributes"], node["skin"]) if self.skins(node) else found

    def _morphed(self, positions: Array, targets: object, weights: object) -> Array:
        if not (isinstance(targets, list) and all(isinstance(one, dict) for one in targets)):
            raise self._file.refused("a primitive's targets are not a list of objects")
        given = [0.0] * len(targets) if weights is None else weights
        try:
            numbers = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            numbers = np.zeros(0)
        if numbers.shape != (len(targets),) or not np.isfinite(numbers).all():
            raise self._file.refused(f"weights {given!r} for {len(targets)} morph targets")
        moved = positions.copy()
        for weight, target in zip(numbers.tolist(), targets, strict=True):
            if weight and "POSITION" in target:
                offsets = self._accessors.vectors(target["POSITION"], "VEC3")
                if offsets.shape != positions.shape:
                    raise self._file.refused(f"a morph target has {len(offsets)} positions for {len(positions)}")
                moved += weight * offsets
        return moved

    def _skinned(self, positions: Array, attributes: Json, index: object) -> Array:
        matrices = self._joint_matrices(self._file.item("skins", index), index)
        blended, total = np.zeros((len(positions), 4, 4)), np.zeros(len(positions))
        for number in count():
            if f"JOINTS_{number}" not in attributes:
                break
            joints = self._accessors.vectors(attributes[f"JOINTS_{number}"], "VEC4").astype(np.int64)
            weights = self._accessors.vectors(attributes.get(f"WEIGHTS_{number}"), "VEC4")
            if len(joints) != len(positions) or weights.shape != joints.shape:
                raise self._file.refused(f"joints or weights {number} are not as many as the vertices")
            if joints.min(initial=0) < 0 or (joints[weights != 0] >= len(matrices)).any():
                raise self._file.refused(f"skin {index}: a vertex has a joint that is none of its {len(matrices)}")
            for joint, weight in zip(joints.T, weights.T, strict=True):
                blended += weight[:, None, None] * matrices[np.minimum(joint, len(matrices) - 1)]
                total += weight
        if not (total > 0).all():
            raise self._file.refused(f"skin {index}: a vertex has no weight")
        blended /= total[:, None, None]
        return np.asarray(np.einsum("nij,nj->ni", blended[:, :3, :3], positions) + blended[:, :3, 3])

    def _joint_matrices(self, skin: Json, index: object) -> Array:
        """(j, 4, 4): what moves vertices of the bind pose to the world, for each joint of a skin."""
        if self._world is None:
            self._world = node_transforms(self._file)
        joints = skin.get("joints")
        if not isinstance(joints, list) or not joints:
            raise self._file.refused(f"skin {index}: joints is {joints!r}, not a list of nodes")
        for joint in joints:
            self._file.item("nodes", joint)
        world = np.stack([self._world[joint] for joint in joints])
        if "inverseBindMatrices" not in skin:
            return world
        inverse = self._accessors.vectors(skin["inverseBindMatrices"], "MAT4")
        if len(inverse) < len(joints):
            raise self._file.refused(f"skin {index}: {len(inverse)} inverse bind matrices for {len(joints)} joints")
        return np.asarray(world @ inverse[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def animation_end(file: GltfFile) -> float | None:
    """Time in seconds of the last key of all animations of a file; None if it has none that can be read."""
    accessors, ends = Accessors(file), list[float]()
    for animation in file.items("animations"):
        samplers = animation.get("samplers", [])
        for sampler in samplers if isinstance(samplers, list) else ():
            with suppress(InputError):  # which is raised where somebody asks for a time
                times = accessors.vectors(sampler.get("input") if isinstance(sampler, dict) else None, "SCALAR")
                ends += [float(times.max())] if np.isfinite(times).all() else []
    return max(ends, default=None)
