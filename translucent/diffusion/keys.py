"""Cache keys of multiply scattered light: all values that it depends on. Importing them loads no solver."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import astuple
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from translucent.media.medium import Medium
from translucent.planning.bodies import enclosed_bodies
from translucent.planning.caustics import lit_by_photons
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import Treatment, scatterer_of, treatment_of
from translucent.scene.environment import Environment
from translucent.scene.scene import Light, Object, Scene

_T = TypeVar("_T")

#: Least number of photons that light opaque objects inside bodies.
PHOTONS_ON_OPAQUE = 1 << 16


def diffusion_key(plan: RenderPlan) -> Hashable:
    """Key of all values that the multiply scattered light of a plan depends on; it does not depend on the camera."""
    scene, caustics = plan.scene, plan.caustics
    followed = caustics is not None and media_lit_by_photons(scene)
    bending = (caustics.in_media, caustics.seed, bending_key(scene)) if caustics is not None and followed else ()
    glowing = (plan.glowing, bending_key(scene)) if plan.glowing else ()
    exchange = (plan.exchanging, photons_on_opaque(plan), bending_key(scene)) if plan.exchanging else ()
    enclosing = bending_key(scene) if enclosed_bodies(scene) else ()
    bodies = tuple(
        (
            i,
            treatment_of(body := scene.objects[i]),
            place_of(body),
            body.density,
            coefficients_of(medium),
            roughness_of(body),
        )
        for i, medium in diffusing_media(scene).items()
    )
    opaque = tuple(opaque_key(item) for item in scene.opaque)
    lighting = environment_key(scene.environment)
    lights = tuple(light_key(light) for light in scene.lights)
    dimming = tuple((i, dimming_key(item)) for i, item in enumerate(scene.objects) if may_dim(item))
    shadows = bool(scene.environment_shadows)  # of bodies on a ground, see `ground_map`
    return (plan.diffusion, bodies, opaque, lighting, lights, dimming, bending, exchange, glowing, enclosing, shadows)


def environment_key(around: Environment) -> Hashable:
    """Fields of an environment that its light depends on; a background lights nothing."""
    return around.kind, around.first.tobytes(), around.second.tobytes(), around.map, around.rotation, around.exposure


def light_key(light: Light) -> Hashable:
    """Type and fields of a light."""
    return type(light), *map(_bytes, astuple(light))


def dimming_key(item: Object) -> Hashable:
    """All that the light depends on that a body lets through."""
    assert item.medium is not None
    return place_of(item), _bytes(item.medium.extinction), _bytes(item.medium.absorption)


def may_dim(item: Object) -> bool:
    """True for a body of even density, neither a layer nor a sheet, that absorbs or scatters light."""
    plain = item.density is None and item.sheet_thickness is None and not item.covers
    return plain and item.medium is not None and bool(np.any(item.medium.extinction))


def photons_on_opaque(plan: RenderPlan) -> int:
    """Number of photons that light opaque objects inside bodies; 0 where their light is found as that of others."""
    if plan.caustics is None or plan.traced or not plan.exchanging:
        return 0
    return max(plan.caustics.photons, PHOTONS_ON_OPAQUE)


def media_lit_by_photons(scene: Scene) -> tuple[int, ...]:
    """Numbers of the bodies into which photons carry light."""
    return lit_by_photons(scene, sorted(diffusing_media(scene)))


def diffusing_media(scene: Scene) -> dict[int, Medium]:
    """Media, by the number of the object, in which light diffuses."""
    return {
        i: medium
        for i, item in enumerate(scene.objects)
        if treatment_of(item) in (Treatment.DIFFUSION, Treatment.VOLUME) and (medium := scatterer_of(item)) is not None
    }


def place_of(item: Object) -> tuple[object, bytes]:
    """Mesh and transform of an object."""
    return item.mesh, item.matrix.tobytes()


def opaque_key(item: Object) -> Hashable:
    """All of an opaque object that the light depends on that it blocks, reflects and emits."""
    return place_of(item), item.base_color.tobytes(), item.surface


def coefficients_of(medium: Medium) -> Hashable:
    """Fields of a medium, as a key."""
    coefficients = medium.absorption, medium.scattering, medium.emission, medium.ior
    return (*map(_bytes, coefficients), medium.phase_function)


def roughness_of(item: Object) -> float:
    """Roughness of the surface of an object, 0 where it has none."""
    return 0.0 if item.surface is None else item.surface.roughness


def bending_key(scene: Scene) -> Hashable:
    """Everything except the lights that photon paths depend on."""
    objects = tuple(
        (
            place_of(item),
            item.priority,
            item.sheet_thickness,
            item.surface,
            item.medium,
            scatterer_of(item),
        )
        for item in scene.objects
    )
    return scene.overlap, objects


def kept(store: OrderedDict[Hashable, _T], key: Hashable, make: Callable[[], _T], most: int) -> _T:
    """Entry of a cache, made if it is missing; beyond `most` entries, the least recently used one is dropped."""
    if key not in store:
        store[key] = make()
        if len(store) > most:
            store.popitem(last=False)
    store.move_to_end(key)
    return store[key]


def _bytes(value: npt.ArrayLike) -> bytes:
    return np.asarray(value, np.float64).tobytes()
