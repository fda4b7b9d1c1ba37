"""Thin layers: every face is a sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.errors import InputError
from translucent.geometry.mesh import MAX_COORDINATE
from translucent.planning.methods.base import Method


@dataclass(frozen=True)
class ThinLayer(Method):
    """Every face is a sheet of the given thickness: t / max(0.001, n.v) each (Drobot 2017), added up.

    With a medium of ior > 1 the cosine is that of the refracted ray.

    Parameters
    ----------
    thickness : float
        In metres.
    """

    name: ClassVar[str] = "thin-layer"
    makes_sheets: ClassVar[bool] = True

    thickness: float = 1e-3

    def __post_init__(self) -> None:
        if not 0 < self.thickness <= MAX_COORDINATE:
            raise InputError(f"ThinLayer thickness {self.thickness}", "not above 0", "give metres, for example 1e-3")

    @property
    def usual_thickness(self) -> float:
        """Metres through every face that declares none."""
        return self.thickness
