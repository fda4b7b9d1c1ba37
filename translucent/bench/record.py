"""What a report knows: frozen values, written to and read from ``report.json``. Pages are made from these alone.

Times are milliseconds. Errors are result minus reference, on pixels whose 3 x 3 neighborhood crosses equally many
surfaces and that the method calls valid: in thickness as shares of the diagonal of the scene's bounds, in transmittance
absolute (0 to 1), in radiance as shares of the root mean square of the reference's radiance over the same pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from translucent.bench.codec import Packed, decode, encode

#: What a file of ours says that it is, and the version of the fields below. A change of meaning raises the version.
FORMAT, VERSION = "translucent report", 1

#: The quantity by which the methods of a case are ranked, and which its Pareto plot shows.
Quantity = Literal["thickness", "transmittance", "radiance"]

#: A method of the public API, or a shortcut that others take, which the report draws for comparison only.
Kind = Literal["floor", "method", "counter-example", "cpu"]


@dataclass(frozen=True)
class Provenance:
    """Where the numbers come from.

    Attributes
    ----------
    command : str
        That made the report.
    started : str
        ISO 8601, UTC.
    platform, processor : str
    processors : int
    backend, renderer, driver : str
        How the OpenGL context was made, the device, and its driver's version.
    software : bool
        The device is the CPU: times say nothing about a GPU, ratios and errors do.
    versions : dict of str to str
        Of the project and of what it stands on.
    commit : str or None
        Of the project's checkout; None where it is installed without one.
    dirty : bool or None
        Whether the checkout had changes beyond that commit.
    seed : int
        Of all random numbers.
    quick : bool
        Made with ``--quick``: fewer methods, pixels and repetitions.
    """

    command: str
    started: str
    platform: str
    processor: str
    processors: int
    backend: str
    renderer: str
    driver: str
    software: bool
    versions: Mapping[str, str]
    commit: str | None
    dirty: bool | None
    seed: int
    quick: bool


@dataclass(frozen=True)
class Timing:
    """Milliseconds over the rounds after warming up: median, 95th percentile, distance of the quartiles."""

    median: float
    p95: float
    iqr: float
    rounds: int


@dataclass(frozen=True)
class Ratio:
    """Time as a multiple of the depth-only floor's.

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
    """Of the absolute error: root mean square, median, percentiles, maximum. ``bias`` is the mean signed error."""

    rms: float
    median: float
    p99: float
    p999: float
    max: float
    bias: float


@dataclass(frozen=True)
class Row:
    """One method on one case.

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
        thickness or intervals.
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
    invalid: float | None = None
    coverage_mismatch: float | None = None
    pareto: bool = False
    refusal: str | None = None
    failure: str | None = None

    def errors(self, quantity: Quantity) -> Errors | None:
        """The errors in one quantity."""
        return {"thickness": self.thickness, "transmittance": self.transmittance, "radiance": self.radiance}[quantity]


@dataclass(frozen=True)
class Picture:
    """What one method shows, and how wrong that is; (h, w), row 0 at the top.

    Attributes
    ----------
    method : str
        As in its `Row`, or ``"reference"``: what all others are held against; that one has no error.
    png : str
        The sRGB picture as a PNG file in base64.
    error : Packed, optional
        Signed error in the case's quantity, in its unit, as floats: of radiance and transmittance, of the channel that
        is farthest off; 0 below 5e-8. NaN where nothing is covered, or the method calls the pixel invalid.
    invalid : Packed, optional
        Booleans: pixels that the method marks.
    """

    method: str
    png: str
    error: Packed | None = None
    invalid: Packed | None = None


@dataclass(frozen=True)
class CaseRecord:
    """One scene with all methods.

    Attributes
    ----------
    name, title, why : str
        Identifier, heading, and what the scene is hard on.
    quantity : {"thickness", "transmittance", "radiance"}
        By which its methods are ranked.
    convex, closed, absorption_only : bool
    triangles, bodies : int
    layers : int
        The most surfaces on one ray.
    size : (width, height)
        Of the timed frames, in pixels.
    compared_size : (width, height)
        Of those that are held against the reference.
    diagonal : float
        Of the scene's bounds, in metres.
    compared_pixels : int
        Within the mask of the errors.
    reference_seconds : float
        That the reference took.
    rows : tuple of Row
        The floor first.
    pictures : tuple of Picture
        The reference first.
    failure : str, optional
        Why the case has no numbers at all.
    """

    name: str
    title: str
    why: str
    quantity: Quantity
    convex: bool = False
    closed: bool = False
    absorption_only: bool = False
    triangles: int = 0
    bodies: int = 0
    layers: int = 0
    size: tuple[int, int] = (0, 0)
    compared_size: tuple[int, int] = (0, 0)
    diagonal: float = 0.0
    compared_pixels: int = 0
    reference_seconds: float = 0.0
    rows: tuple[Row, ...] = ()
    pictures: tuple[Picture, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class ScalePoint:
    """One measurement of a series.

    Attributes
    ----------
    x : int
        Of the series' axis.
    wall, ratio : Timing and Ratio, optional
        As in a `Row`, to the floor at the same x.
    refusal, failure : str, optional
        Why there are no numbers: a limit of this machine or of the method, or something that went wrong.
    """

    x: int
    wall: Timing | None = None
    ratio: Ratio | None = None
    refusal: str | None = None
    failure: str | None = None


@dataclass(frozen=True)
class Series:
    """How the cost of one method grows.

    Attributes
    ----------
    axis : {"triangles", "pixels", "layers", "media"}
    method, family : str
        As in a `Row`; the floor is among them.
    fixed : str
        What stays the same along the axis.
    points : tuple of ScalePoint
    """

    axis: Literal["triangles", "pixels", "layers", "media"]
    method: str
    family: str
    fixed: str
    points: tuple[ScalePoint, ...]


@dataclass(frozen=True)
class HardCase:
    """One of H01 to H24.

    Attributes
    ----------
    id, title : str
    promise : str
        What must hold: exact, bounded, marked invalid, or a clear error.
    result : str
        What happened now.
    error : float, optional
        The measured error, in `unit`; None where the promise is about marks and messages only.
    limit : float, optional
        What the error has to stay at or below, and how that follows is in the promise.
    unit : str
    passed : bool
    """

    id: str
    title: str
    promise: str
    result: str
    passed: bool
    error: float | None = None
    limit: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class Claim:
    """Something that the project says of itself, checked on these numbers.

    Attributes
    ----------
    text : str
    held : bool or None
        None where the run has nothing to check it on.
    measured : str
        The numbers behind that; where it does not hold, where and why.
    """

    text: str
    held: bool | None
    measured: str


@dataclass(frozen=True)
class Report:
    """All of a report.

    Attributes
    ----------
    provenance, cases, scaling, hard_cases, claims
    seconds : float
        That the measurements took so far.
    complete : bool
        False where it was interrupted, or while it is being made: what is there is usable.
    """

    provenance: Provenance
    cases: tuple[CaseRecord, ...] = ()
    scaling: tuple[Series, ...] = ()
    hard_cases: tuple[HardCase, ...] = ()
    claims: tuple[Claim, ...] = ()
    seconds: float = 0.0
    complete: bool = False
    format: str = field(default=FORMAT)
    version: int = field(default=VERSION)

    @property
    def failures(self) -> tuple[str, ...]:
        """What could not be measured, a line each: ``case / method: why``. Refusals are answers, and not among them."""
        cases = [f"{case.name}: {case.failure}" for case in self.cases if case.failure]
        rows = [f"{case.name} / {row.method}: {row.failure}" for case in self.cases for row in case.rows if row.failure]
        points = [
            f"{series.axis} {point.x} / {series.method}: {point.failure}"
            for series in self.scaling
            for point in series.points
            if point.failure
        ]
        return (*cases, *rows, *points)

    def to_json(self) -> str:
        """The report as one JSON object."""
        return encode(self)

    @classmethod
    def from_json(cls, text: str, name: str = "report.json") -> Report:
        """The report of a JSON text.

        Raises
        ------
        InputError
            If the text is cut off, is no report, or is one of another version.
        """
        return decode(cls, text, name, FORMAT, VERSION)
