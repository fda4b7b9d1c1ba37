"""Document of the previewer, one immutable value that can be compared, undone and written to a file: model, material,
look, display and camera; with ranges and explanations of its fields. No window.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.formulas.tone import TONES
from translucent.media.medium import MAX_COEFFICIENT, MAX_EMISSION, MAX_IOR, Medium
from translucent.media.preset import PatternName
from translucent.planning.flags import Flags
from translucent.planning.methods import METHODS
from translucent.planning.scattering import SCATTERINGS
from translucent.scene.camera import MAX_COORDINATE, Camera, Lens, direction_from, framing_directions
from translucent.scene.environment import MAX_EXPOSURE
from translucent.scene.lights import MAX_RADIANCE
from translucent.scene.scene import Object
from translucent.scene.showcase import DEFAULT_COLOR, framing
from translucent.scene.stages import NO_STAGE, STAGES, farthest_vertices
from translucent.scene.surface import MAX_DISPERSION, MAX_FILM, Surface
from translucent.units import metres_per_unit

Triple = tuple[float, float, float]
Source = Literal["file", "color", "preset", "coefficients"]
Mode = Literal["picture", "thickness", "transmittance", "validity"]
Compare = Literal["off", "method", "snapshot", "reference", "error"]
Up = Literal["y", "z"]

#: Name of the method, scattering, stage and tone curve that leaves the choice to ``translucent render``.
AUTO = "auto"

#: Names of stages.
STAGE_WORDS = (AUTO, NO_STAGE, *STAGES)

#: Names of snapshots, by their keys.
SNAPSHOTS = tuple("123456789")

#: Units of length that panels offer.
SHOWN_UNITS = ("mm", "cm", "m", "in")

#: Largest elevation of a camera: closer to the poles, "up" would lose its meaning.
MAX_PITCH = 89.9


#: Methods of pictures that move: random paths are seen by `Display.converge`.
METHOD_NAMES = (AUTO, *(name for name, method in METHODS.items() if not method.follows_paths))

#: Largest width and height of exported pictures in pixels.
MOST_PIXELS = 16384.0

#: Largest length of a material in metres, and latest time of an animation in seconds.
_LONGEST, _LATEST = 1e12, 1e6


@dataclass(frozen=True)
class FieldRange:
    """Range of a field: numbers between bounds, or one of some words."""

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    words: tuple[str, ...] = ()


def ranged(default: Any, low: float, high: float, *, above: bool = False) -> Any:
    """Field of numbers between two bounds; `above` leaves out the lower one."""
    return field(default=default, metadata={"range": FieldRange(low, high, above)})


def one_of(default: str, words: Iterable[str]) -> Any:
    """Field of one of some words."""
    return field(default=default, metadata={"range": FieldRange(words=tuple(words))})


@dataclass(frozen=True)
class Model:
    """Model: a file, or one of the toolkit's own meshes by name.

    Attributes
    ----------
    path : str
    unit : str
        Unit of its coordinates, as ``mm`` or ``25mm``, which is its scale, too.
    up : {"y", "z"}
        Axis of its coordinates that points upwards.
    time : float, optional
        Seconds on the clock of its animations; None: as the file's nodes, skins and morph targets are written.
    """

    path: str = "goblet"
    unit: str = "m"
    up: Up = one_of("y", get_args(Up))
    time: float | None = field(default=None, metadata={"range": FieldRange(0.0, _LATEST)})


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
        Mean cosine g, by the phase function of Henyey and Greenstein where no other is given.
    phase : str
        Another phase function, as `parse_phase` reads it, or nothing.
    ior, roughness, transmission, dispersion : float
    iridescence, iridescence_ior, iridescence_thickness : float
        Of a thin film on the surface; its thickness in metres.
    clearcoat, clearcoat_roughness : float
    thickness : float
        thicknessFactor in metres, written to files and taken by thin layers.
    color_texture, roughness_texture : str
        Files of pictures that multiply the tint of the surface (baseColorTexture) and its roughness
        (metallicRoughnessTexture, G), over the texture coordinates of the mesh; or nothing: those of the model.
    pattern : {"", "veins", "bubbles", "blotches"}
        On surfaces without textures; see `translucent.scene.patterns`.
    """

    source: Source = one_of("file", get_args(Source))
    color: Triple = ranged(DEFAULT_COLOR, 0.0, 1.0, above=True)
    distance: float = ranged(0.02, 0.0, _LONGEST, above=True)
    preset: str = ""
    absorption: Triple = ranged((0.0, 0.0, 0.0), 0.0, MAX_COEFFICIENT)
    scattering: Triple = ranged((0.0, 0.0, 0.0), 0.0, MAX_COEFFICIENT)
    emission: Triple = ranged((0.0, 0.0, 0.0), 0.0, MAX_EMISSION)
    anisotropy: float = ranged(0.0, -0.999, 0.999)
    phase: str = ""
    ior: float = ranged(1.0, 1.0, MAX_IOR)
    roughness: float = ranged(0.0, 0.0, 1.0)
    transmission: float = ranged(1.0, 0.0, 1.0)
    dispersion: float = ranged(0.0, 0.0, MAX_DISPERSION)
    iridescence: float = ranged(0.0, 0.0, 1.0)
    iridescence_ior: float = ranged(1.3, 1.0, MAX_IOR)
    iridescence_thickness: float = ranged(400e-9, 0.0, MAX_FILM)
    clearcoat: float = ranged(0.0, 0.0, 1.0)
    clearcoat_roughness: float = ranged(0.0, 0.0, 1.0)
    thickness: float = ranged(0.001, 0.0, _LONGEST, above=True)
    color_texture: str = ""
    roughness_texture: str = ""
    pattern: PatternName = one_of("", get_args(PatternName))

    @property
    def surface_values(self) -> dict[str, float]:
        """Parameters of its surface, by their names in `Surface`."""
        return {name: getattr(self, name) for name in SURFACE_FIELDS}

    @property
    def unsaid(self) -> list[str]:
        """Parameters of the surface that neither presets nor options of the command line state."""
        parts = ("transmission", "dispersion", "iridescence", "clearcoat")
        return [name for name in parts if getattr(self, name) != getattr(Material, name)]


#: Fields of a material that its surface has, too; color and ior are those of its medium.
SURFACE_FIELDS = tuple(
    name
    for name in Material.__dataclass_fields__
    if name in Surface.__dataclass_fields__.keys() - {"color", "ior", "color_texture", "roughness_texture"}
)


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
class Placed:
    """Place of one object: scaled, then rotated about the middle of its box, then moved.

    Attributes
    ----------
    object : int
        Its number in the model.
    location : tuple of 3 floats
        Metres from where the model has it.
    rotation : tuple of 3 floats
        Degrees about X, then Y, then Z of the world.
    scale : tuple of 3 floats
        Along X, Y and Z of the world.
    """

    object: int = 0
    location: Triple = ranged((0.0, 0.0, 0.0), -_LONGEST, _LONGEST)
    rotation: Triple = ranged((0.0, 0.0, 0.0), -1e6, 1e6)
    scale: Triple = ranged((1.0, 1.0, 1.0), 1e-6, 1e6)


@dataclass(frozen=True)
class AddedLight:
    """Light that the user has added: a sphere that shines, or a point.

    Attributes
    ----------
    position : tuple of 3 floats
        In metres.
    radius : float
        Of the sphere in metres; 0: a point, whose shadows are sharp.
    intensity : float
        Radiant intensity in W/sr.
    color : tuple of 3 floats
        Linear Rec.709, which multiplies it.
    """

    position: Triple = ranged((0.0, 0.0, 0.0), -MAX_COORDINATE, MAX_COORDINATE)
    radius: float = ranged(0.0, 0.0, _LONGEST)
    intensity: float = ranged(1.0, 0.0, MAX_RADIANCE)
    color: Triple = ranged((1.0, 1.0, 1.0), 0.0, 1.0)


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
    depth_of_field : bool
        A still picture is through a lens of the diameter `aperture`, in metres, and in focus in the plane that is
        `focus` metres before the target.
    light : bool
        A directional light besides, from `light_yaw` and `light_pitch` (degrees) with `light_irradiance` (W/m^2).
    """

    stage: str = one_of(NO_STAGE, STAGE_WORDS)
    environment: str = ""
    background: str = ""
    rotation: float = ranged(0.0, -1e6, 1e6)
    exposure: float = ranged(0.0, -MAX_EXPOSURE, MAX_EXPOSURE)
    tone: str = one_of(AUTO, (AUTO, *TONES))
    depth_of_field: bool = False
    aperture: float = ranged(0.01, 0.0, _LONGEST, above=True)
    focus: float = ranged(0.0, -_LONGEST, _LONGEST)
    light: bool = False
    light_yaw: float = ranged(45.0, -1e6, 1e6)
    light_pitch: float = ranged(45.0, -MAX_PITCH, MAX_PITCH)
    light_irradiance: float = ranged(3.0, 0.0, MAX_RADIANCE)


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
    compare : {"off", "method", "snapshot", "reference", "error"}
        What is right of the split: nothing, `method_b`, `snapshot`, the float64 reference, or the signed error against
        it.
    snapshot : str
        Name of the snapshot to compare with.
    split : float
        Position of the split, 0 to 1 from the left.
    inset : bool
        Show the reference in a corner while the view is still.
    antialias : bool
        Refine the edges while the view is still.
    converge : bool
        Path trace the picture while the view is still.
    denoise : bool
        Take the noise of these paths out of the picture.
    caustics : bool
        Add the light of photons from the lights to the picture while the view is still.
    ruler : bool
        Draw a ruler on the ground, and a coin or a hand beside it.
    unit : str
        In which lengths are shown.
    """

    method: str = one_of(AUTO, METHOD_NAMES)
    method_b: str = one_of("thin-layer", METHOD_NAMES)
    scattering: str = one_of(AUTO, (AUTO, *SCATTERINGS))
    mode: Mode = one_of("picture", get_args(Mode))
    compare: Compare = one_of("off", get_args(Compare))
    snapshot: str = ""
    split: float = ranged(0.5, 0.0, 1.0)
    inset: bool = False
    antialias: bool = True
    converge: bool = False
    denoise: bool = False
    caustics: bool = False
    ruler: bool = False
    unit: str = one_of("mm", SHOWN_UNITS)

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
        return self.mode == "picture" and self.compare in ("off", "method", "snapshot")


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

    target: Triple = ranged((0.0, 0.0, 0.0), -MAX_COORDINATE, MAX_COORDINATE)
    yaw: float = ranged(24.0, -1e6, 1e6)
    pitch: float = ranged(18.0, -MAX_PITCH, MAX_PITCH)
    distance: float = ranged(1.0, 0.0, MAX_COORDINATE, above=True)
    fov_y: float = ranged(30.0, 1.0, 150.0)
    orthographic: bool = False


@dataclass(frozen=True)
class Export:
    """Options of files with pictures.

    Attributes
    ----------
    width, height : float, optional
        In pixels; None: as the viewport, or after its shape.
    samples : float
        Of a pixel.
    pictures : float
        Of a turntable.
    transparent : bool
        Whether the bodies are alone, over nothing.
    denoise : bool
        Whether noise is taken out: of rough interfaces, and of paths.
    """

    width: float | None = ranged(None, 1.0, MOST_PIXELS)
    height: float | None = ranged(None, 1.0, MOST_PIXELS)
    samples: float = ranged(16.0, 1.0, 4096.0)
    pictures: float = ranged(36.0, 2.0, 1000.0)
    transparent: bool = False
    denoise: bool = False

    def size(self, viewport: tuple[int, int]) -> tuple[int, int]:
        """Width and height in pixels; with one of them, the other follows the viewport's shape."""
        across, down = viewport
        if self.width is None and self.height is None:
            return viewport
        width = self.width or (self.height or 0.0) * across / down
        height = self.height or (self.width or 0.0) * down / across
        return max(round(width), 1), max(round(height), 1)


@dataclass(frozen=True)
class Snapshot:
    """Kept state of a document, to compare with and to go back to.

    Attributes
    ----------
    name : str
    document : Document
        Without snapshots.
    """

    name: str
    document: Document


@dataclass(frozen=True)
class Document:
    """Document: everything that a session holds. Without an orbit, the model is to be framed.

    Bodies have the material, unless they are assigned one of their own. Objects are identified by their numbers in the
    model, `hidden` ones too.
    """

    model: Model = field(default_factory=Model)
    material: Material = field(default_factory=Material)
    look: Look = field(default_factory=Look)
    display: Display = field(default_factory=Display)
    flags: Flags = field(default_factory=Flags)
    orbit: Orbit | None = None
    assigned: tuple[Assigned, ...] = ()
    hidden: tuple[int, ...] = ()
    placed: tuple[Placed, ...] = ()
    lights: tuple[AddedLight, ...] = ()
    snapshots: tuple[Snapshot, ...] = ()
    export: Export = field(default_factory=Export)

    def shown_among(self, count: int) -> tuple[int, ...]:
        """Numbers of the objects on show of a model with so many."""
        return tuple(number for number in range(count) if number not in self.hidden)

    def own_material(self, number: int | None) -> Material | None:
        """Material that is assigned to an object, if any."""
        return next((one.material for one in self.assigned if one.object == number), None)

    def place_of(self, number: int) -> Placed:
        """Place of an object."""
        return next((one for one in self.placed if one.object == number), Placed(number))

    def snapshot(self, name: str) -> Snapshot | None:
        """Snapshot of a name, if there is one."""
        return next((one for one in self.snapshots if one.name == name), None)

    def seen_as(self, kept: Document) -> Document:
        """Document with what another one shows, from the camera and in the display of this one."""
        if kept.model.path != self.model.path:
            return self
        names = ("material", "look", "assigned", "hidden", "placed", "lights", "flags")
        return dataclasses.replace(self, **{name: getattr(kept, name) for name in names})


#: What has fields, by the names that those begin with.
SECTIONS: dict[str, type[Any]] = {
    "model": Model,
    "material": Material,
    "look": Look,
    "display": Display,
    "orbit": Orbit,
    "export": Export,
    "placed": Placed,
    "light": AddedLight,
}

#: Ranges of fields that cannot hold every value of their type, by section and name.
RANGES: dict[str, FieldRange] = {
    f"{name}.{one.name}": one.metadata["range"]
    for name, section in SECTIONS.items()
    for one in dataclasses.fields(section)
    if one.metadata
}


def checked(name: str, value: Any, like: Any) -> Any:
    """Check a value, converted to the type of `like`, if the field `name` (``material.roughness``) may hold it.

    Raises
    ------
    InputError
        If it may not.
    """
    range_ = RANGES.get(name, FieldRange())
    if like is None:
        return None if value is None else _number(name, value, range_)
    if isinstance(like, bool) or isinstance(value, bool):
        if not (isinstance(like, bool) and isinstance(value, bool)):
            raise InputError(f"{name} = {value!r}", "the value has the wrong type", f"use a value such as {like!r}")
        return value
    if isinstance(like, str):
        if not isinstance(value, str) or (range_.words and value not in range_.words):
            raise InputError(
                f"{name} = {value!r}",
                "the value is not one of the allowed words",
                f"use {', '.join(range_.words) or 'text'}",
            )
        if name == "model.unit":
            metres_per_unit(value)
        return value
    if isinstance(like, tuple):
        if not isinstance(value, tuple | list) or len(value) != 3:
            raise InputError(
                f"{name} = {value!r}", "the value must be three numbers", "use a value such as [0.2, 0.6, 0.4]"
            )
        return tuple(_number(name, one, range_) for one in value)
    return _number(name, value, range_)


def _number(name: str, value: Any, range_: FieldRange) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name} = {value!r}", "the value must be a finite number", "use a finite number")
    if not range_.low <= value <= range_.high or (range_.above and value == range_.low):
        least = f"above {range_.low:g}" if range_.above else f"at least {range_.low:g}"
        raise InputError(
            f"{name} = {value:g}", "the value is outside its range", f"use a value {least} and at most {range_.high:g}"
        )
    return float(value)


#: Factor by which an orthographic camera stands farther back, so that a model around the target is before it.
_STEP_BACK = 4.0

#: Smallest and largest distance of zooming, in metres.
_NEAREST, _FARTHEST = 1e-9, 1e12


def lens_of(look: Look, orbit: Orbit) -> Lens | None:
    """Lens of a picture, if there is one."""
    if not look.depth_of_field or orbit.orthographic:
        return None
    return Lens(look.aperture, max(orbit.distance - look.focus, 1e-3 * orbit.distance))


def camera_of(orbit: Orbit) -> Camera:
    """Camera of an orbit."""
    target, offset = np.asarray(orbit.target), orbit.distance * direction_from(orbit.yaw, orbit.pitch)
    if orbit.orthographic:
        return Camera.orthographic(target + _STEP_BACK * offset, target, height=height_at_target(orbit))
    return Camera.look_at(target + offset, target, fov_y=orbit.fov_y)


def height_at_target(orbit: Orbit) -> float:
    """Height of the picture at the target in metres."""
    return 2.0 * orbit.distance * math.tan(math.radians(orbit.fov_y) / 2)


def turned(orbit: Orbit, right: float, up: float) -> Orbit:
    """Turn the camera to the right and upwards around the target, by degrees."""
    pitch = min(max(orbit.pitch + up, -MAX_PITCH), MAX_PITCH)
    return dataclasses.replace(orbit, yaw=math.remainder(orbit.yaw + right, 360.0), pitch=pitch)


def panned(orbit: Orbit, right: float, down: float) -> Orbit:
    """Pan the picture to the right and down, by fractions of its height."""
    camera = camera_of(orbit)
    step = height_at_target(orbit) * (down * camera.up - right * camera.right)
    target = np.clip(np.asarray(orbit.target) + step, -MAX_COORDINATE, MAX_COORDINATE)
    return dataclasses.replace(orbit, target=tuple(target.tolist()))


def resized(orbit: Orbit, factor: float) -> Orbit:
    """Orbit that sees a model of so many times the size as before."""
    target = np.clip(factor * np.asarray(orbit.target), -MAX_COORDINATE, MAX_COORDINATE)
    distance = min(max(factor * orbit.distance, _NEAREST), _FARTHEST)
    return dataclasses.replace(orbit, target=tuple(target.tolist()), distance=distance)


def zoomed(orbit: Orbit, factor: float, at: tuple[float, float] = (0.0, 0.0)) -> Orbit:
    """Zoom by a factor around the point `at` of the target's plane (heights right and down of the center)."""
    distance = min(max(orbit.distance / factor, _NEAREST), _FARTHEST)
    camera = camera_of(orbit)
    shift = height_at_target(orbit) * (1.0 - distance / orbit.distance)
    target = np.asarray(orbit.target) + shift * (at[0] * camera.right - at[1] * camera.up)
    target = np.clip(target, -MAX_COORDINATE, MAX_COORDINATE)
    return dataclasses.replace(orbit, target=tuple(target.tolist()), distance=distance)


def framed(orbit: Orbit | None, objects: Sequence[Object], size: tuple[int, int]) -> Orbit:
    """Orbit that frames all of the objects, from the same side as before."""
    side = orbit or Orbit(yaw=math.degrees(math.atan2(0.45, 1.0)), pitch=math.degrees(math.atan2(0.35, 1.097)))
    if orbit is None:
        camera = framing(objects, size, fov_y=side.fov_y)  # as translucent render frames it
    else:
        direction = -direction_from(side.yaw, side.pitch)
        corners = farthest_vertices(objects, framing_directions(size, direction, side.fov_y))
        camera = Camera.framing(corners, size, direction, side.fov_y)
    center = np.mean([item.bounds.mean(axis=0) for item in objects], axis=0)
    return dataclasses.replace(orbit_of(camera, center), orthographic=side.orthographic)


def orbit_of(camera: Camera, center: npt.ArrayLike) -> Orbit:
    """Orbit with the view of a camera, without its roll, around the point of its axis nearest to `center`."""
    axis = -camera.forward
    offset = np.asarray(center, dtype=np.float64) - camera.eye
    distance = max(float(offset @ camera.forward), 1e-3 * float(np.linalg.norm(offset)), _NEAREST)
    target = camera.eye + distance * camera.forward
    pitch = math.degrees(math.asin(min(max(float(axis[1]), -1.0), 1.0)))
    yaw = math.degrees(math.atan2(axis[0], axis[2]))
    fov = camera.fov_y if camera.fov_y is not None else 30.0
    if camera.height is not None:
        distance = camera.height / (2.0 * math.tan(math.radians(fov) / 2))
    return Orbit(
        tuple(target.tolist()), yaw, min(max(pitch, -MAX_PITCH), MAX_PITCH), distance, fov, camera.fov_y is None
    )


#: Explanations of fields: their units, typical values, and names in glTF.
_EXPLAINED = """
model.unit = Unit of the file's coordinates. glTF is in metres; most .stl are in mm.
model.up = Axis of the file's coordinates that points upwards. glTF has Y; CAD and printing have Z.
model.time = Time of the file's animations in seconds: nodes, skins and morph targets move, and thickness is that of
    the moved meshes.
material.color_texture = baseColorTexture (glTF): a picture (.png, .jpg) over the texture coordinates of the mesh, which
    tints what passes the surface.
material.pattern = Pattern on surfaces without textures: veins of marble, bubbles of air in ice, or blotches of skin.
material.roughness_texture = metallicRoughnessTexture (glTF): a picture; its green multiplies the roughness.
placed.location = How far the object is moved, in metres. Or drag its gizmo (W).
placed.rotation = Degrees about X, then Y, then Z, around its middle. Or drag its gizmo (R).
placed.scale = Factors along X, Y and Z. Media keep their lengths. Or drag its gizmo (S).
light.position = Position of the light in metres. Or drag its gizmo.
light.radius = Radius of the sphere that shines, in metres: larger ones throw softer shadows. 0: a point.
light.intensity = Radiant intensity in W/sr (intensity of KHR_lights_punctual, cd there): at 1 m it lights as many W/m2.
light.color = Color of the light, linear.
export.width = Width of exported pictures in pixels; empty: as the viewport, or after its shape.
export.height = Height of exported pictures in pixels; empty: as the viewport, or after its shape.
export.samples = Samples of a pixel: more of them make edges and blurred parts smoother. Typical: 16.
export.pictures = Pictures of a turntable.
export.transparent = The bodies alone, over nothing.
export.denoise = Open Image Denoise takes out noise: of rough interfaces, and of paths (the extra denoise).
display.snapshot = Kept state that is seen right of the line. 1 to 9 show snapshots, Shift 1 to 9 keep them.
display.denoise = Open Image Denoise takes the noise out of the paths of a still picture (the extra denoise).
look.depth_of_field = Blur what is off the plane in focus, in a still picture.
look.aperture = Diameter of the lens: larger ones blur more. Typical: a twentieth of the distance of the camera.
look.focus = How far the plane in focus is before the middle of the view (below 0: behind it). Typical: 0.
material.color = attenuationColor (glTF): linear color that is left of white light after attenuationDistance.
    Never black: what is left after the distance is more than nothing.
material.distance = attenuationDistance (glTF): length after which attenuationColor is left. Typical: wine 1 cm,
    honey 2 cm, water 5 m. Twice as long: half the extinction.
material.thickness = thicknessFactor (glTF), in metres: written to files, and the sheet of thin layers. Typical:
    0.001 for a leaf or a bottle's wall. The picture uses the mesh's own thickness.
material.ior = ior (glTF), index of refraction, no unit; 1: light goes straight on. Typical: water 1.33, wine
    1.36, wax 1.44, glass 1.5, crystal 1.55, diamond 2.42.
material.roughness = roughnessFactor (glTF), 0 to 1, no unit: how much the surface blurs what it mirrors and
    lets through. Typical: polished 0, soap 0.3, frosted glass 0.4, wax 0.35.
material.transmission = transmissionFactor (glTF), 0 to 1: share of the light that is not mirrored which enters.
    Typical: 1; the rest is an opaque, diffuse base.
material.dispersion = dispersion (glTF), 20 / Abbe number, no unit: how far colors part when they are refracted.
    Typical: crown glass 0.3, flint glass 0.55, diamond 0.36; 0: none.
material.iridescence = iridescenceFactor (glTF), 0 to 1, no unit: share of the surface with a thin film, whose
    interference colors what is mirrored. Typical: 0 none; soap bubbles, oil on water and coated glass 1.
material.iridescence_ior = iridescenceIor (glTF): index of refraction of the film, no unit. Typical: soapy water
    1.33, oxides 2 to 2.7.
material.iridescence_thickness = iridescenceThicknessMaximum (glTF), in nm: thickness of the film, which sets
    its colors. Typical: 100 to 1000; below 50 it darkens what is mirrored, above 2000 its colors fade.
material.clearcoat = clearcoatFactor (glTF), 0 to 1, no unit: share of the surface with a clear coat of ior 1.5,
    which mirrors light from outside. Typical: 0 none; lacquer and glaze 1.
material.clearcoat_roughness = clearcoatRoughnessFactor (glTF), 0 to 1, no unit: how much the coat blurs what it
    mirrors. Typical: fresh lacquer 0, satin 0.3.
material.absorption = sigma_a in 1/m, for red, green and blue: light that is lost. Typical: water 0.3, wine 100.
material.scattering = sigma_s in 1/m (multiscatterColor of glTF's drafts): light that changes direction.
    Typical: clear 0, jade 200, milk 1000 and more.
material.emission = Radiance that the medium adds, per metre of the ray. Typical: 0; a flame 1 to 100.
material.anisotropy = g (scatterAnisotropy of glTF's drafts), -0.99 to 0.99: mean cosine of the angle of
    scattering. Typical: 0 isotropic, 0.8 milk and skin (forward), -0.3 backward.
look.stage = A ground that catches shadows, lights and soft boxes, as --stage of translucent render; auto:
    studio, unless the model brings a camera, lights or a ground, or an environment is chosen. Quantities and
    the reference go without.
look.environment = What lights the model from all directions: a name, a color, or a picture (.hdr, .exr, .png).
look.background = What is seen behind the model; it does not light. Typical: the environment itself.
look.rotation = Turn of the environment about +Y in degrees; of a stage with its lights. Or drag with E held.
look.exposure = Brightness of the picture in stops: 1 is twice as bright. Typical: -2 to 2. Light stays as it
    is.
look.tone = Curve from light to the screen; auto: neutral on a stage, where light sources are brighter than
    white, else none.
look.light = A directional light besides, seen in media that scatter, and on opaque objects. Or drag with L
    held.
look.light_yaw = Direction of the light around the model in degrees: 0 from the front, 90 from +X, 180 from
    behind.
look.light_pitch = Direction of the light above the horizon in degrees. Typical: 30 to 60.
look.light_irradiance = Irradiance of the light in W/m2 (intensity of KHR_lights_punctual, lx there). Typical: 3
    is as bright as white surroundings.
display.method = How thickness is found; auto: the cheapest method that is exact for the scene.
display.method_b = The other method, whose picture is right of the line.
display.scattering = Light scattered many times: it diffuses in the body, leaves as from a flat layer, or is
    left out; auto: what the body needs.
display.mode = Quantity on show: the picture, thickness along the view ray in false colors, transmittance, or
    where numbers can be trusted.
display.compare = What is seen right of the line in the picture: another method, the float64 reference, or the error of
    thickness.
display.split = Position of the split, 0 to 1 from the left. Or drag the line.
display.inset = The float64 reference as a small picture in the corner, while the view is still. It has straight
    rays, diffuse bases and opaque surfaces with their textures, and the holes of leaves; nothing mirrors there, and
    what tints clear glass is left out.
display.antialias = More samples of a pixel while the view is still.
display.converge = Path trace the picture while nothing changes (C): all light, with less noise the longer it
    goes on.
display.caustics = Photons carry light through interfaces onto opaque objects while nothing changes
    (P): --caustics of translucent render, more and more of them. The picture that moves has none, and neither
    has one that converges.
display.ruler = A ruler before the model, on the ground, and a coin (24 mm) or a hand (18 cm) beside it.
display.unit = Unit of the lengths in panels and scales.
orbit.fov_y = Vertical angle of view in degrees (yfov of a glTF camera, there in radians). Typical: 20 to 50.
orbit.orthographic = No perspective (O), as glTF's orthographic cameras: parallel rays, for technical views.
"""

#: The same by field, with typical values on a line of their own.
TIPS = {
    name: " ".join(text.split()).replace(" Typical:", "\nTypical:")
    for name, text in re.findall(r"^(\S+) = (.*(?:\n +.*)*)", _EXPLAINED, re.MULTILINE)
}
TIPS |= {f"flags.{one.name}": one.metadata["help"] for one in dataclasses.fields(Flags)}


def triple_of(values: npt.ArrayLike) -> Triple:
    """Three numbers as a tuple."""
    red, green, blue = np.asarray(values, dtype=np.float64).tolist()
    return red, green, blue


def medium_fields(medium: Medium) -> dict[str, Any]:
    """Fields of a material that state a medium by its coefficients."""
    triples = {name: triple_of(getattr(medium, name)) for name in ("absorption", "scattering", "emission")}
    return {**triples, "anisotropy": float(medium.anisotropy), "phase": str(medium.phase or ""), "ior": medium.ior}


def triple_text(values: npt.ArrayLike) -> str:
    """Text of three numbers, to the digits that ``translucent extinction`` prints."""
    return " ".join(f"{value:.5g}" for value in np.asarray(values, dtype=np.float64).tolist())


def length_text(metres: float, unit: str) -> str:
    """Text of a length in the user's unit, to five digits."""
    return f"{metres / metres_per_unit(unit):.5g} {unit}"
