"""Models of the user as cases."""

from __future__ import annotations

from translucent.bench.cases import Case
from translucent.bench.contenders import Effect
from translucent.scene import Scene


def model_case(model: str, scene: Scene) -> Case:
    """The case of a scene that the user has asked for by this name."""
    return Case(f"model {model}", model, "a model of yours", lambda _: scene, effect_of(scene))


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
