"""Record of a report: immutable values, written to and read from ``report.json``. Pages are made from these alone.

Times are milliseconds. Errors are result minus reference, on pixels whose 3 x 3 neighborhood crosses equally many
surfaces and that the method calls valid: in thickness as fractions of the diagonal of the scene's bounds, in
transmittance absolute (0 to 1), in radiance as fractions of the root mean square of the reference's radiance.
"""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Literal

from translucent.bench.codec import Packed, decode, encode

#: Format name of a report's file, and the version of the fields below. A change of meaning raises the version.
FORMAT, VERSION = "translucent report", 1

#: Quantity by which the methods of a case are ranked, and which its Pareto plot shows.
Quantity = Literal["thickness", "transmittance", "radiance"]

#: Type of a row: the depth-only floor, a method of the public API, a shortcut of other renderers, or without OpenGL.
RowKind = Literal["floor", "method", "counter-example", "cpu"]

#: Parts of a report that can be measured by themselves.
Part = Literal["scenes", "scaling", "slabs", "shadows", "hard-cases"]

#: Prefix of the names of cases from users' models.
MODEL_CASE = "model "

#: Approximations of a slab; "planned" is the one that the planner picks.
SlabModel = Literal["diffusion", "layer", "planned"]

#: Names of the shortcuts of shadows, as in rows.
OPAQUE, CONSTANT, HALF = "opaque shadow map", "one thickness for each body", "map in float16"


@dataclass(frozen=True)
class TimeStatistics:
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
        Standard error of the median, estimated from the quartiles: the scatter between two runs.
    """

    median: float
    iqr: float
    noise: float


@dataclass(frozen=True)
class ErrorStatistics:
    """Statistics of the absolute error, and the mean signed error, which is the bias."""

    rms: float
    median: float
    p99: float
    p999: float
    max: float
    bias: float


@dataclass(frozen=True)
class LightErrors:
    """Errors of light that is scattered many times, as fractions of the mean of the truth.

    Attributes
    ----------
    nrmse : float
        Root mean square error, freed of the noise of the truth: of (x - a)(x - b) with two independent halves a, b.
    block : float
        The same of means over 4 x 4 pixels, where errors of neighbors cancel.
    bias : tuple of 3 floats
        Mean signed error of each channel, as a fraction of the channel's mean.
    solve_seconds : float, optional
        Time of the diffusion solve, once for each light, medium and mesh; no part of a frame.
    """

    nrmse: float
    block: float
    bias: tuple[float, float, float]
    solve_seconds: float | None = None


@dataclass(frozen=True)
class ColorDifference:
    """Statistics of the color difference in CIELAB 1976: median, 99.9th percentile and maximum.

    Of transmitted white light where thickness ranks the methods; else of the radiance, as a screen shows it.
    """

    median: float
    p999: float
    max: float


@dataclass(frozen=True)
class ReportPicture:
    """Picture of one method with its errors; (h, w), row 0 at the top.

    Attributes
    ----------
    method : str
        As in its row, or ``"reference"``, which has no error.
    png : str
        The sRGB picture as a PNG file in base64.
    error : Packed, optional
        Signed error in the case's quantity, in its unit, as floats: of radiance and transmittance, of the channel with
        the largest error; 0 below 5e-8. NaN where nothing is covered, or the method calls the pixel invalid.
    invalid : Packed, optional
        Booleans: pixels that the method marks.
    """

    method: str
    png: str
    error: Packed | None = None
    invalid: Packed | None = None

    def check(self) -> None:
        """Raise `ValueError` if the picture is no base64, or its parts are of different shapes."""
        base64.b64decode(self.png, validate=True)
        if self.error is not None and self.invalid is not None and self.error.shape != self.invalid.shape:
            raise ValueError(
                f"the errors have the shape {self.error.shape}, and the mask of invalid pixels has the shape "
                f"{self.invalid.shape}; measure again"
            )


@dataclass(frozen=True, kw_only=True)
class TimedRow:
    """Common part of rows: time, its ratio to the floor, and if there are no numbers, why.

    Attributes
    ----------
    wall : TimeStatistics, optional
        By the clock.
    ratio : Ratio, optional
        `wall` to the time of drawing the same objects into a depth buffer alone.
    refusal : str, optional
        Why the planner does not run this, or this machine not at this size: an answer, no failure.
    failure : str, optional
        What went wrong where there should be numbers.
    """

    wall: TimeStatistics | None = None
    ratio: Ratio | None = None
    refusal: str | None = None
    failure: str | None = None


@dataclass(frozen=True)
class SceneRecord:
    """Common part of the records of scenes.

    Attributes
    ----------
    name, title, why : str
        Identifier, heading, and what the scene is hard on.
    reference_seconds : float
        Time of the truth, of both of its halves if it has two; of a stored one, when it was made.
    pictures : tuple of ReportPicture
        The reference first, then some rows.
    failure : str, optional
        Why the scene has no numbers at all.
    """

    name: str
    title: str
    why: str
    _: KW_ONLY
    reference_seconds: float = 0.0
    pictures: tuple[ReportPicture, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class MethodRow(TimedRow):
    """Row: one method on one case.

    Attributes
    ----------
    method : str
        Unique within its case, the same in all cases: ``"DepthPeeling, 4 layers"``.
    family : str
        Name that methods of one technique share, for colors and symbols: ``"DepthPeeling"``.
    parameters : str
        The configuration as Python writes it.
    kind : {"floor", "method", "counter-example", "cpu"}
    promise : str
        Accuracy that the method promises here: ``"exact"``, or where and why it is not.
    exact : bool
        The planner calls the method exact on this case.
    wall, gpu : TimeStatistics, optional
        From the first draw to the last having finished, by the clock and by the GPU's timer: of the passes that find
        thickness or intervals; on cases of interfaces the clock's are of the whole frame, and the timer has none.
    frame : TimeStatistics, optional
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
    thickness, transmittance, radiance : ErrorStatistics, optional
        None where there is no pixel that can be compared.
    sampled : ErrorStatistics, optional
        In radiance, of the mean of 16 samples of each pixel, where the others are of one: on cases of interfaces.
    color_difference : ColorDifference, optional
        Visible difference of the picture; None beside a truth with noise.
    light : LightErrors, optional
        Where light is scattered many times.
    invalid : float, optional
        Fraction of the covered pixels that the method marks as not to be trusted; errors leave these out.
    coverage_mismatch : float, optional
        Fraction of the covered pixels that only the method, or only the reference, covers.
    pareto : bool
        No row of the case beats it (see `translucent.bench.judgement`).
    """

    method: str
    family: str
    parameters: str
    kind: RowKind
    promise: str
    exact: bool
    gpu: TimeStatistics | None = None
    frame: TimeStatistics | None = None
    frame_ratio: Ratio | None = None
    passes: int | None = None
    layers: int | None = None
    ms_per_layer: float | None = None
    bytes_per_pixel: int | None = None
    thickness: ErrorStatistics | None = None
    transmittance: ErrorStatistics | None = None
    radiance: ErrorStatistics | None = None
    sampled: ErrorStatistics | None = None
    color_difference: ColorDifference | None = None
    light: LightErrors | None = None
    invalid: float | None = None
    coverage_mismatch: float | None = None
    pareto: bool = False

    def errors(self, quantity: Quantity) -> ErrorStatistics | None:
        """Errors in one quantity."""
        return {"thickness": self.thickness, "transmittance": self.transmittance, "radiance": self.radiance}[quantity]


@dataclass(frozen=True)
class CaseRecord(SceneRecord):
    """Record of a case: one scene with all methods.

    Attributes
    ----------
    quantity : {"thickness", "transmittance", "radiance"}
        By which its methods are ranked.
    convex, closed, absorption_only : bool
    triangles, bodies : int
    layers : int
        The most surfaces on one ray.
    size, compared_size : (width, height)
        In pixels, of the timed frames, and of the frames that are compared with the reference.
    diagonal : float
        Of the scene's bounds, in metres.
    compared_pixels : int
        Within the mask of the errors.
    truth_noise : float, optional
        Root mean square of the standard error of a path traced truth, as a fraction of its mean.
    truth_rays : int
        Rays of the reference through each pixel, spread over it, whose mean is its radiance; 1 along its center.
    truth_spread : float
        Root mean square of the standard error of that mean, as a fraction of that of the radiance.
    rows : tuple of MethodRow
        The floor first.
    """

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
    truth_noise: float | None = None
    truth_rays: int = 1
    truth_spread: float = 0.0
    rows: tuple[MethodRow, ...] = ()


@dataclass(frozen=True)
class ScalePoint(TimedRow):
    """Point of a series: the axis value x, and times as in a row; a refusal or a failure says why there are none."""

    x: int


@dataclass(frozen=True)
class Series:
    """Cost of one method along an axis; `fixed` says in words what stays the same along it."""

    axis: Literal["triangles", "pixels", "layers", "media"]
    method: str
    family: str
    fixed: str
    points: tuple[ScalePoint, ...]


@dataclass(frozen=True)
class Slab:
    """Wide flat slab in diffuse light: its reflectance and transmittance, unscattered light included.

    Attributes
    ----------
    albedo, depth, anisotropy, ior : float
        Of its medium, and its optical depth.
    reflectance, transmittance : float
        The true ones, by adding and doubling.
    unscattered : (reflectance, transmittance)
        Of light that was never scattered, which is exact in all pictures.
    diffusion, layer : (reflectance, transmittance)
        By `Diffusion` and by `ScatteringLayer`.
    planned : {"diffusion", "layer", "volume", "none"}
        Choice of the planner; volume: rays that gather light inside, where there is no interface, which is measured on
        whole pictures alone; none: single scattering alone.
    """

    albedo: float
    depth: float
    anisotropy: float
    ior: float
    reflectance: float
    transmittance: float
    unscattered: tuple[float, float]
    diffusion: tuple[float, float]
    layer: tuple[float, float]
    planned: Literal["diffusion", "layer", "volume", "none"]

    @property
    def reduced_depth(self) -> float:
        """Optical depth of the similar medium that scatters isotropically: of sigma_a + sigma_s (1 - g)."""
        return self.depth * (1.0 - self.albedo * self.anisotropy)

    def error(self, model: SlabModel) -> float:
        """Error in reflectance or transmittance by a model, whichever is larger, with its sign."""
        found = {"diffusion": self.diffusion, "layer": self.layer, "none": self.unscattered}
        reflected, transmitted = found[self.planned if model == "planned" else model]
        return max(reflected - self.reflectance, transmitted - self.transmittance, key=abs)


@dataclass(frozen=True)
class ShadowRow(TimedRow):
    """Row: one technique for a shadow, in one scene.

    Attributes
    ----------
    method : str
        Unique within its case, the same in all: ``"map of 1024"``.
    kind : {"method", "counter-example"}
    size : int
        Texels along a side of its map.
    promise : str
    errors : ErrorStatistics, optional
        Of transmittance, 0 to 1, at points of the ground in the shadow, away from its outlines, inner ones included.
    edges : float, optional
        Mean absolute error over the shadow and the pixels next to it, with all outlines.
    wall : TimeStatistics, optional
        Of making the map.
    ratio : Ratio, optional
        That to drawing the same objects into a depth buffer of the same size.
    """

    method: str
    kind: RowKind
    size: int
    promise: str
    errors: ErrorStatistics | None = None
    edges: float | None = None


@dataclass(frozen=True)
class ShadowCase(SceneRecord):
    """Record of one scene: shadows on a ground, in one light.

    Attributes
    ----------
    triangles, bodies : int
        Of the occluders.
    opaque : bool
        Some occluders are opaque.
    alike : bool
        All bodies have one medium.
    compared_points : int
        Of the ground, in the shadow and away from its outlines.
    texels : ErrorStatistics, optional
        Of transmittance in the rays of a map's texels, away from outlines; none where an occluder is opaque.
    texel_size : int
        Texels along a side of that map.
    order : float, optional
        Order with which `ShadowRow.edges` fall with the size of maps.
    rows : tuple of ShadowRow
    """

    triangles: int = 0
    bodies: int = 0
    opaque: bool = False
    alike: bool = True
    compared_points: int = 0
    texels: ErrorStatistics | None = None
    texel_size: int = 0
    order: float | None = None
    rows: tuple[ShadowRow, ...] = ()


@dataclass(frozen=True)
class SkyRow:
    """Shadows of an environment by some directions: RMS error of the light on the ground over its mean, and seconds of
    the first picture, with all maps.
    """

    environment: str
    directions: int
    error: float
    seconds: float


@dataclass(frozen=True)
class CausticRow:
    """Row: a caustic by a number of photons.

    Attributes
    ----------
    photons : int
    power : float
        On the ground, relative to the truth's, minus 1; in media, of the mean radiance.
    nrmse : float
        Root mean square error over the mean, freed of the noise of the truth: on a ground of irradiance after a blur by
        a pixel, in media of radiance; 0 where that noise hides it.
    most : float
        The same at most, by two standard errors.
    seconds : float
        Of tracing and of splatting them.
    """

    photons: int
    power: float
    nrmse: float
    most: float
    seconds: float


@dataclass(frozen=True)
class CausticCase(SceneRecord):
    """Record of the caustic of one scene, on the ground.

    Attributes
    ----------
    truth_photons : int
        Of the float64 reference, in each of two halves.
    power_noise : float
        Half of the difference between the powers of the halves, as a fraction of it.
    rows : tuple of CausticRow
    pictures : tuple of ReportPicture
        That of the most photons; then irradiance, of the truth and of these photons.
    """

    truth_photons: int = 0
    power_noise: float = 0.0
    rows: tuple[CausticRow, ...] = ()


@dataclass(frozen=True)
class CausticMediumCase(SceneRecord):
    """Record of a caustic in a medium that scatters.

    Attributes
    ----------
    truth_paths : int
        Random paths of each pixel, in each of two halves.
    noise : float
        Standard error of the mean of the truth, as a fraction of it.
    rows : tuple of CausticRow
        The first one is without photons.
    pictures : tuple of ReportPicture
        The reference, then the rows.
    """

    truth_paths: int = 0
    noise: float = 0.0
    rows: tuple[CausticRow, ...] = ()


@dataclass(frozen=True)
class Shadows:
    """Record of shadows and caustics; `sky_failure` says why there are no shadows of environments."""

    cases: tuple[ShadowCase, ...] = ()
    sky: tuple[SkyRow, ...] = ()
    sky_failure: str | None = None
    caustics: tuple[CausticCase, ...] = ()
    media: tuple[CausticMediumCase, ...] = ()


@dataclass(frozen=True)
class HardCase:
    """Record of one of the hard cases.

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
        Bound of the error, as the promise derives it.
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
    """Claim of the project about itself, checked on these numbers.

    Attributes
    ----------
    text : str
    held : bool or None
        None where the run has nothing to check it on, or its numbers are too noisy.
    measured : str
        The numbers behind that; where it does not hold, where and why.
    """

    text: str
    held: bool | None
    measured: str

    @property
    def undecided(self) -> bool:
        """True if there are numbers whose noise leaves the claim open."""
        return self.held is None and self.measured.startswith("undecided")


@dataclass(frozen=True)
class Provenance:
    """Provenance of the numbers.

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
        Of the project and of its dependencies.
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
class Renewal:
    """Parts that were measured anew, after the rest of the report, with the provenance and seconds of these."""

    parts: tuple[Part, ...]
    provenance: Provenance
    seconds: float


@dataclass(frozen=True)
class Report:
    """Complete report.

    Attributes
    ----------
    provenance, cases, scaling, hard_cases, claims, slabs, shadows
    seconds : float
        Of measuring so far.
    complete : bool
        False where it was interrupted, or while it is being made: its numbers are usable.
    renewals : tuple of Renewal
        Parts measured anew after the rest; `provenance` and `seconds` are those of the rest.
    unmeasured : tuple of str
        Scenes that the run did not come to, or did not complete.
    """

    provenance: Provenance
    cases: tuple[CaseRecord, ...] = ()
    scaling: tuple[Series, ...] = ()
    hard_cases: tuple[HardCase, ...] = ()
    claims: tuple[Claim, ...] = ()
    seconds: float = 0.0
    complete: bool = False
    slabs: tuple[Slab, ...] = ()
    shadows: Shadows = field(default_factory=Shadows)
    renewals: tuple[Renewal, ...] = ()
    unmeasured: tuple[str, ...] = ()
    format: str = field(default=FORMAT)
    version: int = field(default=VERSION)

    @property
    def failures(self) -> tuple[str, ...]:
        """Failed measurements, a line each: ``case / method: why``. Refusals are answers, and not among them."""
        shadows = self.shadows
        found = [(case.name, case.failure) for case in self.cases]
        found += [(f"{case.name} / {row.method}", row.failure) for case in self.cases for row in case.rows]
        found += [(f"{line.axis} {at.x} / {line.method}", at.failure) for line in self.scaling for at in line.points]
        found += [(f"shadows, {case.name}", case.failure) for case in shadows.cases]
        found += [(f"shadows, {case.name} / {row.method}", row.failure) for case in shadows.cases for row in case.rows]
        found += [("shadows of the environment", shadows.sky_failure)]
        found += [(f"caustics, {case.name}", case.failure) for case in shadows.caustics]
        found += [(f"caustics, {case.name}", case.failure) for case in shadows.media]
        return tuple(f"{where}: {failure}" for where, failure in found if failure)

    def plus(self, name: str, records: tuple[Any, ...]) -> Report:
        """The report with more records in a field, or in one of its shadows: ``cases``, ``shadows.sky``."""
        outer, _, inner = name.rpartition(".")
        holder = getattr(self, outer) if outer else self
        grown: Any = dataclasses.replace(holder, **{inner: (*getattr(holder, inner), *records)})
        changes: dict[str, Any] = {outer: grown}
        return dataclasses.replace(self, **changes) if outer else grown

    def without(self, parts: tuple[Part, ...]) -> Report:
        """The report without these parts, and without renewals that are empty then."""
        empty: dict[Part, dict[str, Any]] = {
            "scenes": {"cases": ()},
            "scaling": {"scaling": ()},
            "slabs": {"slabs": ()},
            "shadows": {"shadows": Shadows()},
            "hard-cases": {"hard_cases": ()},
        }
        changes = {name: blank for part in parts for name, blank in empty[part].items()}
        kept = [
            dataclasses.replace(one, parts=tuple(part for part in one.parts if part not in parts))
            for one in self.renewals
        ]
        return dataclasses.replace(self, **changes, renewals=tuple(one for one in kept if one.parts))

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
