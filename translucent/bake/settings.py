"""What a bake is asked for, checked once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from translucent.errors import InputError
from translucent.media.medium import Medium

Mode = Literal["normal", "cone", "transmittance", "inscribed", "local"]
Weighting = Literal["cosine", "uniform"]
Gaps = Literal["first-exit", "total"]

#: Largest map, in texels along a side.
MAX_SIZE = 16384

#: Most rays from one point, before those that a tolerance adds.
MAX_RAYS = 65536

#: The reach of mode "local" where none is given, as a share of the diagonal; the customary one of baking tools.
LOCAL_REACH = 0.1


@dataclass(frozen=True, eq=False)
class BakeSettings:
    """Settings of a bake; `translucent.bake_thickness` says what each does.

    Raises
    ------
    InputError
        If a value is outside its range, or mode "transmittance" has no medium that takes light away.
    """

    mode: Mode = "cone"
    size: int = 1024
    rays: int = 64
    spread: float = 180.0
    weighting: Weighting = "cosine"
    gaps: Gaps = "first-exit"
    max_distance: float | None = None
    ignore_back_faces: bool = False
    medium: Medium | None = None
    supersample: int = 1
    padding: int = 16
    seed: int = 0
    tolerance: float | None = None
    tile: int | None = None
    high_distance: float | None = None

    def __post_init__(self) -> None:
        _check_choice("mode", self.mode, Mode)
        _check_choice("weighting", self.weighting, Weighting)
        _check_choice("gaps", self.gaps, Gaps)
        _check_count("size", self.size, 1, MAX_SIZE, "give the texels along a side, for example 1024")
        # One ray of many tells no error; mode "normal" has only one.
        _check_count("rays", self.rays, 1 if self.mode == "normal" else 2, MAX_RAYS, "give for example 64")
        _check_count("supersample", self.supersample, 1, 16, "give 1 for none, or for example 2")
        _check_count("padding", self.padding, 0, MAX_SIZE, "give the texels around each chart, for example 16")
        _check_count("seed", self.seed, 0, 2**63 - 1, "give a whole number, for example 0")
        if not (_is_number(self.spread) and 0 < self.spread <= 180):
            raise InputError(
                f"spread {self.spread!r}", "not in 0 < spread <= 180 degrees", "give the full angle of the cone"
            )
        for name in ("max_distance", "tolerance", "high_distance"):
            value = getattr(self, name)
            if value is not None and not (_is_number(value) and 0 < value < math.inf):
                raise InputError(f"{name} {value!r}", "not positive and finite", "give metres above 0, or leave it out")
        if self.tile is not None and not (_is_whole(self.tile) and 1001 <= self.tile <= 9999):
            raise InputError(f"tile {self.tile!r}", "not a UDIM tile", "give 1001 to 9999, or leave it out")
        self._check_medium()

    def _check_medium(self) -> None:
        if self.mode != "transmittance":
            return
        if self.medium is None:
            raise InputError(
                "mode 'transmittance'",
                "no medium",
                "give one, for example tl.Medium.from_color('#7b1e3a', 0.01), or --color '#7b1e3a' --distance 1cm",
            )
        if not (self.medium.extinction > 0).any():
            raise InputError(
                "mode 'transmittance'", "a medium that takes no light away", "give one with absorption or scattering"
            )

    def summary(self) -> dict[str, object]:
        """The settings in values that JSON can hold; the medium by its extinction in 1/m."""
        known = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "medium"}
        return {**known, "extinction": None if self.medium is None else self.medium.extinction.tolist()}


def _is_whole(value: Any) -> bool:
    return not isinstance(value, bool) and hasattr(value, "__index__")


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and hasattr(value, "__float__")


def _check_choice(name: str, value: Any, choices: Any) -> None:
    if value not in get_args(choices):
        raise InputError(f"{name} {value!r}", "not known", f"use one of {', '.join(get_args(choices))}")


def _check_count(name: str, value: Any, low: int, high: int, do: str) -> None:
    if not (_is_whole(value) and low <= value <= high):
        raise InputError(f"{name} {value!r}", f"not a whole number in {low} to {high}", do)
