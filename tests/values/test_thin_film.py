"""Thin films against sums over spectra, in their limits, and as parts of walls."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from translucent.formulas import interface, optics, thin_film

Array = npt.NDArray[np.float64]

COSINES = np.linspace(0.05, 1.0, 20)
WAVELENGTHS = np.arange(360.0, 831.0, 2.0)  # nm
XYZ_TO_RGB = np.array([[3.2405, -1.5371, -0.4985], [-0.9693, 1.8760, 0.0416], [0.0556, -0.2040, 1.0572]])
WHITE = np.array([0.9505, 1.0, 1.0890])

iors = st.floats(1.0, 2.5)
cosines = st.floats(0.01, 1.0)
thicknesses = st.floats(0.0, 2e-6)


def lobe(peak: float, middle: float, below: float, above: float) -> Array:
    steep = np.where(middle > WAVELENGTHS, below, above)
    return peak * np.exp(-0.5 * ((WAVELENGTHS - middle) * steep) ** 2)


#: CIE 1931 as Wyman, Sloan and Shirley 2013 fit it, in other curves than those of the film: good to 1 % of its peaks.
OBSERVER = np.stack(
    [
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
)


def airy(cosine: Array, ior: float, film: float, metres: float) -> Array:
    """Reflectance (..., 3) in light of equal energy: Airy's sum of complex amplitudes at each wavelength."""
    inside, beyond = (np.sqrt(1.0 - (1.0 - cosine**2) / n**2)[:, None] for n in (film, ior))
    outside, turn = cosine[:, None], np.exp(4j * np.pi * film * metres * inside / (WAVELENGTHS * 1e-9))
    total = np.zeros(turn.shape)
    for a, b, c in ((outside, film * inside, ior * beyond), (film * outside, inside, film / ior * beyond)):
        near, far = (a - b) / (a + b), (b - c) / (b + c)
        total += 0.5 * np.abs((near + far * turn) / (1.0 + near * far * turn)) ** 2
    seen = (total[:, None, :] * OBSERVER).sum(axis=-1) / OBSERVER.sum(axis=-1)
    return np.asarray(np.clip((seen * WHITE) @ XYZ_TO_RGB.T, 0.0, 1.0))


@pytest.mark.parametrize("metres", [20e-9, 100e-9, 300e-9, 500e-9, 800e-9, 1.2e-6])
@pytest.mark.parametrize(
    ("ior", "film", "allowed"),
    # Of films in air each side mirrors alike, all orders count, and most of the error is where light grazes them.
    [
        (1.0, 1.33, 0.02),
        (1.0, 1.5, 0.025),
        (1.5, 1.3, 0.004),
        (1.5, 2.0, 0.007),
        (1.33, 1.8, 0.007),
        (2.5, 1.38, 0.007),
    ],
)
def test_a_film_has_the_color_of_the_sum_over_the_spectrum(
    ior: float, film: float, allowed: float, metres: float
) -> None:
    truth = airy(COSINES, ior, film, metres)
    found = thin_film.thin_film_reflectance(COSINES, ior, film, film * metres)
    assert np.sqrt(np.mean((found - truth) ** 2)) < allowed


@given(cosines, iors, iors, thicknesses)
def test_a_film_of_an_index_beside_it_or_without_thickness_is_not_seen(
    cosine: float, ior: float, film: float, metres: float
) -> None:
    bare = float(optics.fresnel_dielectric(cosine, ior))
    for index, thick in ((ior, metres), (1.0, metres), (film, 0.0)):
        found = thin_film.thin_film_reflectance(cosine, ior, index, index * thick)
        assert found == pytest.approx(bare, abs=1e-12)


@given(cosines, iors, iors, thicknesses)
def test_a_film_passes_as_much_from_either_side(cosine: float, ior: float, film: float, metres: float) -> None:
    from_outside = thin_film.thin_film_reflectance(cosine, ior, film, film * metres)
    inside = float(optics.refracted_cosine(cosine, ior))
    from_inside = thin_film.thin_film_reflectance(inside, 1.0 / ior, film / ior, film * metres)
    assert ((from_outside >= 0.0) & (from_outside <= 1.0)).all()
    assert from_inside == pytest.approx(from_outside, abs=1e-9)


def test_beyond_the_critical_angle_all_is_reflected() -> None:
    assert (thin_film.thin_film_reflectance(0.7, 1 / 1.5, 2.0 / 1.5, 8e-7) == 1.0).all()
    assert (thin_film.thin_film_reflectance(0.0, 1.5, 2.0, 8e-7) == 1.0).all()


def test_a_thick_film_is_gray() -> None:
    """Its orders are out of step: both its sides reflect as powers, as those of a thin wall do."""
    for cosine in (1.0, 0.5):
        near = float(optics.fresnel_dielectric(cosine, 1.5))
        (red, green, blue) = thin_film.thin_film_reflectance(cosine, 1.0, 1.5, 1e-4)
        assert red == pytest.approx(green, abs=1e-9)
        assert blue == pytest.approx(green, abs=1e-9)
        if cosine == 1.0:  # else the two polarizations are apart
            assert green == pytest.approx(float(interface.slab_reflectance(near, 0.0)), rel=1e-6)


@given(st.floats(0, 1), st.floats(0, 50))
def test_a_wall_of_equal_sides_is_a_thin_wall(share: float, depth: float) -> None:
    three = np.full(3, depth)
    back = thin_film.film_slab_reflectance(np.full(3, share), share, three)
    on = thin_film.film_slab_transmittance(np.full(3, share), share, three)
    assert back == pytest.approx(interface.slab_reflectance(share, three), abs=1e-12)
    assert on == pytest.approx(interface.slab_transmittance(share, three), abs=1e-12)


@given(st.sampled_from([0.0, 0.04, 0.5, 1.0]), st.sampled_from([0.0, 0.04, 0.9]), st.floats(0, 5))
def test_a_wall_adds_up_all_reflections_between_its_sides(front: float, back: float, depth: float) -> None:
    passage, way, mirrored, through = np.exp(-depth), 1.0 - front, front, 0.0
    while way > 1e-13:
        way *= passage
        through += way * (1.0 - back)
        mirrored += way * back * passage * (1.0 - front)
        way *= back * passage * front
    three = np.full(3, depth)
    assert thin_film.film_slab_reflectance(np.full(3, front), back, three) == pytest.approx(mirrored, abs=1e-9)
    assert thin_film.film_slab_transmittance(np.full(3, front), back, three) == pytest.approx(through, abs=1e-9)
