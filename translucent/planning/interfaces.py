"""Passes for interfaces of bodies that refract, reflect, tint or scatter light."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import get_args

import numpy as np

from translucent.errors import InputError
from translucent.planning.methods import Method
from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import Interfaces, RenderPlan
from translucent.planning.slots import overlapping_pair
from translucent.scene.scene import Object, Scene, object_names

#: Note of a plan in which rays refract at the front interface alone.
ONE_INTERFACE = Note(
    NoteKind.ONE_INTERFACE,
    'interfaces="front": bends once, where a ray enters; leaves without bending: rays leave curved bodies in wrong '
    "directions",
)

#: Time of the passes over one interface of each body, as a share of that over two; measured on a software rasterizer.
_FRONT_COST = {PassName.INTERFACES: 0.4, PassName.SURFACES: 0.45}


def interface_passes(scene: Scene, method: Method, draw_cost: float, shade_cost: float) -> tuple[PassSpec, ...]:
    """Passes that find and shade interfaces; none where no interface changes light."""
    objects = tuple(i for i, body in enumerate(scene.objects) if body.has_interface)
    if not objects:
        return ()
    names = _names(scene, objects)
    if method.makes_sheets or all(scene.objects[i].sheet_thickness is not None for i in objects):
        # What bends on entering a sheet bends back on leaving it: each has one interface, that towards the eye.
        return (
            PassSpec(
                PassName.INTERFACES,
                f"{names}: normal and place of the sheet that a ray meets first",
                objects,
                1,
                cost=draw_cost * _FRONT_COST[PassName.INTERFACES],
            ),
            PassSpec(
                PassName.SURFACES,
                f"{_effects(scene, bends=False)}; rays go straight through sheets",
                cost=shade_cost,
            ),
        )
    found = f"{names}: normal and place of the interface where a ray enters, and of the one where it leaves"
    return (
        PassSpec(PassName.INTERFACES, found, objects, 2, cost=draw_cost),
        PassSpec(
            PassName.SURFACES,
            f"{_effects(scene)}; the path through the first interval bends with it",
            cost=shade_cost,
        ),
    )


def check_interfaces(interfaces: str) -> None:
    """Raise `InputError` for an unknown choice of interfaces."""
    if interfaces not in get_args(Interfaces):
        raise InputError(f"interfaces {interfaces!r}", "not known", f"use one of {', '.join(get_args(Interfaces))}")


def with_one_interface(scene: Scene, plan: RenderPlan) -> RenderPlan:
    """The plan in which rays bend where they enter bodies and not where they leave; as it is if nothing bends there.

    Raises
    ------
    InputError
        If rays start inside such a body: they have no front interface.
    """
    found = [i for step in plan.passes if step.name is PassName.INTERFACES for i in step.objects]
    solids = [scene.objects[i] for i in found if scene.objects[i].sheet_thickness is None]
    if not solids or plan.method.makes_sheets:
        return plan
    for body in solids:
        if _starts_inside(scene, body):
            raise InputError(
                'interfaces="front"',
                f"rays start inside {body.mesh.name!r}, and meet no interface where they would enter it",
                'use interfaces="both", or move the camera outside',
            )
    told = {
        PassName.INTERFACES: f"{_names(scene, found)}: normal and place of the interface where a ray enters",
        PassName.SURFACES: f"{_effects(scene)}; rays bend where they enter and go straight on",
    }
    passes = tuple(
        replace(
            step,
            reason=told[step.name],
            geometry_passes=step.geometry_passes // 2,
            cost=step.cost * _FRONT_COST[step.name],
        )
        if step.name in told
        else step
        for step in plan.passes
    )
    return replace(plan, passes=passes, unmodelled=(*plan.unmodelled, ONE_INTERFACE), interfaces="front")


def _starts_inside(scene: Scene, body: Object) -> bool:
    """Whether rays of the camera may start inside a body."""
    if scene.camera.fov_y is None:
        return picture_cuts(scene, body)
    low, high = body.bounds - scene.camera.eye
    around = bool((low <= 0).all() and (high >= 0).all())
    # On a surface the winding number is the mean of both sides.
    return around and round(abs(body.winding_number(scene.camera.eye)), 6) >= 0.5


def picture_cuts(scene: Scene, body: Object) -> bool:
    """Whether an orthographic picture's plane, where its rays start, cuts the bounds of a body."""
    if scene.camera.fov_y is not None:
        return False
    low, high = body.bounds - scene.camera.eye
    forward = scene.camera.forward
    return bool(np.where(forward > 0, low, high) @ forward < 0 < np.where(forward > 0, high, low) @ forward)


def touching_interfaces(scene: Scene) -> str | None:
    """Reason why touching bodies with interfaces need ordered surfaces; None if none may touch."""
    solids = [body for body in scene.bodies if body.sheet_thickness is None]
    bends = np.array([body.has_interface for body in solids])
    if not bends.any() or (found := overlapping_pair(solids, lambda one, other: bends[one] | bends[other])) is None:
        return None
    earlier, later = (solids[index] for index in found)
    names = f"{earlier.mesh.name!r} and {later.mesh.name!r}"
    return f"interfaces of {names} may touch: the order tells where a ray leaves both"


def _names(scene: Scene, objects: Iterable[int]) -> str:
    return object_names(scene.objects[i] for i in objects)


def _effects(scene: Scene, *, bends: bool = True) -> str:
    """Effects of the interfaces of this scene, in words."""
    bodies = [body for body in scene.bodies if body.has_interface]
    surfaces = [body.surface for body in bodies if body.surface is not None]
    effects = []
    if any(body.medium is not None and body.medium.ior > 1 for body in bodies):
        effects.append(f"interfaces mirror the environment{' and bend rays' if bends else ''} (ior above 1)")
    if any(surface.roughness > 0 for surface in surfaces):
        effects.append("rough ones blur both")
    if bends and any(surface.dispersion > 0 for surface in surfaces):
        effects.append("dispersion bends each channel on its own")
    if any(surface.transmission < 1 for surface in surfaces):
        effects.append("paint reflects what does not enter")
    if any((np.asarray(surface.color) != 1).any() or surface.color_texture for surface in surfaces):
        effects.append("colors tint what enters")
    if any(surface.multiple_scattering for surface in surfaces):
        effects.append("light that scatters many times leaves as from a layer (Kubelka and Munk)")
    return "; ".join(effects) or "interfaces"
