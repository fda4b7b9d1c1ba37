"""What a plan adds where light changes at the borders of bodies: they bend, mirror, tint or spread it."""

from __future__ import annotations

import numpy as np

from translucent.render_plan import PassSpec
from translucent.scene import Scene
from translucent.slots import may_overlap


def border_passes(scene: Scene, draw_cost: float, shade_cost: float) -> tuple[PassSpec, ...]:
    """The pass that finds borders, and the one that shades them; none where nothing happens at a border."""
    objects = tuple(i for i, body in enumerate(scene.objects) if body.has_interface)
    if not objects:
        return ()
    names = ", ".join(repr(scene.objects[i].mesh.name) for i in objects)
    found = f"{names}: normal and place of the border where a ray enters, and of the one where it leaves"
    return (
        PassSpec("interfaces", found, objects, 2, cost=draw_cost),
        PassSpec("surfaces", f"{_effects(scene)}; the path through the first interval bends with it", cost=shade_cost),
    )


def touching_borders(scene: Scene) -> str | None:
    """Why the order of surfaces tells more where bodies with borders may touch; None if none do."""
    solids = [body for body in scene.bodies if body.sheet_thickness is None]
    for j, later in enumerate(solids):
        for earlier in solids[:j]:
            if (earlier.has_interface or later.has_interface) and may_overlap(earlier, later):
                return (
                    f"borders of {earlier.mesh.name!r} and {later.mesh.name!r} may touch: the order tells where a ray "
                    "leaves both"
                )
    return None


def _effects(scene: Scene) -> str:
    """What happens at the borders of this scene, in words."""
    bodies = [body for body in scene.bodies if body.has_interface]
    surfaces = [body.surface for body in bodies if body.surface is not None]
    effects = []
    if any(body.medium is not None and body.medium.ior > 1 for body in bodies):
        effects.append("borders mirror the environment and bend rays (ior above 1)")
    if any(surface.roughness > 0 for surface in surfaces):
        effects.append("rough ones blur both")
    if any(surface.dispersion > 0 for surface in surfaces):
        effects.append("dispersion bends each channel on its own")
    if any(surface.transmission < 1 for surface in surfaces):
        effects.append("paint reflects what does not enter")
    if any((np.asarray(surface.color) != 1).any() or surface.color_texture for surface in surfaces):
        effects.append("colors tint what enters")
    if any(surface.multiple_scattering for surface in surfaces):
        effects.append("light that scatters many times leaves as from a layer (Kubelka and Munk)")
    return "; ".join(effects) or "borders"
