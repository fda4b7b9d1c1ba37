"""Effects that a scene asks for and no pass of a plan renders."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from translucent.planning.interfaces import Interfaces
from translucent.planning.layers import layer_effects
from translucent.planning.notes import Note, NoteKind
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.scene import Object, Scene, object_names

#: Note of a plan in which interfaces do nothing to light.
STRAIGHT = Note(
    NoteKind.REFRACTION, "refraction and reflection: rays go straight, though interfaces bend and mirror them"
)

#: How a plan with ambient radiance shades pixels, beside what it does without.
AMBIENT = "of the ambient radiance A, media scatter sigma_s A for each metre, which counts as emitted"


def unmodelled_effects(scene: Scene, *, scattering: bool, interfaces: Interfaces | None = None) -> tuple[Note, ...]:
    """Notes on effects that the scene asks for and a plan does not render.

    Parameters
    ----------
    scene : Scene
    scattering : bool
        The plan has light scattered into the rays.
    interfaces : Interfaces, optional
        How the plan finds interfaces; None if it leaves out what they and the surfaces of opaque objects do to light.
    """
    surfaces = interfaces is not None
    effects = _scattering_effects(scene, followed=scattering, interfaces=surfaces)
    effects += _refraction_effects(scene, interfaces)
    if clear := [body for body in scene.bodies if _is_invisible(body)]:
        text = f"{object_names(clear)}: invisible, since nothing in it absorbs, scatters or emits"
        effects.append(Note(NoteKind.INVISIBLE, text))
    if not surfaces and (finished := [item for item in scene.opaque if item.surface is not None]):
        text = f"surfaces of opaque objects: {object_names(finished)} reflect diffusely, in one color each"
        effects.append(Note(NoteKind.OPAQUE_SURFACES, text))
    effects += layer_effects(scene, interfaces=surfaces)
    effects += shadow_effects(scene) if scene.opaque else []
    if scene.overlap != "priority" and len({body.priority for body in scene.bodies}) > 1:
        text = f'priorities: overlap="{scene.overlap}" does not use them'
        effects.append(Note(NoteKind.UNUSED_PRIORITIES, text))
    return tuple(effects)


def with_ambient(notes: Iterable[Note]) -> tuple[Note, ...]:
    """Notes of a plan in which media emit the ambient radiance that they would scatter."""
    way = Note(NoteKind.DIMMED_AMBIENT, "what dims ambient light on its way to a place in the media")
    return (*(note for note in notes if note.kind is not NoteKind.ONLY_REMOVES), way)


def layers_instead(scene: Scene, refusals: Iterable[tuple[int, str]]) -> tuple[Note, ...]:
    """Notes on objects, by their numbers, that are layers though light should diffuse in them, and why."""
    reasons: dict[str, list[Object]] = {}
    for i, why in refusals:
        reasons.setdefault(why, []).append(scene.objects[i])
    return tuple(
        Note(NoteKind.LAYER_INSTEAD, f"diffusion in {object_names(items)}: {why}; shown as layers")
        for why, items in reasons.items()
    )


def shadow_effects(scene: Scene) -> list[Note]:
    """Notes on shadows on opaque objects that are not rendered, where there are some, or a picture of them."""
    notes = []
    if not scene.environment_shadows and scene.environment.mean.any():
        text = "shadows of the environment: its light reaches opaque objects through everything"
        notes.append(Note(NoteKind.SHADOWS, text))
    layers = [body for body in scene.bodies if body.covers]
    if layers and (scene.lights or scene.environment_shadows):
        text = f"shadows of layers: light reaches opaque objects through {object_names(layers)}"
        notes.append(Note(NoteKind.SHADOWS, text))
    return notes


def _scattering_effects(scene: Scene, *, followed: bool, interfaces: bool) -> list[Note]:
    """Notes on scattered light that is not rendered."""
    notes = _subsurface_effects(scene) if interfaces else []
    bodies = [body for body in scene.bodies if body.medium is not None and body.medium.scatters]
    if any(treatment_of(body) is Treatment.VOLUME for body in bodies):
        text = (
            "what is scattered more than once: what opaque objects and other bodies keep from it, and where it goes on "
            "ahead, as around lights behind media that scatter ahead"
        )
        notes.append(Note(NoteKind.DIFFUSED_LIGHT, text))
    shown = (Treatment.VOLUME, Treatment.LAYER) if interfaces else (Treatment.VOLUME,)
    if media := [body.medium for body in bodies if body.medium and treatment_of(body) not in shown]:
        if followed:
            densest = max(float(np.max(np.asarray(medium.scattering))) for medium in media)
            text = (
                "light scattered more than once, of which there is much in bodies that are thicker than a mean free "
                f"path, here {1 / densest:.2g} m; light of the environment scattered"
            )
            return [*notes, Note(NoteKind.SCATTERED_AGAIN, text)]
        if not scene.lights:
            return [*notes, Note(NoteKind.ONLY_REMOVES, "in-scattered light: scattering only removes light")]
        text = (
            "in-scattered light: this method leaves out what lights send into media that scatter; FragmentLists has it"
        )
        return [*notes, Note(NoteKind.LIGHTS_LEFT_OUT, text)]
    lit = scene.opaque or any(body.covers or (interfaces and body.has_interface) for body in scene.bodies)
    if not notes and scene.lights and not lit:
        text = "lights: they shine on nothing, since no medium scatters and nothing is opaque"
        return [Note(NoteKind.UNUSED_LIGHTS, text)]
    return notes


def _subsurface_effects(scene: Scene) -> list[Note]:
    """Notes on bodies whose surfaces show light that they scatter many times."""
    notes = []
    if any(treatment_of(body) is Treatment.LAYER for body in scene.bodies):
        text = (
            "how light that is scattered many times spreads inside: it leaves as from a flat layer as thick as the "
            "path of the ray, which edges and folds are not"
        )
        notes.append(Note(NoteKind.SPREAD_INSIDE, text))
    if bodies := [body for body in scene.bodies if treatment_of(body) is Treatment.DIFFUSION]:
        text = (
            f"{object_names(bodies)}: what other bodies scatter of the environment's light reaches them, and "
            "what is smaller than a cell has no light of its own"
        )
        notes.append(Note(NoteKind.DIFFUSED_LIGHT, text))
    return notes


def _refraction_effects(scene: Scene, interfaces: Interfaces | None) -> list[Note]:
    """Notes on refracted and reflected light that is not rendered."""
    if not any(body.has_interface for body in scene.bodies):
        return []
    if interfaces is None:
        return [STRAIGHT]
    return interfaces.unmodelled()


def _is_invisible(body: Object) -> bool:
    medium = body.medium
    return (
        medium is not None
        and not body.covers
        and not body.has_interface
        and not (medium.extinction > 0).any()
        and not medium.emits
    )
