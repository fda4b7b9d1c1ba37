"""Stages: what a model stands on and before, and what lights it there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, radians, sin

from translucent.errors import InputError
from translucent.scene.environment import Environment
from translucent.scene.studio import dark_studio_map
from translucent.scene.surface import Surface
from translucent.suggestions import close_names, did_you_mean

Color = tuple[float, float, float]


@dataclass(frozen=True)
class KeyLight:
    """Light that throws the shadow of a stage.

    Attributes
    ----------
    azimuth, elevation : float
        Where it comes from, in degrees: from ahead of the camera towards its right, and up. From behind the model
        (0, and up to 90 to both sides) its light shines through to the camera.
    irradiance : (r, g, b)
        On a surface that faces it, in W/m^2.
    """

    azimuth: float
    elevation: float
    irradiance: Color


@dataclass(frozen=True)
class Stage:
    """Stages: what a model stands on and before.

    Attributes
    ----------
    ground : Surface
        Finish of the ground, which is level and has no end.
    environment : callable
        Makes what lights the model and is mirrored in it; -Z of it is ahead of the camera.
    keys : tuple of KeyLight
    height : float
        Of the default camera over the model, in degrees.
    far : float
        Share of its paint that the ground has far away.
    """

    ground: Surface
    environment: Callable[[], Environment]
    keys: tuple[KeyLight, ...]
    height: float
    far: float = 1.0

    @property
    def view(self) -> Color:
        """Direction in which the default camera looks: ahead, a little to the left, and down."""
        level = cos(radians(self.height))
        return -level * sin(radians(AZIMUTH)), -sin(radians(self.height)), -level * cos(radians(AZIMUTH))


#: How far to the right of the model the default camera is, in degrees about it.
AZIMUTH = 24.2

#: The default stage, and the name for none of them: the model floats before its environment.
DEFAULT_STAGE, NO_STAGE = "studio", "none"

#: Tone curve of pictures of stages, whose light sources are brighter than white.
STAGED_TONE = "neutral"

#: All stages by name.
STAGES = {
    "studio": Stage(
        Surface(color=(0.74, 0.74, 0.75), roughness=0.25),
        lambda: Environment.studio(exposure=-1.0),
        (KeyLight(-42.0, 52.0, (2.15, 2.08, 1.98)),),
        height=20.0,
        far=0.3,
    ),
    "light-table": Stage(
        Surface(color=(0.5, 0.5, 0.5), roughness=0.25, emissive=(0.55, 0.56, 0.58)),
        lambda: Environment.studio(exposure=-1.5).with_background(Environment.constant((0.9, 0.91, 0.93))),
        (KeyLight(35.0, 58.0, (0.9, 0.9, 0.9)),),
        height=34.0,
    ),
    "night": Stage(
        Surface(color=(0.05, 0.052, 0.058), roughness=0.15),
        lambda: Environment.image(dark_studio_map(), exposure=-0.6),
        (KeyLight(-30.0, 46.0, (4.6, 4.4, 4.1)),),
        height=20.0,
        far=0.05,
    ),
    "daylight": Stage(
        Surface(color=(0.78, 0.75, 0.70), roughness=0.6),
        lambda: Environment.gradient((0.34, 0.33, 0.31), (0.42, 0.48, 0.60)),
        (KeyLight(48.0, 42.0, (3.0, 2.8, 2.45)),),
        height=26.0,
        far=0.6,
    ),
}


def stage_named(name: str) -> Stage | None:
    """Stage of this name; None for ``none``.

    Raises
    ------
    InputError
        If there is none.
    """
    if name == NO_STAGE:
        return None
    if name not in STAGES:
        names = (NO_STAGE, *STAGES)
        close = close_names(name, names)
        do = did_you_mean(close) if close else f"give one of {', '.join(names)}"
        raise InputError(f"stage {name!r}", "no such stage", do)
    return STAGES[name]
