"""Files of thickness as programs expect them: their names, what they store, and what to set at import."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from translucent.errors import InputError

#: Part of a name that stands for that of the model.
_MODEL = "{model}"


@dataclass(frozen=True)
class Program:
    """Program that reads a thickness map.

    Attributes
    ----------
    name : str
        Its file, where a folder is given.
    storing : Mapping
        `normalize` and `invert` of a bake job.
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
        {},
        "m",
        1.0,
        "Blender: Image Texture, color space Non-Color; values are metres, {largest} m at most",
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
    """Bake job with the name and the encoding that a program expects; an output that is a folder gets its name.

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
        raise InputError(f"--for {name}", f"--{other[0]} is given, too", "leave out one of the two")
    return {**job, "output": str(output), **program.storing}


def recipe_for(name: str, largest: float) -> str:
    """What to set when a program imports a map with this largest thickness in metres."""
    program = PROGRAMS[name]
    return program.recipe.replace("{largest}", f"{program.per_metre * largest:.4g}")
