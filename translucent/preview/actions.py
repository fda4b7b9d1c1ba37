"""Actions of a user on a document, and the history that undoes them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from translucent.errors import InputError
from translucent.formulas.phase import parse_phase
from translucent.gltf.load import SUFFIXES
from translucent.media.medium import MAX_COEFFICIENT, Medium, color_at
from translucent.media.presets import preset
from translucent.preview import document as orbiting
from translucent.preview.document import Assigned, Document, Material, Model, Orbit, checked


@dataclass(frozen=True)
class SetField:
    """Action: give a field, such as ``material.roughness``, a value. Changes of one `drag` are one step of undo."""

    field: str
    value: Any
    drag: int | None = None


@dataclass(frozen=True)
class Open:
    """Show another model."""

    path: str
    unit: str = "m"


@dataclass(frozen=True)
class ChoosePreset:
    """Fill the bodies with a named medium."""

    name: str


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
class Turn:
    """Orbit by degrees: to the right, and upwards."""

    right: float
    up: float


@dataclass(frozen=True)
class Pan:
    """Move the picture by shares of its height: to the right, and down."""

    right: float
    down: float


@dataclass(frozen=True)
class Zoom:
    """Get closer by a factor, to what is at a position in the picture: heights right of and below its center."""

    factor: float
    right: float = 0.0
    down: float = 0.0


Action = SetField | Open | ChoosePreset | Assign | Hide | Adopt | Replace | SetOrbit | Turn | Pan | Zoom

#: Actions that move the camera: they are no undo steps, and undo leaves the camera where it is.
CAMERA_ACTIONS = (SetOrbit, Turn, Pan, Zoom)

#: Fields that define the medium by a color at a distance, or by coefficients.
_BY_COLOR = ("color", "distance")
_BY_COEFFICIENTS = ("absorption",)
_OF_PRESET = ("scattering", "anisotropy", "phase", "emission")


def apply(document: Document, action: Action) -> Document:
    """Apply an action to a document.

    Raises
    ------
    InputError
        If there is no such field or preset, or a value is out of its range; the document is as it was.
    """
    match action:
        case SetField():
            return _changed(document, action)
        case Open():
            return _opened(document, action)
        case ChoosePreset():
            return dataclasses.replace(document, material=preset_material(document.material, action.name))
        case Assign():
            return _assigned(document, action)
        case Hide():
            return dataclasses.replace(document, hidden=tuple(sorted(set(action.objects))))
        case Adopt():
            return dataclasses.replace(document, material=action.material)
        case Replace():
            return action.document
        case SetOrbit():
            return dataclasses.replace(document, orbit=action.orbit)
        case _:
            if document.orbit is None:  # nothing is loaded yet, so that there is nothing to move
                return document
            return dataclasses.replace(document, orbit=_moved(document.orbit, action))


def _moved(orbit: Orbit, action: Turn | Pan | Zoom) -> Orbit:
    match action:
        case Turn():
            return orbiting.turned(orbit, action.right, action.up)
        case Pan():
            return orbiting.panned(orbit, action.right, action.down)
        case Zoom():
            return orbiting.zoomed(orbit, action.factor, (action.right, action.down))


def _changed(document: Document, action: SetField) -> Document:
    section, _, name = action.field.partition(".")
    owner = getattr(document, section, None) if section in document.__dataclass_fields__ else None
    if owner is None or name not in owner.__dataclass_fields__ or action.field == "model.path":
        raise InputError(f"field {action.field!r}", "there is none to change", "use for example material.roughness")
    if isinstance(owner, Material):
        return dataclasses.replace(document, material=changed_material(owner, name, action.value))
    value = checked(action.field, action.value, getattr(owner, name))
    return dataclasses.replace(document, **{section: dataclasses.replace(owner, **{name: value})})


def changed_material(material: Material, name: str, value: Any) -> Material:
    """Material with another value of a field; raises `InputError` if that is out of its range."""
    value = checked(f"material.{name}", value, getattr(material, name))
    values = {name: value}
    if name == "phase":
        values["anisotropy"] = parse_phase(value).mean_cosine if value else 0.0
    elif name == "anisotropy":
        values["phase"] = ""
    return _resourced(dataclasses.replace(material, **values), name)


def _assigned(document: Document, action: Assign) -> Document:
    others = [one for one in document.assigned if one.object != action.object]
    if action.material is not None:
        others.append(Assigned(action.object, action.material))
    return dataclasses.replace(document, assigned=tuple(sorted(others, key=lambda one: one.object)))


def _resourced(material: Material, edited: str) -> Material:
    """Material with its source updated for an edited field."""
    if edited in _BY_COLOR:
        absorption = absorption_of_color(material)
        return dataclasses.replace(material, source="color", preset="", absorption=absorption)
    if edited in _BY_COEFFICIENTS or (edited in _OF_PRESET and material.source == "preset"):
        return _stated(dataclasses.replace(material, source="coefficients", preset=""))
    if material.source == "file" and edited != "source":
        return dataclasses.replace(material, source="coefficients")
    return material


def absorption_of_color(material: Material) -> tuple[float, float, float]:
    """Absorption in 1/m of a color at a distance."""
    from translucent.media.conversion import extinction_from_colors

    absorption = extinction_from_colors(material.color, material.distance)
    if not (absorption <= MAX_COEFFICIENT).all():
        raise InputError(
            f"distance {material.distance:g} m", "so short that the extinction overflows", "check the unit"
        )
    red, green, blue = absorption.tolist()
    return red, green, blue


def _opened(document: Document, action: Open) -> Document:
    model = Model(action.path, checked("model.unit", action.unit, "m"))
    material = document.material
    # A glTF file shows its own media; on a mesh, which has none, a material of the user's own stays.
    if Path(action.path).suffix.lower() in SUFFIXES or material.source == "file":
        material = Material()
    return dataclasses.replace(document, model=model, material=material, orbit=None, assigned=(), hidden=())


def preset_material(material: Material, name: str) -> Material:
    """Material with the medium of a preset; polished, if it was rough as another preset's surfaces are."""
    found = preset(name)
    medium = found.medium
    kept = 0.0 if material.source == "preset" else material.roughness
    filled = dataclasses.replace(
        material,
        source="preset",
        preset=found.name,
        absorption=tuple(found.absorption.tolist()),
        scattering=tuple(found.scattering.tolist()),
        emission=tuple(np.asarray(medium.emission).tolist()),
        anisotropy=float(medium.anisotropy),
        phase=str(medium.phase or ""),
        ior=float(medium.ior),
        roughness=found.roughness or kept,
    )
    return _stated(filled)


def _stated(material: Material) -> Material:
    """Material with the color at a distance of its coefficients, as ``translucent extinction`` states it."""
    medium = Medium(material.absorption, material.scattering)
    color, distance = color_at(medium, None if medium.extinction.any() else 1.0)
    red, green, blue = np.asarray(color).tolist()
    return dataclasses.replace(material, color=(red, green, blue), distance=float(distance))


#: Largest number of steps that can be undone.
MAX_STEPS = 200


@dataclass(frozen=True)
class History:
    """History of a document: its past and undone states.

    Attributes
    ----------
    present : Document
    past, future : tuple of Document
        The last of `past` is what undo shows, the last of `future` what redo shows.
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
        if isinstance(action, (*CAMERA_ACTIONS, Adopt)):
            return dataclasses.replace(self, present=after)
        if after == self.present:
            return self
        drag = None
        if isinstance(action, (SetField, Assign)) and action.drag is not None:
            drag = action.field if isinstance(action, SetField) else f"object {action.object}", action.drag
        if drag is not None and drag == self.drag:
            return dataclasses.replace(self, present=after, future=())
        return History(after, (*self.past, self.present)[-MAX_STEPS:], (), drag)

    def undone(self) -> History:
        """History one step back; the camera stays, unless the model is another."""
        if not self.past:
            return self
        before = _seen_as(self.present, self.past[-1])
        return History(before, self.past[:-1], (*self.future, self.present))

    def redone(self) -> History:
        """History one step forward."""
        if not self.future:
            return self
        after = _seen_as(self.present, self.future[-1])
        return History(after, (*self.past, self.present), self.future[:-1])


def _seen_as(present: Document, other: Document) -> Document:
    return dataclasses.replace(other, orbit=present.orbit) if other.model == present.model else other
