"""Textures that vary a surface over the texture coordinates of its mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked, vectors
from translucent.arrays import Frozen
from translucent.errors import InputError

Wrap = Literal["repeat", "clamp"]


@checked
@dataclass(frozen=True, eq=False)
class Texture(Frozen):
    """Texture: values over texture coordinates 0 to 1, with bilinear interpolation.

    The coordinates of the mesh are multiplied by `scale`, turned by `rotation` about (0, 0), then moved by `offset`.

    Parameters
    ----------
    pixels : array_like (h, w, 3) or (h, w, 4)
        0 to 1, linear (an sRGB picture has to be decoded first); row 0 is the top, where v = 1. The fourth channel is
        opacity, 1 where there is none.
    scale, offset : array_like (2,)
    rotation : float
        Degrees, counterclockwise as v counts upwards.
    wrap : ({"repeat", "clamp"}, {"repeat", "clamp"})
        What is beyond 0 to 1 in u and in v: the picture again, or its edge.

    Raises
    ------
    InputError
        If the pixels are no picture, or not in 0 to 1.
    """

    pixels: npt.NDArray[np.float32]
    scale: npt.ArrayLike = (1.0, 1.0)
    offset: npt.ArrayLike = (0.0, 0.0)
    rotation: float = 0.0
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")

    def __post_init__(self) -> None:
        try:
            pixels = np.array(self.pixels, dtype=np.float32, order="C")
        except (TypeError, ValueError):
            raise InputError("texture", "the pixels are not numbers", "give an array of shape (h, w, 3)") from None
        if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.size == 0:
            raise InputError(
                "texture", f"the pixels have the shape {pixels.shape}", "give an array of shape (h, w, 3) or (h, w, 4)"
            )
        if wrong := np.count_nonzero(~((pixels >= 0) & (pixels <= 1))):
            raise InputError(
                "texture", f"{wrong} numbers of the pixels are outside 0 to 1", "give linear values from 0 to 1"
            )
        self._freeze("pixels", pixels)
        for field in ("scale", "offset"):
            pair = np.array(getattr(self, field), dtype=np.float64)
            if pair.shape != (2,) or not np.isfinite(pair).all():
                raise InputError(
                    f"texture {field} {getattr(self, field)!r}",
                    "the value must be two finite numbers",
                    "give two numbers (u, v)",
                )
            self._freeze(field, pair)
        if not np.isfinite(self.rotation):
            raise InputError(
                f"texture rotation {self.rotation!r}", "the rotation must be finite", "give the rotation in degrees"
            )
        if len(self.wrap) != 2 or not set(self.wrap) <= set(get_args(Wrap)):
            raise InputError(
                f"texture wrap {self.wrap!r}",
                "the value must be two of the words repeat and clamp",
                'write ("repeat", "repeat"), for example',
            )

    def __repr__(self) -> str:
        return f"Texture({self.pixels.shape[1]}x{self.pixels.shape[0]})"

    @property
    def rows(self) -> npt.NDArray[np.float64]:
        """(2, 3): matrix from (u, v, 1) of the mesh to the picture's own coordinates, v upwards."""
        c, s = np.cos(np.radians(self.rotation)), np.sin(np.radians(self.rotation))
        turned = np.array([[c, -s], [s, c]]) * np.asarray(self.scale)
        return np.column_stack([turned, np.asarray(self.offset)])

    @checked
    def sample(self, uv: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(..., 3) or (..., 4): bilinear values at texture coordinates (..., 2), v upwards."""
        height, width = self.pixels.shape[:2]
        at = vectors("uv", uv, 2, "texture coordinates") @ self.rows[:, :2].T + self.rows[:, 2]
        column, row = at[..., 0] * width - 0.5, (1.0 - at[..., 1]) * height - 0.5
        left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
        right_weight, low_weight = (column - left)[..., None], (row - top)[..., None]
        columns = [_wrapped(left + i, width, self.wrap[0]) for i in (0, 1)]
        rows = [_wrapped(top + i, height, self.wrap[1]) for i in (0, 1)]
        upper = self.pixels[rows[0], columns[0]] * (1 - right_weight) + self.pixels[rows[0], columns[1]] * right_weight
        lower = self.pixels[rows[1], columns[0]] * (1 - right_weight) + self.pixels[rows[1], columns[1]] * right_weight
        return np.asarray(upper * (1 - low_weight) + lower * low_weight)


def _wrapped(index: npt.NDArray[np.int64], size: int, wrap: Wrap) -> npt.NDArray[np.int64]:
    return np.clip(index, 0, size - 1) if wrap == "clamp" else index % size


#: Texels in each direction.
SIZE = 64


@dataclass(frozen=True, eq=False)
class Falloff(Texture):
    """Texture of a fraction of gray: 1 around its middle, `far` at the radius of its edges and beyond.

    Attributes
    ----------
    start : float
        Radius in texture coordinates, 0 to 1/2, at which it begins to get darker, by a smooth step.
    far : float
        Share at the radius 1/2.
    """

    start: float = 0.0
    far: float = 1.0

    @classmethod
    def around(cls, start: float, far: float) -> Falloff:
        """Falloff from a radius on, to a fraction."""
        place = (np.arange(SIZE) + 0.5) / SIZE - 0.5
        fraction = np.clip((np.hypot(place[:, None], place) - start) / (0.5 - start), 0.0, 1.0)
        values = 1.0 + (far - 1.0) * fraction * fraction * (3.0 - 2.0 * fraction)
        return cls(np.repeat(values[..., None], 3, axis=-1), wrap=("clamp", "clamp"), start=start, far=far)
