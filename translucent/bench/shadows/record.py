"""Record of shadows and caustics: what of ``report.json`` is about light through things."""

from __future__ import annotations

from dataclasses import dataclass

from translucent.bench.picture import Picture
from translucent.bench.row import Errors, Kind, Ratio, Timing

#: Names of what others do, as in rows.
OPAQUE, CONSTANT, HALF = "opaque shadow map", "one thickness for each body", "map in float16"


@dataclass(frozen=True)
class ShadowRow:
    """Row: one way of throwing a shadow, in one scene.

    Attributes
    ----------
    method : str
        Unique within its case, the same in all: ``"map of 1024"``.
    kind : {"method", "counter-example"}
    size : int
        Texels along a side of its map.
    promise : str
    errors : Errors, optional
        Of transmittance, 0 to 1, at points of the ground in the shadow, away from its outlines, inner ones included.
    edges : float, optional
        Mean absolute error over the shadow and the pixels next to it, with all outlines.
    wall : Timing, optional
        Of making the map, with all that this takes.
    ratio : Ratio, optional
        That to drawing the same objects into a depth buffer of the same size.
    refusal, failure : str, optional
        Why there are no numbers: an answer, or something that went wrong.
    """

    method: str
    kind: Kind
    size: int
    promise: str
    errors: Errors | None = None
    edges: float | None = None
    wall: Timing | None = None
    ratio: Ratio | None = None
    refusal: str | None = None
    failure: str | None = None


@dataclass(frozen=True)
class ShadowCase:
    """Record of one scene: shadows on a ground, in one light.

    Attributes
    ----------
    name, title, why : str
    triangles, bodies : int
        Of what throws shadows.
    opaque : bool
        Something opaque throws shadows, too.
    alike : bool
        All bodies have one medium.
    compared_points : int
        Of the ground, in the shadow and away from its outlines.
    reference_seconds : float
    texels : Errors, optional
        Of transmittance in the rays of a map's texels, away from outlines; none where something opaque is in the way.
    texel_size : int
        Texels along a side of that map.
    order : float, optional
        With which `ShadowRow.edges` fall with the size of maps.
    rows : tuple of ShadowRow
    pictures : tuple of Picture
        The reference first, then some rows.
    failure : str, optional
        Why the case has no numbers at all.
    """

    name: str
    title: str
    why: str
    triangles: int = 0
    bodies: int = 0
    opaque: bool = False
    alike: bool = True
    compared_points: int = 0
    reference_seconds: float = 0.0
    texels: Errors | None = None
    texel_size: int = 0
    order: float | None = None
    rows: tuple[ShadowRow, ...] = ()
    pictures: tuple[Picture, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class SkyRow:
    """Row: shadows of an environment, by a number of directions.

    Attributes
    ----------
    environment : str
    directions : int
    error : float
        Root mean square error of the light on the ground, as a share of its mean.
    seconds : float
        Of the first picture, with all maps.
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
        On the ground, relative to the truth's, minus 1.
    nrmse : float
        Root mean square error of irradiance after a blur by a pixel, as a share of its mean, freed of the noise of the
        truth; 0 where that hides it.
    most : float
        What it is at most, by two standard errors.
    seconds : float
        Of tracing and of splatting them.
    """

    photons: int
    power: float
    nrmse: float
    most: float
    seconds: float


@dataclass(frozen=True)
class CausticCase:
    """Record of the caustic of one scene, on the ground.

    Attributes
    ----------
    name, title, why : str
    truth_photons : int
        Of the float64 reference, in each of two halves.
    reference_seconds : float
        That both took.
    power_noise : float
        Half of the difference between the powers of the halves, as a share of it.
    rows : tuple of CausticRow
    pictures : tuple of Picture
        That of the most photons, and of irradiance that of the truth and theirs: its errors would be the truth's noise.
    failure : str, optional
    """

    name: str
    title: str
    why: str
    truth_photons: int = 0
    reference_seconds: float = 0.0
    power_noise: float = 0.0
    rows: tuple[CausticRow, ...] = ()
    pictures: tuple[Picture, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class CausticMediumCase:
    """Record of the light of photons in a medium that scatters.

    Attributes
    ----------
    name, title, why : str
    truth_paths : int
        Random paths of each pixel, in each of two halves.
    reference_seconds : float
        That both took.
    noise : float
        Standard error of the mean of the truth, as a share of it.
    rows : tuple of CausticRow
        Of radiance in place of power and irradiance; that without photons has 0 of them.
    pictures : tuple of Picture
        The reference, then the rows.
    failure : str, optional
    """

    name: str
    title: str
    why: str
    truth_paths: int = 0
    reference_seconds: float = 0.0
    noise: float = 0.0
    rows: tuple[CausticRow, ...] = ()
    pictures: tuple[Picture, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class Shadows:
    """Record of the part.

    Attributes
    ----------
    cases : tuple of ShadowCase
    sky : tuple of SkyRow
    sky_failure : str, optional
        Why there are none of these.
    caustics : tuple of CausticCase
    media : tuple of CausticMediumCase
    """

    cases: tuple[ShadowCase, ...] = ()
    sky: tuple[SkyRow, ...] = ()
    sky_failure: str | None = None
    caustics: tuple[CausticCase, ...] = ()
    media: tuple[CausticMediumCase, ...] = ()

    @property
    def measured(self) -> bool:
        """True if anything is there."""
        return bool(self.cases or self.sky or self.caustics or self.media or self.sky_failure)

    @property
    def failures(self) -> tuple[str, ...]:
        """Failed measurements, a line each."""
        whole = [f"shadows, {case.name}: {case.failure}" for case in self.cases if case.failure]
        rows = [
            f"shadows, {case.name} / {row.method}: {row.failure}"
            for case in self.cases
            for row in case.rows
            if row.failure
        ]
        sky = [f"shadows of the environment: {self.sky_failure}"] if self.sky_failure else []
        light = [(one.name, one.failure) for one in self.caustics] + [(one.name, one.failure) for one in self.media]
        return (*whole, *rows, *sky, *(f"caustics, {name}: {failure}" for name, failure in light if failure))
