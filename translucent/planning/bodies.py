"""Bodies of a scene as plans class them: solids, sheets, open ones, and slots that share a winding number.

Also the textures that rays read wherever they hit a surface, and how large these may be.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.media.medium import Medium
from translucent.planning.passes import Note, NoteKind
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.grounds import SUNK, ground_below
from translucent.scene.scene import Object, Scene, first_overlap, object_names
from translucent.scene.texture import Falloff, Texture

#: Largest number of winding numbers that a ray keeps apart.
MAX_SLOTS = 16

#: Texels of all textures together, without their mipmaps; more are halved. 8 bytes each.
MOST_TEXELS = 1 << 24


#: Opaque objects whose light is found by way of interfaces and of each other, at most: each takes half a second.
MOST_EXCHANGING = 8

#: Objects of a scene, and faces of all of them, up to which paths between them are traced on the CPU.
MOST_TRACED, MOST_TRACED_FACES = 64, 1 << 20

#: Diagonal of such an object, in those of the clear bodies, up to which a map shows the shadows on it.
LARGEST_EXCHANGING = 2.0


def may_hold(body: Object, item: Object) -> bool:
    """Test whether an object may be inside a body, at least in part, and so receive the light in it."""
    filled_or_open = item.medium is not None or not item.mesh.diagnosis.solid
    return _may_be_inside(item, *body.bounds) and (filled_or_open or _has_faces_in(body, item))


def _has_faces_in(body: Object, item: Object) -> bool:
    """Test whether faces of an object may cross the box of a body's mesh: not those of a table on which it stands.

    Axes of the box and normals of the faces separate them (Gottschalk, Lin & Manocha 1996, "OBBTree").
    """
    to_box = np.linalg.inv(body.matrix) @ item.matrix
    corners = (item.mesh.vertices @ to_box[:3, :3].T + (to_box[:3, 3] - body.mesh.center))[item.mesh.faces]
    half = 0.5 * (body.mesh.bounds[1] - body.mesh.bounds[0]) - SUNK * body.mesh.diagonal
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    apart = ((corners.min(axis=1) > half) | (corners.max(axis=1) < -half)).any(axis=1)
    apart |= np.abs((normals * corners[:, 0]).sum(axis=1)) > np.abs(normals) @ half
    return not apart.all()


def held_objects(scene: Scene) -> tuple[int, ...]:
    """Numbers of the opaque objects that may be inside clear bodies."""
    clear = _clear_bodies(scene)
    bounds = np.reshape([body.bounds for body in clear], (-1, 2, 3))
    near = [
        i
        for i, item in enumerate(scene.objects)
        if item.medium is None and _may_be_inside(item, *bounds.swapaxes(0, 1))
    ]
    return tuple(i for i in near if any(may_hold(body, scene.objects[i]) for body in clear))


def _may_be_inside(item: Object, low: Array, high: Array) -> bool:
    """Test whether an object may be inside at least one box; `low` and `high` (..., 3) are the corners of the boxes."""
    first, last = item.bounds
    # A solid may be inside in part; an open one, such as a ground, must be inside the box.
    solid = item.mesh.diagnosis.solid
    inside = (first < high) & (last > low) if solid else (first >= low) & (last <= high)
    return bool(inside.all(axis=-1).any())


def exchanging_objects(scene: Scene) -> tuple[int, ...]:
    """Numbers of the opaque objects whose light is found by way of interfaces and of each other.

    Those are objects in clear bodies, and others in such scenes that are no larger. None where too many would be, or
    where paths cannot be traced: through media of varying density, and open meshes.
    """
    if not (held := held_objects(scene)) or not _can_be_traced(scene):
        return ()
    largest = LARGEST_EXCHANGING * max(_diagonal(body) for body in _clear_bodies(scene))
    found = tuple(
        i
        for i, item in enumerate(scene.objects)
        if item.medium is None
        and item.mesh.diagnosis.solid
        and item.mesh.volume > 0.0
        and (i in held or _diagonal(item) <= largest)
    )
    return found if len(found) <= MOST_EXCHANGING else ()


def _can_be_traced(scene: Scene) -> bool:
    """Test whether the CPU can follow paths: through even and closed bodies, and not too many."""
    faces = sum(len(item.mesh.faces) for item in scene.objects)
    if len(scene.objects) > MOST_TRACED or faces > MOST_TRACED_FACES:
        return False
    solids = [body for body in scene.bodies if body.sheet_thickness is None]
    return all(body.density is None for body in scene.bodies) and all(body.mesh.diagnosis.solid for body in solids)


def glowing_bodies(scene: Scene) -> tuple[int, ...]:
    """Numbers of the clear bodies that light a flat ground below by what they emit, and of clear bodies around these.

    None where paths through them cannot be traced.
    """
    clear = [i for i, body in enumerate(scene.objects) if _is_clear(body)]
    emitting = [i for i in clear if (medium := scene.objects[i].medium) and medium.emits]
    if not emitting or not _can_be_traced(scene):
        return ()
    bounds = [scene.objects[i].bounds for i in emitting]
    low, high = np.reshape(bounds, (-1, 2, 3)).transpose(1, 0, 2)
    found = tuple(i for i in clear if i in emitting or _may_be_inside(scene.objects[i], low, high))
    return found if ground_below(scene, found) is not None else ()


def enclosed_bodies(scene: Scene) -> tuple[int, ...]:
    """Numbers of the bodies in which light diffuses, inside the bounds of a clear body that bends light, and no other.

    None where paths through that one cannot be traced.
    """
    bending = [
        body for body in _clear_bodies(scene) if body.medium and body.medium.ior != 1.0 and body.sheet_thickness is None
    ]
    if not bending:
        return ()
    diffusing = {i: body for i, body in enumerate(scene.objects) if treatment_of(body) is Treatment.DIFFUSION}

    def within(item: Object, bodies: Iterable[Object]) -> bool:
        (low, high), bounds = item.bounds, [body.bounds for body in bodies if body is not item]
        return any((low >= first).all() and (high <= last).all() for first, last in bounds)

    found = tuple(i for i, body in diffusing.items() if within(body, bending) and not within(body, diffusing.values()))
    return found if found and _can_be_traced(scene) else ()


def _is_clear(body: Object) -> bool:
    """Test whether a body is filled with a medium that does not scatter."""
    solid = body.sheet_thickness is None and not body.covers and body.mesh.diagnosis.solid
    return solid and body.medium is not None and not body.medium.scatters and treatment_of(body) is Treatment.SINGLE


def _clear_bodies(scene: Scene) -> list[Object]:
    return [body for body in scene.bodies if body.has_interface and treatment_of(body) is not Treatment.DIFFUSION]


def _diagonal(item: Object) -> float:
    return float(np.linalg.norm(item.bounds[1] - item.bounds[0]))


@dataclass(frozen=True, eq=False)
class Slot:
    """Group of bodies that share one winding number.

    Attributes
    ----------
    objects : tuple of int
        Indices into `Scene.objects`.
    medium : Medium
    priority : int
    """

    objects: tuple[int, ...]
    medium: Medium
    priority: int


def medium_slots(scene: Scene, apart: Sequence[int] = ()) -> tuple[Slot, ...]:
    """Slots of a scene, sorted by descending priority.

    Closed bodies of one medium share a slot: their winding numbers are never negative, so the sum of them says how
    often, and whether at all, the medium fills a point. An open body keeps a slot of its own, lest its holes cancel
    those of another, and so does one whose density varies, or in which rays gather light. So do the bodies to
    be kept `apart`. With ``overlap="priority"`` only bodies of equal priority share one.
    """
    groups: dict[Hashable, list[int]] = {}
    fillings = _fillings(scene)
    for i, body in enumerate(scene.objects):
        if body.medium is None or body.sheet_thickness is not None:
            continue
        own = i if i in apart or not body.mesh.diagnosis.sound else None
        priority = body.priority if scene.overlap == "priority" else 0
        groups.setdefault((own, priority, fillings[i]), []).append(i)
    slots = []
    for group in sorted(groups.values(), key=lambda group: -scene.objects[group[0]].priority):
        first = scene.objects[group[0]]
        assert first.medium is not None
        slots.append(Slot(tuple(group), first.medium, first.priority))
    return tuple(slots)


def require_clear_priorities(scene: Scene) -> None:
    """Raise `InputError` where bodies with different media and equal priority may overlap."""
    bodies = [i for i, body in enumerate(scene.objects) if body.medium is not None and body.sheet_thickness is None]
    priorities = np.unique([scene.objects[i].priority for i in bodies], return_inverse=True)[1]
    known: dict[Hashable, int] = {}
    keys = _fillings(scene)
    fillings = np.array([known.setdefault(keys[i], len(known)) for i in bodies])
    found = overlapping_pair(
        [scene.objects[i] for i in bodies],
        lambda one, other: (priorities[one] == priorities[other]) & (fillings[one] != fillings[other]),
    )
    if found is not None:
        i, j = (bodies[index] for index in found)
        earlier, later = scene.objects[i], scene.objects[j]
        raise InputError(
            'overlap="priority"',
            (
                f"objects {i} ({earlier.mesh.name!r}) and {j} ({later.mesh.name!r}) may overlap, have "
                f"different media, and both have the priority {later.priority}"
            ),
            "give a higher priority to the object that displaces the other",
        )


def same_medium(a: Object, b: Object) -> bool:
    """True if two bodies have the same medium, as far as thickness, absorption and emission go."""
    if a.medium is None or b.medium is None or a.medium is b.medium:
        return a.medium is b.medium
    return np.array_equal(a.medium.extinction, b.medium.extinction) and np.array_equal(
        a.medium.emission, b.medium.emission
    )


def overlapping_pair(
    bodies: Sequence[Object],
    matters: Callable[[npt.NDArray[np.intp], npt.NDArray[np.intp]], npt.NDArray[np.bool_]] | None = None,
) -> tuple[int, int] | None:
    """Positions of two bodies whose bounding boxes overlap in more than a face; touching bodies share no volume.

    `matters` gets the indices of many pairs, and says which of them count; default: all.
    """
    if len(bodies) < 2:
        return None
    return first_overlap(np.stack([body.bounds for body in bodies]), matters)


def _fillings(scene: Scene) -> list[Hashable]:
    """Key of the medium of each object; objects with equal keys may fill a point in place of each other."""
    # Many bodies share a medium, and its key.
    media = {id(item.medium): item.medium for item in scene.objects}
    keys = {number: _medium_key(medium, bool(scene.lights)) for number, medium in media.items()}
    # Where density varies, or rays gather light, a body is like no other.
    own = [item.density is not None or treatment_of(item) is Treatment.VOLUME for item in scene.objects]
    found = [keys[id(item.medium)] for item in scene.objects]
    return [i if key is None or apart else key for i, (key, apart) in enumerate(zip(found, own, strict=True))]


def _medium_key(medium: Medium | None, lit: bool) -> Hashable:
    """Properties that matter of a medium that fills a point; None for none."""
    if medium is None:
        return None
    key = (*medium.extinction.tolist(), *np.asarray(medium.emission).tolist())
    return (*key, *np.asarray(medium.scattering).tolist(), medium.phase_function) if lit else key


def indices(scene: Scene, keep: Callable[[Object], bool]) -> tuple[int, ...]:
    """Indices of the objects that satisfy a condition."""
    return tuple(i for i, item in enumerate(scene.objects) if keep(item))


def solids_of(scene: Scene) -> tuple[int, ...]:
    """Indices of bodies that have an inside."""
    return indices(scene, lambda body: body.medium is not None and body.sheet_thickness is None)


def sheets_of(scene: Scene) -> tuple[int, ...]:
    """Indices of bodies that are declared sheets."""
    return indices(scene, lambda body: body.medium is not None and body.sheet_thickness is not None)


def open_bodies(scene: Scene) -> tuple[int, ...]:
    """Indices of objects that are declared solid and are not closed."""
    return tuple(i for i in solids_of(scene) if not scene.objects[i].mesh.diagnosis.solid)


def open_around_eye(scene: Scene) -> tuple[int, ...]:
    """Indices of open bodies whose bounds contain the eye: the errors of two holes on a ray may cancel in a sum."""
    eye = scene.camera.eye
    if scene.camera.fov_y is None:
        return ()  # an orthographic ray is a whole line, wherever the picture is
    bounds = {i: scene.objects[i].bounds for i in open_bodies(scene)}
    return tuple(i for i, (low, high) in bounds.items() if (low <= eye).all() and (eye <= high).all())


def emitting_bodies(scene: Scene) -> tuple[int, ...]:
    """Indices of bodies whose surfaces emit light, except layers, which emit in their own color."""
    return indices(
        scene,
        lambda item: item.medium is not None and not item.covers and item.surface is not None and item.surface.glows,
    )


def media_differ(scene: Scene) -> bool:
    """True if any two bodies have different media."""
    return any(not same_medium(scene.bodies[0], body) for body in scene.bodies[1:])


def scatters(scene: Scene) -> bool:
    """True if any solid scatters, and the scene has lights."""
    media = (scene.objects[i].medium for i in solids_of(scene))
    return bool(scene.lights) and any(medium is not None and medium.scatters for medium in media)


def count_of(items: tuple[int, ...], one: str, many: str) -> str:
    """Count with its noun, in words."""
    return f"{len(items)} {one if len(items) == 1 else many}"


def textures_at_hits(body: Object) -> tuple[Texture | None, Texture | None, Texture | None, Texture | None]:
    """Textures of color, roughness, transmission and emission that rays read at a hit of an object.

    A `Falloff` is no picture to them but a formula, and what bodies emit they leave out.
    """
    surface = body.surface
    if surface is None or body.covers:
        return None, None, None, None
    color = None if isinstance(surface.color_texture, Falloff) else surface.color_texture
    emissive = surface.emissive_texture if body.medium is None else None
    return color, surface.roughness_texture, surface.transmission_texture, emissive


def varies_at_hits(body: Object) -> bool:
    """True if textures or colors of vertices make the surface of an object differ from place to place for rays."""
    return not body.covers and (any(textures_at_hits(body)) or body.mesh.colors is not None)


def textured_at_hits(scene: Scene) -> bool:
    """True if rays read textures or colors of vertices at some object."""
    return any(varies_at_hits(body) for body in scene.objects)


def unread_at_hits(scene: Scene) -> list[Note]:
    """Notes on textures that traced rays do not read."""
    if not (bodies := [body for body in scene.objects if has_more(body)]):
        return []
    text = f"{object_names(bodies)}: traced rays ignore normal maps, occlusion and alpha holes"
    return [Note(NoteKind.TEXTURES, text)]


def untextured_rays(scene: Scene) -> list[Note]:
    """Notes on objects whose textures traced rays replace by one color."""
    names = object_names(body for body in scene.objects if varies_at_hits(body))
    text = f"{names}: behind the first surface of a ray, one color replaces textures and vertex colors"
    return [Note(NoteKind.TEXTURES, text)]


def reduced_at_hits(scene: Scene) -> list[Note]:
    """Notes on textures that rays on a GPU read with fewer texels than they have."""
    halved = {texture for texture, times in halvings(scene).items() if times}
    bodies = [body for body in scene.objects if halved.intersection(filter(None, textures_at_hits(body)))]
    if not bodies:
        return []
    text = f"{object_names(bodies)}: textures are halved for traced rays, which can read {MOST_TEXELS:,} texels in all"
    return [Note(NoteKind.TEXTURES, text)]


def has_more(body: Object) -> bool:
    """True if a surface has normal maps, occlusion or holes, which rays do not read."""
    if (surface := body.surface) is None or body.covers:
        return False
    mapped = surface.normal_texture is not None or surface.occlusion_texture is not None
    return mapped or body.has_holes or (body.medium is None and surface.alpha_cutoff > 0 and varies_at_hits(body))


def halvings(scene: Scene) -> dict[Texture, int]:
    """Number of halvings of each ray-traced texture until all fit into the limit; the largest is halved first."""
    found = dict.fromkeys((one for body in scene.objects for one in textures_at_hits(body) if one is not None), 0)

    def texels(texture: Texture) -> int:
        height, width = (max(side >> found[texture], 1) for side in texture.pixels.shape[:2])
        return int(height * width)

    while found and sum(map(texels, found)) > MOST_TEXELS:
        found[max(found, key=texels)] += 1
    return found
