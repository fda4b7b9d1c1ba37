"""Scenes from documents and loaded models, and materials from models."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from translucent.errors import InputError
from translucent.media.medium import Medium, color_at
from translucent.planning.methods import Method, method_from_name
from translucent.planning.scattering import SCATTERINGS, Scattering
from translucent.preview.document import AUTO, FINISH, Assigned, Document, Look, Material
from translucent.preview.loaded import Loaded
from translucent.preview.orbiting import camera_of
from translucent.preview.staging import environment_of, stage_name, standing
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import DEFAULT_COLOR, DEFAULT_REACH, fillable
from translucent.scene.stages import NO_STAGE
from translucent.scene.surface import Surface


def material_of(scene: Scene, number: int | None = None) -> Material:
    """Material of an object, by default of the first body; if it is opaque, the one that it would be filled with."""
    diagonal = scene.diagonal or 1.0
    body = fillable(scene)[0] if number is None else scene.objects[number]
    if body.medium is None or body.covers:
        reach = DEFAULT_REACH * diagonal
        red, green, blue = np.asarray(Medium.from_color(DEFAULT_COLOR, reach).absorption).tolist()
        return Material(color=DEFAULT_COLOR, distance=reach, absorption=(red, green, blue), thickness=0.1 * diagonal)
    medium, surface = body.medium or Medium(), body.surface or Surface()
    reach = DEFAULT_REACH * diagonal
    # Where the showcase states it; if that is too dark or too bright to tell, where 1/e is left.
    near = reach if (medium.transmittance(reach) > 1e-3).all() else None
    color, distance = color_at(medium, near)
    triples = (np.asarray(v).tolist() for v in (color, medium.absorption, medium.scattering, medium.emission))
    given = tuple((float(r), float(g), float(b)) for r, g, b in triples)
    return Material(
        color=given[0],
        distance=float(distance) if math.isfinite(distance) else reach,
        absorption=given[1],
        scattering=given[2],
        emission=given[3],
        anisotropy=medium.anisotropy,
        ior=medium.ior,
        **{name: getattr(surface, name) for name in FINISH},
        thickness=body.sheet_thickness or 0.1 * diagonal,
    )


def medium_of(material: Material) -> Medium:
    """Medium of the bodies: for a color at a distance, exactly that of ``translucent extinction``."""
    absorption: object = material.absorption
    if material.source == "color":
        absorption = Medium.from_color(material.color, material.distance).absorption
    return Medium(absorption, material.scattering, material.emission, material.anisotropy, material.ior)  # type: ignore[arg-type]


def scene_of(document: Document, loaded: Loaded) -> Scene:
    """Scene of a document with an orbit; all objects of a model without bodies are filled.

    Raises
    ------
    InputError
        If the environment cannot be read.
    """
    if document.orbit is None:
        raise InputError("a picture", "nobody has framed the model", "frame it first")
    scene, look = loaded.scene, document.look
    light = _light(look.light_yaw, look.light_pitch, look.light_irradiance) if look.light else None
    objects, camera = _shown(document.material, document.assigned, document.hidden, scene), camera_of(document.orbit)
    if (name := stage_name(look, loaded)) != NO_STAGE and document.display.pictured:
        on = standing(loaded, name, look.environment, look.background, look.rotation)
        ground = tuple(item for item in on.objects if item.shadow_catcher)
        lights = on.lights if light is None else (*on.lights, light)
        return dataclasses.replace(on, objects=(*objects, *ground), camera=camera, lights=lights)
    lights = scene.lights if light is None else (*scene.lights, light)
    return dataclasses.replace(
        scene,
        objects=objects,
        camera=camera,
        lights=lights,
        environment=_environment(look.environment, look.background, look.rotation, scene),
    )


@lru_cache(maxsize=2)
def _shown(
    material: Material, assigned: tuple[Assigned, ...], hidden: tuple[int, ...], scene: Scene
) -> tuple[Object, ...]:
    """Objects of the scene on show with their materials; cached, so that turning the camera makes none anew."""
    objects = _objects(material, assigned, scene)
    return tuple(item for number, item in enumerate(objects) if number not in hidden)


@lru_cache(maxsize=2)
def _objects(material: Material, assigned: tuple[Assigned, ...], scene: Scene) -> tuple[Object, ...]:
    """Objects of the scene with their materials; cached, so that the others stay as one is hidden."""
    objects = list(_objects_alike(material, scene))
    for one in assigned:
        if one.object < len(objects):
            objects[one.object] = _filled(objects[one.object], one.material, medium_of(one.material))
    return tuple(objects)


@lru_cache(maxsize=2)
def _objects_alike(material: Material, scene: Scene) -> tuple[Object, ...]:
    """Objects of the scene with one material in all bodies."""
    if material.source == "file" and scene.bodies:
        return tuple(scene.objects) if hasattr(scene, "has_camera") else tuple(_bent(scene.objects, material.ior))
    medium, chosen = medium_of(material), set(map(id, fillable(scene)))
    return tuple(_filled(item, material, medium) if id(item) in chosen else item for item in scene.objects)


def _bent(objects: Sequence[Object], ior: float) -> list[Object]:
    """Bodies of a bare mesh with this index of refraction."""
    return [
        item
        if item.medium is None or item.medium.ior == ior
        else dataclasses.replace(item, medium=dataclasses.replace(item.medium, ior=ior))
        for item in objects
    ]


def _filled(item: Object, material: Material, medium: Medium) -> Object:
    surface = dataclasses.replace(item.surface or Surface(), **material.finish, opacity=None)  # type: ignore[arg-type]
    return dataclasses.replace(item, medium=medium, surface=surface, sheet_thickness=None)


def towards_light(look: Look) -> tuple[float, float, float]:
    """Unit vector to the light that the look adds."""
    return _direction(look.light_yaw, look.light_pitch)


def _direction(yaw: float, pitch: float) -> tuple[float, float, float]:
    yaw, pitch = math.radians(yaw), math.radians(pitch)
    return math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)


@lru_cache(maxsize=2)
def _light(yaw: float, pitch: float, irradiance: float) -> DirectionalLight:
    """Light that the look adds; cached, since what it does in bodies is cached with it."""
    return DirectionalLight([-v for v in _direction(yaw, pitch)], irradiance)


@lru_cache(maxsize=2)
def _environment(name: str, background: str, rotation: float, scene: Scene) -> Environment:
    """Environment of the scene; cached, since its filtered maps are cached with it."""
    lit = environment_of(name) if name else scene.environment
    if lit.kind == "image" and rotation:
        lit = dataclasses.replace(lit, rotation=lit.rotation + rotation)
    return lit.with_background(environment_of(background)) if background else lit


@lru_cache(maxsize=4)
def method_of(name: str, material: Material) -> Method | None:
    """Method of a name; a thin layer has the thickness of the material."""
    if name == AUTO:
        return None
    return method_from_name(name).with_thickness(material.thickness)


def scattering_of(name: str) -> Scattering | None:
    """Way of showing light that is scattered many times; None leaves it to the planner."""
    return None if name == AUTO else SCATTERINGS[name]()
