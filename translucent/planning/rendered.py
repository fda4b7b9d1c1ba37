"""Scenes as plans render them: objects with the treatment of the light that they scatter."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from translucent.media.medium import Medium
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene

#: Optical depth across a body that no light passes, as photons carry it.
DENSE = 1e4

_BLACK = Environment.constant((0.0, 0.0, 0.0))


class Treatment(Enum):
    """Model of scattered light that a plan uses for a body."""

    #: What is scattered once into a ray; what is scattered again is lost. Also of what does not scatter.
    SINGLE = "single scattering"

    #: What is scattered many times leaves the surface as that of a flat layer; see `ScatteringLayer`.
    LAYER = "layer"

    #: It leaves the surface as it has diffused in the body; see `Diffusion`.
    DIFFUSION = "diffusion"

    #: Rays gather it in the body, from a solution on a grid; see `Diffusion`.
    VOLUME = "diffusion in a volume"

    #: Random paths find all of it; see `PathTraced`.
    PATHS = "random paths"


@dataclass(frozen=True, eq=False, repr=False)
class RenderedObject(Object):
    """Object of `RenderPlan.scene`.

    Parameters
    ----------
    treatment : Treatment
    scatterer : Medium, optional
        Medium in which light diffuses, where `medium` only removes it from rays. Default: `medium`.
    """

    treatment: Treatment = Treatment.SINGLE
    scatterer: Medium | None = None

    @cached_property
    def has_interface(self) -> bool:
        """True if the interface changes light, or scattered light leaves through it."""
        return super().has_interface or self.treatment in (Treatment.LAYER, Treatment.DIFFUSION)


def treatment_of(item: Object) -> Treatment:
    """Treatment of an object."""
    return item.treatment if isinstance(item, RenderedObject) else Treatment.SINGLE


def scatterer_of(item: Object) -> Medium | None:
    """Medium of an object that scatters light."""
    return item.scatterer or item.medium if isinstance(item, RenderedObject) else item.medium


def treated(item: Object, treatment: Treatment, medium: Medium, scatterer: Medium | None = None) -> RenderedObject:
    """The object with this treatment and medium."""
    fields = item.mesh, medium, item.transform, item.priority, item.sheet_thickness, item.color, item.density
    return RenderedObject(*fields, item.surface, item.shadow_catcher, treatment, scatterer)


def straight_scene(scene: Scene) -> Scene:
    """The scene without interfaces, and with media that only absorb: thickness and optical depth are the same."""
    media = {id(body.medium): Medium(body.medium.extinction) for body in scene.bodies if body.medium is not None}
    objects = [item if item.medium is None else _absorbing(item, media[id(item.medium)]) for item in scene.objects]
    return replace(scene, objects=objects, lights=())


def occluding_bodies(scene: Scene) -> Sequence[Object]:
    """Bodies that throw shadows. Layers throw none; but a plan needs bodies, and alone they are clear sheets."""
    return [item for item in scene.bodies if not item.covers] or scene.bodies


def occluders(scene: Scene, opaque: Container[int] | None = None) -> tuple[int, ...]:
    """Numbers of the bodies that throw shadows, and of these opaque objects. Default: of all."""
    bodies = set(map(id, occluding_bodies(scene)))
    return tuple(
        i
        for i, item in enumerate(scene.objects)
        if (id(item) in bodies if item.medium is not None else opaque is None or i in opaque)
    )


def occluder_scene(scene: Scene, numbers: Iterable[int]) -> Scene:
    """Scene that a light sees: these objects of it, without interfaces, in the dark."""
    objects = [scene.objects[i] for i in numbers]
    return straight_scene(replace(scene, objects=objects, environment=_BLACK, environment_shadows=0))


def darkened(scene: Scene, bodies: frozenset[int]) -> Scene:
    """The scene with these of its bodies so dense that no light passes; the scene itself if there are none."""
    if not bodies:
        return scene

    def dense(body: Object) -> Object:
        return _absorbing(body, Medium(DENSE / float(np.linalg.norm(body.bounds[1] - body.bounds[0]))))

    return replace(scene, objects=[dense(body) if i in bodies else body for i, body in enumerate(scene.objects)])


def _absorbing(item: Object, medium: Medium) -> Object:
    """The object with a medium that only absorbs, and no interface."""
    fields = item.mesh, medium, item.transform, item.priority, item.sheet_thickness, item.color, item.density
    return Object(*fields, None, item.shadow_catcher)
