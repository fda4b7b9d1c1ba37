"""The ways to find the thickness of a body along each view ray, as frozen configurations."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Literal, get_args

from translucent.errors import InputError
from translucent.geometry.mesh import MAX_COORDINATE

#: Passes over the geometry that anybody would wait for.
MAX_LAYERS = 4096

#: More points in an interval change nothing that float32 could show.
MAX_LIGHT_POINTS = 16

#: A pixel's surfaces must fit into the memory of a frame.
MAX_K = 256

#: Steps of a ray through one interval that anybody would wait for.
MAX_STEPS = 65536

#: Gauss-Legendre points of an interval; smooth sources need far fewer for all digits of float64.
MAX_GAUSS_POINTS = 256

#: Where less than this share of the light of every channel gets through, a march on the GPU looks for no more sources.
LEAST_SEEN = 1e-5

Quadrature = Literal["left", "midpoint", "exponential", "jittered", "equiangular", "gauss"]


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
    """Ordered intervals from one pass: every pixel keeps the list of its surfaces (Yang et al. 2010). OpenGL 4.3.

    Parameters
    ----------
    light_points : int
        Where a medium scatters light: points at which each interval looks at each light.
    """

    light_points: int = 8

    def __post_init__(self) -> None:
        _check_count("FragmentLists light_points", self.light_points, MAX_LIGHT_POINTS)


@dataclass(frozen=True)
class KBuffer:
    """Ordered intervals from one pass that keeps the k nearest surfaces (Bavoil et al. 2007). OpenGL 4.3.

    Parameters
    ----------
    k : int
        Surfaces that a ray may cross; pixels with more are marked invalid.
    light_points : int
        Where a medium scatters light: points at which each interval looks at each light.
    """

    k: int = 8
    light_points: int = 8

    def __post_init__(self) -> None:
        _check_count("KBuffer k", self.k, MAX_K)
        _check_count("KBuffer light_points", self.light_points, MAX_LIGHT_POINTS)


@dataclass(frozen=True)
class RayMarched:
    """Steps along each ray through every interval inside the bodies; the error depends on their number.

    The one way where density varies from place to place. The quadratures and their orders of convergence, by steps N:

    - ``left``: the source at the beginning of each step, 1 / N (Riemann);
    - ``midpoint``: in its middle, 1 / N^2;
    - ``exponential``: the source in its middle, constant over the step, and its attenuation in closed form, 1 / N^2
      (Max 1995, section 4); exact for homogeneous media without scattering;
    - ``jittered``: at a random place in each step, N^-1.5 (stratified Monte Carlo, Mitchell 1996);
    - ``equiangular``: steps of equal angles as seen from a point light, and the middle of each (Kulla & Fajardo 2012);
    - ``gauss``: Gauss-Legendre points, beyond any order for smooth sources in homogeneous media; where density varies
      1 / N^2, since depths are sums over steps.

    Parameters
    ----------
    steps : int
        Through each interval between neighboring surfaces, 1 to 65536; at most 256 Gauss-Legendre points.
    quadrature : {"left", "midpoint", "exponential", "jittered", "equiangular", "gauss"}
    jitter : bool
        Moves all samples of a pixel by one random share of a step: bands turn into noise. For quadratures with steps
        and fixed places in them: not for ``jittered`` and ``gauss``.
    seed : int
        Of the random numbers, 0 to 2^32 - 1.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    steps: int = 256
    quadrature: Quadrature = "midpoint"
    jitter: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        _check_count("RayMarched steps", self.steps, MAX_STEPS)
        if self.quadrature not in (known := get_args(Quadrature)):
            raise InputError(
                f"RayMarched quadrature {self.quadrature!r}", "not known", f"use one of {', '.join(known)}"
            )
        if self.quadrature == "gauss":
            _check_count("RayMarched steps of gauss", self.steps, MAX_GAUSS_POINTS)
        if self.jitter and self.quadrature in ("jittered", "gauss"):
            raise InputError(
                f"RayMarched quadrature {self.quadrature!r} with jitter",
                "its samples have no fixed place in a step",
                "leave jitter out, or use midpoint",
            )
        if not isinstance(self.seed, int) or not 0 <= self.seed < 1 << 32:
            raise InputError(
                f"RayMarched seed {self.seed!r}", "not a whole number in 0 to 2^32 - 1", "give for example 0"
            )


def _check_count(what: str, value: object, most: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= most:
        raise InputError(f"{what} {value!r}", f"not a whole number in 1 to {most}", "give for example 8")


#: Methods that find the ordered intervals of each ray.
OrderedMethod = DepthPeeling | FragmentLists | KBuffer | RayMarched

Method = SignedDepth | BackFaceDepth | ThinLayer | OrderedMethod

#: Names on the command line.
METHODS: dict[str, type[Method]] = {
    "signed-depth": SignedDepth,
    "back-face-depth": BackFaceDepth,
    "thin-layer": ThinLayer,
    "depth-peeling": DepthPeeling,
    "fragment-lists": FragmentLists,
    "k-buffer": KBuffer,
    "ray-marched": RayMarched,
}


def method_from_name(name: str) -> Method:
    """The method of this name, with its default parameters; raises `InputError` if there is none."""
    try:
        return METHODS[name.replace("_", "-").lower()]()
    except KeyError:
        close = difflib.get_close_matches(name.replace("_", "-").lower(), METHODS, n=1)
        do = f"did you mean {close[0]}?" if close else f"use one of {', '.join(METHODS)}"
        raise InputError(f"method {name!r}", "not a known method", do) from None
