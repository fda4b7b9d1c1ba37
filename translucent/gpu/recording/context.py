"""Replacement of an OpenGL context that records all draws with their state, for replay in a browser."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import BLOCKS, BODY, BODY_STRIDE
from translucent.gpu.lifting import lift
from translucent.gpu.shaders import gather

_UNIFORM = re.compile(r"^uniform\s+(\w+)\s+(\w+)\s*(?:\[(\w+)\])?\s*;", re.MULTILINE)
_BLOCK = re.compile(r"^layout\(std140, row_major\) uniform (\w+) \{", re.MULTILINE)
_INPUT = re.compile(r"^in\s+\w+\s+(\w+)\s*;", re.MULTILINE)

_numbers = count()


#: What WebGL2 on machines of today has; textures of hierarchies need the first.
INFO: dict[str, int | str] = {
    "GL_MAX_TEXTURE_SIZE": 4096,
    "GL_MAX_3D_TEXTURE_SIZE": 256,
    "GL_SUBPIXEL_BITS": 8,
    "GL_MAX_TEXTURE_IMAGE_UNITS": 20,
    "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 0,
    "GL_RENDERER": "recording",
    "GL_VERSION": "OpenGL ES 3.0",
}

_NAMED = re.compile(r"^// shaders/(\S+)$", re.MULTILINE)
_DEFINE = re.compile(r"^#define (\w+) (-?\d+)$", re.MULTILINE)
_BINDINGS = {name: block.binding for name, block in BLOCKS.items()}


class RecordingContext:
    """Context that looks like one of moderngl to passes.

    Attributes
    ----------
    size : (int, int)
        Of the frame that is recorded: targets of this size get the size of the picture where they are played.
    programs : list of (vertex, fragment)
    textures : list of dict
    contents : list of ndarray
        Of textures and of uniform blocks.
    meshes : list of Mesh
    framebuffers : list of dict
    steps : list of dict
        Where draws go at the moment.
    live : bool
        The uniform blocks of draws are those of the frame, and not what they are now.
    """

    version_code = 330
    extra = None
    mglo = None

    def __init__(self, size: tuple[int, int], most_layers: int, texture_units: int) -> None:
        self.info = {**INFO, "GL_MAX_TEXTURE_IMAGE_UNITS": texture_units}
        self.size, self.most_layers = size, most_layers
        self.bound_blocks: dict[int, tuple[RecordedBuffer, int, int]] = {}
        self.bound_textures: dict[int, RecordedTexture] = {}
        self.framebuffer_in_use: RecordedFramebuffer | None = None
        self.programs: list[tuple[str, str]] = []
        self.textures: list[dict[str, Any]] = []
        self.contents: list[npt.NDArray[Any]] = []
        self.meshes: list[Mesh] = []
        self.framebuffers: list[dict[str, Any]] = []
        self.steps: list[dict[str, Any]] = []
        self.asking = False
        self.live = True
        self.live_blocks: dict[int, bytes] = {}
        self._numbers: dict[Any, int] = {}
        self._flags = 0
        self.blend_func: tuple[int, ...] = (1, 1)
        self.blend_equation: int | tuple[int, int] = 0x8006
        self.depth_func = "<"
        self.cull_face = "back"
        self.front_face = "ccw"

    def enable_only(self, flags: int) -> None:
        """Set which of blending, depth test and culling are on."""
        self._flags = flags

    def buffer(self, data: Any = None, reserve: int = 0) -> RecordedBuffer:
        """Buffer of uniforms."""
        return RecordedBuffer(self, data, reserve)

    def texture(
        self, size: tuple[int, int], components: int, data: Any = None, *, alignment: int = 1, dtype: str = "f1"
    ) -> RecordedTexture:
        """Texture or target."""
        return RecordedTexture(self, "2d", size, components, data, dtype)

    def texture_array(
        self, size: tuple[int, int, int], components: int, data: Any = None, *, dtype: str = "f1"
    ) -> RecordedTexture:
        """Texture with layers."""
        return RecordedTexture(self, "array", size, components, data, dtype)

    def texture3d(
        self, size: tuple[int, int, int], components: int, data: Any = None, *, alignment: int = 1, dtype: str = "f1"
    ) -> RecordedTexture:
        """Texture in three dimensions."""
        return RecordedTexture(self, "3d", size, components, data, dtype)

    def depth_renderbuffer(self, size: tuple[int, int]) -> RecordedTexture:
        """Depth buffer."""
        return RecordedTexture(self, "depth", size, 1, None, "f4")

    depth_texture = depth_renderbuffer

    def framebuffer(self, color_attachments: Any = (), depth_attachment: Any = None) -> RecordedFramebuffer:
        """Framebuffer."""
        return RecordedFramebuffer(self, color_attachments, depth_attachment)

    def program(self, vertex_shader: str, fragment_shader: str) -> RecordedProgram:
        """Program of two preprocessed stages, as texts for WebGL2."""
        (vertex, _), (fragment, merged) = (_es(text) for text in (vertex_shader, fragment_shader))
        return RecordedProgram(vertex, fragment, CONSTANTS, merged)

    def vertex_array(self, program: RecordedProgram, content: Any, *_: Any, **__: Any) -> RecordedArray:
        """Vertex array without vertices; vertex arrays of meshes come from `RecordedMeshes`."""
        assert not content
        return RecordedArray(self, program, None, "fullscreen")

    def query(self, **_: Any) -> RecordedQuery:
        """Query."""
        return RecordedQuery(self)

    def number(self, key: Any, items: list[Any], item: Any) -> int:
        """Index of an item in one of the recorded lists; an item with a known key is not added again."""
        if key not in self._numbers:
            self._numbers[key] = len(items)
            items.append(item)
        return self._numbers[key]

    def number_of_mesh(self, mesh: Mesh) -> int:
        """Number of a mesh."""
        return self.number(("mesh", id(mesh)), self.meshes, mesh)

    def number_of_content(self, content: npt.NDArray[Any]) -> int:
        """Number of an array among the contents."""
        digest = hashlib.sha256(content.tobytes()).digest()
        return self.number((content.shape, content.dtype.str, digest), self.contents, content)

    def number_of_texture(self, texture: RecordedTexture) -> int:
        """Number of a texture; those with one content are one."""
        held = None if texture.content is None else self.number_of_content(texture.content)
        wraps = [texture.repeat_x, texture.repeat_y, texture.repeat_z]
        what = {
            "kind": texture.kind,
            "size": None if texture.size == self.size else list(texture.size),
            "components": texture.components,
            "dtype": texture.dtype,
            "content": held,
            "filter": [int(mode) for mode in texture.filter],
            "repeat": wraps,
            "mipmaps": texture.mipmapped,
        }
        key = ("texture", texture.number) if held is None else ("texture", held, str(what))
        number = self.number(key, self.textures, what)
        self.textures[number] = what  # filters of targets may be set late
        return number

    def number_of_framebuffer(self, framebuffer: RecordedFramebuffer) -> int:
        """Number of a framebuffer."""
        depth = framebuffer.depth_attachment
        what = {
            "colors": [self.number_of_texture(texture) for texture in framebuffer.color_attachments],
            "depth": None if depth is None else self.number_of_texture(depth),
        }
        return self.number(("framebuffer", framebuffer.number), self.framebuffers, what)

    def note_clear(self, framebuffer: RecordedFramebuffer, color: tuple[float, ...], depth: float) -> None:
        """Add a clear to the steps."""
        mask = framebuffer.color_mask
        masks = mask if mask and isinstance(mask[0], tuple) else (mask,) * len(framebuffer.color_attachments)
        cleared = [i for i, own in enumerate(masks) if own[0]]
        self.steps.append(
            {
                "op": "clear",
                "target": self.number_of_framebuffer(framebuffer),
                "attachments": cleared,
                "color": [float(value) for value in color],
                "depth": None if framebuffer.depth_attachment is None else float(depth),
                "scissor": framebuffer.scissor,
            }
        )

    def note_mipmaps(self, texture: RecordedTexture) -> None:
        """Add the making of mipmaps to the steps."""
        self.steps.append({"op": "mipmaps", "texture": self.number_of_texture(texture)})

    def note_draw(self, array: RecordedArray) -> None:
        """Add a draw to the steps."""
        program, framebuffer = array.program, self.framebuffer_in_use
        assert framebuffer is not None
        key = ("program", program.vertex, program.fragment)
        step: dict[str, Any] = {
            "op": "draw",
            "target": self.number_of_framebuffer(framebuffer),
            "program": self.number(key, self.programs, (program.vertex, program.fragment)),
            "mesh": None if array.mesh is None else self.number_of_mesh(array.mesh),
            "looks": array.looks,
            "viewport": framebuffer.part,
            "scissor": framebuffer.scissor,
            "flags": int(self._flags),
            "blend": [
                [int(v) for v in np.atleast_1d(self.blend_func)],
                [int(v) for v in np.atleast_1d(self.blend_equation)],
            ],
            "depth": self.depth_func,
            "depth_mask": framebuffer.depth_mask,
            "cull": self.cull_face,
            "front": self.front_face,
            "textures": {
                name: self.number_of_texture(self.bound_textures[unit])
                for name, unit in program.samplers.items()
                if unit in self.bound_textures
            },
            "merged": {
                name: self.number_of_texture(self.bound_textures[unit]) for name, unit in program.merged.items()
            },
            "uniforms": {
                name: [kind, np.asarray(value, dtype=np.float64).tolist()]
                for name, (kind, value) in program.values.items()
            },
        }
        blocks: dict[str, int] = {}
        for name in program.blocks:
            buffer, offset, size = self.bound_blocks[_BINDINGS[name]]
            if name == BODY.name:
                step["body"] = offset // BODY_STRIDE
            content = bytes(buffer.content[offset : offset + size])
            if self.live:
                if name != BODY.name:
                    self.live_blocks[_BINDINGS[name]] = content
            else:
                blocks[name] = self.number_of_content(np.frombuffer(content, np.uint8))
        step["blocks"] = blocks
        self.steps.append(step)


class _Recorded:
    """Base class of the objects of a context that records: they stay with the recording."""

    def release(self) -> None:
        """Do nothing."""


class RecordedUniform:
    """Uniform of a program: its value, or the binding of its block."""

    def __init__(self, kind: str, array_length: int) -> None:
        self.kind = kind
        self.array_length = array_length
        self.binding = -1
        self.value: Any = None


class RecordedProgram:
    """Program by the texts of its stages, in GLSL ES 3.00.

    Attributes
    ----------
    vertex, fragment : str
    inputs : frozenset of str
        Vertex attributes.
    blocks : tuple of str
        Uniform blocks.
    uniforms : dict of str to RecordedUniform
        Loose uniforms, samplers among them.
    """

    def __init__(self, vertex: str, fragment: str, constants: dict[str, str], merged: tuple[str, ...] = ()) -> None:
        self.glo = next(_numbers)
        self.vertex, self.fragment = vertex, fragment
        self.inputs = frozenset(_INPUT.findall(vertex))
        both = vertex + fragment
        self.blocks = tuple(dict.fromkeys(_BLOCK.findall(both)))
        self.uniforms: dict[str, RecordedUniform] = {}
        for kind, name, length in _UNIFORM.findall(both):
            number = int(constants.get(length, length)) if length else 1
            self.uniforms[name] = RecordedUniform(kind, number)
        self._blocks = {name: RecordedUniform("block", 1) for name in self.blocks}
        self._merged = {name: RecordedUniform("merged", 1) for name in merged}

    def __contains__(self, name: str) -> bool:
        return any(name in known for known in (self.uniforms, self._blocks, self._merged, self.inputs))

    def __getitem__(self, name: str) -> RecordedUniform:
        return (self._blocks | self._merged | self.uniforms)[name]

    def get(self, name: str, default: RecordedUniform | None) -> RecordedUniform | None:
        """Uniform of this name, or the default."""
        return (self._blocks | self._merged | self.uniforms).get(name, default)

    def __iter__(self) -> Iterator[str]:
        return iter([*self.uniforms, *self._blocks, *self.inputs])

    @property
    def samplers(self) -> dict[str, int]:
        """Texture unit of each sampler."""
        found = {name: item.value for name, item in self.uniforms.items() if "sampler" in item.kind}
        return {name: int(unit or 0) for name, unit in found.items()}

    @property
    def merged(self) -> dict[str, int]:
        """Texture unit of each sampler whose texture is now a part of another."""
        return {name: int(item.value) for name, item in self._merged.items()}

    @property
    def values(self) -> dict[str, tuple[str, Any]]:
        """Type and value of each loose uniform that has been set, samplers left out."""
        return {
            name: (item.kind, item.value)
            for name, item in self.uniforms.items()
            if "sampler" not in item.kind and item.value is not None
        }


class RecordedBuffer(_Recorded):
    """Buffer of uniforms."""

    def __init__(self, gl: RecordingContext, data: Any = None, reserve: int = 0) -> None:
        self._gl = gl
        self.content = bytearray(reserve if data is None else _bytes_of(data))
        self.size = len(self.content)

    def write(self, data: Any, offset: int = 0) -> None:
        """Replace bytes from an offset on."""
        content = _bytes_of(data)
        self.content[offset : offset + len(content)] = content

    def bind_to_uniform_block(self, binding: int, offset: int = 0, size: int = -1) -> None:
        """Bind a range."""
        self._gl.bound_blocks[binding] = self, offset, self.size - offset if size < 0 else size


class RecordedTexture(_Recorded):
    """Texture: a target of passes, or content that never changes once it is drawn with.

    Attributes
    ----------
    kind : {"2d", "array", "3d", "depth"}
    size : tuple of int
    components : int
    dtype : str
    content : ndarray, optional
        None of targets.
    """

    def __init__(
        self, gl: RecordingContext, kind: str, size: Sequence[int], components: int, data: Any, dtype: str
    ) -> None:
        self._gl = gl
        self.number = next(_numbers)
        self.kind, self.size, self.components, self.dtype = kind, tuple(size), components, dtype
        self.content: npt.NDArray[Any] | None = None if data is None else _array(data, dtype, size, components)
        self.filter: tuple[int, int] = (0x2601, 0x2601)
        self.repeat_x = self.repeat_y = self.repeat_z = True
        self.mipmapped = False

    def use(self, unit: int) -> None:
        """Bind it."""
        self._gl.bound_textures[unit] = self

    def write(self, data: Any, viewport: tuple[int, int, int, int] | None = None) -> None:
        """Replace the content, or some of its rows."""
        new = _array(data, self.dtype, self.size if viewport is None else viewport[2:], self.components)
        if viewport is None or (self.content is None and viewport[2:] == self.size):
            self.content = new
            return
        x, y, width, height = viewport
        known = np.zeros((*self.size[::-1], *new.shape[2:]), new.dtype) if self.content is None else self.content
        self.content = known.copy()
        self.content[y : y + height, x : x + width] = new

    def build_mipmaps(self) -> None:
        """Note that it needs mipmaps: once where its content is given, else whenever it has been drawn."""
        self.mipmapped = True
        if self.content is None:
            self._gl.note_mipmaps(self)


def _bytes_of(data: Any) -> bytes:
    return data if isinstance(data, bytes) else np.ascontiguousarray(data).tobytes()


def _array(data: Any, dtype: str, size: Sequence[int], components: int) -> npt.NDArray[Any]:
    kinds: dict[str, Any] = {"f4": np.float32, "f2": np.float16, "u4": np.uint32, "f1": np.uint8}
    flat: npt.NDArray[Any] = np.frombuffer(_bytes_of(data), kinds[dtype])
    return flat.reshape(*tuple(size)[::-1], components).copy()


class RecordedFramebuffer(_Recorded):
    """Framebuffer: its attachments, and the state that comes with it."""

    def __init__(self, gl: RecordingContext, colors: Sequence[RecordedTexture], depth: Any) -> None:
        self._gl = gl
        self.number = next(_numbers)
        self.color_attachments = tuple(colors)
        self.depth_attachment = depth
        self.size = (*colors, depth)[0].size
        self.viewport = self._whole = (0, 0, *self.size)
        self.scissor: tuple[int, int, int, int] | None = None
        self.depth_mask = True
        self.color_mask: Any = (True,) * 4

    def use(self) -> None:
        """Draw into it from now on."""
        self._gl.framebuffer_in_use = self

    @property
    def part(self) -> tuple[int, int, int, int] | None:
        """Viewport, or None for the whole target."""
        return None if tuple(self.viewport) == self._whole else tuple(self.viewport)

    def clear(
        self,
        red: float = 0.0,
        green: float = 0.0,
        blue: float = 0.0,
        alpha: float = 0.0,
        depth: float = 1.0,
        viewport: None = None,
    ) -> None:
        """Record a clear of all of it."""
        self._gl.note_clear(self, (red, green, blue, alpha), depth)

    def read(self, viewport: Any = None, components: int = 4, **_: Any) -> bytes:
        """Result of a query during recording: as many crossings as the recording should allow."""
        width, height = (viewport or self._whole)[2:]
        return np.full(width * height * components, self._gl.most_layers, np.float32).tobytes()


@dataclass(frozen=True, eq=False)
class RecordedArray(_Recorded):
    """Vertex array of a mesh for a program; without a mesh, of a triangle that covers all.

    Attributes
    ----------
    looks : {"shared", "flat", "smooth", "fullscreen"}
        Whether faces have common vertices, and else which normals they have.
    """

    gl: RecordingContext
    program: RecordedProgram
    mesh: Mesh | None
    looks: str

    def render(self, mode: int | None = None, vertices: int = -1) -> None:
        """Record a draw, unless it belongs to a query."""
        if not self.gl.asking:
            self.gl.note_draw(self)


class RecordedQuery:
    """Query that always finds samples, so that passes which stop where nothing is left go on.

    What is drawn for it is no step: players ask nothing, and WebGL2 refuses shaders without outputs.
    """

    samples = 1

    def __init__(self, gl: RecordingContext) -> None:
        self._gl = gl

    def __enter__(self) -> RecordedQuery:
        self._gl.asking = True
        return self

    def __exit__(self, *_: object) -> None:
        self._gl.asking = False


class RecordedMeshes(_Recorded):
    """Vertex arrays of meshes, in place of those in buffers."""

    def __init__(self, gl: RecordingContext) -> None:
        self._gl = gl

    def __getitem__(self, mesh: Mesh) -> RecordedMeshes:
        return self

    def vertex_array(self, program: RecordedProgram, mesh: Mesh) -> RecordedArray:
        """The mesh as the program needs it; see `translucent.gpu.resources.MeshBuffers.vertex_array`."""
        inputs = program.inputs
        if "corner_normal" in inputs or ("uv" in inputs and "normal" not in inputs):
            looks = "smooth"
        else:
            looks = "flat" if "normal" in inputs else "shared"
        return RecordedArray(self._gl, program, mesh, looks)


def _es(text: str) -> tuple[str, tuple[str, ...]]:
    """A preprocessed stage, lifted for WebGL2, and the names of samplers whose textures are now parts of others.

    Triangles follow the nodes of hierarchies, as WebGL2 promises no more than 16 textures in a shader.
    """
    named = _NAMED.search(text)
    assert named is not None
    switches = gather(named[1]).switches  # other definitions are constants
    given = {key: int(value) for key, value in _DEFINE.findall(text.partition("#line")[0]) if key in switches}
    lifted = lift(named[1], given, "webgl2").text
    row = "uniform int hierarchy_triangle_row;"
    merged, found = re.subn(r"^uniform usampler2D hierarchy_triangles;", row, lifted, flags=re.MULTILINE)
    of_nodes = "texelFetch(hierarchy_nodes, ivec2(0, hierarchy_triangle_row) + "
    return merged.replace("texelFetch(hierarchy_triangles, ", of_nodes), ("hierarchy_triangles",) * found
