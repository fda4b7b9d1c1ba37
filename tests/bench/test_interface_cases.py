"""Ways of finding interfaces, measured against all the light that there is. No time is judged here."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import translucent as tl
from tests.bench.measuring import case_of, measured, named
from translucent.bench import methods
from translucent.bench import truth as truths
from translucent.bench.cases import CASES
from translucent.bench.contenders import contenders
from translucent.bench.drawing import BenchContext
from translucent.bench.judgement import advise
from translucent.bench.truth import CaseTruth
from translucent.geometry.solids import Sphere
from translucent.gpu.passes import traced_interfaces


@pytest.fixture
def along_centers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures and truths along the rays of pixels' centers: errors are what a way of finding interfaces leaves out."""
    monkeypatch.setattr(traced_interfaces, "FOOTPRINT_STEP", 0.0)
    monkeypatch.setattr(CaseTruth, "over_pixels", CaseTruth.of)
    monkeypatch.setattr(methods, "SAMPLES", 1)


@pytest.mark.usefixtures("along_centers")
def test_a_deeper_tree_is_nearer_to_all_light_and_what_is_drawn_is_not(bench: BenchContext) -> None:
    names = ("constant-thickness", "straight rays", "FrontInterface", "ScreenInterfaces", "TracedInterfaces")
    made = measured(bench, named("glass"), *names, size=(64, 64))
    rows = {row.method: row for row in made.rows}
    constant, straight, front, screen = (
        rows[name]
        for name in ("constant thickness, one interface", "straight rays", "FrontInterface", "ScreenInterfaces")
    )
    traced = [row for row in made.rows if row.family == "TracedInterfaces"]
    assert not [row.failure or row.refusal for row in made.rows if row.failure or row.refusal]
    errors = [row.radiance.rms for row in traced]  # type: ignore[union-attr]
    # Depth 24 with two forks has fewer than the row before it, depth 16 with three.
    deeper = [*errors[:-2], errors[-1]]
    assert (np.array(deeper[1:]) < 1.05 * np.array(deeper[:-1])).all()
    assert errors[-1] < 0.02 < 0.2 < screen.radiance.rms < front.radiance.rms  # type: ignore[union-attr]
    assert front.radiance.rms < straight.radiance.rms  # type: ignore[union-attr]
    assert constant.radiance.rms < 0.7 * straight.radiance.rms, "it mirrors and bends"  # type: ignore[union-attr]
    # In viewers of glTF absorption is wrong beside the missing interface.
    assert constant.radiance.median > front.radiance.median  # type: ignore[union-attr]
    assert constant.parameters.endswith(" m, of least squared error, FrontInterface()")
    assert traced[-1].parameters == "SignedDepth(anchored=True), TracedInterfaces(depth=24, forks=2)"
    assert straight.parameters == "SignedDepth(anchored=True)"
    assert straight.promise == "none: interfaces are left out"
    assert [row.passes for row in (traced[0], screen, front, straight)] == [2, 3, 2, 1]
    assert not any(row.exact for row in rows.values())
    # Pixels are what tracing is about: the whole frame is its time.
    assert all(row.wall == row.frame and row.ratio == row.frame_ratio for row in made.rows if row.kind == "method")
    advice = advise(made)
    assert advice is not None
    assert advice.row.family == "TracedInterfaces"
    assert advice.constant is constant


@pytest.mark.usefixtures("along_centers")
def test_a_thin_wall_mirrors_and_does_not_bend(bench: BenchContext) -> None:
    made = measured(bench, named("thin wall"), "ScreenInterfaces", "FrontInterface", "straight rays", size=(192, 192))
    rows = {row.method: row for row in made.rows}
    assert rows["FrontInterface"].refusal == "sheets have one interface, at which nothing bends"
    wall, none = rows["ScreenInterfaces"].radiance, rows["straight rays"].radiance
    assert wall is not None
    assert none is not None
    # Both faces mirror in closed form; what is left is where the sheet hides itself.
    assert wall.median < 1e-3
    assert none.median > 30 * wall.median


def test_what_the_planner_picks_for_interfaces_is_measured() -> None:
    measured = {one.choices.get("interfaces") for one in contenders("interfaces", quick=True)}
    for case in CASES:
        if case.effect == "interfaces":
            assert tl.plan(case.scene((8, 8))).interfaces in measured


def test_media_within_each_other_have_a_method_that_finds_their_order(bench: BenchContext) -> None:
    made = measured(bench, named("filled goblet"), "traced-interfaces-depth-12-2-forks", size=(32, 32))
    row = made.rows[1]
    assert row.parameters == "FragmentLists(light_points=8), TracedInterfaces(depth=12, forks=2)"
    assert row.radiance is not None


def test_pictures_are_held_against_the_mean_over_pixels_with_one_sample_and_with_many(bench: BenchContext) -> None:
    made = measured(bench, named("glass"), "traced-interfaces-depth-12-2-forks", "constant-thickness", size=(48, 48))
    _, constant, row = made.rows
    assert made.truth_rays == 2 * truths.RAYS
    assert 0.0 < made.truth_spread < 0.1
    assert row.radiance is not None
    assert row.sampled is not None
    assert row.sampled.rms < 0.7 * row.radiance.rms, "sixteen samples are nearer to what a camera takes"
    assert constant.sampled is None


def test_the_reference_follows_rays_until_they_come_out() -> None:
    """In a knot light goes around for a hundred reflections: twelve leave most of some pixels open."""
    frame = CaseTruth.of(named("glass knot").scene((16, 16)), (16, 16), 1e-3).frame
    assert float(frame.provenance["residual"]) < 0.01


def test_noise_of_the_reference_is_no_error(rng: np.random.Generator) -> None:
    truth = CaseTruth.of(case_of(Sphere().tessellate(24)).scene((96, 96)), (96, 96), 1e-3)
    right = truth.frame.radiance
    one, other = (right + 0.3 * rng.normal(size=right.shape) for _ in range(2))
    mean = dataclasses.replace(truth.frame, radiance=0.5 * (one + other))
    noisy = dataclasses.replace(truth, frame=mean, halves=(one, other))
    shown = dataclasses.replace(truth.frame, radiance=right + 0.1)
    found = noisy.errors(shown, "radiance")
    assert found is not None
    assert found[0].rms * noisy.scale("radiance") == pytest.approx(0.1, rel=0.1)
    # What noise hides is no zero: with halves of 0.3, the square's standard error over pixels is reported at least.
    unseen = dataclasses.replace(noisy, rays=8).errors(truth.frame, "radiance")
    least = np.sqrt(0.3**2 / np.sqrt(3 * truth.compared.sum()))
    assert unseen is not None
    assert 0.9 * least < unseen[0].rms * noisy.scale("radiance") < 2.0 * least


def test_frosted_glass_has_two_references(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(truths, "PATHS", 2)
    truth = CaseTruth.over_pixels(named("frosted").scene((8, 8)), (8, 8), 1e-3)
    assert truth.halves is not None
    assert truth.rays == 4
    one, other = truth.halves
    assert (one != other).any()
    np.testing.assert_allclose(truth.frame.radiance, 0.5 * (one + other))
