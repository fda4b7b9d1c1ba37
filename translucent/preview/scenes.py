"""Scenes on show: models read from files, on stages, in the light and with the materials of a document."""

from __future__ import annotations

import dataclasses
import math
import os
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.assets import mesh_names, mesh_path
from translucent.errors import InputError
from translucent.formulas.bsdf import brdf_table
from translucent.formulas.color import srgb_to_linear
from translucent.formulas.phase import parse_phase
from translucent.frames.animation import on_stage
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals, drawn_normals, has_drawn_normals, keep_drawn_normals
from translucent.geometry.solids import Box
from translucent.geometry.support import Support
from translucent.gltf.load import SUFFIXES, load_scene
from translucent.media.colors import read_encoded
from translucent.media.medium import Medium, color_at
from translucent.planning.caustics import Caustics
from translucent.planning.methods import Method, method_from_name
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import SCATTERINGS
from translucent.preview.document import (
    AUTO,
    SURFACE_FIELDS,
    AddedLight,
    Assigned,
    Document,
    Look,
    Material,
    Model,
    Orbit,
    Placed,
    Triple,
    camera_of,
    framed,
    medium_fields,
    orbit_of,
    triple_of,
)
from translucent.preview.tasks import Lane, Task
from translucent.preview.worker import Pool, Urgency
from translucent.scene.camera import Camera, direction_from
from translucent.scene.environment import Environment, filtered
from translucent.scene.environment_files import READERS
from translucent.scene.lights import DirectionalLight, PointLight, PositionalLight, SphereLight, SpotLight
from translucent.scene.patterns import patterned, uniform_scale
from translucent.scene.scene import Light, Object, Scene
from translucent.scene.shadow_directions import shadow_directions
from translucent.scene.showcase import (
    DEFAULT_COLOR,
    DEFAULT_REACH,
    LIGHT_TABLE,
    SOLID_IOR,
    AnyScene,
    fillable,
    framing,
    named_environment,
    showcase,
)
from translucent.scene.stages import (
    DEFAULT_STAGE,
    ENVIRONMENT_SHADOWS,
    NO_STAGE,
    STAGED_TONE,
    has_ground,
    stage_named,
    staged,
    view_axes,
)
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture
from translucent.scene_files import ComposedScene, is_composed, load_composed
from translucent.units import metres_per_unit

#: Bytes of a file from which on it is read by a worker process: while a picture is on show, and before. Whatever reads
#: it holds the interpreter's lock now and then, which nobody sees in a window without a picture, and no process need
#: be started for the first one.
LARGE_BESIDE_PICTURE, LARGE_FILE = 1 << 18, 1 << 23

#: Names of the environments that light, and are seen in the background, and of the stage.
Names = tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class Loaded:
    """Loaded model: its scene, and the material that its bodies came with."""

    model: Model
    scene: Scene
    material: Material

    @property
    def bare(self) -> bool:
        """True if the model is a mesh, and no scene of a file."""
        return not hasattr(self.scene, "has_camera")

    @property
    def has_camera(self) -> bool:
        """True if the model brings a camera."""
        return getattr(self.scene, "has_camera", False)

    @property
    def triangles(self) -> int:
        """Number of triangles that are drawn."""
        return sum(len(item.mesh.faces) for item in self.scene.objects)


def load_with(task: Task, pool: Pool, model: Model, allow_outside: bool = False, *, pictured: bool = False) -> Loaded:
    """Load a model here, or if it is large, in a worker process; `pictured` while the window shows another.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    large = LARGE_BESIDE_PICTURE if pictured else LARGE_FILE
    if os.path.isfile(model.path) and os.path.getsize(model.path) > large:
        loaded, normals = pool.call(task, load_with_normals, model, allow_outside, urgency=Urgency.PICTURE)
        for mesh, made in normals:
            keep_drawn_normals(mesh, made)
    else:
        loaded = load(model, allow_outside)
    for item in loaded.scene.objects:
        _ = Support(item.mesh, item.matrix), item.radius  # whose parts are kept: the window's loop would stand still
    return loaded


def load_with_normals(model: Model, allow_outside: bool) -> tuple[Loaded, list[tuple[Mesh, npt.NDArray[np.float32]]]]:
    """Load a model; with the normals that have been made of its meshes."""
    loaded = load(model, allow_outside)
    meshes = dict.fromkeys(item.mesh for item in loaded.scene.objects)
    return loaded, [(mesh, drawn_normals(mesh)) for mesh in meshes if has_drawn_normals(mesh)]


def load(model: Model, allow_outside: bool = False) -> Loaded:
    """Load a model, and compute everything that would delay its first picture.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    from translucent.mesh_files import load_mesh  # with trimesh, which takes long to import

    if is_composed(model.path):
        unit = None if model.unit == "m" else model.unit
        scene: Scene = load_composed(model.path, unit, allow_outside=allow_outside)
    elif Path(model.path).suffix.lower() in SUFFIXES:
        scene = load_scene(model.path, model.unit, allow_outside=allow_outside, time=model.time)
    elif model.path in mesh_names() and not Path(model.path).exists():
        scene = showcase(load_mesh(mesh_path(model.path), model.unit), stage="none")
    else:
        unit = None if model.unit == "m" else model.unit  # what is assumed is said
        scene = showcase(load_mesh(model.path, unit, allow_outside=allow_outside), stage="none")
    if model.up == "z":
        scene = turned_up(scene)
    for item in scene.objects:
        _ = item.mesh.diagnosis, item.bounds  # slow for large meshes, and kept
        if item.has_interface or item.surface is not None:
            drawn_normals(item.mesh)
    return Loaded(model, scene, material_of(scene))


def rescaled(loaded: Loaded, model: Model) -> Loaded:
    """Loaded model by another unit of its coordinates: of its meshes, all that takes time is kept."""
    factor = metres_per_unit(model.unit) / metres_per_unit(loaded.model.unit)
    scene, scale = loaded.scene, np.diag([factor, factor, factor, 1.0])
    media = {id(item.medium): item.medium.diluted(factor) for item in scene.objects if item.medium is not None}
    objects = [
        dataclasses.replace(
            item,
            transform=scale @ item.matrix,
            medium=media.get(id(item.medium)),
            sheet_thickness=None if item.sheet_thickness is None else factor * item.sheet_thickness,
        )
        for item in scene.objects
    ]
    pose = scene.camera.pose.copy()
    pose[:3, 3] *= factor
    height = None if scene.camera.height is None else factor * scene.camera.height
    camera = dataclasses.replace(scene.camera, pose=pose, height=height)
    lights = [_farther(light, factor) for light in scene.lights]
    scene = dataclasses.replace(scene, objects=objects, camera=camera, lights=lights)
    return Loaded(model, scene, material_of(scene))


#: Turns what is upwards in coordinates with Z up into what is upwards with Y up.
_Z_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def turned_up(scene: AnyScene) -> AnyScene:
    """Scene of a model in which Z was upwards."""
    turn = _Z_UP[:3, :3]

    def turned(light: Light) -> Light:
        if isinstance(light, PositionalLight):
            light = dataclasses.replace(light, position=turn @ np.asarray(light.position))
        if isinstance(light, SpotLight | DirectionalLight):
            light = dataclasses.replace(light, direction=turn @ np.asarray(light.direction))
        return light

    objects = [dataclasses.replace(item, transform=_Z_UP @ item.matrix) for item in scene.objects]
    camera = dataclasses.replace(scene.camera, pose=_Z_UP @ scene.camera.pose)
    if not getattr(scene, "has_camera", False):
        camera = framing(objects, (1, 1))
    return dataclasses.replace(scene, objects=objects, camera=camera, lights=[turned(one) for one in scene.lights])


def placement(place: Placed, item: Object) -> Array:
    """(4, 4): what moves an object of the model, about the middle of its box, to its place."""
    middle = item.bounds.mean(axis=0)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix(place.rotation) * np.asarray(place.scale)
    matrix[:3, 3] = middle + np.asarray(place.location) - matrix[:3, :3] @ middle
    return matrix


def rotation_matrix(degrees: Triple) -> Array:
    """(3, 3): rotation by degrees about X, then Y, then Z of the world."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def degrees_of(rotation: Array) -> Triple:
    """Degrees about X, then Y, then Z of a rotation (3, 3), as `rotation_matrix` takes them."""
    x = math.atan2(rotation[2, 1], rotation[2, 2])
    y = math.atan2(-rotation[2, 0], math.hypot(rotation[2, 1], rotation[2, 2]))
    z = math.atan2(rotation[1, 0], rotation[0, 0])
    return math.degrees(x), math.degrees(y), math.degrees(z)


@lru_cache(maxsize=4)
def placed_objects(scene: Scene, placed: tuple[Placed, ...]) -> tuple[Object, ...]:
    """Objects of a model where the user has put them; cached, so that the others stay as one moves."""
    objects = list(scene.objects)
    for place in placed:
        if place.object < len(objects):
            item = objects[place.object]
            objects[place.object] = dataclasses.replace(item, transform=placement(place, item) @ item.matrix)
    return tuple(objects)


@lru_cache(maxsize=16)
def light_of(light: AddedLight) -> PointLight | SphereLight:
    """Light that the user has added; cached, as solutions for scattered light are cached by it."""
    intensity = light.intensity * np.asarray(light.color)
    if light.radius > 0:
        return SphereLight(light.position, intensity, light.radius)
    return PointLight(light.position, intensity)


@lru_cache(maxsize=4)
def picture_texture(path: str, written: int, *, encoded: bool) -> Texture:
    """Texture of a picture file as it was `written`; `encoded`: its colors are sRGB."""
    stored = read_encoded(path, f"texture {path!r}")
    levels = stored / float(np.iinfo(stored.dtype).max)
    return Texture((srgb_to_linear(levels) if encoded else levels).astype(np.float32))


def _texture(path: str, item: Object, *, encoded: bool) -> Texture:
    if item.mesh.uv is None:
        found = f"{item.mesh.name or 'the mesh'} has no texture coordinates"
        raise InputError(f"texture {path!r}", found, "unwrap the mesh in a modeler, or choose no texture")
    written = Path(path).stat().st_mtime_ns if Path(path).is_file() else 0
    return picture_texture(path, written, encoded=encoded)


def _farther(light: Light, factor: float) -> Light:
    """Light that falls alike on objects so many times as large."""
    if not isinstance(light, PositionalLight):
        return light
    position, intensity = factor * np.asarray(light.position), factor**2 * np.asarray(light.intensity)
    if isinstance(light, SphereLight):
        return dataclasses.replace(light, position=position, intensity=intensity, radius=factor * light.radius)
    return dataclasses.replace(light, position=position, intensity=intensity)


@dataclass
class Lighting:
    """Environments and stages prepared in the background, with the last ones on show meanwhile.

    Parameters
    ----------
    lane : Lane

    Attributes
    ----------
    begun : bool
        The first picture is there: it is one without a stage, and waits for none.
    """

    lane: Lane
    begun: bool = False
    _ready: Names = ("", "", NO_STAGE)
    _requested: Names | None = None
    #: Stages whose light is known.
    _made: set[str] = field(default_factory=lambda: {NO_STAGE})

    def lit(self, document: Document, loaded: Loaded) -> Document:
        """Document with the last environments and the last stage in place of its own, if these are not ready."""
        look = document.look
        requested = look.environment, look.background, stage_name(look, loaded)
        files = any(Path(name).suffix.lower() in READERS for name in requested[:2])
        if not files and requested[2] in self._made:
            self._ready, self._requested = requested, None
        elif requested != self._requested and (self.begun or requested[2] == NO_STAGE):
            self._requested = requested
            name = "reading the environment" if requested[2] == NO_STAGE else "setting the stage"
            self.lane.start(name, lambda _: _prepare(requested), lambda _: self._take(requested))
        environment, background, stage = self._ready
        return dataclasses.replace(
            document, look=dataclasses.replace(look, environment=environment, background=background, stage=stage)
        )

    def _take(self, names: Names) -> None:
        self._ready = names
        if not any(names[:2]):
            self._made.add(names[2])


def _prepare(names: Names) -> None:
    """Compute the parts of environments and a stage that take long, and are cached."""
    environment, background, stage_of = names
    for name in filter(None, (environment, background)):
        filtered(environment_of(name))
    if (stage := stage_named(stage_of)) is not None:
        lit = _own_environment(environment, background) or stage.environment()
        filtered(lit)
        shadow_directions(lit, ENVIRONMENT_SHADOWS)


def prepare(_: Task) -> None:
    """Compute the shared data of frames with surfaces or smooth edges before one needs them."""
    corner_normals(Box().tessellate())
    brdf_table()
    for name in ("light-table", "studio"):
        filtered(environment_of(name))


def stage_name(look: Look, loaded: Loaded) -> str:
    """Name of the stage that a look requests; ``auto`` is the choice of ``translucent render`` for the model."""
    if look.stage != AUTO:
        return look.stage
    if isinstance(loaded.scene, ComposedScene) and not (look.environment or look.background):
        return loaded.scene.stage
    own = look.environment or look.background or loaded.scene.lights or loaded.has_camera
    return NO_STAGE if own or has_ground(loaded.scene) else DEFAULT_STAGE


def own_material(look: Look, loaded: Loaded) -> Material:
    """Material that a model comes with: a bare mesh on a stage has an interface, as ``translucent render`` gives it."""
    if not loaded.bare or stage_name(look, loaded) == NO_STAGE:
        return loaded.material
    return dataclasses.replace(loaded.material, ior=SOLID_IOR)


def tone_of(look: Look, scene: Scene) -> str:
    """Tone curve of a picture of the scene."""
    if look.tone != AUTO:
        return look.tone
    return STAGED_TONE if on_stage(scene) else "none"


def environment_of(name: str) -> Environment:
    """Environment of a name, or of a file as it is now; the last ones are cached."""
    path = Path(name)
    return _environment_of(name, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=4)
def _environment_of(name: str, written: int) -> Environment:
    return named_environment(name)


def _own_environment(environment: str, background: str, rotation: float = 0.0) -> Environment | None:
    """Environment by the names of light and background, in place of the stage's; None if both are empty."""
    return _environment(environment, background, rotation, LIGHT_TABLE) if environment or background else None


@lru_cache(maxsize=2)
def _environment(name: str, background: str, rotation: float, default: Environment) -> Environment:
    """Environment of a scene; cached, since its filtered maps are cached with it."""
    lit = environment_of(name) if name else default
    if lit.kind == "image" and rotation:
        lit = dataclasses.replace(lit, rotation=lit.rotation + rotation)
    return lit.with_background(environment_of(background)) if background else lit


def _stage_camera(loaded: Loaded, name: str) -> Camera:
    """Camera that a stage faces: the model's own, or the one that frames it there."""
    scene = loaded.scene
    return scene.camera if loaded.has_camera else framing(scene.objects, (16, 9), stage=stage_named(name))


@lru_cache(maxsize=2)
def _standing(loaded: Loaded, name: str, environment: str, background: str, rotation: float) -> Scene:
    """Loaded scene on a stage; cached, as the ground, the lights and the environment stay while the camera moves."""
    rendered = dataclasses.replace(loaded.scene, camera=_stage_camera(loaded, name))
    return staged(rendered, name, _own_environment(environment, background, rotation), rotation)


def turn_from(document: Document, loaded: Loaded, camera: Camera) -> float:
    """Degrees by which the stage is turned about +Y from where `staged` puts it for a camera."""
    from_, to = (view_axes(one)[2] for one in (camera, _stage_camera(loaded, stage_name(document.look, loaded))))
    turn = math.degrees(math.atan2(to[0], to[2]) - math.atan2(from_[0], from_[2]))
    return math.remainder(turn + document.look.rotation, 360.0)


def first_orbit(loaded: Loaded, size: tuple[int, int], stage: str) -> Orbit:
    """First orbit of a model: of the file's own camera, or from the view of ``translucent render``, framed as by F."""
    scene, rendered = loaded.scene, None
    if loaded.has_camera:
        return orbit_of(scene.camera, scene.bounds.mean(axis=0))
    if stage != NO_STAGE:
        rendered = orbit_of(framing(scene.objects, size, stage=stage_named(stage)), scene.bounds.mean(axis=0))
    return framed(rendered, scene.objects, size)


def material_of(scene: Scene, number: int | None = None) -> Material:
    """Material of an object, by default of the first body; if it is opaque, the one that it would be filled with."""
    diagonal = scene.diagonal or 1.0
    reach, thickness = DEFAULT_REACH * diagonal, 0.1 * diagonal
    body = fillable(scene)[0] if number is None else scene.objects[number]
    medium, surface = body.medium, body.surface or Surface()
    if medium is None or body.covers:
        absorption = triple_of(Medium.from_color(DEFAULT_COLOR, reach).absorption)
        return Material(color=DEFAULT_COLOR, distance=reach, absorption=absorption, thickness=thickness)
    # Where the showcase states it; if that is too dark or too bright, where 1/e is left.
    near = reach if (medium.transmittance(reach) > 1e-3).all() else None
    color, distance = color_at(medium, near)
    return Material(
        color=triple_of(color),
        distance=float(distance) if math.isfinite(distance) else reach,
        **medium_fields(medium),
        **{name: getattr(surface, name) for name in SURFACE_FIELDS},
        thickness=body.sheet_thickness or thickness,
    )


def medium_of(material: Material) -> Medium:
    """Medium of the bodies: for a color at a distance, exactly that of ``translucent extinction``."""
    absorption: object = material.absorption
    if material.source == "color":
        absorption = Medium.from_color(material.color, material.distance).absorption
    phase = parse_phase(material.phase) if material.phase else None
    g = 0.0 if phase else material.anisotropy
    return Medium(absorption, material.scattering, material.emission, g, material.ior, phase)  # type: ignore[arg-type]


def scene_of(document: Document, loaded: Loaded) -> Scene:
    """Scene of a document with an orbit; all objects of a model without bodies are filled.

    Raises
    ------
    InputError
        If the environment cannot be read.
    """
    if document.orbit is None:
        raise InputError(
            "saving a picture", "the window has not shown a view of the model yet", "wait until the model is visible"
        )
    look, scene = document.look, loaded.scene
    objects = _objects(document.material, document.assigned, scene, document.placed)
    objects = tuple(item for number, item in enumerate(objects) if number not in document.hidden)
    if (name := stage_name(look, loaded)) != NO_STAGE and document.display.pictured:
        scene = _standing(loaded, name, look.environment, look.background, look.rotation)
        objects += tuple(item for item in scene.objects if item.shadow_catcher)
        environment = scene.environment
    else:
        environment = _environment(look.environment, look.background, look.rotation, scene.environment)
    lights: list[Light] = [light_of(one) for one in document.lights]
    lights += [_light(look.light_yaw, look.light_pitch, look.light_irradiance)] if look.light else []
    return dataclasses.replace(
        scene,
        objects=objects,
        camera=camera_of(document.orbit),
        lights=(*scene.lights, *lights),
        environment=environment,
    )


@lru_cache(maxsize=4)
def _objects(
    material: Material, assigned: tuple[Assigned, ...], scene: Scene, placed: tuple[Placed, ...]
) -> tuple[Object, ...]:
    """Objects of the scene with their materials, in their places; cached, so that the others stay as one is hidden."""
    objects = list(_objects_alike(material, scene))
    for one in assigned:
        if one.object < len(objects):
            objects[one.object] = _filled(objects[one.object], one.material, medium_of(one.material))
    for item, place in zip(placed_objects(scene, placed), range(len(objects)), strict=True):
        if item is not scene.objects[place]:
            objects[place] = dataclasses.replace(objects[place], transform=item.transform)
    return tuple(objects)


@lru_cache(maxsize=4)
def _objects_alike(material: Material, scene: Scene) -> tuple[Object, ...]:
    """Objects of the scene with one material in all bodies; a bare mesh with the model's own gets an ior alone."""
    if material.source != "file" or not scene.bodies:
        medium, chosen = medium_of(material), set(map(id, fillable(scene)))
        return tuple(_filled(item, material, medium) if id(item) in chosen else item for item in scene.objects)
    if hasattr(scene, "has_camera"):
        return tuple(scene.objects)
    return tuple(
        item
        if item.medium is None or item.medium.ior == material.ior
        else dataclasses.replace(item, medium=dataclasses.replace(item.medium, ior=material.ior))
        for item in scene.objects
    )


def _filled(item: Object, material: Material, medium: Medium) -> Object:
    surface = dataclasses.replace(item.surface or Surface(), **material.surface_values, opacity=None)  # type: ignore[arg-type]
    if material.color_texture:
        surface = dataclasses.replace(surface, color_texture=_texture(material.color_texture, item, encoded=True))
    if material.roughness_texture:
        found = _texture(material.roughness_texture, item, encoded=False)
        surface = dataclasses.replace(surface, roughness_texture=found)
    mesh, marked = patterned(item.mesh, surface, material.pattern, uniform_scale(item.matrix))
    return dataclasses.replace(item, mesh=mesh, medium=medium, surface=marked, sheet_thickness=None)


@lru_cache(maxsize=2)
def _light(yaw: float, pitch: float, irradiance: float) -> DirectionalLight:
    """Light that the look adds; cached, as the solutions for its scattered light are cached by it."""
    return DirectionalLight(-direction_from(yaw, pitch), irradiance)


@lru_cache(maxsize=4)
def method_of(name: str, material: Material) -> Method | None:
    """Method of a name; a thin layer has the thickness of the material."""
    if name == AUTO:
        return None
    return method_from_name(name).with_thickness(material.thickness)


def request_of(document: Document, caustics: Caustics | None = None) -> RenderRequest:
    """Request for the picture of a document."""
    display = document.display
    scattering = None if display.scattering == AUTO else SCATTERINGS[display.scattering]()
    method, flags = method_of(display.method, document.material), dataclasses.asdict(document.flags)
    return RenderRequest(method, scattering=scattering, caustics=caustics, **flags)
