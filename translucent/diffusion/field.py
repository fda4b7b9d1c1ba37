"""Subsurface light of a body by diffusion, as pictures look it up: two volumes around its surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers
from translucent.diffusion.entering import (
    BEFORE,
    Occluders,
    Sky,
    dimming_bodies,
    environment_parts,
    flux_of,
    from_itself,
    from_light,
    nearest_parts,
    sky_light,
    sky_of,
    sky_paths,
    transfer,
)
from translucent.diffusion.first_events import EnteringRays, joined_rays
from translucent.diffusion.grid import BodyGrid, Densities, body_grid, densities
from translucent.diffusion.photons import EnteringPhotons
from translucent.diffusion.solution import BodySystem, DiffuseSolution
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface, emergent_cosine, emergent_fluxes
from translucent.formulas.diffusion import emergent_radiance, in_scattered_shares
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster
from translucent.media.medium import Medium
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Object, Scene

#: Values (x, y, z, 3) in cells.
Volume = npt.NDArray[np.float32]

#: Cells by which values at the surface are spread beyond the cells that it crosses.
SPREAD = 3

#: Share by which light that has entered just now can darken the rest, at most: where the two do not fit together, as
#: beside the edge of a shadow.
FRESH = 0.8

#: Samples of a surface for each one at which paths through other bodies are found.
SAMPLES_FOR_PATH = 4

#: Least fraction of the paths through a body on which light counts as scattered: thinner parts hardly scatter.
LEAST_SCATTERED = 0.02

#: Fraction of a cell that is inside from which all of it is.
_WHOLE = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class DiffusionField:
    """Light of a body at its surface, on a grid of cells in world coordinates.

    Attributes
    ----------
    fluence, entering : (x, y, z, 3) float32
        Of scattered light below the surface; and flux that enters there times the albedo. Spread beyond the surface.
    scattered : (x, y, z, 3) float32
        Fraction of the paths through the body, from its surface, on which light is scattered; 1 deep inside.
    low : (3,) float64
        Corner of the grid in metres.
    step : float
        Side of a cell in metres.
    albedo : (3,) float64
        Of single scattering after similarity: sigma_s' / (sigma_a + sigma_s').
    conductance, exit_share, mean_cosine : float
        Of the interface; see `DiffuseInterface`.
    fluxes : tuple of 4 floats
        See `emergent_fluxes`.
    steps : int
        Iterations of the solver.
    cells : int
        In the system.
    ior : float
        Of the medium.
    ahead : (3,) float64
        Fraction of its extinction by light that is scattered ahead, g sigma_s / sigma_t: unscattered light here.
    in_scattered : tuple of two (3,) float64
        See `in_scattered_shares`.
    """

    fluence: Volume
    entering: Volume
    scattered: Volume
    low: Array
    step: float
    albedo: Array
    conductance: float
    exit_share: float
    mean_cosine: float
    fluxes: tuple[float, float, float, float]
    steps: int
    cells: int
    ior: float
    ahead: Array
    in_scattered: tuple[Array, Array]

    @cached_property
    def volumes(self) -> tuple[Volume, Volume]:
        """Arrays (x, y, z, 3) that pictures look up: along paths on which all light is scattered."""
        with np.errstate(under="ignore"):
            return self.fluence / self.scattered, self.entering / self.scattered

    def radiance(self, points: Array, cosine: Array) -> Array:
        """(k, 3): basic radiance L / n^2 below points of the surface, towards it: the mean over paths through the body.

        Parameters
        ----------
        points : (k, 3) float64
            In metres.
        cosine : (k,) float64
            Of the directions there, inside.
        """
        return self._emergent(self.fluence, self.entering, points, cosine)

    def scattered_radiance(self, points: Array, cosine: Array) -> Array:
        """`radiance` as if all light was scattered on the path through the body: the twin of ``diffused_light.glsl``.

        Its file is in ``shaders/shade``. Along a real path the fraction counts that is scattered there.
        """
        return self._emergent(*self.volumes, points, cosine)

    def _emergent(self, fluences: Volume, fluxes: Volume, points: Array, cosine: Array) -> Array:
        place = ((points - self.low) / self.step - 0.5).T
        fluence, entering = (
            np.stack([map_coordinates(values[..., i], place, order=1, mode="nearest") for i in range(3)], axis=1)
            for values in (fluences, fluxes)
        )
        uniform, rising, fresh, shadowed = self.fluxes
        steady = uniform + self.conductance * rising
        with np.errstate(under="ignore"):
            entering = np.minimum(entering.astype(np.float64), FRESH * steady / shadowed * fluence)
            light = emergent_radiance(
                fluence, entering, self.albedo, self.conductance, self.mean_cosine, cosine[:, None]
            )
            flux = self.albedo * (fluence * steady - entering * shadowed) + entering * fresh
            scaled = light * self.exit_share * fluence / np.maximum(flux, 1e-30)
            return np.asarray(np.maximum(scaled, 0.0) / (4.0 * np.pi * self.ior**2))


@dataclass(frozen=True, eq=False)
class Entrance:
    """Transfer from radiance outside to flux that enters a body through its interface.

    Attributes
    ----------
    visible : (s, k) float32
        For each radiance over the solid angle of a direction, see `transfer`; 0 where the sky is hidden.
    itself : (s, s) csr_array
        For the flux that leaves each sample, see `from_itself`.
    """

    visible: npt.NDArray[np.float32]
    itself: sparse.csr_array


@dataclass(frozen=True, eq=False)
class Spreading:
    """Means of samples' values in the cells where they lie, spread to cells around. Cells farther inside have others.

    Attributes
    ----------
    means : (c, s) csr_array
        Of the samples in each of the cells that have some.
    rings : list of csr_array
        Cells next to those that are known so far, each time: means of the known ones among the 26 around.
    cells : (n,) int64
        Places in the flat grid, of the cells that have samples and of each ring.
    deep, numbers : (m,), (m,) int64
        Places of the other cells in the system, and their numbers.
    shape : tuple of 3 int
    """

    means: sparse.csr_array
    rings: list[sparse.csr_array]
    cells: Integers
    deep: Integers
    numbers: Integers
    shape: tuple[int, ...]

    @classmethod
    def of(cls, grid: BodyGrid) -> Spreading:
        """Spread over a grid."""
        shape = grid.number.shape
        place = np.floor((grid.points - grid.cells.low) / grid.cells.step).astype(int)
        at = np.ravel_multi_index(tuple(np.clip(place, 0, np.array(shape) - 1).T), shape)
        cells, row, count = np.unique(at, return_inverse=True, return_counts=True)
        means = sparse.csr_array((1.0 / count[row], (row, np.arange(len(at)))), (len(cells), len(at)), np.float32)
        # The grid gets a border, in which nothing is known.
        wide = tuple(side + 2 for side in shape)
        numbered = np.full(wide, -2)
        numbered[1:-1, 1:-1, 1:-1] = -1
        flat, inner = numbered.ravel(), np.flatnonzero(numbered == -1)
        x, y, z = np.indices((3, 3, 3)).reshape(3, -1) - 1
        around = (x * wide[1] + y) * wide[2] + z
        known, rings = inner[cells], []
        last, flat[known] = known, np.arange(len(known))
        for _ in range(SPREAD):
            near = np.zeros(len(flat), bool)
            near[last[:, None] + around] = True
            last = np.flatnonzero(near & (flat == -1))
            column = flat[last[:, None] + around]
            each = (column >= 0).sum(axis=1)
            size, starts = (len(last), len(known)), np.concatenate([[0], np.cumsum(each)])
            weights = np.repeat(1.0 / each, each).astype(np.float32)
            rings.append(sparse.csr_array((weights, column[column >= 0], starts), size))
            flat[last] = len(known) + np.arange(len(last))
            known = np.concatenate([known, last])
        number = grid.number.ravel()
        deep = np.flatnonzero((flat[inner] < 0) & (number >= 0))
        place = np.zeros(len(flat), np.int64)
        place[inner] = np.arange(len(inner))
        return cls(means, rings, place[known], deep, number[deep], shape)

    def volume(self, values: Floats, deep: Floats) -> Floats:
        """(x, y, z, n) float32: values (s, n) of the samples, spread, and `deep` (cells, n) farther inside."""
        filled = self.means @ values
        for ring in self.rings:
            filled = np.concatenate([filled, ring @ filled])
        volume = np.zeros((int(np.prod(self.shape)), values.shape[1]), np.float32)
        volume[self.cells], volume[self.deep] = filled, deep[self.numbers]
        return volume.reshape(*self.shape, -1)


@dataclass(frozen=True, eq=False)
class LitBody:
    """Geometry and densities of a body in which light diffuses, for any medium and lights.

    Attributes
    ----------
    grid : BodyGrid
    casters : Casters
    sky : Sky
    """

    grid: BodyGrid
    casters: Occluders
    sky: Sky
    _entrances: dict[tuple[float, float], Entrance] = field(default_factory=dict)
    _sky_paths: dict[tuple[Mesh, bytes], sparse.csr_array] = field(default_factory=dict)

    @cached_property
    def spreading(self) -> Spreading:
        """From the samples of its surface to the cells around it."""
        return Spreading.of(self.grid)

    @cached_property
    def densities(self) -> Densities:
        """Densities of the body."""
        return densities(self.casters.body, self.grid)

    def sky_paths(self, others: Sequence[Object]) -> list[sparse.csr_array]:
        """Metres in each of other bodies on paths to the sky, see `sky_paths`; the last ones are cached."""
        places = [(body.mesh, body.matrix.tobytes()) for body in others]
        found = {
            place: self._sky_paths[place] if place in self._sky_paths else self._paths(body)
            for place, body in zip(places, others, strict=True)
        }
        self._sky_paths.clear()
        self._sky_paths.update(found)
        return [found[place] for place in places]

    def _paths(self, body: Object) -> sparse.csr_array:
        """Metres in another body, of paths from a part of the samples; all samples take those of the nearest one."""
        points, part = self.grid.points, slice(None, None, SAMPLES_FOR_PATH)
        start = points[part] + BEFORE * self.grid.cells.step * self.grid.face_normals[part]
        nearest = cKDTree(points[part]).query(points)[1]
        # Next to an edge samples face other directions: each takes every direction that its group of samples sees.
        groups = sparse.csr_array((np.ones(len(points)), (nearest, np.arange(len(points)))), (len(start), len(points)))
        metres = sky_paths(body, start, self.sky.directions, groups @ self.sky.visible.astype(np.float64) > 0.0)
        return sparse.csr_array(metres[nearest])

    def entrance(self, ior: float, roughness: float) -> Entrance:
        """Transfer through an interface with this index and roughness; the last one is cached."""
        if (ior, roughness) not in self._entrances:
            solid_angles = nearest_parts(self.sky.directions)[1]
            transferred = transfer(self.sky, solid_angles, ior, diffuse_interface(ior, roughness))
            itself = from_itself(self.sky, transferred, solid_angles)
            self._entrances.clear()
            self._entrances[ior, roughness] = Entrance((transferred * self.sky.visible).astype(np.float32), itself)
        return self._entrances[ior, roughness]


def lit_body(body: Object, opaque: RayCaster | None, step: float) -> LitBody:
    """Geometry of a body with cells of this side, shadowed by itself and by `opaque_surfaces`."""
    grid = body_grid(body, step)
    casters = Occluders(body, opaque)
    return LitBody(grid, casters, sky_of(grid, casters))


class DiffusingBody:
    """Solver of the subsurface light of one body and medium, for any lights.

    Parameters
    ----------
    lit : LitBody
    medium : Medium
    roughness : float
        Of its surface.
    corrected, warm_starts : bool
        See `BodySystem`.
    """

    @np.errstate(under="ignore")
    def __init__(
        self, lit: LitBody, medium: Medium, roughness: float, *, corrected: bool = True, warm_starts: bool = False
    ) -> None:
        self._lit, self._medium, self._roughness = lit, medium, roughness
        self._interface = diffuse_interface(medium.ior, roughness)
        self._entrance = lit.entrance(medium.ior, roughness)
        self._system = BodySystem(
            lit.grid, medium, roughness, lit.densities, corrected=corrected, warm_starts=warm_starts
        )

    @np.errstate(under="ignore")
    def field(
        self, scene: Scene, body: int, photons: EnteringPhotons | None = None, stops: RayCaster | None = None
    ) -> DiffusionField:
        """Subsurface light of the body in a scene, for its environment and lights; `body` is its number.

        `photons` carry the light that other bodies, whose surfaces are `stops`, refract and reflect; none of it goes
        straight through these.
        """
        dimming = dimming_bodies(scene, body)
        grid = self._lit.grid
        entering, bright = self._from_sky(environment_parts(scene.environment, self._lit.sky.directions), dimming)
        rays = [bright]
        inside = np.zeros((grid.count, 3))
        for light in scene.lights:
            if isinstance(light, PositionalLight) and (cell := _cell_at(grid, np.asarray(light.position))) >= 0:
                inside[cell] += 4.0 * np.pi * light.mean_share * np.asarray(light.intensity)
            else:
                rays.append(
                    from_light(grid, self._lit.casters, light, self._medium.ior, self._interface, dimming, stops)
                )
        if photons is not None:
            entering = entering + flux_of(photons, grid)
        found = self._system.solved(entering, self._entrance.itself, inside, rays)
        return _field(self._lit, self._medium, self._roughness, found)

    def _from_sky(self, parts: Array, others: list[Object]) -> tuple[Array, EnteringRays]:
        """Flux (s, 3) that enters from radiance over solid angles (k, 3), less what other bodies on its path absorb.

        Parts of the sky that are brighter than the rest are returned as rays. Light that others scatter continues
        elsewhere, and as much comes from there: in uniform light it is not missing.
        """
        if not parts.any():
            return np.zeros((len(self._lit.grid.points), 3)), joined_rays([])
        visible, sky, ior = self._entrance.visible, self._lit.sky, self._medium.ior
        means = parts / nearest_parts(sky.directions)[1][:, None]
        radiances = [np.broadcast_to(channel.astype(np.float32), visible.shape) for channel in means.T]
        absorbing = [body for body in others if body.medium is not None and np.any(body.medium.absorption)]
        paths = self._lit.sky_paths(absorbing)
        for channel in range(3) if absorbing else ():
            depth = sparse.csr_array(visible.shape)
            for body, metres in zip(absorbing, paths, strict=True):
                assert body.medium is not None
                depth = depth + metres * float(np.asarray(body.medium.absorption)[channel])
            lost = depth.tocoo()
            radiances[channel] = radiances[channel].copy()
            radiances[channel][lost.row, lost.col] *= optics.transmittance(lost.data)
        mirrored = (1.0 - diffuse_interface(ior).entering) / self._interface.entering
        return sky_light(sky, visible, radiances, self._lit.grid.normals, ior, mirrored)


def _cell_at(grid: BodyGrid, point: Array) -> int:
    """Number of the cell at a point, -1 outside the body; in cells that are cut, the nearest sample decides."""
    place = np.floor((point - grid.cells.low) / grid.cells.step).astype(int)
    if (place < 0).any() or (place >= grid.number.shape).any():
        return -1
    if grid.cells.inside[tuple(place)] < _WHOLE:
        nearest = int(((grid.points - point) ** 2).sum(axis=1).argmin())
        if (point - grid.points[nearest]) @ grid.face_normals[nearest] > 0.0:
            return -1
    return int(grid.number[tuple(place)])


def _field(lit: LitBody, medium: Medium, roughness: float, found: DiffuseSolution) -> DiffusionField:
    grid, extinction = lit.grid, medium.extinction
    reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    total = reduced + np.asarray(medium.absorption)
    albedo = np.where(total > 0.0, reduced / np.where(total > 0.0, total, 1.0), 0.0)
    interface, polished = diffuse_interface(medium.ior, roughness), diffuse_interface(medium.ior)
    scattered = np.maximum(found.scattered, LEAST_SCATTERED)
    values = np.concatenate([found.fluence, albedo * found.entering, scattered], axis=1)
    deep = np.concatenate([found.inside, np.zeros_like(found.inside), np.ones_like(found.inside)], axis=1)
    volume = lit.spreading.volume(values.astype(np.float32), deep.astype(np.float32))
    cosine = emergent_cosine(float(albedo.mean()), medium.ior)
    ahead = np.asarray(medium.scattering) * max(medium.anisotropy, 0.0)
    # Of diffuse light, four times the volume over the area.
    chord = 2.0 * lit.casters.body.mean_thickness * float(np.average(lit.densities.cells, weights=grid.volumes))
    return DiffusionField(
        fluence=np.ascontiguousarray(volume[..., :3]),
        entering=np.ascontiguousarray(volume[..., 3:6]),
        scattered=np.where(volume[..., 6:] > 0.0, volume[..., 6:], np.float32(1.0)),
        low=grid.cells.low,
        step=grid.cells.step,
        albedo=albedo,
        conductance=interface.conductance,
        exit_share=interface.exit_share,
        mean_cosine=cosine,
        fluxes=emergent_fluxes(medium.ior, cosine),
        steps=found.steps,
        cells=grid.count,
        ior=medium.ior,
        ahead=ahead / np.where(extinction > 0.0, extinction, 1.0),
        in_scattered=in_scattered_shares(
            polished.reflected, optics.transmittance(np.asarray(medium.absorption) * chord)
        ),
    )
