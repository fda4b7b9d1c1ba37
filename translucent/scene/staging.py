"""Models on a stage: a ground that fits them and the picture, lights and environment as the camera sees them."""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.geometry.grouping import used_vertices
from translucent.geometry.mesh import Mesh
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.stages import KeyLight, Stage
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Air between model and ground, as a share of the model's diagonal: rays tell surfaces apart that are so far apart.
GAP = 1e-3

#: Of the backdrop, in diagonals of the model: how far behind it, how high at least, and the radius of the curve up.
BEHIND, HIGH, CURVE = 3.0, 1.5, 1.6

#: Roughness of the backdrop.
DULL = 0.9

#: Of the floor, in the same: least reach to the sides and towards the camera.
AROUND = 3.0

#: Pieces of the curve, along the rest of the profile, and from side to side.
CURVE_PIECES, PIECES_ACROSS = 48, 2

#: Directions of the environment that throw shadows onto the ground.
ENVIRONMENT_SHADOWS = 32

#: What messages call the ground.
GROUND_NAME = "ground"

AnyScene = TypeVar("AnyScene", bound=Scene)


def staged(
    scene: AnyScene,
    stage: Stage,
    size: tuple[int, int],
    environment: Environment | None = None,
) -> AnyScene:
    """Scene on a stage: its objects on a ground before a backdrop, as its camera sees them; +Y is up.

    The ground comes after the objects. It is a little below their lowest point, and is seen from above only.

    Parameters
    ----------
    scene : Scene
        Its lights, if it has any, shine in place of the stage's.
    stage : Stage
    size : (width, height)
        Of the picture in pixels: the backdrop is as wide.
    environment : Environment, optional
        In place of the stage's, whose lights stay out, too.
    """
    axes = view_axes(scene.camera)
    ground = Object(ground_mesh(scene, size, axes), surface=_finish(stage), shadow_catcher=True)
    lights = scene.lights or (() if environment else tuple(_light(key, axes) for key in stage.keys))
    azimuth = float(np.degrees(np.arctan2(axes[2, 0], -axes[2, 2])))
    made = environment or dataclasses.replace(stage.environment(), rotation=-azimuth)
    return dataclasses.replace(
        scene,
        objects=(*scene.objects, ground),
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


def _finish(stage: Stage) -> Surface:
    """Paint and coat of the ground; the backdrop is dull, as lights behind the model would be mirrored in its curve."""
    ramp = np.broadcast_to(np.array([[[1.0]], [[stage.gloss]]], dtype=np.float32), (2, 1, 3))
    return Surface(
        color=stage.color,
        emissive=stage.emissive,
        roughness=DULL,
        roughness_texture=Texture(ramp, wrap=("clamp", "clamp")),
        double_sided=False,
    )


def _light(key: KeyLight, axes: Array) -> DirectionalLight:
    azimuth, elevation = np.radians(key.azimuth), np.radians(key.elevation)
    towards = np.cos(elevation) * np.sin(azimuth), np.sin(elevation), np.cos(elevation) * np.cos(azimuth)
    return DirectionalLight(-np.asarray(towards) @ axes, key.irradiance)


def ground_mesh(scene: Scene, size: tuple[int, int], axes: Array) -> Mesh:
    """Floor below the objects of a scene that curves up into a backdrop behind them, large enough for its camera."""
    points = np.concatenate([world_vertices(item) for item in scene.objects])
    low, high = points.min(axis=0), points.max(axis=0)
    unit = float(np.linalg.norm(high - low)) or 1.0
    foot = np.array([0.5 * (low[0] + high[0]), low[1] - GAP * unit, 0.5 * (low[2] + high[2])])
    local = (points - foot) @ axes.T
    eye = (scene.camera.eye - foot) @ axes.T
    half_width, half_height = scene.camera.half_extent(size)
    behind = float(local[:, 2].max()) + BEHIND * unit
    # How far the backdrop is from the camera, and how far to its sides and up the picture's corners are there.
    depth = max(behind - float(eye[2]), unit) if scene.camera.fov_y is not None else 1.0
    side = abs(float(eye[0])) + 1.2 * depth * half_width
    wide = max(float(np.abs(local[:, 0]).max()) + AROUND * unit, side)
    steepest = scene.camera.forward @ axes[1] + half_height
    top = max(float(local[:, 1].max()) + HIGH * unit, float(eye[1]) + 1.2 * depth * max(float(steepest), 0.0))
    near = max(AROUND * unit - float(local[:, 2].min()), 0.5 * unit - float(eye[2]))
    wide, top, near = (min(value, FARTHEST * unit) for value in (wide, top, near))
    profile, share = _profile(near, behind, top, CURVE * unit)
    across = np.linspace(-wide, wide, PIECES_ACROSS + 1)
    way, height = np.tile(profile, (len(across), 1)).T
    local = np.stack([np.repeat(across, len(profile)), height, way], axis=1)
    uv = np.stack([np.full(len(local), 0.5), np.tile(share, len(across))], axis=1)
    return Mesh(foot + local @ axes, _strip_faces(len(across), len(profile)), uv, GROUND_NAME)


#: Farthest that a ground reaches, in diagonals of the model, however far away its camera is.
FARTHEST = 40.0


def _profile(near: float, behind: float, top: float, radius: float) -> tuple[Array, Array]:
    """(n, 2): way ahead and height along floor, curve and backdrop; and (n,): from 0 on the floor to 1 on the curve."""
    angles = np.linspace(0.0, 0.5 * np.pi, CURVE_PIECES + 1)
    start = behind - radius
    curve = np.stack([start + radius * np.sin(angles), radius - radius * np.cos(angles)], axis=1)
    floor = np.array([(-near, 0.0), (0.3 * start, 0.0)])
    profile = np.concatenate([floor, curve, [[behind, max(top, 1.01 * radius)]]])
    return profile, np.repeat([0.0, 1.0], [len(floor), len(profile) - len(floor)])


def _strip_faces(rows: int, columns: int) -> npt.NDArray[np.int32]:
    """Faces of a grid of vertices, whose rows go to the right and columns ahead, seen from above."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, ahead = corner + columns, corner + 1
    faces = [[corner, right, ahead], [right, right + 1, ahead]]
    return np.concatenate([np.stack(face, axis=1) for face in faces]).astype(np.int32)


def world_vertices(item: Object) -> Array:
    """(n, 3): vertices of an object in the world, without those that no face uses."""
    return np.asarray(item.mesh.vertices[used_vertices(item.mesh.faces)] @ item.matrix[:3, :3].T + item.matrix[:3, 3])
