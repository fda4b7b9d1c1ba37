"""The planner: from a scene to the cheapest passes that are exact for it, each with its reason. Pure; needs no GPU."""

from __future__ import annotations

import weakref
from collections.abc import Hashable
from dataclasses import replace

import numpy as np

from translucent.arguments import checked_but
from translucent.errors import InputError
from translucent.geometry.together import diagnose_together
from translucent.media.density import DensityGrid
from translucent.planning.assembly import COSTS, assembled
from translucent.planning.bodies import (
    MAX_SLOTS,
    exchanging_objects,
    glowing_bodies,
    media_differ,
    medium_slots,
    open_around_eye,
    open_bodies,
    overlapping_pair,
    reduced_at_hits,
    require_clear_priorities,
    scatters,
    solids_of,
    textured_at_hits,
    unread_at_hits,
    untextured_rays,
)
from translucent.planning.caustics import (
    UNREQUESTED,
    Caustics,
    affordable_caustics,
    caustics_left_out,
    caustics_to_request,
    check_caustics,
    lit_by_photons,
    opaque_to_shadows,
    passes_with_caustics,
)
from translucent.planning.interfaces import (
    USUAL_DEPTH,
    InterfaceMode,
    ScreenInterfaces,
    TracedInterfaces,
    chosen_interfaces,
    touching_interfaces,
    with_interfaces,
)
from translucent.planning.limits import (
    AMBIENT,
    MAX_LIGHTS,
    MAX_SCATTER_LIGHTS,
    hidden_lights,
    layers_instead,
    mesh_limits,
    open_limits,
    reflected_effects,
    shadow_effects,
    unmodelled_effects,
    with_ambient,
)
from translucent.planning.methods import (
    DepthPeeling,
    FragmentLists,
    Method,
    PathTraced,
    RayMarched,
    SignedDepth,
    ThinLayer,
)
from translucent.planning.methods.base import EMBREE_COST, HITS, SMALL_PICTURE, chosen_hits
from translucent.planning.methods.path_traced import has_bases, takes_picture
from translucent.planning.methods.ray_marched import MAX_STEPS
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.remarks import remarks
from translucent.planning.render_plan import Capabilities, MapPlan, RenderPlan
from translucent.planning.rendered import Treatment, darkened, occluder_scene, occluders, straight_scene, treatment_of
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import (
    Diffusion,
    Scattering,
    SingleScattering,
    Treatments,
    choose_treatments,
    rendered_scene,
)
from translucent.planning.shadow_maps import ShadowMaps, shadow_passes, shadows_left_out, usual_maps
from translucent.scene.grounds import mirror_of
from translucent.scene.lights import SPREADS, AreaLight, PositionalLight, SpotLight, with_points
from translucent.scene.scene import Object, Scene, check_scene, object_names


@checked_but("scene", "method", "interfaces", "scattering", "caustics", "shadows")
def plan(
    scene: Scene,
    method: Method | None = None,
    capabilities: Capabilities | None = None,
    *,
    interfaces: InterfaceMode | None = None,
    scattering: Scattering | None = None,
    caustics: Caustics | None = None,
    shadows: ShadowMaps | None = None,
) -> RenderPlan:
    """Choose the passes for a scene.

    Parameters
    ----------
    scene : Scene
    method : Method, optional
        How to find thickness; None picks the cheapest method that is exact.
    capabilities : Capabilities, optional
        Of the machine; default: all.
    interfaces : TracedInterfaces, ScreenInterfaces or FrontInterface, optional
        How to find the interfaces at which light refracts and reflects; None lets the planner pick.
    scattering : Diffusion, ScatteringLayer or SingleScattering, optional
        How to show light that media scatter more than once; None lets the planner pick.
    caustics : Caustics, optional
        Photons from the lights through interfaces onto opaque objects and into fog; None for none.
    shadows : ShadowMaps, optional
        How to find shadows on opaque objects; a renderer without OpenGL traces them. Default: `ShadowMaps()`,
        or narrower ones for bodies of very many surfaces.

    Raises
    ------
    InputError
        If no available method can render the scene, or not with interfaces, scattering, caustics or shadows as
        requested.
    """
    request = RenderRequest(method, 1, interfaces, scattering, caustics, shadows)
    return plan_scene(scene, request, capabilities)


def plan_scene(scene: Scene, request: RenderRequest, capabilities: Capabilities | None = None) -> RenderPlan:
    """Choose the passes for a request.

    Raises
    ------
    InputError
        As `plan`; before a `Backdrop` also if the scene has opaque objects of its own, or interfaces are to be traced.
    """
    check_scene(scene)
    machine = capabilities or Capabilities()
    if request.caustics is not None and not request.caustics.photons:
        request = replace(request, caustics=None, pixels=0)
    if request.over_backdrop:
        _check_backdrop(scene, request)
    diagnose_together(body.mesh for body in scene.bodies if body.sheet_thickness is None)
    paths = request.method if isinstance(request.method, PathTraced) else None
    if paths is None:
        treatments, hidden = _treatments(scene, request, machine), hidden_lights(scene)
        scene, spheres = _with_point_lights(scene, rendered_scene(scene, treatments))
        rendered = rendered_scene(scene, treatments)
        found = _thickness(rendered, request, machine, ambient=_scatters_ambient(scene, treatments))
        notes = layers_instead(scene, treatments.refusals)
        if _finds_light(request):
            traced = found.interfaces is not None and found.interfaces.traced
            exchanging = exchanging_objects(rendered) if traced else ()
            found = replace(found, exchanging=exchanging, glowing=glowing_bodies(scene))
        mirrors = machine.opengl and found.interfaces is not None and found.interfaces.traced
        mirror = mirror_of(rendered) if mirrors else None
        notes = (*reflected_effects(rendered, found.exchanging, found.glowing, mirror), *hidden, *notes)
        found = replace(found, diffusion=treatments.diffusion, unmodelled=(*found.unmodelled, *notes))
    else:
        _check_paths(scene, request, paths, machine)
        scene, spheres = _with_point_lights(scene, straight_scene(scene))
        found = _thickness(straight_scene(scene), RenderRequest(), machine, ambient=False)
        everywhere = {i: Treatment.PATHS for i, item in enumerate(scene.objects) if item.medium is not None}
        # Where media scatter, flights are short, and shaders look no farther.
        scattering = any(body.medium is not None and body.medium.scatters for body in scene.bodies)
        requested = paths.hits or ("gl" if scattering else None)
        hits, slower = chosen_hits("PathTraced", requested, machine.software, machine.shader_storage)
        (step,) = paths.passes(scene, "requested")
        cost = step.cost * (EMBREE_COST if hits == "embree" else 1.0)
        step = replace(step, reason=f"{step.reason}; {HITS[hits]} finds the hits", cost=cost)
        found = replace(
            found,
            scene=rendered_scene(scene, Treatments(everywhere)),
            passes=(*found.passes, step),
            limits=(*found.limits, *paths.limits(scene)),
            unmodelled=paths.unmodelled(scene),
            paths=paths,
            hits=hits,
            remarks=(Note(NoteKind.SLOW_HITS, slower),) if slower else (),
        )
    unmodelled = (*found.unmodelled, *spheres)
    found = replace(found, request=request, unmodelled=unmodelled, remarks=(*found.remarks, *remarks(scene)))
    if request.caustics is not None:
        found = _with_caustics(found, scene, request.caustics, machine, "requested")
    elif (unrequested := _unrequested_caustics(found, scene, request, machine)) is not None:
        why = f"a light, a clear body and a ground; photons take less than {UNREQUESTED:.0%} of the render time"
        found = _with_caustics(found, scene, unrequested, machine, why)
    elif paths is None:
        found = replace(found, unmodelled=(*found.unmodelled, *caustics_to_request(scene)))
    if request.denoise:
        found = replace(found, unmodelled=(*found.unmodelled, _denoised_note(found)))
    found = _with_textures(found, machine)
    return found if found.traced else _with_shadows(found, scene, machine)


def _finds_light(request: RenderRequest) -> bool:
    """True if the light that bodies send to opaque objects is found before anything is drawn."""
    scattering = request.scattering
    return not request.over_backdrop and (scattering is None or isinstance(scattering, Diffusion))


def _denoised_note(found: RenderPlan) -> Note:
    text = "denoised: Open Image Denoise replaces the noise by an estimate, whose error is unknown"
    return Note(
        NoteKind.DENOISED, text if found.has_noise else "the picture is not denoised, because it has no random noise"
    )


def _with_point_lights(scene: Scene, rendered: Scene) -> tuple[Scene, tuple[Note, ...]]:
    """The scene with point lights in place of area lights, and notes.

    `rendered` is the scene with its treatments: lights that are followed into its media are fewer.
    """
    areas = [light for light in scene.lights if isinstance(light, AreaLight)]
    if not areas:
        return scene, ()
    most = MAX_SCATTER_LIGHTS if scatters(rendered) else MAX_LIGHTS
    lights = with_points(scene.lights, most)
    count = (len(lights) - len(scene.lights)) // len(areas) + 1
    text = f"each {areas[0].noun} casts the shadows of {count} point lights"
    if count < len(SPREADS[0]):
        where = "into media" if scatters(rendered) else "to surfaces"
        text += f", not of {len(SPREADS[0])}, because at most {most} lights can shine {where}"
    return replace(scene, lights=lights), (Note(NoteKind.SPHERE_LIGHTS, text),)


def _treatments(scene: Scene, request: RenderRequest, machine: Capabilities) -> Treatments:
    """Choose the treatment of multiple scattering for each body."""
    method, scattering = request.method, request.scattering
    # Where nothing bends, a method that is requested is the sum that is requested, of light scattered once; and ambient
    # light represents what is scattered often.
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
            "none of these objects has a medium",
            "give at least one object a medium: medium=tl.Medium(...)",
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
    if isinstance(bending, TracedInterfaces) and bending.hits is None and _has_few_rays(request, machine):
        bending = replace(bending, hits="gl")
    return assembled(scene, chosen, why, bending, machine, instead=instead, ambient=ambient)


def _has_few_rays(request: RenderRequest, machine: Capabilities) -> bool:
    """True if preparing Embree and its shaders takes longer than Embree saves in a picture."""
    return machine.software and 0 < request.pixels * request.samples < SMALL_PICTURE and request.caustics is None


def _method(
    scene: Scene,
    method: Method | None,
    machine: Capabilities,
    interfaces: InterfaceMode,
    caustics: Caustics | None = None,
) -> tuple[Method, str]:
    """Method of a renderer with OpenGL, and the reason; refuses requests that it cannot render."""
    if scene.varies:
        return marching_method(scene, method, machine), "the density varies from place to place"
    if method is None and any(treatment_of(body) is Treatment.VOLUME for body in scene.bodies):
        return scattered_again_method(
            scene, caustics
        ), "multiply scattered light, which ray marching looks up at each step"
    if method is not None and method.ordered:
        return method, "requested"
    if (why := why_order_matters(scene, method, interfaces)) is not None:
        return _ordered_method(scene, method, machine, why), why
    if method is not None:
        return method, "requested"
    if scatters(scene) and machine.shader_storage:
        return FragmentLists(), "light scattered into the rays: each interval sums the light of all lights"
    if not solids_of(scene):
        return ThinLayer(), "all bodies are thin-walled sheets"
    return SignedDepth(), "a sum over each ray suffices"


#: Smallest number of steps through an interval of varying density, unless requested otherwise.
LEAST_STEPS = 64


#: Gauss-Legendre points through an interval of fog of one density.
FOG_POINTS = 16


def marching_method(scene: Scene, method: Method | None, capabilities: Capabilities) -> Method:
    """Ray marching for varying densities: as requested, or with a step for each voxel, and at least 64.

    Raises
    ------
    InputError
        If another method is requested, or the machine cannot march.
    """
    names = object_names(body for body in scene.bodies if body.density is not None)
    if not capabilities.shader_storage:
        raise InputError(
            f"rendering {names} with a varying density",
            "this OpenGL has no shader storage buffers, which need version 4.3",
            "render on the CPU (backend='cpu'), or with tl.reference.march(scene, size)",
        )
    if method is None:
        grids = [np.shape(body.density.values) for body in scene.bodies if isinstance(body.density, DensityGrid)]
        return RayMarched(steps=min(max([LEAST_STEPS, *(max(shape) for shape in grids)]), MAX_STEPS))
    if not method.marches:
        raise InputError(
            type(method).__name__,
            f"{names}: the density varies, so only ray marching can find the optical depth",
            "use the method RayMarched, or let the planner choose the method",
        )
    return method


def scattered_again_method(scene: Scene, caustics: Caustics | None = None) -> RayMarched:
    """Ray marching through fog of one density.

    A few Gauss-Legendre points, which are more accurate than four times as many steps; near a light inside, where light
    falls off as 1 / r^2 from a peak, or for a spot, which shines between two angles, steps of equal angles instead; and
    even steps through light of photons, which is as narrow as cells.
    """
    if caustics is not None:
        return RayMarched(steps=LEAST_STEPS)
    if any(isinstance(light, SpotLight) for light in scene.lights):
        return RayMarched(steps=LEAST_STEPS, quadrature="equiangular")
    lights = [np.asarray(light.position) for light in scene.lights if isinstance(light, PositionalLight)]
    fogs = [body.bounds for body in scene.bodies if treatment_of(body) is Treatment.VOLUME]
    if any((low <= position).all() and (position <= high).all() for position in lights for low, high in fogs):
        return RayMarched(steps=LEAST_STEPS, quadrature="equiangular")
    return RayMarched(steps=FOG_POINTS, quadrature="gauss")


def why_order_matters(scene: Scene, method: Method | None, interfaces: InterfaceMode) -> str | None:
    """Reason why this scene needs ordered surfaces rather than a sum over each ray; None if a sum suffices."""
    bodies = scene.bodies
    if media_differ(scene) and any(body.medium is not None and body.medium.emits for body in bodies):
        return "emission among several media: a medium dims the emission behind it"
    if method is None and interfaces.finds_exits and (touching := touching_interfaces(scene)) is not None:
        return touching
    if method is None and (why := _undecided_by_sums(scene)) is not None:
        return why
    if scene.overlap == "add":
        return None
    # Sheets have no inside to overlap, and pixels that enter more than once may be marked.
    if method is not None and (method.makes_sheets or method.convex_only):
        return None
    solids = [body for body in bodies if body.sheet_thickness is None]
    if (found := overlapping_pair(solids)) is not None:
        earlier, later = (solids[index] for index in found)
        return (
            f'overlap="{scene.overlap}": {earlier.mesh.name!r} and {later.mesh.name!r} may overlap, and a sum '
            "would count both"
        )
    for body in solids:
        if not body.mesh.diagnosis.convex:
            return f'overlap="{scene.overlap}": {body.mesh.name!r} may overlap itself, and a sum would count it twice'
    return None


def _undecided_by_sums(scene: Scene) -> str | None:
    """Reason that a sum cannot say which pixels of a body are wrong; None where intervals cannot either."""
    if len(medium_slots(scene)) > MAX_SLOTS:
        return None
    for body in scene.bodies:
        if body.sheet_thickness is None and body.mesh.diagnosis.inside_out:
            return f"{body.mesh.name!r} is inside out in places, and a sum cannot tell which pixels show such a place"
    around = open_around_eye(scene)
    for index in open_bodies(scene):
        mesh = scene.objects[index].mesh
        if mesh.diagnosis.holes > 1 or index in around:
            return f"{mesh.name!r} is open, and a sum cannot tell which pixels show two holes, whose errors may cancel"
    return None


def _ordered_method(scene: Scene, method: Method | None, machine: Capabilities, why: str) -> Method:
    """Method for a scene that needs ordered intervals; refuses any other that is requested."""
    if not solids_of(scene):
        raise InputError(
            f"rendering {object_names(scene.bodies)}",
            f"{why}, but the surfaces of sheets cannot be sorted among those of bodies",
            "give all sheets the same medium, or a medium without emission",
        )
    cheapest = _cheapest_ordered(scene, machine)
    if method is not None:
        do = f"use {type(cheapest).__name__}, or leave the choice to the planner"
        raise InputError(type(method).__name__, why, do)
    return cheapest


def _cheapest_ordered(scene: Scene, machine: Capabilities) -> Method:
    """Method with the lowest expected cost that finds all intervals."""
    # Of two that cost the same the lists come first: peeling reads a count back before it goes on.
    candidates: list[Method] = [FragmentLists()] if machine.shader_storage else []
    candidates.append(DepthPeeling())
    return min(candidates, key=lambda method: sum(step.cost for step in method.passes(scene, "")))


def _traced(
    scene: Scene, method: Method | None, interfaces: InterfaceMode | None, machine: Capabilities, *, ambient: bool
) -> RenderPlan:
    """Plan for a renderer without OpenGL, which finds all surfaces on each ray, whatever the method."""
    followed = _followed(scene, interfaces)
    chosen = method or FragmentLists()
    sheets = chosen.makes_sheets
    if isinstance(interfaces, TracedInterfaces) and interfaces.hits == "gl":
        raise InputError('TracedInterfaces(hits="gl")', "this renderer does not use OpenGL", "omit hits")
    reason = "no OpenGL: all surfaces on each ray, in float64"
    if method is not None and not sheets:
        reason += f", in place of the requested {method}"
    if followed is not None and interfaces is not None and not interfaces.traced:
        reason += f"; and {followed} in place of {interfaces}"
    shading = "sheets, sorted along each ray" if sheets else "the intervals between surfaces, in order and exactly"
    passes = (
        PassSpec(PassName.INTERSECT, reason, tuple(range(len(scene.objects))), 1),
        PassSpec(PassName.SHADE, f"{shading}; {AMBIENT}" if ambient else shading),
    )
    limits = (*(chosen.limits(scene) if sheets else open_limits(scene)), *mesh_limits(scene, chosen))
    unmodelled = unmodelled_effects(scene, scattering=machine.scattering and scatters(scene), interfaces=followed)
    unmodelled = with_ambient(unmodelled) if ambient else unmodelled
    return RenderPlan(scene, chosen, passes, True, limits, unmodelled, interfaces=followed, traced=True)


def _followed(scene: Scene, interfaces: InterfaceMode | None) -> InterfaceMode | None:
    """Interfaces of a renderer without OpenGL, which traces all of them; as deep as requested, or as is usual."""
    if not with_interfaces(scene):
        return None
    return interfaces if interfaces is not None and interfaces.traced else TracedInterfaces(depth=USUAL_DEPTH)


def _unrequested_caustics(
    found: RenderPlan, scene: Scene, request: RenderRequest, machine: Capabilities
) -> Caustics | None:
    """Photons for a picture that is better with them, and hardly slower."""
    method = request.method
    if not machine.opengl or request.over_backdrop or request.transparent or found.paths is not None:
        return None
    if method is not None and method.makes_sheets:
        return None
    hits = found.hits or chosen_hits("Caustics", None, machine.software, machine.shader_storage)[0]
    return affordable_caustics(scene, request.samples, request.pixels, embree=hits == "embree")


def _with_caustics(found: RenderPlan, scene: Scene, caustics: Caustics, machine: Capabilities, why: str) -> RenderPlan:
    """The plan with photons; refuses them where none could land, or the method follows none."""
    volumes = found.treated(Treatment.VOLUME)
    lit = lit_by_photons(scene, found.treated(Treatment.VOLUME, Treatment.DIFFUSION))
    check_caustics(scene, found.request.method, lit)
    hits, slower = found.hits, ""
    if machine.opengl and scene.opaque and not hits:
        hits, slower = chosen_hits("Caustics", None, machine.software, machine.shader_storage)
    return replace(
        found,
        passes=passes_with_caustics(found.passes, scene, caustics, lit, hits, why),
        hits=hits,
        remarks=(*found.remarks, *([Note(NoteKind.SLOW_HITS, slower)] if slower else [])),
        unmodelled=(*found.unmodelled, *caustics_left_out(scene, lit, volumes, machine.opengl)),
        caustics=caustics,
        opaque_to_shadows=opaque_to_shadows(scene),
    )


def _with_textures(found: RenderPlan, machine: Capabilities) -> RenderPlan:
    """The plan with textures of surfaces at every hit of a ray, and notes on what rays do not read of them."""
    scene, followed = found.scene, found.has(PassName.TRACED, PassName.PATH_TRACE)
    on_cpu = found.traced and found.interfaces is not None
    textured = textured_at_hits(scene) and (followed or found.has(PassName.CAUSTICS))
    notes = unread_at_hits(scene) if followed or on_cpu else []
    if textured and not machine.textured_rays:
        notes = untextured_rays(scene)
    elif textured and followed:
        notes += reduced_at_hits(scene)
    return replace(found, textured=textured and machine.textured_rays, unmodelled=(*found.unmodelled, *notes))


def _with_shadows(found: RenderPlan, scene: Scene, machine: Capabilities) -> RenderPlan:
    """The plan with shadows on opaque objects, or on a picture of them that is drawn elsewhere."""
    before, behind = shadow_passes(scene, over_backdrop=found.request.over_backdrop), tuple[PassSpec, ...]()
    if found.paths is not None and not has_bases(scene) and not takes_picture(scene, textured=found.textured):
        return found  # paths find shadows by themselves
    unmodelled: list[Note] = []
    if found.request.over_backdrop:
        reason = "a backdrop (a picture with depth) replaces opaque objects: rays through media end at its depth"
        behind = (PassSpec(PassName.BACKDROP, reason, cost=COSTS["resolve"]),)
        drawn_elsewhere = Note(NoteKind.SHADOWS, "objects in the backdrop cast no shadows onto media")
        unmodelled = [*shadow_effects(scene), drawn_elsewhere]
    elif before and found.has(PassName.TRACED, PassName.SURFACES, PassName.PATH_TRACE):
        unmodelled = [*shadows_left_out(machine.texture_units)]
    if not before and not behind:
        return found
    shadows, narrow = found.request.shadows, tuple[Note, ...]()
    if shadows is None and before:
        # What a backdrop shows may be nearer to the eye than the bodies: nobody knows how fine shadows look there.
        shadows, narrow = usual_maps(scene, 0 if found.request.over_backdrop else found.request.pixels)
    return replace(
        found,
        passes=(*before, *behind, *found.passes),
        unmodelled=(*found.unmodelled, *unmodelled, *narrow),
        shadows=shadows or ShadowMaps(),
        maps=_map_plans(scene, found, machine) if before else (),
    )


def _map_plans(scene: Scene, found: RenderPlan, machine: Capabilities) -> tuple[MapPlan, ...]:
    """Plans of the maps of shadows: as lights see the scene, and as the sky does.

    They are kept until objects change: lights and cameras do more often.
    """
    # Where all bodies are drawn as sheets, they throw shadows as sheets, too. Shadows have no per-pixel validity: sums
    # of signed depths suffice where intervals would only find which pixels are wrong.
    method = found.method if found.method.makes_sheets else None
    if method is None and scene.overlap == "add" and not scene.varies and _undecided_by_sums(scene):
        method = SignedDepth()
    key = tuple(map(weakref.ref, scene.objects)), scene.overlap, method, found.opaque_to_shadows, machine.shader_storage
    known = _MAPS.get(scene.objects[0])
    if known is None or known[0] != key:
        rendered = [scene] if not found.opaque_to_shadows else [darkened(scene, found.opaque_to_shadows), scene]
        storage = Capabilities(shader_storage=machine.shader_storage)
        plans = (
            _thickness(occluder_scene(each, occluders(each)), RenderRequest(method), storage, ambient=False)
            for each in rendered
        )
        known = key, tuple(MapPlan(each.method, each.passes, each.spectral) for each in plans)
        _MAPS[scene.objects[0]] = known
    return known[1]


_MAPS: weakref.WeakKeyDictionary[Object, tuple[Hashable, tuple[MapPlan, ...]]] = weakref.WeakKeyDictionary()


def _check_paths(scene: Scene, request: RenderRequest, method: PathTraced, machine: Capabilities) -> None:
    """Raise `InputError` if paths cannot render a scene, or something is requested that they take the place of."""
    for what, requested in (("interfaces", request.interfaces), ("scattering", request.scattering)):
        if requested is not None:
            raise InputError(
                f"{method} with {what}={requested}",
                f"path tracing replaces {what}",
                f"omit {what}, or choose another method",
            )
    if not machine.opengl:
        found = "random paths need OpenGL, but this renderer works on the CPU"
        raise InputError(str(method), found, "use tl.reference.path_trace(scene, size, paths), or an OpenGL backend")
    method.check(scene)


def _check_backdrop(scene: Scene, request: RenderRequest) -> None:
    """Raise `InputError` if a scene cannot be rendered before a `Backdrop` as requested."""
    if scene.opaque:
        raise InputError(
            "a backdrop",
            f"the scene itself has opaque objects: {object_names(scene.opaque)}",
            "remove these objects, or draw them into the backdrop",
        )
    if isinstance(request.method, PathTraced):
        found = "the objects of a backdrop have no mesh that a path could hit"
        do = "omit the backdrop, or choose another method"
        raise InputError(f"{request.method} in front of a backdrop", found, do)
    if request.interfaces is not None and request.interfaces.traced:
        found = "the objects of a backdrop have no mesh that a ray could hit"
        raise InputError(f"{request.interfaces} in front of a backdrop", found, "use ScreenInterfaces() instead")
