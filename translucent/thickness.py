"""The ways to find the thickness of a body along each view ray, as frozen configurations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from translucent.errors import InputError
from translucent.mesh import MAX_COORDINATE

#: Passes over the geometry that anybody would wait for.
MAX_LAYERS = 4096

#: A pixel's surfaces must fit into the memory of a frame.
MAX_K = 256


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


@dataclass(frozen=True)
class DepthPeeling:
    """Ordered intervals from a pass over the geometry for every layer or two (Everitt 2001), with OpenGL 3.3.

    Coplanar faces survive, since a layer is told from the next by distance, medium and side, and those alike are
    counted.

    Parameters
    ----------
    max_layers : int
        Surfaces that a ray may cross; pixels with more are marked invalid.
    order : {"both-ends", "front-to-back", "back-to-front"}
        In which layers are peeled and composited; ``both-ends`` takes two with each pass (dual depth peeling, Bavoil &
        Myers 2008). Pixels with too many layers lose the last of them, or those in the middle.
    """

    max_layers: int = 64
    order: Literal["both-ends", "front-to-back", "back-to-front"] = "both-ends"

    def __post_init__(self) -> None:
        _check_count("DepthPeeling max_layers", self.max_layers, MAX_LAYERS)
        if self.order not in (orders := ("both-ends", "front-to-back", "back-to-front")):
            raise InputError(f"DepthPeeling order {self.order!r}", "not known", f"use one of {', '.join(orders)}")


@dataclass(frozen=True)
class FragmentLists:
    """Ordered intervals from one pass: every pixel keeps the list of its surfaces (Yang et al. 2010). OpenGL 4.3."""


@dataclass(frozen=True)
class KBuffer:
    """Ordered intervals from one pass that keeps the k nearest surfaces (Bavoil et al. 2007). OpenGL 4.3.

    Parameters
    ----------
    k : int
        Surfaces that a ray may cross; pixels with more are marked invalid.
    """

    k: int = 8

    def __post_init__(self) -> None:
        _check_count("KBuffer k", self.k, MAX_K)


def _check_count(what: str, value: object, most: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= most:
        raise InputError(f"{what} {value!r}", f"not a whole number in 1 to {most}", "give for example 8")


#: Methods that find the ordered intervals of each ray.
OrderedMethod = DepthPeeling | FragmentLists | KBuffer

Method = SignedDepth | BackFaceDepth | ThinLayer | OrderedMethod

#: Names on the command line.
METHODS: dict[str, type[Method]] = {
    "signed-depth": SignedDepth,
    "back-face-depth": BackFaceDepth,
    "thin-layer": ThinLayer,
    "depth-peeling": DepthPeeling,
    "fragment-lists": FragmentLists,
    "k-buffer": KBuffer,
}


def method_from_name(name: str) -> Method:
    """The method of this name, with its default parameters; raises `InputError` if there is none."""
    try:
        return METHODS[name.replace("_", "-").lower()]()
    except KeyError:
        raise InputError(f"method {name!r}", "not a known method", f"use one of {', '.join(METHODS)}") from None
