"""Strips of a map: surface points of their texels, and their thickness. Strips are independent of one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats, Mask
from translucent.bake.high_low import Projection
from translucent.bake.measure import Measure
from translucent.bake.surface import Surface
from translucent.bake.texels import Atlas

#: Texels (before supersampling) in a strip, about: one strip is what a thread takes at a time.
STRIP_TEXELS = 1 << 14

#: Names of the counts of a strip.
COUNTS = ("traced", "cast", "escaped", "above", "samples", "missed", "overlapping")


@dataclass(frozen=True, eq=False)
class Strip:
    """Strip: some rows of a map.

    Attributes
    ----------
    values, errors : (rows, w) float32
    coverage, valued : (rows, w) bool
        Texels that a triangle touches, and those that have a value: without a high mesh, the same.
    owners : (m,) bool
        Faces that some texel shows.
    counts : (len(COUNTS),) int64
    """

    values: Floats
    errors: Floats
    coverage: Mask
    valued: Mask
    owners: Mask
    counts: npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Strips:
    """Baker of strips of a map. Any number of threads may ask at once.

    Attributes
    ----------
    low : Surface
        With the texture coordinates.
    shown : (k,) int64
        The faces of `low` that the atlas has.
    atlas : Atlas
        `supersample` times as wide and high as the map.
    measure : Measure
        On the mesh whose thickness is baked.
    projection : Projection or None
        From `low` to that mesh, where it is another.
    """

    low: Surface
    shown: npt.NDArray[np.int64]
    atlas: Atlas
    measure: Measure
    projection: Projection | None

    @property
    def rows(self) -> int:
        """Rows of the map in a strip."""
        return max(1, STRIP_TEXELS // self.measure.settings.size)

    def bake(self, begin: int) -> Strip:
        """The strip that begins at row `begin` of the map."""
        settings = self.measure.settings
        size, fine = settings.size, settings.supersample
        rows = min(self.rows, size - begin)
        samples = self.atlas.strip(begin * fine, (begin + rows) * fine)
        face = self.shown[samples.face]
        points = self.low.points(face, samples.barycentric)
        found = np.ones(len(points), dtype=bool)
        if self.projection is not None:
            points, found = self.projection.points(points, samples.barycentric)
        measured = self.measure.at(points)
        texel = (samples.row // fine - begin) * size + samples.column // fine
        coverage, overlapping = np.zeros((2, rows * size), dtype=bool)
        coverage[texel] = True
        overlapping[texel[samples.overlapping]] = True
        values, errors, valued = _gathered(
            texel[found], samples.inside[found], measured.values, measured.errors, rows * size
        )
        owners = np.zeros(len(self.low.faces), dtype=bool)
        owners[face] = True
        counts = [measured.traced, measured.cast, measured.escaped, measured.above]
        counts += [len(texel), int((~found).sum()), int(overlapping.sum())]
        shape = (rows, size)
        return Strip(
            values.reshape(shape),
            errors.reshape(shape),
            coverage.reshape(shape),
            valued.reshape(shape),
            owners,
            np.array(counts, dtype=np.int64),
        )


def _gathered(
    texel: npt.NDArray[np.int64], inside: Mask, values: Array, errors: Array, count: int
) -> tuple[Floats, Floats, Mask]:
    """Means (count,) of the samples of each texel, their standard errors, and which texels have any.

    Samples beside the triangles count only where a texel has none inside them.
    """
    used = inside | (np.bincount(texel[inside], minlength=count) == 0)[texel]
    texel, values, errors = texel[used], values[used], errors[used]
    samples = np.bincount(texel, minlength=count)
    divisor = np.maximum(samples, 1)
    with np.errstate(under="ignore"):
        mean = np.bincount(texel, weights=values, minlength=count) / divisor
        error = np.sqrt(np.bincount(texel, weights=errors * errors, minlength=count)) / divisor
        return mean.astype(np.float32), error.astype(np.float32), samples > 0
