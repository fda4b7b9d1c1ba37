"""The table of what rough interfaces reflect, against sampling with another distribution and against its limits."""

from __future__ import annotations

import numpy as np
import pytest

from tools import brdf_quadrature
from tools.brdf_quadrature import albedo
from translucent.formulas.bsdf import brdf_table as table


def sampled(n_v: float, roughness: float, count: int = 200_000) -> tuple[np.ndarray, np.ndarray]:
    """Scale and bias with their standard errors, from half vectors of density D n.h: not the visible ones."""
    rng = np.random.default_rng(int(1000 * n_v + 10 * roughness))
    alpha = roughness**2
    u, turn = rng.random((2, count))
    n_h = np.sqrt((1 - u) / (1 + (alpha * alpha - 1) * u))
    v_h = np.sqrt(1 - n_v * n_v) * np.sqrt(1 - n_h * n_h) * np.cos(2 * np.pi * turn) + n_v * n_h
    n_l = 2 * v_h * n_h - n_v
    met = (n_l > 0) & (v_h > 0)
    lit = np.where(met, n_l, 1.0)

    def smith(cosine: np.ndarray | float) -> np.ndarray:
        return np.asarray(0.5 * (np.sqrt(1 + alpha**2 * (1 / np.square(cosine) - 1)) - 1))

    weight = np.where(met, v_h / (n_h * n_v) / (1 + smith(n_v) + smith(lit)), 0.0)
    fresnel = (1 - np.clip(v_h, 0, 1)) ** 5
    parts = np.stack([weight * (1 - fresnel), weight * fresnel], axis=-1)
    return parts.mean(axis=0), parts.std(axis=0) / np.sqrt(count)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("n_v", [0.1, 0.4, 0.7, 1.0])
def test_quadrature_agrees_with_sampling(n_v: float, roughness: float) -> None:
    with np.errstate(under="ignore"):
        mean, error = sampled(n_v, roughness)
        found = albedo(n_v, roughness)
    assert (np.abs(found - mean) <= 5 * error + 1e-4).all()


def test_the_quadrature_has_converged(monkeypatch: pytest.MonkeyPatch) -> None:
    cosine, roughness = np.meshgrid([0.0, 0.05, 0.2, 0.5, 0.9, 1.0], [1 / 63, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0])
    found = albedo(cosine, roughness)
    monkeypatch.setattr(brdf_quadrature, "POINTS", (120, 96))
    np.testing.assert_allclose(found, albedo(cosine, roughness), atol=1e-4)


def test_a_mirror_reflects_by_schlick_alone() -> None:
    cosine = np.linspace(0.01, 1, 34)
    exact = np.stack([1 - (1 - cosine) ** 5, (1 - cosine) ** 5], axis=-1)
    np.testing.assert_allclose(albedo(cosine, 0.0), exact, atol=1e-9)


def test_nothing_is_gained_and_rough_surfaces_lose_what_is_reflected_twice() -> None:
    found = table()
    assert found.shape == (64, 64, 2)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    total = found.sum(axis=-1)
    assert total.max() <= 1 + 1e-6
    # Smooth surfaces lose nothing. With alpha = 1, seen from above, what is left is the integral of c / (1 + c).
    np.testing.assert_allclose(total[0], 1.0, atol=1e-6)
    assert total[-1, -1] == pytest.approx(1 - np.log(2), abs=1e-5)
    assert (np.diff(total[:, -1]) <= 1e-6).all()


def test_the_table_has_both_ends_and_is_made_once() -> None:
    found = table()
    assert table() is found
    np.testing.assert_allclose(found[0, -1], (1, 0), atol=1e-7)
    np.testing.assert_allclose(found[63, 31], albedo(31 / 63, 1.0), rtol=1e-6)
    np.testing.assert_allclose(found[16, 40], albedo(40 / 63, 16 / 63), rtol=1e-6)
