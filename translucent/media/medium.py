"""Homogeneous participating media."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array, Frozen
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.formulas.phase import HenyeyGreenstein, PhaseFunction
from translucent.media import conversion
from translucent.media.colors import hex_of_bytes, parse_color
from translucent.units import metres_in

Channels = npt.ArrayLike

#: Largest absorption and scattering in 1/m: far beyond any matter, and their products with lengths stay finite.
MAX_COEFFICIENT = 1e300

#: Largest emission in radiance per metre: its product with a length stays within float32.
MAX_EMISSION = 1e18

#: Largest index of refraction; germanium in the infrared has 4.
MAX_IOR = 100.0


@checked
@dataclass(frozen=True, eq=False)
class Medium(Frozen):
    """A homogeneous participating medium. Triples are linear Rec.709 channels; a single number is that of all three.

    Parameters
    ----------
    absorption : array_like (3,)
        sigma_a in 1/m, >= 0.
    scattering : array_like (3,)
        sigma_s in 1/m, >= 0: light that leaves the ray sideways.
    emission : array_like (3,)
        q in radiance per metre, >= 0.
    anisotropy : float
        Mean cosine g of the angle that scattered light is deflected by, -1 < g < 1: by the phase function of Henyey and
        Greenstein, where no other is given.
    ior : float
        Index of refraction, >= 1; 1 is index-matched.
    phase : PhaseFunction, optional
        Phase function in place of Henyey and Greenstein's; it determines `anisotropy`.

    Raises
    ------
    InputError
        If a value is outside its range or not finite.
    """

    absorption: Channels = (0.0, 0.0, 0.0)
    scattering: Channels = (0.0, 0.0, 0.0)
    emission: Channels = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0
    ior: float = 1.0
    phase: PhaseFunction | None = None

    def __post_init__(self) -> None:
        for field in ("absorption", "scattering", "emission"):
            object.__setattr__(self, field, _channels(field, getattr(self, field)))
        if self.phase is not None:
            if self.anisotropy not in (0.0, self.phase.mean_cosine):
                raise InputError(
                    f"medium anisotropy {self.anisotropy}",
                    f"the phase function {self.phase} already determines the anisotropy",
                    "give either anisotropy or phase",
                )
            object.__setattr__(self, "anisotropy", self.phase.mean_cosine)
        if not -1 < self.anisotropy < 1:
            raise InputError(
                f"medium anisotropy {self.anisotropy}",
                "the anisotropy must lie between -1 and 1",
                "use a value such as 0.8",
            )
        if not 1 <= self.ior <= MAX_IOR:
            raise InputError(
                f"medium ior {self.ior}",
                f"the index of refraction must lie in 1 to {MAX_IOR:g}",
                "use a value such as 1.5 for glass",
            )

    @classmethod
    @checked
    def from_color(cls, color: str | npt.ArrayLike, distance: float, ior: float = 1.0) -> Medium:
        """Absorbing medium that turns white light into `color` after `distance`: sigma_a = -log(t_c) / d.

        Parameters
        ----------
        color : str or array_like (3,)
            Transmitted color: hex and names are sRGB, bare triples linear; each channel in 0 < t_c <= 1.
        distance : float
            In metres, > 0. Infinity leaves white light white, as an absent glTF attenuationDistance does.
        ior : float
            Index of refraction.

        Raises
        ------
        InputError
            If a channel is 0 (no finite extinction makes it: see `clamp_colors`), above 1 or not finite, or the
            distance is not positive.
        """
        triple = parse_color(color)
        bytes_of_color = hex_of_bytes(triple.tolist())
        for channel, value in zip(("red", "green", "blue"), triple, strict=True):
            if not 0 < value <= 1:
                raise InputError(
                    f"color {color!r}" if isinstance(color, str) else f"color {tuple(triple.tolist())}",
                    f"{channel} = {value:g} is not in 0 < t <= 1",
                    "a channel of 0 would need an infinite extinction; use a value such as 0.001 for nearly black"
                    if value <= 0 and not bytes_of_color
                    else f"write {bytes_of_color!r} if these are numbers from 0 to 255"
                    if bytes_of_color
                    else "a medium cannot amplify light; scale the color to at most 1",
                )
        try:
            metres = float(distance)
        except (TypeError, ValueError):
            metres = np.nan
        if (stated := metres_in(str(distance))) is not None:
            raise InputError(
                f"distance {distance!r}",
                "the distance is a text with a unit",
                f"give the distance in metres: {stated:g}",
            )
        if not metres > 0:
            raise InputError(
                f"distance {distance!r}",
                "the distance must be above 0",
                "give the distance in metres, for example 0.02",
            )
        with np.errstate(over="ignore", under="ignore"):
            extinction = optics.extinction_from_color(triple, metres)
        if not (extinction <= MAX_COEFFICIENT).all():
            raise InputError(
                f"distance {metres:g} m",
                "the distance is so short that the extinction overflows",
                "check the unit of the distance",
            )
        return cls(absorption=extinction, ior=ior)

    @classmethod
    @checked
    def from_particles(
        cls,
        number_density: float,
        radius: float,
        albedo: Channels = 0.0,
        glow: Channels = 0.0,
        anisotropy: float = 0.0,
    ) -> Medium:
        """Medium of many small opaque spheres: sigma_t = rho A with their projected area A = pi r^2.

        Max 1995, sections 2 to 5: of the light that hits a particle it scatters the fraction `albedo` and absorbs
        the rest, and it sends out the radiance `glow` where it absorbs, so that q = sigma_a glow.

        Parameters
        ----------
        number_density : float
            rho, particles per cubic metre, >= 0.
        radius : float
            r in metres, >= 0.
        albedo : array_like (3,)
            0 to 1: black particles, which only absorb, to white ones.
        glow : array_like (3,)
            Radiance of the particles themselves, >= 0.
        anisotropy : float
            Henyey-Greenstein g, -1 < g < 1.

        Raises
        ------
        InputError
            If a value is outside its range or not finite.
        """
        for name, value in (("number_density", number_density), ("radius", radius)):
            if not 0 <= value < np.inf:
                raise InputError(
                    f"particles of {name} {value}",
                    "the value must be a number of 0 or above",
                    "give the value in metres",
                )
        fractions = _channels("albedo", albedo)
        if (fractions > 1).any():
            raise InputError(
                f"medium albedo {tuple(fractions.tolist())}",
                "the albedo is above 1",
                "particles cannot scatter more light than hits them",
            )
        # What overflows is refused as any medium is.
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            extinction = number_density * np.pi * radius * radius
            absorption, scattering = extinction * (1.0 - fractions), extinction * fractions
            return cls(absorption, scattering, absorption * _channels("glow", glow), anisotropy)

    @checked
    def diluted(self, times: float) -> Medium:
        """Medium whose absorption, scattering and emission are so many times as small.

        Raises
        ------
        InputError
            If the number is not above 0.
        """
        if not (math.isfinite(times) and times > 0):
            raise InputError(
                f"medium diluted {times:g} times", "the number must be finite and above 0", "use a value such as 5"
            )
        absorption, scattering, emission = (
            np.asarray(one) / times for one in (self.absorption, self.scattering, self.emission)
        )
        return replace(self, absorption=absorption, scattering=scattering, emission=emission)

    @cached_property
    def extinction(self) -> Array:
        """(3,): sigma_t = sigma_a + sigma_s in 1/m."""
        total = np.asarray(np.add(self.absorption, self.scattering))
        total.setflags(write=False)
        return total

    @checked
    def transmittance(self, distance: npt.ArrayLike) -> Array:
        """(..., 3): fraction of light per channel that passes `distance` (...,) metres of the medium, 0 and above.

        Raises
        ------
        InputError
            If a distance is below 0.
        """
        with np.errstate(under="ignore", invalid="ignore", over="ignore"):
            optical_depth = conversion.lengths(distance)[..., None] * self.extinction
        # Without extinction even an infinite path, 0 times infinity, loses nothing.
        return optics.transmittance(np.where(self.extinction == 0, 0.0, optical_depth))

    @property
    def mean_free_path(self) -> Array:
        """(3,): 1 / sigma_t in m, after which 1/e is left; inf where there is no extinction."""
        return conversion.mean_free_path(self.extinction)

    @property
    def half_value_thickness(self) -> Array:
        """(3,): ln 2 / sigma_t in m, after which half is left; inf where there is no extinction."""
        return conversion.half_value_thickness(self.extinction)

    def _repr_html_(self) -> str:
        """Swatches of white light after 0.1 to 10 times the 1/e distance, for notebooks."""
        from translucent.media.conversion import html_strip

        return html_strip(self.extinction)

    @cached_property
    def emits(self) -> bool:
        """True if any channel emits."""
        return bool(np.any(np.asarray(self.emission) > 0))

    @cached_property
    def scatters(self) -> bool:
        """True if any channel scatters."""
        return bool(np.any(np.asarray(self.scattering) > 0))

    @cached_property
    def phase_function(self) -> PhaseFunction:
        """Phase function of the scattered light: `phase`, or that of Henyey and Greenstein."""
        return self.phase or HenyeyGreenstein(self.anisotropy)

    def _key(self) -> tuple[object, ...]:
        triples = (np.asarray(v) for v in (self.absorption, self.scattering, self.emission))
        return (*(tuple(t.tolist()) for t in triples), self.phase_function, self.ior)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Medium) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())


def _channels(field: str, value: Channels) -> Array:
    try:
        triple = np.broadcast_to(np.array(value, dtype=np.float64), (3,)).copy()
    except (TypeError, ValueError):
        raise InputError(
            f"medium {field} {value!r}", "the value must be one or three numbers", "give (r, g, b) in 1/m"
        ) from None
    limit = MAX_EMISSION if field == "emission" else MAX_COEFFICIENT
    if (triple > limit).any() and np.isfinite(triple).all():
        raise InputError(
            f"medium {field} {tuple(triple.tolist())}",
            f"the value is above the limit of {limit:g}",
            "check the unit of length",
        )
    if not (np.isfinite(triple).all() and (triple >= 0).all()):
        raise InputError(
            f"medium {field} {tuple(triple.tolist())}", "a value is negative or not finite", "give values of 0 or above"
        )
    triple.setflags(write=False)
    return triple


#: Medium of what has none.
VACUUM = Medium()


#: Darkest channel that is written, and the value that a channel of 0 is read as: no finite extinction makes black.
BLACKEST = 1e-5


def color_at(medium: Medium, distance: float | None = None) -> tuple[Array, float]:
    """Color that white light has after `distance` of the medium, and the distance.

    Parameters
    ----------
    medium : Medium
    distance : float, optional
        In metres, > 0. None, or a distance that leaves a channel darker than `BLACKEST`: where the densest channel
        lets 1/e pass.

    Returns
    -------
    (3,) float64, float
        Linear color, 0 < T <= 1, and metres. A medium without extinction is white after `distance`, or at infinity.

    Raises
    ------
    InputError
        If the distance is not positive.
    """
    if distance is not None and not distance > 0:
        raise InputError(
            f"distance {distance!r}", "the distance must be above 0", "give the distance in metres, for example 0.02"
        )
    densest = float(medium.extinction.max())
    if densest == 0:
        return np.ones(3), math.inf if distance is None else float(distance)
    metres = 1.0 / densest if distance is None or densest * distance > -math.log(BLACKEST) else float(distance)
    color = medium.transmittance(metres)
    # 15 digits turn what a logarithm and an exponential made of 0.18 back into 0.18.
    return np.array([float(f"{value:.15g}") for value in color]), metres


def extinction_at(color: npt.ArrayLike, distance: float) -> Array:
    """(3,): sigma_t in 1/m of a stored color; a channel of 0 counts as `BLACKEST`, an infinite distance gives 0.

    Stored files may hold black, which has no finite extinction. Renderers differ there: undefined, clamped, or opaque
    from the surface on. Here it is always clamped, so that the result is finite.
    """
    triple = np.asarray(color, dtype=np.float64)
    if math.isinf(distance):
        return np.zeros(3)
    with np.errstate(under="ignore", over="ignore"):  # a medium refuses infinity
        return optics.extinction_from_color(np.where(triple == 0, BLACKEST, triple), distance)
