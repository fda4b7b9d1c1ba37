"""Actions of a user on a document, and the history that undoes them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from translucent.errors import InputError
from translucent.formulas.phase import parse_phase
from translucent.gltf.load import SUFFIXES
from translucent.media.conversion import extinction_from_colors
from translucent.media.medium import MAX_COEFFICIENT, Medium, color_at
from translucent.media.presets import preset
from translucent.preview.document import (
    Assigned,
    Document,
    Material,
    Model,
    Orbit,
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
    """Get closer by a factor, to what is at a position in the picture: heights right of and below its center."""

    factor: float
    right: float = 0.0
    down: float = 0.0


Action = SetField | Open | Resize | ChoosePreset | Assign | Hide | Adopt | Replace | SetOrbit | OrbitBy | Pan | Zoom

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
            return replace(model=model, material=material, orbit=None, assigned=(), hidden=())
        case Resize():
            model = dataclasses.replace(document.model, unit=checked("model.unit", action.unit, "m"))
            factor = metres_per_unit(model.unit) / metres_per_unit(document.model.unit)
            material = dataclasses.replace(document.material, thickness=factor * document.material.thickness)
            return _viewed_alike(replace(model=model, material=material), document)
        case ChoosePreset():
            return replace(material=preset_material(document.material, action.name))
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
        raise InputError(f"field {action.field!r}", "there is none to change", "use for example material.roughness")
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
            found = "so short that the extinction overflows"
            raise InputError(f"distance {material.distance:g} m", found, "check the unit")
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
    return _with_color(dataclasses.replace(material, **stated, roughness=roughness))


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
        if isinstance(action, (SetOrbit, OrbitBy, Pan, Zoom, Adopt)):
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
        before = _with_view_of(self.present, self.past[-1])
        return History(before, self.past[:-1], (*self.future, self.present))

    def redone(self) -> History:
        """History one step forward."""
        if not self.future:
            return self
        after = _with_view_of(self.present, self.future[-1])
        return History(after, (*self.past, self.present), self.future[:-1])


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
