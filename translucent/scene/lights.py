"""Point and directional lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.frozen import Frozen
from translucent.scene.camera import MAX_COORDINATE

#: Largest radiance, intensity or irradiance: its products with lengths stay within float32.
MAX_RADIANCE = 1e18


@dataclass(frozen=True, eq=False)
class PointLight(Frozen):
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
        object.__setattr__(self, "intensity", positive_triple("light intensity", self.intensity))

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
class DirectionalLight(Frozen):
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
        # What has unit length keeps it to the last bit, so that copies of a light have the same direction.
        direction = direction / length if abs(length - 1.0) > 1e-15 else direction.copy()
        direction.setflags(write=False)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "irradiance", positive_triple("light irradiance", self.irradiance))

    def irradiance_on(self, points: npt.ArrayLike, normals: npt.ArrayLike) -> Array:
        """Irradiance on surfaces with unit `normals` (..., 3) that nothing shadows, (..., 3) in W/m^2, at any point."""
        with np.errstate(under="ignore"):
            cosine = np.maximum(-np.sum(np.asarray(normals) * np.asarray(self.direction), axis=-1, keepdims=True), 0.0)
            return np.asarray(cosine * np.asarray(self.irradiance))


def _vector(what: str, value: npt.ArrayLike) -> Array:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{what} {value!r}", "not three finite numbers", "give (x, y, z)")
    vector.setflags(write=False)
    return vector


def positive_triple(what: str, value: npt.ArrayLike) -> Array:
    """(3,) float64, read-only: one or three numbers in 0 to `MAX_RADIANCE`, else an `InputError` about `what`."""
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
