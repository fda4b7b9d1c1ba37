"""Coarser copies of meshes that a browser would be slow with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.scene.scene import Scene

#: Triangles that a mesh keeps in any case.
LEAST_FACES = 100


def triangles(scene: Scene) -> int:
    """Triangles of all meshes of a scene, each once."""
    return sum(len(mesh.faces) for mesh in {body.mesh for body in scene.objects})


def simplified(scene: Scene, faces: int) -> Scene:
    """The scene with about so many triangles in all, by quadric error metrics (Garland & Heckbert 1997).

    Meshes with texture coordinates or colors stay as they are.

    Raises
    ------
    InputError
        If the package fast-simplification, which does it, is not installed; if the number is not above `LEAST_FACES`.
    """
    if faces < LEAST_FACES:
        raise InputError(f"--simplify {faces}", f"fewer than {LEAST_FACES} triangles", "give for example 200000")
    share = faces / triangles(scene)
    if share >= 1.0:
        return scene
    coarse = {
        mesh: _coarse(mesh, max(int(share * len(mesh.faces)), LEAST_FACES))
        for mesh in dict.fromkeys(body.mesh for body in scene.objects)
        if mesh.uv is None and mesh.colors is None and len(mesh.faces) > LEAST_FACES
    }
    return replace(scene, objects=[replace(body, mesh=coarse.get(body.mesh, body.mesh)) for body in scene.objects])


def _coarse(mesh: Mesh, faces: int) -> Mesh:
    try:
        import fast_simplification
    except ImportError as error:
        do = "pip install fast-simplification, or reduce the model before, for example in Blender"
        raise InputError("--simplify", "the package fast-simplification is not installed", do) from error
    # It asks for arrays that it could write to; more haste than this makes bodies thinner, by several percent.
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)
    vertices, kept = fast_simplification.simplify(points, triangles, target_count=faces, agg=3)
    return Mesh(vertices, kept, name=mesh.name)
