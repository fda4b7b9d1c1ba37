"""Document of the previewer, one immutable value: it can be compared, undone and written to a file, without a
window.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from translucent.errors import InputError
from translucent.formulas.tone import TONES
from translucent.media.medium import MAX_COEFFICIENT, MAX_EMISSION, MAX_IOR
from translucent.planning.methods import METHODS
from translucent.planning.scattering import SCATTERINGS
from translucent.scene.camera import MAX_COORDINATE
from translucent.scene.environment import MAX_EXPOSURE
from translucent.scene.lights import MAX_RADIANCE
from translucent.scene.showcase import DEFAULT_COLOR
from translucent.scene.stages import NO_STAGE, STAGES
from translucent.scene.surface import MAX_DISPERSION, MAX_FILM
from translucent.units import METRES_PER_UNIT

Triple = tuple[float, float, float]
Source = Literal["file", "color", "preset", "coefficients"]
Mode = Literal["picture", "thickness", "transmittance", "validity"]
Compare = Literal["off", "method", "reference", "error"]

#: Name of the method, of the way of scattering, of the stage and of the tone curve that leaves the choice to what
#: ``translucent render`` picks.
AUTO = "auto"

#: Names of stages.
STAGE_WORDS = (AUTO, NO_STAGE, *STAGES)

#: Units of length that panels offer.
SHOWN_UNITS = ("mm", "cm", "m", "in")

#: Fields of a material that its surface has, too.
FINISH = (
    "roughness",
    "transmission",
    "dispersion",
    "iridescence",
    "iridescence_ior",
    "iridescence_thickness",
    "clearcoat",
    "clearcoat_roughness",
)

#: Largest elevation of a camera: closer to the poles, "up" would lose its meaning.
MAX_PITCH = 89.9


@dataclass(frozen=True)
class Model:
    """Model: a file, or one of the toolkit's own meshes by name, with the unit of its coordinates."""

    path: str = "goblet"
    unit: str = "m"


@dataclass(frozen=True)
class Material:
    """Material: the medium in the bodies, and their interface. Names of glTF where it has one.

    Attributes
    ----------
    source : {"file", "color", "preset", "coefficients"}
        Where absorption comes from: the model itself, `color` at `distance`, or `absorption` (of a preset, or edited).
    color : tuple of 3 floats
        attenuationColor, linear Rec.709.
    distance : float
        attenuationDistance in metres.
    preset : str
        Name of the preset that the coefficients come from, or nothing.
    absorption, scattering : tuple of 3 floats
        1/m.
    emission : tuple of 3 floats
        Radiance per metre.
    anisotropy : float
        Henyey-Greenstein g.
    ior, roughness, transmission, dispersion : float
    iridescence, iridescence_ior, iridescence_thickness : float
        Of a thin film on the surface; its thickness in metres.
    clearcoat, clearcoat_roughness : float
    thickness : float
        thicknessFactor in metres, written to files and taken by thin layers.
    """

    source: Source = "file"
    color: Triple = DEFAULT_COLOR
    distance: float = 0.02
    preset: str = ""
    absorption: Triple = (0.0, 0.0, 0.0)
    scattering: Triple = (0.0, 0.0, 0.0)
    emission: Triple = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0
    ior: float = 1.0
    roughness: float = 0.0
    transmission: float = 1.0
    dispersion: float = 0.0
    iridescence: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: float = 400e-9
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    thickness: float = 0.001

    @property
    def finish(self) -> dict[str, float]:
        """Values of its surface, by the names of `Surface`."""
        return {name: getattr(self, name) for name in FINISH}

    @property
    def unsaid(self) -> list[str]:
        """Parts of the finish that neither presets nor options of the command line hold."""
        parts = ("transmission", "dispersion", "iridescence", "clearcoat")
        return [name for name in parts if getattr(self, name) != getattr(Material, name)]


@dataclass(frozen=True)
class Assigned:
    """Material of one object alone.

    Attributes
    ----------
    object : int
        Its number in the model.
    material : Material
    """

    object: int
    material: Material


@dataclass(frozen=True)
class Look:
    """Look: stage, lights, background, exposure and tone curve.

    Attributes
    ----------
    stage : str
        What the model stands on and before: ``auto``, ``none``, or a name of `STAGES`.
    environment, background : str
        As ``translucent render`` takes them; no background: the environment itself. No environment: the scene's own.
    rotation : float
        Of the environment about +Y, in degrees; of a stage, with its lights.
    exposure : float
        Stops.
    tone : {"auto", "none", "neutral", "agx"}
        By itself neutral on a stage, else none.
    light : bool
        A directional light besides, from `light_yaw` and `light_pitch` (degrees) with `light_irradiance` (W/m^2).
    """

    stage: str = NO_STAGE
    environment: str = ""
    background: str = ""
    rotation: float = 0.0
    exposure: float = 0.0
    tone: str = AUTO
    light: bool = False
    light_yaw: float = 45.0
    light_pitch: float = 45.0
    light_irradiance: float = 3.0


@dataclass(frozen=True)
class Display:
    """Display: the quantity that the viewport shows, and the method that finds it.

    Attributes
    ----------
    method, method_b : str
        Names of methods, or ``auto``: the planner's choice.
    scattering : str
        How light that is scattered many times is shown: ``auto``, or a name of `SCATTERINGS`.
    mode : {"picture", "thickness", "transmittance", "validity"}
    compare : {"off", "method", "reference", "error"}
        What is right of the split: nothing, `method_b`, the float64 reference, or the signed error against it.
    split : float
        Position of the split, 0 to 1 from the left.
    inset : bool
        Show the reference in a corner while the view is still.
    antialias : bool
        Refine the edges while the view is still.
    converge : bool
        Path trace the picture while the view is still.
    caustics : bool
        Add the light of photons from lamps to the picture while the view is still.
    unit : str
        In which lengths are shown.
    """

    method: str = AUTO
    method_b: str = "thin-layer"
    scattering: str = AUTO
    mode: Mode = "picture"
    compare: Compare = "off"
    split: float = 0.5
    inset: bool = False
    antialias: bool = True
    converge: bool = False
    caustics: bool = False
    unit: str = "mm"

    @property
    def converges(self) -> bool:
        """True if a still picture is path traced: there is one, and nothing beside it."""
        return self.converge and self.mode == "picture" and self.compare == "off"

    @property
    def follows_photons(self) -> bool:
        """True if photons light a still picture: one alone that is not path traced."""
        return self.caustics and self.mode == "picture" and self.compare == "off" and not self.converge

    @property
    def pictured(self) -> bool:
        """True if pictures are on show, and neither quantities nor the reference, which are of the model alone."""
        return self.mode == "picture" and self.compare in ("off", "method")


@dataclass(frozen=True)
class Orbit:
    """Orbit: a camera around a target.

    Attributes
    ----------
    target : tuple of 3 floats
        In metres.
    yaw, pitch : float
        Where the camera is, as seen from the target, in degrees: yaw about +Y, 0 on +Z, 90 on +X; pitch upwards.
    distance : float
        From the target, in metres.
    fov_y : float
        Vertical angle of view in degrees.
    orthographic : bool
        The same height at the target, without perspective.
    """

    target: Triple = (0.0, 0.0, 0.0)
    yaw: float = 24.0
    pitch: float = 18.0
    distance: float = 1.0
    fov_y: float = 30.0
    orthographic: bool = False


@dataclass(frozen=True)
class Document:
    """Document: everything that a session holds. No orbit: the model is to be framed.

    Bodies have the material, except those that are assigned one of their own. Objects are told by their numbers in
    the model, `hidden` ones too.
    """

    model: Model = field(default_factory=Model)
    material: Material = field(default_factory=Material)
    look: Look = field(default_factory=Look)
    display: Display = field(default_factory=Display)
    orbit: Orbit | None = None
    assigned: tuple[Assigned, ...] = ()
    hidden: tuple[int, ...] = ()

    def shown_among(self, count: int) -> tuple[int, ...]:
        """Numbers of the objects on show of a model with so many."""
        return tuple(number for number in range(count) if number not in self.hidden)

    def own_material(self, number: int | None) -> Material | None:
        """Material that is assigned to an object, if any."""
        return next((one.material for one in self.assigned if one.object == number), None)


@dataclass(frozen=True)
class _Range:
    """Range of a field: numbers between bounds, or one of some words."""

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    words: tuple[str, ...] = ()


#: Methods of pictures that move: those of random paths are seen by `Display.converge`.
METHOD_NAMES = (AUTO, *(name for name, method in METHODS.items() if not method.follows_paths))
_POSITIVE = _Range(0.0, 1e12, above=True)

#: Ranges of fields that cannot hold every value of their type, by section and name.
RANGES: dict[str, _Range] = {
    "model.unit": _Range(words=tuple(METRES_PER_UNIT)),
    "material.source": _Range(words=get_args(Source)),
    "material.color": _Range(0.0, 1.0, above=True),
    "material.distance": _POSITIVE,
    "material.absorption": _Range(0.0, MAX_COEFFICIENT),
    "material.scattering": _Range(0.0, MAX_COEFFICIENT),
    "material.emission": _Range(0.0, MAX_EMISSION),
    "material.anisotropy": _Range(-0.999, 0.999),
    "material.ior": _Range(1.0, MAX_IOR),
    "material.roughness": _Range(0.0, 1.0),
    "material.transmission": _Range(0.0, 1.0),
    "material.dispersion": _Range(0.0, MAX_DISPERSION),
    "material.iridescence": _Range(0.0, 1.0),
    "material.iridescence_ior": _Range(1.0, MAX_IOR),
    "material.iridescence_thickness": _Range(0.0, MAX_FILM),
    "material.clearcoat": _Range(0.0, 1.0),
    "material.clearcoat_roughness": _Range(0.0, 1.0),
    "material.thickness": _POSITIVE,
    "look.stage": _Range(words=STAGE_WORDS),
    "look.rotation": _Range(-1e6, 1e6),
    "look.exposure": _Range(-MAX_EXPOSURE, MAX_EXPOSURE),
    "look.tone": _Range(words=(AUTO, *TONES)),
    "look.light_yaw": _Range(-1e6, 1e6),
    "look.light_pitch": _Range(-MAX_PITCH, MAX_PITCH),
    "look.light_irradiance": _Range(0.0, MAX_RADIANCE),
    "display.method": _Range(words=METHOD_NAMES),
    "display.method_b": _Range(words=METHOD_NAMES),
    "display.scattering": _Range(words=(AUTO, *SCATTERINGS)),
    "display.mode": _Range(words=get_args(Mode)),
    "display.compare": _Range(words=get_args(Compare)),
    "display.split": _Range(0.0, 1.0),
    "display.unit": _Range(words=SHOWN_UNITS),
    "orbit.target": _Range(-MAX_COORDINATE, MAX_COORDINATE),
    "orbit.yaw": _Range(-1e6, 1e6),
    "orbit.pitch": _Range(-MAX_PITCH, MAX_PITCH),
    "orbit.distance": _Range(0.0, MAX_COORDINATE, above=True),
    "orbit.fov_y": _Range(1.0, 150.0),
}


def checked(name: str, value: Any, like: Any) -> Any:
    """Check a value, converted to the type of `like`, if the field `name` (``material.roughness``) may hold it.

    Raises
    ------
    InputError
        If it may not.
    """
    range_ = RANGES.get(name, _Range())
    if isinstance(like, bool) or isinstance(value, bool):
        if not (isinstance(like, bool) and isinstance(value, bool)):
            raise InputError(f"{name} = {value!r}", "of the wrong type", f"give for example {like!r}")
        return value
    if isinstance(like, str):
        if not isinstance(value, str) or (range_.words and value not in range_.words):
            raise InputError(f"{name} = {value!r}", "not one of its words", f"use {', '.join(range_.words) or 'text'}")
        return value
    if isinstance(like, tuple):
        if not isinstance(value, tuple | list) or len(value) != 3:
            raise InputError(f"{name} = {value!r}", "not three numbers", "give for example [0.2, 0.6, 0.4]")
        return tuple(_number(name, one, range_) for one in value)
    return _number(name, value, range_)


def _number(name: str, value: Any, range_: _Range) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name} = {value!r}", "not a finite number", "give a number")
    if not range_.low <= value <= range_.high or (range_.above and value == range_.low):
        least = f"above {range_.low:g}" if range_.above else f"at least {range_.low:g}"
        raise InputError(f"{name} = {value:g}", "out of its range", f"give {least} and at most {range_.high:g}")
    return float(value)
