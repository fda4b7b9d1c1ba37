"""Scenes with the switches that a page's panel can throw: media that bend light, and rough surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from translucent.media.medium import Medium
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

#: What a body gets in a variant whose passes it is to have, where it has none: the page puts its own in place.
USUAL_IOR, USUAL_ROUGHNESS = 1.5, 0.5


def editable(body: Object) -> str:
    """Reason for which a page cannot change the medium of a body; empty if it can."""
    medium = body.medium
    if medium is None or body.covers:
        return "opaque"
    if np.any(np.asarray(medium.scattering) > 0):
        return (
            "This medium scatters light. How that spreads was solved when the page was written, for this medium alone: "
            "it stays, while view, exposure and other media change. For another one, write the page again."
        )
    if medium.emits:
        return "This medium glows: it stays as it is."
    if body.density is not None:
        return "The density of this medium varies: it stays as it is."
    return ""


def variant(scene: Scene, *, bends: bool, rough: bool) -> Scene:
    """The scene with media of bodies that a page can change made to bend light or not, polished or not."""
    return replace(scene, objects=[_changed(body, bends, rough) for body in scene.objects])


def _changed(body: Object, bends: bool, rough: bool) -> Object:
    if body.medium is None or editable(body):
        return body
    medium, surface = body.medium, body.surface or Surface()
    ior = (medium.ior if medium.ior != 1.0 else USUAL_IOR) if bends else 1.0
    roughness = (surface.roughness or USUAL_ROUGHNESS) if rough else 0.0
    shown = replace(surface, roughness=roughness)
    plain = body.surface is None and roughness == 0.0
    return replace(body, medium=_with_ior(medium, ior), surface=None if plain else shown)


def _with_ior(medium: Medium, ior: float) -> Medium:
    return replace(medium, ior=ior)


def current(scene: Scene) -> tuple[bool, bool]:
    """Switches as they are: any medium that a page can change bends light; any of their surfaces is rough."""
    free = [body for body in scene.objects if body.medium is not None and not editable(body)]
    bends = any(body.medium is not None and body.medium.ior != 1.0 for body in free)
    return bends, any(body.surface is not None and body.surface.roughness > 0 for body in free)
