"""Settings of a bake, and the file names and encodings of thickness maps that other programs expect."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.media.medium import Medium

Mode = Literal["normal", "cone", "transmittance", "inscribed", "local"]
Weighting = Literal["cosine", "uniform"]
Gaps = Literal["first-exit", "total"]

#: Definitions of the values of each mode; the equations are in ``docs/baking.md``.
DEFINITIONS: dict[Mode, str] = {
    "normal": "distance from the surface to the exit along the inward normal",
    "cone": "mean distance from the surface to the exit over the directions of a cone around the inward normal",
    "transmittance": "the distance at which the medium lets through as much as the mean over the cone",
    "inscribed": "diameter of the largest sphere inside that touches the surface at this point",
    "local": "fraction of the directions in a cone around the inward normal whose distance exceeds the maximum",
}

#: Largest size of a map, in texels along a side.
MAX_SIZE = 16384

#: Largest number of rays from one point, before a tolerance adds more.
MAX_RAYS = 65536

#: Default reach of mode "local", as a fraction of the diagonal; the customary one of baking tools.
LOCAL_REACH = 0.1

#: Part of a name that stands for that of the model.
_MODEL = "{model}"


@checked
@dataclass(frozen=True, eq=False)
class BakeSettings:
    """Settings of a bake.

    Rays go from points of the surface into the mesh, around the inward smooth normal; the mode makes one number of
    their lengths d. With n the outward normal, w the directions and p the density of the weighting:

    - "normal": d(-n), one ray.
    - "cone": the mean E[d] = integral p(w) d(w) dw over the cone.
    - "transmittance": the d for which Y(exp(-sigma_t d)) = E[Y(exp(-sigma_t d(w)))], Y being the luminance: what a
      shader needs to get the mean transmittance of the cone from one length.
    - "inscribed": the diameter of the largest sphere inside that touches the surface at the point.
    - "local": P(d(w) >= max_distance), one minus the ambient occlusion with inverted normals (Barre-Brisebois and
      Bouchard 2011); 1 where the mesh is thick. The only one without a unit.

    Parameters
    ----------
    size : int
        Texels along each side of the map.
    mode : str
        As above.
    rays : int
        From each point, >= 2; powers of 2 are best. Mode "normal" casts one, whatever is given, and takes 1, too;
        "inscribed" begins with them.
    spread : float
        Full angle of the cone in degrees, 0 < spread <= 180.
    seed : int
        Of the directions. The result does not depend on the number of threads.
    weighting : str
        "cosine": p = cos(theta) / (pi sin^2(spread / 2)), or "uniform": p = 1 / (2 pi (1 - cos(spread / 2))).
    gaps : str
        "first-exit": d ends where the ray first leaves the mesh. "total": d is the whole length inside, beyond gaps.
    max_distance : float, optional
        In metres: d is at most this. Mode "local" takes a tenth of the diagonal where it is not given.
    ignore_back_faces : bool
        Seen from inside, as the rays do, the back of a face is its outer side: rays that hit one go on, where meshes
        of overlapping parts would otherwise end them. "total" counts such parts once in any case.
    medium : Medium, optional
        Of mode "transmittance".
    supersample : int
        Points along each side of a texel; each has its own rays.
    padding : int
        Texels around each chart that get the value of the nearest texel with one.
    tolerance : float, optional
        Standard error in metres (mode "local": 1) to be reached: up to 64 times as many rays are cast where it is not.
    tile : int, optional
        UDIM tile to bake. Default: texture coordinates outside 0..1 repeat the map.
    high_distance : float, optional
        Instead of a cage, metres on either side of the mesh, along its smooth normals. Default: 2 % of the diagonal.

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
        # One ray of many has no error estimate; mode "normal" has only one.
        _check_count("rays", self.rays, 1 if self.mode == "normal" else 2, MAX_RAYS, "give for example 64")
        _check_count("supersample", self.supersample, 1, 16, "use a value such as 2, or 1 for no supersampling")
        _check_count("padding", self.padding, 0, MAX_SIZE, "give the texels around each chart, for example 16")
        _check_count("seed", self.seed, 0, 2**63 - 1, "give a whole number, for example 0")
        if not (_is_number(self.spread) and 0 < self.spread <= 180):
            raise InputError(
                f"spread {self.spread!r}",
                "the angle must satisfy 0 < spread <= 180 degrees",
                "give the full angle of the cone",
            )
        for name in ("max_distance", "tolerance", "high_distance"):
            value = getattr(self, name)
            if value is not None and not (_is_number(value) and 0 < value < math.inf):
                raise InputError(
                    f"{name} {value!r}",
                    "the value must be positive and finite",
                    "give metres above 0, or omit the setting",
                )
        if self.tile is not None and not (_is_whole(self.tile) and 1001 <= self.tile <= 9999):
            raise InputError(
                f"tile {self.tile!r}",
                "this number is not a UDIM tile",
                "give a tile number from 1001 to 9999, or omit the tile",
            )
        if self.mode == "transmittance" and self.medium is None:
            do = "give a medium, such as tl.Medium.from_color('#7b1e3a', 0.01), or --color '#7b1e3a' --distance 1cm"
            raise InputError("mode 'transmittance'", "this mode needs a medium", do)
        if self.mode == "transmittance" and self.medium is not None and not (self.medium.extinction > 0).any():
            found = "the medium is clear"
            raise InputError("mode 'transmittance'", found, "use a medium that absorbs or scatters light")

    @property
    def unit(self) -> str:
        """Unit of the values: ``"m"``, or ``"1"`` for the dimensionless mode "local"."""
        return "1" if self.mode == "local" else "m"

    def summary(self) -> dict[str, object]:
        """Settings as values that JSON can hold; the medium by its extinction in 1/m."""
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


def settings_from(settings: Any, short: str, given: Mapping[str, Any]) -> BakeSettings:
    """Copy of settings with some fields replaced.

    Parameters
    ----------
    settings : BakeSettings, optional
        Or the value of the field `short` alone.
    short : str
    given : mapping
        Fields by name.

    Raises
    ------
    InputError
        If a field is outside its range.
    """
    if isinstance(settings, BakeSettings):
        return dataclasses.replace(settings, **given)
    return BakeSettings(**given) if settings is None else BakeSettings(**{short: settings}, **given)


@dataclass(frozen=True)
class Program:
    """Program that reads a thickness map.

    Attributes
    ----------
    name : str
        Its file, where a folder is given.
    storing : Mapping
        `normalize`, `invert` and `values_only` of a bake job.
    unit : str
        Of its lengths, and `per_metre` of them in a metre.
    recipe : str
        What to set at import; {largest} is the largest thickness in that unit.
    """

    name: str
    storing: Mapping[str, bool]
    unit: str
    per_metre: float
    recipe: str


PROGRAMS = {
    "blender": Program(
        "{model}_thickness.exr",
        {"values_only": True},  # Cycles takes three channels for red, green and blue
        "m",
        1.0,
        "Blender: Image Texture, color space Non-Color, its Color into Subsurface Scale; values are metres, "
        "{largest} m at most",
    ),
    "unreal": Program(
        "T_{model}_Thickness.png",
        {"normalize": True, "invert": True},
        "cm",
        1e2,
        "Unreal: sRGB off, compression Grayscale (16 bit as Displacementmap); 1 is thin; "
        "thickness = (1 - value) x {largest} cm",
    ),
    "unity": Program(
        "{model}_Thickness.png",
        {"normalize": True},
        "mm",
        1e3,
        "Unity HDRP: sRGB off, as Thickness Map; in the diffusion profile Thickness Remap 0 to {largest} mm",
    ),
}


def job_for(name: str, job: dict[str, Any]) -> dict[str, Any]:
    """Bake job with the file name and the encoding that a program expects.

    Raises
    ------
    InputError
        If the output has another suffix, or the job stores in another way.
    """
    program, output = PROGRAMS[name], Path(job["output"])
    if output.is_dir():
        output = output / program.name.replace(_MODEL, Path(job["model"]).stem)
    if output.suffix.lower() != Path(program.name).suffix:
        do = f"write {Path(program.name).suffix}, or give a folder"
        raise InputError(f"output {str(output)!r}", f"{name} reads {Path(program.name).suffix}", do)
    if other := [key for key in ("normalize", "invert", "vertices") if job.get(key)]:
        found = "--for already determines the encoding"
        raise InputError(f"--for {name}", found, f"omit --for or --{other[0]}")
    return {**job, "output": str(output), **program.storing}


def recipe_for(name: str, largest: float) -> str:
    """Import settings of a program for a map with this largest thickness in metres."""
    program = PROGRAMS[name]
    return program.recipe.replace("{largest}", f"{program.per_metre * largest:.4g}")
