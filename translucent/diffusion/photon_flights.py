"""Ways of photons from the lights of a scene through its interfaces, as media see them, by Embree.

The CPU's twin of ``shaders/transport/photons.frag``: the same aims and starts, and the same choices by chance. It tells
of each way between two surfaces, and not of where photons land.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.diffusion.grid import plane_points
from translucent.diffusion.photon_surfaces import AIR, Met, PhotonSurfaces
from translucent.formulas import optics
from translucent.formulas.light import cone_attenuation
from translucent.planning.caustics import PhotonAim, photon_aims
from translucent.scene.scene import Scene

#: Photons that are followed together.
BATCH = 1 << 15

#: Surfaces on the way of a photon after which it is given up.
MOST_MET = 96

#: Share of its power below which a photon ends by Russian roulette, or goes on with this.
ROULETTE = 0.05


@dataclass(frozen=True, eq=False)
class Flights:
    """Ways of photons from one surface to the next.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In metres in the world; directions have unit length.
    length : (n,) float64
        In metres.
    power : (n, 3) float64
        In W, where they begin.
    extinction : (n, 3) float64
        In 1/m, of all that fills the place; what is scattered ahead counts as unscattered.
    filling : (n, objects) float64
        How often each object's medium fills the place.
    before, after : (n, objects) float64
        The same on the other sides of the two surfaces, where light passes these straight on; else as `filling`.
    bent : (n,) bool
        An interface has bent or mirrored them.
    entered : (n,) int64
        Object that decides the index of refraction here and not before, -1 for none.
    bent_before : (n,) bool
        An interface has bent or mirrored them before they have come in.
    lands : (n,) bool
        Something opaque is where they end.
    """

    origins: Array
    directions: Array
    length: Array
    power: Array
    extinction: Array
    filling: Array
    before: Array
    after: Array
    bent: Mask
    entered: Integers
    bent_before: Mask
    lands: Mask

    def where(self, chosen: Mask | Integers) -> Flights:
        """Selection of flights."""
        return Flights(*(getattr(self, one.name)[chosen] for one in fields(self)))


@dataclass(eq=False)
class _Photons:
    """Photons that are on their way; `last` (n, objects) are the faces that they are on, -1 for none."""

    origins: Array
    directions: Array
    power: Array
    started: Array
    windings: npt.NDArray[np.int16]
    since: Integers
    last: Integers
    before: Array
    bent: Mask
    entered: Integers
    bent_before: Mask
    channel: Integers

    def where(self, chosen: Mask | Integers) -> _Photons:
        return _Photons(*(getattr(self, one.name)[chosen] for one in fields(self)))


def photon_flights(scene: Scene, photons: int, seed: int) -> Iterator[Flights]:
    """All ways of about so many photons from the lights of a scene; see `Flights`.

    At a rough interface a photon meets one microfacet, that hides none of the light of another.

    Parameters
    ----------
    scene : Scene
        Its bodies are closed, even, or sheets.
    photons : int
    seed : int
        Of the random numbers.
    """
    surfaces = PhotonSurfaces(scene)
    rng = np.random.default_rng((seed, 0x6D656469))
    for aim in photon_aims(scene, np.zeros(3), photons):
        starts = (plane_points(aim.photons) + rng.random(2)) % 1.0
        for first in range(0, aim.photons, BATCH):
            going = _begun(scene, surfaces, aim, starts[first : first + BATCH], rng)
            for _ in range(MOST_MET):
                if not len(going.origins):
                    break
                flights, going = _step(surfaces, going, rng)
                yield flights


def _begun(scene: Scene, surfaces: PhotonSurfaces, aim: PhotonAim, starts: Array, rng: np.random.Generator) -> _Photons:
    """Photons at the light, or where they come near the scene."""
    count, objects = len(starts), len(scene.objects)
    if aim.right.any():
        power = np.tile(aim.flux / aim.photons, (count, 1))
        target = aim.middle + (2.0 * starts - 1.0) @ np.stack([aim.right, aim.up])
        directions = np.tile(aim.light[:3], (count, 1))
        origins = target - 2.0 * scene.diagonal * directions
        if aim.light[3]:
            way = target - aim.light[:3]
            distance = np.linalg.norm(way, axis=1)
            directions = way / distance[:, None]
            across = np.cross(aim.right, aim.up)
            cosine = np.abs(directions @ (across / np.linalg.norm(across)))
            power *= (cosine / distance**2 * cone_attenuation(directions, aim.cone))[:, None]
            origins = np.tile(aim.light[:3], (count, 1))
    else:
        up, angle = 2.0 * starts[:, 0] - 1.0, 2.0 * np.pi * starts[:, 1]
        level = np.sqrt(np.maximum((1.0 - up) * (1.0 + up), 0.0))
        directions = np.stack([level * np.cos(angle), level * np.sin(angle), up], axis=1)
        origins = np.tile(aim.light[:3], (count, 1))
        power = cone_attenuation(directions, aim.cone)[:, None] * aim.flux / aim.photons
    channel = np.full(count, 1)
    if surfaces.disperses:
        channel = rng.integers(3, size=count)
        power = power * 3.0 * np.eye(3)[channel]
    windings = np.zeros((count, objects), np.int16)
    windings[:, list(aim.inside)] = 1
    lit = np.flatnonzero(power.any(axis=1))
    since, last = np.zeros((count, objects), np.int64), np.full((count, objects), -1)
    filling = surfaces.filling(windings, since)
    unbent, nothing = np.zeros(count, dtype=bool), np.full(count, AIR)
    begun = _Photons(
        origins, directions, power, power, windings, since, last, filling, unbent, nothing, unbent, channel
    )
    return begun.where(lit)


def _step(surfaces: PhotonSurfaces, going: _Photons, rng: np.random.Generator) -> tuple[Flights, _Photons]:
    """Follow photons to the next surface, and on from there."""
    met = surfaces.nearest(going.origins, going.directions, going.last)
    found = np.isfinite(met.distance)
    going, met = going.where(found), met.where(found)
    filling = surfaces.filling(going.windings, going.since)
    extinction = filling @ surfaces.extinction
    with np.errstate(under="ignore"):
        power = going.power * optics.transmittance(extinction * met.distance[:, None])
    points = going.origins + met.distance[:, None] * going.directions
    beyond = _beyond(surfaces, going, met, points, power, rng)
    flights = Flights(
        going.origins,
        going.directions,
        met.distance,
        going.power,
        extinction,
        filling,
        going.before,
        np.where(beyond.straight[:, None], beyond.filling, filling),
        going.bent,
        going.entered,
        going.bent_before,
        beyond.lands,
    )
    # On from a surface that bends or mirrors, the other side is none that light comes straight from.
    after = surfaces.filling(beyond.photons.windings, beyond.photons.since)
    beyond.photons.before = np.where(beyond.straight[:, None], filling, after)
    return flights, _surviving(beyond.photons.where(np.flatnonzero(~beyond.ended)), rng)


@dataclass(eq=False)
class _Beyond:
    """Photons beyond a surface, whether they go straight on, end or land there, and what fills the other side."""

    photons: _Photons
    straight: Mask
    ended: Mask
    lands: Mask
    filling: Array


def _beyond(
    surfaces: PhotonSurfaces, going: _Photons, met: Met, points: Array, power: Array, rng: np.random.Generator
) -> _Beyond:
    windings, since = surfaces.crossed(going.windings, going.since, met, going.directions)
    before, after = surfaces.dominant(going.windings, going.since), surfaces.dominant(windings, since)
    turn = surfaces.turned(met, points, going.directions, before, after, going.channel, power, rng)
    passes = turn.passes[:, None]
    photons = _Photons(
        points,
        turn.directions,
        turn.power,
        going.started,
        np.where(passes, windings, going.windings),
        np.where(passes, since, going.since),
        np.where(met.faces >= 0, met.faces, -1),
        going.before,
        going.bent | turn.bent,
        np.where(turn.passes & (before != after), after, AIR),
        going.bent,
        going.channel,
    )
    ended = np.asarray(turn.ended | ~turn.power.any(axis=1))
    return _Beyond(photons, turn.straight, ended, turn.ended, surfaces.filling(windings, since))


def _surviving(photons: _Photons, rng: np.random.Generator) -> _Photons:
    """Photons that go on by Russian roulette, those with little of their power left by chance."""
    left = np.max(photons.power / np.maximum(photons.started.max(axis=1, keepdims=True), 1e-300), axis=1)
    chance = np.minimum(left / ROULETTE, 1.0)
    lives = rng.random(len(chance)) < chance
    found = photons.where(lives)
    found.power = found.power / chance[lives, None]
    return found
