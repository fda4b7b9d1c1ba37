"""Scenes of pyrender drawn twice: what its renderers mark as theirs, made anew. Import it by the shim only."""

from __future__ import annotations

import copy
from collections.abc import Collection
from typing import Any

import pyrender


def opaque_part(scene: Any, hidden: Collection[Any]) -> Any:
    """The scene as one of its own, in which the nodes in `hidden` are not visible; shadow maps make room for them yet.

    pyrender marks what it draws as bound to the context where it does so, and refuses it elsewhere. The scene that was
    given may be drawn by another renderer of pyrender, so this one gets twins of all that would be marked.
    """
    part = pyrender.Scene(bg_color=scene.bg_color, ambient_light=scene.ambient_light)
    meshes: dict[tuple[Any, bool], Any] = {}
    textures: dict[Any, Any] = {}
    for node in scene.nodes:
        mesh = light = None
        if node.mesh is not None:
            key = node.mesh, node.mesh.is_visible and node not in hidden
            if key not in meshes:
                meshes[key] = _unbound_mesh(*key, textures)
            mesh = meshes[key]
        if node.light is not None:
            light = copy.copy(node.light)
            light._shadow_texture = None
        twin = pyrender.Node(mesh=mesh, light=light, camera=node.camera)
        part.add_node(twin)
        part.set_pose(twin, scene.get_pose(node))
        if node is scene.main_camera_node:
            part.main_camera_node = twin
    return part


def _unbound_mesh(mesh: Any, visible: bool, textures: dict[Any, Any]) -> Any:
    primitives = []
    for primitive in mesh.primitives:
        twin = copy.copy(primitive)
        twin._vaid, twin._buffers = None, []
        twin.material = copy.copy(primitive.material)
        for name, value in vars(primitive.material).items():
            if isinstance(value, pyrender.Texture):
                if value not in textures:
                    textures[value] = copy.copy(value)
                    textures[value]._texid = None
                setattr(twin.material, name, textures[value])
        primitives.append(twin)
    return pyrender.Mesh(primitives, is_visible=visible)
