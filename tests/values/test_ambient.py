"""Ambient radiance of a scene: who scatters it, and what the planner says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box
from translucent.planning.plan import plan

CUBE = Box().tessellate()
CAMERA = tl.Camera.look_at((1, 2, 4), (0, 0, 0))
ONCE = tl.SingleScattering()
MILK = tl.Medium(absorption=1.0, scattering=(1, 2, 3), emission=(0.5, 0, 0))


def scene(*media: tl.Medium | None, ambient: Any = (0.5, 1, 0), **options: Any) -> tl.Scene:
    return tl.Scene([tl.Object(CUBE, medium) for medium in media], CAMERA, ambient=ambient, **options)


def test_it_is_none_unless_asked_for() -> None:
    plain = tl.Scene([tl.Object(CUBE, MILK)], CAMERA)
    np.testing.assert_array_equal(plain.ambient, 0.0)
    assert not plain.scatters_ambient
    assert plan(plain, scattering=ONCE).scene.objects == plain.objects


@pytest.mark.parametrize("medium", [tl.Medium(absorption=1.0), tl.Medium(scattering=(0, 0, 1)), None])
def test_without_a_medium_that_scatters_it_nothing_changes(medium: tl.Medium | None) -> None:
    lit = scene(tl.Medium(absorption=2.0), medium)
    assert not lit.scatters_ambient
    assert plan(lit, scattering=ONCE).scene.objects == lit.objects
    assert plan(lit) == plan(scene(tl.Medium(absorption=2.0), medium, ambient=0.0))


def test_media_emit_what_they_scatter() -> None:
    lit = scene(MILK, None)
    np.testing.assert_array_equal(lit.source(lit.objects[0]), (1.0, 2.0, 0.0))
    np.testing.assert_array_equal(lit.source(lit.objects[1]), 0.0)
    rendered = plan(lit).scene
    assert not rendered.scatters_ambient
    assert rendered.objects[0].mesh is CUBE
    assert rendered.objects[0].medium == tl.Medium(MILK.absorption, MILK.scattering, (1.0, 2.0, 0.0))
    assert rendered.objects[1] is lit.objects[1]


def test_the_planner_adds_it_and_says_so() -> None:
    found = plan(scene(MILK))
    assert found.method == tl.SignedDepth()
    assert found.exact
    assert "closed form, q / sigma_t (1 - T); media emit the ambient radiance A" in found.passes[-1].reason
    assert found.unmodelled == ("ambient light reaches every point of the media without shadows or attenuation",)
    several = plan(scene(MILK, tl.Medium(absorption=1.0)))
    assert several.ordered
    assert "emission among several media" in several.passes[0].reason


def test_colors_and_what_is_none() -> None:
    np.testing.assert_allclose(scene(MILK, ambient="#ffffff").ambient, 1.0)
    np.testing.assert_allclose(scene(MILK, ambient=0.5).ambient, 0.5)
    for wrong in ((-1, 0, 0), (np.nan, 0, 0), (1, 2), "no color"):
        with pytest.raises(tl.InputError, match=r"ambient radiance|no color"):
            scene(MILK, ambient=wrong)
    with pytest.raises(tl.InputError, match="ambient radiance in 'box'; the medium would scatter more than 1e"):
        scene(tl.Medium(scattering=1e10), ambient=1e10)


def test_paths_find_it_by_themselves() -> None:
    with pytest.raises(tl.InputError, match=r"path tracing with ambient radiance; .*; omit the ambient radiance"):
        tl.reference.path_trace(scene(MILK), (4, 4), paths=2)
