"""Record of a report: immutable values, written to and read from ``report.json``. Pages are made from these alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from translucent.bench.codec import decode, encode
from translucent.bench.picture import Picture
from translucent.bench.row import Quantity, Ratio, Row, Timing
from translucent.bench.shadows.record import Shadows

#: Format name of a report's file, and the version of the fields below. A change of meaning raises the version.
FORMAT, VERSION = "translucent report", 1


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
class CaseRecord:
    """Record of a case: one scene with all methods.

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
        That the reference took; of a stored truth, when it was made.
    truth_noise : float, optional
        Root mean square of the standard error of a path traced truth, as a share of its mean.
    truth_rays : int
        Rays of the reference through each pixel, spread over it, whose mean its radiance is; 1 along its center.
    truth_spread : float
        Root mean square of the standard error of that mean, as a share of that of the radiance.
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
    truth_noise: float | None = None
    truth_rays: int = 1
    truth_spread: float = 0.0
    rows: tuple[Row, ...] = ()
    pictures: tuple[Picture, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class ScalePoint:
    """Point of a series: one measurement.

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
    """Series of the cost of one method along an axis.

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


#: Ways of showing what slabs give back and let through; what the planner takes is one of the others, or nothing.
SlabWay = Literal["diffusion", "layer", "planned"]


@dataclass(frozen=True)
class Slab:
    """Record of a wide flat slab in diffuse light: shares of the light that enters, unscattered light with them.

    Attributes
    ----------
    albedo, depth, anisotropy, ior : float
        Of its medium, and its optical depth.
    reflectance, transmittance : float
        The true ones, by adding and doubling.
    unscattered : (reflectance, transmittance)
        What of them was never scattered, which is exact in all pictures.
    diffusion, layer : (reflectance, transmittance)
        By `Diffusion` and by `ScatteringLayer`.
    planned : {"diffusion", "layer", "volume", "none"}
        What the planner takes; volume: rays that gather light on their way, where there is no interface, which is
        measured on whole pictures alone; none: nothing beyond what is scattered once.
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
        """Optical depth of the medium that scatters isotropically and is alike: of sigma_a + sigma_s (1 - g)."""
        return self.depth * (1.0 - self.albedo * self.anisotropy)

    def error(self, way: SlabWay) -> float:
        """The error in reflectance or transmittance by a way that is larger, with its sign."""
        shares = {"diffusion": self.diffusion, "layer": self.layer, "none": self.unscattered}
        reflected, transmitted = shares[self.planned if way == "planned" else way]
        off = reflected - self.reflectance, transmitted - self.transmittance
        return max(off, key=abs)


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
    """Claim of the project about itself, checked on these numbers.

    Attributes
    ----------
    text : str
    held : bool or None
        None where the run has nothing to check it on, or its numbers are too noisy to tell.
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


#: Parts of a report that can be measured by themselves.
Part = Literal["scenes", "scaling", "slabs", "shadows", "hard-cases"]


@dataclass(frozen=True)
class Renewal:
    """Parts that were measured anew, after the rest of the report.

    Attributes
    ----------
    parts : tuple of str
    provenance : Provenance
        Of these.
    seconds : float
        That they took.
    """

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
        That the measurements took so far.
    complete : bool
        False where it was interrupted, or while it is being made: what is there is usable.
    renewals : tuple of Renewal
        What was measured anew after the rest; `provenance` and `seconds` are those of the rest.
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
    format: str = field(default=FORMAT)
    version: int = field(default=VERSION)

    @property
    def failures(self) -> tuple[str, ...]:
        """Failed measurements, a line each: ``case / method: why``. Refusals are answers, and not among them."""
        cases = [f"{case.name}: {case.failure}" for case in self.cases if case.failure]
        rows = [f"{case.name} / {row.method}: {row.failure}" for case in self.cases for row in case.rows if row.failure]
        points = [
            f"{series.axis} {point.x} / {series.method}: {point.failure}"
            for series in self.scaling
            for point in series.points
            if point.failure
        ]
        return (*cases, *rows, *points, *self.shadows.failures)

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
