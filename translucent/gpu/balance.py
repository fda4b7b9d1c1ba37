"""Rules of validity: contribution of each face to a pixel's signed count, and bounds of valid sums. Without OpenGL."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.placement import PlacedScene
from translucent.planning.methods import Method
from translucent.scene.scene import Object, Scene

#: Count that is invalid in every pixel.
UNEXPECTED = float(CONSTANTS["UNEXPECTED"])

#: Share of the diagonal below which a path is the rounding of a sum that should be 0.
COVERAGE_FLOOR = 2e-7

#: Counts of open bodies must not cancel: the first gets 16 times the weight of closed ones, the next 16 times that, and
#: so on, as far as float32 counts exactly. Beyond, they share the last weight.
OPEN_WEIGHTS = tuple(16.0**k for k in range(1, 6))

#: Share of the diagonal that a path may be below 0 by rounding; it then counts as 0. Steep faces have the largest
#: errors, of some 1e-5.
ROUNDING = 1e-5


@dataclass(frozen=True, eq=False)
class FaceCounts:
    """Contribution of one face of each object to the signed count of a pixel.

    Attributes
    ----------
    weights : (objects,) float64
        With the sign of its side.
    offsets : (objects,) float64
        Whatever its side: not 0 marks all pixels that the body covers.
    subpixel : float
        Step of the grid onto which the rasterizer moves vertices, in pixels; 0 where nothing is put down to it.
    snapping_share : float
        The same over the scene's diagonal, in the fraction of the count.
    """

    weights: Array
    offsets: Array
    subpixel: float
    snapping_share: float


@dataclass(frozen=True)
class Balance:
    """Bounds within which the sums of a pixel are valid.

    Attributes
    ----------
    expected_count : (float, float)
        Least and greatest sum of signed counts.
    rounding : float
        How far below 0 a path may be, in metres, by the rounding of float32 alone.
    coverage_floor : float
        Metres from which on a path is not the rounding of 0.
    """

    expected_count: tuple[float, float]
    rounding: float
    coverage_floor: float

    @classmethod
    def of(cls, placed: PlacedScene, method: Method, counts: FaceCounts) -> Balance:
        """Bounds for a frame of a scene that a method draws with these counts."""
        floor = COVERAGE_FLOOR * placed.scene.diagonal
        return cls(_expected_count(placed, method, counts), _rounding(placed, method), floor)


def count_weights(scene: Scene) -> list[float]:
    """Weight of each object's faces in a pixel's signed count."""
    weights = []
    used = 0
    for body in scene.objects:
        is_open = body.medium is not None and body.sheet_thickness is None and not body.mesh.diagnosis.solid
        weights.append(OPEN_WEIGHTS[min(used, len(OPEN_WEIGHTS) - 1)] if is_open else 1.0)
        used += is_open
    return weights


def face_counts(scene: Scene, subpixel_bits: int) -> FaceCounts:
    """Contribution of each object's faces to a pixel's count, with a rasterizer of this precision."""
    # Where a body is broken, paths below 0 are more likely to be real than swapped at a silhouette; and the weights of
    # open bodies leave no room in the fraction of a count.
    sound = all(body.mesh.diagnosis.sound for body in scene.bodies if body.sheet_thickness is None)
    subpixel = 0.5**subpixel_bits if sound else 0.0
    offsets = np.array([count_offset(body) for body in scene.objects])
    return FaceCounts(np.array(count_weights(scene)), offsets, subpixel, subpixel / scene.diagonal)


def count_offset(body: Object) -> float:
    """Count that each face adds whatever its side, which invalidates all pixels of a body that is inside out."""
    return UNEXPECTED if body.medium is not None and body.mesh.diagnosis.inside_out else 0.0


def _expected_count(placed: PlacedScene, method: Method, counts: FaceCounts) -> tuple[float, float]:
    if method.makes_sheets:
        return 0.0, 0.0
    low, high = (counts.weights[:, None] * placed.expected_counts).sum(axis=0)
    return float(low), float(high)


def _rounding(placed: PlacedScene, method: Method) -> float:
    """Largest rounding error of a path in float32, in metres.

    Next to a silhouette a rasterizer may swap two faces, and a path is then below 0 by as much as it misplaces
    them; that differs from pixel to pixel, and goes along with what they hold (``thickness/snapping.glsl``).
    """
    reach = placed.scene.diagonal
    if method.counts_from_camera:
        # Distances from the camera cancel with an error that grows with them.
        reach += float(np.linalg.norm(placed.anchors, axis=1).max())
    return ROUNDING * reach
