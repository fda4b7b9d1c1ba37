"""Explanations of black pictures, by a wrong unit of a file or a medium too dense for it, and of white ones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from translucent.commands.console import echo
from translucent.units import METRES_PER_UNIT, metres_per_unit

if TYPE_CHECKING:
    from translucent.frames.frame import Frame
    from translucent.media.medium import Medium
    from translucent.scene.scene import Scene

#: Below these shares of light, passed straight or scattered back, a picture shows little but black.
NEARLY_BLACK, HARDLY_LIT = 0.02, 0.05

#: Radiance from which on a picture is white, with what rounding adds, and the share of such pixels that hides a shape.
WHITE, BURNT_OUT = 1.02, 0.3

#: Range of the share of light that passes in a picture that shows its medium.
SHOWS_MEDIUM = (0.05, 0.97)

#: Metres across, from which on a model is rarely one of a thing that light shines through, and what such are usually.
LARGE, USUAL = 0.5, (0.01, 1.0)

#: Units of files, and their names.
_FILE_UNITS = {"mm": "millimetres", "cm": "centimetres", "in": "inches"}


def warn_if_black(scene: Scene, frame: Frame, unit: str, *, own: bool = False) -> None:
    """Warn if hardly any light passes or is scattered back, with the likely reason.

    Parameters
    ----------
    scene : Scene
    frame : Frame
        Of it.
    unit : str
        That the file was taken to be in.
    own : bool
        The model comes with the toolkit, so that its unit is known.
    """
    seen = frame.coverage & frame.valid
    if not seen.any():
        return
    from translucent.planning.darkness import given_back

    passed = float(frame.transmittance[seen].mean())
    if passed >= NEARLY_BLACK or any(given_back(scene, medium) >= HARDLY_LIT for medium in _media(scene)):
        return
    depth = frame.optical_depth[seen].astype(np.float64)
    low, high = (
        np.min([body.bounds[0] for body in scene.bodies], 0),
        np.max([body.bounds[1] for body in scene.bodies], 0),
    )
    thickness = float(np.median(frame.thickness[seen]))
    # Of the channel that gets farthest.
    clearest = float(np.median(depth, axis=0).min())
    tenth = thickness * math.log(10.0) / clearest if clearest > 0 else math.inf
    echo(
        f"warning: only {passed:.2%} of the light passes: the model is {_extent(high - low)} and {_length(thickness)} "
        f"thick at the median, and this medium leaves a tenth of the light after {_length(tenth)}; "
        + (_other_unit(high - low, depth, unit, own) or _clearer(clearest)),
        err=True,
    )


def warn_if_white(frame: Frame, exposure: float, tone: str) -> None:
    """Warn if much of what media cover is beyond the white of a picture that clamps, with what shows it."""
    seen = frame.coverage & frame.valid
    if tone != "none" or not seen.any():
        return
    bright = frame.radiance[seen].astype(np.float64).min(axis=-1) * 2.0**exposure
    if (share := float((bright > WHITE).mean())) < BURNT_OUT:
        return
    darker = exposure - math.ceil(math.log2(float(np.quantile(bright, 0.95))))
    echo(
        f"warning: {share:.0%} of what media cover is brighter than white, and shown as white; "
        f"--tone neutral keeps its shape, and --exposure {darker:g} its brightness",
        err=True,
    )


def _other_unit(size: np.ndarray, depth: np.ndarray, unit: str, own: bool) -> str:
    """Unit in which the model would have a usual size, and the medium would show; empty if there is none."""
    if own or size.max() < LARGE:
        return ""
    for name, words in _FILE_UNITS.items():
        scale = METRES_PER_UNIT[name] / metres_per_unit(unit)
        with np.errstate(under="ignore"):
            passes = float(np.exp(-scale * depth).mean())
        usual = scale < 1 and USUAL[0] <= scale * size.max() <= USUAL[1]
        if usual and SHOWS_MEDIUM[0] <= passes <= SHOWS_MEDIUM[1]:
            return f"is the file in {words}? With --unit {name} it is {_extent(scale * size)}, and {passes:.0%} passes"
    return ""


def _clearer(depth: float) -> str:
    """Factor by which the medium would have to be clearer, for the optical depth of its clearest channel."""
    times = float(f"{depth / math.log(5.0):.2g}")
    return f"in a medium {times:.3g} times as clear (a color at a --distance so much longer), a fifth would pass"


def _media(scene: Scene) -> list[Medium]:
    """Media in which multiple scattering matters."""
    return [
        body.medium for body in scene.bodies if body.medium is not None and body.has_interface and body.medium.scatters
    ]


def _extent(size: np.ndarray) -> str:
    unit, scale = _unit(float(size.max()))
    return f"{' x '.join(f'{value / scale:.3g}' for value in size)} {unit}"


def _length(metres: float) -> str:
    unit, scale = _unit(metres)
    return f"{metres / scale:.3g} {unit}"


def _unit(metres: float) -> tuple[str, float]:
    """Unit in which a length is read best."""
    return next(
        ((name, METRES_PER_UNIT[name]) for name in ("m", "cm", "mm") if metres >= METRES_PER_UNIT[name]), ("um", 1e-6)
    )
