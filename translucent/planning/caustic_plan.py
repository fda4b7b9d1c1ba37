"""The plan of a scene with caustics: where photons belong among the passes, and what they leave out."""

from __future__ import annotations

from dataclasses import replace

from translucent.errors import InputError
from translucent.planning.bodies import count_of, indices
from translucent.planning.caustics import Caustics
from translucent.planning.methods import Method
from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.scene.scene import Object, Scene, object_names


def opaque_to_shadows(scene: Scene) -> frozenset[int]:
    """Numbers of the objects that stop the straight light of lamps where photons carry it: solids that bend it."""
    return frozenset(i for i, body in enumerate(scene.objects) if _turns_light(body) and body.sheet_thickness is None)


def with_caustics(
    found: RenderPlan, scene: Scene, caustics: Caustics, method: Method | None, capabilities: Capabilities
) -> RenderPlan:
    """The plan with photons.

    Raises
    ------
    InputError
        If no photon could land, or this machine or what else is asked for follows none.
    """
    _check(scene, method, capabilities)
    _check_ways(scene)
    bending, opaque = indices(scene, _turns_light), indices(scene, lambda item: item.medium is None)
    reason = (
        f"asked for: {caustics.photons:,} photons from {count_of(tuple(range(len(scene.lights))), 'light', 'lights')} "
        f"through {object_names([scene.objects[i] for i in bending])}, added to what opaque objects reflect diffusely"
    )
    cost = caustics.cost_of_a_million * caustics.photons / 1e6
    step = PassSpec(PassName.CAUSTICS, reason, opaque, 1, cost=cost)
    last = next(i for i, one in enumerate(found.passes) if one.name is PassName.OPAQUE) + 1
    return replace(
        found,
        passes=(*found.passes[:last], step, *found.passes[last:]),
        unmodelled=(*found.unmodelled, *_left_out(scene)),
        caustics=caustics,
        opaque_to_shadows=opaque_to_shadows(scene),
    )


def _turns_light(body: Object) -> bool:
    """Whether interfaces of an object bend or mirror light."""
    return body.medium is not None and body.has_interface and body.medium.ior != 1.0


def _check(scene: Scene, method: Method | None, capabilities: Capabilities) -> None:
    if not capabilities.opengl:
        found = "photons are followed by OpenGL, and this renderer works on the CPU"
        raise InputError("caustics", found, "use tl.reference.trace_photons, or an OpenGL backend")
    if method is not None and method.follows_paths:
        found = "its paths meet opaque objects behind interfaces without the caustics on them"
        raise InputError(f"caustics with {method}", found, "leave out one of the two")
    if method is not None and method.makes_sheets:
        found = "it takes every face for a sheet, which bends nothing"
        raise InputError(f"caustics with {method}", found, "leave out one of the two")


def _check_ways(scene: Scene) -> None:
    """Refuse a scene in which no photon could land."""
    if not scene.lights:
        do = "add a tl.PointLight, tl.SpotLight or tl.DirectionalLight; light of the environment makes no caustics"
        raise InputError("caustics", "the scene has no lights", do)
    if not any(_turns_light(body) for body in scene.objects):
        found = f"no interface of {object_names(scene.bodies)} bends or mirrors light"
        raise InputError("caustics", found, "give a medium an index of refraction: ior=1.5")
    if not scene.opaque:
        raise InputError("caustics", "no opaque object that light could land on", "add a ground: tl.Object(mesh)")
    if uneven := [body for body in scene.bodies if body.density is not None]:
        found = f"the density of {object_names(uneven)} varies, and photons follow even media"
        raise InputError("caustics", found, "leave out one of the two")
    if rough := [
        body
        for body in scene.bodies
        if body.sheet_thickness is not None and body.surface is not None and body.surface.roughness > 0.0
    ]:
        found = f"{object_names(rough)}: a sheet that is rough"
        raise InputError("caustics", found, "give it an inside, or no roughness")


def _left_out(scene: Scene) -> tuple[Note, ...]:
    """Notes on light that photons do not carry."""
    texts = [
        "caustics of light of the environment",
        "caustics on receivers that interfaces alone show, which are out of the picture or hidden by what is opaque",
    ]
    if any(body.medium is not None and body.medium.scatters for body in scene.bodies):
        texts.append("caustics in media that scatter, and photons that they scatter")
    surfaces = [body.surface for body in scene.bodies if body.surface is not None]
    if any(surface.iridescence or surface.clearcoat for surface in surfaces):
        texts.append("what thin films and clear coats change in caustics")
    return tuple(Note(NoteKind.CAUSTICS, text) for text in texts)
