"""Meshes on the GPU: uploaded once, shared by all passes, gone when the mesh is."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from translucent.corner_normals import drawn_normals
from translucent.gpu.ledger import before_making
from translucent.mesh import Mesh


class MeshBuffers:
    """Vertex and index buffers of one mesh; vertices are offsets from the center of the mesh, in float32.

    The offsets are taken in float64, so float32 resolves the body's size, not its place in the world. Nothing here
    refers to the mesh: its end must be able to end these buffers.
    """

    def __init__(self, gl: moderngl.Context, mesh: Mesh) -> None:
        self._gl = gl
        self.offsets = gl.buffer((mesh.vertices - mesh.center).astype(np.float32))
        self.indices = gl.buffer(mesh.faces)
        self._flat: moderngl.Buffer | None = None
        self._border: moderngl.Buffer | None = None
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def vertex_array(self, program: moderngl.Program, mesh: Mesh) -> moderngl.VertexArray:
        """The mesh bound to the inputs of `program`.

        Shared vertices; or where it asks for ``normal``, flat faces; or for ``corner_normal``, faces that look smooth.
        """
        if (array := self._arrays.get(program.glo)) is None:
            if "corner_normal" in program:
                names = ("offset", "corner_normal", "uv")
                array = self._gl.vertex_array(program, [(self._smooth_faces(mesh), "3f 3f 2f", *names)])
            elif "normal" in program:
                array = self._gl.vertex_array(program, [(self._flat_faces(mesh), "3f 3f", "offset", "normal")])
            else:
                content = [(self.offsets, "3f", "offset")]
                array = self._gl.vertex_array(program, content, self.indices, index_element_size=4)
            self._arrays[program.glo] = array
        return array

    def _flat_faces(self, mesh: Mesh) -> moderngl.Buffer:
        """Each face with vertices of its own, which carry its normal."""
        if self._flat is None:
            corners = (mesh.vertices - mesh.center)[mesh.faces]
            normals = np.broadcast_to(mesh.face_normals[:, None], corners.shape)
            self._flat = self._gl.buffer(np.concatenate([corners, normals], axis=2).astype(np.float32))
        return self._flat

    def _smooth_faces(self, mesh: Mesh) -> moderngl.Buffer:
        """Each face with vertices of its own, which carry smooth normals and texture coordinates."""
        if self._border is None:
            before_making(self._gl)
            content = np.zeros((*mesh.faces.shape, 8), dtype=np.float32)
            content[..., :3] = (mesh.vertices - mesh.center).astype(np.float32)[mesh.faces]
            content[..., 3:6] = drawn_normals(mesh)
            if mesh.uv is not None:
                content[..., 6:] = mesh.uv[mesh.faces]
            self._border = self._gl.buffer(content)
        return self._border

    def release(self) -> None:
        """Free the OpenGL objects now."""
        for resource in (*self._arrays.values(), self.offsets, self.indices, self._flat, self._border):
            if resource is not None:
                resource.release()
        self._arrays.clear()


class MeshCache:
    """Buffers of each mesh that has been drawn and is still alive."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._buffers: WeakKeyDictionary[Mesh, MeshBuffers] = WeakKeyDictionary()

    def __getitem__(self, mesh: Mesh) -> MeshBuffers:
        if (buffers := self._buffers.get(mesh)) is None:
            buffers = self._buffers[mesh] = MeshBuffers(self._gl, mesh)
        return buffers

    def __len__(self) -> int:
        return len(self._buffers)

    def release(self) -> None:
        """Free all buffers."""
        for buffers in list(self._buffers.values()):
            buffers.release()
        self._buffers.clear()
