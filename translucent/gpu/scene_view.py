"""View of a scene from one camera, ready to be drawn: the common base of a frame and a light's view."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from translucent.gpu.body_uniforms import BodyRoles
from translucent.gpu.placement import PlacedScene
from translucent.gpu.resources import Resources
from translucent.gpu.std140 import UniformBlock
from translucent.gpu.targets import Targets
from translucent.gpu.uniform_buffers import UniformBuffers


class CameraView:
    """Bodies before a camera, with their uniforms, and targets of the size of a picture.

    Parameters
    ----------
    placed : PlacedScene
    roles : BodyRoles
        Of the objects of the scene.
    contents : mapping of UniformBlock to bytes
        Of blocks that are alike for all samples.
    targets, resources
    """

    def __init__(
        self,
        gl: moderngl.Context,
        placed: PlacedScene,
        roles: BodyRoles,
        contents: Mapping[UniformBlock, bytes],
        targets: Targets,
        resources: Resources,
    ) -> None:
        self.gl = gl
        self.scene = placed.scene
        self.placed = placed
        self.roles = roles
        self.targets = targets
        self.resources = resources
        self.uniforms = UniformBuffers(gl, placed, roles, contents)

    def draw(self, program: moderngl.Program, objects: tuple[int, ...]) -> None:
        """Draw objects with the current state; front faces are those where a ray enters."""
        for i in objects:
            body = self.scene.objects[i]
            self.uniforms.bind_body(i)
            self.gl.front_face = "cw" if body.faces_inwards else "ccw"
            self.resources.meshes[body.mesh].vertex_array(program, body.mesh).render()
        self.gl.front_face = "ccw"
