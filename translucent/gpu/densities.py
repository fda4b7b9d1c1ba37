"""Spatially varying densities on the GPU: one 3D texture with all grids, and transforms into each body's unit box."""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import moderngl
import numpy as np

from translucent.arrays import Array
from translucent.errors import RenderError
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.diffusion import DiffusedLight, slot_grids
from translucent.gpu.layout import DENSITY
from translucent.media.density import DensityGrid, ExponentialDensity, LinearDensity
from translucent.planning.bodies import MAX_SLOTS, Slot
from translucent.scene.scene import Scene


class GridTexture:
    """Texture with the grids of the scene that was drawn last, one behind the other, in float32."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._grids: tuple[weakref.ref[DensityGrid], ...] = ()
        self._texture: moderngl.Texture3D | None = None

    def use(self, unit: int, grids: Sequence[DensityGrid]) -> None:
        """Bind grids for the shader that reads texture `unit`.

        Raises
        ------
        RenderError
            If this OpenGL has no texture that large.
        """
        held = tuple(weakref.ref(grid) for grid in grids)
        if self._texture is None or held != self._grids:
            self.release()
            self._texture = self._made([np.asarray(grid.values) for grid in grids])
            self._grids = held
        self._texture.use(unit)

    def _made(self, grids: Sequence[Array]) -> moderngl.Texture3D:
        width, height, depth = grids_extent(grids)
        layers = np.zeros((depth, height, width), dtype=np.float32)
        first = 0
        for values in grids:
            nx, ny, nz = values.shape
            with np.errstate(under="ignore"):
                layers[first : first + nz, :ny, :nx] = values.T
            first += nz
        limit = int(self._gl.info["GL_MAX_3D_TEXTURE_SIZE"])
        try:
            if max(layers.shape) > limit:
                raise moderngl.Error(f"a 3D texture ends at {limit}")
            texture = self._gl.texture3d((width, height, depth), 1, layers, alignment=1, dtype="f4")
        except moderngl.Error as error:
            raise RenderError(
                f"density grids of {width}x{height}x{depth} voxels in all",
                f"OpenGL has no room for them ({error})",
                "use coarser grids",
            ) from error
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def release(self) -> None:
        """Free the texture now."""
        if self._texture is not None:
            self._texture.release()
        self._texture, self._grids = None, ()


def grids_extent(grids: Sequence[Array]) -> tuple[int, int, int]:
    """Width, height and depth of the texture that holds grids (nx, ny, nz) one behind the other along z."""
    sizes = np.array([values.shape for values in grids] or [(1, 1, 1)])
    return int(sizes[:, 0].max()), int(sizes[:, 1].max()), int(sizes[:, 2].sum())


def scene_grids(scene: Scene, slots: Sequence[Slot]) -> list[DensityGrid]:
    """The grids of a scene, in the order in which the texture holds them."""
    densities = (scene.objects[slot.objects[0]].density for slot in slots)
    return [density for density in densities if isinstance(density, DensityGrid)]


def density_uniforms(scene: Scene, slots: Sequence[Slot], center: Array, light: DiffusedLight | None) -> bytes:
    """Contents of the Density block; `center` (3,) is where the points of shaders count from, in metres."""
    rows = np.zeros((3 * MAX_SLOTS, 4))
    profile, grid = np.zeros((2, MAX_SLOTS, 4))
    first = 0
    for i, slot in enumerate(slots):
        body = scene.objects[slot.objects[0]]
        density = body.density
        if density is None:
            continue
        rows[3 * i : 3 * i + 3] = body.to_unit_box(center)
        if isinstance(density, DensityGrid):
            shape = np.shape(density.values)
            profile[i, 0] = float(CONSTANTS["DENSITY_GRID"])
            grid[i] = [*shape, first]
            first += shape[2]
        elif isinstance(density, LinearDensity):
            profile[i] = [float(CONSTANTS["DENSITY_LINEAR"]), density.axis, density.start, density.end]
        elif isinstance(density, ExponentialDensity):
            kind = float(CONSTANTS["DENSITY_EXPONENTIAL"])
            profile[i] = [kind, density.axis, density.maximum, density.log_ratio]
    scattered = slot_grids(light, slots, center)
    return DENSITY.pack(density_rows=rows, density_profile=profile, density_grid=grid, **scattered)
