"""The planner: from a scene to the cheapest passes that are exact for it, each with its reason. Pure; needs no GPU."""

from __future__ import annotations

import dataclasses

from translucent.arguments import checked_but
from translucent.errors import InputError
from translucent.geometry.together import diagnose_together
from translucent.media.given_back import DiffusedVolume
from translucent.planning.assembly import COSTS, assembled, with_unlit_marked
from translucent.planning.bodies import scatters, solids_of
from translucent.planning.caustic_plan import with_caustics
from translucent.planning.caustics import Caustics, check_caustics
from translucent.planning.darkness import black_bodies
from translucent.planning.effects import shadow_effects, unmodelled_effects, with_ambient_told, with_given_back_told
from translucent.planning.interface_choice import USUAL_DEPTH, check_interfaces, chosen_interfaces, with_fallback_told
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
from translucent.planning.methods.base import check_method
from translucent.planning.notes import Note, NoteKind
from translucent.planning.order import why_order_matters
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.paths import check_paths, straight_scene, with_paths
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.scattering import Scattering, SingleScattering
from translucent.planning.scattering.choice import check_scattering, given_back, shown
from translucent.planning.shadow_maps import ShadowMaps, check_shadows, shadow_passes, shadows_left_out
from translucent.planning.slots import require_clear_priorities
from translucent.scene.scene import Scene, check_scene, object_names


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
    check_scene(scene)
    check_caustics(caustics)
    check_shadows(shadows)
    diagnose_together(body.mesh for body in scene.bodies if body.sheet_thickness is None)
    chosen = _plan(scene, method, capabilities, interfaces, scattering, caustics)
    if remarks := black_bodies(scene):
        chosen = dataclasses.replace(chosen, remarks=remarks)
    if caustics is not None:
        chosen = with_caustics(chosen, scene, caustics, method, capabilities or Capabilities())
    if chosen.traced:
        return chosen
    if not (found := shadow_passes(scene)):
        return chosen
    left_out: tuple[Note, ...] = ()
    if chosen.has(PassName.TRACED, PassName.SURFACES, PassName.PATH_TRACE):
        left_out = shadows_left_out((capabilities or Capabilities()).texture_units)
    return dataclasses.replace(
        chosen,
        passes=(*found, *chosen.passes),
        unmodelled=(*chosen.unmodelled, *left_out),
        shadows=shadows or ShadowMaps(),
    )


def _plan(
    scene: Scene,
    method: Method | None,
    capabilities: Capabilities | None,
    interfaces: Interfaces | None = None,
    scattering: Scattering | None = None,
    caustics: Caustics | None = None,
) -> RenderPlan:
    """The plan but for shadows and photons."""
    check_method(method)
    check_interfaces(interfaces)
    check_scattering(scattering)
    capabilities = capabilities or Capabilities()
    if isinstance(method, PathTraced):
        check_paths(scene, method, capabilities, interfaces, scattering)
        return with_paths(scene, method, _plan(straight_scene(scene), None, capabilities))
    opengl = capabilities.opengl
    # Where nothing bends, a method that is asked for is the sum that is asked for, of light scattered once; and ambient
    # light stands for what is scattered often.
    matched = scattering is not None or (method is None and not scene.scatters_ambient)
    volumes = opengl and capabilities.shader_storage and (method is None or method.marches)
    if back := given_back(scene, scattering, layers=opengl, matched=matched, volumes=volumes):
        once = SingleScattering()
        found = _plan(shown(scene, back), method, capabilities, interfaces, once, caustics)
        return with_given_back_told(found, scene, back)
    if scene.scatters_ambient:
        emitted = scene.with_ambient_emitted
        shown_once = scattering or SingleScattering()
        return with_ambient_told(_plan(emitted, method, capabilities, interfaces, shown_once))
    if not scene.bodies:
        raise InputError(
            f"rendering {object_names(scene.objects)}",
            "nothing there has a medium",
            "give an object one: medium=tl.Medium(...)",
        )
    if scene.overlap == "priority":
        require_clear_priorities(scene)
    if not capabilities.opengl:
        return _plan_traced(scene, method, interfaces, capabilities)
    sheets = method is not None and method.makes_sheets
    bending, instead = chosen_interfaces(scene, interfaces, sheets=sheets)
    thickness, why = _choice(scene, method, capabilities, bending, caustics)
    if method is None and isinstance(scattering, SingleScattering) and isinstance(thickness, FragmentLists):
        thickness = dataclasses.replace(thickness, light_points=scattering.points)
    chosen = assembled(scene, thickness, why, bending, capabilities)
    if scatters(scene) and not capabilities.shader_storage:
        chosen = with_unlit_marked(scene, chosen)
    return with_fallback_told(chosen, instead) if instead else chosen


def _choice(
    scene: Scene,
    method: Method | None,
    capabilities: Capabilities,
    interfaces: Interfaces,
    caustics: Caustics | None = None,
) -> tuple[Method, str]:
    """The method of a renderer with OpenGL, and why it is that one; refuses what was asked for if it cannot do."""
    if scene.varies:
        return marching_method(scene, method, capabilities), "the density varies from place to place"
    if method is None and any(isinstance(body.medium, DiffusedVolume) for body in scene.bodies):
        return scattered_again_method(scene, caustics), "light scattered again into the rays: steps look it up"
    if method is not None and method.ordered:
        return method, "asked for"
    if (why := why_order_matters(scene, method, interfaces)) is not None:
        return _ordered_method(scene, method, capabilities, why), why
    if method is not None:
        return method, "asked for"
    if scatters(scene) and capabilities.shader_storage:
        return FragmentLists(), "light scattered into the rays: each interval looks at the lights"
    if not solids_of(scene):
        return ThinLayer(), "all bodies are declared sheets"
    return SignedDepth(), "a sum over each ray tells its picture"


def _ordered_method(scene: Scene, method: Method | None, capabilities: Capabilities, why: str) -> Method:
    """Method for a scene that needs ordered intervals; refuses any other that was asked for."""
    if not solids_of(scene):
        raise InputError(
            f"rendering {object_names(scene.bodies)}",
            f"{why}, and sheets have no place in the order",
            "give all sheets one medium, or none that emits",
        )
    cheapest = _cheapest_ordered(scene, capabilities)
    if method is not None:
        do = f"use {type(cheapest).__name__}, or leave the choice to the planner"
        raise InputError(type(method).__name__, why, do)
    return cheapest


def _cheapest_ordered(scene: Scene, capabilities: Capabilities) -> Method:
    """Method with the lowest expected cost of those that find all intervals."""
    # Of two that cost the same the lists come first: peeling waits for a count before it goes on.
    candidates: list[Method] = [FragmentLists()] if capabilities.shader_storage else []
    candidates.append(DepthPeeling())
    return min(candidates, key=lambda method: sum(step.cost for step in method.passes(scene, "")))


def plan_over_backdrop(
    scene: Scene,
    method: Method | None = None,
    capabilities: Capabilities | None = None,
    *,
    interfaces: Interfaces | None = None,
    scattering: Scattering | None = None,
    shadows: ShadowMaps | None = None,
) -> RenderPlan:
    """Plan for a scene before a `Backdrop`, which another renderer has drawn.

    Raises
    ------
    InputError
        As `plan`, and if the scene has opaque objects of its own, or interfaces are to be traced.
    """
    if scene.opaque:
        raise InputError(
            "a backdrop",
            f"the scene has opaque objects of its own: {object_names(scene.opaque)}",
            "leave them out, or to whoever draws the backdrop",
        )
    if isinstance(method, PathTraced):
        found = "what is drawn elsewhere has no mesh that a path could meet"
        raise InputError(f"{method} before a backdrop", found, "leave out one of the two")
    check_interfaces(interfaces)
    if interfaces is not None and interfaces.traced:
        found = "what is drawn elsewhere has no mesh that a ray could meet"
        raise InputError(f"{interfaces} before a backdrop", found, "use ScreenInterfaces()")
    chosen = plan(
        scene, method, capabilities, interfaces=interfaces or ScreenInterfaces(), scattering=scattering, shadows=shadows
    )
    reason = "opaque objects come as a picture drawn elsewhere: rays through the media end at its depth"
    picture = PassSpec(PassName.BACKDROP, reason, cost=COSTS["resolve"])
    return dataclasses.replace(
        chosen,
        passes=(*shadow_passes(scene, over_backdrop=True), picture, *chosen.passes),
        unmodelled=(
            *chosen.unmodelled,
            *shadow_effects(scene),
            Note(NoteKind.SHADOWS, "shadows of what is drawn elsewhere on the media"),
        ),
    )


def _plan_traced(
    scene: Scene, method: Method | None, interfaces: Interfaces | None, capabilities: Capabilities
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
    passes = (
        PassSpec(PassName.INTERSECT, reason, tuple(range(len(scene.objects))), 1),
        PassSpec(PassName.SHADE, "sheets in order" if sheets else "the intervals between them in order, exactly"),
    )
    limits = (*(chosen.limits(scene) if sheets else open_limits(scene)), *mesh_limits(scene, chosen))
    unmodelled = unmodelled_effects(scene, scattering=capabilities.scattering and scatters(scene), interfaces=followed)
    return RenderPlan(chosen, passes, True, limits, unmodelled, interfaces=followed, traced=True)


def _followed(scene: Scene, interfaces: Interfaces | None) -> Interfaces | None:
    """The interfaces that a renderer without OpenGL follows: all, whatever is asked for, as far as tracing would."""
    if not with_interfaces(scene):
        return None
    return interfaces if interfaces is not None and interfaces.traced else TracedInterfaces(depth=USUAL_DEPTH)
