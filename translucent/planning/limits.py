"""Notes of plans: inexact thickness, missing effects, and black bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from translucent.planning.bodies import (
    emitting_bodies,
    enclosed_bodies,
    held_objects,
    may_hold,
    open_around_eye,
    open_bodies,
    scatters,
    sheets_of,
)
from translucent.planning.interfaces import InterfaceMode
from translucent.planning.methods import Method
from translucent.planning.passes import Note, NoteKind
from translucent.planning.rendered import Treatment, scatterer_of, treatment_of
from translucent.scene.grounds import Mirror, ground_below
from translucent.scene.lights import AreaLight
from translucent.scene.scene import Object, Scene, object_names

#: Largest number of lights that shine on surfaces.
MAX_LIGHTS = 32

#: Largest number of lights that are followed into media.
MAX_SCATTER_LIGHTS = 8

#: Transmittance of the mean chord of a body from which on lights behind the body are visible through it.
CLEAR = 0.01

#: Reduced optical depth of scattering over the mean thickness of a body below which diffusion is an approximation.
THIN = 0.5

#: Optical depth across a scene beyond which float32 places are too coarse for where light is scattered.
DENSE = 1e5


#: Fraction of the scene's diagonal by which a visible sheet may lie behind an opaque surface.
SHEET_ON_OPAQUE = 1e-6


#: Note of a plan for an OpenGL version that cannot follow lights into media.
UNLIT = Note(
    NoteKind.UNLIT,
    (
        "pixels that show scattering media are marked as invalid: their light can be rendered only by OpenGL "
        "4.3 or by the reference"
    ),
)


def open_limits(scene: Scene) -> list[Note]:
    """Notes on each open body: its defects, and what to do."""
    return [
        Note(
            NoteKind.OPEN_MESH,
            (
                f"{mesh.name!r}: {'; '.join(mesh.diagnosis.problems)}: close the mesh, or declare it a "
                "thin-walled sheet (sheet_thickness=..., --method thin-layer)"
            ),
        )
        for mesh in dict.fromkeys(scene.objects[i].mesh for i in open_bodies(scene))
    ]


def hole_limits(scene: Scene, method: Method) -> list[Note]:
    """Notes on bodies with several holes, or around the eye with one, where the method adds up faces in any order."""
    if method.ordered or method.makes_sheets:
        return []
    around, notes = open_around_eye(scene), list[Note]()
    for i in open_bodies(scene):
        mesh, name = scene.objects[i].mesh, type(method).__name__
        if i in around:
            text = f"the eye is within the bounds of this open mesh, so {name} marks all its pixels as invalid"
        elif mesh.diagnosis.holes > 1:
            text = f"{mesh.diagnosis.holes} holes: {name} may miss rays through two holes, whose errors cancel"
        else:
            continue
        notes.append(
            Note(NoteKind.OPEN_MESH, f"{mesh.name!r}: {text}; the method FragmentLists finds rays through two holes")
        )
    return notes


def layer_limits(scene: Scene, method: Method) -> list[Note]:
    """Notes on rays that may cross more surfaces than the method keeps."""
    if (most := method.layer_limit) is None:
        return []
    meshes = [body.mesh for body in scene.bodies if body.sheet_thickness is None]
    # A ray crosses a convex body's surface twice, and no face more than once.
    possible = sum(2 if mesh.diagnosis.convex else len(mesh.faces) for mesh in meshes)
    if possible <= most:
        return []
    return [Note(NoteKind.LAYER_LIMIT, f"pixels whose rays cross more than {most} surfaces are marked as invalid")]


def mesh_limits(scene: Scene, method: Method) -> list[Note]:
    """Notes on errors of thickness from duplicated faces, and from parts or lobes that are inside out."""
    limits = []
    for body in scene.bodies:
        diagnosis = body.mesh.diagnosis
        if found := diagnosis.duplicate_faces:
            text = f"{body.mesh.name!r}: {found.count} faces are duplicated, so their distances count twice or cancel"
            limits.append(Note(NoteKind.DUPLICATED_FACES, text))
        if diagnosis.inside_out and body.sheet_thickness is None and not method.makes_sheets:
            parts = diagnosis.inside_out_parts
            what = f"{parts} closed parts are inside out" if parts else "the mesh is inside out in places"
            marked = (
                "these pixels are marked as invalid"
                if method.ordered
                else f"{type(method).__name__} cannot tell which pixels are wrong, and marks all as invalid; "
                "FragmentLists can"
            )
            limits.append(Note(NoteKind.INSIDE_OUT, f"{body.mesh.name!r}: {what}: {marked}"))
    return list(dict.fromkeys(limits))


def scattering_limits(scene: Scene) -> list[Note]:
    """Notes on scattering media too dense for float32 to resolve how far light gets into them."""
    if not scatters(scene):
        return []
    dense = [
        body
        for body in scene.bodies
        if body.medium is not None and body.medium.extinction.max() * scene.diagonal > DENSE
    ]
    if not dense:
        return []
    text = f"{object_names(dense)}: scattered light is not exact beyond an optical depth of {DENSE:g}"
    return [Note(NoteKind.DENSE_SCATTERING, text)]


def sheet_limits(scene: Scene) -> list[Note]:
    """Notes on errors of sheets among ordered intervals."""
    if not sheets_of(scene) or not any(body.medium is not None and body.medium.emits for body in scene.bodies):
        return []
    text = (
        "sheets among media that emit light: a sheet dims all light on its ray, even light in front of it, and "
        "emits none"
    )
    return [Note(NoteKind.SHEETS_WITHOUT_ORDER, text)]


def layer_effects(scene: Scene, *, interfaces: bool) -> list[Note]:
    """Notes on effects of layers that are not rendered; `interfaces` as for `unmodelled_effects`."""
    effects = []
    if layers := object_names(item for item in scene.bodies if item.covers):
        text = (
            f"{layers}: these layers cast no shadows, are invisible to refracted rays, are sorted by object even "
            "where they intersect, and behind the first body of a ray are dimmed by all media of the ray"
            if interfaces
            else f"{layers}: these layers reflect only diffusely"
        )
        effects.append(Note(NoteKind.LAYERS, text))
    if emitting := object_names(scene.objects[i] for i in emitting_bodies(scene)):
        where = "behind the first surface on each ray" if interfaces else "in the whole picture"
        effects.append(Note(NoteKind.GLOW, f"{emitting}: light that these surfaces emit is missing {where}"))
    if cut := object_names(item for item in scene.bodies if _wants_holes(item)):
        text = f"{cut}: holes by alpha_cutoff are drawn closed, because a solid with holes has no inside"
        effects.append(Note(NoteKind.HOLES, text))
    return effects


def _wants_holes(item: Object) -> bool:
    if item.sheet_thickness is not None or item.surface is None:
        return False
    varies = item.surface.color_texture is not None or item.mesh.colors is not None
    return item.surface.alpha_cutoff > 0 and varies


#: Note of a plan in which interfaces do nothing to light.
STRAIGHT = Note(NoteKind.REFRACTION, "rays go straight through interfaces, without refraction or reflection")

#: How a plan with ambient radiance shades pixels, beside what it does without.
AMBIENT = "media emit the ambient radiance A that they scatter, sigma_s A per metre"


def unmodelled_effects(scene: Scene, *, scattering: bool, interfaces: InterfaceMode | None = None) -> tuple[Note, ...]:
    """Notes on effects that the scene requests and a plan does not render.

    Parameters
    ----------
    scene : Scene
    scattering : bool
        The plan has light scattered into the rays.
    interfaces : InterfaceMode, optional
        How the plan finds interfaces; None if it leaves out what they and the surfaces of opaque objects do to light.
    """
    surfaces = interfaces is not None
    effects = _scattering_effects(scene, followed=scattering, interfaces=surfaces)
    effects += _refraction_effects(scene, interfaces)
    if clear := [body for body in scene.bodies if _is_invisible(body) and not _is_cavity(body, scene)]:
        text = f"{object_names(clear)}: invisible, because the medium does not absorb, scatter or emit light"
        effects.append(Note(NoteKind.INVISIBLE, text))
    if not surfaces and (surfaced := [item for item in scene.opaque if item.surface is not None]):
        text = f"{object_names(surfaced)}: these opaque surfaces reflect only diffusely, each in one color"
        effects.append(Note(NoteKind.OPAQUE_SURFACES, text))
    effects += layer_effects(scene, interfaces=surfaces)
    effects += shadow_effects(scene) if scene.opaque else []
    if scene.overlap != "priority" and len({body.priority for body in scene.bodies}) > 1:
        text = f'overlap="{scene.overlap}" ignores the priorities of objects'
        effects.append(Note(NoteKind.UNUSED_PRIORITIES, text))
    return tuple(effects)


def with_ambient(notes: Iterable[Note]) -> tuple[Note, ...]:
    """Notes of a plan in which media emit the ambient radiance that they would scatter."""
    dimmed = Note(
        NoteKind.DIMMED_AMBIENT,
        "ambient light reaches every point of the media without shadows or attenuation",
    )
    return (*(note for note in notes if note.kind is not NoteKind.ONLY_REMOVES), dimmed)


def layers_instead(scene: Scene, refusals: Iterable[tuple[int, str]]) -> tuple[Note, ...]:
    """Notes on objects, by their numbers, that are layers though light should diffuse in them, and why."""
    reasons: dict[str, list[Object]] = {}
    for i, why in refusals:
        reasons.setdefault(why, []).append(scene.objects[i])
    return tuple(
        Note(
            NoteKind.LAYER_INSTEAD,
            f"{object_names(items)}: flat layers replace diffusion, because {why}",
        )
        for why, items in reasons.items()
    )


def shadow_effects(scene: Scene) -> list[Note]:
    """Notes on missing shadows on opaque objects, or on a picture of them that is drawn elsewhere."""
    notes = []
    if not scene.environment_shadows and scene.environment.mean.any():
        shadowing = [i for i, item in enumerate(scene.objects) if treatment_of(item) is Treatment.DIFFUSION]
        ground = ground_below(scene, shadowing) if shadowing else None
        if ground is None or ground.has_walls or len(scene.objects) > len(shadowing) + 1:
            text = (
                "the environment casts no shadows on opaque objects, so a ground is up to twice as bright beside "
                "objects that stand on it"
            )
            if ground is not None:
                names = object_names([scene.objects[i] for i in shadowing])
                text += f"; only {names} shadow {object_names([ground.ground])}"
            notes.append(Note(NoteKind.SHADOWS, text))
    layers = [body for body in scene.bodies if body.covers]
    if layers and (scene.lights or scene.environment_shadows):
        text = f"{object_names(layers)}: these layers cast no shadows on opaque objects"
        notes.append(Note(NoteKind.SHADOWS, text))
    return notes


def hidden_lights(scene: Scene) -> tuple[Note, ...]:
    """Note on clear bodies before lights with a size, which no ray through these bodies shows."""
    eye, names = scene.camera.eye, list[Object]()
    places = [np.asarray(light.position) for light in scene.lights if isinstance(light, AreaLight)]
    for body in scene.bodies:
        if body.medium is None or body.medium.ior == 1.0 or body.sheet_thickness is not None or body.covers:
            continue
        middle = body.bounds.mean(axis=0)
        behind = any((place - middle) @ (eye - middle) < 0.0 for place in places)
        if behind and body.medium.transmittance(2.0 * body.mean_thickness).max() >= CLEAR:
            names.append(body)
    if not names:
        return ()
    text = (
        f"{object_names(names)}: lights behind are invisible through these bodies, whose pixels lack up to 95 % of "
        "their light there; --method path-traced shows these lights"
    )
    return (Note(NoteKind.SPHERE_LIGHTS, text),)


def reflected_effects(
    scene: Scene, exchanging: Sequence[int], glowing: Sequence[int], mirror: Mirror | None
) -> list[Note]:
    """Notes on light that opaque objects do not get.

    `exchanging` are those with light of all kinds, `glowing` the bodies whose emission lights the ground, and `mirror`
    a flat surface that reflects the objects on it.
    """
    items, held, texts = scene.objects, held_objects(scene), []
    left_out = [i for i in held if i not in exchanging or _is_metal(items[i])]
    if held and exchanging and scene.lights:
        texts.append(
            f"{object_names([items[i] for i in held])}: light of the lights on these objects is up to 40 % "
            "wrong without caustics, because it comes straight, and up to 20 % with caustics"
        )
    elif left_out:
        texts.append(
            f"{object_names([items[i] for i in left_out])}: up to 30 % wrong, without light that interfaces "
            "refract onto these objects, and light that opaque objects reflect onto each other; --method path-traced "
            "includes this light"
        )
    apart = [items[i] for i in held] + ([] if mirror is None else [mirror.ground])
    if metals := [item for item in scene.opaque if _is_metal(item) and item not in apart]:
        texts.append(
            f"{object_names(metals)}: metals reflect the environment alone, without the objects around: up to 50 % "
            "wrong; --method path-traced includes these reflections"
        )
    lamps = [item for item in scene.opaque if item.surface is not None and item.surface.glows]
    unlit = [item for i, item in enumerate(items) if item.medium is None and i not in exchanging and item not in lamps]
    if lamps and unlit:
        texts.append(
            f"{object_names(lamps)}: the light that these surfaces emit does not reach {object_names(unlit)}: black "
            "there if nothing else shines; --method path-traced includes this light"
        )
    emitting = [body for body in scene.bodies if body.medium is not None and body.medium.emits]
    silent = [body for body in emitting if treatment_of(body) is not Treatment.DIFFUSION]
    ground = ground_below(scene, glowing) if glowing else None
    dark = _off_ground(scene.opaque, ground)
    if silent and dark:
        texts.append(
            f"{object_names(silent)}: the light that these media emit does not reach {object_names(dark)}: "
            "black there if nothing else shines; --method path-traced includes this light"
        )
    return [Note(NoteKind.REFLECTED_LIGHT, text) for text in texts]


def _off_ground(items: Iterable[Object], ground: Mirror | None) -> list[Object]:
    """Those of some opaque objects that are more than the ground below bodies, or something else."""
    return [item for item in items if ground is None or item is not ground.ground or ground.has_walls]


def _is_metal(item: Object) -> bool:
    return item.surface is not None and item.surface.metallic > 0.0


def _scattering_effects(scene: Scene, *, followed: bool, interfaces: bool) -> list[Note]:
    """Notes on scattered light that is not rendered."""
    notes = _subsurface_effects(scene) if interfaces else []
    bodies = [body for body in scene.bodies if body.medium is not None and body.medium.scatters]
    if any(treatment_of(body) is Treatment.VOLUME for body in bodies):
        text = (
            "fog: opaque objects and other bodies cast no shadows on light that is scattered more than once, and "
            "fog does not scatter the light of these objects forward to the eye"
        )
        if scene.opaque:
            text += "; light that the ground reflects into the fog is missing, up to 45 % on a bright ground"
        volumes = [body for body in bodies if treatment_of(body) is Treatment.VOLUME]
        sharp = bool(scene.lights) or scene.environment.kind == "image"
        if sharp and any(body.medium.anisotropy >= STRONGLY_AHEAD for body in volumes if body.medium):
            text += "; rims of fog that scatters forward are up to 15 % too bright in front of a light or a bright sky"
        notes.append(Note(NoteKind.DIFFUSED_LIGHT, text))
    rendered = (Treatment.VOLUME, Treatment.LAYER) if interfaces else (Treatment.VOLUME,)
    if media := [body.medium for body in bodies if body.medium and treatment_of(body) not in rendered]:
        if followed:
            densest = max(float(np.max(np.asarray(medium.scattering))) for medium in media)
            text = (
                "light that is scattered more than once is missing, much of the light in bodies thicker than a "
                f"mean free path ({1 / densest:.2g} m), and so is scattered light of the environment"
            )
            return [*notes, Note(NoteKind.SCATTERED_AGAIN, text)]
        if not scene.lights:
            return [*notes, Note(NoteKind.ONLY_REMOVES, "scattering only removes light from rays, and adds none")]
        text = "this method leaves out the light that media scatter into rays; FragmentLists renders this light"
        return [*notes, Note(NoteKind.LIGHTS_LEFT_OUT, text)]
    lit = scene.opaque or any(body.covers or (interfaces and body.has_interface) for body in scene.bodies)
    if not notes and scene.lights and not lit:
        text = "lights have no effect, because no medium scatters and no object is opaque"
        return [Note(NoteKind.UNUSED_LIGHTS, text)]
    return notes


#: Mean cosine of scattering from which on what is scattered ahead is still seen as an image of what is behind.
STRONGLY_AHEAD = 0.5


def _subsurface_effects(scene: Scene) -> list[Note]:
    """Notes on bodies whose surfaces show light that they scatter many times."""
    notes = []
    if any(treatment_of(body) is Treatment.LAYER for body in scene.bodies):
        text = (
            "multiply scattered light does not spread sideways: it leaves as from a flat layer as thick as the "
            "path of the ray, so edges and folds are wrong"
        )
        notes.append(Note(NoteKind.SPREAD_INSIDE, text))
    if bodies := [body for body in scene.bodies if treatment_of(body) is Treatment.DIFFUSION]:
        ground = ground_below(scene, [i for i, body in enumerate(scene.objects) if body in bodies])
        text = (
            f"{object_names(bodies)}: without details smaller than a cell of the diffusion grid: spikes and edges are "
            "up to 15 % too dark"
        )
        if thin := [body for body in bodies if _is_thin(body)]:
            text += f"; where light is hardly scattered twice, as in {object_names(thin)}, up to 20 % wrong"
        if scene.lights:
            text += (
                "; where lights shine from behind, bodies are up to 30 % too dark, and rims up to 40 % too bright "
                "(finer cells, as of tl.Diffusion(48), halve both)"
            )
        lit = [scene.objects[i] for i in enclosed_bodies(scene)]
        rest, without = [body for body in scene.bodies if body not in bodies], [one for one in bodies if one not in lit]
        if rest and without:
            inside = any(may_hold(other, body) for other in rest for body in without)
            where = "up to 30 % too dark in, and up to 10 % next to" if inside else "up to 10 % too dark next to"
            text += f"; {where} {object_names(rest)}, whose light does not reach these bodies"
        if any(map(_scatters_ahead, bodies)) and scene.environment.kind == "image":
            text += "; bright parts of the environment, scattered forward by the bodies, are up to 10 % wrong"
        if any(body.medium is not None and body.medium.emits for body in bodies):
            text += "; light that the bodies emit and scatter is up to 10 % too dark"
        if held := [item for item in scene.opaque if any(may_hold(body, item) for body in bodies)]:
            text += f"; the light around {object_names(held)} inside the bodies is wrong by up to 15 %"
        beside = [item for item in scene.opaque if not any(may_hold(body, item) for body in bodies)]
        if others := _off_ground(beside, ground):
            text += f"; light from these bodies does not reach {object_names(others)}: up to 10 % too dark there"
        if ground is not None and ground.has_walls:
            name = object_names([ground.ground])
            text += f"; parts of {name} do not light each other: up to 60 % too dark in the corners of a white room"
        notes.append(Note(NoteKind.DIFFUSED_LIGHT, text))
    return notes


def _scatters_ahead(body: Object) -> bool:
    medium = scatterer_of(body)
    return medium is not None and medium.anisotropy >= STRONGLY_AHEAD


def _is_thin(body: Object) -> bool:
    """Test whether most light that a body scatters leaves it without another event."""
    medium = scatterer_of(body)
    if medium is None or body.density is not None:
        return False
    depth = np.asarray(medium.scattering) * (1.0 - medium.anisotropy) * body.mean_thickness
    return float(depth.max()) < THIN


def _refraction_effects(scene: Scene, interfaces: InterfaceMode | None) -> list[Note]:
    """Notes on refracted and reflected light that is not rendered."""
    if not any(body.has_interface for body in scene.bodies):
        return []
    if interfaces is None:
        return [STRAIGHT]
    return interfaces.unmodelled()


def _is_cavity(body: Object, scene: Scene) -> bool:
    """Test whether a body may displace a body with an interface: then the interface between them is visible."""
    return scene.overlap == "priority" and any(other.has_interface and may_hold(other, body) for other in scene.bodies)


def _is_invisible(body: Object) -> bool:
    medium = body.medium
    return (
        medium is not None
        and not body.covers
        and not body.has_interface
        and not (medium.extinction > 0).any()
        and not medium.emits
    )
