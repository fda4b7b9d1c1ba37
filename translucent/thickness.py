"""The ways to find the thickness of a body along each view ray, as frozen configurations."""

from __future__ import annotations

from dataclasses import dataclass

from translucent.errors import InputError
from translucent.mesh import MAX_COORDINATE


@dataclass(frozen=True)
class SignedDepth:
    """One unsorted pass: the sum of exit distances minus the sum of entry distances. Exact for closed meshes.

    Baker & Boyd 2001 without a sort, in float32 and anchored: distances count from the body's own center, so that
    precision does not depend on how far away the body is.

    Parameters
    ----------
    anchored : bool
        False counts distances from the camera, as engines do: a counter-example for measurements.
    """

    anchored: bool = True


@dataclass(frozen=True)
class BackFaceDepth:
    """Farthest back face minus nearest front face. Exact for convex bodies; other pixels are marked invalid."""


@dataclass(frozen=True)
class ThinLayer:
    """Every face is a sheet of the given thickness: t / max(0.001, n.v) each (Drobot 2017), added up.

    With a medium of ior > 1 the cosine is that of the refracted ray.

    Parameters
    ----------
    thickness : float
        In metres.
    """

    thickness: float = 1e-3

    def __post_init__(self) -> None:
        if not 0 < self.thickness <= MAX_COORDINATE:
            raise InputError(f"ThinLayer thickness {self.thickness}", "not above 0", "give metres, for example 1e-3")


Method = SignedDepth | BackFaceDepth | ThinLayer

#: Names on the command line.
METHODS: dict[str, type[Method]] = {
    "signed-depth": SignedDepth,
    "back-face-depth": BackFaceDepth,
    "thin-layer": ThinLayer,
}


def method_from_name(name: str) -> Method:
    """The method of this name, with its default parameters; raises `InputError` if there is none."""
    try:
        return METHODS[name.replace("_", "-").lower()]()
    except KeyError:
        raise InputError(f"method {name!r}", "not a known method", f"use one of {', '.join(METHODS)}") from None
