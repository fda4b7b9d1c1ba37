"""Turntables: views of a scene from all around."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Scene
from translucent.scene.stages import moved, with_shadows

#: Slices of a model, and points around each, that enclose it as it turns.
CUTS, POINTS_AROUND = 32, 48


def turntable(scene: Scene, count: int) -> Iterator[Scene]:
    """Scenes of a turntable from `count` sides: the camera orbits the center of the objects once, about +Y.

    Seen from above it goes counterclockwise. Environment and background go with it, so that the model seems to turn
    before them; lights stay with the model. On a stage, with a shadow catcher, ground and lights go with the camera.

    Raises
    ------
    InputError
        If the count is not a whole number above 1.
    """
    if not isinstance(count, int) or count < 2:
        raise InputError(f"turntable of {count!r} pictures", "not a whole number above 1", "give for example 36")
    center = scene.shown_bounds.mean(axis=0)
    for i in range(count):
        angle = 360.0 * i / count
        turn = _about(center, angle)
        camera = dataclasses.replace(scene.camera, pose=turn @ scene.camera.pose)
        view = dataclasses.replace(scene, camera=camera, environment=_turned(scene.environment, angle))
        yield _with_stage_turned(view, turn) if on_stage(scene) else view


def framed_all_around(scene: Scene, size: tuple[int, int]) -> Scene:
    """Scene with its camera far enough away to see what is shown from every side of a `turntable`.

    An orthographic camera stays where it is.
    """
    camera = scene.camera
    if camera.fov_y is None:
        return scene
    points = swept_points(scene)
    if on_stage(scene):
        points = with_shadows(points, scene.lights)
    return dataclasses.replace(
        scene, camera=Camera.framing(points, size, direction=camera.forward, fov_y=camera.fov_y, up=camera.up)
    )


def swept_points(scene: Scene) -> Array:
    """(n, 3): points that enclose a model while it turns on a turntable, about +Y through the center of its bounds."""
    center = scene.shown_bounds.mean(axis=0)
    offsets = np.concatenate(
        [
            item.mesh.vertices[np.unique(item.mesh.faces)] @ item.matrix[:3, :3].T + (item.matrix[:3, 3] - center)
            for item in scene.shown
        ]
    )
    radius, height = np.hypot(offsets[:, 0], offsets[:, 2]), offsets[:, 1]
    low, high = height.min(), height.max()
    cut = np.minimum((CUTS * (height - low) / ((high - low) or 1.0)).astype(np.intp), CUTS - 1)
    widest = np.zeros(CUTS)
    np.maximum.at(widest, cut, radius)
    angles = 2.0 * np.pi * np.arange(POINTS_AROUND) / POINTS_AROUND
    # A ring of points around a circle has to be wider than that, for its sides to enclose it.
    around = np.stack([np.cos(angles), np.zeros(POINTS_AROUND), np.sin(angles)], axis=1) / np.cos(np.pi / POINTS_AROUND)
    edges = np.linspace(low, high, CUTS + 1)
    rings = [
        radius * around + np.array([0.0, level, 0.0])
        for i, radius in enumerate(widest)
        if radius > 0
        for level in (edges[i], edges[i + 1])
    ]
    return np.asarray(np.concatenate(rings or [offsets]) + center)


def _about(center: Array, angle: float) -> Array:
    """(4, 4): a turn about +Y through a point, counterclockwise as seen from above, in degrees."""
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    matrix = np.eye(4)
    matrix[:3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    matrix[:3, 3] = center - matrix[:3, :3] @ center
    return matrix


def on_stage(scene: Scene) -> bool:
    """True if a scene has a shadow catcher."""
    return any(item.shadow_catcher for item in scene.objects)


def _with_stage_turned(scene: Scene, turn: Array) -> Scene:
    """Scene with its shadow catchers and lights turned."""
    objects = [
        dataclasses.replace(item, transform=turn @ item.matrix) if item.shadow_catcher else item
        for item in scene.objects
    ]
    return dataclasses.replace(scene, objects=objects, lights=[moved(light, turn) for light in scene.lights])


def _turned(environment: Environment, angle: float) -> Environment:
    background = environment.background and _turned(environment.background, angle)
    return dataclasses.replace(environment, rotation=environment.rotation + angle, background=background)
