"""Resources shared by frames on the GPU, uploaded once: meshes, densities, environments, textures, and light views."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Integers
from translucent.geometry.mesh import Mesh, unit_normals
from translucent.geometry.normals import drawn_normals
from translucent.gpu.diffusion import DiffusionCache, GridTexture
from translucent.gpu.embree_hits import EmbreeHitsCache
from translucent.gpu.hierarchies import HierarchyCache
from translucent.gpu.shaders import before_making
from translucent.gpu.shadow_atlas import ShadowAtlas
from translucent.gpu.targets import Storage
from translucent.gpu.textures import AnyTexture, EnvironmentMaps, TextureCache
from translucent.scene.environment import Environment

#: Faces whose corners are written at a time, so that little memory is taken meanwhile.
_CHUNK = 1 << 18


class MeshBuffers:
    """Vertex and index buffers of one mesh; vertices are offsets from the center of the mesh, in float32.

    The offsets are taken in float64, so float32 resolves the body's size, not its position in the world. Nothing here
    refers to the mesh: its end must be able to end these buffers.
    """

    def __init__(self, gl: moderngl.Context, mesh: Mesh) -> None:
        self._gl = gl
        self.offsets = gl.buffer((mesh.vertices - mesh.center).astype(np.float32))
        self.indices = gl.buffer(mesh.faces)
        self._flat: moderngl.Buffer | None = None
        self._smooth: moderngl.Buffer | None = None
        self._looks: dict[str, moderngl.Buffer] = {}
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def vertex_array(self, program: moderngl.Program, mesh: Mesh) -> moderngl.VertexArray:
        """The mesh bound to the inputs of `program`.

        Shared vertices; or where it reads ``normal``, flat faces; or for ``corner_normal``, faces that look smooth.
        """
        if (array := self._arrays.get(program.glo)) is None:
            content = self._content(program, mesh)
            indices = self.indices if self._shares(program) else None
            array = self._arrays[program.glo] = self._gl.vertex_array(program, content, indices, index_element_size=4)
        return array

    def draw_faces(self, program: moderngl.Program, mesh: Mesh, faces: Integers) -> None:
        """Draw some faces (k,) of the mesh."""
        if not len(faces):
            return
        corners = mesh.faces[faces] if self._shares(program) else 3 * faces[:, None] + np.arange(3)
        indices = self._gl.buffer(corners.astype(np.int32))
        array = self._gl.vertex_array(program, self._content(program, mesh), indices, index_element_size=4)
        array.render()
        array.release()
        indices.release()

    @staticmethod
    def _shares(program: moderngl.Program) -> bool:
        """True if faces share their vertices, as the program reads positions alone."""
        return not any(name in program for name in ("corner_normal", "normal", "uv"))

    def _content(self, program: moderngl.Program, mesh: Mesh) -> list[tuple[Any, ...]]:
        """Buffers of the inputs of a program, with their layouts and names."""
        if self._shares(program):
            return [(self.offsets, "3f", "offset")]
        if "normal" in program:
            content: list[tuple[Any, ...]] = [(self._flat_faces(mesh), "3f 3f", "offset", "normal")]
            if "uv" in program:
                content.append((self._of_corners("uv", mesh.uv, mesh), "2f", "uv"))
        else:
            # What only emits has no use for normals.
            read = [name for name in ("offset", "corner_normal", "uv") if name in program]
            layout = f"3f {'3f' if 'corner_normal' in read else '12x'} {'2f' if 'uv' in read else '8x'}"
            content = [(self._smooth_faces(mesh), layout, *read)]
        return [*content, *self._corner_looks(program, mesh)]

    def _corner_looks(self, program: moderngl.Program, mesh: Mesh) -> list[tuple[moderngl.Buffer, str, str]]:
        """Colors of the vertices, for a program that reads them."""
        if "corner_color" not in program:
            return []
        return [(self._of_corners("colors", mesh.colors, mesh), "4f", "corner_color")]

    def _of_corners(self, name: str, values: npt.NDArray[np.float64] | None, mesh: Mesh) -> moderngl.Buffer:
        """Vertex attribute for each corner of each face; zeros if the mesh lacks it."""
        if name not in self._looks:
            content = np.zeros((*mesh.faces.shape, 2)) if values is None else values[mesh.faces]
            self._looks[name] = self._gl.buffer(content.astype(np.float32))
        return self._looks[name]

    def _flat_faces(self, mesh: Mesh) -> moderngl.Buffer:
        """Unshared vertices of all faces, with flat normals."""
        if self._flat is None:
            before_making(self._gl)
            offsets = mesh.vertices - mesh.center

            def rows(part: slice) -> npt.NDArray[np.float32]:
                corners = offsets[mesh.faces[part]]
                normals = np.broadcast_to(unit_normals(mesh.vertices, mesh.faces[part])[:, None], corners.shape)
                return np.concatenate([corners, normals], axis=2).astype(np.float32)

            self._flat = self._written(len(mesh.faces), rows)
        return self._flat

    def _smooth_faces(self, mesh: Mesh) -> moderngl.Buffer:
        """Unshared vertices of all faces, with smooth normals and texture coordinates."""
        if self._smooth is None:
            before_making(self._gl)
            normals, offsets = drawn_normals(mesh), (mesh.vertices - mesh.center).astype(np.float32)
            uv = mesh.uv

            def rows(part: slice) -> npt.NDArray[np.float32]:
                faces = mesh.faces[part]
                content = np.zeros((*faces.shape, 8), dtype=np.float32)
                content[..., :3], content[..., 3:6] = offsets[faces], normals[part]
                if uv is not None:
                    content[..., 6:] = uv[faces]
                return content

            self._smooth = self._written(len(mesh.faces), rows)
        return self._smooth

    def _written(self, faces: int, rows: Callable[[slice], npt.NDArray[np.float32]]) -> moderngl.Buffer:
        """Buffer with the `rows` of all faces, made some at a time."""
        if faces <= _CHUNK:
            return self._gl.buffer(rows(slice(None)))
        buffer, offset = None, 0
        for begin in range(0, faces, _CHUNK):
            content = rows(slice(begin, begin + _CHUNK))
            if buffer is None:
                buffer = self._gl.buffer(reserve=faces * content.nbytes // len(content))
            buffer.write(content, offset=offset)
            offset += content.nbytes
        assert buffer is not None
        return buffer

    def release(self) -> None:
        """Free the OpenGL objects now."""
        for resource in (*self._arrays.values(), self.offsets, self.indices, self._flat, self._smooth):
            if resource is not None:
                resource.release()
        for buffer in self._looks.values():
            buffer.release()
        self._arrays.clear()


class MeshCache:
    """Cache of the buffers of each mesh that has been drawn and is still alive."""

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


class Resources:
    """Caches of one context."""

    def __init__(self, gl: moderngl.Context) -> None:
        #: Textures that one shader can read.
        self.texture_units = int(gl.info["GL_MAX_TEXTURE_IMAGE_UNITS"])
        self.meshes = MeshCache(gl)
        self.grids = GridTexture(gl)
        self.environments = EnvironmentMaps(gl)
        self.textures = TextureCache(gl)
        self.hierarchies = HierarchyCache(gl)
        self.diffusion = DiffusionCache(gl)
        self._shadows = ShadowAtlas(gl), ShadowAtlas(gl)
        #: Photons carry the light that interfaces turn, so that bodies are opaque to lights: their maps are others.
        self.photons_carry = False
        #: Media change after passes have been recorded, so that maps must not know which of them are alike.
        self.media_change = False
        #: Views from lights, which are the same for frames of all sizes.
        self.light_lists = Storage(gl, "light that media scatter")
        self.rays = Storage(gl, "traced rays")
        self.ray_hits = EmbreeHitsCache()

    @property
    def shadows(self) -> ShadowAtlas:
        """Maps of shadows of the frame that is being drawn."""
        return self._shadows[self.photons_carry]

    def light_textures(self, environment: Environment) -> dict[str, AnyTexture]:
        """Maps of an environment that lights surfaces, and of what these reflect, by the names of their samplers."""
        maps = self.environments.light(environment)
        return {
            "light_map": self.environments.sharp(environment),
            "light_levels": maps.levels,
            "light_irradiance": maps.irradiance,
            "reflectance_table": self.textures.reflectance,
        }

    def background_textures(self, environment: Environment) -> dict[str, AnyTexture]:
        """Map of an environment as a background, by the name of its sampler; none where it is no picture."""
        background = environment.seen
        return {"seen_map": self.environments.sharp(background)} if background.kind == "image" else {}

    def release(self) -> None:
        """Free all caches."""
        caches = (
            self.meshes,
            self.grids,
            self.environments,
            self.textures,
            self.hierarchies,
            self.diffusion,
            *self._shadows,
            self.light_lists,
            self.rays,
        )
        for cache in caches:
            cache.release()
