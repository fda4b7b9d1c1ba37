"""Stand-in for an OpenGL context that records each draw with all its state, to be replayed in a browser."""

from __future__ import annotations

import hashlib
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import BLOCKS, BODY, BODY_STRIDE
from translucent.gpu.lifting import lift
from translucent.gpu.recording.objects import (
    RecordedArray,
    RecordedBuffer,
    RecordedFramebuffer,
    RecordedProgram,
    RecordedQuery,
    RecordedTexture,
)

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
        """Vertex array without vertices: those of meshes come from `RecordedMeshes`."""
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
            "uniforms": {name: [kind, _plain(value)] for name, (kind, value) in program.values.items()},
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


def _plain(value: Any) -> Any:
    """Value of a uniform as JSON holds it."""
    return np.asarray(value, dtype=np.float64).tolist()


def _es(text: str) -> tuple[str, tuple[str, ...]]:
    """A preprocessed stage, lifted for WebGL2, and the names of samplers whose textures are now parts of others.

    Triangles follow the nodes of hierarchies, as WebGL2 promises no more than 16 textures in a shader.
    """
    named = _NAMED.search(text)
    assert named is not None
    head = text.partition("#line")[0]
    lifted = lift(named[1], {key: int(value) for key, value in _DEFINE.findall(head)}, "webgl2").text
    row = "uniform int hierarchy_triangle_row;"
    merged, found = re.subn(r"^uniform usampler2D hierarchy_triangles;", row, lifted, flags=re.MULTILINE)
    of_nodes = "texelFetch(hierarchy_nodes, ivec2(0, hierarchy_triangle_row) + "
    return merged.replace("texelFetch(hierarchy_triangles, ", of_nodes), ("hierarchy_triangles",) * found
