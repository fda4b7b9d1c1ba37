"""Stages: ground, backdrop and lights around a model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import cos, radians, sin
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError, close_names, did_you_mean
from translucent.geometry.grouping import used_vertices
from translucent.geometry.mesh import Mesh
from translucent.geometry.support import Support
from translucent.media.colors import ColorLike, reflectance
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PositionalLight, SpotLight
from translucent.scene.scene import Light, Object, Scene
from translucent.scene.studio import cove_map, dark_studio_map
from translucent.scene.surface import Surface
from translucent.scene.texture import Falloff

Color = tuple[float, float, float]

#: Vertices from which on a mesh is not looked at whole to frame it: of fewer, that takes milliseconds.
LARGE = 1 << 18


@dataclass(frozen=True)
class KeyLight:
    """Light that throws the shadow of a stage.

    Attributes
    ----------
    azimuth, elevation : float
        Where it comes from, in degrees: from ahead of the camera towards its right, and up. From behind the model
        (0, and up to 90 to both sides) its light shines through to the camera.
    irradiance : (r, g, b)
        On a surface that faces it, in W/m^2.
    """

    azimuth: float
    elevation: float
    irradiance: Color


@dataclass(frozen=True)
class Stage:
    """Stage: ground, backdrop and lights around a model.

    Attributes
    ----------
    ground : Surface
        Surface of the ground, which is level and has no end.
    environment : callable
        Makes what lights the model and is mirrored in it; -Z of it is ahead of the camera.
    keys : tuple of KeyLight
    height : float
        Of the default camera over the model, in degrees.
    far : float
        Fraction of its base color that the ground has far away.
    """

    ground: Surface
    environment: Callable[[], Environment]
    keys: tuple[KeyLight, ...]
    height: float
    far: float = 1.0

    @property
    def view(self) -> Color:
        """Direction in which the default camera looks: ahead, a little to the left, and down."""
        level = cos(radians(self.height))
        return -level * sin(radians(AZIMUTH)), -sin(radians(self.height)), -level * cos(radians(AZIMUTH))


#: How far to the right of the model the default camera is, in degrees about it.
AZIMUTH = 24.2

#: The default stage, and the name for none of them: the model floats before its environment.
DEFAULT_STAGE, NO_STAGE = "studio", "none"

#: Tone curve of pictures of stages, whose light sources are brighter than white.
STAGED_TONE = "neutral"

#: All stages by name.
STAGES = {
    "studio": Stage(
        Surface(color=(0.74, 0.74, 0.75), roughness=0.25),
        # Far away the ground is as bright as the backdrop: then it mirrors what it is, and no horizon is seen.
        lambda: Environment.image(cove_map(), exposure=-0.55),
        (KeyLight(-42.0, 52.0, (1.3, 1.25, 1.18)),),
        height=20.0,
        far=0.45,
    ),
    "light-table": Stage(
        Surface(color=(0.5, 0.5, 0.5), roughness=0.25, emissive=(0.55, 0.56, 0.58)),
        lambda: Environment.studio(exposure=-1.5).with_background(Environment.constant((0.9, 0.91, 0.93))),
        (KeyLight(35.0, 58.0, (0.9, 0.9, 0.9)),),
        height=34.0,
    ),
    "night": Stage(
        Surface(color=(0.05, 0.052, 0.058), roughness=0.15),
        lambda: Environment.image(dark_studio_map(), exposure=-0.6),
        (KeyLight(-30.0, 46.0, (4.6, 4.4, 4.1)),),
        height=20.0,
        far=0.05,
    ),
    "daylight": Stage(
        Surface(color=(0.78, 0.75, 0.70), roughness=0.6),
        lambda: Environment.gradient((0.34, 0.33, 0.31), (0.42, 0.48, 0.60)),
        (KeyLight(48.0, 42.0, (3.0, 2.8, 2.45)),),
        height=26.0,
        far=0.6,
    ),
}


def stage_named(name: str) -> Stage | None:
    """Stage of this name; None for ``none``.

    Raises
    ------
    InputError
        If there is none.
    """
    if name == NO_STAGE:
        return None
    if name not in STAGES:
        names = (NO_STAGE, *STAGES)
        close = close_names(name, names)
        do = did_you_mean(close) if close else f"use one of {', '.join(names)}"
        raise InputError(f"stage {name!r}", "no stage has this name", do)
    return STAGES[name]


#: Air between model and ground, as a fraction of the model's diagonal: rays resolve surfaces that are so far apart.
GAP = 1e-3

#: How far the ground reaches, in diagonals of the model.
REACH = 60.0

#: How far from the model the ground gets darker, and how far it goes on to, in the same.
BRIGHT, DARK = 0.8, 9.0

#: Directions of the environment that throw shadows onto the ground.
ENVIRONMENT_SHADOWS = 128

#: Fraction of the length of shadows that the default camera makes room for.
SHADOW_SEEN = 0.7

#: Sine of the elevation of lights below which shadows have no end to make room for.
LOWEST = 0.3

#: Color of a ground that is left out.
NO_GROUND = "none"

#: What messages call the ground.
GROUND_NAME = "ground"

AnyScene = TypeVar("AnyScene", bound=Scene)


@checked
def staged(
    scene: AnyScene,
    stage: str | Stage = DEFAULT_STAGE,
    environment: Environment | None = None,
    turn: float = 0.0,
    ground: ColorLike | None = None,
) -> AnyScene:
    """Scene on a stage: its objects on a ground, lit as its camera sees them; +Y is up.

    The ground comes after the objects. It is a little below their lowest point, and is seen from above only.

    Parameters
    ----------
    scene : Scene
        Its lights, if it has any, shine in place of the stage's.
    stage : str or Stage
        A stage, or its name; ``none`` gives the scene itself.
    environment : Environment, optional
        In place of the stage's, whose lights stay out, too.
    turn : float
        Of the stage with its lights and its environment about +Y, in degrees, counterclockwise as seen from above.
    ground : str or array_like (3,), optional
        Color of the ground, which it has far away, too; ``none``: no ground, but the stage's light. Default: the
        stage's.

    Raises
    ------
    InputError
        If there is no such stage, or the scene stands on one.
    """
    chosen = stage_named(stage) if isinstance(stage, str) else stage
    if chosen is None:
        return scene
    if len(scene.shown) < len(scene.objects):
        do = 'use a scene without a stage, such as tl.showcase(mesh, medium, stage="none")'
        raise InputError("a stage for a scene", "the scene already has a ground that catches shadows", do)
    axes = view_axes(scene.camera) @ _about_y(turn).T
    surface = _ground_surface(chosen, ground)
    floor = (Object(ground_mesh(scene, axes), surface=surface, shadow_catcher=True),) if surface else ()
    lights = scene.lights or (() if environment else tuple(_light(key, axes) for key in chosen.keys))
    azimuth = float(np.degrees(np.arctan2(axes[2, 0], -axes[2, 2])))
    made = environment or dataclasses.replace(chosen.environment(), rotation=-azimuth)
    return dataclasses.replace(
        scene,
        objects=(*scene.objects, *floor),
        lights=lights,
        environment=made,
        environment_shadows=scene.environment_shadows or ENVIRONMENT_SHADOWS,
    )


def view_axes(camera: Camera) -> Array:
    """(3, 3): unit rows to the right, up (+Y), and ahead of a camera, the first and the last of them level."""
    ahead = camera.forward * (1.0, 0.0, 1.0)
    if np.linalg.norm(ahead) < 1e-3:  # straight up or down: what is ahead is where the picture's top or bottom is
        ahead = -np.sign(camera.forward[1]) * camera.up * (1.0, 0.0, 1.0)
    ahead /= np.linalg.norm(ahead)
    return np.stack([np.cross(ahead, (0.0, 1.0, 0.0)), (0.0, 1.0, 0.0), ahead])


def _about_y(degrees: float) -> Array:
    """(3, 3): turn about +Y, counterclockwise as seen from above."""
    if not np.isfinite(degrees):
        raise InputError(f"stage turned by {degrees}", "the angle must be finite", "give the angle in degrees")
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def stage_lights(stage: Stage) -> list[DirectionalLight]:
    """Lights of a stage as the default camera sees it."""
    ahead = np.array(stage.view) * (1.0, 0.0, 1.0)
    ahead /= np.linalg.norm(ahead)
    axes = np.stack([np.cross(ahead, (0.0, 1.0, 0.0)), (0.0, 1.0, 0.0), ahead])
    return [_light(key, axes) for key in stage.keys]


def with_shadows(points: Array, lights: Sequence[Light]) -> Array:
    """(n, 3): points, and places on the ground below them most of the distance to where lights throw their shadows."""
    height = points[:, 1:2] - points[:, 1].min()
    feet = points - height * (0.0, 1.0, 0.0)
    directions = [np.asarray(light.direction) for light in lights if isinstance(light, DirectionalLight)]
    shadows = [
        feet - SHADOW_SEEN * height * direction * (1.0, 0.0, 1.0) / direction[1]
        for direction in directions
        if direction[1] < -LOWEST
    ]
    return np.concatenate([points, *shadows])


def _ground_surface(stage: Stage, color: ColorLike | None) -> Surface | None:
    """Surface of the ground: its base color is darker far away, as if the lights stood near the model."""
    if isinstance(color, str) and color == NO_GROUND:
        return None
    if color is not None:
        return dataclasses.replace(stage.ground, color=reflectance(color, GROUND_NAME), double_sided=False)
    if stage.far == 1.0:
        return dataclasses.replace(stage.ground, double_sided=False)
    return dataclasses.replace(stage.ground, double_sided=False, color_texture=_falloff(stage.far))


@lru_cache(maxsize=8)
def _falloff(far: float) -> Falloff:
    """Fraction of the base color over the texture coordinates of `ground_mesh`: 1 in the middle, `far` at the edges."""
    return Falloff.around(0.5 * BRIGHT / DARK, far)


def _light(key: KeyLight, axes: Array) -> DirectionalLight:
    azimuth, elevation = np.radians(key.azimuth), np.radians(key.elevation)
    towards = np.cos(elevation) * np.sin(azimuth), np.sin(elevation), np.cos(elevation) * np.cos(azimuth)
    return DirectionalLight(-np.asarray(towards) @ axes, key.irradiance)


def ground_mesh(scene: Scene, axes: Array) -> Mesh:
    """Square below the objects of a scene: two faces, as a ground that is known to shadow nothing costs no map."""
    points = farthest_vertices(scene.objects, np.concatenate([np.eye(3), -np.eye(3)]))
    low, high = points.min(axis=0), points.max(axis=0)
    unit = float(np.linalg.norm(high - low)) or 1.0
    foot = np.array([0.5 * (low[0] + high[0]), low[1] - GAP * unit, 0.5 * (low[2] + high[2])])
    corners = REACH * unit * np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]) @ axes
    uv = 0.5 + 0.5 * REACH / DARK * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return Mesh(foot + corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), uv, GROUND_NAME)


def world_vertices(item: Object) -> Array:
    """(n, 3): vertices of an object in the world that faces use."""
    return np.asarray(item.mesh.vertices[used_vertices(item.mesh.faces)] @ item.matrix[:3, :3].T + item.matrix[:3, 3])


def farthest_vertices(objects: Sequence[Object], directions: Array) -> Array:
    """(n, 3): vertices of objects in the world, as of `world_vertices`.

    Of large meshes a subset that includes the farthest vertex along each of the directions (k, 3).
    """
    found = []
    for item in objects:
        large = len(item.mesh.vertices) >= LARGE and (support := Support(item.mesh, item.matrix)).whole
        found.append(support.farthest(directions) if large else world_vertices(item))
    return np.concatenate(found)


def upright(scene: AnyScene, up: npt.ArrayLike) -> AnyScene:
    """Scene turned, with its camera and lights, by the shortest rotation of `up` (3,) to +Y, as stages need it."""
    turn = np.eye(4)
    turn[:3, :3] = upright_turn(up)
    if (turn == np.eye(4)).all():
        return scene
    return dataclasses.replace(
        scene,
        objects=[dataclasses.replace(item, transform=turn @ item.matrix) for item in scene.objects],
        camera=dataclasses.replace(scene.camera, pose=turn @ scene.camera.pose),
        lights=[moved(light, turn) for light in scene.lights],
    )


def upright_turn(up: npt.ArrayLike) -> Array:
    """(3, 3): the smallest turn that makes a direction +Y."""
    axis = np.asarray(up, dtype=np.float64)
    if not (length := float(np.linalg.norm(axis))) > 0:
        raise InputError(f"up {tuple(axis.tolist())}", "the vector is not a direction", "use a direction such as 0,0,1")
    axis = axis / length
    if axis[1] < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues' formula for the turn about their cross product (Möller & Hughes 1999).
    cross = np.array([[0.0, -axis[0], 0.0], [axis[0], 0.0, axis[2]], [0.0, -axis[2], 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + axis[1]))


def moved(light: Light, matrix: Array) -> Light:
    """Light moved by a rigid matrix (4, 4)."""
    changes: dict[str, Any] = {}
    if isinstance(light, SpotLight | DirectionalLight):
        changes["direction"] = matrix[:3, :3] @ np.asarray(light.direction)
    if isinstance(light, PositionalLight):
        changes["position"] = matrix[:3, :3] @ np.asarray(light.position) + matrix[:3, 3]
    return dataclasses.replace(light, **changes)


def has_ground(scene: Scene) -> bool:
    """True if an opaque object is a ground, or a room, for all that light enters: below it, and as wide and deep."""
    if not scene.bodies or not scene.opaque:
        return False
    boxes = np.stack([body.bounds for body in scene.bodies])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    margin = GAP * float(np.linalg.norm(high - low))
    level = [0, 2]
    return any(
        bool(
            (item.bounds[0][level] <= low[level] + margin).all()
            and (item.bounds[1][level] >= high[level] - margin).all()
        )
        and bool(item.bounds[0][1] <= low[1] + margin)
        for item in scene.opaque
    )
