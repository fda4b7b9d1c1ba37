"""What shines: point and directional lights, and the environment behind everything."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from translucent.camera import MAX_COORDINATE
from translucent.color import parse_color
from translucent.errors import InputError

Array = npt.NDArray[np.float64]
ColorLike = str | npt.ArrayLike
EnvironmentKind = Literal["constant", "gradient", "checkerboard"]

#: Largest radiance, intensity or irradiance: its products with lengths stay within float32.
MAX_RADIANCE = 1e18

_WHAT = "environment radiance"


@dataclass(frozen=True, eq=False)
class PointLight:
    """Light that shines alike in all directions and falls off with the inverse square (KHR_lights_punctual).

    Parameters
    ----------
    position : array_like (3,)
        In metres.
    intensity : array_like (3,)
        Radiant intensity in W/sr, linear RGB; one number stands for all channels.
    """

    position: npt.ArrayLike
    intensity: npt.ArrayLike

    def __post_init__(self) -> None:
        position = _vector("light position", self.position)
        if (farthest := float(np.abs(position).max())) > MAX_COORDINATE:
            raise InputError("light position", f"{farthest:.3g} m away", f"stay within {MAX_COORDINATE:g} m")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "intensity", _positive("light intensity", self.intensity))

    def irradiance_on(self, points: npt.ArrayLike, normals: npt.ArrayLike) -> Array:
        """Irradiance I cos / r^2 on surfaces that nothing shadows, (..., 3) in W/m^2; at most 1e18, and 0 in the light.

        Parameters
        ----------
        points : array_like (..., 3)
            In metres.
        normals : array_like (..., 3)
            Unit vectors.
        """
        towards = np.asarray(self.position) - np.asarray(points, dtype=np.float64)
        # In units of the largest coordinate no square overflows or vanishes.
        reach = np.maximum(np.abs(towards).max(axis=-1, keepdims=True), np.finfo(np.float64).tiny)
        with np.errstate(over="ignore", under="ignore"):
            scaled = towards / reach
            length = np.linalg.norm(scaled, axis=-1, keepdims=True)
            length = np.where(length > 0, length, 1.0)
            cosine = np.maximum(np.sum(scaled * np.asarray(normals), axis=-1, keepdims=True) / length, 0.0)
            irradiance = np.asarray(self.intensity) * cosine / (reach * length) / (reach * length)
        return np.asarray(np.minimum(irradiance, MAX_RADIANCE))


@dataclass(frozen=True, eq=False)
class DirectionalLight:
    """Light from infinitely far away (KHR_lights_punctual).

    Parameters
    ----------
    direction : array_like (3,)
        In which the light travels; any length but 0.
    irradiance : array_like (3,)
        On a surface that faces the light, in W/m^2, linear RGB.
    """

    direction: npt.ArrayLike
    irradiance: npt.ArrayLike

    def __post_init__(self) -> None:
        direction = _vector("light direction", self.direction)
        if not (length := float(np.linalg.norm(direction))) > 0:
            raise InputError("light direction", "its length is 0", "give the direction in which the light travels")
        direction = direction / length
        direction.setflags(write=False)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "irradiance", _positive("light irradiance", self.irradiance))

    def irradiance_on(self, points: npt.ArrayLike, normals: npt.ArrayLike) -> Array:
        """Irradiance on surfaces with unit `normals` (..., 3) that nothing shadows, (..., 3) in W/m^2, at any point."""
        with np.errstate(under="ignore"):
            cosine = np.maximum(-np.sum(np.asarray(normals) * np.asarray(self.direction), axis=-1, keepdims=True), 0.0)
            return np.asarray(cosine * np.asarray(self.irradiance))


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance from far behind everything. Made by `constant`, `gradient` or `checkerboard`.

    Attributes
    ----------
    kind : {"constant", "gradient", "checkerboard"}
    first, second : (3,)
        Linear radiance: bottom and top of a gradient, the two squares of a checkerboard.
    tiles : float
        Squares of a checkerboard along the height of the picture.
    """

    kind: EnvironmentKind
    first: Array
    second: Array
    tiles: float = 8.0

    def __post_init__(self) -> None:
        if self.kind not in get_args(EnvironmentKind):
            raise InputError(
                f"environment kind {self.kind!r}", "not known", f"use one of {', '.join(get_args(EnvironmentKind))}"
            )
        object.__setattr__(self, "first", _positive(_WHAT, self.first))
        object.__setattr__(self, "second", _positive(_WHAT, self.second))
        if not 0 < self.tiles <= 1e6:
            raise InputError(f"checkerboard of {self.tiles} tiles", "not in 0 to 1e6", "give for example 8")

    @classmethod
    def constant(cls, radiance: ColorLike) -> Environment:
        """The same radiance from everywhere."""
        return cls("constant", *2 * (parse_radiance(_WHAT, radiance),))

    @classmethod
    def gradient(cls, bottom: ColorLike, top: ColorLike) -> Environment:
        """From `bottom` for rays straight down (-Y) to `top` for rays straight up (+Y), linear in the sine between."""
        return cls("gradient", parse_radiance(_WHAT, bottom), parse_radiance(_WHAT, top))

    @classmethod
    def checkerboard(
        cls, first: ColorLike = (0.9, 0.9, 0.9), second: ColorLike = (0.6, 0.6, 0.6), tiles: float = 8.0
    ) -> Environment:
        """A backdrop of squares, fixed to the picture: it shows what a body lets through."""
        return cls("checkerboard", parse_radiance(_WHAT, first), parse_radiance(_WHAT, second), tiles)

    def radiance(self, directions: npt.ArrayLike, backdrop: npt.ArrayLike) -> Array:
        """Radiance along rays, (..., 3); the twin of ``shaders/lib/environment.glsl``.

        Parameters
        ----------
        directions : array_like (..., 3)
            Unit vectors.
        backdrop : array_like (..., 2)
            Position in the picture, right and down from the top left corner, in heights of the picture.
        """
        if self.kind == "checkerboard":
            share = checkerboard_share(backdrop, self.tiles)
        elif self.kind == "gradient":
            share = gradient_share(directions)
        else:
            share = np.zeros(np.asarray(directions).shape[:-1])
        return self.first + (self.second - self.first) * share[..., None]

    def irradiance_on(self, normals: npt.ArrayLike) -> Array:
        """Irradiance on surfaces with unit `normals` (..., 3) that nothing shadows, (..., 3).

        A backdrop fixed to the picture lights like the mean of its squares.
        """
        if self.kind == "gradient":
            share = gradient_irradiance_share(normals)
        else:
            share = np.full(np.asarray(normals).shape[:-1], 0.5)
        with np.errstate(under="ignore"):
            return np.asarray(np.pi * (self.first + (self.second - self.first) * share[..., None]))


def gradient_share(direction: npt.ArrayLike) -> Array:
    """Share of a gradient's top in direction (..., 3): (1 + y) / 2."""
    return np.asarray(0.5 + 0.5 * np.asarray(direction, dtype=np.float64)[..., 1])


def gradient_irradiance_share(normal: npt.ArrayLike) -> Array:
    """Share of a gradient's top in what a surface with unit normal (..., 3) receives.

    The cosine-weighted mean of `gradient_share` over the hemisphere: the mean of y there is 2/3 of the normal's y.
    """
    return np.asarray(0.5 + np.asarray(normal, dtype=np.float64)[..., 1] / 3.0)


def checkerboard_share(backdrop: npt.ArrayLike, tiles: npt.ArrayLike) -> Array:
    """1 in the second squares of a checkerboard at backdrop (..., 2), else 0; the top left square is a first one."""
    cell = np.floor(np.asarray(backdrop, dtype=np.float64) * np.asarray(tiles, dtype=np.float64)[..., None])
    return np.asarray(np.mod(cell[..., 0] + cell[..., 1], 2.0))


def _vector(what: str, value: npt.ArrayLike) -> Array:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{what} {value!r}", "not three finite numbers", "give (x, y, z)")
    vector.setflags(write=False)
    return vector


def _positive(what: str, value: npt.ArrayLike) -> Array:
    try:
        triple = np.broadcast_to(np.array(value, dtype=np.float64), (3,))
    except (TypeError, ValueError):
        raise InputError(f"{what} {value!r}", "not one or three numbers", "give (r, g, b)") from None
    triple = _vector(what, triple)
    if (triple < 0).any() or (triple > MAX_RADIANCE).any():
        raise InputError(
            f"{what} {tuple(triple.tolist())}", f"not in 0 to {MAX_RADIANCE:g}", "give values of 0 and above"
        )
    return triple


def parse_radiance(what: str, color: ColorLike) -> Array:
    """(3,): linear radiance from a color as text, or one or three numbers >= 0; errors name it `what`."""
    return _positive(what, parse_color(color) if isinstance(color, str) else color)
