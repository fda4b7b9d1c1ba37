"""Environment light after forward scattering: the background, blurred by a medium, by optical depth.

References
----------
Goudsmit & Saunderson 1940, "Multiple scattering of electrons"; Premoze et al. 2004, "Practical rendering of multiple
scattering effects in participating media", for the light that stays near a ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas.phase import henyey_greenstein
from translucent.media.medium import Medium
from translucent.scene.environment import Environment, equirectangular_uv
from translucent.scene.environment_map import bilinear, convolved, row_solid_angles, texel_directions

#: Depths, rows and columns.
DEPTHS, HEIGHT, WIDTH = 16, 32, 64

#: Attenuation of the lowest Legendre moments, as an exponent, beyond which nothing is left.
_GONE = 4.0

#: Optical depth that stands for none, at which the ratio has a limit.
_NO_DEPTH = 1e-6

#: Reduced optical depth of a body beyond which little is seen of what is behind.
_OPAQUE = 6.0

#: Most events on a path that differ from many, and the mean cosine after them from which on they do.
_MOST_EVENTS, _LEAST_POWER = 128, 0.05


@dataclass(frozen=True, eq=False)
class EnvironmentAhead:
    """Radiance along rays by light that was scattered forward, over exp(-(1 - straight) depth) - exp(-depth).

    A Legendre moment of order l > 2 of the environment is multiplied by exp(-(1 - g^l) depth) - exp(-depth): as by a
    Poisson number n > 0 of events, of g^n together. Of lower orders cells hold what has turned, and 1 - g^l is the
    fraction here that turns there.

    Attributes
    ----------
    radiance : (WIDTH + 2, HEIGHT, DEPTHS, 3) float32
        An equirectangular picture, with a column more at each side, for each optical depth of scattering x. These are
        `deepest` times the squares of even fractions.
    deepest : float
        The last depth.
    """

    radiance: npt.NDArray[np.float32]
    deepest: float

    def at(self, directions: Array, depth: Array) -> Array:
        """(k, 3): radiance in directions (k, 3), for optical depths (k, 3) of scattering."""
        maps = self.radiance[1:-1].transpose(2, 1, 0, 3)
        place = np.sqrt(np.minimum(depth / self.deepest, 1.0)) * (DEPTHS - 1)
        below = np.minimum(place.astype(np.int64), DEPTHS - 2)
        uv, found = equirectangular_uv(directions, 0.0), np.zeros(depth.shape)
        for channel, (number, fraction) in enumerate(zip(below.T, (place - below).T, strict=True)):
            near, far = (bilinear(maps, number + i, uv)[:, channel] for i in (0, 1))
            found[:, channel] = near + fraction * (far - near)
        return found


@lru_cache(maxsize=2)
@np.errstate(under="ignore")
def environment_ahead(
    environment: Environment, anisotropy: float, straight: float, order: int = 2
) -> EnvironmentAhead | None:
    """Forward-scattered light of an environment in media with a mean cosine g > 0; None if it is black.

    `straight` is the fraction of scattered light that counts as unscattered in cells, up to moments of this order.
    """
    directions, angles = texel_directions(HEIGHT, WIDTH), row_solid_angles(HEIGHT, WIDTH)[:, None, None]
    fine = _means(environment)
    if not fine.any():
        return None
    mean = (fine * angles).sum(axis=(0, 1)) / (4.0 * np.pi)
    first = np.einsum("yxc,yxd->cd", fine * angles, directions) / (4.0 * np.pi)
    gradient = 3.0 * directions @ first.T
    second = np.einsum("yxc,yxd,yxe->cde", fine * angles, directions, directions) / (4.0 * np.pi)
    curvature = 7.5 * np.einsum("yxd,yxe,cde->yxc", directions, directions, second) - 2.5 * mean if order == 2 else 0.0
    deepest = _GONE / (1.0 - straight)
    events = [n for n in range(1, _MOST_EVENTS + 1) if anisotropy**n >= _LEAST_POWER]
    if environment.kind != "image":
        events, mean, gradient, curvature = [], fine, 0.0, 0.0  # hardly any moment of order 3 and more
    blurred = [convolved(fine, partial(henyey_greenstein, anisotropy=anisotropy**n)) for n in events]
    found = np.zeros((DEPTHS, HEIGHT, WIDTH, 3))
    for i, depth in enumerate(deepest * (np.arange(DEPTHS) / (DEPTHS - 1)) ** 2):
        depth = max(depth, _NO_DEPTH)
        ratio = 1.0 / np.expm1(straight * depth)
        found[i] = mean + gradient + curvature
        for n, picture in zip(events, blurred, strict=True):
            ratio *= depth / n
            power = anisotropy**n
            found[i] += ratio * (picture - mean - power * gradient - power**2 * curvature)
    wrapped = np.concatenate([found[:, :, -1:], found, found[:, :, :1]], axis=2)
    return EnvironmentAhead(np.ascontiguousarray(wrapped.transpose(2, 1, 0, 3), np.float32), deepest)


def behind_body(environment: Environment, medium: Medium, thickness: float) -> EnvironmentAhead | None:
    """Find what a body leaves of a picture of an environment behind it; None where it is nearly nothing, or no picture.

    Diffusion counts g of the scattered light as unscattered, and cells hold moments of orders 0 and 1 of what turns.
    `thickness` is the mean one in metres.
    """
    g = medium.anisotropy
    reduced = (1.0 - g) * min(np.asarray(medium.scattering)) + min(np.asarray(medium.absorption))
    if environment.kind != "image" or g <= 0.0 or reduced * thickness > _OPAQUE:
        return None
    return environment_ahead(environment, g, g, 1)


def _means(environment: Environment) -> Array:
    """(HEIGHT, WIDTH, 3): mean radiance of the environment's light in the texels of a small picture."""
    times = 8
    fine = environment.lighting(texel_directions(times * HEIGHT, times * WIDTH))
    angles = row_solid_angles(times * HEIGHT, times * WIDTH)[:, None, None]
    shape = HEIGHT, times, WIDTH, times, -1
    total = (fine * angles).reshape(shape).sum(axis=(1, 3))
    return np.asarray(total / np.broadcast_to(angles, fine[..., :1].shape).reshape(shape).sum(axis=(1, 3)))
