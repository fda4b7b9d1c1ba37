"""What any plan has to admit: what is wrong with the meshes of a scene, and what in it no pass renders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from translucent.errors import InputError
from translucent.media.density import DensityGrid
from translucent.planning.layers import layer_effects
from translucent.planning.methods import (
    BackFaceDepth,
    DepthPeeling,
    FragmentLists,
    Method,
    RayMarched,
    SignedDepth,
    ThinLayer,
)
from translucent.planning.methods.ray_marched import LEAST_SEEN, MAX_STEPS
from translucent.planning.render_plan import Capabilities, PassSpec, RenderPlan
from translucent.scene.scene import Object, Scene, object_names

#: Lights that are followed into media.
MAX_SCATTER_LIGHTS = 8

#: Optical depth across a scene beyond which float32 places are too coarse for where light is scattered.
DENSE = 1e5

#: Steps through an interval of varying density, at least, where nobody says how many.
LEAST_STEPS = 64

#: What a plan says that does not follow lights into media; the renderer warns of it.
LIGHTS_LEFT_OUT = (
    "in-scattered light: this method leaves out what lights send into media that scatter; FragmentLists has it"
)

#: What limits a plan for an OpenGL that cannot follow lights into media.
UNLIT = "pixels with media that scatter are marked invalid: their light takes OpenGL 4.3, or the reference"

#: What a plan says where media scatter and nothing shines.
ONLY_REMOVES = "in-scattered light: scattering only removes light"


def open_bodies(scene: Scene) -> tuple[int, ...]:
    """Indices of objects that are declared solid and are not closed."""
    return tuple(
        i
        for i, body in enumerate(scene.objects)
        if body.medium is not None and body.sheet_thickness is None and not body.mesh.diagnosis.solid
    )


def open_limits(scene: Scene) -> list[str]:
    """For each open body, what is wrong with it and what to do."""
    return [
        f"{mesh.name!r}: {'; '.join(mesh.diagnosis.problems)}: close it, or declare it a sheet "
        "(sheet_thickness=..., --method thin-layer)"
        for mesh in dict.fromkeys(scene.objects[i].mesh for i in open_bodies(scene))
    ]


def closed_sheet_limits(scene: Scene, method: ThinLayer) -> list[str]:
    """What `ThinLayer` leaves out of closed bodies."""
    solid = [body for body in scene.bodies if body.sheet_thickness is None and body.mesh.diagnosis.solid]
    return [f"{object_names(solid)} closed, but drawn as sheets: what is inside is left out"] if solid else []


def layer_limits(scene: Scene, method: Method) -> list[str]:
    """What is left out where a ray can cross more surfaces than the method keeps."""
    if isinstance(method, FragmentLists | RayMarched):
        return []
    most = method.max_layers if isinstance(method, DepthPeeling) else method.k
    meshes = [body.mesh for body in scene.bodies if body.sheet_thickness is None]
    # A ray crosses a convex body's surface twice, and no face more than once.
    possible = sum(2 if mesh.diagnosis.convex else len(mesh.faces) for mesh in meshes)
    return [f"pixels with more than {most} surfaces are marked invalid"] if possible > most else []


def marching_method(scene: Scene, method: Method | None, capabilities: Capabilities) -> RayMarched:
    """How rays march where the density varies: as asked for, or with a step for each voxel, and 64 at least.

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
    if not isinstance(method, RayMarched):
        raise InputError(
            type(method).__name__,
            f"{names}: the density varies, and only steps through the intervals tell how deep they are",
            "use RayMarched, or leave the choice to the planner",
        )
    return method


def marching_limits(scene: Scene, method: RayMarched) -> list[str]:
    """What marching leaves out."""
    what = (
        "optical depth, and what is emitted and scattered, are" if scene.varies else "what is emitted and scattered is"
    )
    limits = [
        f"{what} a sum over {method.steps} steps in each interval ({method.quadrature}); what lies behind a "
        f"transmittance of {LEAST_SEEN:g} is left out of it"
    ]
    if scene.varies and scene.lights:
        limits[0] += "; depths from the lights are exact, with a path through the density for each step and light"
    return limits


def mesh_limits(scene: Scene, method: Method) -> list[str]:
    """What duplicated faces, and parts or lobes inside out, do to a thickness."""
    limits = []
    for body in scene.bodies:
        diagnosis = body.mesh.diagnosis
        if found := diagnosis.duplicate_faces:
            limits.append(f"{body.mesh.name!r}: {found.count} duplicated faces, which count twice or cancel")
        if diagnosis.inside_out and not _is_sheet(body, method):
            parts = diagnosis.inside_out_parts
            what = f"{parts} closed parts inside out" if parts else "inside out in places"
            marked = (
                f"{type(method).__name__} cannot tell which pixels show one, so all that it covers are marked invalid; "
                "FragmentLists can"
                if isinstance(method, SignedDepth | BackFaceDepth)
                else "their pixels are marked invalid"
            )
            limits.append(f"{body.mesh.name!r}: {what}: {marked}")
    return list(dict.fromkeys(limits))


def scattering_limits(scene: Scene) -> list[str]:
    """Where float32 cannot tell how far light gets into a medium that scatters it."""
    dense = [
        body
        for body in scene.bodies
        if body.medium is not None and body.medium.extinction.max() * scene.diagonal > DENSE
    ]
    return (
        [f"{object_names(dense)}: scattered light is not exact beyond an optical depth of {DENSE:g}"] if dense else []
    )


def unmodelled_effects(scene: Scene, *, scatters: bool, borders: bool = False) -> tuple[str, ...]:
    """What the scene asks for and a plan does not render.

    Parameters
    ----------
    scene : Scene
    scatters : bool
        The plan has light scattered into the rays.
    borders : bool
        The plan has what the borders of bodies and the surfaces of opaque objects do to light.
    """
    media = [body.medium for body in scene.bodies if body.medium is not None]
    effects = []
    layered = [body for body in scene.bodies if body.surface is not None and body.surface.multiple_scattering]
    if borders and layered:
        effects.append(
            "how light that is scattered many times spreads inside: it leaves as from a flat layer as thick as the "
            "path of the ray, which edges and folds are not"
        )
    elif scattering := [medium for medium in media if medium.scatters]:
        if scatters:
            densest = max(float(np.max(np.asarray(medium.scattering))) for medium in scattering)
            effects.append(
                "light scattered more than once, of which there is much in bodies that are thicker than a mean free "
                f"path, here {1 / densest:.2g} m; light of the environment scattered"
            )
        else:
            effects.append(LIGHTS_LEFT_OUT if scene.lights else ONLY_REMOVES)
    elif scene.lights and not scene.opaque and not any(body.covers for body in scene.bodies):
        effects.append("lights: they shine on nothing, since no medium scatters and nothing is opaque")
    bent = [body for body in scene.bodies if body.has_interface]
    if bent and borders:
        effects.append(
            "refraction and reflection beyond the first interval of a ray: what lies farther on is crossed straight, "
            "and borders mirror the environment only"
        )
    elif bent:
        effects.append("refraction and reflection: rays go straight, though borders bend and mirror them")
    if clear := [body for body in scene.bodies if _is_invisible(body)]:
        effects.append(f"{object_names(clear)}: invisible, since nothing in it absorbs, scatters or emits")
    if not borders and (finished := [item for item in scene.opaque if item.surface is not None]):
        effects.append(f"surfaces of opaque objects: {object_names(finished)} reflect diffusely, in one color each")
    effects += layer_effects(scene, borders=borders)
    if scene.opaque:
        effects.append("shadows: light reaches opaque objects through everything")
    if scene.overlap != "priority" and len({body.priority for body in scene.bodies}) > 1:
        effects.append(f'priorities: overlap="{scene.overlap}" does not use them')
    return tuple(effects)


def _is_invisible(body: Object) -> bool:
    medium = body.medium
    return (
        medium is not None
        and not body.covers
        and not body.has_interface
        and not (medium.extinction > 0).any()
        and not medium.emits
    )


def with_unlit_marked(scene: Scene, chosen: RenderPlan, cost: float) -> RenderPlan:
    """The plan with a pass that finds the pixels in which media scatter light that this OpenGL cannot follow."""
    solids = ((i, body.medium) for i, body in enumerate(scene.objects) if body.sheet_thickness is None)
    scattering = tuple(i for i, medium in solids if medium is not None and medium.scatters)
    reason = "paths in media that scatter: this OpenGL cannot follow lights there, so their pixels are marked invalid"
    unlit = PassSpec("unlit", reason, scattering, 1, target="unlit", cost=cost)
    last = next(i for i, step in enumerate(chosen.passes) if step.name == "transmittance")
    passes = (*chosen.passes[:last], unlit, *chosen.passes[last:])
    return replace(chosen, passes=passes, limits=(*chosen.limits, UNLIT))


def with_ambient_told(plan: RenderPlan) -> RenderPlan:
    """The plan of a scene in which media emit what they scatter of the ambient radiance, made to say so."""
    told = "of the ambient radiance A, media scatter sigma_s A for each metre, which counts as emitted"
    passes = tuple(
        replace(step, reason=f"{step.reason}; {told}") if step.name in ("transmittance", "shade") else step
        for step in plan.passes
    )
    effects = tuple(effect for effect in plan.unmodelled if effect != ONLY_REMOVES)
    way = "what dims ambient light on its way to a place in the media"
    return replace(plan, passes=passes, unmodelled=(*effects, way))


def _is_sheet(body: Object, method: Method) -> bool:
    return isinstance(method, ThinLayer) or body.sheet_thickness is not None
