"""What any plan has to admit: what is wrong with the meshes of a scene, and what in it no pass renders."""

from __future__ import annotations

import numpy as np

from translucent.errors import InputError
from translucent.scene import Object, Scene
from translucent.thickness import Method, ThinLayer

#: Lights that are followed into media.
MAX_SCATTER_LIGHTS = 8

#: Optical depth across a scene beyond which float32 places are too coarse for where light is scattered.
DENSE = 1e5

#: What a plan says that does not follow lights into media; the renderer warns of it.
LIGHTS_LEFT_OUT = (
    "in-scattered light: this method leaves out what lights send into media that scatter; FragmentLists has it"
)


def open_bodies(scene: Scene) -> tuple[int, ...]:
    """Indices of objects that are declared solid and are not closed."""
    return tuple(
        i
        for i, body in enumerate(scene.objects)
        if body.medium is not None and body.sheet_thickness is None and not body.mesh.diagnosis.solid
    )


def open_limits(scene: Scene) -> list[str]:
    """For each open body, what is wrong with it and what to do."""
    limits = []
    for i in open_bodies(scene):
        mesh = scene.objects[i].mesh
        limits.append(
            f"{mesh.name!r}: {'; '.join(mesh.diagnosis.problems)}: close it, or declare it a sheet "
            "(sheet_thickness=..., --method thin-layer)"
        )
    return limits


def closed_sheet_limits(scene: Scene, method: ThinLayer) -> list[str]:
    """What `ThinLayer` leaves out of closed bodies."""
    solid = [body for body in scene.bodies if body.sheet_thickness is None and body.mesh.diagnosis.solid]
    names = ", ".join(repr(body.mesh.name) for body in solid)
    return [f"{names} closed, but drawn as sheets: what is inside is left out"] if solid else []


def refuse_varying_density(scene: Scene) -> None:
    """Raise where a density varies in space, which no pass renders."""
    if dense := [body.mesh.name for body in scene.bodies if body.density is not None]:
        raise InputError(
            f"rendering {', '.join(map(repr, dense))} with a density that varies",
            "no pass of the renderer goes through one",
            "march the rays on the CPU: tl.reference.march(scene, size)",
        )


def mesh_limits(scene: Scene, method: Method) -> list[str]:
    """What duplicated faces and parts inside out do to a thickness."""
    limits = []
    for body in scene.bodies:
        if found := body.mesh.diagnosis.duplicate_faces:
            limits.append(f"{body.mesh.name!r}: {found.count} duplicated faces, which count twice or cancel")
        if (parts := body.mesh.diagnosis.inside_out_parts) and not _is_sheet(body, method):
            limits.append(f"{body.mesh.name!r}: {parts} closed parts inside out: their pixels are marked invalid")
    return limits


def scattering_limits(scene: Scene) -> list[str]:
    """Where float32 cannot tell how far light gets into a medium that scatters it."""
    dense = [
        body.mesh.name
        for body in scene.bodies
        if body.medium is not None and body.medium.extinction.max() * scene.diagonal > DENSE
    ]
    names = ", ".join(map(repr, dense))
    return [f"{names}: scattered light is not exact beyond an optical depth of {DENSE:g}"] if dense else []


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
            "how light that is scattered many times spreads inside: it leaves as from a flat layer as thick as the ray's "
            "path, which edges and folds are not"
        )
    elif scattering := [medium for medium in media if medium.scatters]:
        if scatters:
            densest = max(float(np.max(np.asarray(medium.scattering))) for medium in scattering)
            effects.append(
                "light scattered more than once, of which there is much in bodies that are thicker than a mean free "
                f"path, here {1 / densest:.2g} m; light of the environment scattered"
            )
        else:
            effects.append(LIGHTS_LEFT_OUT if scene.lights else "in-scattered light: scattering only removes light")
    elif scene.lights and not scene.opaque:
        effects.append("lights: they shine on nothing, since no medium scatters and nothing is opaque")
    bent = [body for body in scene.bodies if body.has_interface]
    if bent and borders:
        effects.append(
            "refraction and reflection beyond the first interval of a ray: what lies farther on is crossed straight, "
            "and borders mirror the environment only"
        )
    elif bent:
        effects.append("refraction and reflection: rays go straight, though borders bend and mirror them")
    if clear := [body.mesh.name for body in scene.bodies if _is_invisible(body)]:
        effects.append(f"{', '.join(map(repr, clear))}: invisible, since nothing in it absorbs, scatters or emits")
    if not borders and (finished := [item.mesh.name for item in scene.opaque if item.surface is not None]):
        names = ", ".join(map(repr, finished))
        effects.append(f"surfaces of opaque objects: {names} reflect diffusely, in one color each")
    if scene.opaque:
        effects.append("shadows: light reaches opaque objects through everything")
    if scene.overlap != "priority" and len({body.priority for body in scene.bodies}) > 1:
        effects.append(f'priorities: overlap="{scene.overlap}" does not use them')
    return tuple(effects)


def _is_invisible(body: Object) -> bool:
    medium = body.medium
    return medium is not None and not body.has_interface and not (medium.extinction > 0).any() and not medium.emits


def _is_sheet(body: Object, method: Method) -> bool:
    return isinstance(method, ThinLayer) or body.sheet_thickness is not None
