"""The stage that a document's model stands on, kept while the camera, the medium or the material change."""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache
from pathlib import Path

from translucent.preview import orbiting
from translucent.preview.document import AUTO, Document, Look, Material, Orbit
from translucent.preview.loaded import Loaded
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Scene
from translucent.scene.shadow_directions import shadow_directions
from translucent.scene.showcase import LIGHT_TABLE, STAGED_IOR, framing, named_environment
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
from translucent.scene.turntable import on_stage


def stage_name(look: Look, loaded: Loaded) -> str:
    """Name of the stage that a look asks for; ``auto`` is what ``translucent render`` gives the model."""
    if look.stage != AUTO:
        return look.stage
    scene = loaded.scene
    own = look.environment or look.background or scene.lights or getattr(scene, "has_camera", False)
    return NO_STAGE if own or has_ground(scene) else DEFAULT_STAGE


def own_material(look: Look, loaded: Loaded) -> Material:
    """Material that a model comes with: a bare mesh on a stage has an interface, as ``translucent render`` gives it."""
    if not loaded.bare or stage_name(look, loaded) == NO_STAGE:
        return loaded.material
    return dataclasses.replace(loaded.material, ior=STAGED_IOR)


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


def own_environment(environment: str, background: str) -> Environment | None:
    """Environment in place of the stage's; None if a look names none."""
    if not (environment or background):
        return None
    lit = environment_of(environment) if environment else LIGHT_TABLE
    return lit.with_background(environment_of(background)) if background else lit


def shown_from(loaded: Loaded, name: str) -> Camera:
    """Camera to which a stage is turned: the model's own, or the one that frames it there."""
    scene = loaded.scene
    own = getattr(scene, "has_camera", False)
    return scene.camera if own else framing(scene.objects, (16, 9), stage=stage_named(name))


@lru_cache(maxsize=2)
def standing(loaded: Loaded, name: str, environment: str, background: str, rotation: float) -> Scene:
    """Loaded scene on a stage; cached, as the ground, the lights and the environment stay while the camera moves."""
    own = own_environment(environment, background)
    if own is not None and own.kind == "image":
        own = dataclasses.replace(own, rotation=own.rotation + rotation)
    seen = dataclasses.replace(loaded.scene, camera=shown_from(loaded, name))
    return staged(seen, name, own, rotation)


def turn_from(document: Document, loaded: Loaded, camera: Camera) -> float:
    """Degrees by which the stage is turned about +Y from where `staged` puts it for a camera."""
    from_, to = (view_axes(one)[2] for one in (camera, shown_from(loaded, stage_name(document.look, loaded))))
    turn = math.degrees(math.atan2(to[0], to[2]) - math.atan2(from_[0], from_[2]))
    return math.remainder(turn + document.look.rotation, 360.0)


def first_orbit(loaded: Loaded, size: tuple[int, int], stage: str) -> Orbit:
    """First orbit of a model: that of the file's own camera, or from where `render` sees it, close as F frames it."""
    scene = loaded.scene
    if getattr(scene, "has_camera", False):
        return orbiting.orbit_of(scene.camera, scene.bounds.mean(axis=0))
    if stage == NO_STAGE:
        return orbiting.framed(None, scene.objects, size)
    seen = orbiting.orbit_of(framing(scene.objects, size, stage=stage_named(stage)), scene.bounds.mean(axis=0))
    return orbiting.framed(seen, scene.objects, size)


def prepare_stage(name: str, environment: str, background: str) -> None:
    """Compute what takes long about a stage, and is cached."""
    from translucent.scene.environment import filtered

    stage = stage_named(name)
    if stage is not None:
        lit = own_environment(environment, background) or stage.environment()
        filtered(lit)
        shadow_directions(lit, ENVIRONMENT_SHADOWS)
