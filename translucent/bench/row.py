"""Row of a report: one method on one case.

Times are milliseconds. Errors are result minus reference, on pixels whose 3 x 3 neighborhood crosses equally many
surfaces and that the method calls valid: in thickness as shares of the diagonal of the scene's bounds, in transmittance
absolute (0 to 1), in radiance as shares of the root mean square of the reference's radiance over the same pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

#: Quantity by which the methods of a case are ranked, and which its Pareto plot shows.
Quantity = Literal["thickness", "transmittance", "radiance"]

#: A method of the public API, or a shortcut that others take, which the report draws for comparison only.
Kind = Literal["floor", "method", "counter-example", "cpu"]


@dataclass(frozen=True)
class Timing:
    """Milliseconds over the rounds after warming up: median, 95th percentile, distance of the quartiles."""

    median: float
    p95: float
    iqr: float
    rounds: int


@dataclass(frozen=True)
class Ratio:
    """Ratio of a time to that of the depth-only floor.

    Each round measures the method between two floors, and their quotient is one sample: what disturbs the machine for
    longer than that cancels. With a software rasterizer, times in it are the processor's, of all threads.

    Attributes
    ----------
    median, iqr : float
        Of the quotients of the rounds.
    noise : float
        Standard error of the median, estimated from the quartiles: what two runs may differ by.
    """

    median: float
    iqr: float
    noise: float


@dataclass(frozen=True)
class Errors:
    """Statistics of the absolute error: root mean square, median, percentiles, maximum. ``bias`` is the mean signed
    error.
    """

    rms: float
    median: float
    p99: float
    p999: float
    max: float
    bias: float


@dataclass(frozen=True)
class LightErrors:
    """Errors of light that is scattered many times, as shares of the mean of the truth.

    Attributes
    ----------
    nrmse : float
        Root mean square error, freed of the noise of the truth: of (x - a)(x - b) with two independent halves a, b.
    block : float
        The same of means over 4 x 4 pixels: what is left where errors of neighbors cancel.
    bias : tuple of 3 floats
        Mean signed error of each channel, as a share of the channel's mean.
    solve_seconds : float, optional
        For the light that diffuses, once for each light, medium and mesh; frames do not have it.
    """

    nrmse: float
    block: float
    bias: tuple[float, float, float]
    solve_seconds: float | None = None


@dataclass(frozen=True)
class ColorDifference:
    """Statistics of the color difference in CIELAB 1976: median, 99.9th percentile and maximum.

    Of white light that has passed, where thickness ranks the methods; else of the radiance, as a screen shows it.
    """

    median: float
    p999: float
    max: float


@dataclass(frozen=True)
class Row:
    """Row: one method on one case.

    Attributes
    ----------
    method : str
        Unique within its case, the same in all cases: ``"DepthPeeling, 4 layers"``.
    family : str
        What methods of one technique share, for colors and symbols: ``"DepthPeeling"``.
    parameters : str
        The configuration as Python writes it.
    kind : {"floor", "method", "counter-example", "cpu"}
    promise : str
        What the method promises here: ``"exact"``, or where and why it is not.
    exact : bool
        The planner calls the method exact on this case.
    wall, gpu : Timing, optional
        From the first draw to the last having finished, by the clock and by the GPU's timer: of the part that finds
        thickness or intervals; on cases of interfaces the clock's are of the whole frame, and the timer has none.
    frame : Timing, optional
        By the clock, the whole frame: that and the shading of every pixel.
    ratio, frame_ratio : Ratio, optional
        `wall` and `frame` to the floor.
    passes : int, optional
        Draws of the geometry.
    layers : int, optional
        The most surfaces that the method found on a ray, of methods that put them in order; where it draws the geometry
        again for each, in the timed frame.
    ms_per_layer : float, optional
        `wall` by these, for methods that draw the geometry again for each.
    bytes_per_pixel : int, optional
        Of all targets and buffers of its frames; 53 of them hold the result.
    thickness, transmittance, radiance : Errors, optional
        None where there is no pixel that can be compared.
    sampled : Errors, optional
        In radiance, of the mean of 16 samples of each pixel, where the others are of one: of ways of finding
        interfaces.
    color_difference : ColorDifference, optional
        What anybody could see of these errors; None beside a truth with noise.
    light : LightErrors, optional
        Where light is scattered many times.
    invalid : float, optional
        Share of the covered pixels that the method marks as not to be trusted; errors leave these out.
    coverage_mismatch : float, optional
        Share of the covered pixels that only the method, or only the reference, covers.
    pareto : bool
        No row of the case beats it (see `translucent.bench.frontier`).
    refusal : str, optional
        Why the planner does not run this method on this scene, or this machine not at this size: an answer, no failure.
    failure : str, optional
        What went wrong where there should be numbers.
    """

    method: str
    family: str
    parameters: str
    kind: Kind
    promise: str
    exact: bool
    wall: Timing | None = None
    gpu: Timing | None = None
    frame: Timing | None = None
    ratio: Ratio | None = None
    frame_ratio: Ratio | None = None
    passes: int | None = None
    layers: int | None = None
    ms_per_layer: float | None = None
    bytes_per_pixel: int | None = None
    thickness: Errors | None = None
    transmittance: Errors | None = None
    radiance: Errors | None = None
    sampled: Errors | None = None
    color_difference: ColorDifference | None = None
    light: LightErrors | None = None
    invalid: float | None = None
    coverage_mismatch: float | None = None
    pareto: bool = False
    refusal: str | None = None
    failure: str | None = None

    def errors(self, quantity: Quantity) -> Errors | None:
        """Errors in one quantity."""
        return {"thickness": self.thickness, "transmittance": self.transmittance, "radiance": self.radiance}[quantity]
