"""Subsurface radiance of bodies in which light diffuses, in float64. Each has a twin in ``shaders/lib/diffusion.glsl``.

All functions are pure and broadcast over channels.

References
----------
Eddington 1926, "The internal constitution of the stars", section 226: light that leaves a scattering half-space.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics
from translucent.formulas.phase import AHEAD_EVENTS, LEAST_POWER, henyey_greenstein, phase_value

#: Roughness of the mirror that blurs the environment as media blur what they scatter ahead: half of the directions are
#: within 40 degrees, as after one to three events with g = .8.
IN_SCATTERED_ROUGHNESS = 0.8

#: Distance in cells up to which a sample of a surface counts for a cell.
SAMPLE_REACH = 2.0

#: Least cosine of entering light with the normal, inside.
LEAST_COSINE = 0.05

#: Azimuths at which the phase function is looked at for its mean over all of them.
AZIMUTHS = 4

#: Cosine that uniform light counts with in `emergent_radiance`: so lossless bodies in it are as bright at all angles
#: (Eddington 1926).
UNIFORM_COSINE = 3.0**-0.5

#: Least optical depth in `last_event_fraction`: float32 then finds it within 1e-4.
LEAST_EVENT_DEPTH = 0.03

#: Angle in radians, beside the critical one, at which the reflectance of forward-scattered light goes from that of rays
#: to that of diffuse light in proportion to its mean cosine: see `ahead_mirrored`.
AHEAD_ANGLE = 0.5


@np.errstate(under="ignore")
def emergent_radiance(
    fluence: npt.ArrayLike,
    entering: npt.ArrayLike,
    albedo: npt.ArrayLike,
    conductance: npt.ArrayLike,
    mean_cosine: npt.ArrayLike,
    cosine: npt.ArrayLike,
) -> Array:
    """Radiance times 4 pi, inside a body below its surface and towards it, of light that has been scattered.

    With D = (2 - w) / 3 and k = sqrt((1 - w) / D), in mean free paths, light that enters with a cosine m has the
    fluence A exp(-k t) + B exp(-t / m) at a depth t by diffusion, phi_1 at the surface; a ray that leaves gathers it.
    The rest of the fluence comes from elsewhere, with phi' = c phi / D at the surface and phi'' = k^2 phi below. In all
    E / (mu + m) + w ((phi_1 + E m mu / (D (1 + k m) (m + mu))) / (1 + k mu)
    + (phi - phi_1) (1 + c mu / D + k^2 mu^2)), where phi_1 = E / ((1 + k m) (c + k D)), or phi if that is less.
    Half-spaces in uniform light are as bright at each angle as in the exact solution within 1.5 %, at any albedo.

    Parameters
    ----------
    fluence : array_like (..., 3)
        phi at the surface.
    entering : array_like (..., 3)
        E: flux that enters there, times the albedo.
    albedo : array_like (..., 3)
        w: sigma_s' / sigma_t', 0 to 1.
    conductance : array_like
        c: `DiffuseInterface.conductance`.
    mean_cosine : array_like
        m: of the light that enters, inside; `UNIFORM_COSINE` for uniform light.
    cosine : array_like
        mu: of the direction towards the surface, inside.
    """
    phi, e, w, c, m, mu = (
        np.asarray(x, np.float64) for x in (fluence, entering, albedo, conductance, mean_cosine, cosine)
    )
    d = (2.0 - w) / 3.0
    k = np.sqrt((1.0 - w) / d)
    own = np.minimum(e / ((1.0 + k * m) * (c + k * d)), phi)
    once = e / (mu + m)
    gathered = (own + once * m * mu / (d * (1.0 + k * m))) / (1.0 + k * mu)
    rising = 1.0 + c * mu / d + (k * mu) ** 2
    return np.asarray(once + w * (gathered + (phi - own) * rising))


def first_events_excess(phase: npt.ArrayLike, scale: npt.ArrayLike, cos_scatter: npt.ArrayLike) -> Array:
    """Radiance by first events at an angle, over that by as many events that scatter to all sides alike, less 1.

    `emergent_radiance` takes similarity for the phase function: it scatters to all sides alike, and as much less. Light
    that has been scattered once still has the phase function's shape, and the albedo of single scattering (as in the
    correction of Nakajima & Tanaka 1988, "Algorithms for radiative intensity calculations").

    Parameters
    ----------
    phase : array_like (..., 4)
        `PhaseFunction.parameters`.
    scale : array_like (..., 3)
        Albedo of single scattering over the reduced one.
    cos_scatter : array_like (..., 1)
    """
    value = phase_value(np.asarray(phase)[..., None, :], cos_scatter)
    return np.asarray(4.0 * np.pi * value * np.asarray(scale, np.float64) - 1.0)


def mean_first_events_excess(
    phase: npt.ArrayLike, scale: npt.ArrayLike, down: npt.ArrayLike, up: npt.ArrayLike
) -> Array:
    """Mean of `first_events_excess` over all azimuths.

    Parameters
    ----------
    phase, scale
        See there.
    down, up : array_like (..., 1)
        Cosines of the light that enters and of the light that leaves with the normal, inside.
    """
    down, up = np.asarray(down, np.float64), np.asarray(up, np.float64)
    level = np.sqrt(np.maximum((1.0 - down * down) * (1.0 - up * up), 0.0))
    azimuths = np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    return np.asarray(
        np.mean([first_events_excess(phase, scale, level * np.cos(angle) - down * up) for angle in azimuths], axis=0)
    )


def last_event_fraction(optical_depth: npt.ArrayLike) -> Array:
    """Mean distance of the last scattering event from where a ray leaves a body, as a fraction of its path there.

    On a path of optical depth tau the last event is at a depth t with the probability exp(-t) / (1 - exp(-tau)), whose
    mean is 1 - tau / (exp(tau) - 1): a free path in thick bodies, and half the path in thin ones.

    Parameters
    ----------
    optical_depth : array_like (...)
        tau; below `LEAST_EVENT_DEPTH` it counts as that.
    """
    depth = np.maximum(np.asarray(optical_depth, np.float64), LEAST_EVENT_DEPTH)
    return np.asarray(1.0 / depth + 1.0 - 1.0 / optics.opacity(depth))


def staying_fraction(cosine: npt.ArrayLike, anisotropy: npt.ArrayLike) -> Array:
    """Fraction of light on a path out of a body that is still inside after an event ahead, see `scattered_ahead`.

    Events ahead have the second Legendre moment g: the mean squared sine of their angles is 2 (1 - g) / 3. Light on
    paths that make a smaller angle with the surface than that leaves at once where it is turned outwards. Across walls
    all of it stays.

    Parameters
    ----------
    cosine : array_like (...)
        Of the path with the normal where it leaves, 0 to 1.
    anisotropy : array_like (...)
        g.
    """
    sine = np.sqrt(np.maximum(2.0 / 3.0 * (1.0 - np.asarray(anisotropy, np.float64)), np.finfo(np.float32).tiny))
    return np.asarray(np.minimum(np.asarray(cosine, np.float64) / sine, 1.0))


def scattered_ahead(
    depth: npt.ArrayLike,
    ahead: npt.ArrayLike,
    anisotropy: npt.ArrayLike,
    cos_scatter: npt.ArrayLike,
    staying: npt.ArrayLike = 1.0,
) -> Array:
    """Radiance times 4 pi of directed light with unit irradiance, behind a path on which it has been scattered ahead.

    Diffusion counts that light as unscattered. Similarity splits the phase function into g of a peak ahead and 1 - g
    that goes to all sides alike (Wiscombe 1977, "The delta-M method"), so events ahead have the Legendre moments
    g^(l - 1), l > 0. On a path t with scattering g s t to the peak the light then has exp(-t) (exp(g^l s t) - 1)
    (Goudsmit & Saunderson 1940), and in total as much as of order 1: what crosses a slab is the difference of
    exp(-t') and exp(-t). Orders 1 and 2 are in closed form here, and others the sum over a Poisson number of events.
    Negative values, which no light has, count as 0.

    Parameters
    ----------
    depth : array_like (..., 3)
        t: optical depth of the path.
    ahead : array_like (..., 3)
        Fraction of the extinction by events ahead, g sigma_s / sigma_t.
    anisotropy : array_like (..., 1)
        g, more than 0 and at most 1.
    cos_scatter : array_like (..., 1)
        Between the directions of travel of the light, before and behind.
    staying : array_like (..., 1)
        Fraction of the light by two or more events that counts, see `staying_fraction`.
    """
    t, part, g, cosine = (np.asarray(x, np.float64) for x in (depth, ahead, anisotropy, cos_scatter))
    second = 1.5 * cosine * cosine - 0.5
    with np.errstate(under="ignore"):
        none = optics.transmittance(t)
        total = (1.0 + 3.0 * cosine) * (optics.transmittance((1.0 - part) * t) - none)
        total = total + 5.0 * second * (optics.transmittance((1.0 - g * part) * t) - none)
        probability, power = none, np.ones_like(g)
        for n in range(1, AHEAD_EVENTS + 1):
            probability, power = probability * part * t / (g * n), power * g
            lower = 1.0 + power * (3.0 * cosine + 5.0 * power * second)
            beyond = 4.0 * np.pi * henyey_greenstein(cosine, power) - lower
            total = total + np.where(power < LEAST_POWER, 0.0, probability * beyond)
        once = none * part * t * (4.0 * np.pi * henyey_greenstein(cosine, g) - (1.0 - g)) / g
    return np.maximum(once + np.asarray(staying, np.float64) * (total - once), 0.0)


@np.errstate(under="ignore")
def ahead_mirrored(
    cosine: npt.ArrayLike,
    ior: npt.ArrayLike,
    reflected: npt.ArrayLike,
    reflected_flux: npt.ArrayLike,
    depth: npt.ArrayLike,
    anisotropy: npt.ArrayLike,
) -> Array:
    """Fraction of forward-scattered light that an interface mirrors where a ray leaves a medium.

    After a depth s of scattering, the scattered light has the mean cosine c with the ray. A fraction 1 - c counts as
    isotropic, and the interface mirrors r of it; a fraction c counts as going ahead. If the interface mirrors m of
    all, it mirrors r - (r - m) / c of what goes ahead: Fresnel's reflectance F of the ray for c = 1, and
    q = r - 2 mu (r - R_j) for c = 0. Between both, q + (F - q) c^p with p = 0.5 / |angle to the critical one| fits the
    light of Henyey and Greenstein to 0.03 in the mean, and to 0.15 near the critical angle.

    Parameters
    ----------
    cosine : array_like (...)
        Of the ray inside with the normal, mu.
    ior : array_like (...)
        Index inside relative to outside, >= 1.
    reflected, reflected_flux : array_like (...)
        r and R_j, as in `DiffuseInterface`.
    depth : array_like (...)
        Optical depth of the events ahead on the ray, g s.
    anisotropy : array_like (...)
        g, above 0.
    """
    mu, g = np.asarray(cosine, np.float64), np.asarray(anisotropy, np.float64)
    r, r_flux = np.asarray(reflected, np.float64), np.asarray(reflected_flux, np.float64)
    s = np.maximum(np.asarray(depth, np.float64) / g, 1e-3)
    c = np.maximum(np.exp(-(1.0 - g) * s) - np.exp(-s), 0.0) / (1.0 - np.exp(-s))
    diffuse = r - 2.0 * mu * (r - r_flux)
    beside = np.abs(np.arcsin(1.0 / np.asarray(ior)) - np.arccos(np.clip(mu, 0.0, 1.0)))
    ray = optics.fresnel_dielectric(mu, 1.0 / np.asarray(ior))
    return np.asarray(diffuse + (ray - diffuse) * c ** (AHEAD_ANGLE / np.maximum(beside, 1e-3)))


def in_scattered_shares(reflected: npt.ArrayLike, passed: npt.ArrayLike) -> tuple[Array, Array]:
    """Fractions of mirrored forward-scattered light that leave on the far side, and on the near side.

    What the far interface mirrors crosses, as diffuse light, the body again, and again after each mirror, until it
    leaves: of p that comes across (1 - r) / (1 - (r p)^2) in all on the near side, and r p times that on the far one.

    Parameters
    ----------
    reflected : array_like (...)
        r: fraction of diffuse light from inside that the interface mirrors.
    passed : array_like (...)
        p: fraction of diffuse light that absorption lets across the body.
    """
    r, p = np.asarray(reflected, np.float64), np.asarray(passed, np.float64)
    near = p * (1.0 - r) / (1.0 - (r * p) ** 2)
    return np.asarray(r * p * near), np.asarray(near)
