"""The planner: from a scene to the cheapest passes that are exact for it, each with its reason. Pure; needs no GPU."""

from __future__ import annotations

from collections.abc import Callable

from translucent.errors import InputError
from translucent.render_plan import Capabilities, PassSpec, RenderPlan
from translucent.scene import Object, Scene
from translucent.slots import MAX_SLOTS, may_touch, medium_slots, require_clear_priorities, same_medium
from translucent.thickness import (
    BackFaceDepth,
    DepthPeeling,
    FragmentLists,
    KBuffer,
    Method,
    OrderedMethod,
    SignedDepth,
    ThinLayer,
)

#: An open mesh that was declared solid is drawn, where it is not closed, as a sheet of this share of its diagonal.
FALLBACK_SHEET = 0.01

#: Time of a pass in multiples of drawing the same geometry into a depth buffer, as measured on a software rasteriser
#: (`python -m translucent.bench`). Peeling: for each pass, of which one finds two layers.
COSTS = {
    "opaque": 1.5,
    "signed_depth": 1.1,
    "signed_depth_spectral": 1.6,
    "thin_layer": 1.7,
    "back_face_depth": 2.2,
    "depth_peeling": 2.0,
    "fragment_lists": 3.5,
    "k_buffer": 7.0,
    "resolve": 0.7,
}

#: Layers of a body that is not convex, for want of a better guess: cost estimates are made before anything is drawn.
_GUESSED_LAYERS = 8


def plan(scene: Scene, method: Method | None = None, capabilities: Capabilities | None = None) -> RenderPlan:
    """Choose the passes for a scene.

    Parameters
    ----------
    scene : Scene
    method : Method, optional
        How to find thickness; None picks the cheapest way that is exact.
    capabilities : Capabilities, optional
        Of the machine; default: all.

    Raises
    ------
    InputError
        If no available method can render the scene.
    """
    if method is not None and not isinstance(method, Method):
        raise InputError(f"method {method!r}", "not a thickness method", "give for example tl.SignedDepth()")
    capabilities = capabilities or Capabilities()
    if not scene.bodies:
        names = ", ".join(repr(item.mesh.name) for item in scene.objects)
        raise InputError(
            f"rendering {names}", "nothing there has a medium", "give an object one: medium=tl.Medium(...)"
        )
    if scene.overlap == "priority":
        require_clear_priorities(scene)
    why_ordered = _why_order_matters(scene)
    if isinstance(method, OrderedMethod):
        return _plan_ordered(scene, method, capabilities, "asked for")
    if why_ordered is not None and method is not None:
        raise InputError(
            type(method).__name__, why_ordered, "use FragmentLists or DepthPeeling, or leave the choice to the planner"
        )
    if isinstance(method, BackFaceDepth):
        return _plan_back_face_depth(scene, method)
    if isinstance(method, ThinLayer):
        return _plan_thin_layer(scene, method)
    solids, sheets = _solids(scene), _sheets(scene)
    if method is None and why_ordered is not None and solids:
        return _plan_ordered(scene, _cheapest_ordered(scene, capabilities), capabilities, why_ordered)
    if method is None and not solids:
        return _plan_thin_layer(scene, ThinLayer())
    return _plan_signed_depth(scene, method or SignedDepth(), solids, sheets)


def _why_order_matters(scene: Scene) -> str | None:
    """Why a sum over each ray does not tell the picture of this scene; None if it does."""
    bodies = scene.bodies
    if _media_differ(scene) and any(body.medium is not None and body.medium.emits for body in bodies):
        return "emission among several media: what is in front dims what is behind"
    solids = [body for body in bodies if body.sheet_thickness is None]
    if scene.overlap == "add":
        return None
    for j, later in enumerate(solids):
        for earlier in solids[:j]:
            if may_touch(earlier, later):
                return (
                    f'overlap="{scene.overlap}": {earlier.mesh.name!r} and {later.mesh.name!r} may overlap, and a sum '
                    "would count both"
                )
    for body in solids:
        if not body.mesh.diagnosis.convex:
            return f'overlap="{scene.overlap}": {body.mesh.name!r} may overlap itself, and a sum would count it twice'
    return None


def _cheapest_ordered(scene: Scene, capabilities: Capabilities) -> OrderedMethod:
    """Of the methods that find all intervals, the one that is expected to be fastest."""
    candidates: list[OrderedMethod] = [DepthPeeling()]
    if capabilities.shader_storage:
        candidates.append(FragmentLists())
    return min(candidates, key=lambda method: _ordered_cost(scene, method))


def _ordered_cost(scene: Scene, method: OrderedMethod) -> float:
    if isinstance(method, DepthPeeling):
        return _peeling_passes(scene, method) * COSTS["depth_peeling"]
    return COSTS["k_buffer" if isinstance(method, KBuffer) else "fragment_lists"]


def _peeling_passes(scene: Scene, method: DepthPeeling) -> int:
    layers = min(_expected_layers(scene), method.max_layers)
    return 1 + (-(-layers // 2) if method.order == "both-ends" else layers)


def _expected_layers(scene: Scene) -> int:
    bodies = [scene.objects[i] for i in _solids(scene)]
    return sum(2 if body.mesh.diagnosis.convex else _GUESSED_LAYERS for body in bodies)


def _plan_ordered(scene: Scene, method: OrderedMethod, capabilities: Capabilities, why: str) -> RenderPlan:
    solids, sheets = _solids(scene), _sheets(scene)
    name = type(method).__name__
    if not solids:
        raise InputError(name, "all bodies are declared sheets, which have no inside", "use ThinLayer")
    if not isinstance(method, DepthPeeling) and not capabilities.shader_storage:
        raise InputError(name, "this OpenGL has no shader storage buffers, which came with 4.3", "use DepthPeeling")
    if (count := len(medium_slots(scene))) > MAX_SLOTS:
        raise InputError(
            name, f"{count} different media or open bodies, more than {MAX_SLOTS}", "let bodies share media"
        )
    passes = []
    what = {
        DepthPeeling: "two layers with each draw" if method == DepthPeeling() else "a layer with each draw",
        FragmentLists: "one draw into a list for each pixel, sorted afterwards",
        KBuffer: f"one draw, of which each pixel keeps the {getattr(method, 'k', 0)} nearest surfaces",
    }[type(method)]
    geometry_passes = _peeling_passes(scene, method) if isinstance(method, DepthPeeling) else 1
    key = {DepthPeeling: "depth_peeling", FragmentLists: "fragment_lists", KBuffer: "k_buffer"}[type(method)]
    # Sheets go first: their sums are read where the intervals are resolved.
    if sheets:
        passes.append(_sheet_pass(sheets, f"{_count(sheets, 'mesh', 'meshes')} declared thin: paths add up"))
    fallback = _fallback_passes(scene, solids, sheets)
    passes += fallback
    passes.append(PassSpec(key, f"{why}; {what}", solids, geometry_passes, cost=_ordered_cost(scene, method)))
    limits = [_open_limit(body) for body in _open_bodies(scene)]
    most = method.max_layers if isinstance(method, DepthPeeling) else method.k if isinstance(method, KBuffer) else None
    bodies = [scene.objects[i] for i in solids]
    if most is not None and not (all(b.mesh.diagnosis.convex for b in bodies) and 2 * len(bodies) <= most):
        limits.append(f"pixels with more than {most} surfaces are marked invalid")
    if sheets and any(body.medium is not None and body.medium.emits for body in scene.bodies):
        limits.append(
            "declared sheets among emitting media: their place in the order is not kept: they dim all light, and what they emit is left out"
        )
    return _finished(scene, method, passes, limits, spectral=True)


def _plan_signed_depth(
    scene: Scene, method: SignedDepth, solids: tuple[int, ...], sheets: tuple[int, ...]
) -> RenderPlan:
    spectral = _media_differ(scene)
    what = (
        "optical depth per channel, since media differ" if spectral else "thickness, since all bodies share one medium"
    )
    passes = []
    limits = []
    if solids:
        reason = f"{_count(solids, 'body', 'bodies')} in one unsorted draw each: exits minus entries add up to {what}"
        cost = COSTS["signed_depth_spectral" if spectral else "signed_depth"]
        passes.append(PassSpec("signed_depth", reason, solids, 1, cost=cost))
    if sheets:
        passes.append(
            _sheet_pass(sheets, f"{_count(sheets, 'mesh', 'meshes')} declared thin: paths through faces add up")
        )
    passes += _fallback_passes(scene, solids, sheets)
    limits += [_open_limit(body) for body in _open_bodies(scene)]
    if not method.anchored:
        limits.append("distances count from the camera: float32 loses digits with distance")
    return _finished(scene, method, passes, limits, spectral)


def _fallback_passes(scene: Scene, solids: tuple[int, ...], sheets: tuple[int, ...]) -> list[PassSpec]:
    """What a pixel shows that enters and leaves unequally often: open bodies as sheets, all others as ever."""
    open_bodies = tuple(i for i in solids if not scene.objects[i].mesh.diagnosis.solid)
    if not open_bodies:
        return []
    names = ", ".join(repr(scene.objects[i].mesh.name) for i in open_bodies)
    reason = (
        f"{names} not closed: pixels that enter and leave unequally often get sheets of {FALLBACK_SHEET:.0%} of the "
        "diagonal, and are marked invalid"
    )
    sheet_cost, solid_cost = COSTS["thin_layer"], COSTS["signed_depth"]
    passes = [PassSpec("thin_layer_fallback", reason, open_bodies + sheets, 1, "fallback", sheet_cost)]
    if closed := tuple(i for i in solids if i not in open_bodies):
        reason = "closed bodies, in those pixels, too"
        passes.append(PassSpec("signed_depth_fallback", reason, closed, 1, "fallback", solid_cost))
    return passes


def _open_limit(body: Object) -> str:
    return (
        f"{body.mesh.name!r}: {'; '.join(body.mesh.diagnosis.problems)}: close it, or declare it a sheet "
        "(sheet_thickness=..., --method thin-layer)"
    )


def _plan_back_face_depth(scene: Scene, method: BackFaceDepth) -> RenderPlan:
    if _media_differ(scene):
        raise InputError("BackFaceDepth", "bodies with different media", "use SignedDepth, which tells them apart")
    if sheets := [scene.objects[i].mesh.name for i in _sheets(scene)]:
        raise InputError(
            "BackFaceDepth", f"{', '.join(map(repr, sheets))} declared a sheet", "use SignedDepth or ThinLayer"
        )
    bodies = _indices(scene, lambda body: body.medium is not None)
    reason = "asked for: nearest front face, then farthest back face"
    passes = [PassSpec("back_face_depth", reason, bodies, 2, cost=COSTS["back_face_depth"])]
    limits = []
    if len(bodies) > 1:
        limits.append("several bodies: pixels that cross more than one are marked invalid")
    if concave := [body.mesh.name for body in scene.bodies if not body.mesh.diagnosis.convex]:
        limits.append(f"{', '.join(concave)} not convex: pixels with more than one entry are marked invalid")
    return _finished(scene, method, passes, limits, spectral=False)


def _plan_thin_layer(scene: Scene, method: ThinLayer) -> RenderPlan:
    bodies = _indices(scene, lambda body: body.medium is not None)
    solid = [body.mesh.name for body in scene.bodies if body.sheet_thickness is None and body.mesh.diagnosis.solid]
    limits = [f"{', '.join(map(repr, solid))} closed, but drawn as sheets: what is inside is left out"] if solid else []
    reason = f"every face of {_count(bodies, 'mesh', 'meshes')} is a sheet: their paths add up"
    return _finished(scene, method, [_sheet_pass(bodies, reason)], limits, _media_differ(scene))


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
    media = [body.medium for body in scene.bodies if body.medium is not None]
    if isinstance(method, OrderedMethod):
        reason = "Beer-Lambert: what is behind, through exp(-optical depth), and what the intervals emit"
    elif any(medium.emits for medium in media):
        reason = "Beer-Lambert, and the emission of the one medium in closed form, q / sigma_t (1 - T)"
    else:
        reason = "Beer-Lambert: what is behind, through exp(-optical depth)"
    passes = [*passes, PassSpec("transmittance", reason, cost=COSTS["resolve"])]
    for body in scene.bodies:
        if found := body.mesh.diagnosis.duplicate_faces:
            limits.append(f"{body.mesh.name!r}: {found.count} duplicated faces, which count twice or cancel")
        if parts := body.mesh.diagnosis.inside_out_parts:
            limits.append(f"{body.mesh.name!r}: {parts} closed parts inside out: their pixels are marked invalid")
    unmodelled = []
    if any(medium.scatters for medium in media):
        unmodelled.append("in-scattered light: scattering only removes light")
    if any(medium.ior > 1 for medium in media):
        unmodelled.append("refraction and reflection: rays go straight, though ior is above 1")
    if scene.opaque and scene.lights:
        unmodelled.append("shadows: lights reach opaque objects through everything")
    return RenderPlan(method, tuple(passes), spectral, tuple(limits), tuple(unmodelled))


def _open_bodies(scene: Scene) -> list[Object]:
    return [scene.objects[i] for i in _solids(scene) if not scene.objects[i].mesh.diagnosis.solid]


def _media_differ(scene: Scene) -> bool:
    return any(not same_medium(scene.bodies[0], body) for body in scene.bodies[1:])


def _solids(scene: Scene) -> tuple[int, ...]:
    return _indices(scene, lambda body: body.medium is not None and body.sheet_thickness is None)


def _sheets(scene: Scene) -> tuple[int, ...]:
    return _indices(scene, lambda body: body.medium is not None and body.sheet_thickness is not None)


def _indices(scene: Scene, keep: Callable[[Object], bool]) -> tuple[int, ...]:
    return tuple(i for i, body in enumerate(scene.objects) if keep(body))


def _count(items: tuple[int, ...], one: str, many: str) -> str:
    return f"{len(items)} {one if len(items) == 1 else many}"
