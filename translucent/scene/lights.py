"""Point, spot, sphere and directional lights."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief, checked, vectors
from translucent.arrays import Array, Frozen
from translucent.errors import InputError
from translucent.formulas.light import ALL_AROUND, cone_attenuation, light_cone
from translucent.scene.camera import MAX_COORDINATE

#: Largest radiance, intensity or irradiance: its products with lengths stay within float32.
MAX_RADIANCE = 1e18

#: Smallest half angle of a cone in degrees: half a per cent of it is a rounding of float32 in a direction.
NARROWEST_CONE = 1e-3


class PositionalLight(Frozen):
    """Base class of lights that shine from a point and fall off with the inverse square."""

    position: npt.ArrayLike
    intensity: npt.ArrayLike

    #: Radius in metres of the part of a sphere over which its shadows are filtered; 0 for a light without size.
    part_radius = 0.0

    #: Vector to the center of the whole sphere, which is mirrored and sends out photons, and its radius, in
    #: metres; 0 for none.
    disc: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        position = _vector("light position", self.position, "give (x, y, z); at infinity, use a tl.DirectionalLight")
        if (farthest := float(np.abs(position).max())) > MAX_COORDINATE:
            raise InputError(
                "light position",
                f"the light is {farthest:.3g} m away from the origin",
                f"use a position within {MAX_COORDINATE:g} m",
            )
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "intensity", positive_triple("light intensity", self.intensity))

    @property
    def cone(self) -> Array:
        """(4,): cone in which it shines, as `translucent.formulas.light.cone_attenuation` takes it."""
        return np.array(ALL_AROUND)

    @property
    def mean_share(self) -> float:
        """Mean over all directions of the fraction of its intensity with which it shines there."""
        return 1.0

    def intensity_along(self, travel: npt.ArrayLike) -> Array:
        """Radiant intensity in unit directions (..., 3) in which light leaves, (..., 3) in W/sr."""
        with np.errstate(under="ignore"):
            return np.asarray(np.asarray(self.intensity) * cone_attenuation(travel, self.cone)[..., None])

    def irradiance_on(self, points: npt.ArrayLike, normals: npt.ArrayLike) -> Array:
        """Irradiance I cos / r^2 on surfaces that nothing shadows, (..., 3) in W/m^2; at most 1e18, and 0 in the light.

        Parameters
        ----------
        points : array_like (..., 3)
            In metres.
        normals : array_like (..., 3)
            Unit vectors.
        """
        towards = np.asarray(self.position) - np.asarray(points, dtype=np.float64)
        # In units of the largest coordinate no square overflows or vanishes.
        reach = np.maximum(np.abs(towards).max(axis=-1, keepdims=True), np.finfo(np.float64).tiny)
        with np.errstate(over="ignore", under="ignore"):
            scaled = towards / reach
            length = np.sqrt(np.einsum("...i,...i->...", scaled, scaled))[..., None]
            length = np.where(length > 0, length, 1.0)
            cosine = np.maximum(np.einsum("...i,...i->...", scaled, np.asarray(normals))[..., None] / length, 0.0)
            irradiance = self.intensity_along(-scaled / length) * cosine / (reach * length) / (reach * length)
        return np.asarray(np.minimum(irradiance, MAX_RADIANCE))


@checked
@dataclass(frozen=True, eq=False)
class PointLight(PositionalLight):
    """Light that shines alike in all directions and falls off with the inverse square (KHR_lights_punctual).

    Parameters
    ----------
    position : array_like (3,)
        In metres.
    intensity : array_like (3,)
        Radiant intensity in W/sr, linear RGB; one number for all channels.
    """

    position: npt.ArrayLike
    intensity: npt.ArrayLike


@checked
@dataclass(frozen=True, eq=False)
class SpotLight(PositionalLight):
    """Light that shines in a cone and falls off with the inverse square (KHR_lights_punctual).

    Within the inner cone the intensity is whole. From there to the outer cone it falls to 0, as the square of
    (cos a - cos outer_cone) / (cos inner_cone - cos outer_cone) at an angle a from the direction.

    Parameters
    ----------
    position : array_like (3,)
        In metres.
    direction : array_like (3,)
        In which the middle of the cone shines; any length but 0.
    intensity : array_like (3,)
        Radiant intensity within the inner cone, in W/sr, linear RGB; one number for all channels.
    inner_cone, outer_cone : float
        Half angles of the cones in degrees: 0 <= inner_cone < outer_cone <= 90, and outer_cone at least 0.001.

    Raises
    ------
    InputError
        If a value is not in its range, or the direction has no length.
    """

    position: npt.ArrayLike
    direction: npt.ArrayLike
    intensity: npt.ArrayLike
    inner_cone: float = 0.0
    outer_cone: float = 45.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "direction", _unit(self.direction))
        for name in ("inner_cone", "outer_cone"):
            object.__setattr__(self, name, _angle(name, getattr(self, name)))
        if not (self.outer_cone >= NARROWEST_CONE and self.inner_cone < self.outer_cone):
            raise InputError(
                f"light with inner_cone {self.inner_cone:g} and outer_cone {self.outer_cone:g} degrees",
                (
                    "the inner cone must be smaller than the outer cone, and the outer cone at least "
                    f"{NARROWEST_CONE:g} degrees"
                ),
                "use angles with 0 <= inner_cone < outer_cone <= 90",
            )

    @cached_property
    def cone(self) -> Array:
        """(4,): cone in which it shines, as `translucent.formulas.light.cone_attenuation` takes it."""
        cone = light_cone(self.direction, math.radians(self.inner_cone), math.radians(self.outer_cone))
        cone.setflags(write=False)
        return cone

    @property
    def mean_share(self) -> float:
        """Mean over all directions of the fraction of its intensity with which it shines there."""
        within, without = (2.0 * math.sin(0.5 * math.radians(a)) ** 2 for a in (self.inner_cone, self.outer_cone))
        return 0.5 * (within + (without - within) / 3.0)


class AreaLight(PositionalLight):
    """Base class of lights with a size, which are drawn as several point lights and so throw soft shadows."""

    #: Name of the kind of light in messages.
    noun = "area light"

    def points(self, count: int) -> tuple[PointLight, ...]:
        """Point lights of the same intensity in all, at most `count` of them, 1 at least."""
        raise NotImplementedError


@checked
@dataclass(frozen=True, eq=False)
class SphereLight(AreaLight):
    """Sphere that shines with the same radiance from all its points in all directions, and so throws soft shadows.

    It is drawn as point lights that are spread in it so that they look like an even disc from everywhere. The camera
    sees it in highlights alone, and it hides nothing.

    Parameters
    ----------
    position : array_like (3,)
        Of its center, in metres.
    intensity : array_like (3,)
        Radiant intensity in W/sr, linear RGB; one number for all channels.
    radius : float
        In metres, above 0.

    Raises
    ------
    InputError
        If a value is not in its range.
    """

    position: npt.ArrayLike
    intensity: npt.ArrayLike
    radius: float

    noun = "sphere light"

    def __post_init__(self) -> None:
        super().__post_init__()
        number = isinstance(self.radius, int | float | np.number) and not isinstance(self.radius, bool)
        if not number or not 0 < self.radius <= MAX_COORDINATE:
            raise InputError(
                f"light with radius {brief(self.radius)}",
                f"the radius must be above 0 and at most {MAX_COORDINATE:g} m",
                "give the radius in metres, or use a tl.PointLight",
            )
        object.__setattr__(self, "radius", float(self.radius))

    @classmethod
    def from_radiance(cls, position: npt.ArrayLike, radiance: npt.ArrayLike, radius: float) -> SphereLight:
        """Sphere with a radiance (3,) in W/(m^2 sr); its intensity is pi radius^2 times that."""
        sphere = cls(position, 0.0, radius)
        return replace(sphere, intensity=math.pi * sphere.radius**2 * positive_triple("light radiance", radiance))

    def points(self, count: int) -> tuple[PointLight, ...]:
        """Point lights of the same intensity in all: of `SPREADS` the largest with at most `count`, 1 at least.

        Each looks like a disc of its fraction of the area.
        """
        spread = next(spread for spread in SPREADS if len(spread) <= count)
        fraction = 1.0 / len(spread)
        # With what the discs add, the variance is that of the whole disc.
        offsets = self.radius * math.sqrt(1.0 - fraction) * spread
        return tuple(
            _PointOfSphere(
                self.position + offset,
                fraction * np.asarray(self.intensity),
                math.sqrt(fraction) * self.radius,
                (*-offset, self.radius),
            )
            for offset in offsets
        )


def _projected(vertices: Array) -> Array:
    """Projection (n, 3) of points (n, 4) along an axis that is far from those of their symmetry."""
    axis = np.array([4.0, 5.0, 6.0, 7.0]) / math.sqrt(126.0)
    normal = axis - np.array([0.0, 0.0, 0.0, 1.0])
    return np.asarray((vertices - 2.0 * np.outer(vertices @ normal, normal) / (normal @ normal))[:, :3])


#: Points in a ball that look like an even disc from everywhere, by their number. Such a disc is the projection of an
#: evenly covered sphere in four dimensions, as of the vertices of a tesseract and of its dual: spherical designs, whose
#: mean, variance and third moments are exact. Four are a tetrahedron in the ball.
SPREADS = (
    _projected(np.array(list(itertools.product((-0.5, 0.5), repeat=4)))),
    _projected(np.concatenate([np.eye(4), -np.eye(4)])),
    0.5 * np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)]),
    np.zeros((1, 3)),
)


@dataclass(frozen=True, eq=False)
class _PointOfSphere(PointLight):
    """Point light that looks like a disc: a part of a sphere."""

    part_radius: float = 0.0
    disc: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)


@checked
@dataclass(frozen=True, eq=False)
class DirectionalLight(Frozen):
    """Light from infinitely far away (KHR_lights_punctual).

    Parameters
    ----------
    direction : array_like (3,)
        In which the light travels; any length but 0.
    irradiance : array_like (3,)
        On a surface that faces the light, in W/m^2, linear RGB.
    """

    direction: npt.ArrayLike
    irradiance: npt.ArrayLike

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", _unit(self.direction))
        object.__setattr__(self, "irradiance", positive_triple("light irradiance", self.irradiance))

    @checked
    def irradiance_on(self, points: npt.ArrayLike, normals: npt.ArrayLike) -> Array:
        """Irradiance on surfaces with unit `normals` (..., 3) that nothing shadows, (..., 3) in W/m^2, at any point."""
        with np.errstate(under="ignore"):
            cosine = np.maximum(
                -np.sum(vectors("normals", normals) * np.asarray(self.direction), axis=-1, keepdims=True), 0.0
            )
            return np.asarray(cosine * np.asarray(self.irradiance))


#: Any light of a scene.
Light = PointLight | SpotLight | SphereLight | DirectionalLight


def with_points(lights: Sequence[Light], most: int) -> tuple[Light, ...]:
    """The lights with point lights in place of each area light, at most `most` of them in all."""
    areas = sum(isinstance(light, AreaLight) for light in lights)
    count = max((most - len(lights)) // max(areas, 1) + 1, 1)
    return tuple(
        part for light in lights for part in (light.points(count) if isinstance(light, AreaLight) else (light,))
    )


def with_whole_spheres(lights: Sequence[Light]) -> tuple[Light, ...]:
    """The lights with one point light at the center of each sphere, of its size, in place of its points."""
    found = list[Light]()
    for parts in by_spheres(lights):
        light = parts[0]
        if isinstance(light, _PointOfSphere) and (radius := light.disc[3]) > 0.0:
            center, size = np.asarray(light.position) + light.disc[:3], (0.0, 0.0, 0.0, radius)
            power = np.sum([np.asarray(part.intensity) for part in parts if isinstance(part, PointLight)], axis=0)
            light = _PointOfSphere(center, power, radius, size)
        found.append(light)
    return tuple(found)


def by_spheres(lights: Sequence[Light]) -> list[list[Light]]:
    """The lights, each alone, but the points of each sphere together."""
    found: dict[object, list[Light]] = {}
    for light in lights:
        key: object = id(light)
        if isinstance(light, _PointOfSphere) and (radius := light.disc[3]) > 0.0:
            key = radius, *np.rint(1e6 * (np.asarray(light.position) + light.disc[:3]) / radius).tolist()
        found.setdefault(key, []).append(light)
    return list(found.values())


def _unit(value: npt.ArrayLike) -> Array:
    direction = _vector("light direction", value)
    if (largest := float(np.abs(direction).max())) > 0 and not 1e-100 < largest < 1e100:
        direction = direction / largest  # squares would overflow, or vanish
    if not (length := float(np.linalg.norm(direction))) > 0:
        raise InputError(
            "light direction", "the direction has the length 0", "give the direction in which the light travels"
        )
    # What has unit length keeps it to the last bit, so that copies of a light have the same direction.
    direction = direction / length if abs(length - 1.0) > 1e-15 else direction.copy()
    direction.setflags(write=False)
    return direction


def _angle(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0 <= value <= 90:
        raise InputError(
            f"light with {name} {value!r}",
            "the angle must lie in 0 to 90",
            "give the half angle of the cone in degrees",
        )
    return float(value)


def _vector(what: str, value: npt.ArrayLike, do: str = "give (x, y, z)") -> Array:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{what} {brief(value)}", "the value must be three finite numbers", do)
    vector.setflags(write=False)
    return vector


def positive_triple(what: str, value: npt.ArrayLike) -> Array:
    """(3,) float64, read-only: one or three numbers in 0 to `MAX_RADIANCE`, else an `InputError` about `what`."""
    try:
        triple = np.broadcast_to(np.array(value, dtype=np.float64), (3,))
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{what} {brief(value)}", "the value must be one or three numbers", "give three numbers (r, g, b)"
        ) from None
    triple = _vector(what, triple)
    if (triple < 0).any() or (triple > MAX_RADIANCE).any():
        raise InputError(
            f"{what} {tuple(triple.tolist())}",
            f"the value must lie in 0 to {MAX_RADIANCE:g}",
            "use values in this range",
        )
    return triple
