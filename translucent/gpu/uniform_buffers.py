"""Uniform buffers of a picture: those that depend on its camera, body by body, and those shared by all samples."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from translucent.gpu.body_uniforms import BodyRoles, body_records, clip_rows
from translucent.gpu.layout import BODY, VIEW
from translucent.gpu.placement import PlacedScene, SampleView
from translucent.gpu.std140 import UniformBlock
from translucent.gpu.uniforms import media_center, view_uniforms

#: Offsets of uniform buffer ranges must be multiples of this on every driver in use.
_ALIGNMENT = 256

_STRIDE = -(-BODY.dtype.itemsize // _ALIGNMENT) * _ALIGNMENT


class UniformBuffers:
    """The buffers of all uniform blocks that programs read when they draw a scene as one camera sees it.

    Parameters
    ----------
    gl : moderngl.Context
    placed : PlacedScene
    roles : BodyRoles
        Of the objects of the scene.
    contents : mapping of UniformBlock to bytes
        Of the blocks that are alike for all samples of a picture.
    """

    def __init__(
        self,
        gl: moderngl.Context,
        placed: PlacedScene,
        roles: BodyRoles,
        contents: Mapping[UniformBlock, bytes],
    ) -> None:
        self._gl = gl
        self._placed = placed
        self._view = gl.buffer(reserve=VIEW.dtype.itemsize)
        records = body_records(placed, roles, media_center(placed.scene))
        self._content = np.zeros((len(records), _STRIDE), np.uint8)
        self._records = self._content[:, : BODY.dtype.itemsize].view(BODY.dtype)[:, 0]
        self._records[:] = records
        self.bodies = gl.buffer(reserve=self._content.nbytes)
        self._constant = {block: gl.buffer(content) for block, content in contents.items()}

    def place(self, view: SampleView) -> None:
        """Write and bind the uniforms for some sample points."""
        self._records["clip_from_offset"] = clip_rows(self._placed, view)
        self.bodies.write(self._content)
        self._view.write(view_uniforms(view, self._placed))
        self.bind()

    def add(self, block: UniformBlock, content: bytes) -> None:
        """Add a block that is the same for all samples; `bind` binds it."""
        if block in self._constant:
            self._constant[block].release()
        self._constant[block] = self._gl.buffer(content)

    def bind(self) -> None:
        """Bind these uniforms, where others have been bound since they were placed."""
        self._view.bind_to_uniform_block(VIEW.binding)
        for block, buffer in self._constant.items():
            buffer.bind_to_uniform_block(block.binding)

    def bind_body(self, number: int) -> None:
        """Bind the uniforms of one object for the next draw."""
        self.bodies.bind_to_uniform_block(BODY.binding, offset=number * _STRIDE, size=BODY.dtype.itemsize)

    def release(self) -> None:
        """Free the buffers."""
        for buffer in (self._view, self.bodies, *self._constant.values()):
            buffer.release()
