"""What any plan has to admit: what is wrong with the meshes of a scene, and what in it no pass renders."""

from __future__ import annotations

from translucent.scene import Object, Scene
from translucent.thickness import Method, ThinLayer


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


def mesh_limits(scene: Scene, method: Method) -> list[str]:
    """What duplicated faces and parts inside out do to a thickness."""
    limits = []
    for body in scene.bodies:
        if found := body.mesh.diagnosis.duplicate_faces:
            limits.append(f"{body.mesh.name!r}: {found.count} duplicated faces, which count twice or cancel")
        if (parts := body.mesh.diagnosis.inside_out_parts) and not _is_sheet(body, method):
            limits.append(f"{body.mesh.name!r}: {parts} closed parts inside out: their pixels are marked invalid")
    return limits


def unmodelled_effects(scene: Scene, *, scatters: bool) -> tuple[str, ...]:
    """What the scene asks for and a plan does not render; `scatters`: it has light scattered into the rays."""
    media = [body.medium for body in scene.bodies if body.medium is not None]
    effects = []
    if any(medium.scatters for medium in media):
        effects.append(
            "light scattered more than once, and light from the environment scattered"
            if scatters
            else "in-scattered light: scattering only removes light"
        )
    if any(medium.ior > 1 for medium in media):
        effects.append("refraction and reflection: rays go straight, though ior is above 1")
    if scene.opaque:
        effects.append("shadows: light reaches opaque objects through everything")
    return tuple(effects)


def _is_sheet(body: Object, method: Method) -> bool:
    return isinstance(method, ThinLayer) or body.sheet_thickness is not None
