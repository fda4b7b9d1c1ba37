"""Actions of a user on a document, and the history that undoes them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from translucent.errors import InputError
from translucent.formulas.phase import parse_phase
from translucent.gltf.load import SUFFIXES
from translucent.media.albedo import hulst_color, scattering_medium
from translucent.media.conversion import extinction_from_colors
from translucent.media.medium import MAX_COEFFICIENT, Medium, color_at
from translucent.media.presets import preset
from translucent.preview.document import (
    AddedLight,
    Assigned,
    Document,
    Material,
    Model,
    Orbit,
    Placed,
    Snapshot,
    Triple,
    checked,
    medium_fields,
    panned,
    resized,
    triple_of,
    turned,
    zoomed,
)
from translucent.scene.showcase import SOLID_IOR
from translucent.scene_files import is_composed
from translucent.units import metres_per_unit

#: Largest number of steps that can be undone.
MAX_STEPS = 200


@dataclass(frozen=True)
class SetField:
    """Give a field, such as ``material.roughness``, a value. Changes of one `drag` are one step of undo."""

    field: str
    value: Any
    drag: int | None = None


@dataclass(frozen=True)
class Open:
    """Show another model."""

    path: str
    unit: str = "m"


@dataclass(frozen=True)
class Resize:
    """Scale the model by another unit of its coordinates, and the view with it."""

    unit: str


@dataclass(frozen=True)
class ChoosePreset:
    """Fill the bodies with a named medium."""

    name: str


@dataclass(frozen=True)
class SetMaterial:
    """Fill the bodies with a material. Changes of one `drag` are one step of undo."""

    material: Material
    drag: int | None = None


@dataclass(frozen=True)
class Assign:
    """Give an object a material of its own, or none again. Those of one `drag` are one step of undo."""

    object: int
    material: Material | None
    drag: int | None = None


@dataclass(frozen=True)
class Hide:
    """Hide these objects, and show all others."""

    objects: tuple[int, ...]


@dataclass(frozen=True)
class Place:
    """Move, rotate and scale an object. Those of one `drag` are one step of undo."""

    place: Placed
    drag: int | None = None


@dataclass(frozen=True)
class SetLights:
    """Light the model with these lights of the user's. Changes of one `drag` are one step of undo."""

    lights: tuple[AddedLight, ...]
    drag: int | None = None


@dataclass(frozen=True)
class Stand:
    """Let an axis of the model's coordinates, ``y`` or ``z``, point upwards."""

    up: str


@dataclass(frozen=True)
class SetTime:
    """Show a time of the model's animations in seconds; None: as they are written. A `drag` is one step of undo."""

    time: float | None
    drag: int | None = None


@dataclass(frozen=True)
class Keep:
    """Store the document as a snapshot, in place of one with the same name."""

    name: str


@dataclass(frozen=True)
class Recall:
    """Show a snapshot, from the present camera."""

    name: str


@dataclass(frozen=True)
class Adopt:
    """Take over the material that a model came with; no step of undo."""

    material: Material


@dataclass(frozen=True)
class Replace:
    """Show another document altogether: a session."""

    document: Document


@dataclass(frozen=True)
class SetOrbit:
    """Set the camera's orbit; None: no camera yet."""

    orbit: Orbit | None


@dataclass(frozen=True)
class OrbitBy:
    """Orbit the camera around its target by degrees: to the right, and upwards."""

    right: float
    up: float


@dataclass(frozen=True)
class Pan:
    """Move the picture by fractions of its height: to the right, and down."""

    right: float
    down: float


@dataclass(frozen=True)
class Zoom:
    """Zoom by a factor towards a point of the picture, in heights right of and below its center."""

    factor: float
    right: float = 0.0
    down: float = 0.0


Move = SetOrbit | OrbitBy | Pan | Zoom
Action = (
    SetField | Open | Resize | Stand | SetTime | ChoosePreset | SetMaterial | Assign | Hide | Place | SetLights | Keep
    | Recall | Adopt | Replace | Move
)  # fmt: skip

#: Fields with which a preset is none any more.
_OF_PRESET = ("absorption", "scattering", "anisotropy", "phase", "emission")


def apply(document: Document, action: Action) -> Document:
    """Apply an action to a document.

    Raises
    ------
    InputError
        If there is no such field or preset, or a value is out of its range; the document is as it was.
    """
    replace = partial(dataclasses.replace, document)
    match action:
        case SetField():
            return _changed(document, action)
        case Open():
            model, material = Model(action.path, checked("model.unit", action.unit, "m")), document.material
            # A glTF file shows its own media; on a mesh, which has none, a material of the user's own stays.
            if not _is_mesh(action.path) or material.source == "file":
                material = Material()
            return replace(
                model=model, material=material, orbit=None, assigned=(), hidden=(), placed=(), lights=(), snapshots=()
            )
        case Resize():
            model = dataclasses.replace(document.model, unit=checked("model.unit", action.unit, "m"))
            factor = metres_per_unit(model.unit) / metres_per_unit(document.model.unit)
            material = dataclasses.replace(document.material, thickness=factor * document.material.thickness)
            return _viewed_alike(replace(model=model, material=material), document)
        case Stand():
            model = dataclasses.replace(document.model, up=checked("model.up", action.up, "y"))
            return replace(model=model, orbit=document.orbit if model == document.model else None)
        case SetTime():
            time = checked("model.time", action.time, None)
            return replace(model=dataclasses.replace(document.model, time=time))
        case Place():
            placed = {one.object: one for one in document.placed} | {action.place.object: action.place}
            moved = (placed[number] for number in sorted(placed) if placed[number] != Placed(number))
            return replace(placed=tuple(moved))
        case SetLights():
            return replace(lights=action.lights)
        case Keep():
            kept = Snapshot(action.name, replace(snapshots=()))
            others = {one.name: one for one in document.snapshots} | {action.name: kept}
            return replace(snapshots=tuple(others[name] for name in sorted(others)))
        case Recall():
            if (found := document.snapshot(action.name)) is None:
                names = ", ".join(one.name for one in document.snapshots) or "none (no snapshot exists)"
                raise InputError(f"snapshot {action.name!r}", "no snapshot has this name", f"use one of: {names}")
            return document.seen_as(found.document)
        case ChoosePreset():
            return replace(material=preset_material(document.material, action.name))
        case SetMaterial():
            return replace(material=action.material)
        case Assign():
            assigned = {one.object: one for one in document.assigned if one.object != action.object}
            if action.material is not None:
                assigned[action.object] = Assigned(action.object, action.material)
            return replace(assigned=tuple(assigned[number] for number in sorted(assigned)))
        case Hide():
            return replace(hidden=tuple(sorted(set(action.objects))))
        case Adopt():
            return replace(material=action.material)
        case Replace():
            return action.document
        case SetOrbit():
            return replace(orbit=action.orbit)
        case _ if document.orbit is None:  # nothing is loaded yet, so that there is nothing to move
            return document
        case OrbitBy():
            return replace(orbit=turned(document.orbit, action.right, action.up))
        case Pan():
            return replace(orbit=panned(document.orbit, action.right, action.down))
        case Zoom():
            return replace(orbit=zoomed(document.orbit, action.factor, (action.right, action.down)))


def _changed(document: Document, action: SetField) -> Document:
    section, _, name = action.field.partition(".")
    owner = getattr(document, section, None) if section in document.__dataclass_fields__ else None
    if owner is None or name not in owner.__dataclass_fields__ or section == "model":
        raise InputError(
            f"field {action.field!r}",
            "this field does not exist, or cannot be changed",
            "use a field such as material.roughness",
        )
    if isinstance(owner, Material):
        changed = changed_material(owner, name, action.value)
        bare = _is_mesh(document.model.path)
        if bare and owner.source == "file" and changed.source == "color":
            changed = dataclasses.replace(changed, ior=max(owner.ior, SOLID_IOR))  # a solid, as of other verbs
        return dataclasses.replace(document, material=changed)
    value = checked(action.field, action.value, getattr(owner, name))
    return dataclasses.replace(document, **{section: dataclasses.replace(owner, **{name: value})})


def changed_material(material: Material, name: str, value: Any) -> Material:
    """Material with another value of a field, and its source accordingly.

    Raises
    ------
    InputError
        If the value is out of its range.
    """
    value = checked(f"material.{name}", value, getattr(material, name))
    values = {name: value}
    if name == "phase":
        values["anisotropy"] = parse_phase(value).mean_cosine if value else 0.0
    elif name == "anisotropy":
        values["phase"] = ""
    material = dataclasses.replace(material, **values)
    if name in ("color", "distance"):
        absorption = extinction_from_colors(material.color, material.distance)
        if not (absorption <= MAX_COEFFICIENT).all():
            found = "the distance is so short that the extinction overflows"
            raise InputError(f"distance {material.distance:g} m", found, "check the unit of length")
        return dataclasses.replace(material, source="color", preset="", absorption=triple_of(absorption))
    if name == "absorption" or (name in _OF_PRESET and material.source == "preset"):
        return _with_color(dataclasses.replace(material, source="coefficients", preset=""))
    if material.source == "file" and name != "source":
        return dataclasses.replace(material, source="coefficients")
    return material


def preset_material(material: Material, name: str) -> Material:
    """Material with the medium of a preset; polished, if it was rough as another preset's surfaces are."""
    found = preset(name)
    roughness = found.roughness or (0.0 if material.source == "preset" else material.roughness)
    stated: dict[str, Any] = medium_fields(found.medium) | {"source": "preset", "preset": found.name}
    return _with_color(dataclasses.replace(material, **stated, roughness=roughness, pattern=found.pattern))


def scattering_of(material: Material) -> tuple[Triple, float] | None:
    """Diffuse color of a medium, and the mean of its mean free paths in metres; None if it does not scatter."""
    absorption, scattering = np.asarray(material.absorption), np.asarray(material.scattering)
    extinction = absorption + scattering
    if not (extinction > 0).all() or not scattering.any():
        return None
    color = hulst_color(scattering / extinction, material.anisotropy)
    return triple_of(np.clip(color, 0.0, 1.0)), float(np.mean(1.0 / extinction))


def scattered_material(material: Material, color: Triple | None = None, radius: float | None = None) -> Material:
    """Material with another diffuse color where it is thick, or another mean free path in metres.

    Channels keep the proportions of their mean free paths. One that scattered nothing gets the other of the two from
    its color and its distance.

    Raises
    ------
    InputError
        If a value is out of its range.
    """
    known = scattering_of(material)
    before, mean = known or (material.color, 0.1 * material.distance)
    path = np.full(3, mean)
    if known is not None:
        path = 1.0 / (np.asarray(material.absorption) + np.asarray(material.scattering))
    if radius is not None:
        path = path * radius / mean
    made = scattering_medium(before if color is None else color, path, material.anisotropy)
    coefficients = {name: checked(f"material.{name}", triple_of(getattr(made, name)), (0.0, 0.0, 0.0))
                    for name in ("absorption", "scattering")}  # fmt: skip
    return _with_color(dataclasses.replace(material, **coefficients, source="coefficients", preset="", phase=""))


def _with_color(material: Material) -> Material:
    """Material with the color at a distance of its coefficients, as ``translucent extinction`` states it."""
    medium = Medium(material.absorption, material.scattering)
    color, distance = color_at(medium, None if medium.extinction.any() else 1.0)
    return dataclasses.replace(material, color=triple_of(color), distance=float(distance))


@dataclass(frozen=True)
class History:
    """History of a document: its past and undone states.

    Attributes
    ----------
    present : Document
    past, future : tuple of Document
        Undo shows the last of `past`, redo the last of `future`.
    drag : tuple of (str, int), optional
        Field, or object, and number of the drag that made the present one.
    """

    present: Document = dataclasses.field(default_factory=Document)
    past: tuple[Document, ...] = ()
    future: tuple[Document, ...] = ()
    drag: tuple[str, int] | None = None

    def done(self, action: Action) -> History:
        """History after an action; one that changes nothing leaves no step, and a drag leaves one."""
        after = apply(self.present, action)
        # Moves of the camera are no steps, and undo leaves it where it is.
        if isinstance(action, (Move, Adopt)):
            return dataclasses.replace(self, present=after)
        if after == self.present:
            return self
        drag = None
        if isinstance(action, (SetField, SetMaterial, Assign, Place, SetLights, SetTime)) and action.drag is not None:
            drag = _dragged(action), action.drag
        if drag is not None and drag == self.drag:
            return dataclasses.replace(self, present=after, future=())
        return History(after, (*self.past, self.present)[-MAX_STEPS:], (), drag)

    def undone(self) -> History:
        """History one step back; the camera stays, unless the model is another."""
        if not self.past:
            return self
        before = _with_view_of(self.present, self.past[-1])
        return History(before, self.past[:-1], (*self.future, self.present))

    def redone(self) -> History:
        """History one step forward."""
        if not self.future:
            return self
        after = _with_view_of(self.present, self.future[-1])
        return History(after, (*self.past, self.present), self.future[:-1])


def _dragged(action: SetField | SetMaterial | Assign | Place | SetLights | SetTime) -> str:
    """Part of the document that a drag changes, which makes one undo step."""
    match action:
        case SetField():
            return action.field
        case Assign():
            return f"object {action.object}"
        case Place():
            return f"place {action.place.object}"
    return type(action).__name__


def _with_view_of(present: Document, other: Document) -> Document:
    return _viewed_alike(other, present) if other.model.path == present.model.path else other


def _viewed_alike(document: Document, other: Document) -> Document:
    """Document with the view of another one of the same file, which may have another scale."""
    factor = metres_per_unit(document.model.unit) / metres_per_unit(other.model.unit)
    orbit = other.orbit if other.orbit is None or factor == 1.0 else resized(other.orbit, factor)
    return dataclasses.replace(document, orbit=orbit)


def _is_mesh(model: str) -> bool:
    """True if a model is one mesh, and no scene with materials of its own."""
    return Path(model).suffix.lower() not in SUFFIXES and not is_composed(model)
