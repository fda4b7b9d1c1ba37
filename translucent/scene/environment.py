"""Environments: light from far away, and the background of a picture.

`gradient_share`, `gradient_irradiance_share`, `checkerboard_share` and `equirectangular_uv` have twins in
``shaders/lib/environment.glsl``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief, checked
from translucent.arrays import Array, Frozen
from translucent.errors import InputError
from translucent.formulas.spherical_harmonics import COUNT, real_harmonics
from translucent.media.colors import ColorLike, parse_color
from translucent.scene.environment_map import (
    KEPT,
    EnvironmentMap,
    convolved,
    irradiance_map,
    row_blocks,
    row_solid_angles,
    sized,
    texel_directions,
)
from translucent.scene.lights import positive_triple

EnvironmentKind = Literal["constant", "gradient", "checkerboard", "image"]

#: Largest exposure in stops, of either sign: the radiance of any image stays far below `lights.MAX_RADIANCE`.
MAX_EXPOSURE = 32.0

_WHAT = "environment radiance"


@checked
@dataclass(frozen=True, eq=False)
class Environment(Frozen):
    """Environment: radiance from infinitely far away in all directions. Made by `constant`, `gradient`, `checkerboard`,
    `image` or `studio`.

    It lights, it is reflected, and it is seen behind everything, unless `with_background` gives it something else to
    be seen there.

    Attributes
    ----------
    kind : {"constant", "gradient", "checkerboard", "image"}
    first, second : (3,)
        Linear radiance: bottom and top of a gradient, the two squares of a checkerboard; 0 for an image.
    tiles : float
        Squares of a checkerboard along the height of the picture.
    map : EnvironmentMap, optional
        The pixels of an image.
    rotation : float
        Of the image about +Y, in degrees, counterclockwise as seen from above.
    exposure : float
        Stops that the image is brighter than its pixels say.
    background : Environment, optional
        What is seen instead of the environment itself, along straight and along refracted rays.
    """

    kind: EnvironmentKind
    first: Array
    second: Array
    tiles: float = 8.0
    map: EnvironmentMap | None = None
    rotation: float = 0.0
    exposure: float = 0.0
    background: Environment | None = None

    def __post_init__(self) -> None:
        if self.kind not in get_args(EnvironmentKind):
            raise InputError(
                f"environment kind {self.kind!r}",
                "no environment has this name",
                f"use one of {', '.join(get_args(EnvironmentKind))}",
            )
        object.__setattr__(self, "first", positive_triple("environment radiance", self.first))
        object.__setattr__(self, "second", positive_triple("environment radiance", self.second))
        if not 0 < self.tiles <= 1e6:
            raise InputError(
                f"checkerboard of {self.tiles} tiles",
                "the number of tiles must lie in 0 to 1e6",
                "use a value such as 8",
            )
        if (self.kind == "image") != (self.map is not None):
            raise InputError(
                f"{self.kind} environment", "an image environment needs its pixels", "use tl.Environment.image"
            )
        if not np.isfinite(self.rotation):
            raise InputError(
                f"rotation {self.rotation} of an environment",
                "the rotation must be finite",
                "give the rotation in degrees",
            )
        if not abs(self.exposure) <= MAX_EXPOSURE:
            raise InputError(
                f"exposure {self.exposure} of an environment",
                f"the exposure must lie within {MAX_EXPOSURE:g} stops",
                "use a value such as 1",
            )

    def __repr__(self) -> str:
        behind = f", before {self.background!r}" if self.background else ""
        size = f" {self.map.size[0]}x{self.map.size[1]}" if self.map else ""
        return f"Environment({self.kind}{size}{behind})"

    @classmethod
    @checked
    def constant(cls, radiance: ColorLike) -> Environment:
        """Environment with the same radiance from all directions."""
        return cls("constant", parse_radiance(_WHAT, radiance), parse_radiance(_WHAT, radiance))

    @classmethod
    @checked
    def gradient(cls, bottom: ColorLike, top: ColorLike) -> Environment:
        """Vertical gradient from `bottom` (rays along -Y) to `top` (rays along +Y), linear in the sine of elevation."""
        return cls("gradient", parse_radiance(_WHAT, bottom), parse_radiance(_WHAT, top))

    @classmethod
    @checked
    def checkerboard(
        cls, first: ColorLike = (0.9, 0.9, 0.9), second: ColorLike = (0.6, 0.6, 0.6), tiles: float = 8.0
    ) -> Environment:
        """Checkerboard backdrop, fixed to the picture: it shows the transmission of a body."""
        return cls("checkerboard", parse_radiance(_WHAT, first), parse_radiance(_WHAT, second), tiles)

    @classmethod
    @checked
    def image(
        cls, source: str | Path | npt.ArrayLike | EnvironmentMap, rotation: float = 0.0, exposure: float = 0.0
    ) -> Environment:
        """Environment from a picture of all directions in equirectangular projection.

        Row 0 is straight up (+Y), the center of the picture is straight ahead (-Z), and +X is to the right of it.

        Parameters
        ----------
        source : str, Path, array_like (h, w, 3) or EnvironmentMap
            A ``.hdr``, ``.exr``, ``.png`` or ``.jpg`` file, or linear radiance. Twice as wide as high.
        rotation : float
            About +Y, in degrees, counterclockwise as seen from above.
        exposure : float
            Stops brighter.

        Raises
        ------
        InputError
            If the file cannot be read, or holds no picture.
        """
        if isinstance(source, str | Path):
            from translucent.scene.environment_files import read_environment_map

            source = read_environment_map(source)
        if not isinstance(source, EnvironmentMap):
            source = EnvironmentMap(cast("npt.NDArray[np.floating[Any]]", source))
        return cls("image", np.zeros(3), np.zeros(3), map=source, rotation=rotation, exposure=exposure)

    @classmethod
    @checked
    def studio(cls, rotation: float = 0.0, exposure: float = 0.0) -> Environment:
        """Procedural photographer's studio: soft boxes, dark cards and a warm floor, which flatter glass."""
        from translucent.scene.studio import studio_map

        return cls.image(studio_map(), rotation, exposure)

    def with_background(self, background: Environment) -> Environment:
        """Copy with another environment as the visible background; light and reflections stay."""
        if not isinstance(background, Environment):
            raise InputError(
                f"background {brief(background)}",
                f"of type {type(background).__name__}",
                "give an object of type tl.Environment",
            )
        return dataclasses.replace(self, background=background.seen)

    @property
    def seen(self) -> Environment:
        """Environment that is visible: the background if there is one, else itself."""
        return self.background or self

    @property
    def scale(self) -> float:
        """Factor of the exposure."""
        return float(2.0**self.exposure)

    @property
    def turn(self) -> float:
        """Rotation in turns, as `equirectangular_uv` takes it."""
        return self.rotation / 360.0

    @property
    def mean(self) -> Array:
        """(3,): mean radiance over all directions that it lights from."""
        return 0.5 * (self.first + self.second) if self.map is None else self.scale * self.map.mean

    @cached_property
    def light_map(self) -> EnvironmentMap:
        """Map of the light of the environment, before rotation and exposure; that of a checkerboard is its mean."""
        if self.map is not None:
            return self.map
        if self.kind == "gradient":
            return _gradient_map(tuple(self.first.tolist()), tuple(self.second.tolist()))
        return _uniform_map(tuple(self.mean.tolist()))

    @checked
    def radiance(self, directions: npt.ArrayLike, backdrop: npt.ArrayLike) -> Array:
        """Radiance seen along rays, (..., 3): that of the background, if there is one.

        Parameters
        ----------
        directions : array_like (..., 3)
            Unit vectors.
        backdrop : array_like (..., 2)
            Position in the picture, right and down from the top left corner, in heights of the picture.
        """
        background = self.seen
        if background.kind != "checkerboard":
            return background.lighting(directions)
        return (
            background.first
            + (background.second - background.first) * checkerboard_share(backdrop, background.tiles)[..., None]
        )

    @checked
    def lighting(self, directions: npt.ArrayLike) -> Array:
        """Radiance (..., 3) that arrives as light from unit vectors (..., 3), whatever the background.

        A backdrop fixed to the picture lights like the mean of its squares.
        """
        if self.map is not None:
            return self.scale * self.map.at(equirectangular_uv(directions, self.turn))
        if self.kind == "gradient":
            fraction = gradient_share(directions)
        else:
            fraction = np.full(np.asarray(directions).shape[:-1], 0.5)
        return self.first + (self.second - self.first) * fraction[..., None]

    @checked
    def irradiance_on(self, normals: npt.ArrayLike) -> Array:
        """Irradiance on surfaces with unit `normals` (..., 3) that nothing shadows, (..., 3).

        A backdrop fixed to the picture lights like the mean of its squares. Of an image it is looked up in
        `environment_filter.Filtered.irradiance`.
        """
        if self.map is not None:
            from translucent.scene.environment_map import irradiance_map

            return self.scale * irradiance_map(self.map).at(equirectangular_uv(normals, self.turn))
        if self.kind == "gradient":
            fraction = gradient_irradiance_share(normals)
        else:
            fraction = np.full(np.asarray(normals).shape[:-1], 0.5)
        with np.errstate(under="ignore"):
            return np.asarray(np.pi * (self.first + (self.second - self.first) * fraction[..., None]))

    def harmonics(self) -> Array:
        """Coefficients (9, 3) of its light in real spherical harmonics of the bands 0 to 2.

        Coefficient i = l (l + 1) + m, as `translucent.formulas.spherical_harmonics.real_harmonics` has them in
        directions of the world: what a bake of scattered light is read with, where the object is not turned.
        """

        return radiance_harmonics(self.lighting, 0 if self.map is None else self.map.size[1])


#: Rows of the picture of a gradient: between two of them, a sine differs from a straight line by 2e-5.
GRADIENT_MAP_HEIGHT = 256


# Environments that light alike share one picture, so that it is blurred, and uploaded, once.


@lru_cache(maxsize=8)
def _gradient_map(bottom: tuple[float, ...], top: tuple[float, ...]) -> EnvironmentMap:
    return EnvironmentMap.from_formula(Environment.gradient(bottom, top).lighting, GRADIENT_MAP_HEIGHT)


@lru_cache(maxsize=8)
def _uniform_map(radiance: tuple[float, ...]) -> EnvironmentMap:
    return EnvironmentMap(np.broadcast_to(np.array(radiance), (2, 4, 3)))


def gradient_share(direction: npt.ArrayLike) -> Array:
    """Fraction of a gradient's top in direction (..., 3): (1 + y) / 2."""
    return np.asarray(0.5 + 0.5 * np.asarray(direction, dtype=np.float64)[..., 1])


def gradient_irradiance_share(normal: npt.ArrayLike) -> Array:
    """Fraction of a gradient's top in what a surface with unit normal (..., 3) receives.

    The cosine-weighted mean of `gradient_share` over the hemisphere: the mean of y there is 2/3 of the normal's y.
    """
    return np.asarray(0.5 + np.asarray(normal, dtype=np.float64)[..., 1] / 3.0)


def checkerboard_share(backdrop: npt.ArrayLike, tiles: npt.ArrayLike) -> Array:
    """Checkerboard pattern at backdrop (..., 2): 0 in the top left square and every second one, 1 in the others."""
    cell = np.floor(np.asarray(backdrop, dtype=np.float64) * np.asarray(tiles, dtype=np.float64)[..., None])
    return np.asarray(np.mod(cell[..., 0] + cell[..., 1], 2.0))


def equirectangular_uv(direction: npt.ArrayLike, turn: npt.ArrayLike) -> Array:
    """Texture coordinates (..., 2) of a direction (..., 3) in an equirectangular picture: right and down, 0 to 1.

    u wraps around. Straight up (+Y) is v = 0, and -Z is u = 1/2. A picture that is rotated about +Y by a positive
    fraction of a full turn, counterclockwise as seen from above, has its center there instead.
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    u = 0.5 + np.arctan2(x, 0.0 - z) / (2.0 * np.pi) + np.asarray(turn, dtype=np.float64)
    return np.stack([u, np.arctan2(np.hypot(x, z), y) / np.pi], axis=-1)


def parse_radiance(what: str, color: ColorLike) -> Array:
    """(3,): linear radiance from a color as text, or one or three numbers >= 0; errors name it `what`."""
    return positive_triple(what, parse_color(color) if isinstance(color, str) else color)


#: Blurred pictures between roughness 0 and 1, and their rows and columns.
LEVELS = 8
LEVEL_SIZE = (128, 256)


@dataclass(frozen=True, eq=False)
class FilteredEnvironment:
    """Prefiltered environment: blurred reflections and irradiance, before its rotation and exposure. Row 0 is straight
    up (+Y).

    Attributes
    ----------
    sharp : EnvironmentMap
        As a mirror reflects it, in full resolution.
    levels : (n, h, w, 3) float32
        As rough surfaces reflect it around each direction: its mean over a GGX lobe.
    roughness : (n,) float64
        Of the levels: 1/n, 2/n, ... 1. The alpha of GGX is its square.
    irradiance : (h, w, 3) float32
        On a surface with each normal: the integral of radiance times cosine.
    """

    sharp: EnvironmentMap
    levels: npt.NDArray[np.float32]
    roughness: Array
    irradiance: npt.NDArray[np.float32]


def filtered(environment: Environment) -> FilteredEnvironment:
    """Prefilter an environment for surfaces: done once for each picture, in less than a second.

    The lobe is that of the split-sum approximation (Karis 2013, "Real Shading in Unreal Engine 4", section on image
    based lighting): seen along the normal and the reflected direction at once (n = v = r), GGX half vectors h, whose
    density is D(h) n.h / (4 v.h) = D(h) / 4 around r, weighted with n.l. It is a mean: a uniform environment stays what
    it is, and so does the integral over all directions.
    """
    return _filtered(environment.light_map)


@lru_cache(maxsize=KEPT)
def _filtered(source: EnvironmentMap) -> FilteredEnvironment:
    roughness = np.arange(1, LEVELS + 1) / LEVELS
    color = source.pixels[0, 0]
    if (source.pixels == color).all():  # which blurring leaves as it is
        levels = np.full((LEVELS, *LEVEL_SIZE, 3), color, dtype=np.float32)
    else:
        pixels = sized(source, LEVEL_SIZE)
        with np.errstate(under="ignore"):
            blurred = [convolved(pixels, partial(ggx_lobe, alpha=alpha)) for alpha in roughness**2]
            levels = np.stack(blurred).astype(np.float32)
    return FilteredEnvironment(source, levels, roughness, irradiance_map(source).pixels.astype(np.float32))


def ggx_lobe(cosine: npt.ArrayLike, alpha: float) -> Array:
    """GGX weight of light at an angle of this cosine to the reflected direction, up to a factor: D(h) n.l, n = v = r.

    The half vector has half the angle: (n.h)^2 = (1 + cos) / 2. Walter et al. 2007, eq. 33, for D.
    """
    c = np.asarray(cosine, dtype=np.float64)
    falloff = 1.0 + 0.5 * (1.0 + c) * (alpha * alpha - 1.0)
    return np.maximum(c, 0.0) / (falloff * falloff)


#: Rows of the picture over which formulas and coarse pictures are integrated: good to 1e-4 of the light.
LEAST_HEIGHT = 128


def radiance_harmonics(radiance: Callable[[Array], Array], height: int) -> Array:
    """(9, 3): integrals over all directions of a function of unit vectors (..., 3), times each of `real_harmonics`.

    Parameters
    ----------
    radiance : callable
    height : int
        Rows of a picture that resolves it; sums are no coarser than that.
    """
    height = max(height, LEAST_HEIGHT)
    angles, directions = row_solid_angles(height, 2 * height), texel_directions(height, 2 * height)
    found = np.zeros((COUNT, 3))
    for rows in row_blocks(height, 2 * height):
        basis = real_harmonics(directions[rows]) * angles[rows, None, None]
        found += np.einsum("yxi,yxc->ic", basis, radiance(directions[rows]))
    return found
