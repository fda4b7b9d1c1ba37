"""The size of the model in the window: everything that states metres follows, and undo restores it."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.preview.actions import ChoosePreset, OrbitBy
from translucent.preview.document import Model
from translucent.preview.measuring import measure
from translucent.preview.panels.viewport import reference_outline, ruler
from translucent.preview.scenes import load, material_of, rescaled
from translucent.preview.workspace import Workspace


def test_all_that_states_metres_follows_the_height(work: Workspace) -> None:
    work.do(ChoosePreset("wax"))
    work.update()
    before, scene = work.document, work.scene()
    assert scene is not None
    work.measured = measure(scene, None, (32, 24))
    thickest = work.measured.seen.thickness.max()
    work.resize(0.4)  # of a ball of 4 cm, to 2e-7
    assert work.loaded is not None
    assert work.loaded.model == work.document.model != before.model  # at once, without another look at the file
    larger = work.scene()
    assert larger is not None
    np.testing.assert_allclose(larger.shown_bounds, 10 * scene.shown_bounds, rtol=1e-6)
    assert larger.objects[0].mesh is scene.objects[0].mesh
    np.testing.assert_allclose(larger.camera.eye, 10 * scene.camera.eye, rtol=1e-6)
    assert work.measured is not None
    assert work.measured.seen.thickness.max() == pytest.approx(10 * thickest)
    assert work.document.material.thickness == pytest.approx(10 * before.material.thickness)
    # A medium has lengths of its own, whatever the size of what it fills.
    assert work.document.material.absorption == before.material.absorption
    work.do(OrbitBy(30.0, 0.0))
    orbit = work.document.orbit
    assert orbit is not None
    work.undo()
    assert (work.document.model, work.document.material) == (before.model, before.material)
    smaller = work.document.orbit
    assert smaller is not None
    assert smaller.yaw == orbit.yaw  # the view stays as it was turned
    assert smaller.distance == pytest.approx(orbit.distance / 10)


def test_a_size_that_is_none_is_refused(work: Workspace) -> None:
    before = work.document
    work.resize(0.0)
    assert work.document == before
    assert "height 0.0; the length must be positive and finite" in work.messages[-1].text


def test_a_rescaled_model_is_the_one_that_is_read_with_that_unit() -> None:
    model = Model("bear", "25m")
    read, scaled = load(model), rescaled(load(Model("bear")), model)
    np.testing.assert_allclose(scaled.scene.shown_bounds, read.scene.shown_bounds, rtol=1e-12)
    own, other = material_of(read.scene), material_of(scaled.scene)
    np.testing.assert_allclose(other.absorption, own.absorption, rtol=1e-9)
    assert other.distance == pytest.approx(own.distance)


def test_the_ruler_has_round_steps_and_stands_beside_a_thing_of_known_size() -> None:
    assert ruler(0.08) == (pytest.approx(0.01), 8)
    assert ruler(1.7) == (pytest.approx(0.2), 8)
    name, coin = reference_outline(0.08)
    assert (name, np.ptp(coin[:, 0])) == ("coin, 24 mm", pytest.approx(0.024))
    name, hand = reference_outline(0.5)
    assert (name, np.ptp(hand[:, 2])) == ("hand, 18 cm", pytest.approx(0.18))
