"""Back-face depth: farthest back face minus nearest front face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.planning.methods.base import Method


@dataclass(frozen=True)
class BackFaceDepth(Method):
    """Farthest back face minus nearest front face. Exact for convex bodies; other pixels are marked invalid."""

    name: ClassVar[str] = "back-face-depth"
    tells_media_apart: ClassVar[bool] = False
    convex_only: ClassVar[bool] = True
