"""Shading of a band of a picture: that of the reference, in pieces that fit into memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Integers
from translucent.cpu.caustics import CausticLight
from translucent.cpu.hits import slices
from translucent.cpu.light_paths import EmbreeLightPaths
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster
from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.reference import Hits, Rays, shade_hits, sheet_thicknesses
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.scene import Scene

Arrays = dict[str, npt.NDArray[Any]]
Sheets = tuple[float | None, ...]

#: Surfaces, times objects, that are shaded at a time: the working arrays stay below 100 MB.
SURFACES = 1 << 21

#: Arrays that an invalid pixel takes from the fallback; its validity and coverage are known already.
SHOWN = ("radiance", "transmittance", "optical_depth", "thickness")


@dataclass(frozen=True, eq=False)
class Shader:
    """Shader of hits, which gives the arrays of a frame.

    Attributes
    ----------
    scene : Scene
    sheets : tuple of float or None
        Thickness in metres of the sheet that each object is; None for a solid.
    fallback : tuple of float or None, or None
        The same where a pixel is not valid, for scenes with bodies that are not closed.
    light : SurfaceLight
        On the surfaces of the scene.
    """

    scene: Scene
    sheets: Sheets
    fallback: Sheets | None
    light: SurfaceLight

    @classmethod
    def of(cls, scene: Scene, plan: RenderPlan, meshes: Mapping[Mesh, RayCaster]) -> Shader:
        """Shader for a plan of the scene; `meshes` are all of it, ready for rays."""
        sheets = sheet_thicknesses(scene, plan.method)
        drawn = {i for step in plan.passes if step.name is PassName.THIN_LAYER_FALLBACK for i in step.objects}
        diagonals = [float(np.linalg.norm(body.bounds[1] - body.bounds[0])) for body in scene.objects]
        fallback = tuple(
            FALLBACK_SHEET * diagonals[i] if i in drawn and metres is None else metres
            for i, metres in enumerate(sheets)
        )
        if plan.caustics is None:
            light = SurfaceLight(EmbreeLightPaths(scene, sheets, meshes))
        else:
            light = CausticLight(scene, sheets, meshes, plan.caustics, plan.opaque_to_shadows)
        return cls(scene, sheets, fallback if drawn else None, light)

    def shade(self, rays: Rays, hits: Sequence[Hits]) -> Arrays:
        """Shade some rays into the arrays of a frame, (n,) or (n, 3), float64 and bool.

        Parameters
        ----------
        rays : Rays
        hits : sequence of Hits
            Of each object of the scene, as `shade_hits` takes them.
        """
        surfaces = np.sum([np.bincount(line.pixel, minlength=len(rays)) for line in hits], axis=0)
        parts = []
        for some in slices(surfaces * len(hits), SURFACES):
            chosen = np.arange(some.start, some.stop)
            parts.append(self._shade(rays.where(some), [on_rays(line, chosen, len(rays)) for line in hits]))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _shade(self, rays: Rays, hits: Sequence[Hits]) -> Arrays:
        shaded = shade_hits(self.scene, rays, hits, self.sheets, self.light)
        invalid = np.flatnonzero(~shaded["valid"])
        if self.fallback is not None and invalid.size:
            lines = [on_rays(line, invalid, len(rays)) for line in hits]
            again = shade_hits(self.scene, rays.where(invalid), lines, self.fallback, self.light)
            for name in SHOWN:
                shaded[name][invalid] = again[name]
        return shaded


def on_rays(hits: Hits, chosen: Integers, rays: int) -> Hits:
    """Hits on the `chosen` rays, with the rays renumbered."""
    number = np.full(rays, -1)
    number[chosen] = np.arange(len(chosen))
    kept = hits.where(number[hits.pixel] >= 0)
    return replace(kept, pixel=number[kept.pixel])
