"""A picture of everything opaque that another renderer has drawn, in place of opaque objects and environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Frozen
from translucent.errors import InputError
from translucent.media.colors import ColorLike
from translucent.scene.environment import parse_radiance
from translucent.scene.lights import MAX_RADIANCE


@checked
@dataclass(frozen=True, eq=False)
class Backdrop(Frozen):
    """Picture of everything opaque in a frame: rays through the media end at its depth, and its radiance is seen there.

    Bodies throw the shadows of the scene's lights onto it, as onto opaque objects.

    The camera is that of the scene, and each pixel belongs to the ray through its center. Row 0 is the top row.

    Parameters
    ----------
    radiance : array_like (h, w, 3)
        Linear RGB.
    depth : array_like (h, w)
        Metres along the camera's forward axis, above 0: not along the ray. ``inf`` where nothing stops the ray; the
        radiance is seen there, too.
    coverage : array_like (h, w) of bool, optional
        Where the picture is; elsewhere the environment of the scene is seen. Default: everywhere.
    ambient : str, float or (3,), optional
        Radiance that lit the picture evenly from all around; default: the environment of the scene. With the lights of
        the scene it is taken for all the light that the picture shows: bodies throw shadows onto it, which leave the
        fraction of its radiance that reaches it of this light.

    Raises
    ------
    InputError
        If the shapes differ, radiance is not in 0 to 1e18, or depth is not above 0.
    """

    radiance: npt.NDArray[np.floating[Any]]
    depth: npt.NDArray[np.floating[Any]]
    coverage: npt.NDArray[np.bool_] | None = None
    ambient: ColorLike | None = None

    def __post_init__(self) -> None:
        radiance, depth = _numbers("radiance", self.radiance, np.float32), _numbers("depth", self.depth, np.float64)
        if depth.ndim != 2 or depth.size == 0:
            raise InputError("backdrop", f"the depth has shape {depth.shape}", "use the shape (h, w)")
        if radiance.shape != (*depth.shape, 3):
            raise InputError(
                "backdrop",
                f"the radiance has shape {radiance.shape}, and the depth has shape {depth.shape}",
                "use the shapes (h, w, 3) and (h, w)",
            )
        if wrong := np.count_nonzero(~((radiance >= 0) & (radiance <= MAX_RADIANCE))):
            raise InputError(
                "backdrop",
                f"{wrong} numbers of the radiance are outside 0 to {MAX_RADIANCE:g}",
                "give linear RGB radiance",
            )
        if wrong := np.count_nonzero(~(depth > 0)):
            raise InputError(
                "backdrop",
                f"the depth is not above 0 in {wrong} pixels",
                "give metres along the camera's forward axis, and inf for pixels without a surface",
            )
        self._freeze("radiance", radiance)
        self._freeze("depth", depth)
        if self.coverage is not None:
            coverage = np.array(self.coverage, order="C")
            if coverage.shape != depth.shape or coverage.dtype != bool:
                found = f"the coverage has the shape {coverage.shape} and the type {coverage.dtype}"
                raise InputError("backdrop", found, f"use an array of shape {depth.shape} and type bool")
            self._freeze("coverage", coverage)
        if self.ambient is not None:
            ambient = parse_radiance("ambient radiance of a backdrop", self.ambient)
            object.__setattr__(self, "ambient", tuple(ambient.tolist()))

    def __repr__(self) -> str:
        return f"Backdrop({self.size[0]}x{self.size[1]}, {np.count_nonzero(np.isfinite(self.depth))} pixels end rays)"

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.depth.shape[1], self.depth.shape[0]


def _numbers(field: str, value: npt.ArrayLike, dtype: Any) -> npt.NDArray[Any]:
    try:
        with np.errstate(over="ignore", under="ignore"):
            return np.array(value, order="C").astype(dtype)
    except (TypeError, ValueError):
        raise InputError("backdrop", f"the values of {field} are not numbers", "give arrays of floats") from None
