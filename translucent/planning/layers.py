"""Passes for partly transparent layers, emissive surfaces and holes."""

from __future__ import annotations

from collections.abc import Iterable

from translucent.planning.bodies import indices
from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassName, PassSpec
from translucent.scene.scene import Object, Scene


def layer_passes(scene: Scene, cost: float) -> tuple[PassSpec, ...]:
    """Pass that draws layers and the emission of interfaces; none where a scene has neither."""
    layers, glowing = (indices(scene, keep) for keep in (_covers, _glows))
    if not layers and not glowing:
        return ()
    reasons = []
    if layers:
        reasons.append(
            f"{_names(scene, layers)}: each covers a share of what is behind it, and shows its own light there"
        )
    if glowing:
        reasons.append(f"{_names(scene, glowing)}: the surface glows")
    return (PassSpec(PassName.LAYERS, "; ".join(reasons), tuple(sorted((*layers, *glowing))), 1, cost=cost),)


def layer_effects(scene: Scene, *, interfaces: bool) -> list[Note]:
    """Notes on effects of layers that are not rendered; `interfaces` as for `unmodelled_effects`."""
    effects = []
    if layers := _names(scene, indices(scene, _covers)):
        text = (
            f"{layers}: layers cast no shadows, rays that bend do not meet them, all media on a ray dim those behind "
            "its first body, and they are painted object by object, far ones first, also where they cross"
            if interfaces
            else f"what layers mirror: {layers} show diffuse light alone"
        )
        effects.append(Note(NoteKind.LAYERS, text))
    if glowing := _names(scene, indices(scene, _glows)):
        what = "add it where a ray first enters a body, and nowhere behind" if interfaces else "not at all"
        effects.append(Note(NoteKind.GLOW, f"light of surfaces that glow: {glowing} {what}"))
    if cut := _names(scene, indices(scene, _wants_holes)):
        text = f"holes by alpha_cutoff: {cut} drawn closed, since a solid with a hole has no inside"
        effects.append(Note(NoteKind.HOLES, text))
    return effects


def _covers(item: Object) -> bool:
    return item.covers


def _glows(item: Object) -> bool:
    return item.medium is not None and not item.covers and item.surface is not None and item.surface.glows


def _wants_holes(item: Object) -> bool:
    if item.medium is None or item.sheet_thickness is not None or item.surface is None:
        return False
    varies = item.surface.color_texture is not None or item.mesh.colors is not None
    return item.surface.alpha_cutoff > 0 and varies


def _names(scene: Scene, objects: Iterable[int]) -> str:
    return ", ".join(repr(scene.objects[i].mesh.name) for i in objects)
