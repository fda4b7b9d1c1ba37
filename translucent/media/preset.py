"""A named medium: what it looks like, and what absorption alone shows of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from translucent.arrays import Array
from translucent.formulas.card import reflectance_on_card
from translucent.formulas.color import to_hex
from translucent.formulas.diffuse_interface import diffuse_interface, half_space_reflectance
from translucent.media.medium import Medium
from translucent.media.swatches import html_card

Kind = Literal["measured", "estimated"]
Regime = Literal["absorbing", "single scattering", "scattering dominated"]
Triple = tuple[float, float, float]

#: The papers that measured presets name as their source.
PAPERS = {
    "Jensen et al. 2001": "Jensen, Marschner, Levoy, Hanrahan: A Practical Model for Subsurface Light Transport, "
    "SIGGRAPH 2001",
    "Narasimhan et al. 2006": "Narasimhan, Gupta, Donner, Ramamoorthi, Nayar, Jensen: Acquiring Scattering Properties "
    "of Participating Media by Dilution, SIGGRAPH 2006",
}

#: Distances in m at which colors are listed.
COLOR_DISTANCES = {"1 mm": 1e-3, "1 cm": 1e-2, "10 cm": 1e-1}

#: Thicknesses in m of slabs on a card, and the cards with their reflectance.
SLABS = {"1 mm": 1e-3, "5 mm": 5e-3, "20 mm": 2e-2}
CARDS = {"white": 1.0, "black": 0.0}

#: Size in m of the body of `Preset.regime`.
BODY_SIZE = 1e-2
#: Albedo below which scattering is neglected ...
NEGLIGIBLE_ALBEDO = 0.1
#: ... or share of the light that crosses the body below which scattering is neglected.
NEGLIGIBLE_SCATTERING = 0.05
#: Smallest reduced albedo at which scattering dominates.
DOMINANT_ALBEDO = 0.5


@dataclass(frozen=True)
class Preset:
    """A named medium.

    Attributes
    ----------
    name : str
        In lower_snake_case.
    medium : Medium
        Coefficients in 1/m. A medium has one anisotropy for all channels; here it is the mean of the measured ones,
        weighted by scattering, so that the sum of the reduced scattering is kept.
    kind : {"measured", "estimated"}
    source : str
        The paper (see `PAPERS`), or how it was estimated.
    note : str
        What to know before using it, or nothing.
    aliases : tuple of str
        Other names.
    channel_anisotropy : tuple of 3 floats
        Henyey-Greenstein g as measured, for each channel.
    reduced : bool
        Whether only sigma_s' = sigma_s (1 - g) is known: the medium has it as its scattering, with g = 0.
    roughness : float
        Of a typical surface, 0 (polished) to 1, as in `Surface`; 0 also where nothing is said about it.
    group : str
        Heading under which it is listed, such as ``stone and resin``; empty if none.
    """

    name: str
    medium: Medium
    kind: Kind
    source: str
    note: str = ""
    aliases: tuple[str, ...] = ()
    channel_anisotropy: Triple = (0.0, 0.0, 0.0)
    reduced: bool = False
    roughness: float = 0.0
    group: str = ""

    def _repr_html_(self) -> str:
        """Name and swatches, for notebooks: of light that passes, and of slabs on a white and a black card."""
        cards = [
            html_card(card, zip(row, SLABS, strict=True))
            for card, row in zip(CARDS, self.slab_reflectance, strict=True)
        ]
        return f"<div>{self.name} ({self.kind})</div>{self.medium._repr_html_()}{''.join(cards)}"

    @property
    def absorption(self) -> Array:
        """(3,): sigma_a in 1/m."""
        return np.asarray(self.medium.absorption, dtype=np.float64)

    @property
    def scattering(self) -> Array:
        """(3,): sigma_s in 1/m; sigma_s' if `reduced`."""
        return np.asarray(self.medium.scattering, dtype=np.float64)

    @property
    def reduced_scattering(self) -> Array:
        """(3,): sigma_s' = sigma_s (1 - g) in 1/m, with each channel's own g."""
        return self.scattering * (1.0 - np.array(self.channel_anisotropy))

    @property
    def mean_free_path(self) -> Array:
        """(3,): 1 / sigma_t in m, the mean distance to the first event; inf where there is none."""
        return _reciprocal(self.medium.extinction)

    @property
    def albedo(self) -> Array:
        """(3,): single-scattering albedo sigma_s / sigma_t; 0 where nothing happens."""
        return _share(self.scattering, self.medium.extinction)

    @property
    def reduced_albedo(self) -> Array:
        """(3,): sigma_s' / (sigma_a + sigma_s'); 0 where nothing happens."""
        return _share(self.reduced_scattering, self.absorption + self.reduced_scattering)

    @property
    def diffusion_length(self) -> Array:
        """(3,): 1 / sigma_tr = 1 / sqrt(3 sigma_a (sigma_a + sigma_s')) in m, inf where nothing absorbs.

        How far light spreads by repeated scattering until 1/e is left; of use where the reduced albedo is high.
        """
        return _reciprocal(np.sqrt(3.0 * self.absorption * (self.absorption + self.reduced_scattering)))

    @property
    def diffuse_reflectance(self) -> Array:
        """(3,): share of white light from all sides that a thick slab scatters back through a polished surface.

        What the medium looks like where it is thick, without the mirror image on the surface: the share that enters,
        times `half_space_reflectance`: exact, with each channel's own anisotropy.
        """
        ior = self.medium.ior
        channels = zip(self.albedo.tolist(), self.channel_anisotropy, strict=True)
        given_back = [half_space_reflectance(min(albedo, 1.0), ior, float(g)) for albedo, g in channels]
        return diffuse_interface(ior).entering * np.array(given_back)

    @property
    def slab_reflectance(self) -> Array:
        """(2, 3, 3): what slabs of 1, 5 and 20 mm on a white and a black card (`CARDS`) send back of white light.

        From all sides to all sides, polished, without the mirror image, the card below in optical contact: as paint on
        a contrast chart. Exact where scattering is isotropic; else by the reduced coefficients; of thick
        slabs that is right to 0.04 (`diffuse_reflectance` is exact).
        """
        reduced = self.absorption + self.reduced_scattering
        return _on_cards(*(tuple(v.tolist()) for v in (self.reduced_albedo, reduced)), self.medium.ior)

    @property
    def regime(self) -> Regime:
        """Regime of light transport in a body of 1 cm (`BODY_SIZE`); the channel that scatters most decides.

        "scattering dominated"
            In some channel, scattering that counts is as frequent as absorption (reduced albedo >= 0.5), and the
            reduced mean free path 1 / (sigma_a + sigma_s') is at most 1 cm. Light then forgets where it came from,
            and absorption along the view ray alone does not give the look; `diffuse_reflectance` does.
        "absorbing"
            In each channel, less than a tenth of the events scatter (albedo < 0.1), or less than 5 % of the light
            is scattered within 1 cm (1 / sigma_s > 20 cm). Absorption alone gives the look.
        "single scattering"
            What is in between: absorption gives the color, and scattering adds a haze.
        """
        reduced_extinction = self.absorption + self.reduced_scattering
        if ((self.reduced_albedo >= DOMINANT_ALBEDO) & (reduced_extinction * BODY_SIZE >= 1.0)).any():
            return "scattering dominated"
        rare = (self.albedo < NEGLIGIBLE_ALBEDO) | (self.scattering * BODY_SIZE < NEGLIGIBLE_SCATTERING)
        return "absorbing" if rare.all() else "single scattering"

    @property
    def warning(self) -> str:
        """Warning about a scattering-dominated medium for users of absorption alone; empty for others."""
        if self.regime != "scattering dominated":
            return ""
        lengths = [f"{1e3 * v:.3g} mm" if np.isfinite(v) else "no end" for v in self.diffusion_length.tolist()]
        return (
            "scattering dominates, so absorption along the view ray alone does not show the look of this medium; light "
            f"spreads by the diffusion length 1/sigma_tr: {', '.join(lengths)} (red, green, blue)"
        )

    def colors(self) -> dict[str, str]:
        """Hex colors of white light after 1 mm, 1 cm and 10 cm, with absorption and scattering counted as lost."""
        return {text: _hex(self.medium.transmittance(metres)) for text, metres in COLOR_DISTANCES.items()}

    def diffuse_color(self) -> str:
        """Hex color of a thick slab in white light, `diffuse_reflectance`; empty for media that do not scatter."""
        return _hex(self.diffuse_reflectance) if self.medium.scatters else ""

    def slab_colors(self) -> dict[str, dict[str, str]]:
        """Hex colors of slabs of 1, 5 and 20 mm on a white and a black card, `slab_reflectance`."""
        return {
            card: dict(zip(SLABS, map(_hex, row), strict=True))
            for card, row in zip(CARDS, self.slab_reflectance, strict=True)
        }

    def absorption_colors(self) -> dict[str, str]:
        """Hex colors as in `colors`, of absorption alone."""
        absorbing = Medium(absorption=self.absorption)
        return {text: _hex(absorbing.transmittance(metres)) for text, metres in COLOR_DISTANCES.items()}

    def summary(self) -> dict[str, object]:
        """Everything about the preset, for JSON: coefficients in 1/m, lengths in m; a length without end is None."""
        return {
            "name": self.name,
            "aliases": list(self.aliases),
            "kind": self.kind,
            "group": self.group,
            "source": self.source,
            "citation": PAPERS.get(self.source, ""),
            "note": self.note,
            "regime": self.regime,
            "warning": self.warning,
            "ior": self.medium.ior,
            "roughness": self.roughness,
            "absorption": self.absorption.tolist(),
            "scattering": self.scattering.tolist(),
            "scattering_is_reduced": self.reduced,
            "reduced_scattering": self.reduced_scattering.tolist(),
            "extinction": self.medium.extinction.tolist(),
            "anisotropy": self.medium.anisotropy,
            "channel_anisotropy": list(self.channel_anisotropy),
            "albedo": self.albedo.tolist(),
            "mean_free_path": _finite(self.mean_free_path),
            "diffusion_length": _finite(self.diffusion_length),
            "colors": self.colors(),
            "absorption_colors": self.absorption_colors(),
            "diffuse_reflectance": self.diffuse_reflectance.tolist(),
            "diffuse_color": self.diffuse_color() or None,
            "slab_colors": self.slab_colors(),
        }


@lru_cache(maxsize=256)
def _on_cards(albedo: Triple, extinction: Triple, ior: float) -> Array:
    depth = np.array(list(SLABS.values()))[:, None] * extinction
    card = np.array(list(CARDS.values()))[:, None, None]
    found = reflectance_on_card(np.minimum(albedo, 1.0), depth, ior, card)
    found.setflags(write=False)
    return found


def _reciprocal(values: Array) -> Array:
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(1.0 / values)


def _share(part: Array, whole: Array) -> Array:
    return np.divide(part, whole, out=np.zeros(3), where=whole > 0)


def _finite(values: Array) -> list[float | None]:
    return [v if np.isfinite(v) else None for v in values.tolist()]


def _hex(linear: Array) -> str:
    with np.errstate(under="ignore"):
        return to_hex(linear)
