"""Sensible defaults: a mesh, framed, in a medium that suits its size, before a bright backdrop."""

from __future__ import annotations

from translucent.camera import Camera
from translucent.lights import Environment
from translucent.medium import Medium
from translucent.mesh import Mesh
from translucent.scene import Object, Scene

#: Linear color that the default medium keeps of white light after `DEFAULT_REACH` of the mesh's diagonal.
DEFAULT_COLOR = (0.18, 0.62, 0.35)
DEFAULT_REACH = 0.15


def showcase(
    mesh: Mesh,
    medium: Medium | None = None,
    size: tuple[int, int] = (1280, 720),
    camera: Camera | None = None,
    environment: Environment | None = None,
) -> Scene:
    """A scene that shows one mesh well.

    Parameters
    ----------
    mesh : Mesh
    medium : Medium, optional
        Default: jade green after 15 % of the mesh's diagonal, whatever its size.
    size : (width, height)
        Size of the picture in pixels, which the framing depends on.
    camera : Camera, optional
        Default: from the front right and above, the whole mesh in view.
    environment : Environment, optional
        Default: a light table, white above and light grey below.
    """
    return Scene(
        objects=[
            Object(mesh, medium=medium or Medium.from_color(DEFAULT_COLOR, DEFAULT_REACH * (mesh.diagonal or 1.0)))
        ],
        camera=camera or Camera.framing(mesh.vertices[mesh.faces].reshape(-1, 3), size),
        environment=environment or Environment.gradient((0.55, 0.56, 0.58), (1.15, 1.15, 1.15)),
    )
