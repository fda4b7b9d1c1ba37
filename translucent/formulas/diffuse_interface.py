"""Diffuse light at an interface, and the reflectance of a scattering half-space behind it; float64.

References
----------
Walsh 1926, "The reflection factor of a polished glass surface for diffused light"; Haskell et al. 1994, "Boundary
conditions for the diffusion equation in radiative transfer"; Chandrasekhar 1960, "Radiative transfer", section 34;
Grosjean 1956, "A high accuracy approximation for solving multiple scattering problems in infinite homogeneous media";
Walter et al. 2007, "Microfacet models for refraction through rough surfaces".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import interface, optics
from translucent.formulas.phase import ISOTROPIC, PhaseFunction
from translucent.threads import one_blas_thread

#: Even and odd Legendre moments.
_PARTS = slice(0, None, 2), slice(1, None, 2)


@np.errstate(under="ignore")
def bare_half_space(albedo: float, phase: PhaseFunction, cosine: Array, weight: Array, moments: int) -> Array:
    """Reflection matrix (n, n) of a half-space without an interface, averaged around the normal.

    What goes up and what goes down are modes that decay with the depth, each with its own length: together they go
    down at the surface as what comes in, which says how much there is of each, and so what goes up.

    Parameters
    ----------
    albedo : float
        Of single scattering, 0 to 1.
    phase : PhaseFunction
    cosine, weight : (n,)
        Quadrature over 0 to 1.
    moments : int
        Legendre moments of the phase function, as many as the quadrature can resolve: twice the nodes of a part of
        it. The forward peak beyond them counts as unscattered.
    """
    from scipy.linalg import eigh  # late: a window opens without it

    known = phase.moments(moments + 1)
    peak = float(known[-1])
    albedo = albedo * (1.0 - peak) / (1.0 - albedo * peak)
    order = np.arange(moments)
    coefficients = (2 * order + 1) * (known[:-1] - peak) / (1.0 - peak)
    root = np.sqrt(weight)
    values = root[:, None] * np.polynomial.legendre.legvander(cosine, moments - 1)
    one = np.eye(len(cosine))
    # Even moments act on the sum alone, odd ones on the difference: with s = up + down, t = up - down, mu s' = odd t
    # and mu t' = even s. Both are symmetric, as the radiance carries the roots of the weights.
    even, odd = (one - albedo * (values[:, part] * coefficients[part]) @ values[:, part].T for part in _PARTS)
    along = np.linalg.solve(odd, np.diag(cosine))
    rates, sums = eigh(even, cosine[:, None] * along)  # looks at one triangle of each alone
    differences = along @ sums * np.sqrt(np.maximum(rates, 0.0))
    back = np.linalg.solve((sums + differences).T, (sums - differences).T).T
    return np.asarray(back / root[:, None] * root)


#: Points of the quadratures, and of the sums over microfacets of a rough interface.
NODES, FACETS = 64, 1 << 14

#: Points of the quadrature where media scatter more to one side: it costs their third power, and errs by 1e-5.
MODE_NODES = 24

#: Change of Chandrasekhar's function at which its iteration ends, and steps after which it ends anyway.
H_TOLERANCE, H_STEPS = 1e-13, 200


@dataclass(frozen=True)
class DiffuseInterface:
    """Fractions of diffuse light that an interface reflects and lets through.

    Light that microfacets of a rough one block comes to more of them, and ends up in the denser medium: of that outside
    nine tenths go in, by random walks among them (Heitz et al. 2016), and of that inside nine tenths stay.

    Attributes
    ----------
    entering : float
        Of uniform radiance from outside, the fraction that enters.
    mean_cosine : float
        Of the entering light, inside: the mean depth of its first event is this many mean free paths.
    reflected, reflected_flux : float
        Of light from inside, the fraction that is reflected: of uniform radiance, weighted by the cosine; and of
        radiance that is as the cosine, weighted by its square (R_phi and R_j of Haskell et al. 1994).
    leaving, leaving_flux : float
        Likewise, the fractions that leave.
    """

    entering: float
    mean_cosine: float
    reflected: float
    reflected_flux: float
    leaving: float
    leaving_flux: float

    @property
    def conductance(self) -> float:
        """Net flux through the interface from inside over the fluence there: (1 - R_phi) / (2 (1 + R_j))."""
        return 0.5 * (1.0 - self.reflected) / (1.0 + self.reflected_flux)

    @property
    def exit_share(self) -> float:
        """Flux outside as a fraction of the fluence inside: the conductance, as the interface loses no light."""
        return 0.25 * self.leaving + 0.5 * self.conductance * self.leaving_flux


@lru_cache(maxsize=256)
def diffuse_interface(ior: float, roughness: float = 0.0) -> DiffuseInterface:
    """Fractions of diffuse light at an interface.

    Parameters
    ----------
    ior : float
        Index inside relative to outside; below 1, light from outside is reflected totally at a slant, and roughness has
        no effect.
    roughness : float
        Square root of the GGX alpha, 0 to 1.
    """
    cosine, weight = interface_nodes(ior)
    outside, outside_weight = _gauss() if ior >= 1.0 else interface_nodes(1.0 / ior)
    entered = 1.0 - optics.fresnel_dielectric(outside, ior)
    flux = 2.0 * outside * outside_weight * entered
    mean_cosine = float((flux * optics.refracted_cosine(outside, ior)).sum() / flux.sum())
    if roughness > 0.0 and ior > 1.0:
        entering = 1.0 - _rough_fractions(ior, roughness, 2)[0]
        # In equilibrium as much leaves as enters. Light that leaves has the directions of a single microfacet.
        leaving = entering / ior**2
        single, single_flux = (_rough_fractions(1.0 / ior, roughness, power)[1] for power in (2, 3))
        leaving_flux = single_flux * leaving / single
        return DiffuseInterface(entering, mean_cosine, 1.0 - leaving, 1.0 - leaving_flux, leaving, leaving_flux)
    inside = _inside_reflectance(cosine, ior)
    reflected = float((2.0 * cosine * inside * weight).sum())
    reflected_flux = float((3.0 * cosine**2 * inside * weight).sum())
    return DiffuseInterface(
        float(flux.sum()), mean_cosine, reflected, reflected_flux, 1.0 - reflected, 1.0 - reflected_flux
    )


@lru_cache(maxsize=256)
def exit_quadrature(ior: float) -> tuple[Array, Array]:
    """Cosines (3,) inside, and weights (3,), that make flux outside of radiance below a polished interface times 4 pi.

    The Gaussian quadrature for what the interface lets through: exact for polynomials of up to the fifth degree.
    """
    cosine, weight = interface_nodes(ior)
    passed = 0.5 * cosine * weight * (1.0 - _inside_reflectance(cosine, ior))
    # Three steps of Lanczos for the polynomials that are orthogonal under this weight (Golub & Welsch 1969).
    before, now = np.zeros_like(cosine), np.sqrt(passed / passed.sum())
    diagonal, beside, between = np.zeros(3), np.zeros(3), 0.0
    for i in range(3):
        following = cosine * now - between * before
        diagonal[i] = following @ now
        following = following - diagonal[i] * now
        between = beside[i] = float(np.linalg.norm(following))
        before, now = now, following / between
    nodes, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside[:2], 1) + np.diag(beside[:2], -1))
    return np.asarray(nodes), np.asarray(passed.sum() * vectors[0] ** 2)


@lru_cache(maxsize=1024)
def half_space_reflectance(albedo: float, ior: float = 1.0, phase: PhaseFunction = ISOTROPIC) -> float:
    """Reflectance of a half-space for diffuse light that has entered it; exact.

    Parameters
    ----------
    albedo : float
        Of single scattering, 0 to 1; not the reduced one.
    ior : float
        Index of the half-space relative to what is above; polished.
    phase : PhaseFunction
    """
    cosine, flux, reflectances = _half_space(albedo, ior, phase)
    # Uniform radiance from outside stays uniform inside the cone that it refracts to, but for Fresnel reflection.
    down = flux * (1.0 - _inside_reflectance(cosine, ior))
    return float((down * reflectances).sum() / down.sum())


def half_space_reflectances(
    cosine: npt.ArrayLike, albedo: float, ior: float = 1.0, phase: PhaseFunction = ISOTROPIC
) -> Array:
    """Reflectance of a half-space for light that has entered it in one direction.

    Parameters
    ----------
    cosine : array_like (...)
        Of the direction with the normal, inside, 0 to 1.
    albedo, ior, phase
        See `half_space_reflectance`.
    """
    at, _, reflectances = _half_space(albedo, ior, phase)
    return np.asarray(np.interp(np.asarray(cosine, np.float64), at, reflectances))


@lru_cache(maxsize=1024)
@one_blas_thread()
def _half_space(albedo: float, ior: float, phase: PhaseFunction) -> tuple[Array, Array, Array]:
    """Quadrature over cosines inside the medium: cosines, fluxes, and reflectances of the interface.

    The bare half-space reflects as Chandrasekhar's H functions say where it scatters to all sides alike, else as its
    modes do (`bare_half_space`); its interface mirrors part of that back, and the half-space reflects it again: one
    linear system on a quadrature.
    """
    if phase == ISOTROPIC:
        cosine, weight = interface_nodes(ior)
        h = _chandrasekhar_h(albedo, cosine, weight)
        bare = 0.5 * albedo * np.outer(h, h * cosine * weight) / (cosine[:, None] + cosine)
    else:
        cosine, weight = interface_nodes(ior, MODE_NODES)
        bare = bare_half_space(albedo, phase, cosine, weight, 2 * MODE_NODES)
    mirrored, flux = _inside_reflectance(cosine, ior), cosine * weight
    # The transposed system: what leaves for each radiance that goes up for the first time.
    leaving = np.linalg.solve((np.eye(len(cosine)) - bare * mirrored).T, flux * (1.0 - mirrored))
    return cosine, flux, (leaving @ bare) / flux


def _chandrasekhar_h(albedo: float, cosine: Array, weight: Array) -> Array:
    """H at the nodes: 1 / H = sqrt(1 - w) + w / 2 int mu' H(mu') / (mu + mu') (Chandrasekhar 1960, V 22).

    Whole steps swing about the solution, without end where nothing is absorbed; half ones do not.
    """
    h = np.ones_like(cosine)
    kernel = 0.5 * albedo * cosine * weight / (cosine[:, None] + cosine)
    for _ in range(H_STEPS):
        # Halfway by ratio: the equation alone turns what is too large by a factor into what is too small by it, which
        # would go on for ever where nothing is absorbed. So errors are at least halved.
        better = np.sqrt(h / (np.sqrt(1.0 - albedo) + kernel @ h))
        done = np.abs(better - h).max() < H_TOLERANCE
        h = better
        if done:
            break
    return h


def _inside_reflectance(cosine: Array, ior: float) -> Array:
    """Fresnel's reflectance of light from inside, at the nodes of `interface_nodes`."""
    return optics.fresnel_dielectric(cosine, 1.0 / ior) if ior != 1.0 else np.zeros_like(cosine)


@lru_cache(maxsize=8)
def _gauss(number: int = NODES) -> tuple[Array, Array]:
    """Nodes and weights on 0 to 1."""
    x, weight = np.polynomial.legendre.leggauss(number)
    return 0.5 * (x + 1.0), 0.5 * weight


def interface_nodes(ior: float, number: int = NODES) -> tuple[Array, Array]:
    """Nodes and weights for cosines inside, apart on both sides of the critical one."""
    x, weight = _gauss(number)
    if ior <= 1.0:
        return x, weight
    critical = float(np.sqrt((1.0 - 1.0 / ior) * (1.0 + 1.0 / ior)))
    return (
        np.concatenate([critical * x, critical + (1.0 - critical) * x]),
        np.concatenate([critical * weight, (1.0 - critical) * weight]),
    )


def _rough_fractions(ior: float, roughness: float, power: int) -> tuple[float, float]:
    """Reflected and transmitted fraction of light whose density over cosines is `power` mu^(power - 1)."""
    number = np.arange(FACETS)
    first, *samples = ((0.5 + number[:, None] * [0.8191725133961645, 0.6710436067037893, 0.5497004779019703]) % 1.0).T
    cosine, alpha = first ** (1.0 / power), roughness * roughness
    towards = np.stack([np.sqrt(1.0 - cosine**2), np.zeros_like(cosine), cosine], axis=1)
    facet = interface.ggx_visible_normal(towards, alpha, np.stack(samples, axis=1))
    on_facet = np.clip((towards * facet).sum(axis=1), 0.0, 1.0)
    reflectance = optics.fresnel_dielectric(on_facet, ior)
    back = 2.0 * on_facet * facet[:, 2] - cosine
    on = interface.refracted_direction(-towards, facet, np.full(FACETS, ior))[:, 2]

    def unmasked(cosine_out: Array) -> Array:
        into = interface.smith_lambda(cosine, alpha)
        out = interface.smith_lambda(np.maximum(cosine_out, 1e-6), alpha)
        return np.where(cosine_out > 0.0, (1.0 + into) / (1.0 + into + out), 0.0)

    return float((reflectance * unmasked(back)).mean()), float(((1.0 - reflectance) * unmasked(-on)).mean())


def diffusion_coefficient(absorption: npt.ArrayLike, reduced_scattering: npt.ArrayLike) -> Array:
    """D = (2 sigma_a + sigma_s') / (3 (sigma_a + sigma_s')^2) in m (Grosjean 1956).

    1 / (3 sigma_t') where little is absorbed; where much is, the light of a far source decays nearly as it does in the
    exact solution.
    """
    a, s = np.asarray(absorption, np.float64), np.asarray(reduced_scattering, np.float64)
    # Divided twice, so that no square overflows.
    return np.asarray((1.0 + a / (a + s)) / (3.0 * (a + s)))
