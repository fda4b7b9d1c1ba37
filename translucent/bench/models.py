"""Cases from models of the user."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from translucent import reference
from translucent.bench.cases import Case, Size
from translucent.bench.contenders import Effect
from translucent.errors import InputError
from translucent.scene.scene import Object, Scene

#: A model is no solid if the reference can trust less than this share of the pixels that it covers ...
LEAST_VALID = 0.5
#: ... in a picture of this size.
LOOK: Size = (64, 64)


def model_cases(scenes: Mapping[str, Scene]) -> list[Case]:
    """Cases for the scenes of models, by the names that the user gave.

    What is judged is what methods do differently: interfaces, which cost the same on top of each and have scenes of
    their own, are left out, and so is light that is scattered many times, which no method and no reference follows
    here. A case is called by the file's name, or by all of its path where several files have the same. One that no
    method can treat as solid raises `InputError` when its scene is made, so that it is a row of the report like all
    that fails.
    """
    shared = Counter(Path(model).name for model in scenes)
    return [
        Case(
            f"model {title}",
            title,
            "a model of yours" if judged is scene else "a model of yours, without its interfaces",
            partial(_solid, title, judged),
            effect_of(judged),
        )
        for model, scene in scenes.items()
        for judged in [without_interfaces(scene)]
        for title in [model if shared[Path(model).name] > 1 else Path(model).name]
    ]


def without_interfaces(scene: Scene) -> Scene:
    """Scene without interfaces; itself, if it has none."""
    if not any(_has_interface(item) for item in scene.bodies):
        return scene

    def bare(item: Object) -> Object:
        if item.medium is None:
            return item
        return dataclasses.replace(item, medium=dataclasses.replace(item.medium, ior=1.0), surface=None)

    return dataclasses.replace(scene, objects=[bare(item) for item in scene.objects])


def _has_interface(item: Object) -> bool:
    return item.surface is not None or (item.medium is not None and item.medium.ior > 1)


def effect_of(scene: Scene) -> Effect:
    """Effect of the media of a scene, which decides what is worth measuring."""
    media = [body.medium for body in scene.bodies if body.medium is not None]
    if any(body.density is not None for body in scene.bodies):
        return "density"
    if scene.lights and any(medium.scatters for medium in media):
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
