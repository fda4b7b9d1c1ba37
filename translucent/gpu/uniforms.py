"""Contents of the uniform blocks and of the table of objects: values that shaders read of a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.light import ALL_AROUND
from translucent.formulas.two_stream import two_stream_absorption, two_stream_scattering
from translucent.gpu.constants import CONSTANTS, OBJECT_TYPES
from translucent.gpu.features import FrameFeatures
from translucent.gpu.layout import (
    BODY,
    ENVIRONMENT,
    LIGHTS,
    MAX_LIGHT_VIEWS,
    MEDIA,
    OBJECT_ROW,
    SCATTER,
    SHADE,
    SURFACES,
    VIEW,
)
from translucent.gpu.placement import NEAR_SURFACE, Balance, FaceCounts, PlacedScene, SampleView
from translucent.media.medium import VACUUM, Medium
from translucent.planning.bodies import MAX_SLOTS, Slot
from translucent.planning.limits import MAX_LIGHTS, MAX_SCATTER_LIGHTS, SHEET_ON_OPAQUE
from translucent.planning.methods.base import MAX_LIGHT_POINTS
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import SMOOTH, Surface

#: A medium denser than this over the scene's diagonal is opaque anyway; the limit keeps float32 products finite.
MAX_SCENE_OPTICAL_DEPTH = 1e30


@dataclass(frozen=True, eq=False)
class BodyRoles:
    """Roles of the objects of a frame, apart from their placement.

    Attributes
    ----------
    anchored : bool
        Distances count from the center of each body, not from the camera.
    sheet_thicknesses : (objects,) float64
        In metres, for passes that draw an object as a sheet.
    counts : FaceCounts
        What their faces add to counts.
    slots : (objects,) int
        Whose winding number their crossings change.
    """

    anchored: bool
    sheet_thicknesses: Array
    counts: FaceCounts
    slots: npt.NDArray[np.intp]

    @classmethod
    def of(cls, features: FrameFeatures, counts: FaceCounts) -> BodyRoles:
        """Roles of all objects of a frame."""
        slots = np.zeros(len(features.scene.objects), dtype=np.intp)
        for number, slot in enumerate(features.slots):
            slots[list(slot.objects)] = number
        return cls(not features.plan.method.counts_from_camera, features.sheet_thicknesses, counts, slots)


def body_records(placed: PlacedScene, roles: BodyRoles, center: Array) -> npt.NDArray[Any]:
    """(objects,): contents of the Body blocks, except `clip_rows`, which depend on the view.

    Parameters
    ----------
    placed, roles
    center : (3,) float64
        Of the media.
    """
    scene, media, counts = placed.scene, placed.media, roles.counts
    camera, diagonal, objects = scene.camera, scene.diagonal, scene.objects
    records = np.zeros(len(objects), BODY.dtype)
    rows = placed.camera_from_offset(camera)
    axes = rows[:, 2].copy()
    if roles.anchored:
        axes[~placed.cut, 3] = 0.0
    records["world_from_normal"] = _normal_matrices(placed)
    records["eye_from_offset"] = np.eye(4)
    records["eye_from_offset"][:, :3, :3], records["eye_from_offset"][:, :3, 3] = (
        placed.matrices[:, :3, :3],
        placed.anchors,
    )
    records["axis"] = axes
    nothing = np.zeros(3)
    extinctions = np.array([nothing if item.medium is None else item.medium.extinction for item in objects])
    records["extinction"][:, :3] = np.minimum(extinctions, _densest(diagonal))
    records["color"][:, :3] = [item.base_color for item in objects]
    records["sheet_thickness"] = roles.sheet_thicknesses
    records["sheet_ior"] = [1.0 if item.medium is None else item.medium.ior for item in objects]
    records["sheet_tolerance"] = SHEET_ON_OPAQUE * diagonal
    starts_cut = placed.cut & (camera.fov_y is None)
    records["axial_start"] = np.where(starts_cut, 0.0, -float(CONSTANTS["NOTHING"]))
    records["count_weight"], records["count_offset"] = counts.weights, counts.offsets
    records["subpixel"], records["snapping_share"] = counts.subpixel, counts.snapping_share
    records["axial_depth_scale"] = 1.0 / media.length
    records["axial_depth_start"] = (rows[:, 2, 3] - axes[:, 3] - media.near) / media.length
    records["slot"] = roles.slots
    records["starts_unknown"] = placed.on_surface
    records["object"] = np.arange(len(objects))
    records["anchor_from_center"][:, :3] = placed.anchors + camera.eye - center
    return records


def clip_rows(placed: PlacedScene, view: SampleView) -> Array:
    """(objects, 4, 4): from offsets to clip space."""
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    rows = placed.camera_from_offset(camera)
    clip = np.zeros((len(rows), 4, 4))
    clip[:, 0], clip[:, 1] = rows[:, 0] / half_width, rows[:, 1] / half_height
    if camera.fov_y is None:
        clip[:, 3, 3] = 1.0
    else:
        clip[:, 3] = rows[:, 2]
    aside, above = camera.center(view.size)
    clip[:, 0] -= (2.0 * view.shift[0] / view.size[0] + aside) * clip[:, 3]
    clip[:, 1] += (2.0 * view.shift[1] / view.size[1] - above) * clip[:, 3]
    if view.depth_range is not None:
        near, far = view.depth_range
        if camera.fov_y is None:
            clip[:, 2] = (2.0 * rows[:, 2] - (near + far) * clip[:, 3]) / (far - near)
        else:
            clip[:, 2] = clip[:, 3] * (far + near) / (far - near) - np.eye(4)[3] * 2.0 * far * near / (far - near)
    else:
        # Triangles through the eye itself have no image: they project to 0/0. Clip them just ahead of it.
        for i in np.flatnonzero(placed.on_surface).tolist():
            clip[i, 2, 3] = -NEAR_SURFACE * placed.scene.objects[i].mesh.diagonal
    return clip


def turned_records(
    records: npt.NDArray[Any], placed: PlacedScene, cameras: Sequence[Camera], center: Array
) -> npt.NDArray[Any]:
    """(cameras, objects): contents of the Body blocks for orthographic cameras that look at a scene from outside.

    Parameters
    ----------
    records : (objects,)
        Of one of these cameras.
    placed : PlacedScene
        The scene before that camera.
    cameras : sequence of Camera
        All views are square.
    center : (3,) float64
        From which axial depths count.
    """
    turned = np.tile(records, (len(cameras), 1))
    axes = np.stack([[camera.right, camera.up, camera.forward] for camera in cameras])  # (k, 3, 3)
    half = np.array([camera.half_extent((1, 1)) for camera in cameras])
    middles = placed.anchors + placed.scene.camera.eye
    linear = axes[:, None] @ placed.matrices[None, :, :3, :3]  # (k, objects, 3, 3)
    eyes = np.array([camera.eye for camera in cameras])
    place = np.einsum("kij,knj->kni", axes, middles - eyes[:, None])
    clip = np.zeros((*turned.shape, 4, 4))
    clip[:, :, :2, :3], clip[:, :, :2, 3] = linear[:, :, :2] / half[:, None, :, None], place[:, :, :2] / half[:, None]
    clip[:, :, 3, 3] = 1.0
    turned["clip_from_offset"] = clip
    anchored = records["axis"][:, 3] == 0.0
    turned["axis"][:, :, :3], turned["axis"][:, :, 3] = linear[:, :, 2], np.where(anchored, 0.0, place[:, :, 2])
    ahead = np.where(anchored, place[:, :, 2], 0.0) - np.einsum("kj,kj->k", axes[:, 2], center - eyes)[:, None]
    turned["axial_depth_start"] = ahead / placed.media.length
    return turned


def _normal_matrices(placed: PlacedScene) -> Array:
    """(objects, 4, 4): matrices that transform normals of meshes to the world."""
    inverted = np.array([item.mesh.diagnosis.inverted for item in placed.scene.objects])
    matrices = np.tile(np.eye(4), (len(inverted), 1, 1))
    # The inverse transpose keeps outwards outwards under a mirror; only an inverted mesh has its normals inside.
    turned = np.linalg.inv(placed.matrices[:, :3, :3]).transpose(0, 2, 1) * np.where(inverted, -1.0, 1.0)[:, None, None]
    # The scale of a normal is lost when it is normalized; unit scale keeps it within float32.
    matrices[:, :3, :3] = turned / np.abs(turned).max(axis=(1, 2), keepdims=True)
    return matrices


def bounded_extinction(medium: Medium | None, diagonal: float) -> Array:
    """(3,): extinction in 1/m that float32 can multiply with lengths of the scene; 0 without a medium."""
    return np.zeros(3) if medium is None else np.minimum(medium.extinction, _densest(diagonal))


def _densest(diagonal: float) -> float:
    """Largest extinction in 1/m in a scene of this size."""
    return MAX_SCENE_OPTICAL_DEPTH / max(diagonal, float(np.finfo(np.float64).tiny))


#: Fields of an object, by their names in `OBJECT_ROW`.
Fields = Mapping[str, npt.ArrayLike]

#: Placement of an object where no rays are traced.
_UNPLACED: Fields = dict.fromkeys(("local_x", "local_y", "local_z", "first_node", "node_count", "fading"), 0.0)

#: Fields of a body in which no light diffuses.
_NO_DIFFUSION: Fields = {
    "diffuses": 0.0,
    "grid_low": 0.0,
    "grid_x": 0.0,
    "grid_y": 0.0,
    "grid_z": 0.0,
    "grid_size": 0.0,
    "first_layer": 0.0,
    "albedo": 0.0,
    "turned": 0.0,
    "conductance": 0.0,
    "exit_cosines": 0.0,
    "exit_weights": 0.0,
    "exit_share": 0.0,
    "ahead": 0.0,
    "ahead_layer": 0.0,
    "ahead_deepest": 0.0,
    "inner_mirror_flux": 0.0,
    "ahead_cosine": 0.0,
    "in_scattered_far": 0.0,
    "in_scattered_near": 0.0,
}


def object_rows(
    scene: Scene, sheets: Mapping[int, float], diffused: Mapping[int, Fields] | None = None
) -> tuple[Fields, ...]:
    """Media and surfaces of all objects.

    Parameters
    ----------
    scene : Scene
    sheets : dict of int to float
        Thickness in metres of the objects that are drawn without an inside, by their numbers.
    diffused : dict of int to dict, optional
        Fields of those in which light diffuses.
    """
    ranks = np.unique([body.priority for body in scene.objects], return_inverse=True)[1] + 1.0
    numbers: dict[Medium | None, int] = {}
    rows = []
    for i, body in enumerate(scene.objects):
        decides = i not in sheets and body.medium is not None and (body.has_interface or scene.overlap == "priority")
        own = {"rank": ranks[i] if decides else 0.0, "slot": numbers.setdefault(body.medium, len(numbers))}
        diffusion = {**_NO_DIFFUSION, **(diffused or {}).get(i, {})}
        rows.append({**_medium(scene, body, sheets.get(i)), **_surface(body, sheets.get(i)), **own, **diffusion})
    return tuple(rows)


def packed_objects(rows: Sequence[Fields], placements: Sequence[Fields] | None = None) -> npt.NDArray[np.float32]:
    """(objects, texels, 4): contents of the table; `placements` are those of `SceneHierarchies.place`."""
    placed = placements or [_UNPLACED] * len(rows)
    return OBJECT_ROW.pack([{**row, **place} for row, place in zip(rows, placed, strict=True)])


def _medium(scene: Scene, body: Object, sheet: float | None) -> Fields:
    medium, metres = body.medium or VACUUM, 1.0 if sheet is None else sheet
    extinction = metres * bounded_extinction(medium, scene.diagonal)
    with np.errstate(under="ignore"):
        albedo = medium.scattering / np.where(medium.extinction > 0, medium.extinction, 1.0)
    stream = two_stream_absorption(medium.absorption), two_stream_scattering(medium.scattering, medium.anisotropy)
    limit = MAX_SCENE_OPTICAL_DEPTH / max(scene.diagonal, float(np.finfo(np.float64).tiny))
    return {
        "extinction": extinction,
        "scattering": extinction * albedo,
        "emission": metres * np.asarray(medium.emission),
        "phase": medium.phase_function.parameters,
        "stream_absorption": np.minimum(stream[0], limit),
        "stream_scattering": np.minimum(stream[1], limit),
        "inner_mirror": diffuse_interface(medium.ior).reflected if medium.scatters else 0.0,
        "scatters_much": treatment_of(body) is Treatment.LAYER,
        "longest": np.linalg.norm(body.bounds[1] - body.bounds[0]),
    }


def _surface(body: Object, sheet: float | None) -> Fields:
    surface, opaque = body.surface or SMOOTH, body.medium is None
    return {
        "type": OBJECT_TYPES.index(_type(body, sheet)),
        "outwards": -1.0 if body.mesh.diagnosis.inverted else 1.0,
        "not_closed": not opaque and not body.mesh.diagnosis.solid,
        "plain": body.surface is None if opaque else body.plain,
        "color": body.base_color if opaque else np.asarray(surface.color),
        **surface_fields(surface),
        "ior": surface.ior if body.medium is None else body.medium.ior,
    }


def surface_fields(surface: Surface) -> Fields:
    """Numbers of a surface by the names of their fields in the table of objects."""
    return {
        "transmission": surface.transmission,
        "ior": surface.ior,
        "dispersion": surface.dispersion,
        "roughness": surface.roughness,
        "metallic": surface.metallic,
        "emissive": np.asarray(surface.emissive),
        "passed": surface.diffuse_transmission * np.asarray(surface.diffuse_transmission_color),
        "passed_share": surface.diffuse_transmission,
        "one_sided": not surface.double_sided,
        "film": (surface.iridescence, surface.iridescence_ior, surface.iridescence_thickness),
        "clearcoat": surface.clearcoat,
        "clearcoat_roughness": surface.clearcoat_roughness,
    }


def _type(body: Object, sheet: float | None) -> str:
    if body.medium is None:
        return "OPAQUE"
    if body.covers:
        return "UNSEEN"
    return "SOLID" if sheet is None else "THIN_WALL" if body.has_interface else "ABSORBER"


#: Optical depth, across the scene, of what stops the straight light of point and spot lights.
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
        scale = extinction[i, :3] / np.where(slot.medium.extinction > 0, slot.medium.extinction, 1.0)
        scattering[i, :3] = scale * np.asarray(slot.medium.scattering)
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
        A bit for each slot that stops the straight light of point and spot lights.
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
    """Number of bits of the numbers of `count` slots."""
    return max(count - 1, 0).bit_length()


def light_uniforms(scene: Scene, shine: bool, ground: Mapping[str, npt.ArrayLike]) -> bytes:
    """Contents of the Lights block; none of them lights surfaces where there are none that they could shine on.

    `ground` has its fields of the light that bodies send to a ground.

    Raises
    ------
    InputError
        If there are more lights than the block holds.
    """
    if shine and len(scene.lights) > MAX_LIGHTS:
        raise InputError(
            "lighting opaque objects", f"the scene has {len(scene.lights)} lights", f"use at most {MAX_LIGHTS} lights"
        )
    lights, center = scene.lights[:MAX_LIGHTS], media_center(scene)
    position, power, disc = np.zeros((3, MAX_LIGHTS, 4))
    cone = np.tile(ALL_AROUND, (MAX_LIGHTS, 1))
    for i, light in enumerate(lights):
        if isinstance(light, PositionalLight):
            position[i] = [*(np.asarray(light.position) - center), 1.0]
            power[i] = [*np.asarray(light.intensity), light.part_radius]
            cone[i], disc[i] = light.cone, light.disc
        else:
            position[i], power[i, :3] = [*-np.asarray(light.direction), 0.0], light.irradiance
    count = len(lights) if shine else 0
    return LIGHTS.pack(
        light_position=position,
        light_power=power,
        light_disc=disc,
        light_cone=cone,
        light_count=count,
        **ground,
    )


def shade_uniforms(scene: Scene, balance: Balance) -> bytes:
    """Contents of the Shade block; with the medium of the first body, where all are the same."""
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
    background = environment.seen
    return ENVIRONMENT.pack(
        seen_first=[*background.first, 0.0],
        seen_second=[*background.second, 0.0],
        seen_tiles=background.tiles,
        seen_turn=background.turn,
        seen_scale=background.scale,
        seen_kind=int(CONSTANTS[f"ENVIRONMENT_{background.kind.upper()}"]),
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
