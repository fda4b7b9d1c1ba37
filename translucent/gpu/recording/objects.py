"""Objects of a context that records: programs, textures and framebuffers that only know what they are."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh

_UNIFORM = re.compile(r"^uniform\s+(\w+)\s+(\w+)\s*(?:\[(\w+)\])?\s*;", re.MULTILINE)
_BLOCK = re.compile(r"^layout\(std140, row_major\) uniform (\w+) \{", re.MULTILINE)
_INPUT = re.compile(r"^in\s+\w+\s+(\w+)\s*;", re.MULTILINE)

_numbers = count()


class Recorder(Protocol):
    """Context, as the objects that belong to it know it."""

    bound_blocks: dict[int, tuple[RecordedBuffer, int, int]]
    bound_textures: dict[int, RecordedTexture]
    framebuffer_in_use: RecordedFramebuffer | None
    most_layers: int
    asking: bool

    def note_clear(self, framebuffer: RecordedFramebuffer, color: tuple[float, ...], depth: float) -> None:
        """Record that a framebuffer is cleared."""

    def note_mipmaps(self, texture: RecordedTexture) -> None:
        """Record that mipmaps of a texture are made."""

    def note_draw(self, array: RecordedArray) -> None:
        """Record a draw with all of its state."""


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


class RecordedBuffer:
    """Buffer of uniforms."""

    def __init__(self, gl: Recorder, data: Any = None, reserve: int = 0) -> None:
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

    def release(self) -> None:
        """Do nothing: what was recorded stays."""


class RecordedTexture:
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

    def __init__(self, gl: Recorder, kind: str, size: Sequence[int], components: int, data: Any, dtype: str) -> None:
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

    def release(self) -> None:
        """Do nothing: what was recorded stays."""


def _bytes_of(data: Any) -> bytes:
    return data if isinstance(data, bytes) else np.ascontiguousarray(data).tobytes()


def _array(data: Any, dtype: str, size: Sequence[int], components: int) -> npt.NDArray[Any]:
    kinds: dict[str, Any] = {"f4": np.float32, "f2": np.float16, "u4": np.uint32, "f1": np.uint8}
    flat: npt.NDArray[Any] = np.frombuffer(_bytes_of(data), kinds[dtype])
    return flat.reshape(*tuple(size)[::-1], components).copy()


class RecordedFramebuffer:
    """Framebuffer: its attachments, and the state that comes with it."""

    def __init__(self, gl: Recorder, colors: Sequence[RecordedTexture], depth: Any) -> None:
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
        """Viewport, unless it is all."""
        return None if tuple(self.viewport) == self._whole else tuple(self.viewport)

    def clear(
        self, red: float = 0.0, green: float = 0.0, blue: float = 0.0, alpha: float = 0.0, depth: float = 1.0
    ) -> None:
        """Note that it is cleared."""
        self._gl.note_clear(self, (red, green, blue, alpha), depth)

    def read(self, viewport: Any = None, components: int = 4, **_: Any) -> bytes:
        """Stand in for the result that passes look at: as many crossings as the recording is to allow."""
        width, height = (viewport or self._whole)[2:]
        return np.full(width * height * components, self._gl.most_layers, np.float32).tobytes()

    def release(self) -> None:
        """Do nothing: what was recorded stays."""


@dataclass(frozen=True, eq=False)
class RecordedArray:
    """Vertex array of a mesh for a program; without a mesh, of a triangle that covers all.

    Attributes
    ----------
    looks : {"shared", "flat", "smooth", "fullscreen"}
        Whether corners of faces share vertices, and else which normals they have.
    """

    gl: Recorder
    program: RecordedProgram
    mesh: Mesh | None
    looks: str

    def render(self, mode: int | None = None, vertices: int = -1) -> None:
        """Note a draw, unless it is a query's."""
        if not self.gl.asking:
            self.gl.note_draw(self)

    def release(self) -> None:
        """Do nothing: what was recorded stays."""


class RecordedQuery:
    """Query that always finds samples, so that passes which stop where nothing is left go on.

    What is drawn for it is no step: players ask nothing, and WebGL2 refuses shaders without outputs.
    """

    samples = 1

    def __init__(self, gl: Recorder) -> None:
        self._gl = gl

    def __enter__(self) -> RecordedQuery:
        self._gl.asking = True
        return self

    def __exit__(self, *_: object) -> None:
        self._gl.asking = False


class RecordedMeshes:
    """Vertex arrays of meshes, in place of those in buffers."""

    def __init__(self, gl: Recorder) -> None:
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

    def release(self) -> None:
        """Do nothing."""
