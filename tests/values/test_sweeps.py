"""Sweeps through a grid: beams that are known, uniform light, and turned grids."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.diffusion.entering import even_directions, nearest_parts
from translucent.diffusion.volume import ORDER, capped, condensed, moment_functions, swept
from translucent.formulas.phase import HenyeyGreenstein, PhaseFunction, WaterDroplets

STEP = 0.25
SHAPE = (6, 5, 7)
#: Of float32, added up over the cells and directions of a sweep.
ROUNDING = 1e-5


def one_beam(direction: tuple[float, float, float], extinction: np.ndarray) -> np.ndarray:
    way = np.array([direction]) / np.linalg.norm(direction)
    return swept(extinction, np.zeros_like(extinction), np.ones((1, 3)), way, np.ones(1), STEP)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_beam_along_an_axis_loses_what_it_passes(axis: int, sign: float) -> None:
    """On the mean over each cell."""
    extinction = np.random.default_rng(1).uniform(0.0, 4.0, (*SHAPE, 3))
    direction = [0.0, 0.0, 0.0]
    direction[axis] = sign
    along = np.moveaxis(extinction, axis, 0)[:: -int(sign)]
    before = STEP * (np.cumsum(along, axis=0) - along)
    mean = np.exp(-before) * -np.expm1(-STEP * along) / (STEP * along)
    expected = np.moveaxis(mean[:: -int(sign)], 0, axis)
    found = one_beam((direction[0], direction[1], direction[2]), extinction)
    np.testing.assert_allclose(found, expected, rtol=ROUNDING)


def test_a_beam_aslant_loses_more() -> None:
    """In uniform matter, away from where it has come in at the sides."""
    extinction = np.full((9, 9, 9, 3), 2.0)
    found = one_beam((0.2, 0.1, 1.0), extinction)
    slant = np.linalg.norm((0.2, 0.1, 1.0))
    depth = STEP * np.arange(9)[::-1] * slant * 2.0
    mean = -np.expm1(-STEP * slant * 2.0) / (STEP * slant * 2.0)
    np.testing.assert_allclose(found[0, 0, :, 0], np.exp(-depth) * mean, rtol=ROUNDING)


def test_what_sends_out_as_much_as_it_takes_is_invisible() -> None:
    """In uniform light, whatever there is, in every direction."""
    extinction = np.random.default_rng(2).uniform(0.0, 30.0, (*SHAPE, 3))
    extinction[2:4] = 0.0
    directions = even_directions(48)
    weights = nearest_parts(directions)[1]
    found = swept(extinction, extinction, np.ones((48, 3)), directions, weights, STEP)
    # Between cells, light and matter are interpolated each by themselves.
    np.testing.assert_allclose(found, 4.0 * np.pi, rtol=ROUNDING)


def test_a_turned_grid_has_turned_light() -> None:
    rng = np.random.default_rng(3)
    extinction, emission = rng.uniform(0.0, 3.0, (2, *SHAPE, 3))
    directions = even_directions(32)
    arriving, weights = rng.uniform(0.0, 1.0, (32, 3)), np.ones(32)
    plain = swept(extinction, emission, arriving, directions, weights, STEP)
    order, signs = [2, 0, 1], np.array([1.0, -1.0, -1.0])
    turned = directions[:, order] * signs
    grids = [np.flip(values.transpose(*order, 3), (1, 2)) for values in (extinction, emission, plain)]
    found = swept(grids[0], grids[1], arriving, turned, weights, STEP)
    np.testing.assert_allclose(found, grids[2], rtol=ROUNDING)


@np.errstate(under="ignore")
def test_all_that_is_sent_out_is_taken_somewhere() -> None:
    """Within matter that lets nothing out of the grid, however uneven it is inside."""
    rng = np.random.default_rng(4)
    extinction = np.full((9, 9, 9, 3), 200.0)
    extinction[2:7, 2:7, 2:7] = rng.uniform(0.0, 3.0, (5, 5, 5, 3))
    emission = np.zeros_like(extinction)
    emission[3:6, 3:6, 3:6] = rng.uniform(0.0, 1.0, (3, 3, 3, 3))
    directions = even_directions(48)
    weights = nearest_parts(directions)[1]
    found = swept(extinction, emission, np.zeros((48, 3)), directions, weights, STEP)
    sent = 4.0 * np.pi * emission.sum(axis=(0, 1, 2))
    np.testing.assert_allclose((extinction * found).sum(axis=(0, 1, 2)), sent, rtol=1e-4)


@pytest.mark.parametrize("depth", [0.3, 1.0])
@np.errstate(under="ignore")
def test_light_gets_as_far_as_it_does(depth: float) -> None:
    """From event to event, the mean square of a way is 2 / sigma^2; where events are closer, that much less."""
    directions = even_directions(48)
    weights = nearest_parts(directions)[1]
    middle = 15 if depth > 0.5 else 30
    sigma = np.full((1, 1, 1, 3), depth / STEP)
    events = float(condensed(sigma, directions, STEP)[0, 0, 0, 0])
    extinction = np.full((2 * middle + 1,) * 3 + (3,), events)
    emission = np.zeros_like(extinction)
    emission[middle, middle, middle] = 1.0
    found = swept(extinction, emission, np.zeros((48, 3)), directions, weights, STEP)[..., 0]
    place = STEP * (np.arange(2 * middle + 1) - middle)
    square = sum(axis**2 for axis in np.meshgrid(place, place, place))
    assert (found * square).sum() / found.sum() == pytest.approx(2.0 / (events * depth / STEP), rel=0.02)
    assert condensed(np.zeros(3), directions, STEP).max() == 0.0


def test_moment_functions_add_up_to_legendre_polynomials() -> None:
    """Legendre polynomials of the cosine between two directions, one per order."""
    one, other = even_directions(48), even_directions(30)
    products = moment_functions(one)[:, :, None] * moment_functions(other)[:, None, :]
    cosine = one @ other.T
    for order in range(3):
        expected = np.polynomial.legendre.Legendre.basis(order)(cosine)
        np.testing.assert_allclose(products[order == ORDER].sum(axis=0), expected, atol=1e-12)


@pytest.mark.parametrize("phase", [HenyeyGreenstein(0.85), WaterDroplets(1e-5)])
@pytest.mark.parametrize("fraction", [0.1, 0.5])
def test_a_phase_function_is_cut_off_where_a_fraction_is_left(phase: PhaseFunction, fraction: float) -> None:
    cosine, weight = np.polynomial.legendre.leggauss(300)
    below = np.minimum(phase.value(cosine), capped(phase, fraction))
    assert 2.0 * np.pi * weight @ below == pytest.approx(fraction, rel=1e-3)
