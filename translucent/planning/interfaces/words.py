"""Words of plans on interfaces: whose they are, and what they do to light."""

from __future__ import annotations

import numpy as np

from translucent.planning.interfaces.places import with_interfaces
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.scene import Scene, object_names


def owners(scene: Scene) -> str:
    """Names of the objects whose interfaces change light."""
    return object_names(scene.objects[i] for i in with_interfaces(scene))


def effects_of(scene: Scene, *, bends: bool = True, mirrored: str = "the environment") -> str:
    """Effects of the interfaces of a scene: whether they bend rays, and what they mirror."""
    bodies = [body for body in scene.bodies if body.has_interface]
    surfaces = [body.surface for body in bodies if body.surface is not None]
    effects = []
    if any(body.medium is not None and body.medium.ior > 1 for body in bodies):
        effects.append(f"interfaces mirror {mirrored}{' and bend rays' if bends else ''} (ior above 1)")
    if any(surface.roughness > 0 for surface in surfaces):
        effects.append("rough ones blur both")
    if bends and any(surface.dispersion > 0 for surface in surfaces):
        effects.append("dispersion bends each channel on its own")
    if any(surface.iridescence for surface in surfaces):
        effects.append("thin films color what is mirrored")
    if any(surface.clearcoat for surface in surfaces):
        effects.append("clear coats mirror over them")
    if any(surface.transmission < 1 for surface in surfaces):
        effects.append("paint reflects what does not enter")
    if any((np.asarray(surface.color) != 1).any() or surface.color_texture for surface in surfaces):
        effects.append("colors tint what enters")
    if any(treatment_of(body) is Treatment.LAYER for body in bodies):
        effects.append("light that scatters many times leaves as from a layer (Kubelka and Munk, Saunderson)")
    if any(treatment_of(body) is Treatment.DIFFUSION for body in bodies):
        effects.append("light that scatters many times leaves as it has diffused in the body")
    return "; ".join(effects) or "interfaces"
