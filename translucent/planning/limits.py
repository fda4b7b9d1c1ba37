"""Limits of thickness that hold for every method: defects of the meshes of a scene, and rounding in float32."""

from __future__ import annotations

import numpy as np

from translucent.errors import InputError
from translucent.media.density import DensityGrid
from translucent.planning.bodies import open_bodies, scatters, sheets_of
from translucent.planning.caustics import Caustics
from translucent.planning.methods import Method, RayMarched
from translucent.planning.methods.ray_marched import MAX_STEPS
from translucent.planning.notes import Note, NoteKind
from translucent.planning.render_plan import Capabilities
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.lights import PositionalLight, SpotLight
from translucent.scene.scene import Scene, object_names

#: Largest number of lights that are followed into media.
MAX_SCATTER_LIGHTS = 8

#: Optical depth across a scene beyond which float32 places are too coarse for where light is scattered.
DENSE = 1e5

#: Smallest number of steps through an interval of varying density, unless told otherwise.
LEAST_STEPS = 64

#: Share of the scene's diagonal by which a visible sheet may lie behind an opaque surface.
SHEET_ON_OPAQUE = 1e-6

#: Gauss-Legendre points through an interval of fog of one density.
FOG_POINTS = 16

#: Note of a plan for an OpenGL version that cannot follow lights into media.
UNLIT = Note(
    NoteKind.UNLIT, "pixels with media that scatter are marked invalid: their light takes OpenGL 4.3, or the reference"
)


def open_limits(scene: Scene) -> list[Note]:
    """Notes on each open body: its defects, and what to do."""
    return [
        Note(
            NoteKind.OPEN_MESH,
            f"{mesh.name!r}: {'; '.join(mesh.diagnosis.problems)}: close it, or declare it a sheet "
            "(sheet_thickness=..., --method thin-layer)",
        )
        for mesh in dict.fromkeys(scene.objects[i].mesh for i in open_bodies(scene))
    ]


def layer_limits(scene: Scene, method: Method) -> list[Note]:
    """Notes on rays that may cross more surfaces than the method keeps."""
    if (most := method.layer_limit) is None:
        return []
    meshes = [body.mesh for body in scene.bodies if body.sheet_thickness is None]
    # A ray crosses a convex body's surface twice, and no face more than once.
    possible = sum(2 if mesh.diagnosis.convex else len(mesh.faces) for mesh in meshes)
    if possible <= most:
        return []
    return [Note(NoteKind.LAYER_LIMIT, f"pixels with more than {most} surfaces are marked invalid")]


def marching_method(scene: Scene, method: Method | None, capabilities: Capabilities) -> Method:
    """Ray marching for varying densities: as asked for, or with a step for each voxel, and at least 64.

    Raises
    ------
    InputError
        If another method is asked for, or the machine cannot march.
    """
    names = object_names(body for body in scene.bodies if body.density is not None)
    if not capabilities.shader_storage:
        raise InputError(
            f"rendering {names} with a density that varies",
            "this OpenGL has no shader storage buffers, which came with 4.3",
            "render on the CPU (backend='cpu'), or march there: tl.reference.march(scene, size)",
        )
    if method is None:
        grids = [np.shape(body.density.values) for body in scene.bodies if isinstance(body.density, DensityGrid)]
        return RayMarched(steps=min(max([LEAST_STEPS, *(max(shape) for shape in grids)]), MAX_STEPS))
    if not method.marches:
        raise InputError(
            type(method).__name__,
            f"{names}: the density varies, and only steps through the intervals tell how deep they are",
            "use RayMarched, or leave the choice to the planner",
        )
    return method


def scattered_again_method(scene: Scene, caustics: Caustics | None = None) -> RayMarched:
    """Ray marching through fog of one density.

    A few Gauss-Legendre points, which are more accurate than four times as many steps; near a lamp inside, where light
    falls off as 1 / r^2 from a peak, or for a spot, which shines between two angles, steps of equal angles instead; and
    even steps through light of photons, which is as narrow as cells.
    """
    if caustics is not None:
        return RayMarched(steps=LEAST_STEPS)
    if any(isinstance(light, SpotLight) for light in scene.lights):
        return RayMarched(steps=LEAST_STEPS, quadrature="equiangular")
    lamps = [np.asarray(light.position) for light in scene.lights if isinstance(light, PositionalLight)]
    fogs = [body.bounds for body in scene.bodies if treatment_of(body) is Treatment.VOLUME]
    if any((low <= lamp).all() and (lamp <= high).all() for lamp in lamps for low, high in fogs):
        return RayMarched(steps=LEAST_STEPS, quadrature="equiangular")
    return RayMarched(steps=FOG_POINTS, quadrature="gauss")


def mesh_limits(scene: Scene, method: Method) -> list[Note]:
    """Notes on errors of thickness from duplicated faces, and from parts or lobes that are inside out."""
    limits = []
    for body in scene.bodies:
        diagnosis = body.mesh.diagnosis
        if found := diagnosis.duplicate_faces:
            text = f"{body.mesh.name!r}: {found.count} duplicated faces, which count twice or cancel"
            limits.append(Note(NoteKind.DUPLICATED_FACES, text))
        if diagnosis.inside_out and body.sheet_thickness is None and not method.makes_sheets:
            parts = diagnosis.inside_out_parts
            what = f"{parts} closed parts inside out" if parts else "inside out in places"
            marked = (
                "their pixels are marked invalid"
                if method.ordered
                else f"{type(method).__name__} cannot tell which pixels show one, so all that it covers are marked "
                "invalid; FragmentLists can"
            )
            limits.append(Note(NoteKind.INSIDE_OUT, f"{body.mesh.name!r}: {what}: {marked}"))
    return list(dict.fromkeys(limits))


def scattering_limits(scene: Scene) -> list[Note]:
    """Notes on scattering media too dense for float32 to resolve how far light gets into them."""
    if not scatters(scene):
        return []
    dense = [
        body
        for body in scene.bodies
        if body.medium is not None and body.medium.extinction.max() * scene.diagonal > DENSE
    ]
    if not dense:
        return []
    text = f"{object_names(dense)}: scattered light is not exact beyond an optical depth of {DENSE:g}"
    return [Note(NoteKind.DENSE_SCATTERING, text)]


def sheet_limits(scene: Scene) -> list[Note]:
    """Notes on what sheets among ordered intervals leave out."""
    if not sheets_of(scene) or not any(body.medium is not None and body.medium.emits for body in scene.bodies):
        return []
    text = (
        "declared sheets among emitting media have no place in the order: they dim all light, and what they emit "
        "is left out"
    )
    return [Note(NoteKind.SHEETS_WITHOUT_ORDER, text)]
