"""Grids on the GPU: densities that vary, and light that diffuses in bodies, by slots."""

from __future__ import annotations

import weakref
from collections import OrderedDict
from collections.abc import Hashable, Sequence
from dataclasses import replace
from threading import Lock
from typing import TYPE_CHECKING

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.diffusion.keys import diffusion_key
from translucent.errors import RenderError
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import DENSITY
from translucent.gpu.textures import unlike_powers
from translucent.media.density import DensityGrid, ExponentialDensity, LinearDensity
from translucent.planning.bodies import MAX_SLOTS, Slot
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from translucent.diffusion.cache import FieldCache, Fields
    from translucent.diffusion.field import DiffusionField
    from translucent.diffusion.irradiance_maps import IrradianceMap


#: Sizes of grids whose solutions are kept: a window has a small one while things move.
KEPT_GRIDS = 2


class DiffusedTexture:
    """Texture of the light that diffuses in the bodies of a scene.

    Attributes
    ----------
    texture : moderngl.Texture3D
        See ``shaders/shade/diffused_light.glsl`` and ``shaders/volume/scattered_light.glsl``.
    fields : Fields
    first_layers : dict of int to int
        Of each object in the texture.
    ground_layer : int
        Of the map of a ground, if there is one.
    """

    def __init__(self, gl: moderngl.Context, fields: Fields) -> None:
        self.fields = fields
        self.first_layers: dict[int, int] = {}
        parts = fields.surfaces | fields.volumes | fields.maps
        volumes = {number: part.volumes for number, part in parts.items()}
        shapes = np.array([values.shape[:3] for arrays in volumes.values() for values in arrays]).reshape(-1, 3)
        extent = shapes[:, 0].max(initial=1), shapes[:, 1].max(initial=1), shapes[:, 2].sum()
        if (ground := fields.ground) is not None:
            extent = max(extent[0], len(ground.values)), max(extent[1], len(ground.values)), extent[2] + 1
        width, height, layers = (unlike_powers(int(side)) for side in extent)
        texels = np.zeros((layers, height, width, 4), np.float32)
        first = 0
        for number, arrays in volumes.items():
            self.first_layers[number] = first
            for values in arrays:
                across, up, deep = values.shape[:3]
                texels[first : first + deep, :up, :across, : values.shape[3]] = values.transpose(2, 1, 0, 3)
                first += deep
        self.ground_layer = first
        if ground is not None:
            texels[first, : len(ground.values), : len(ground.values), :3] = ground.values
        self.texture = gl.texture3d((width, height, layers), 4, texels, dtype="f4")
        self.texture.filter = moderngl.LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = self.texture.repeat_z = False

    @np.errstate(under="ignore")
    def rows(self, center: Array) -> dict[int, dict[str, npt.ArrayLike]]:
        """Fields of a `OBJECT_ROW` of each object, for positions that count from `center`."""
        maps = {
            number: {**self._placed(number, own, own.values.shape[1:4], center), "diffuses": float(own.lit)}
            for number, own in self.fields.maps.items()
        }
        return maps | {
            number: {
                **self._placed(number, field, field.fluence.shape[1:4], center),
                "diffuses": 1.0,
                "albedo": field.albedo,
                "turned": 0.0 if field.travel is None else 1.0 - field.phase.mean_cosine,
                "phase": field.phase.parameters,
                "conductance": field.conductance,
                "exit_cosines": field.exits[0],
                "exit_weights": field.exits[1],
                "exit_share": field.exit_share,
                "ahead": field.ahead,
                "ahead_deepest": 0.0 if field.behind is None else field.behind.deepest * field.phase.mean_cosine,
                "ahead_layer": self.first_layers[number] + sum(part.shape[2] for part in field.volumes[:-1]),
                "inner_mirror_flux": diffuse_interface(field.ior).reflected_flux,
                "ahead_cosine": field.phase.mean_cosine,
                "in_scattered_far": field.in_scattered[0].astype(np.float32),
                "in_scattered_near": field.in_scattered[1].astype(np.float32),
            }
            for number, field in self.fields.surfaces.items()
        }

    def _placed(
        self, number: int, own: DiffusionField | IrradianceMap, size: tuple[int, ...], center: Array
    ) -> dict[str, npt.ArrayLike]:
        """Fields that place the grid of an object."""
        axes = own.placement.turn.T / own.placement.step
        return {
            "grid_low": own.placement.low - center,
            "grid_x": axes[0],
            "grid_y": axes[1],
            "grid_z": axes[2],
            "grid_size": size,
            "first_layer": self.first_layers[number],
        }

    @np.errstate(under="ignore")
    def map_uniform(self, number: int, center: Array) -> list[tuple[float, ...]]:
        """Rows of `opaque_map` in ``shaders/shade/opaque.frag``; 0 for an object without a map."""
        if (own := self.fields.maps.get(number)) is None:
            return [(0.0,) * 4] * 5
        placed = self._placed(number, own, own.values.shape[1:4], center)
        names = "grid_low", "grid_x", "grid_y", "grid_z", "grid_size"
        beside = (float(self.first_layers[number]), float(own.lit), 0.0, 0.0, 0.0)
        return [(*map(float, np.asarray(placed[name])), w) for name, w in zip(names, beside, strict=True)]


def ground_uniforms(light: DiffusedTexture | None, center: Array) -> dict[str, npt.ArrayLike]:
    """Fields of the Lights block for the light that bodies send to a ground; positions count from `center`."""
    if light is None or (ground := light.fields.ground) is None:
        names = "ground_light_plane", "ground_light_right", "ground_light_up"
        return {"ground_light_layer": np.zeros(2), **dict.fromkeys(names, np.zeros(4))}
    rows = ground.axes / np.square(ground.axes).sum(axis=1, keepdims=True)
    return {
        "ground_light_layer": (light.ground_layer, len(ground.values)),
        "ground_light_plane": (*ground.normal, ground.height - float(ground.normal @ center)),
        "ground_light_right": (*rows[0], float(rows[0] @ (center - ground.middle))),
        "ground_light_up": (*rows[1], float(rows[1] @ (center - ground.middle))),
    }


def slot_grids(light: DiffusedTexture | None, slots: Sequence[Slot], center: Array) -> dict[str, Array]:
    """Fields of the Density block: grids of the slots whose light is known, for positions from `center`."""
    low, grid = np.zeros((2, MAX_SLOTS, 4))
    ahead = np.zeros((MAX_SLOTS, 4))
    for i, slot in enumerate(slots):
        if light is not None and (field := light.fields.volumes.get(slot.objects[0])) is not None:
            low[i] = *(field.low - center), 1.0 / field.step
            grid[i] = *field.mean_radiance.shape[:3], light.first_layers[slot.objects[0]]
            ahead[i, :2] = field.mean_cosine, field.straight
            ahead[i, 2] = 0.0 if field.environment is None else field.environment.deepest
            ahead[i, 3] = field.cap
    return {"scattered_low": low, "scattered_grid": grid, "scattered_ahead": ahead}


class DiffusionCache:
    """Textures of the diffused light of the last scene.

    Attributes
    ----------
    warm_starts : bool
        As of `FieldCache`: for a window, whose light changes from frame to frame. Set it before anything is solved for.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self.warm_starts = False
        #: One for each size of grids: a small one is solved without waiting for a large one.
        self._solvers: OrderedDict[Diffusion, FieldCache] = OrderedDict()
        self._lock = Lock()
        self._last: DiffusedTexture | None = None

    def of(self, plan: RenderPlan) -> DiffusedTexture | None:
        """Diffused light of the bodies of a plan, None where there is none.

        In a window, maps of irradiance are left out until they have been stored.
        """
        if self.warm_starts and plan.exchanging and not self.has(diffusion_key(plan)):
            plan = replace(plan, exchanging=())
        if not plan.solves or not (fields := self._solver(plan.diffusion).of(plan)):
            return None
        if self._last is None or self._last.fields is not fields:
            self._release_last()
            self._last = DiffusedTexture(self._gl, fields)
        return self._last

    def has(self, key: Hashable) -> bool:
        """True if the light of this `diffusion_key` is known."""
        return any(solver.has(key) for solver in tuple(self._solvers.values()))

    def solve(self, plan: RenderPlan) -> None:
        """Find the light of a plan, to be drawn later. Needs no context: a thread may do it."""
        self._solver(plan.diffusion).of(plan)

    def keep(self, plan: RenderPlan, fields: Fields) -> None:
        """Store the light of a plan, computed elsewhere. Needs no context, either."""
        self._solver(plan.diffusion).keep(plan, fields)

    def release(self) -> None:
        """Free the texture."""
        self._release_last()
        for solver in tuple(self._solvers.values()):
            solver.clear()

    def _solver(self, diffusion: Diffusion) -> FieldCache:
        """Solver, with the parts of SciPy that it needs: half a second of loading for the first scene that needs it."""
        from translucent.diffusion.cache import FieldCache

        with self._lock:  # several threads use it
            if diffusion not in self._solvers:
                self._solvers[diffusion] = FieldCache(warm_starts=self.warm_starts)
                if len(self._solvers) > KEPT_GRIDS:
                    self._solvers.popitem(last=False)
            self._solvers.move_to_end(diffusion)
            return self._solvers[diffusion]

    def _release_last(self) -> None:
        if self._last is not None:
            self._last.texture.release()
            self._last = None


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
                raise moderngl.Error(f"3D textures are limited to {limit} texels along a side")
            texture = self._gl.texture3d((width, height, depth), 1, layers, alignment=1, dtype="f4")
        except moderngl.Error as error:
            raise RenderError(
                f"density grids of {width}x{height}x{depth} voxels in all",
                f"OpenGL does not have enough memory for these grids ({error})",
                "use grids with fewer voxels",
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


def density_uniforms(scene: Scene, slots: Sequence[Slot], center: Array, light: DiffusedTexture | None) -> bytes:
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
