"""Contents of the uniform blocks: what the shaders are told about a frame and its bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.formulas.two_stream import two_stream_absorption, two_stream_scattering
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import (
    BODY,
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
from translucent.gpu.placement import NEAR_SURFACE, AxialRange, Placement
from translucent.media.medium import Medium
from translucent.planning.limits import MAX_SCATTER_LIGHTS
from translucent.planning.methods.base import MAX_LIGHT_POINTS
from translucent.planning.slots import MAX_SLOTS, Slot
from translucent.reference.sheets import SHEET_ON_OPAQUE
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PointLight
from translucent.scene.scene import Scene
from translucent.scene.surface import Surface

Array = npt.NDArray[np.float64]

#: A medium denser than this over the scene's diagonal is opaque anyway; the limit keeps float32 products finite.
MAX_SCENE_OPTICAL_DEPTH = 1e30


@dataclass(frozen=True)
class View:
    """The camera, and the sample points of a frame.

    Attributes
    ----------
    camera : Camera
    size : (int, int)
        Width and height in pixels.
    shift : (float, float)
        Of the sample points from the pixel centers, right and down, in pixels.
    depth_range : (float, float), optional
        Write depth between these metres; else all depths are alike, so that nothing is clipped but what is behind.
    """

    camera: Camera
    size: tuple[int, int]
    shift: tuple[float, float] = (0.0, 0.0)
    depth_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class BodyRole:
    """What a body is in a frame, besides where it is.

    Attributes
    ----------
    anchored : bool
        Distances count from the body's center, not from the camera.
    sheet_thickness : float
        In metres, for passes that draw the body as a sheet.
    count_weight : float
        What one face adds to the count, with the sign of its side.
    count_offset : float
        What it adds whatever its side: not 0 marks all pixels that the body covers.
    subpixel : float
        Step of the grid onto which the rasterizer moves vertices, in pixels; 0 where nothing is put down to it.
    counts_share : bool
        The fraction of a count has room for how far the rasterizer may misplace a face.
    slot : int
        Whose winding number its crossings change.
    number : int
        Its place among the objects of the scene.
    """

    anchored: bool
    sheet_thickness: float
    count_weight: float
    count_offset: float
    subpixel: float
    counts_share: bool
    slot: int
    number: int


def body_uniforms(placement: Placement, view: View, role: BodyRole, media: AxialRange, diagonal: float) -> bytes:
    """Contents of the Body block.

    Parameters
    ----------
    placement, view, role
    media : AxialRange
        Of all media of the scene.
    diagonal : float
        Of the scene, in metres.
    """
    body, camera = placement.body, view.camera
    seen = placement.camera_from_offset(camera)
    axis = seen[2].copy()
    if role.anchored and not placement.cut:
        axis[3] = 0.0
    anchor = seen[2, 3] - axis[3]
    eye_from_offset = np.eye(4)
    eye_from_offset[:3, :3], eye_from_offset[:3, 3] = body.matrix[:3, :3], placement.anchor
    return BODY.pack(
        clip_from_offset=_clip_rows(placement, view, seen),
        world_from_normal=_normal_matrix(placement),
        eye_from_offset=eye_from_offset,
        axis=axis,
        extinction=[*bounded_extinction(body.medium, diagonal), 0.0],
        color=[*body.base_color, 0.0],
        sheet_thickness=role.sheet_thickness,
        sheet_ior=1.0 if body.medium is None else body.medium.ior,
        sheet_tolerance=SHEET_ON_OPAQUE * diagonal,
        axial_start=0.0 if camera.fov_y is None and placement.cut else -float(CONSTANTS["NOTHING"]),
        count_weight=role.count_weight,
        count_offset=role.count_offset,
        subpixel=role.subpixel,
        snapping_share=role.subpixel / diagonal if role.counts_share else 0.0,
        place_scale=1.0 / media.length,
        place_start=(anchor - media.near) / media.length,
        slot=role.slot,
        starts_unknown=placement.on_surface,
        object=role.number,
    )


def _clip_rows(placement: Placement, view: View, seen: Array) -> Array:
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    clip = np.zeros((4, 4))
    clip[0], clip[1] = seen[0] / half_width, seen[1] / half_height
    if camera.fov_y is None:
        clip[3, 3] = 1.0
    else:
        clip[3] = seen[2]
    clip[0] -= 2.0 * view.shift[0] / view.size[0] * clip[3]
    clip[1] += 2.0 * view.shift[1] / view.size[1] * clip[3]
    if view.depth_range is not None:
        near, far = view.depth_range
        if camera.fov_y is None:
            clip[2] = (2.0 * seen[2] - (near + far) * clip[3]) / (far - near)
        else:
            clip[2] = clip[3] * (far + near) / (far - near) - np.eye(4)[3] * 2.0 * far * near / (far - near)
    elif placement.on_surface:
        # Triangles through the eye itself have no image: they project to 0/0. Clip them just ahead of it.
        clip[2, 3] = -NEAR_SURFACE * placement.body.mesh.diagonal
    return clip


def _normal_matrix(placement: Placement) -> Array:
    body = placement.body
    matrix = np.eye(4)
    # The inverse transpose keeps outwards outwards under a mirror; only an inverted mesh has its normals inside.
    matrix[:3, :3] = np.linalg.inv(body.matrix[:3, :3]).T * (-1.0 if body.mesh.diagnosis.inverted else 1.0)
    # The scale of a normal is lost when it is normalised; unit scale keeps it within float32.
    matrix[:3, :3] /= np.abs(matrix[:3, :3]).max()
    return matrix


def bounded_extinction(medium: Medium | None, diagonal: float) -> Array:
    """(3,): extinction in 1/m that float32 can multiply with lengths of the scene; 0 without a medium."""
    limit = MAX_SCENE_OPTICAL_DEPTH / max(diagonal, float(np.finfo(np.float64).tiny))
    return np.zeros(3) if medium is None else np.minimum(medium.extinction, limit)


def view_uniforms(view: View, media: AxialRange, opaque: AxialRange | None) -> bytes:
    """Contents of the View block."""
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    perspective = camera.fov_y is not None
    reach = (0.0, 0.0)
    if opaque is not None:
        reach = ((opaque.near - media.near) / media.length, media.length / opaque.length)
    return VIEW.pack(
        frame_size=[*view.size, *view.shift],
        ray_right=[*(camera.right * half_width * perspective), 0.0],
        ray_up=[*(camera.up * half_height * perspective), 0.0],
        ray_forward=[*camera.forward, 0.0],
        opaque_range=reach,
    )


def media_uniforms(scene: Scene, slots: tuple[Slot, ...], placements: list[Placement], media: AxialRange) -> bytes:
    """Contents of the Media block."""
    extinction, emission, scattering = (np.zeros((MAX_SLOTS, 4)) for _ in range(3))
    for i, slot in enumerate(slots[:MAX_SLOTS]):
        density = scene.objects[slot.objects[0]].density
        densest = 1.0 if density is None else max(density.maximum, 1.0)
        extinction[i, :3] = bounded_extinction(slot.medium, densest * scene.diagonal)
        emission[i, :3] = slot.medium.emission
        share = extinction[i, :3] / np.where(slot.medium.extinction > 0, slot.medium.extinction, 1.0)
        scattering[i] = *(share * np.asarray(slot.medium.scattering)), slot.medium.anisotropy
        extinction[i, 3] = sum(placements[k].expected_count[0] for k in slot.objects)
        emission[i, 3] = sum(placements[k].expected_count[1] for k in slot.objects)
    return MEDIA.pack(
        slot_extinction=extinction,
        slot_emission=emission,
        slot_scattering=scattering,
        place_metres=media.length,
        slot_bits=slot_bits(len(slots)),
    )


@dataclass(frozen=True, eq=False)
class LightViews:
    """Views from the lights that media scatter.

    Attributes
    ----------
    center : (3,) float64
        Of the media, in metres.
    inside : tuple of bool
        Whether each light is inside a body.
    spans : (lights, 4) float64
        Number of each light's first view, how many it has, texels along a side of each, and number of the first texel.
    rows : (4 views, 4) float64
        For each view the rows of x, y and w of the picture, and of place, from a point given from the center.
    """

    center: Array
    inside: tuple[bool, ...]
    spans: Array
    rows: Array


def scatter_uniforms(scene: Scene, media: AxialRange, view: View, lights: LightViews, points: int) -> bytes:
    """Contents of the Scatter block.

    Parameters
    ----------
    scene, media, view, lights
    points : int
        Gauss-Legendre points for each interval and light.
    """
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    place, power, spans = (np.zeros((MAX_SCATTER_LIGHTS, 4)) for _ in range(3))
    seen = scene.lights[: len(lights.spans)]
    for i, light in enumerate(seen):
        if isinstance(light, PointLight):
            place[i], power[i, :3] = [*(np.asarray(light.position) - lights.center), 1.0], light.intensity
        else:
            place[i], power[i, :3] = [*-np.asarray(light.direction), 0.0], light.irradiance
        power[i, 3] = lights.inside[i]
        spans[i] = lights.spans[i]
    rows = np.zeros((4 * MAX_LIGHT_VIEWS, 4))
    rows[: len(lights.rows)] = lights.rows
    gauss = np.zeros((MAX_LIGHT_POINTS, 4))
    points = min(points, MAX_LIGHT_POINTS)  # marching by other rules has no use for them
    nodes, weights = np.polynomial.legendre.leggauss(points)
    gauss[:points, 0], gauss[:points, 1] = (nodes + 1) / 2, weights / 2
    center = lights.center - camera.eye
    off_axis = center - (center @ camera.forward) * camera.forward
    return SCATTER.pack(
        scatter_right=[*(camera.right * half_width), 0.0],
        scatter_up=[*(camera.up * half_height), 0.0],
        scatter_off_axis=[*off_axis, 0.0],
        scatter_near=[media.near, media.near - float(center @ camera.forward), float(camera.fov_y is not None), 0.0],
        scatter_light_place=place,
        scatter_light_power=power,
        scatter_light_views=spans,
        scatter_views=rows,
        gauss=gauss,
        gauss_count=points,
        scatter_light_count=len(seen),
    )


def slot_bits(count: int) -> int:
    """Bits that tell `count` slots apart."""
    return max(count - 1, 0).bit_length()


def light_uniforms(scene: Scene, shine: bool) -> bytes:
    """Contents of the Lights block: none where there is nothing opaque that they could shine on.

    Raises
    ------
    InputError
        If there are more lights than the block holds.
    """
    lights = scene.lights if shine else ()
    if len(lights) > MAX_LIGHTS:
        raise InputError("lighting opaque objects", f"{len(lights)} lights", f"use at most {MAX_LIGHTS}")
    place, power = np.zeros((MAX_LIGHTS, 4)), np.zeros((MAX_LIGHTS, 4))
    for i, light in enumerate(lights):
        if isinstance(light, PointLight):
            place[i], power[i, :3] = [*(np.asarray(light.position) - scene.camera.eye), 1.0], light.intensity
        else:
            place[i], power[i, :3] = [*-np.asarray(light.direction), 0.0], light.irradiance
    return LIGHTS.pack(light_place=place, light_power=power, light_count=len(lights))


def shade_uniforms(scene: Scene, expected_count: tuple[float, float], rounding: float, coverage_floor: float) -> bytes:
    """Contents of the Shade block; the first body's medium stands for all where they are alike."""
    medium = scene.bodies[0].medium
    assert medium is not None
    return SHADE.pack(
        extinction=[*bounded_extinction(medium, scene.diagonal), 0.0],
        emission=[*np.asarray(medium.emission), 0.0],
        expected_count=expected_count,
        rounding=rounding,
        count_share=scene.diagonal,
        coverage_floor=coverage_floor,
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


def surface_uniforms(scene: Scene, media: AxialRange, view: View) -> bytes:
    """Contents of the Surfaces block."""
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    boxes = np.stack([body.bounds for body in scene.bodies])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    center = 0.5 * low + 0.5 * high - camera.eye
    ahead = float(center @ camera.forward)
    return SURFACES.pack(
        surface_right=[*(camera.right * half_width), float(camera.fov_y is not None)],
        surface_up=[*(camera.up * half_height), 0.0],
        surface_off_axis=[*(center - ahead * camera.forward), 0.0],
        surface_ahead=[media.near - ahead, media.length, ahead, float(np.linalg.norm(high - low))],
        surface_reach=scene.diagonal,
        surface_eye_place=-media.near / media.length,
    )


def surface_table(scene: Scene, sheets: Mapping[int, float]) -> npt.NDArray[np.float32]:
    """(objects, 5, 4): what ``shaders/shade/surfaces.frag`` reads of each object, besides what textures vary.

    `sheets`: thickness in metres of those objects that are drawn without an inside, by their numbers.
    """
    table = np.zeros((len(scene.objects), 5, 4), dtype=np.float32)
    for i, (row, body) in enumerate(zip(table, scene.objects, strict=True)):
        if body.medium is None:
            continue
        medium, surface = body.medium, body.surface or Surface()
        stream = two_stream_absorption(medium.absorption), two_stream_scattering(medium.scattering, medium.anisotropy)
        limit = MAX_SCENE_OPTICAL_DEPTH / max(scene.diagonal, float(np.finfo(np.float64).tiny))
        passed = surface.diffuse_transmission * np.asarray(surface.diffuse_transmission_color)
        much = surface.multiple_scattering and medium.scatters
        row[0] = medium.ior, surface.dispersion, i in sheets, much
        row[1, :3] = bounded_extinction(medium, scene.diagonal) * sheets.get(i, 0.0)
        row[1, 3] = np.linalg.norm(body.bounds[1] - body.bounds[0])
        row[2] = *passed, surface.roughness
        row[3] = *np.minimum(stream[0], limit), surface.transmission
        row[4] = *np.minimum(stream[1], limit), surface.diffuse_transmission
    return table
