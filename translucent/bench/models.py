"""Models of the user as cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from translucent import reference
from translucent.bench.cases import Case, Size
from translucent.bench.contenders import Effect
from translucent.errors import InputError
from translucent.scene import Scene

#: A model is no solid if the reference can trust less than this share of the pixels that it covers ...
LEAST_VALID = 0.5
#: ... in a picture of this size.
LOOK: Size = (64, 64)


def model_cases(scenes: Mapping[str, Scene]) -> list[Case]:
    """A case for the scene of each model, by the name that the user gave.

    A case is called by the file's name, or by all of its path where several files have the same. One that no method can
    treat as solid raises `InputError` when its scene is made, so that it is a row of the report like all that fails.
    """
    shared = Counter(Path(model).name for model in scenes)
    return [
        Case(
            f"model {title}",
            title,
            "a model of yours",
            partial(_solid, title, scene),
            effect_of(scene),
        )
        for model, scene in scenes.items()
        for title in [model if shared[Path(model).name] > 1 else Path(model).name]
    ]


def effect_of(scene: Scene) -> Effect:
    """What the media of a scene do, which decides what is worth measuring."""
    media = [body.medium for body in scene.bodies if body.medium is not None]
    if any(body.density is not None for body in scene.bodies):
        return "density"
    if any(medium.scatters for medium in media):
        return "scattering"
    if any(medium.emits for medium in media):
        return "emission"
    return "sheet" if all(body.sheet_thickness is not None for body in scene.bodies) else "absorption"


def _solid(title: str, scene: Scene, _size: Size) -> Scene:
    """The scene, which has been made for the size already, if its bodies have an inside at all."""
    look = reference.render(scene, LOOK)
    covered = look.coverage | ~look.valid
    if covered.any() and look.valid[covered].mean() < LEAST_VALID:
        wrong = "; ".join(f"{body.mesh.name!r} {body.mesh.diagnosis}" for body in scene.bodies)
        share = 1.0 - look.valid[covered].mean()
        raise InputError(
            f"measuring {title!r}",
            f"no method can treat it as solid: {share:.0%} of its pixels are invalid; {wrong}",
            "close it, or declare it a thin sheet in a .glb file",
        )
    return scene
