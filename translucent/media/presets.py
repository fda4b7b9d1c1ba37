"""Named media with their sources, from ``presets.toml``, and how well absorption alone describes them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import Literal, cast

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.reading import toml_value
from translucent.formulas.color import to_hex
from translucent.media.medium import Medium
from translucent.suggestions import LEAST_PART, close_names, did_you_mean
from translucent.units import metres_per_unit, parse_length

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

#: Size in m of the body of `Preset.regime`.
BODY_SIZE = 1e-2
#: Albedo below which scattering is neglected ...
NEGLIGIBLE_ALBEDO = 0.1
#: ... or share of the light that crosses the body below which scattering is neglected.
NEGLIGIBLE_SCATTERING = 0.05
#: Smallest reduced albedo at which scattering dominates.
DOMINANT_ALBEDO = 0.5

_ALWAYS = {"kind", "source", "ior"}
_OPTIONAL = {"note", "aliases"}
_BY_COLOR = {"color", "distance"}
_BY_COEFFICIENTS = {"unit", "absorption"}
_SCATTERING = {"scattering", "anisotropy", "reduced_scattering"}
_KNOWN = _ALWAYS | _OPTIONAL | _BY_COLOR | _BY_COEFFICIENTS | _SCATTERING
_WELL_KNOWN = ("marble", "skim_milk", "merlot", "honey", "jade")


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
        Whether only sigma_s' = sigma_s (1 - g) was measured: the medium has it as its scattering, with g = 0.
    """

    name: str
    medium: Medium
    kind: Kind
    source: str
    note: str = ""
    aliases: tuple[str, ...] = ()
    channel_anisotropy: Triple = (0.0, 0.0, 0.0)
    reduced: bool = False

    def _repr_html_(self) -> str:
        """Name and swatches, for notebooks."""
        return f"<div>{self.name} ({self.kind})</div>{self.medium._repr_html_()}"

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
    def regime(self) -> Regime:
        """Regime of light transport in a body of 1 cm (`BODY_SIZE`); the channel that scatters most decides.

        "scattering dominated"
            In some channel, scattering that counts is as frequent as absorption (reduced albedo >= 0.5), and the
            reduced mean free path 1 / (sigma_a + sigma_s') is at most 1 cm. Light then forgets where it came from,
            and absorption along the view ray alone does not give the look.
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
            "source": self.source,
            "citation": PAPERS.get(self.source, ""),
            "note": self.note,
            "regime": self.regime,
            "warning": self.warning,
            "ior": self.medium.ior,
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
        }


def presets() -> dict[str, Preset]:
    """All presets by name, without their aliases."""
    return dict(_all())


def preset(name: str) -> Preset:
    """Preset of this name or alias, in any case and with any separators; raises `InputError` if there is none."""
    known = _names()
    key = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    if key in known:
        return known[key]
    speaking = [one.name for one in _all().values() if _speaks_of(one, key)]
    close = close_names(key, _all()) or close_names(key, known) or speaking
    number = len(_all())
    do = (
        f"{did_you_mean(close)} 'translucent presets' lists all {number}"
        if close
        else f"use one of {', '.join(_WELL_KNOWN)} and {number - len(_WELL_KNOWN)} more, see 'translucent presets'"
    )
    raise InputError(f"preset {name!r}", "not a known preset", do)


def read_presets(text: str, file: str = "presets.toml") -> dict[str, Preset]:
    """Presets of a TOML text; the head of ``presets.toml`` describes the format.

    Parameters
    ----------
    text : str
    file : str
        What errors call it.

    Raises
    ------
    InputError
        If an entry lacks a key, has an unknown one or a value of the wrong type, or a name is given twice.
    """
    try:
        entries = toml_value(text)
    except ValueError as error:
        raise InputError(file, f"no TOML: {error}", "correct the file") from None
    found = {name: _Entry(file, name, entry).preset() for name, entry in entries.items()}
    taken = set(found)
    for one in found.values():
        for alias in one.aliases:
            if alias in taken:
                raise InputError(f"{file}, [{one.name}]", f"alias {alias!r} is a name already", "choose another")
            taken.add(alias)
    return found


class _Entry:
    """Reader of one table of the file, key by key."""

    def __init__(self, file: str, name: str, entry: object) -> None:
        self.where, self.name = f"{file}, [{name}]", name
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
            raise InputError(self.where, "not a name in lower_snake_case", "write for example skim_milk")
        if not isinstance(entry, Mapping):
            raise InputError(self.where, "not a table", f"write [{name}], and its keys below")
        self.entry: Mapping[str, object] = entry
        self._check_keys()

    def _check_keys(self) -> None:
        given = set(self.entry)
        for key in sorted(given - _KNOWN):
            close = get_close_matches(key, sorted(_KNOWN), n=1)
            do = f"did you mean {close[0]!r}?" if close else f"use some of {', '.join(sorted(_KNOWN))}"
            raise InputError(self.where, f"unknown key {key!r}", do)
        body = _BY_COLOR if given & _BY_COLOR else _BY_COEFFICIENTS
        excluded = given & (_BY_COEFFICIENTS | _SCATTERING if body is _BY_COLOR else set())
        if "reduced_scattering" in given:
            excluded |= given & {"scattering", "anisotropy"}
        for key in sorted(excluded):
            other = "color" if body is _BY_COLOR else "reduced_scattering"
            raise InputError(self.where, f"both {key!r} and {other!r}", "give one or the other")
        for key in sorted((_ALWAYS | body | ({"scattering"} if "anisotropy" in given else set())) - given):
            raise InputError(self.where, f"no key {key!r}", "add it")

    def preset(self) -> Preset:
        """The preset that the table describes."""
        kind = self._text("kind")
        if kind not in ("measured", "estimated"):
            raise self._wrong("kind", '"measured" or "estimated"')
        anisotropy = self._triple("anisotropy") if "anisotropy" in self.entry else (0.0, 0.0, 0.0)
        try:
            medium = self._medium(anisotropy)
        except InputError as error:
            raise InputError(self.where, str(error)) from None
        return Preset(
            self.name,
            medium,
            cast(Kind, kind),
            self._text("source"),
            self._text("note") if "note" in self.entry else "",
            self._names("aliases") if "aliases" in self.entry else (),
            anisotropy,
            "reduced_scattering" in self.entry,
        )

    def _medium(self, anisotropy: Triple) -> Medium:
        ior = self._number("ior", self.entry["ior"])
        if "color" in self.entry:
            return Medium.from_color(self._triple("color"), parse_length(self._text("distance")), ior=ior)
        per_metre = 1.0 / metres_per_unit(self._text("unit"))
        key = "reduced_scattering" if "reduced_scattering" in self.entry else "scattering"
        for g in anisotropy:
            if not -1 < g < 1:
                raise self._wrong("anisotropy", "between -1 and 1")
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):  # a medium refuses what is not finite
            scattering = np.array(self._triple(key) if key in self.entry else (0.0, 0.0, 0.0)) * per_metre
            absorption = np.array(self._triple("absorption")) * per_metre
            total = float(scattering.sum())
            mean = float(scattering @ np.array(anisotropy)) / total if total > 0 else 0.0
        return Medium(absorption=absorption, scattering=scattering, anisotropy=mean, ior=ior)

    def _text(self, key: str) -> str:
        value = self.entry[key]
        if not (isinstance(value, str) and value.strip()):
            raise self._wrong(key, "a text")
        return value

    def _names(self, key: str) -> tuple[str, ...]:
        value = self.entry[key]
        if not (isinstance(value, list) and all(isinstance(v, str) for v in value)):
            raise self._wrong(key, "a list of names")
        return tuple(value)

    def _number(self, key: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._wrong(key, "a number")
        return float(value)

    def _triple(self, key: str) -> Triple:
        value = self.entry[key]
        if not (isinstance(value, list) and len(value) == 3):
            raise self._wrong(key, "three numbers [r, g, b]")
        r, g, b = (self._number(key, v) for v in value)
        return r, g, b

    def _wrong(self, key: str, do: str) -> InputError:
        return InputError(self.where, f"{key} = {self.entry[key]!r}", f"give {do}")


@cache
def _all() -> dict[str, Preset]:
    return read_presets(files("translucent").joinpath("media/presets.toml").read_text(encoding="utf-8"))


@cache
def _names() -> dict[str, Preset]:
    return {name: one for one in _all().values() for name in (one.name, *one.aliases)}


def _speaks_of(one: Preset, word: str) -> bool:
    """Whether the note contains the word, as that of merlot contains wine."""
    return len(word) >= LEAST_PART and word in re.findall(r"[a-z]+", one.note.lower())


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
