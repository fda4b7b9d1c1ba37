"""Baking a thickness map in the background, and the model painted with it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from translucent.formulas.color import srgb_to_linear
from translucent.frames.aovs import EMPTY, false_colors
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import keep_drawn_normals, made_normals
from translucent.media.medium import Medium
from translucent.preview.document import Orbit
from translucent.preview.numbers import length_text
from translucent.preview.orbiting import camera_of
from translucent.preview.tasks import Report, Task
from translucent.preview.worker import Pool, Urgency
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

if TYPE_CHECKING:
    from translucent.bake.thickness_map import ThicknessMap


@dataclass(eq=False)
class Bake:
    """Baked map, and the scene with the model painted with it.

    Attributes
    ----------
    map : ThicknessMap
    mode : str
    scene : Scene
        The model painted with it.
    """

    map: ThicknessMap
    mode: str
    scene: Scene
    _seen: tuple[Orbit, Scene] | None = None

    @property
    def covered(self) -> float:
        """Share of the texels that have a value."""
        return float(np.mean(self.map.coverage))

    def thickest_text(self, unit: str) -> str:
        """Text of the largest value."""
        values = self.map.values[self.map.coverage]
        most = float(values.max(initial=0.0))
        return f"{most:.3g}" if self.mode == "local" else length_text(most, unit)

    def seen_from(self, orbit: Orbit) -> Scene:
        """Scene of the painted model; the same object while the camera stays."""
        if self._seen is None or self._seen[0] != orbit:
            self._seen = orbit, dataclasses.replace(self.scene, camera=camera_of(orbit))
        return self._seen[1]


def bake_map(task: Task, pool: Pool, body: Object, medium: Medium, mode: str, size: int, rays: int) -> Bake:
    """Bake a map of a body."""
    options: dict[str, Any] = {"mode": mode, "size": size, "rays": rays}
    if mode == "transmittance":
        options["medium"] = medium
    # xatlas holds the interpreter's lock while it makes texture coordinates.
    baked, normals = pool.call(task, _bake, body.mesh, options, urgency=Urgency.LATER)
    keep_drawn_normals(baked.mesh, normals)
    return Bake(baked, mode, painted(dataclasses.replace(body, mesh=baked.mesh), baked))


def _bake(report: Report, mesh: Mesh, options: dict[str, Any]) -> tuple[ThicknessMap, npt.NDArray[np.float32]]:
    """Bake a map; with what the picture needs of its mesh, which is diagnosed, too: its normals."""
    from translucent.bake.bake import bake_thickness

    def progress(done: int, total: int, cast: int) -> None:
        report(done / max(total, 1), f"{cast / 1e6:.1f} million rays")

    report(None, "starting")
    baked = bake_thickness(mesh, progress=progress, **options)
    _ = baked.mesh.diagnosis  # goes with the mesh
    return baked, made_normals(baked.mesh)


def painted(body: Object, baked: ThicknessMap) -> Scene:
    """Scene with the body in the false colors of a map, unshaded, in white surroundings."""
    values = np.where(baked.coverage, baked.values, 0.0)
    most = float(values.max(initial=0.0)) or 1.0
    colors = false_colors()[np.rint(np.clip(values / most, 0.0, 1.0) * 255).astype(np.intp)]
    colors[~np.asarray(baked.coverage, dtype=bool)] = EMPTY
    paint = Surface(
        transmission=0.0, roughness=1.0, color_texture=Texture(srgb_to_linear(colors / 255.0).astype(np.float32))
    )
    shown = dataclasses.replace(body, medium=Medium(absorption=1.0), surface=paint, sheet_thickness=None)
    return Scene([shown], camera_of(Orbit()), environment=Environment.constant((1.0, 1.0, 1.0)))
