"""Contents of the uniform blocks: values that shaders read about a frame and its bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.light import ALL_AROUND
from translucent.gpu.balance import Balance
from translucent.gpu.body_uniforms import bounded_extinction
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import (
    ENVIRONMENT,
    LIGHTS,
    MAX_LIGHT_VIEWS,
    MAX_LIGHTS,
    MEDIA,
    SCATTER,
    SHADE,
    SURFACES,
    VIEW,
)
from translucent.gpu.placement import PlacedScene, SampleView
from translucent.planning.bodies import MAX_SLOTS, Slot
from translucent.planning.limits import MAX_SCATTER_LIGHTS
from translucent.planning.methods.base import MAX_LIGHT_POINTS
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Scene

#: Optical depth, across the scene, of what stops the straight light of lamps.
STOPPING = 1e5


def view_uniforms(view: SampleView, placed: PlacedScene) -> bytes:
    """Contents of the View block."""
    camera, media, opaque = view.camera, placed.media, placed.opaque
    half_width, half_height = camera.half_extent(view.size)
    perspective = camera.fov_y is not None
    aside = center_aside(camera, view.size) if perspective else np.zeros(3)
    reach = (0.0, 0.0)
    if opaque is not None:
        reach = ((opaque.near - media.near) / media.length, media.length / opaque.length)
    return VIEW.pack(
        # Shaders count from the corner of their target.
        frame_size=[*view.size, view.shift[0] - view.corner[0], view.shift[1] + view.corner[1]],
        ray_right=[*(camera.right * half_width * perspective), 0.0],
        ray_up=[*(camera.up * half_height * perspective), 0.0],
        ray_forward=[*(camera.forward + aside), 0.0],
        opaque_range=reach,
        beyond=camera.beyond(view.size),
    )


def view_span(view: SampleView) -> tuple[float, float, float, float]:
    """Steps of rays right and down at distance 1: per pixel, and from the axis to the top left corner of the view.

    0 for parallel rays.
    """
    camera, (width, height) = view.camera, view.size
    if camera.fov_y is None:
        return 0.0, 0.0, 0.0, 0.0
    half_width, half_height = camera.half_extent(view.size)
    aside, above = camera.center(view.size)
    right, down = 2.0 * half_width / width, 2.0 * half_height / height
    return (
        right,
        down,
        view.shift[0] * right + (aside - 1.0) * half_width,
        (view.shift[1] * down - (above + 1.0) * half_height),
    )


def center_aside(camera: Camera, size: tuple[int, int]) -> Array:
    """(3,): from the camera's axis to the center of the view, at distance 1, or in metres for an orthographic one."""
    aside = np.array(camera.center(size)) * camera.half_extent(size)
    return np.asarray(aside[0] * camera.right + aside[1] * camera.up)


def media_uniforms(placed: PlacedScene, slots: tuple[Slot, ...]) -> bytes:
    """Contents of the Media block."""
    scene = placed.scene
    extinction, emission, scattering, phase = (np.zeros((MAX_SLOTS, 4)) for _ in range(4))
    nothing = float(CONSTANTS["NOTHING"])
    for i, slot in enumerate(slots[:MAX_SLOTS]):
        density = scene.objects[slot.objects[0]].density
        densest = 1.0 if density is None else max(density.maximum, 1.0)
        extinction[i, :3] = bounded_extinction(slot.medium, densest * scene.diagonal)
        emission[i, :3] = slot.medium.emission
        share = extinction[i, :3] / np.where(slot.medium.extinction > 0, slot.medium.extinction, 1.0)
        scattering[i, :3] = share * np.asarray(slot.medium.scattering)
        phase[i] = slot.medium.phase_function.parameters
        extinction[i, 3], emission[i, 3] = placed.expected_counts[list(slot.objects)].sum(axis=0)
        open_from = (placed.open_from[list(slot.objects)].min() - placed.media.near) / placed.media.length
        scattering[i, 3] = np.clip(open_from, -nothing, nothing)
    return MEDIA.pack(
        slot_extinction=extinction,
        slot_emission=emission,
        slot_scattering=scattering,
        slot_phase=phase,
        media_length=placed.media.length,
        slot_bits=slot_bits(len(slots)),
    )


@dataclass(frozen=True, eq=False)
class LightLookup:
    """Lookup data of the views from the lights that media scatter.

    Attributes
    ----------
    center : (3,) float64
        Of the media, in metres.
    inside : tuple of bool
        Whether each light is inside a body.
    spans : (lights, 4) float64
        Number of each light's first view, how many it has, texels along a side of each, and number of the first texel.
    rows : (4 views, 4) float64
        For each view the rows of x, y and w of the picture, and of axial depth, from a point given from the center.
    """

    center: Array
    inside: tuple[bool, ...]
    spans: Array
    rows: Array


def scatter_uniforms(
    placed: PlacedScene, size: tuple[int, int], lights: LightLookup, points: int, stopping: int = 0
) -> bytes:
    """Contents of the Scatter block.

    Parameters
    ----------
    placed : PlacedScene
    size : (int, int)
        Width and height of the picture, in pixels.
    lights : LightLookup
    points : int
        Gauss-Legendre points for each interval and light.
    stopping : int
        A bit for each slot that stops the straight light of lamps.
    """
    scene, camera, media = placed.scene, placed.scene.camera, placed.media
    half_width, half_height = camera.half_extent(size)
    spans = np.zeros((MAX_SCATTER_LIGHTS, 4))
    spans[: len(lights.spans)] = lights.spans
    spans[: len(lights.spans), 1] *= np.where(lights.inside, -1.0, 1.0)
    rows = np.zeros((4 * MAX_LIGHT_VIEWS, 4))
    rows[: len(lights.rows)] = lights.rows
    gauss = np.zeros((MAX_LIGHT_POINTS, 4))
    points = min(points, MAX_LIGHT_POINTS)  # marching by other rules has no use for them
    nodes, weights = np.polynomial.legendre.leggauss(points)
    gauss[:points, 0], gauss[:points, 1] = (nodes + 1) / 2, weights / 2
    center = lights.center - camera.eye
    ahead, aside = float(center @ camera.forward), center_aside(camera, size)
    off_axis = center - ahead * camera.forward - (ahead if camera.fov_y is not None else 1.0) * aside
    return SCATTER.pack(
        scatter_right=[*(camera.right * half_width), 0.0],
        scatter_up=[*(camera.up * half_height), 0.0],
        scatter_off_axis=[*off_axis, 0.0],
        scatter_near=[media.near, media.near - float(center @ camera.forward), float(camera.fov_y is not None), 0.0],
        scatter_light_views=spans,
        scatter_views=rows,
        gauss=gauss,
        gauss_count=points,
        scatter_light_count=len(lights.spans),
        stopping_slots=stopping,
        stopping_extinction=STOPPING / scene.diagonal,
    )


def slot_bits(count: int) -> int:
    """Number of bits that tell `count` slots apart."""
    return max(count - 1, 0).bit_length()


def light_uniforms(scene: Scene, shine: bool) -> bytes:
    """Contents of the Lights block; none of them lights surfaces where there are none that they could shine on.

    Raises
    ------
    InputError
        If there are more lights than the block holds.
    """
    if shine and len(scene.lights) > MAX_LIGHTS:
        raise InputError("lighting opaque objects", f"{len(scene.lights)} lights", f"use at most {MAX_LIGHTS}")
    lights, center = scene.lights[:MAX_LIGHTS], media_center(scene)
    position, power = np.zeros((2, MAX_LIGHTS, 4))
    cone = np.tile(ALL_AROUND, (MAX_LIGHTS, 1))
    for i, light in enumerate(lights):
        if isinstance(light, PositionalLight):
            position[i], power[i, :3] = [*(np.asarray(light.position) - center), 1.0], light.intensity
            cone[i] = light.cone
        else:
            position[i], power[i, :3] = [*-np.asarray(light.direction), 0.0], light.irradiance
    count = len(lights) if shine else 0
    return LIGHTS.pack(light_position=position, light_power=power, light_cone=cone, light_count=count)


def shade_uniforms(scene: Scene, balance: Balance) -> bytes:
    """Contents of the Shade block; the first body's medium stands for all where they are the same."""
    medium = scene.bodies[0].medium
    assert medium is not None
    return SHADE.pack(
        extinction=[*bounded_extinction(medium, scene.diagonal), 0.0],
        emission=[*np.asarray(medium.emission), 0.0],
        expected_count=balance.expected_count,
        rounding=balance.rounding,
        count_share=scene.diagonal,
        coverage_floor=balance.coverage_floor,
    )


def environment_uniforms(environment: Environment) -> bytes:
    """Contents of the Environment block."""
    seen = environment.seen
    return ENVIRONMENT.pack(
        seen_first=[*seen.first, 0.0],
        seen_second=[*seen.second, 0.0],
        seen_tiles=seen.tiles,
        seen_turn=seen.turn,
        seen_scale=seen.scale,
        seen_kind=int(CONSTANTS[f"ENVIRONMENT_{seen.kind.upper()}"]),
        light_first=[*environment.first, 0.0],
        light_second=[*environment.second, 0.0],
        light_turn=environment.turn,
        light_scale=environment.scale,
        light_kind=int(CONSTANTS[f"ENVIRONMENT_{environment.kind.upper()}"]),
    )


def media_center(scene: Scene) -> Array:
    """(3,): center of the bounds of all bodies, from which positions count."""
    boxes = scene.boxes[scene.filled]
    return np.asarray(0.5 * boxes[:, 0].min(axis=0) + 0.5 * boxes[:, 1].max(axis=0))


def surface_uniforms(placed: PlacedScene, size: tuple[int, int]) -> bytes:
    """Contents of the Surfaces block, for a picture of this size."""
    scene, camera, media = placed.scene, placed.scene.camera, placed.media
    half_width, half_height = camera.half_extent(size)
    boxes = scene.boxes[scene.filled]
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    center = 0.5 * low + 0.5 * high - camera.eye
    ahead = float(center @ camera.forward)
    ends = scene.bounds - camera.eye
    farthest = float(np.maximum(ends[0] * camera.forward, ends[1] * camera.forward).sum())
    aside, above = camera.center(size)
    slant = center_aside(camera, size) if camera.fov_y is not None else np.zeros(3)
    return SURFACES.pack(
        surface_right=[*(camera.right * half_width), float(camera.fov_y is not None)],
        surface_up=[*(camera.up * half_height), above],
        surface_off_axis=[*(center - ahead * (camera.forward + slant)), aside],
        surface_ahead=[media.near - ahead, media.length, ahead, farthest - ahead],
        surface_reach=scene.diagonal,
        surface_eye_axial_depth=-media.near / media.length,
    )
