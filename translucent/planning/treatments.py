"""Treatments: how a plan shows the light that each body scatters, and the scene as it is rendered then."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace

import numpy as np

from translucent.errors import InputError
from translucent.media.medium import Medium
from translucent.planning.rendered import Treatment, treated
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer
from translucent.planning.slots import MAX_SLOTS, medium_slots
from translucent.scene.scene import Object, Scene

#: Least reduced scattering across a body, sigma_s' times its mean thickness, at which the planner shows more than what
#: single scattering does: of the environment's light, that is nothing.
LEAST_DEPTH = 0.01

#: Optical depth across a cell from which on light of a body of one density leaves through its surface.
MOST_CELL_DEPTH = 1.0

#: Bodies in which light diffuses unless it is requested: each takes its tenths of a second and its share of a texture.
MOST_DIFFUSED = 32

#: Reason against light scattered again where density varies.
_NO_STEPS = "its density varies, and no steps of a ray gather its light: that takes OpenGL 4.3 and RayMarched"


@dataclass(frozen=True)
class Treatments:
    """Treatments of the bodies of a scene that show light which they scatter many times.

    Attributes
    ----------
    of : dict of int to Treatment
        By the number of the object.
    diffusion : Diffusion
        Of those in which light diffuses.
    refusals : tuple of (int, str)
        Objects that are layers since light cannot diffuse in them, and why.
    """

    of: dict[int, Treatment] = field(default_factory=dict)
    diffusion: Diffusion = field(default_factory=Diffusion)
    refusals: tuple[tuple[int, str], ...] = ()


def choose_treatments(
    scene: Scene, requested: Scattering | None, *, layers: bool = True, matched: bool = True, volumes: bool = True
) -> Treatments:
    """Choose how the bodies of a scene show light that they scatter many times.

    Unless it is requested, those that scatter little do not show any.

    Parameters
    ----------
    scene : Scene
    requested : Scattering, optional
    layers : bool
        Bodies can be shown as layers.
    matched : bool
        Bodies without an interface can show it, too.
    volumes : bool
        Rays can gather it on their way through them; else it leaves through their surface.

    Raises
    ------
    InputError
        If what is requested can be done for none of the bodies that scatter.
    """
    if requested is not None and not requested.gives_back:
        return Treatments()
    wanted = Diffusion() if requested is None else requested
    bodies = {
        i: body
        for i, body in enumerate(scene.objects)
        if body.medium is not None
        and body.medium.scatters
        and not body.covers
        and (body.has_interface or matched)
        and (requested is not None or _is_deep(body, body.medium))
    }
    refused = {i: why for i, body in bodies.items() if (why := wanted.refusal(body)) is not None}
    if not volumes:
        refused |= {i: _NO_STEPS for i, body in bodies.items() if _is_cloud(body)}
    if requested is None and len(bodies) - len(refused) > MOST_DIFFUSED:
        many = f"light would diffuse in more than {MOST_DIFFUSED} bodies, which takes long"
        refused = dict.fromkeys(bodies, many) | refused
    layer, of = ScatteringLayer(), dict[int, Treatment]()
    for i, body in bodies.items():
        if layers and (i in refused or wanted == layer) and layer.refusal(body) is None:
            of[i] = Treatment.LAYER
        elif i not in refused and isinstance(wanted, Diffusion):
            of[i] = Treatment.DIFFUSION
    if requested is not None and bodies and not of:
        i = next(iter(bodies))
        why = refused.get(i, "this renderer draws no layers")
        raise InputError(str(requested), f"{scene.objects[i].mesh.name!r}: {why}", "use SingleScattering()")
    if not isinstance(wanted, Diffusion):
        return Treatments(of)
    if volumes:
        solved = [i for i, treatment in of.items() if treatment is Treatment.DIFFUSION]
        of |= dict.fromkeys(_volumes(scene, solved, wanted), Treatment.VOLUME)
    layered = tuple((i, why) for i, why in refused.items() if of.get(i) is Treatment.LAYER)
    return Treatments(of, wanted, layered)


def rendered_scene(scene: Scene, treatments: Treatments) -> Scene:
    """Scene as it is rendered: bodies with their treatments, and media that emit the ambient radiance they scatter."""
    objects = list(scene.objects)
    for i, item in enumerate(objects):
        treatment = treatments.of.get(i, Treatment.SINGLE)
        if (medium := item.medium) is None:
            continue
        if treatment is Treatment.DIFFUSION:
            straight = Medium(medium.extinction, emission=scene.source(item), ior=medium.ior)
            objects[i] = treated(item, treatment, straight, medium)
        elif scene.scatters_ambient and medium.scatters:
            objects[i] = treated(item, treatment, replace(medium, emission=scene.source(item)))
        elif treatment is not Treatment.SINGLE:
            objects[i] = treated(item, treatment, medium)
    # A scene of its own in any case, lest plans that are kept for a scene keep it.
    if all(item is given for item, given in zip(objects, scene.objects, strict=True)):
        return copy.copy(scene)
    return replace(scene, objects=objects, ambient=(0.0, 0.0, 0.0))


def _volumes(scene: Scene, solved: list[int], wanted: Diffusion) -> tuple[int, ...]:
    """The bodies into whose rays light is scattered, as far as each can have winding numbers of its own."""
    varying = tuple(i for i in solved if _is_cloud(scene.objects[i]))
    even = tuple(i for i in solved if scene.objects[i].density is None and _is_volume(scene.objects[i], wanted))
    fogs = varying + even
    return fogs if not fogs or len(medium_slots(scene, apart=fogs)) <= MAX_SLOTS else varying


def _is_cloud(body: Object) -> bool:
    return body.density is not None and not body.has_interface


def _is_deep(body: Object, medium: Medium) -> bool:
    reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    densest = 1.0 if body.density is None else body.density.maximum
    return bool(reduced.max() * densest * body.mean_thickness > LEAST_DEPTH)


def _is_volume(body: Object, wanted: Diffusion) -> bool:
    """True if rays gather light in a body of one density: where they see more than a skin beneath all cells."""
    if body.has_interface:
        return False
    assert body.medium is not None
    medium = body.medium
    reduced = np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    return float(reduced.max()) * wanted.cell_size(body) < MOST_CELL_DEPTH
