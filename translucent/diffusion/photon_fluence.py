"""Light that bodies bend and mirror into media, by photons: fluence in fog, flux into other bodies.

A cell's fluence is the power times the length of all ways through it, over its volume: the estimator by track lengths
(Lux & Koblinger 1991), of ways that Jarosz et al. 2011 call photon beams. It has no bias, and takes every way whole, so
that few photons are enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers
from translucent.diffusion.photons import PhotonSegments, photon_segments
from translucent.formulas import optics
from translucent.planning.caustics import Caustics
from translucent.scene.scene import Scene

#: Cells of the finer grid along the side of one of light that is scattered again, at most, and in all of a body.
FINER, MOST_CELLS = 4, 1 << 20

#: Largest length of a part of a way, in cells, all of which counts in one of them.
PART = 0.7

#: Cells by which ways are followed straight on beyond the body, so that cells that its surface cuts have all light.
BEYOND = 1.5

#: Parts that are added up together.
_TOGETHER = 1 << 19


@dataclass(frozen=True, eq=False)
class FineCells:
    """Cells that divide those of a coarser grid.

    Attributes
    ----------
    low : (3,) float64
        Corner of the grid in metres.
    step : float
        Side of a fine cell in metres.
    shape : (3,) ints
    finer : int
        How many of them lie along the side of a coarse one.
    """

    low: Array
    step: float
    shape: tuple[int, int, int]
    finer: int

    @classmethod
    def of(cls, low: Array, step: float, shape: tuple[int, ...]) -> FineCells:
        """As fine as there is room for, in a grid with cells of this side."""
        room = np.cbrt(MOST_CELLS / float(np.prod(shape)))
        finer = int(min(max(room, 1.0), FINER))
        return cls(low, step / finer, (shape[0] * finer, shape[1] * finer, shape[2] * finer), finer)

    def coarse(self, values: Array) -> Array:
        """Means (x, y, z, 3) of values (x, y, z, 3) over the cells of the coarse grid."""
        k = self.finer
        x, y, z = (size // k for size in self.shape)
        return np.asarray(values.reshape(x, k, y, k, z, k, -1).mean(axis=(1, 3, 5)))


@dataclass(frozen=True, eq=False)
class EnteringPhotons:
    """Photons that enter a body through its interface.

    Attributes
    ----------
    points : (n, 3) float64
        In metres in the world.
    power : (n, 3) float64
        In W, of what is not mirrored.
    """

    points: Array
    power: Array


@dataclass(frozen=True, eq=False)
class BentLight:
    """Light that interfaces have turned, as photons carry it to media.

    Attributes
    ----------
    fluence : dict of int to (x, y, z, 3) float64
        In the cells of objects without an interface, in W/m^2. What a medium scatters ahead counts as unscattered, as
        `translucent.diffusion.volume` has it; what it scatters else is not in it.
    entering : dict of int to EnteringPhotons
        Of other objects in which light diffuses, what had been turned before it came there.
    """

    fluence: dict[int, Array]
    entering: dict[int, EnteringPhotons]


def bent_light(scene: Scene, caustics: Caustics, grids: Mapping[int, FineCells], bodies: Sequence[int]) -> BentLight:
    """Light that interfaces of a scene turn into these cells of objects, and through the interfaces of bodies."""
    sums = {body: np.zeros((int(np.prod(cells.shape)), 3)) for body, cells in grids.items()}
    parts: dict[int, list[PhotonSegments]] = {body: [] for body in bodies}
    rng = np.random.default_rng((caustics.seed, len(grids)))
    for segments in photon_segments(scene, caustics.in_media, caustics.seed):
        turned = segments.where(segments.bent)
        for body, cells in grids.items():
            _add(sums[body], turned.where(turned.filling[:, body] > 0.0), body, cells, rng)
        for body, found in parts.items():
            found.append(turned.where((turned.entered == body) & turned.bent_before))
    fluence = {body: sums[body].reshape(*cells.shape, 3) / cells.step**3 for body, cells in grids.items()}
    return BentLight(fluence, {body: _entering(found) for body, found in parts.items()})


def _entering(parts: list[PhotonSegments]) -> EnteringPhotons:
    none = np.zeros((0, 3))
    return EnteringPhotons(
        np.concatenate([none, *(part.origins for part in parts)]),
        np.concatenate([none, *(part.power for part in parts)]),
    )


def _add(sums: Array, segments: PhotonSegments, body: int, cells: FineCells, rng: np.random.Generator) -> None:
    """Add power times length of segments in a body to its cells (n, 3)."""
    first = np.where(segments.before[:, body] == 0.0, BEYOND * cells.step, 0.0)
    last = segments.length + np.where(segments.after[:, body] == 0.0, BEYOND * cells.step, 0.0)
    length = first + last
    parts = np.ceil(length / (PART * cells.step)).astype(np.int64)
    ends = np.cumsum(parts)
    begin = 0
    while begin < len(parts):
        done = ends[begin - 1] if begin else 0
        end = max(int(np.searchsorted(ends, done + _TOGETHER, side="right")), begin + 1)
        own = np.repeat(np.arange(begin, end), parts[begin:end])
        number = np.arange(len(own)) - np.repeat(ends[begin:end] - parts[begin:end] - done, parts[begin:end])
        _add_parts(sums, segments, cells, own, number, first, length / parts, rng)
        begin = end


def _add_parts(
    sums: Array,
    segments: PhotonSegments,
    cells: FineCells,
    own: Integers,
    number: Integers,
    first: Array,
    size: Array,
    rng: np.random.Generator,
) -> None:
    """Add parts of segments, with these numbers and sizes in metres, the first of which begin so far behind.

    Each counts in the cell of a random place on it, and with the light that is there.
    """
    along = (number + rng.random(len(own))) * size[own] - first[own]
    points = segments.origins[own] + along[:, None] * segments.directions[own]
    place = np.floor((points - cells.low) / cells.step).astype(np.int64)
    inside = ((place >= 0) & (place < cells.shape)).all(axis=1)
    own, along, place = own[inside], along[inside], place[inside]
    at = np.ravel_multi_index(tuple(place.T), cells.shape)
    with np.errstate(under="ignore"):
        # Behind the surface where it begins there is as much light as at it.
        left = optics.transmittance(segments.extinction[own] * np.maximum(along, 0.0)[:, None])
        weight = segments.power[own] * left * size[own, None]
    for channel in range(3):
        sums[:, channel] += np.bincount(at, weight[:, channel], len(sums))
