"""Scenes of straight rays with what surfaces show of themselves: paint, textures, and the holes of leaves."""

from __future__ import annotations

import dataclasses
from functools import lru_cache

import numpy as np

from translucent.media.medium import Medium
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Thickness of the sheet that stands for paint, in diagonals of its object.
THIN = 1e-6

#: Largest side of a texture of paint in pixels: a small picture shows no more.
MOST = 512


def with_paint(straight: Scene, scene: Scene) -> Scene:
    """Scene of straight rays, with the matt colors of opaque objects, and layers of paint on bodies.

    Parameters
    ----------
    straight : Scene
        Without the optical effects of interfaces.
    scene : Scene
        The same with them. Its objects are shown as they are, in their order.
    """
    objects: list[Object] = []
    for plain, item in zip(straight.objects, scene.shown, strict=True):
        if item.medium is None and item.surface is not None:
            plain = dataclasses.replace(plain, surface=_matt(item.surface))
        objects.append(plain)
        if (paint := _paint(item)) is not None:
            objects.append(paint)
    return dataclasses.replace(straight, objects=objects)


def shows_paint(scene: Scene) -> bool:
    """True if its surfaces show more than straight rays do without them."""
    return any((item.medium is None and item.surface is not None) or _paint(item) is not None for item in scene.shown)


def _matt(surface: Surface) -> Surface:
    return Surface(
        color=surface.color,
        color_texture=surface.color_texture,
        emissive=surface.emissive,
        emissive_texture=surface.emissive_texture,
        alpha_cutoff=surface.alpha_cutoff,
    )


def _paint(item: Object) -> Object | None:
    """Layer that covers as much of a body as does not let light in; None if all does."""
    surface = item.surface
    if item.medium is None or surface is None or item.covers:
        return None
    if surface.transmission == 1.0 and surface.transmission_texture is None:
        return None
    texture = surface.color_texture
    if surface.transmission_texture is not None:
        texture = _covering(texture, surface.transmission_texture, surface.transmission)
    opacity = 1.0 if surface.transmission_texture is not None else 1.0 - surface.transmission
    paint = Surface(color=surface.color, color_texture=texture, opacity=opacity)
    thin = THIN * float(np.linalg.norm(np.ptp(item.bounds, axis=0)))
    return Object(item.mesh, Medium(), transform=item.matrix, surface=paint, sheet_thickness=thin)


@lru_cache(maxsize=8)
def _covering(color: Texture | None, entering: Texture, transmission: float) -> Texture:
    """Texture of the color of paint, and as its opacity the share of light that does not enter."""
    pictures = [one for one in (color, entering) if one is not None]
    height, width = (min(max(one.pixels.shape[i] for one in pictures), MOST) for i in (0, 1))
    v, u = np.meshgrid(1.0 - (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    at = np.stack([u, v], axis=-1)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    if color is not None:
        pixels[..., :3] = color.sample(at)[..., :3]
    pixels[..., 3] = 1.0 - transmission * entering.sample(at)[..., 0]
    return Texture(np.clip(pixels, 0.0, 1.0), wrap=entering.wrap)
