"""Remarks of plans on bodies that are rendered correctly but hardly visible, with advice."""

from __future__ import annotations

import math

import numpy as np

from translucent.formulas.color import luminance
from translucent.formulas.two_stream import two_stream_absorption, two_stream_reflectance, two_stream_scattering
from translucent.media.medium import Medium
from translucent.planning.passes import Note, NoteKind
from translucent.scene.scene import Object, Scene, object_names
from translucent.units import length_text, other_size, short_length

#: Luminance of white light that passes a body, or comes back from it, below which it is black: a step of 8 bits.
BLACK = 1 / 255

#: Luminance at which a body shows its color.
SHOWN = 0.2


def _black_bodies(scene: Scene) -> tuple[Note, ...]:
    """Note on the bodies that are black, with a remedy for the clearest of them; empty if none is black.

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
            fractions = luminance(medium.transmittance([_chord(body) for body in bodies])).tolist()
        black += [(fraction, body) for fraction, body in zip(fractions, bodies, strict=True) if fraction < BLACK]
    if not black:
        return ()
    passed, clearest = max(black, key=lambda found: found[0])
    assert clearest.medium is not None
    chord, distance = _chord(clearest), _distance(clearest.medium, SHOWN)
    text = (
        f"{object_names(body for _, body in black)}: black: only {passed:.1e} of white light passes {_text(chord)}, "
        f"the mean thickness{'' if len(black) == 1 else f' of {clearest.mesh.name!r}'}; a fifth passes "
        f"{_text(distance)}; diluted {chord / distance:.2g} times (--dilute {chord / distance:.2g}), the color "
        "becomes visible"
    )
    return (Note(NoteKind.BLACK, text),)


#: Mean free paths across a body from which on it looks opaque, as plastic or clay, and those at which thin parts glow.
OPAQUE, GLOWING = 200.0, 50.0

#: Mean free paths across a body without an interface up to which it shows nothing, and those at which it is a cloud.
UNSEEN, CLOUDY = 1.0 / 3.0, 5.0

#: Mean chords of a body that count as its size, if they are less than its longest side: walls of a cup are what glows.
_CHORDS = 4.0


def remarks(scene: Scene) -> tuple[Note, ...]:
    """Notes on the bodies of a scene that are black, look opaque, or show nothing, with a remedy."""
    notes = _black_bodies(scene)
    return (*notes, *_opaque_bodies(scene, {note.kind for note in notes}), *_unseen_bodies(scene))


def _opaque_bodies(scene: Scene, known: set[NoteKind]) -> tuple[Note, ...]:
    """Note on bodies that look opaque, because light leaves where it entered."""
    if NoteKind.BLACK in known:
        return ()
    bodies = [
        (_size(body) / free, free, body)
        for body in _plain_bodies(scene)
        if body.medium is not None
        and body.medium.scatters
        and body.has_interface
        and math.isfinite(free := _transport_length(body.medium))
        and _size(body) >= OPAQUE * free
    ]
    if not bodies:
        return ()
    times, free, worst = max(bodies, key=lambda found: found[0])
    return (
        Note(
            NoteKind.OPAQUE_BODIES,
            (
                f"{object_names((body for *_, body in bodies))}: opaque at this size, like plastic: the mean free "
                f"path is {_text(free)}, and {times:.0f} of these fit into {short_length(_size(worst))}; "
                f"{other_size(scene.shown_bounds, GLOWING / times)} light would shine through thin parts, or with "
                f"--dilute {times / GLOWING:.2g}"
            ),
        ),
    )


def _unseen_bodies(scene: Scene) -> tuple[Note, ...]:
    """Note on fog that is too thin to be visible."""
    bodies = [
        (_size(body) * float(body.medium.extinction.max()), body)
        for body in _plain_bodies(scene)
        if body.medium is not None
        and not body.has_interface
        and not body.medium.emits
        and 0.0 < _size(body) * float(body.medium.extinction.max()) <= UNSEEN
    ]
    if not bodies:
        return ()
    times, first = max(bodies, key=lambda found: found[0])
    return (
        Note(
            NoteKind.UNSEEN_BODIES,
            (
                f"{object_names((body for _, body in bodies))}: invisible: light travels "
                f"{short_length(_size(first) / times)} through this medium before it is scattered or absorbed "
                f"(the mean free path), but the size of the body is only {short_length(_size(first))}; "
                f"{other_size(scene.shown_bounds, CLOUDY / times)} the medium would be visible"
            ),
        ),
    )


def _plain_bodies(scene: Scene) -> list[Object]:
    """Solids of one density, whose surfaces light enters everywhere."""
    return [
        body
        for body in scene.bodies
        if body.density is None
        and body.sheet_thickness is None
        and (body.surface is None or body.surface.transmission == 1.0)
    ]


def _size(body: Object) -> float:
    """Size of a body in metres that mean free paths are compared with."""
    longest = float((body.bounds[1] - body.bounds[0]).max())
    return min(longest, _CHORDS * _chord(body)) if body.mesh.diagnosis.sound else longest


def _transport_length(medium: Medium) -> float:
    """Transport mean free path 1 / (sigma_a + sigma_s (1 - g)) in metres, of the channel that gets farthest."""
    reduced = np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    return 1.0 / float(reduced.min()) if reduced.min() > 0 else math.inf


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


def _distance(medium: Medium, fraction: float) -> float:
    """Distance in metres that this fraction of the luminance of white light passes."""
    # Of the clearest channel alone so much would pass no sooner, and of the densest no later.
    low, high = (-math.log(fraction) / sigma for sigma in (medium.extinction.max(), medium.extinction.min()))
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _passes(medium, middle) > fraction else (low, middle)
    return float(np.mean((low, high)))
