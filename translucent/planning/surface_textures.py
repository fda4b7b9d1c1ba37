"""Textures that rays read wherever they hit a surface, and how large they may be."""

from __future__ import annotations

from translucent.planning.passes import Note, NoteKind
from translucent.scene.scene import Object, Scene, object_names
from translucent.scene.texture import Falloff, Texture

#: Texels of all textures together, without their mipmaps; more are halved. 8 bytes each.
MOST_TEXELS = 1 << 24


def textures_at_hits(body: Object) -> tuple[Texture | None, Texture | None, Texture | None, Texture | None]:
    """Textures of color, roughness, transmission and emission that rays read at a hit of an object.

    A `Falloff` is no picture to them but a formula, and what bodies emit they leave out.
    """
    surface = body.surface
    if surface is None or body.covers:
        return None, None, None, None
    color = None if isinstance(surface.color_texture, Falloff) else surface.color_texture
    emissive = surface.emissive_texture if body.medium is None else None
    return color, surface.roughness_texture, surface.transmission_texture, emissive


def varies_at_hits(body: Object) -> bool:
    """True if textures or colors of vertices make the surface of an object differ from place to place for rays."""
    return not body.covers and (any(textures_at_hits(body)) or body.mesh.colors is not None)


def textured_at_hits(scene: Scene) -> bool:
    """True if rays read textures or colors of vertices at some object."""
    return any(varies_at_hits(body) for body in scene.objects)


def unread_at_hits(scene: Scene) -> list[Note]:
    """Notes on what rays do not read of surfaces."""
    if not (bodies := [body for body in scene.objects if has_more(body)]):
        return []
    text = f"normal maps, occlusion and holes by alpha: rays find {object_names(bodies)} without"
    return [Note(NoteKind.TEXTURES, text)]


def untextured_rays(scene: Scene) -> list[Note]:
    """Notes on textures where rays have the values of a surface where a pixel shows it first, or without textures."""
    names = object_names(body for body in scene.objects if varies_at_hits(body))
    text = f"textures and vertex colors behind the first surface of a ray: {names} are even there"
    return [Note(NoteKind.TEXTURES, text)]


def reduced_at_hits(scene: Scene) -> list[Note]:
    """Notes on textures that rays on a GPU read with fewer texels than they have."""
    halved = {texture for texture, times in halvings(scene).items() if times}
    bodies = [body for body in scene.objects if halved.intersection(filter(None, textures_at_hits(body)))]
    if not bodies:
        return []
    text = f"fine texels: textures of {object_names(bodies)} are halved for rays, {MOST_TEXELS:,} texels fit in all"
    return [Note(NoteKind.TEXTURES, text)]


def has_more(body: Object) -> bool:
    """True if a surface has normal maps, occlusion or holes, which rays do not read."""
    if (surface := body.surface) is None or body.covers:
        return False
    mapped = surface.normal_texture is not None or surface.occlusion_texture is not None
    return mapped or body.has_holes or (body.medium is None and surface.alpha_cutoff > 0 and varies_at_hits(body))


def halvings(scene: Scene) -> dict[Texture, int]:
    """How often each texture that rays read is halved, so that all of them fit: the largest one first."""
    found = dict.fromkeys((one for body in scene.objects for one in textures_at_hits(body) if one is not None), 0)

    def texels(texture: Texture) -> int:
        height, width = (max(side >> found[texture], 1) for side in texture.pixels.shape[:2])
        return int(height * width)

    while found and sum(map(texels, found)) > MOST_TEXELS:
        found[max(found, key=texels)] += 1
    return found
