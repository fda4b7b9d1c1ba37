"""Raw triangles, as files hold them, in the files' units."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError

#: Raw triangles: vertices (n, 3), faces (m, 3), and texture coordinates (n, 2) if there are some.
Triangles = tuple[Array, npt.NDArray[np.int32], Array | None]


def joined(parts: list[Triangles], asked: str) -> Triangles:
    """Concatenate the triangles of all parts; raises `InputError` if there are none."""
    if not parts:
        raise InputError(asked, "it has no faces", "give a triangle mesh, not points or lines")
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts[:-1])])
    faces = [part.astype(np.int64) + start for (_, part, _), start in zip(parts, starts.tolist(), strict=True)]
    uv = [coordinates for _, _, coordinates in parts if coordinates is not None]
    return (
        np.concatenate([vertices for vertices, _, _ in parts]),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(uv) if len(uv) == len(parts) else None,
    )
