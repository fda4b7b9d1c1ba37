"""Uniform blocks: NumPy dtypes are the single source of their layout, in Python and in GLSL."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

#: GLSL type, size and alignment in bytes (std140) of a NumPy field. Other shapes are not used: std140 pads them oddly.
_TYPES: dict[tuple[str, tuple[int, ...]], tuple[str, int, int]] = {
    ("f", ()): ("float", 4, 4),
    ("i", ()): ("int", 4, 4),
    ("f", (2,)): ("vec2", 8, 8),
    ("f", (4,)): ("vec4", 16, 16),
    ("f", (4, 4)): ("mat4", 64, 16),
}


@dataclass(frozen=True)
class UniformBlock:
    """A named uniform block at a fixed binding point.

    Parameters
    ----------
    name : str
        Name of the block in GLSL, and of its generated include, ``#include <name>``.
    binding : int
        Binding point, the same in every program.
    fields : tuple of (name, base, shape)
        base is "f4" or "i4"; shape one of (), (2,), (4,) or (4, 4), matrices in row-major order for column vectors.
    """

    name: str
    binding: int
    fields: tuple[tuple[str, str, tuple[int, ...]], ...]

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Structured dtype with the offsets of std140."""
        offset = 0
        offsets = []
        for _, base, shape in self.fields:
            _, size, alignment = _TYPES[base[0], shape]
            offset = -(-offset // alignment) * alignment
            offsets.append(offset)
            offset += size
        return np.dtype(
            {
                "names": [name for name, _, _ in self.fields],
                "formats": [(base, shape) for _, base, shape in self.fields],
                "offsets": offsets,
                "itemsize": -(-offset // 16) * 16,
            }
        )

    @property
    def glsl(self) -> str:
        """Declaration for a shader."""
        members = "".join(f"    {_TYPES[base[0], shape][0]} {name};\n" for name, base, shape in self.fields)
        return f"layout(std140, row_major) uniform {self.name} {{\n{members}}};\n"

    def pack(self, **values: npt.ArrayLike) -> bytes:
        """Bytes of the block with these values; every field must be given."""
        record = np.zeros((), dtype=self.dtype)
        if values.keys() != set(self.dtype.names or ()):
            wrong = sorted(values.keys() ^ set(self.dtype.names or ()))
            raise KeyError(f"uniform block {self.name}: missing or unknown fields {wrong}")
        for name, value in values.items():
            record[name] = value
        return record.tobytes()


#: Per frame: the view rays. Pixels count right and down from the top left corner.
VIEW = UniformBlock(
    "View",
    0,
    (
        ("frame_size", "f4", (4,)),  # width, height, and the shift of the sample point, in pixels
        ("ray_right", "f4", (4,)),
        ("ray_up", "f4", (4,)),
        ("ray_forward", "f4", (4,)),
    ),
)

#: Per body: where it is, and what it is made of.
BODY = UniformBlock(
    "Body",
    1,
    (
        ("clip_from_offset", "f4", (4, 4)),
        ("world_from_normal", "f4", (4, 4)),
        ("axis", "f4", (4,)),  # camera's forward axis in object space; w: the anchor's place along it
        ("extinction", "f4", (4,)),
        ("sheet_thickness", "f4", ()),
        ("sheet_ior", "f4", ()),
        ("axial_start", "f4", ()),  # rays start here: what is behind counts as if it were at the start
        ("count_weight", "f4", ()),  # what one face adds to the count
    ),
)

#: Per frame: from path to radiance.
SHADE = UniformBlock(
    "Shade",
    2,
    (
        ("extinction", "f4", (4,)),
        ("emission", "f4", (4,)),
        ("environment_first", "f4", (4,)),
        ("environment_second", "f4", (4,)),
        ("expected_count", "f4", (2,)),  # least and greatest signed count of a trustworthy pixel
        ("negative_tolerance", "f4", ()),
        ("coverage_floor", "f4", ()),  # a path not longer than this is rounding
        ("environment_tiles", "f4", ()),
        ("environment_kind", "i4", ()),
    ),
)

BLOCKS = {block.name: block for block in (VIEW, BODY, SHADE)}
