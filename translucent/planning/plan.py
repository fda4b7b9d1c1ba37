"""The planner: from a scene to the cheapest passes that are exact for it, each with its reason. Pure; needs no GPU."""

from __future__ import annotations

import weakref
from collections.abc import Hashable
from dataclasses import replace

import numpy as np

from translucent.arguments import checked_but
from translucent.errors import InputError
from translucent.geometry.together import diagnose_together
from translucent.planning.assembly import COSTS, assembled
from translucent.planning.bodies import scatters, solids_of
from translucent.planning.caustic_plan import with_caustics
from translucent.planning.caustics import Caustics
from translucent.planning.darkness import black_bodies
from translucent.planning.effects import AMBIENT, layers_instead, shadow_effects, unmodelled_effects, with_ambient
from translucent.planning.interface_choice import USUAL_DEPTH, chosen_interfaces
from translucent.planning.interfaces import Interfaces, ScreenInterfaces, TracedInterfaces
from translucent.planning.interfaces.places import with_interfaces
from translucent.planning.limits import marching_method, mesh_limits, open_limits, scattered_again_method
from translucent.planning.methods import (
    DepthPeeling,
    FragmentLists,
    Method,
    PathTraced,
    SignedDepth,
    ThinLayer,
)
from translucent.planning.notes import Note, NoteKind
from translucent.planning.order import why_order_matters
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import Capabilities, MapPlan, RenderPlan
from translucent.planning.rendered import Treatment, darkened, occluder_scene, occluders, straight_scene, treatment_of
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import Scattering, SingleScattering
from translucent.planning.shadow_maps import ShadowMaps, shadow_passes, shadows_left_out
from translucent.planning.slots import require_clear_priorities
from translucent.planning.treatments import Treatments, choose_treatments, rendered_scene
from translucent.scene.scene import Object, Scene, check_scene, object_names


@checked_but("scene", "method", "interfaces", "scattering", "caustics", "shadows")
def plan(
    scene: Scene,
    method: Method | None = None,
    capabilities: Capabilities | None = None,
    *,
    interfaces: Interfaces | None = None,
    scattering: Scattering | None = None,
    caustics: Caustics | None = None,
    shadows: ShadowMaps | None = None,
) -> RenderPlan:
    """Choose the passes for a scene.

    Parameters
    ----------
    scene : Scene
    method : Method, optional
        How to find thickness; None picks the cheapest way that is exact.
    capabilities : Capabilities, optional
        Of the machine; default: all.
    interfaces : TracedInterfaces, ScreenInterfaces or FrontInterface, optional
        How to find the interfaces at which light refracts and reflects; None lets the planner pick.
    scattering : Diffusion, ScatteringLayer or SingleScattering, optional
        How to show light that media scatter more than once; None lets the planner pick.
    caustics : Caustics, optional
        Photons from the lights through interfaces onto opaque objects and into fog; None for none.
    shadows : ShadowMaps, optional
        How to find shadows on opaque objects; a renderer without OpenGL traces them. Default: `ShadowMaps()`.

    Raises
    ------
    InputError
        If no available method can render the scene, or not with interfaces, scattering, caustics or shadows as asked
        for.
    """
    request = RenderRequest(method, 1, interfaces, scattering, caustics, shadows)
    return plan_scene(scene, request, capabilities)


def plan_scene(scene: Scene, request: RenderRequest, capabilities: Capabilities | None = None) -> RenderPlan:
    """Choose the passes for what is requested of a scene.

    Raises
    ------
    InputError
        As `plan`; before a `Backdrop` also if the scene has opaque objects of its own, or interfaces are to be traced.
    """
    check_scene(scene)
    machine = capabilities or Capabilities()
    if request.over_backdrop:
        _check_backdrop(scene, request)
    diagnose_together(body.mesh for body in scene.bodies if body.sheet_thickness is None)
    paths = request.method if isinstance(request.method, PathTraced) else None
    if paths is None:
        treatments = _treatments(scene, request, machine)
        rendered = rendered_scene(scene, treatments)
        found = _thickness(rendered, request, machine, ambient=_scatters_ambient(scene, treatments))
        notes = layers_instead(scene, treatments.refusals)
        found = replace(found, diffusion=treatments.diffusion, unmodelled=(*found.unmodelled, *notes))
    else:
        _check_paths(scene, request, paths, machine)
        found = _thickness(straight_scene(scene), RenderRequest(), machine, ambient=False)
        everywhere = {i: Treatment.PATHS for i, item in enumerate(scene.objects) if item.medium is not None}
        found = replace(
            found,
            scene=rendered_scene(scene, Treatments(everywhere)),
            passes=(*found.passes, *paths.passes(scene, "asked for")),
            limits=(*found.limits, *paths.limits(scene)),
            unmodelled=paths.unmodelled(scene),
            paths=paths,
        )
    found = replace(found, request=request, remarks=black_bodies(scene))
    if request.caustics is not None:
        found = with_caustics(found, scene, request.caustics, request.method, machine)
    return found if found.traced else _with_shadows(found, scene, machine)


def _treatments(scene: Scene, request: RenderRequest, machine: Capabilities) -> Treatments:
    """How bodies show light that they scatter many times."""
    method, scattering = request.method, request.scattering
    # Where nothing bends, a method that is requested is the sum that is requested, of light scattered once; and ambient
    # light stands for what is scattered often.
    matched = scattering is not None or (method is None and not scene.scatters_ambient)
    volumes = machine.opengl and machine.shader_storage and (method is None or method.marches)
    return choose_treatments(scene, scattering, layers=machine.opengl, matched=matched, volumes=volumes)


def _scatters_ambient(scene: Scene, treatments: Treatments) -> bool:
    """True if a medium in which light does not diffuse scatters ambient radiance, which counts as emitted there."""
    if not scene.scatters_ambient:
        return False
    media = (
        item.medium
        for i, item in enumerate(scene.objects)
        if item.medium is not None and treatments.of.get(i) is not Treatment.DIFFUSION
    )
    return any(bool((np.asarray(medium.scattering) * np.asarray(scene.ambient) > 0).any()) for medium in media)


def _thickness(scene: Scene, request: RenderRequest, machine: Capabilities, *, ambient: bool) -> RenderPlan:
    """Plan of a scene with its treatments, but for random paths, photons and shadows.

    `ambient`: what media emit there is also the ambient radiance that they scatter.
    """
    if not scene.bodies:
        raise InputError(
            f"rendering {object_names(scene.objects)}",
            "nothing there has a medium",
            "give an object one: medium=tl.Medium(...)",
        )
    if scene.overlap == "priority":
        require_clear_priorities(scene)
    method = request.method
    if not machine.opengl:
        return _traced(scene, method, request.interfaces, machine, ambient=ambient)
    interfaces = request.interfaces or (ScreenInterfaces() if request.over_backdrop else None)
    sheets = method is not None and method.makes_sheets
    bending, instead = chosen_interfaces(scene, interfaces, sheets=sheets)
    chosen, why = _method(scene, method, machine, bending, request.caustics)
    if method is None and isinstance(request.scattering, SingleScattering) and isinstance(chosen, FragmentLists):
        chosen = replace(chosen, light_points=request.scattering.points)
    return assembled(scene, chosen, why, bending, machine, instead=instead, ambient=ambient)


def _method(
    scene: Scene,
    method: Method | None,
    machine: Capabilities,
    interfaces: Interfaces,
    caustics: Caustics | None = None,
) -> tuple[Method, str]:
    """The method of a renderer with OpenGL, and why it is that one; refuses what is requested if it cannot do."""
    if scene.varies:
        return marching_method(scene, method, machine), "the density varies from place to place"
    if method is None and any(treatment_of(body) is Treatment.VOLUME for body in scene.bodies):
        return scattered_again_method(scene, caustics), "light scattered again into the rays: steps look it up"
    if method is not None and method.ordered:
        return method, "asked for"
    if (why := why_order_matters(scene, method, interfaces)) is not None:
        return _ordered_method(scene, method, machine, why), why
    if method is not None:
        return method, "asked for"
    if scatters(scene) and machine.shader_storage:
        return FragmentLists(), "light scattered into the rays: each interval looks at the lights"
    if not solids_of(scene):
        return ThinLayer(), "all bodies are declared sheets"
    return SignedDepth(), "a sum over each ray tells its picture"


def _ordered_method(scene: Scene, method: Method | None, machine: Capabilities, why: str) -> Method:
    """Method for a scene that needs ordered intervals; refuses any other that is requested."""
    if not solids_of(scene):
        raise InputError(
            f"rendering {object_names(scene.bodies)}",
            f"{why}, and sheets have no place in the order",
            "give all sheets one medium, or none that emits",
        )
    cheapest = _cheapest_ordered(scene, machine)
    if method is not None:
        do = f"use {type(cheapest).__name__}, or leave the choice to the planner"
        raise InputError(type(method).__name__, why, do)
    return cheapest


def _cheapest_ordered(scene: Scene, machine: Capabilities) -> Method:
    """Method with the lowest expected cost of those that find all intervals."""
    # Of two that cost the same the lists come first: peeling waits for a count before it goes on.
    candidates: list[Method] = [FragmentLists()] if machine.shader_storage else []
    candidates.append(DepthPeeling())
    return min(candidates, key=lambda method: sum(step.cost for step in method.passes(scene, "")))


def _traced(
    scene: Scene, method: Method | None, interfaces: Interfaces | None, machine: Capabilities, *, ambient: bool
) -> RenderPlan:
    """Plan for a renderer without OpenGL, which finds all surfaces on each ray, whatever the method."""
    followed = _followed(scene, interfaces)
    chosen = method or FragmentLists()
    sheets = chosen.makes_sheets
    reason = "no OpenGL: all surfaces on each ray, in float64"
    if method is not None and not sheets:
        reason += f", in place of {method}, which was asked for"
    if followed is not None and interfaces is not None and not interfaces.traced:
        reason += f"; and {followed} in place of {interfaces}"
    shading = "sheets in order" if sheets else "the intervals between them in order, exactly"
    passes = (
        PassSpec(PassName.INTERSECT, reason, tuple(range(len(scene.objects))), 1),
        PassSpec(PassName.SHADE, f"{shading}; {AMBIENT}" if ambient else shading),
    )
    limits = (*(chosen.limits(scene) if sheets else open_limits(scene)), *mesh_limits(scene, chosen))
    unmodelled = unmodelled_effects(scene, scattering=machine.scattering and scatters(scene), interfaces=followed)
    unmodelled = with_ambient(unmodelled) if ambient else unmodelled
    return RenderPlan(scene, chosen, passes, True, limits, unmodelled, interfaces=followed, traced=True)


def _followed(scene: Scene, interfaces: Interfaces | None) -> Interfaces | None:
    """The interfaces that a renderer without OpenGL follows: all, whatever is asked for, as far as tracing would."""
    if not with_interfaces(scene):
        return None
    return interfaces if interfaces is not None and interfaces.traced else TracedInterfaces(depth=USUAL_DEPTH)


def _with_shadows(found: RenderPlan, scene: Scene, machine: Capabilities) -> RenderPlan:
    """The plan with shadows on opaque objects, or on a picture of them that is drawn elsewhere."""
    before, behind = shadow_passes(scene, over_backdrop=found.request.over_backdrop), tuple[PassSpec, ...]()
    unmodelled: list[Note] = []
    if found.request.over_backdrop:
        reason = "opaque objects come as a picture drawn elsewhere: rays through the media end at its depth"
        behind = (PassSpec(PassName.BACKDROP, reason, cost=COSTS["resolve"]),)
        drawn_elsewhere = Note(NoteKind.SHADOWS, "shadows of what is drawn elsewhere on the media")
        unmodelled = [*shadow_effects(scene), drawn_elsewhere]
    elif before and found.has(PassName.TRACED, PassName.SURFACES, PassName.PATH_TRACE):
        unmodelled = [*shadows_left_out(machine.texture_units)]
    if not before and not behind:
        return found
    return replace(
        found,
        passes=(*before, *behind, *found.passes),
        unmodelled=(*found.unmodelled, *unmodelled),
        shadows=found.request.shadows or ShadowMaps(),
        maps=_map_plans(scene, found, machine) if before else (),
    )


def _map_plans(scene: Scene, found: RenderPlan, machine: Capabilities) -> tuple[MapPlan, ...]:
    """Plans of the maps of shadows: as lights see the scene, and as the sky does.

    They are kept until objects change: lights and cameras do more often.
    """
    # Where all bodies are drawn as sheets, these throw the shadows, too.
    method = found.method if found.method.makes_sheets else None
    key = tuple(map(weakref.ref, scene.objects)), scene.overlap, method, found.opaque_to_shadows, machine.shader_storage
    known = _MAPS.get(scene.objects[0])
    if known is None or known[0] != key:
        seen = [scene] if not found.opaque_to_shadows else [darkened(scene, found.opaque_to_shadows), scene]
        storage = Capabilities(shader_storage=machine.shader_storage)
        plans = (
            _thickness(occluder_scene(each, occluders(each)), RenderRequest(method), storage, ambient=False)
            for each in seen
        )
        known = key, tuple(MapPlan(each.method, each.passes, each.spectral) for each in plans)
        _MAPS[scene.objects[0]] = known
    return known[1]


_MAPS: weakref.WeakKeyDictionary[Object, tuple[Hashable, tuple[MapPlan, ...]]] = weakref.WeakKeyDictionary()


def _check_paths(scene: Scene, request: RenderRequest, method: PathTraced, machine: Capabilities) -> None:
    """Raise `InputError` if paths cannot render a scene, or something is requested that they take the place of."""
    for what, asked in (("interfaces", request.interfaces), ("scattering", request.scattering)):
        if asked is not None:
            raise InputError(f"{method} with {what}={asked}", f"paths take the place of {what}", "give one of the two")
    if not machine.opengl:
        found = "paths are followed by OpenGL, and this renderer works on the CPU"
        raise InputError(str(method), found, "use tl.reference.path_trace(scene, size, paths), or an OpenGL backend")
    method.check(scene)


def _check_backdrop(scene: Scene, request: RenderRequest) -> None:
    """Raise `InputError` if a scene cannot be rendered before a `Backdrop` as requested."""
    if scene.opaque:
        raise InputError(
            "a backdrop",
            f"the scene has opaque objects of its own: {object_names(scene.opaque)}",
            "leave them out, or to whoever draws the backdrop",
        )
    if isinstance(request.method, PathTraced):
        found = "what is drawn elsewhere has no mesh that a path could meet"
        raise InputError(f"{request.method} before a backdrop", found, "leave out one of the two")
    if request.interfaces is not None and request.interfaces.traced:
        found = "what is drawn elsewhere has no mesh that a ray could meet"
        raise InputError(f"{request.interfaces} before a backdrop", found, "use ScreenInterfaces()")
