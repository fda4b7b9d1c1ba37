"""Passes of a plan beside those of its method: sheets, fallbacks, lights, opaque objects, interfaces, shading."""

from __future__ import annotations

from dataclasses import replace

from translucent.errors import InputError
from translucent.planning.bodies import (
    MAX_SLOTS,
    count_of,
    emitting_bodies,
    indices,
    media_differ,
    medium_slots,
    open_bodies,
    scatters,
    sheets_of,
    solids_of,
)
from translucent.planning.interfaces import InterfaceMode, TracedInterfaces, touching_interfaces, with_interfaces
from translucent.planning.limits import (
    AMBIENT,
    MAX_SCATTER_LIGHTS,
    UNLIT,
    hole_limits,
    layer_limits,
    mesh_limits,
    open_limits,
    scattering_limits,
    sheet_limits,
    unmodelled_effects,
    with_ambient,
)
from translucent.planning.methods import FragmentLists, Method, SignedDepth, ThinLayer
from translucent.planning.methods.base import EMBREE_COST, HITS, chosen_hits
from translucent.planning.methods.thin_layer import sheet_pass
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.shadow_maps import dims_interfaces
from translucent.scene.scene import Scene, object_names

#: Thickness, as a fraction of its diagonal, of the sheet that replaces an open mesh declared solid where it is not
#: closed.
FALLBACK_SHEET = 0.01

#: Time of a pass in multiples of drawing the same geometry into a depth buffer, as measured on a software rasterizer
#: (`translucent report`); those of methods and of interfaces are theirs. Passes that shade pixels (resolve): beside
#: 90,000 triangles; beside fewer ones, which cost less, they count for more.
COSTS = {"opaque": 2.8, "resolve": 0.4, "layers": 3.0}


def assembled(
    scene: Scene,
    method: Method,
    why: str,
    interfaces: InterfaceMode,
    capabilities: Capabilities,
    *,
    instead: str,
    ambient: bool,
) -> RenderPlan:
    """The plan of a method, which was chosen for the reason `why`, with OpenGL.

    Parameters
    ----------
    scene, method, why, interfaces, capabilities
    instead : str
        Why interfaces are in screen space rather than traced, or nothing.
    ambient : bool
        Media emit the ambient radiance that they scatter, too.

    Raises
    ------
    InputError
        If the method cannot render the scene, or not on this machine.
    """
    _check(scene, method, capabilities)
    spectral = method.ordered or media_differ(scene)
    own = method.passes(scene, why)
    beside = () if method.makes_sheets else (*_declared_sheets(scene), *_fallback_passes(scene, spectral))
    # Sheets go first where intervals are in order: their sums are read where the intervals are resolved.
    passes = (*beside, *_light_views(scene, method), *own) if method.ordered else (*own, *beside)
    found = _interface_passes(scene, method, interfaces, instead)
    hits, slower = "", ""
    if found and isinstance(interfaces, TracedInterfaces):
        machine = capabilities.software, capabilities.shader_storage
        hits, slower = chosen_hits("TracedInterfaces", interfaces.hits, *machine)
        cost = found[1].cost * (EMBREE_COST if hits == "embree" else 1.0)
        found = found[0], replace(found[1], reason=f"{found[1].reason}; {HITS[hits]} finds the hits", cost=cost)
    unlit = _unlit_passes(scene, spectral) if scatters(scene) and not capabilities.shader_storage else ()
    passes = (
        *_opaque_passes(scene),
        *passes,
        *found[:1],
        *unlit,
        PassSpec(PassName.TRANSMITTANCE, _shading(scene, method, ambient=ambient), cost=COSTS["resolve"]),
        *found[1:],
        *_layer_passes(scene),
    )
    lit = any(step.name is PassName.LIGHT_VIEWS for step in passes)
    unmodelled = (
        *unmodelled_effects(scene, scattering=lit, interfaces=interfaces),
        *_touching(scene, method, interfaces),
        *(_through_bodies(scene, interfaces) if found else ()),
    )
    limits = (*_limits(scene, method), *([UNLIT] if unlit else []))
    unmodelled = with_ambient(unmodelled) if ambient else unmodelled
    used = interfaces if found else None
    remarks = (Note(NoteKind.SLOW_HITS, slower),) if slower else ()
    return RenderPlan(scene, method, passes, spectral, limits, unmodelled, remarks, interfaces=used, hits=hits)


def _unlit_passes(scene: Scene, spectral: bool) -> tuple[PassSpec, ...]:
    """Pass that marks the pixels in which media scatter light that this OpenGL version cannot follow."""
    media = ((i, scene.objects[i].medium) for i in solids_of(scene))
    scattering = tuple(i for i, medium in media if medium is not None and medium.scatters)
    reason = "this OpenGL cannot compute scattered light, so pixels of scattering media are marked as invalid"
    cost = SignedDepth.cost_for(spectral=spectral)
    return (PassSpec(PassName.UNLIT, reason, scattering, 1, target="unlit", cost=cost),)


def _check(scene: Scene, method: Method, capabilities: Capabilities) -> None:
    name = type(method).__name__
    if method.ordered and not solids_of(scene):
        raise InputError(
            name, "all bodies are declared as thin-walled sheets, which have no inside", "use the method ThinLayer"
        )
    if method.needs_storage and not capabilities.shader_storage:
        raise InputError(
            name, "this OpenGL has no shader storage buffers, which need version 4.3", "use the method DepthPeeling"
        )
    if method.ordered and (count := len(medium_slots(scene))) > MAX_SLOTS:
        raise InputError(
            name,
            (
                f"the scene has {count} groups of bodies (for each medium, priority and open mesh), more than "
                f"the limit of {MAX_SLOTS}"
            ),
            "use fewer different media and priorities, or close the open meshes",
        )
    if not method.tells_media_apart and media_differ(scene):
        raise InputError(name, "the bodies have different media", "use SignedDepth, which supports several media")
    method.check(scene)


def _interface_passes(scene: Scene, method: Method, interfaces: InterfaceMode, instead: str) -> tuple[PassSpec, ...]:
    """Passes that find and shade interfaces; none where no interface changes light."""
    if not (found := with_interfaces(scene)):
        return ()
    straight = method.makes_sheets or all(scene.objects[i].sheet_thickness is not None for i in found)
    drawn, shaded = interfaces.passes(scene, straight=straight)
    if instead and shaded.name is PassName.SURFACES:
        shaded = replace(shaded, reason=f"{shaded.reason}; in screen space, because {instead}")
    return drawn, shaded


def _touching(scene: Scene, method: Method, interfaces: InterfaceMode) -> tuple[Note, ...]:
    """Note for methods that do not know the first exit from all bodies, and refract rays between touching bodies."""
    if not interfaces.finds_exits or method.finds_exits or method.makes_sheets:
        return ()
    if (touching := touching_interfaces(scene)) is None:
        return ()
    text = f"{touching}; {type(method).__name__} lacks this order, and treats the interface between them as the last"
    return (Note(NoteKind.TOUCHING_INTERFACES, text),)


def _through_bodies(scene: Scene, interfaces: InterfaceMode) -> tuple[Note, ...]:
    """Notes on missing shadows on interfaces."""
    notes = []
    if not interfaces.traced and dims_interfaces(scene):
        notes.append("bodies in front of a light do not dim its highlights and diffuse reflection")
    reflects = (body.surface is not None and body.surface.transmission < 1 for body in scene.bodies if not body.covers)
    if scene.environment_shadows and any(reflects):
        notes.append("objects do not dim the diffuse reflection of the environment")
    return tuple(Note(NoteKind.SHADOWS, f"shadows on bodies are missing: {text}") for text in notes)


def _limits(scene: Scene, method: Method) -> tuple[Note, ...]:
    """Notes on where the thickness that a method finds in this scene is not exact."""
    limits = [] if method.makes_sheets else [*open_limits(scene), *hole_limits(scene, method)]
    limits += layer_limits(scene, method) + method.limits(scene)
    if method.ordered:
        limits += scattering_limits(scene) + sheet_limits(scene)
    return (*limits, *mesh_limits(scene, method))


def _declared_sheets(scene: Scene) -> tuple[PassSpec, ...]:
    if not (sheets := sheets_of(scene)):
        return ()
    return (sheet_pass(sheets, f"{count_of(sheets, 'mesh', 'meshes')}, thin-walled: sum of paths through all faces"),)


def _fallback_passes(scene: Scene, spectral: bool) -> tuple[PassSpec, ...]:
    """Passes for pixels with unequal entry and exit counts: open bodies drawn as sheets, all others as usual."""
    leaky = open_bodies(scene)
    if not leaky:
        return ()
    reason = (
        f"{object_names([scene.objects[i] for i in leaky])}: not closed; pixels with unequal entries and exits show "
        f"sheets of {FALLBACK_SHEET:.0%} of the diagonal, and are marked as invalid"
    )
    sheets = leaky + sheets_of(scene)
    as_sheets = PassSpec(PassName.THIN_LAYER_FALLBACK, reason, sheets, 1, "fallback", ThinLayer.cost)
    closed = tuple(i for i in solids_of(scene) if i not in leaky)
    if not closed:
        return (as_sheets,)
    reason = "pixels that open meshes cover also need the thickness of the closed bodies"
    cost = SignedDepth.cost_for(spectral=spectral)
    return (as_sheets, PassSpec(PassName.SIGNED_DEPTH_FALLBACK, reason, closed, 1, "fallback", cost))


def _light_views(scene: Scene, method: Method) -> tuple[PassSpec, ...]:
    """Pass that renders views from the lights, if the method follows light into scattering media."""
    if not method.samples_lights or not scatters(scene):
        return ()
    lights = len(scene.lights)
    if lights > MAX_SCATTER_LIGHTS:
        raise InputError(
            f"{lights} lights on scattering media",
            f"the renderer supports at most {MAX_SCATTER_LIGHTS} lights inside scattering media",
            f"remove {lights - MAX_SCATTER_LIGHTS} lights, or use media without scattering",
        )
    reason = (
        f"{lights} {'light' if lights == 1 else 'lights'} in scattering media: the sorted surfaces on the way from "
        f"each light give the light at {method.light_points} points of each interval"
    )
    # From each light, surfaces are kept in lists.
    cost = lights * FragmentLists.cost
    return (PassSpec(PassName.LIGHT_VIEWS, reason, solids_of(scene), lights, cost=cost),)


def _opaque_passes(scene: Scene) -> tuple[PassSpec, ...]:
    if not (opaque := indices(scene, lambda item: item.medium is None)):
        return ()
    reason = (
        f"{count_of(opaque, 'opaque object', 'opaque objects')}: depth and color of the nearest surface, where rays "
        "through media end"
    )
    return (PassSpec(PassName.OPAQUE, reason, opaque, 1, cost=COSTS["opaque"]),)


def _shading(scene: Scene, method: Method, *, ambient: bool) -> str:
    """Description of how path lengths become radiance."""
    if not any(body.medium is not None and body.medium.emits for body in scene.bodies):
        found = "Beer-Lambert: light from behind, times exp(-optical depth)"
    elif method.ordered:
        found = "Beer-Lambert: light from behind, times exp(-optical depth), plus the emission of the intervals"
    else:
        found = "Beer-Lambert, plus the emission of the single medium in closed form, q / sigma_t (1 - T)"
    return f"{found}; {AMBIENT}" if ambient else found


def _layer_passes(scene: Scene) -> tuple[PassSpec, ...]:
    """Pass that draws layers and the emission of interfaces; none where a scene has neither."""
    layers, emitting = indices(scene, lambda item: item.covers), emitting_bodies(scene)
    reasons = []
    if layers:
        names = object_names(scene.objects[i] for i in layers)
        reasons.append(f"{names}: partly transparent layers over the picture")
    if emitting:
        reasons.append(f"{object_names(scene.objects[i] for i in emitting)}: the surface emits light")
    if not reasons:
        return ()
    return (
        PassSpec(PassName.LAYERS, "; ".join(reasons), tuple(sorted((*layers, *emitting))), 1, cost=COSTS["layers"]),
    )
