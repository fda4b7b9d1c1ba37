"""Radiance of rays that bend, in place of that of the straight rays of a band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Integers
from translucent.cpu.caster import Caster
from translucent.cpu.diffused import DiffusedLight
from translucent.cpu.facets import Spread
from translucent.cpu.picture import Band
from translucent.cpu.shading import Arrays, Shader, on_rays
from translucent.cpu.traced import RayTree
from translucent.reference import Hits, Rays

#: Rays of the picture that are followed together: the working arrays stay below 100 MB.
BATCH = 1 << 14


@dataclass(frozen=True, eq=False)
class BentLight:
    """Light along rays that bend at the interfaces of a scene.

    Attributes
    ----------
    tree : RayTree
    bending : tuple of int
        Objects with interfaces.
    """

    tree: RayTree
    bending: tuple[int, ...]

    @classmethod
    def of(
        cls, shader: Shader, caster: Caster, size: tuple[int, int], tree: tuple[int, int], diffused: DiffusedLight
    ) -> BentLight:
        """Light for pictures of this size; `caster` has the objects of the shader's scene.

        `tree`: depth and forks, as of `TracedInterfaces`.
        """
        scene = shader.scene
        pixel = 2.0 * scene.camera.half_extent(size)[1] / size[1]
        rays = RayTree(shader.light, caster, size[0] / size[1], *tree, diffused, pixel)
        return cls(rays, tuple(i for i, body in enumerate(scene.objects) if body.has_interface))

    def put_into(self, shaded: Arrays, rays: Rays, hits: Sequence[Hits], band: Band, spread: Spread | None) -> None:
        """Replace radiance and validity of those rays that bend; parameters as for `Shader.shade` and `RayTree.see`."""
        touched = np.zeros(len(rays), dtype=bool)
        for i in self.bending:
            touched[hits[i].pixel[hits[i].distance >= 0]] = True
        chosen = np.flatnonzero(touched & shaded["valid"])
        for begin in range(0, len(chosen), BATCH):
            self._put(shaded, rays, hits, chosen[begin : begin + BATCH], band.first_row * band.width, spread)

    def _put(
        self, shaded: Arrays, rays: Rays, hits: Sequence[Hits], some: Integers, first: int, spread: Spread | None
    ) -> None:
        own = [on_rays(line, some, len(rays)) for line in hits]
        light = self.tree.see(rays.where(some), own, some + first, spread)
        shaded["radiance"][some], shaded["valid"][some] = light.radiance, light.valid
