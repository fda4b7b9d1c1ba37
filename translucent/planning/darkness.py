"""Remarks on bodies that are black in a picture, since their media are too dense for how thick they are."""

from __future__ import annotations

import math

import numpy as np

from translucent.formulas.color import luminance
from translucent.formulas.two_stream import two_stream_absorption, two_stream_reflectance, two_stream_scattering
from translucent.media.medium import Medium
from translucent.planning.notes import Note, NoteKind
from translucent.scene.scene import Object, Scene, object_names
from translucent.units import length_text

#: Luminance of white light that passes a body, or comes back from it, below which it is black: a step of 8 bits.
BLACK = 1 / 255

#: Luminance at which a body shows its color.
SHOWN = 0.2


def black_bodies(scene: Scene) -> tuple[Note, ...]:
    """Note on the bodies that are black, with what would show the one that is nearest to it; empty if none is.

    The thickness that counts is the mean chord 4 V / S of a body (Cauchy 1850), so that rays near its edge pass more.
    """
    by_medium: dict[int, list[Object]] = {}
    for body in scene.bodies:
        if body.density is None and not body.covers and (body.surface is None or body.surface.transmission == 1.0):
            by_medium.setdefault(id(body.medium), []).append(body)
    black: list[tuple[float, Object]] = []
    for bodies in by_medium.values():
        medium = bodies[0].medium
        # As thick as the whole scene: if anything passes that, no body is black.
        if medium is None or medium.emits or _passes(medium, scene.diagonal) + scattered_back(scene, medium) >= BLACK:
            continue
        with np.errstate(under="ignore"):
            shares = luminance(medium.transmittance([_chord(body) for body in bodies])).tolist()
        black += [(share, body) for share, body in zip(shares, bodies, strict=True) if share < BLACK]
    if not black:
        return ()
    passed, clearest = max(black, key=lambda found: found[0])
    assert clearest.medium is not None
    chord, shown = _chord(clearest), _distance(clearest.medium, SHOWN)
    text = (
        f"{object_names(body for _, body in black)}: black: {passed:.1e} of white light passes "
        f"{_text(chord)}, the mean thickness{'' if len(black) == 1 else f' of {clearest.mesh.name!r}'}, and a "
        f"fifth passes {_text(shown)}; a medium {chord / shown:.2g} times as dilute (a color at a distance so "
        "much longer) shows its color"
    )
    return (Note(NoteKind.BLACK, text),)


def scattered_back(scene: Scene, medium: Medium) -> float:
    """Luminance of white light that a body as large as the scene scatters back."""
    if not medium.scatters:
        return 0.0
    absorbed = two_stream_absorption(medium.absorption) * scene.diagonal
    turned = two_stream_scattering(medium.scattering, medium.anisotropy) * scene.diagonal
    return float(luminance(two_stream_reflectance(absorbed, turned)))


def _text(metres: float) -> str:
    return length_text(metres).replace("µ", "u")


def _chord(body: Object) -> float:
    """Mean length of a ray in a solid, and straight through a sheet, in metres."""
    return body.mean_thickness if body.sheet_thickness is not None else 2.0 * body.mean_thickness


def _passes(medium: Medium, distance: float) -> float:
    with np.errstate(under="ignore"):
        return float(luminance(medium.transmittance(distance)))


def _distance(medium: Medium, share: float) -> float:
    """Distance in metres that this share of the luminance of white light passes."""
    # Of the clearest channel alone so much would pass no sooner, and of the densest no later.
    low, high = (-math.log(share) / sigma for sigma in (medium.extinction.max(), medium.extinction.min()))
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _passes(medium, middle) > share else (low, middle)
    return float(np.mean((low, high)))
