"""Presets: named media, and the text format of files that hold them."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.reading import json_value, read_text, toml_value
from translucent.formulas.color import to_hex
from translucent.formulas.diffuse_interface import diffuse_interface, half_space_reflectance
from translucent.formulas.phase import HenyeyGreenstein, PhaseFunction, parse_phase
from translucent.formulas.slab import reflectance_on_card
from translucent.media.colors import html_card, parse_color
from translucent.media.medium import Medium
from translucent.units import metres_per_unit, parse_length

Kind = Literal["measured", "estimated"]
Regime = Literal["absorbing", "single scattering", "scattering dominated"]
PatternName = Literal["", "veins", "bubbles", "blotches"]
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
#: ... or fraction of the light that crosses the body below which scattering is neglected.
NEGLIGIBLE_SCATTERING = 0.05
#: Smallest reduced albedo at which scattering dominates.
DOMINANT_ALBEDO = 0.5


@checked
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
    pattern : {"", "veins", "bubbles", "blotches"}
        Of a typical surface; see `translucent.scene.patterns`.
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
    pattern: PatternName = ""

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
        return _ratio(self.scattering, self.medium.extinction)

    @property
    def reduced_albedo(self) -> Array:
        """(3,): sigma_s' / (sigma_a + sigma_s'); 0 where nothing happens."""
        return _ratio(self.reduced_scattering, self.absorption + self.reduced_scattering)

    @property
    def diffusion_length(self) -> Array:
        """(3,): 1 / sigma_tr = 1 / sqrt(3 sigma_a (sigma_a + sigma_s')) in m, inf where nothing absorbs.

        How far light spreads by repeated scattering until 1/e is left; of use where the reduced albedo is high.
        """
        return _reciprocal(np.sqrt(3.0 * self.absorption * (self.absorption + self.reduced_scattering)))

    @property
    def diffuse_reflectance(self) -> Array:
        """(3,): fraction of white light from all sides that a thick slab scatters back through a polished surface.

        What the medium looks like where it is thick, without the mirror image on the surface: the fraction that enters,
        times `half_space_reflectance`: exact, with each channel's own anisotropy.
        """
        ior = self.medium.ior
        phases = [self.medium.phase or HenyeyGreenstein(float(g)) for g in self.channel_anisotropy]
        channels = zip(self.albedo.tolist(), phases, strict=True)
        reflected = [half_space_reflectance(min(albedo, 1.0), ior, phase) for albedo, phase in channels]
        return diffuse_interface(ior).entering * np.array(reflected)

    @property
    def slab_reflectance(self) -> Array:
        """(2, 3, 3): reflected color of slabs of 1, 5 and 20 mm on a white and a black card (`CARDS`) in white light.

        From all sides to all sides, polished, without the mirror image, the card below in optical contact: as on
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
            What is in between: absorption gives the color, and scattering makes it milky.
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
            "pattern": self.pattern,
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


def _ratio(part: Array, whole: Array) -> Array:
    return np.divide(part, whole, out=np.zeros(3), where=whole > 0)


def _finite(values: Array) -> list[float | None]:
    return [v if np.isfinite(v) else None for v in values.tolist()]


def _hex(linear: Array) -> str:
    with np.errstate(under="ignore"):
        return to_hex(linear)


_ALWAYS = {"kind", "source", "ior"}
_OPTIONAL = {"group", "note", "aliases", "roughness", "pattern"}
_BY_COLOR = {"color", "distance"}
_BY_COEFFICIENTS = {"unit", "absorption"}
_UNREDUCED = {"scattering", "anisotropy", "phase"}
_KNOWN = _ALWAYS | _OPTIONAL | _BY_COLOR | _BY_COEFFICIENTS | _UNREDUCED | {"reduced_scattering", "emission"}


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
    found = {name: _Entry(file, name, entry).preset() for name, entry in _entries(text, file).items()}
    taken = set(found)
    for one in found.values():
        for alias in one.aliases:
            if alias in taken:
                raise InputError(
                    f"{file}, [{one.name}]",
                    f"the alias {alias!r} is already the name of a preset",
                    "choose another alias",
                )
            taken.add(alias)
    return found


def read_good_presets(text: str, file: str) -> tuple[dict[str, Preset], list[InputError]]:
    """Readable presets of a TOML text, and the errors of the others, each with its line."""
    found: dict[str, Preset] = {}
    wrong = []
    try:
        entries = _entries(text, file)
    except InputError as error:
        return {}, [error]
    for name, entry in entries.items():
        try:
            found[name] = _Entry(file, name, entry).preset()
        except InputError as error:
            line = _line(text, name, str(error).partition("; ")[2])
            wrong.append(InputError(f"{file}, line {line}, {str(error).removeprefix(f'{file}, ')}"))
    return found, wrong


def preset_text(one: Preset) -> str:
    """Text of an entry, which `read_presets` reads."""
    medium = one.medium
    values: dict[str, object] = {"kind": one.kind}
    values |= {"group": one.group} if one.group else {}
    values |= {"source": one.source, "unit": "m", "absorption": one.absorption.tolist()}
    if one.reduced:
        values |= {"reduced_scattering": one.scattering.tolist()}
    elif medium.scatters:
        values |= {"scattering": one.scattering.tolist()}
        values |= {"phase": str(medium.phase)} if medium.phase else {"anisotropy": list(one.channel_anisotropy)}
    emission = np.asarray(medium.emission, dtype=np.float64).tolist()
    values |= {"emission": emission} if any(emission) else {}
    values |= {"ior": float(medium.ior)}
    values |= {"roughness": one.roughness} if one.roughness else {}
    values |= {"pattern": one.pattern} if one.pattern else {}
    values |= {"note": one.note} if one.note else {}
    values |= {"aliases": list(one.aliases)} if one.aliases else {}
    # JSON's numbers, lists and strings are TOML's.
    written = {key: json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f") for key, value in values.items()}
    return "\n".join([f"[{one.name}]", *(f"{key} = {value}" for key, value in written.items()), ""])


def _entries(text: str, file: str) -> dict[str, object]:
    try:
        return toml_value(text)
    except ValueError as error:
        raise InputError(file, f"the file is not valid TOML: {error}", "correct the file") from None


def _line(text: str, name: str, reason: str) -> int:
    """Number of the line of an entry that a reason speaks of: that of its key, or the entry's first."""
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if re.match(rf"\s*\[?{re.escape(name)}\b", line)]
    first = heads[0] if heads else 0
    for i in range(first + 1, len(lines)):
        if lines[i].lstrip().startswith("["):
            break
        key = lines[i].partition("=")[0].strip()
        if key and re.search(rf"\b{re.escape(key)}\b", reason.partition("; ")[0]):
            return i + 1
    return first + 1


class _Entry:
    """Reader of one table of the file, key by key."""

    def __init__(self, file: str, name: str, entry: object) -> None:
        self.where, self.name = f"{file}, [{name}]", name
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
            raise InputError(self.where, "the name is not in lower_snake_case", "write a name such as skim_milk")
        if not isinstance(entry, Mapping):
            raise InputError(
                self.where, "the value is not a table", f"write [{name}], and the keys of the preset below"
            )
        self.entry: Mapping[str, object] = entry
        self._check_keys()

    def _check_keys(self) -> None:
        given = set(self.entry)
        for key in sorted(given - _KNOWN):
            close = get_close_matches(key, sorted(_KNOWN), n=1)
            do = f"did you mean {close[0]!r}?" if close else f"use one of {', '.join(sorted(_KNOWN))}"
            raise InputError(self.where, f"unknown key {key!r}", do)
        if given & _BY_COLOR:
            self._check_by_color(given)
            return
        if "reduced_scattering" in given:
            self._exclude(given & _UNREDUCED, "reduced_scattering")
        if "phase" in given:
            self._exclude(given & {"anisotropy"}, "phase")
        self._require(_ALWAYS | _BY_COEFFICIENTS | ({"scattering"} if given & _UNREDUCED else set()), given)

    def _check_by_color(self, given: set[str]) -> None:
        self._exclude(given & {"absorption"}, "color")
        for key in sorted(given & _UNREDUCED):
            do = "give 'reduced_scattering', sigma_s (1 - g), instead"
            raise InputError(self.where, f"the key {key!r} cannot be combined with 'color'", do)
        per_length = bool(given & {"reduced_scattering", "emission"})
        if "unit" in given and not per_length:
            raise InputError(
                self.where,
                "the key 'unit' cannot be combined with 'color'",
                "omit 'unit': the text of 'distance' contains its own unit, and only scattering needs this key",
            )
        self._require(_ALWAYS | _BY_COLOR | ({"unit"} if per_length else set()), given)

    def _exclude(self, keys: set[str], other: str) -> None:
        for key in sorted(keys):
            raise InputError(self.where, f"the keys {key!r} and {other!r} exclude each other", "use one or the other")

    def _require(self, keys: set[str], given: set[str]) -> None:
        for key in sorted(keys - given):
            raise InputError(self.where, f"the preset has no key {key!r}", "add this key")

    def preset(self) -> Preset:
        """The preset that the table describes."""
        kind = self._text("kind")
        if kind not in ("measured", "estimated"):
            raise self._wrong("kind", '"measured" or "estimated"')
        anisotropy = self._triple("anisotropy") if "anisotropy" in self.entry else (0.0, 0.0, 0.0)
        try:
            phase = parse_phase(self._text("phase")) if "phase" in self.entry else None
            anisotropy = (phase.mean_cosine,) * 3 if phase else anisotropy
            medium = self._medium(anisotropy, phase)
        except InputError as error:
            if str(error).startswith(self.where):
                raise
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
            self._roughness(),
            self._text("group") if "group" in self.entry else "",
            self._pattern(),
        )

    def _pattern(self) -> PatternName:
        name = self._text("pattern") if "pattern" in self.entry else ""
        if name not in get_args(PatternName):
            raise self._wrong("pattern", " or ".join(f'"{one}"' for one in get_args(PatternName) if one))
        return cast(PatternName, name)

    def _medium(self, anisotropy: Triple, phase: PhaseFunction | None) -> Medium:
        ior = self._number("ior", self.entry["ior"])
        for g in anisotropy:
            if not -1 < g < 1:
                raise self._wrong("anisotropy", "between -1 and 1")
        key = "reduced_scattering" if "reduced_scattering" in self.entry else "scattering"
        scattering = self._per_metre(key) if key in self.entry else np.zeros(3)
        with np.errstate(over="ignore", invalid="ignore"):  # a medium refuses what is not finite
            total = float(scattering.sum())
            mean = float(scattering @ np.array(anisotropy)) / total if total > 0 else 0.0
        emission = self._per_metre("emission") if "emission" in self.entry else np.zeros(3)
        return Medium(self._absorption(), scattering, emission, 0.0 if phase else mean, ior, phase)

    def _absorption(self) -> Array:
        """sigma_a in 1/m."""
        if "color" not in self.entry:
            return self._per_metre("absorption")
        clear = Medium.from_color(self._triple("color"), self._distance())
        return np.asarray(clear.absorption, dtype=np.float64)

    def _distance(self) -> float:
        """Metres."""
        if not isinstance(self.entry["distance"], str):
            raise self._wrong("distance", 'a length with its unit, for example "1cm"')
        return parse_length(self._text("distance"))

    def _per_metre(self, key: str) -> Array:
        """Coefficients in 1/m; infinite beyond the numbers there are."""
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            return np.asarray(np.array(self._triple(key)) * (1.0 / metres_per_unit(self._text("unit"))))

    def _roughness(self) -> float:
        if "roughness" not in self.entry:
            return 0.0
        if not 0.0 <= (roughness := self._number("roughness", self.entry["roughness"])) <= 1.0:
            raise self._wrong("roughness", "0 (polished) to 1")
        return roughness

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


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes
    ----------
    location : str
        Where it is: ``FILE line N``, or ``FILE item N`` of a JSON list.
    cells : dict
        Values by column; CSV has text only, without the spaces around it. An empty cell is absent.
    """

    location: str
    cells: dict[str, Any]

    def need(self, column: str) -> Any:
        """Value of a required column."""
        if column not in self.cells:
            raise InputError(column, "a value is missing", "fill in the missing value")
        return self.cells[column]

    def length(self, column: str, unit: str) -> float:
        """Length of a column in metres, read in `unit` if it names none."""
        return parse_length(str(self.need(column)), unit)

    def color(self) -> Any:
        """Linear color of the column ``color``, or of the columns ``r``, ``g`` and ``b`` (linear) without it."""
        if "color" not in self.cells and "r" in self.cells:
            return parse_color([self.number(channel) for channel in "rgb"])
        return parse_color(self.need("color"))

    def number(self, column: str) -> float:
        """Number of a column."""
        try:
            return float(self.need(column))
        except (TypeError, ValueError):
            raise InputError(f"{column} {self.cells[column]!r}", "the value is not a number", "give a number") from None


def read_table(path: str | Path, *, needs: Iterable[tuple[str, ...]]) -> list[Row]:
    """Rows of a ``.json`` file (a list of objects), or of CSV text with a line of column names.

    Parameters
    ----------
    path : str or Path
    needs : iterable of tuple of str
        Columns that a CSV table must have; of each tuple, one is enough.

    Raises
    ------
    InputError
        If the file cannot be read, holds no row, or lacks a column.
    """
    what = f"table {str(path)!r}"
    text = read_text(path, what, do="save the table as CSV or JSON, in UTF-8")
    rows = _json_rows(what, path, text) if Path(path).suffix.lower() == ".json" else _csv_rows(path, text, needs)
    if not rows:
        raise InputError(what, "the table has no rows", "add at least one row")
    return rows


def _csv_rows(path: str | Path, text: str, needs: Iterable[tuple[str, ...]]) -> list[Row]:
    what, reader = f"table {str(path)!r}", csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    rows: list[Row] = []
    try:
        names = [name.strip().lower() for name in next((line for line in reader if any(line)), [])]
        for choice in needs:
            if not set(choice) & set(names):
                found = f"no column {' or '.join(repr(name) for name in choice)}"
                has = f"the first line is {', '.join(names)}" if names else "the file is empty"
                raise InputError(what, f"{found}: {has}", "write the names of the columns into the first line")
        for line in reader:
            cells = [cell.strip() for cell in line]
            if any(cells):
                named = {name: cell for name, cell in zip(names, cells, strict=False) if cell}
                spare = {"": "cells"} if any(cells[len(names) :]) else {}
                rows.append(Row(f"{path} line {reader.line_num}", {**named, **spare}))
    except csv.Error as error:
        raise InputError(what, f"line {reader.line_num}: {error}", "save the table as CSV") from None
    return rows


def _json_rows(what: str, path: str | Path, text: str) -> list[Row]:
    try:
        items = json_value(text)
    except ValueError as error:
        raise InputError(
            what, f"the file is not valid JSON: {error}", "write a list of objects with color and distance"
        ) from None
    if not (isinstance(items, list) and all(isinstance(item, dict) for item in items)):
        raise InputError(
            what, "the JSON is not a list of objects", 'write [{"name": ..., "color": ..., "distance": ...}]'
        )
    return [
        Row(f"{path} item {i}", {name: value for name, value in item.items() if value not in (None, "")})
        for i, item in enumerate(items, 1)
    ]


def check_cells(row: Row) -> None:
    """Refuse a row with more cells than columns: most often an unquoted color with commas."""
    if "" in row.cells:
        raise InputError(
            "cells of a table row",
            "the row has more cells than there are columns",
            'put a color that contains commas into quotes: "linear(.2,.6,.3)"',
        )
