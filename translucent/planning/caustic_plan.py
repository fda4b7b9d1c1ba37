"""The plan of a scene with caustics: where photons belong among the passes, and what they leave out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from translucent.errors import InputError
from translucent.formulas.phase import ISOTROPIC
from translucent.planning.bodies import count_of, indices
from translucent.planning.caustics import Caustics
from translucent.planning.methods import Method
from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.rendered import Treatment
from translucent.scene.scene import Object, Scene, object_names

#: Time of a photon in media for each object of the scene, which are searched one after the other, in seconds of a
#: processor core: through a ball of glass into fog, measured on two busy cores.
SECONDS_OF_A_PHOTON = 2.5e-5

#: Passes that show light of media, of which the first that a plan has tells of photons in them.
_CARRYING = PassName.LIGHT_VIEWS, PassName.TRACED, PassName.SURFACES


def opaque_to_shadows(scene: Scene) -> frozenset[int]:
    """Numbers of the objects that stop the straight light of lamps where photons carry it: solids that bend it."""
    return frozenset(i for i, body in enumerate(scene.objects) if _turns_light(body) and body.sheet_thickness is None)


def lit_by_photons(scene: Scene, solved: Iterable[int]) -> tuple[int, ...]:
    """Bodies in which light diffuses, by their numbers, into which others bend some."""
    bending = opaque_to_shadows(scene)
    return tuple(i for i in solved if bending - {i})


def with_caustics(
    found: RenderPlan, scene: Scene, caustics: Caustics, method: Method | None, capabilities: Capabilities
) -> RenderPlan:
    """The plan with photons.

    Raises
    ------
    InputError
        If no photon could land, or this machine or what else is asked for follows none.
    """
    _check(method)
    volumes = found.treated(Treatment.VOLUME)
    lit = lit_by_photons(scene, found.treated(Treatment.VOLUME, Treatment.DIFFUSION))
    _check_ways(scene, lit)
    carries = next((one for one in _CARRYING if found.has(one)), None)
    steps: list[PassSpec] = []
    for one in found.passes:
        steps.append(_into_media(one, scene, lit, caustics) if lit and one.name is carries else one)
        if one.name is PassName.OPAQUE:
            steps.append(_onto_opaque(scene, caustics))
        elif one.name is PassName.SHADE and scene.opaque:
            steps[-1] = _shaded_with(steps[-1], scene, caustics)
    return replace(
        found,
        passes=tuple(steps),
        unmodelled=(*found.unmodelled, *_left_out(scene, lit, volumes, capabilities.opengl)),
        caustics=caustics,
        opaque_to_shadows=opaque_to_shadows(scene),
    )


def _onto_opaque(scene: Scene, caustics: Caustics) -> PassSpec:
    """Pass of the photons that land on opaque objects."""
    opaque, cost = indices(scene, lambda item: item.medium is None), caustics.cost_of_a_million * caustics.photons / 1e6
    return PassSpec(PassName.CAUSTICS, _landing(scene, caustics), opaque, 1, cost=cost)


def _shaded_with(step: PassSpec, scene: Scene, caustics: Caustics) -> PassSpec:
    """Pass that shades opaque objects without OpenGL, with the photons that land on them."""
    seconds = caustics.photons * SECONDS_OF_A_PHOTON * len(scene.objects)
    told = f"{_landing(scene, caustics)}, followed on the processor, about {seconds:.2g} s"
    return replace(step, reason=f"{step.reason}; {told}")


def _landing(scene: Scene, caustics: Caustics) -> str:
    return (
        f"asked for: {caustics.photons:,} photons from {count_of(tuple(range(len(scene.lights))), 'light', 'lights')} "
        f"through {_bending(scene)}, added to what opaque objects reflect diffusely"
    )


def _into_media(step: PassSpec, scene: Scene, lit: tuple[int, ...], caustics: Caustics) -> PassSpec:
    """Pass that shows light of media, with the photons that carry it there."""
    seconds = caustics.in_media * SECONDS_OF_A_PHOTON * len(scene.objects)
    reason = (
        f"{step.reason}; asked for: {caustics.in_media:,} photons, followed on the processor and again only where "
        f"objects or lights change, carry what {_bending(scene)} bends into {_names(scene, lit)}, about "
        f"{seconds:.2g} s"
    )
    return replace(step, reason=reason)


def _bending(scene: Scene) -> str:
    return _names(scene, indices(scene, _turns_light))


def _names(scene: Scene, numbers: tuple[int, ...]) -> str:
    return object_names([scene.objects[i] for i in numbers])


def _turns_light(body: Object) -> bool:
    """True if interfaces of an object bend or mirror light."""
    return body.medium is not None and body.has_interface and body.medium.ior != 1.0


def _check(method: Method | None) -> None:
    if method is not None and method.follows_paths:
        found = "its paths meet opaque objects behind interfaces without the caustics on them"
        raise InputError(f"caustics with {method}", found, "leave out one of the two")
    if method is not None and method.makes_sheets:
        found = "it takes every face for a sheet, which bends nothing"
        raise InputError(f"caustics with {method}", found, "leave out one of the two")


def _check_ways(scene: Scene, lit: tuple[int, ...]) -> None:
    """Refuse a scene in which no photon could land."""
    if not scene.lights:
        do = "add a tl.PointLight, tl.SpotLight or tl.DirectionalLight; light of the environment makes no caustics"
        raise InputError("caustics", "the scene has no lights", do)
    if not any(_turns_light(body) for body in scene.objects):
        found = f"no interface of {object_names(scene.bodies)} bends or mirrors light"
        raise InputError("caustics", found, "give a medium an index of refraction: ior=1.5")
    if not scene.opaque and not lit:
        found = "no opaque object that light could land on, and no other body in which light is scattered on"
        raise InputError("caustics", found, "add a ground: tl.Object(mesh)")
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


def _left_out(scene: Scene, lit: tuple[int, ...], fogs: tuple[int, ...], opengl: bool) -> tuple[Note, ...]:
    """Notes on light that photons do not carry."""
    texts = ["caustics of light of the environment"]
    if opengl:
        hidden = "which are out of the picture or hidden by what is opaque"
        texts.append(f"caustics on receivers that interfaces alone show, {hidden}")
    dark = indices(scene, lambda body: body.medium is not None and body.medium.scatters)
    uneven = indices(scene, lambda body: body.medium is not None and body.medium.phase_function != ISOTROPIC)
    if others := tuple(i for i in dark if i not in lit):
        texts.append(f"caustics in media that scatter: {_names(scene, others)}")
    if dark:
        texts.append("photons that media scatter")
    if aside := tuple(i for i in fogs if i in uneven):
        texts.append(f"directions in which {_names(scene, aside)} scatters caustics: alike in all")
    return tuple(Note(NoteKind.CAUSTICS, text) for text in texts)
