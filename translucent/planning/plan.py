"""The planner: from a scene to the cheapest passes that are exact for it, each with its reason. Pure; needs no GPU."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from translucent.errors import InputError
from translucent.planning.borders import border_passes, check_borders, with_one_border
from translucent.planning.layers import layer_passes
from translucent.planning.limits import (
    MAX_SCATTER_LIGHTS,
    closed_sheet_limits,
    layer_limits,
    marching_limits,
    marching_method,
    mesh_limits,
    open_bodies,
    open_limits,
    scattering_limits,
    unmodelled_effects,
    with_ambient_told,
    with_unlit_marked,
)
from translucent.planning.methods import (
    BackFaceDepth,
    DepthPeeling,
    FragmentLists,
    KBuffer,
    Method,
    RayMarched,
    SignedDepth,
    ThinLayer,
)
from translucent.planning.methods.base import MAX_LIGHT_POINTS
from translucent.planning.order import media_differ, why_order_matters
from translucent.planning.render_plan import Borders, Capabilities, PassSpec, RenderPlan
from translucent.planning.slots import MAX_SLOTS, medium_slots, require_clear_priorities
from translucent.scene.scene import Object, Scene, object_names

#: An open mesh that was declared solid is drawn, where it is not closed, as a sheet of this share of its diagonal.
FALLBACK_SHEET = 0.01

#: Time of a pass in multiples of drawing the same geometry into a depth buffer, as measured on a software rasteriser
#: (`translucent report`). Peeling takes a pass for every two layers, and this much for each pass. Passes that shade
#: pixels (resolve, surfaces): beside 90,000 triangles; beside fewer ones, which cost less, they count for more.
COSTS = {
    "opaque": 2.8,
    "signed_depth": 1.1,
    "signed_depth_spectral": 1.5,
    "thin_layer": 1.7,
    "back_face_depth": 1.7,
    "depth_peeling": 2.4,
    "fragment_lists": 2.4,
    "k_buffer": 4.2,
    "step": 0.1,  # of marching
    "resolve": 0.4,
    "interfaces": 4.0,
    "surfaces": 8.0,
    "layers": 3.0,
}

#: Layers of a body that is not convex, for want of a better guess: cost estimates are made before anything is drawn.
_GUESSED_LAYERS = 8


def plan(
    scene: Scene,
    method: Method | None = None,
    capabilities: Capabilities | None = None,
    *,
    borders: Borders = "both",
) -> RenderPlan:
    """Choose the passes for a scene.

    Parameters
    ----------
    scene : Scene
    method : Method, optional
        How to find thickness; None picks the cheapest way that is exact.
    capabilities : Capabilities, optional
        Of the machine; default: all.
    borders : {"both", "front"}
        Where rays bend: at the border where they enter a body and at the one where they leave it, or only at the first,
        which saves finding the second and is wrong for curved bodies.

    Raises
    ------
    InputError
        If no available method can render the scene, or the camera is inside a body that has only a front border.
    """
    if method is not None and not isinstance(method, Method):
        raise InputError(f"method {method!r}", "not a thickness method", "give for example tl.SignedDepth()")
    check_borders(borders)
    capabilities = capabilities or Capabilities()
    if scene.scatters_ambient:
        return with_ambient_told(plan(scene.with_ambient_emitted, method, capabilities, borders=borders))
    if not scene.bodies:
        raise InputError(
            f"rendering {object_names(scene.objects)}",
            "nothing there has a medium",
            "give an object one: medium=tl.Medium(...)",
        )
    if scene.overlap == "priority":
        require_clear_priorities(scene)
    if not capabilities.opengl:
        return _plan_traced(scene, method, capabilities)
    chosen = _plan_drawn(scene, method, capabilities, borders)
    if _scatters(scene) and not capabilities.shader_storage:
        chosen = with_unlit_marked(scene, chosen, _signed_depth_cost(chosen.spectral))
    return chosen if borders == "both" else with_one_border(scene, chosen)


def _plan_drawn(scene: Scene, method: Method | None, capabilities: Capabilities, borders: Borders) -> RenderPlan:
    """The plan of a renderer with OpenGL, with both borders of bodies."""
    if scene.varies:
        method = marching_method(scene, method, capabilities)
        return _plan_ordered(scene, method, capabilities, "the density varies from place to place")
    if method is not None and method.ordered:
        return _plan_ordered(scene, method, capabilities, "asked for")
    if (why := why_order_matters(scene, method, borders)) is not None:
        return _plan_for_order(scene, method, capabilities, why)
    if isinstance(method, BackFaceDepth):
        return _plan_back_face_depth(scene, method)
    if isinstance(method, ThinLayer):
        return _plan_thin_layer(scene, method)
    if _scatters(scene) and capabilities.shader_storage and method is None:
        why = "light scattered into the rays: each interval looks at the lights"
        return _plan_ordered(scene, FragmentLists(), capabilities, why)
    if method is None and not _solids(scene):
        return _plan_thin_layer(scene, ThinLayer())
    return _plan_signed_depth(scene, method or SignedDepth())


def plan_over_backdrop(
    scene: Scene,
    method: Method | None = None,
    capabilities: Capabilities | None = None,
    *,
    borders: Borders = "both",
) -> RenderPlan:
    """The plan for a scene before a `Backdrop`, which somebody else has drawn.

    Raises
    ------
    InputError
        As `plan`, and if the scene has opaque objects of its own.
    """
    if scene.opaque:
        raise InputError(
            "a backdrop",
            f"the scene has opaque objects of its own: {object_names(scene.opaque)}",
            "leave them out, or to whoever draws the backdrop",
        )
    chosen = plan(scene, method, capabilities, borders=borders)
    reason = "opaque objects come as a picture drawn elsewhere: rays through the media end at its depth"
    return dataclasses.replace(
        chosen,
        passes=(PassSpec("backdrop", reason, cost=COSTS["resolve"]), *chosen.passes),
        unmodelled=(*chosen.unmodelled, "shadows between the media and what is drawn elsewhere"),
    )


def _scatters(scene: Scene) -> bool:
    """Whether a solid scatters, and there are lights whose light it can."""
    return bool(scene.lights) and any(
        body.medium is not None and body.medium.scatters for body in (scene.objects[i] for i in _solids(scene))
    )


def _light_views(scene: Scene, points: int) -> PassSpec:
    solids, lights = _solids(scene), len(scene.lights)
    if lights > MAX_SCATTER_LIGHTS:
        raise InputError(
            f"{lights} lights on media that scatter",
            f"at most {MAX_SCATTER_LIGHTS} are followed into media",
            f"leave out {lights - MAX_SCATTER_LIGHTS}, or let the media only absorb",
        )
    reason = (
        f"{lights} {'light' if lights == 1 else 'lights'} on a medium that scatters: the surfaces on the way from each "
        f"light, in order, tell how much of it reaches the {points} points of an interval"
    )
    return PassSpec("light_views", reason, solids, lights, cost=lights * COSTS["fragment_lists"])


def _plan_traced(scene: Scene, method: Method | None, capabilities: Capabilities) -> RenderPlan:
    """The plan of a renderer without OpenGL, which finds all surfaces on each ray, whatever the method."""
    chosen = method or FragmentLists()
    sheets = isinstance(method, ThinLayer)
    limits = [*(closed_sheet_limits(scene, method) if isinstance(method, ThinLayer) else open_limits(scene))]
    reason = "no OpenGL: all surfaces on each ray, in float64"
    if method is not None and not sheets:
        reason += f", in place of {method}, which was asked for"
    passes = (
        PassSpec("intersect", reason, tuple(range(len(scene.objects))), 1),
        PassSpec("shade", "sheets in order" if sheets else "the intervals between them in order, exactly"),
    )
    limits += mesh_limits(scene, chosen)
    scatters = capabilities.scattering and _scatters(scene)
    unmodelled = unmodelled_effects(scene, scatters=scatters)
    return RenderPlan(chosen, passes, True, tuple(limits), unmodelled, traced=True)


def _plan_for_order(scene: Scene, method: Method | None, capabilities: Capabilities, why: str) -> RenderPlan:
    """The plan of a scene that only ordered intervals can tell; refuses any other method that was asked for."""
    if not _solids(scene):
        raise InputError(
            f"rendering {object_names(scene.bodies)}",
            f"{why}, and sheets have no place in the order",
            "give all sheets one medium, or none that emits",
        )
    cheapest = _cheapest_ordered(scene, capabilities)
    if method is not None:
        do = f"use {type(cheapest).__name__}, or leave the choice to the planner"
        raise InputError(type(method).__name__, why, do)
    return _plan_ordered(scene, cheapest, capabilities, why)


def _cheapest_ordered(scene: Scene, capabilities: Capabilities) -> Method:
    """Of the methods that find all intervals, the one that is expected to be fastest."""
    # Of two that cost the same the lists come first: peeling waits for a count before it goes on.
    candidates: list[Method] = [FragmentLists()] if capabilities.shader_storage else []
    candidates.append(DepthPeeling())
    return min(candidates, key=lambda method: _ordered_pass(scene, method, "").cost)


def _ordered_pass(scene: Scene, method: Method, why: str) -> PassSpec:
    """The pass that finds all intervals; peeling draws as often as it is expected to have to."""
    solids = _solids(scene)
    if isinstance(method, FragmentLists):
        reason = f"{why}; one draw into a list for each pixel, sorted afterwards"
        return PassSpec("fragment_lists", reason, solids, 1, cost=COSTS["fragment_lists"])
    if isinstance(method, RayMarched):
        reason = f"{why}; one draw into a list for each pixel, then {method.steps} steps through each interval"
        return PassSpec(
            "fragment_lists", reason, solids, 1, cost=COSTS["fragment_lists"] + COSTS["step"] * method.steps
        )
    if isinstance(method, KBuffer):
        reason = f"{why}; one draw, of which each pixel keeps the {method.k} nearest surfaces"
        return PassSpec("k_buffer", reason, solids, 1, cost=COSTS["k_buffer"])
    bodies = [scene.objects[i] for i in solids]
    expected = sum(2 if body.mesh.diagnosis.convex else _GUESSED_LAYERS for body in bodies)
    layers = min(expected, method.max_layers)
    both_ends = method.order == "both-ends"
    reason = f"{why}; {'two layers' if both_ends else 'a layer'} with each draw, until all are found"
    # Where some layers are left out, one more draw counts the faces of the last that is not.
    draws = (-(-layers // 2) if both_ends else layers) + (expected > layers)
    return PassSpec("depth_peeling", reason, solids, draws, cost=draws * COSTS["depth_peeling"])


def _plan_ordered(scene: Scene, method: Method, capabilities: Capabilities, why: str) -> RenderPlan:
    sheets = _sheets(scene)
    name = type(method).__name__
    if not _solids(scene):
        raise InputError(name, "all bodies are declared sheets, which have no inside", "use ThinLayer")
    if not isinstance(method, DepthPeeling) and not capabilities.shader_storage:
        raise InputError(name, "this OpenGL has no shader storage buffers, which came with 4.3", "use DepthPeeling")
    if (count := len(medium_slots(scene))) > MAX_SLOTS:
        raise InputError(
            name,
            f"{count} winding numbers for each ray, one for each medium, priority and open body: more than {MAX_SLOTS}",
            "let bodies share media and priorities, or close them",
        )
    if isinstance(method, RayMarched) and method.quadrature == "gauss" and method.steps > MAX_LIGHT_POINTS:
        raise InputError(f"{method}", f"shaders hold {MAX_LIGHT_POINTS} Gauss-Legendre points", "use fewer steps")
    passes = []
    # Sheets go first: their sums are read where the intervals are resolved.
    if sheets:
        passes.append(_declared_sheets(sheets))
    passes += _fallback_passes(scene, spectral=True)
    if _scatters(scene) and not isinstance(method, DepthPeeling):
        points = method.steps if isinstance(method, RayMarched) else method.light_points
        passes.append(_light_views(scene, points))
    passes.append(_ordered_pass(scene, method, why))
    limits = open_limits(scene) + layer_limits(scene, method)
    if isinstance(method, RayMarched):
        limits += marching_limits(scene, method)
    if _scatters(scene):
        limits += scattering_limits(scene)
    if sheets and any(body.medium is not None and body.medium.emits for body in scene.bodies):
        limits.append(
            "declared sheets among emitting media have no place in the order: they dim all light, and what they emit "
            "is left out"
        )
    return _finished(scene, method, passes, limits, spectral=True)


def _plan_signed_depth(scene: Scene, method: SignedDepth) -> RenderPlan:
    solids, sheets = _solids(scene), _sheets(scene)
    spectral = media_differ(scene)
    what = (
        "optical depth per channel, since media differ" if spectral else "thickness, since all bodies share one medium"
    )
    passes = []
    if solids:
        reason = f"{_count(solids, 'body', 'bodies')} in one unsorted draw each: exits minus entries add up to {what}"
        passes.append(PassSpec("signed_depth", reason, solids, 1, cost=_signed_depth_cost(spectral)))
    if sheets:
        passes.append(_declared_sheets(sheets))
    passes += _fallback_passes(scene, spectral)
    limits = open_limits(scene)
    if not method.anchored:
        limits.append("distances count from the camera: float32 loses digits with distance")
    return _finished(scene, method, passes, limits, spectral)


def _fallback_passes(scene: Scene, spectral: bool) -> list[PassSpec]:
    """What a pixel shows that enters and leaves unequally often: open bodies as sheets, all others as ever."""
    leaky = open_bodies(scene)
    if not leaky:
        return []
    reason = (
        f"{object_names([scene.objects[i] for i in leaky])} not closed: pixels that enter and leave unequally often "
        f"get sheets of {FALLBACK_SHEET:.0%} of the diagonal, and are marked invalid"
    )
    sheets = leaky + _sheets(scene)
    passes = [PassSpec("thin_layer_fallback", reason, sheets, 1, "fallback", COSTS["thin_layer"])]
    if closed := tuple(i for i in _solids(scene) if i not in leaky):
        reason = "closed bodies, in those pixels, too"
        cost = _signed_depth_cost(spectral)
        passes.append(PassSpec("signed_depth_fallback", reason, closed, 1, "fallback", cost))
    return passes


def _signed_depth_cost(spectral: bool) -> float:
    return COSTS["signed_depth_spectral" if spectral else "signed_depth"]


def _plan_back_face_depth(scene: Scene, method: BackFaceDepth) -> RenderPlan:
    if media_differ(scene):
        raise InputError("BackFaceDepth", "bodies with different media", "use SignedDepth, which tells them apart")
    if sheets := [scene.objects[i] for i in _sheets(scene)]:
        raise InputError("BackFaceDepth", f"{object_names(sheets)} declared a sheet", "use SignedDepth or ThinLayer")
    bodies = _solids(scene)
    reason = "asked for: nearest front face, then farthest back face"
    passes = [PassSpec("back_face_depth", reason, bodies, 2, cost=COSTS["back_face_depth"])]
    passes += _fallback_passes(scene, spectral=False)
    limits = open_limits(scene)
    if len(bodies) > 1:
        limits.append("several bodies: pixels that cross more than one are marked invalid")
    if concave := [body for body in scene.bodies if not body.mesh.diagnosis.convex]:
        limits.append(f"{object_names(concave)} not convex: pixels with more than one entry are marked invalid")
    return _finished(scene, method, passes, limits, spectral=False)


def _plan_thin_layer(scene: Scene, method: ThinLayer) -> RenderPlan:
    bodies = _indices(scene, lambda body: body.medium is not None)
    limits = closed_sheet_limits(scene, method)
    reason = f"every face of {_count(bodies, 'mesh', 'meshes')} is a sheet: their paths add up"
    return _finished(scene, method, [_sheet_pass(bodies, reason)], limits, media_differ(scene))


def _declared_sheets(sheets: tuple[int, ...]) -> PassSpec:
    return _sheet_pass(sheets, f"{_count(sheets, 'mesh', 'meshes')} declared thin: paths through faces add up")


def _sheet_pass(objects: tuple[int, ...], reason: str) -> PassSpec:
    return PassSpec("thin_layer", f"{reason}, t / max(0.001, n.v) each", objects, 1, cost=COSTS["thin_layer"])


def _finished(scene: Scene, method: Method, passes: list[PassSpec], limits: list[str], spectral: bool) -> RenderPlan:
    """The plan with its first and last pass, and with the limits that any method has in this scene."""
    if opaque := _indices(scene, lambda item: item.medium is None):
        reason = (
            f"{_count(opaque, 'opaque object', 'opaque objects')}: depth and color of the nearest, where rays through "
            "the media end"
        )
        passes = [PassSpec("opaque", reason, opaque, 1, cost=COSTS["opaque"]), *passes]
    borders = border_passes(scene, method, COSTS["interfaces"], COSTS["surfaces"])
    media = [body.medium for body in scene.bodies if body.medium is not None]
    emits = any(medium.emits for medium in media)
    if emits and method is not None and method.ordered:
        reason = "Beer-Lambert: what is behind, through exp(-optical depth), and what the intervals emit"
    elif emits:
        reason = "Beer-Lambert, and the emission of the one medium in closed form, q / sigma_t (1 - T)"
    else:
        reason = "Beer-Lambert: what is behind, through exp(-optical depth)"
    resolve = PassSpec("transmittance", reason, cost=COSTS["resolve"])
    passes = [*passes, *borders[:1], resolve, *borders[1:], *layer_passes(scene, COSTS["layers"])]
    scatters = any(step.name == "light_views" for step in passes)
    limits = [*limits, *mesh_limits(scene, method)]
    unmodelled = unmodelled_effects(scene, scatters=scatters, borders=True)
    return RenderPlan(method, tuple(passes), spectral, tuple(limits), unmodelled)


def _solids(scene: Scene) -> tuple[int, ...]:
    return _indices(scene, lambda body: body.medium is not None and body.sheet_thickness is None)


def _sheets(scene: Scene) -> tuple[int, ...]:
    return _indices(scene, lambda body: body.medium is not None and body.sheet_thickness is not None)


def _indices(scene: Scene, keep: Callable[[Object], bool]) -> tuple[int, ...]:
    return tuple(i for i, body in enumerate(scene.objects) if keep(body))


def _count(items: tuple[int, ...], one: str, many: str) -> str:
    return f"{len(items)} {one if len(items) == 1 else many}"
