"""Shadow maps for opaque objects: transmittance from each light, and from directions of the environment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.planning.bodies import count_of, indices, media_differ
from translucent.planning.methods import SignedDepth
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.grounds import ground_of
from translucent.scene.scene import Scene

#: Textures that shaders of interfaces read at most, with those of shadows. OpenGL promises 16.
UNITS_WITH_SHADOWS = 20

#: Sizes that make sense: below, shadows are blots; above, no texture holds them.
LEAST_SIZE, MOST_SIZE = 64, 8192

#: Texels of a light's map across a pixel at least, where objects are nearest to the eye, and the fewest along its side.
#: Next to four times as many, the light of a bear in 64 x 64 pixels changes by 5e-4 (root mean square), and by 0.02 at
#: most, at the edge of its shadow.
TEXELS_OF_PIXEL, LEAST_USUAL = 2.0, 256

#: Surfaces on a ray through the bodies, on average, up to which maps are as wide as usual: a texel costs as many.
MANY_SURFACES = 8.0


@checked
@dataclass(frozen=True)
class ShadowMaps:
    """Colored shadows on opaque objects: the transmittance of the straight path from each light.

    From each light, one draw of the opaque objects and one of the bodies find the transmittance to the first opaque
    surface on each ray: thickness ends there, so that no bias is needed. Where the surface is read, it is interpolated
    between texels, as transmittance and not as thickness. Maps are kept until objects or lights change.

    Parameters
    ----------
    size : int
        Texels along a side of each light's map, 64 to 8192. Those of directions of the environment
        (`Scene.environment_shadows`) have a quarter of it. Without any choice of shadows, small pictures have maps as
        fine as they can show, except over a backdrop.
    directions : int, optional
        Of the environment, that a pixel looks into at most: for pictures that move. Shadows are the rougher for it,
        and as bright. None: all.

    Raises
    ------
    InputError
        If the size is not a whole number in this range, or the directions are not at least 1.
    """

    size: int = 1024
    directions: int | None = None

    def __post_init__(self) -> None:
        if isinstance(self.size, bool) or not isinstance(self.size, int) or not LEAST_SIZE <= self.size <= MOST_SIZE:
            raise InputError(
                f"ShadowMaps size {self.size!r}",
                f"the size must be a whole number in {LEAST_SIZE} to {MOST_SIZE}",
                "use a value such as 1024",
            )
        if self.directions is not None and not (isinstance(self.directions, int) and self.directions >= 1):
            raise InputError(
                f"ShadowMaps directions {self.directions!r}",
                "the value must be a number of directions",
                "use a value such as 8",
            )


def usual_maps(scene: Scene, pixels: int) -> tuple[ShadowMaps, tuple[Note, ...]]:
    """Default shadow maps of a picture of so many pixels, with a note if rays that cross many surfaces narrow them.

    They are no finer than a small picture can show. 0 are pixels that are not known, as those of a window: its maps
    stay when it grows or the eye comes near; and those over a backdrop, whose nearest shadow nobody knows.

    Of all lines through a box of area S, surfaces in it of area A are crossed 2 A / S times on average (Cauchy 1850).
    """
    usual = ShadowMaps(_shown(scene, pixels))
    low, high = (f([item.bounds[i] for item in scene.bodies], axis=0) for i, f in enumerate((np.min, np.max)))
    box = 2.0 * float((high - low) @ np.roll(high - low, 1))
    surfaces, size = 2.0 * sum(item.area for item in scene.bodies) / box if box > 0.0 else 0.0, usual.size
    while surfaces * size**2 > MANY_SURFACES * ShadowMaps().size ** 2 and size > LEAST_SIZE:
        size //= 2
    if size == usual.size:
        return usual, ()
    text = (
        f"shadow maps are {size} texels wide instead of {usual.size}, because rays through the bodies cross "
        f"{surfaces:.0f} surfaces on average; --shadow-size or shadows=tl.ShadowMaps(size=...) changes it"
    )
    return ShadowMaps(size), (Note(NoteKind.SHADOWS, text),)


def _shown(scene: Scene, pixels: int) -> int:
    """Texels along a side of a light's map, a power of two: as many as a picture of so many pixels can show."""
    most, ground, camera = ShadowMaps().size, ground_of(scene), scene.camera
    if not pixels:
        return most
    if camera.window is not None:  # a part of a larger picture
        pixels, camera = int(np.prod(camera.window.whole)), replace(camera, window=None)
    boxes = np.stack([item.bounds for item in scene.objects if ground is None or item is not ground.ground])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    away = float(np.linalg.norm(np.maximum(np.maximum(low - camera.eye, camera.eye - high), 0.0)))
    across = 2.0 * camera.half_extent((1, 1))[1] * (away if camera.fov_y is not None else 1.0)
    needed, size = TEXELS_OF_PIXEL * float(np.linalg.norm(high - low) * np.sqrt(pixels)), LEAST_USUAL
    while size < most and size * across < needed:
        size *= 2
    return size


def shadows_left_out(units: int) -> tuple[Note, ...]:
    """Note that shaders of interfaces and random paths have too few texture units for shadows."""
    if units >= UNITS_WITH_SHADOWS:
        return ()
    text = (
        "no shadows on interfaces, and on objects visible only through interfaces: shadows need "
        f"{UNITS_WITH_SHADOWS} textures in a shader, and this OpenGL allows {units}"
    )
    return (Note(NoteKind.SHADOWS, text),)


def dims_interfaces(scene: Scene) -> bool:
    """True if a body may shadow an interface of another body, or its own."""
    dense = (body for body in scene.bodies if not body.covers and body.medium and (body.medium.extinction > 0).any())
    return bool(scene.lights) and any(len(scene.bodies) > 1 or not body.mesh.diagnosis.convex for body in dense)


def shadow_passes(scene: Scene, *, over_backdrop: bool = False) -> tuple[PassSpec, ...]:
    """The pass that renders maps of shadows; none without something opaque, such as a backdrop, and light on it."""
    opaque = indices(scene, lambda item: item.medium is None)
    views = len(scene.lights) + scene.environment_shadows
    if not (opaque or over_backdrop) or not views:
        return ()
    lights = f"{len(scene.lights)} {'light' if len(scene.lights) == 1 else 'lights'}"
    sky = f"{scene.environment_shadows} directions of the environment"
    sources = " and ".join(what for what, there in ((lights, scene.lights), (sky, scene.environment_shadows)) if there)
    receivers = "the backdrop" if over_backdrop else count_of(opaque, "opaque object", "opaque objects")
    reason = (
        f"{sources} on {receivers}: the thickness of media in front of the first opaque surface gives the color of "
        "shadows; kept until objects or lights change"
    )
    cost = views * (1.0 + SignedDepth.cost_for(spectral=media_differ(scene)))
    return (PassSpec(PassName.SHADOW_MAPS, reason, tuple(range(len(scene.objects))), views, cost=cost),)
