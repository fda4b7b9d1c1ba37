"""Signed depth: exits minus entries, in any order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.planning.methods.base import Method


@dataclass(frozen=True)
class SignedDepth(Method):
    """One unsorted pass: the sum of exit distances minus the sum of entry distances. Exact for closed meshes.

    Baker & Boyd 2001 without a sort, in float32 and anchored: distances count from the body's own center, so that
    precision does not depend on how far away the body is.

    Parameters
    ----------
    anchored : bool
        False counts distances from the camera, as engines do: a counter-example for measurements.
    """

    name: ClassVar[str] = "signed-depth"

    anchored: bool = True

    @property
    def counts_from_camera(self) -> bool:
        """Whether distances count from the camera, and lose digits with distance."""
        return not self.anchored
