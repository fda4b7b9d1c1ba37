"""Procedural photographer's studio as an environment."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.scene.environment_map import EnvironmentMap

#: Rows of the picture. The edges of the soft boxes are about two pixels wide.
STUDIO_HEIGHT = 512


class Panel(NamedTuple):
    """Panel: a rectangle that faces the subject.

    Attributes
    ----------
    azimuth, elevation : float
        Where its center is, in degrees: from -Z towards +X, and up.
    width, height : float
        Angles in degrees under which its middle lines are seen.
    radiance : (r, g, b)
        In its middle.
    falloff : float
        How much darker it is at its corners, as a fraction.
    softness : float
        Width of its edges, as a fraction of its half width and half height.
    """

    azimuth: float
    elevation: float
    width: float
    height: float
    radiance: tuple[float, float, float]
    falloff: float = 0.0
    softness: float = 0.03


#: Panels that shine, the farthest first. A camera usually looks along -Z, so +Z is behind it.
LIT_PANELS = (
    Panel(0, 10, 126, 70, (0.98, 0.98, 1.0), falloff=0.4, softness=0.6),  # the backdrop, lit from below
    Panel(138, 40, 44, 36, (9.5, 9.15, 8.55), falloff=0.35),  # key light, a large soft box to the right of the camera
    Panel(-122, 22, 11, 72, (5.5, 5.8, 6.3), falloff=0.15, softness=0.08),  # rim light, a strip to the left
    Panel(97, 18, 6, 66, (4.0, 4.15, 4.4), falloff=0.15, softness=0.08),  # a narrower one on the right
    Panel(-158, 50, 26, 18, (2.6, 2.7, 2.85), falloff=0.25),  # fill light, above and behind the camera
)

#: Dark cards: black edges that draw the shape of glass.
DARK_CARDS = (
    Panel(-66, 4, 13, 84, (0.012, 0.012, 0.014), softness=0.1),
    Panel(66, 4, 13, 84, (0.012, 0.012, 0.014), softness=0.1),
)

#: All panels of the studio, the farthest first.
PANELS = (*LIT_PANELS, *DARK_CARDS)

#: Radiance of the room: straight down near the subject, the floor far away, the wall at the horizon, and the ceiling.
FLOOR_NEAR, FLOOR_FAR = (0.31, 0.25, 0.20), (0.60, 0.55, 0.49)
WALL, CEILING = (0.50, 0.51, 0.53), (0.13, 0.135, 0.15)


#: Radiance of the room of the dark studio, which has all panels but the backdrop.
DARK = (0.006, 0.006, 0.007)


@lru_cache(maxsize=1)
def dark_studio_map() -> EnvironmentMap:
    """Environment map of a studio with dark walls, in which soft boxes alone are mirrored; made once."""
    return EnvironmentMap.from_formula(dark_studio_radiance, STUDIO_HEIGHT)


def dark_studio_radiance(directions: npt.ArrayLike) -> Array:
    """Radiance (..., 3) from unit vectors (..., 3): soft boxes and strips in the dark."""
    towards = np.asarray(directions, dtype=np.float64)
    return _with_panels(np.broadcast_to(np.asarray(DARK), towards.shape).copy(), towards, PANELS[1:])


#: Radiance of the backdrop of `cove_map`, as a fraction of that of the studio.
COVE_BACKDROP = 0.56


@lru_cache(maxsize=1)
def cove_map() -> EnvironmentMap:
    """Environment map of the studio with a backdrop as bright as the ground before it, without dark cards."""
    return EnvironmentMap.from_formula(cove_radiance, STUDIO_HEIGHT)


def cove_radiance(directions: npt.ArrayLike) -> Array:
    """Radiance (..., 3) from unit vectors (..., 3): the studio's, with the darker backdrop and without the dark cards.

    Above a ground, flat faces of clear bodies mirror the cards as black bars.
    """
    towards = np.asarray(directions, dtype=np.float64)
    red, green, blue = (COVE_BACKDROP * value for value in PANELS[0].radiance)
    backdrop = PANELS[0]._replace(radiance=(red, green, blue))
    return _with_panels(_room(towards[..., 1]), towards, (backdrop, *LIT_PANELS[1:]))


@lru_cache(maxsize=1)
def studio_map() -> EnvironmentMap:
    """Environment map of the studio; made once."""
    return EnvironmentMap.from_formula(studio_radiance, STUDIO_HEIGHT)


def studio_radiance(directions: npt.ArrayLike) -> Array:
    """Radiance (..., 3) from unit vectors (..., 3): a room, and the panels that hang in it."""
    towards = np.asarray(directions, dtype=np.float64)
    return _with_panels(_room(towards[..., 1]), towards, PANELS)


def _with_panels(radiance: Array, towards: Array, panels: tuple[Panel, ...]) -> Array:
    for panel in panels:
        # Of most directions a panel covers nothing.
        on = towards @ _center(panel) > np.cos(np.radians(0.5 * np.hypot(panel.width, panel.height)))
        fraction, brightness = _panel(towards[on], panel)
        radiance[on] += fraction * (np.asarray(panel.radiance) * brightness - radiance[on])
    return radiance


def _room(height: Array) -> Array:
    """Floor, wall and ceiling by the sine of the elevation; where floor and wall meet the corner is rounded."""
    if height.ndim > 1 and height.shape[-1] > 1 and (height == height[..., :1]).all():  # rows of a map are alike
        return np.repeat(_room(height[..., :1]), height.shape[-1], axis=-2)
    above = np.clip(height, 0.0, 1.0)[..., None]
    below = np.clip(-height, 0.0, 1.0)[..., None]
    wall = _mixed(np.asarray(WALL), np.asarray(CEILING), _smooth(above / 0.9))
    floor = _mixed(np.asarray(FLOOR_FAR), np.asarray(FLOOR_NEAR), _smooth(below / 0.85))
    return _mixed(floor, wall, _smooth((height[..., None] + 0.05) / 0.1))


def _center(panel: Panel) -> Array:
    """Unit vector towards the middle of a panel."""
    azimuth, elevation = np.radians(panel.azimuth), np.radians(panel.elevation)
    return np.array([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), -np.cos(elevation) * np.cos(azimuth)])


def _panel(towards: Array, panel: Panel) -> tuple[Array, Array]:
    """Coverage (n, 1) of directions (n, 3) by a panel, and the panel's brightness there."""
    azimuth, center = np.radians(panel.azimuth), _center(panel)
    right = np.array([np.cos(azimuth), 0.0, np.sin(azimuth)])
    ahead = towards @ center
    depth = np.maximum(ahead, 1e-6)  # what is behind the subject is on no panel in front of it
    x = towards @ right / depth / np.tan(np.radians(0.5 * panel.width))
    y = towards @ np.cross(right, center) / depth / np.tan(np.radians(0.5 * panel.height))
    inside = np.where(ahead > 0, _edge(x, panel.softness) * _edge(y, panel.softness), 0.0)
    brightness = 1.0 - panel.falloff * np.clip(0.5 * (x * x + y * y), 0.0, 1.0)
    return inside[..., None], brightness[..., None]


def _edge(x: Array, softness: float) -> Array:
    """Smooth window: 1 in the middle, 0 beyond the edges at -1 and 1."""
    return _smooth((1.0 - np.abs(x)) / softness)


def _smooth(fraction: Array) -> Array:
    """The cubic from 0 at 0 to 1 at 1 that is flat at both ends."""
    t = np.clip(fraction, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _mixed(first: Array, second: Array, fraction: Array) -> Array:
    return first + (second - first) * fraction
