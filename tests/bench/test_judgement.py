"""Conclusions from numbers: the frontier, changes between reports, claims. No clock is read here."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np
import pytest

from translucent.bench.drawing import (
    FEWEST,
    FEWEST_LONG,
    FEWEST_UNSURE,
    MOST,
    MOST_REPEATED,
    Sample,
    interleaved,
    ratio,
    timing,
)
from translucent.bench.hard_light import HARD_CASES
from translucent.bench.judgement import Agreement, agreement, beats, compare_reports, machines_differ, mark_frontier
from translucent.bench.record import (
    CaseRecord,
    Claim,
    ErrorStatistics,
    HardCase,
    MethodRow,
    Ratio,
    Report,
    ScalePoint,
    Series,
    ShadowCase,
    ShadowRow,
    Shadows,
    TimeStatistics,
)
from translucent.bench.run import experiments

from .test_record import PROVENANCE

ALL_HARD = tuple(HardCase(case.name, "", "", "", True) for case in HARD_CASES)


def row(
    method: str, time: float, error: float, noise: float = 0.0, invalid: float = 0.0, kind: str = "method"
) -> MethodRow:
    errors = ErrorStatistics(error, error, error, error, error, 0.0)
    return MethodRow(
        method,
        method,
        "",
        kind,  # type: ignore[arg-type]
        "exact",
        True,
        wall=TimeStatistics(time, time, 0.0, 9),
        ratio=Ratio(time, 0.0, noise),
        thickness=errors,
        invalid=invalid,
    )


def test_only_what_no_other_beats_is_on_the_frontier() -> None:
    rows = [row("fast", 1.0, 1e-1), row("good", 2.0, 1e-4), row("worse", 2.5, 1e-3), row("best", 9.0, 1e-6)]
    found = {one.method: one.pareto for one in mark_frontier(rows, "thickness")}
    assert found == {"fast": True, "good": True, "worse": False, "best": True}


def test_the_floor_and_rows_without_numbers_are_not_on_it() -> None:
    nothing = dataclasses.replace(row("none", 1.0, 1.0), ratio=None)
    lost = dataclasses.replace(row("lost", 0.1, 1.0), thickness=None)
    found = mark_frontier([row("depth only", 0.5, 0.0, kind="floor"), nothing, lost, row("a", 1, 1e-3)], "thickness")
    assert [one.method for one in found if one.pareto] == ["a"]


def test_what_noise_explains_beats_nothing() -> None:
    assert beats(row("a", 1.0, 1e-3), row("b", 1.2, 1e-3), "thickness")
    assert not beats(row("a", 1.0, 1e-3, noise=0.1), row("b", 1.2, 1e-3, noise=0.1), "thickness")
    assert not beats(row("a", 1.0, 1e-3), row("b", 1.04, 1e-3), "thickness")
    assert not beats(row("a", 1.0, 1e-8), row("b", 1.0, 9e-7), "thickness"), "both are rounding"


def test_errors_that_are_both_rounding_are_a_tie() -> None:
    # A hundred roundings, 6e-6, is what hard cases call exact; 1e-7 and 5e-6 are so far apart that digits would decide.
    exact, more = row("exact", 1.0, 1e-7), row("more layers", 1.0, 5e-6)
    assert [one.pareto for one in mark_frontier([exact, more], "thickness")] == [True, True]
    assert beats(more, row("slow", 1.2, 1e-7), "thickness"), "time decides"
    assert beats(exact, row("no rounding", 1.0, 1.2e-5), "thickness")


def test_a_method_that_marks_pixels_beats_none_that_does_not() -> None:
    assert not beats(row("a", 1.0, 1e-5, invalid=0.2), row("b", 2.0, 1e-4), "thickness")
    assert beats(row("b", 1.0, 1e-5), row("a", 2.0, 1e-4, invalid=0.2), "thickness")


def case(*rows: MethodRow, name: str = "knot", **more: object) -> CaseRecord:
    fields = {"closed": True, "absorption_only": True, "size": (64, 64), "compared_size": (32, 32), "layers": 4}
    return CaseRecord(name, name, "", "thickness", rows=mark_frontier(rows, "thickness"), **(fields | more))  # type: ignore[arg-type]


def report(*cases: CaseRecord, hard: tuple[HardCase, ...] = ()) -> Report:
    return Report(PROVENANCE, cases, (), hard)


def test_ratios_agree_within_their_share_whichever_report_is_the_old_one() -> None:
    """1.15 and 1 / 1.15; of what both have at one size, without the floor, in every part that has ratios."""

    def made(*times: float, size: tuple[int, int] = (64, 64)) -> Report:
        rows = [row(name, time, 1e-4) for name, time in zip("abc", times, strict=False)]
        floor = row("depth only", times[0], 0.0, kind="floor")
        points = (ScalePoint(2, ratio=Ratio(times[0], 0.0, 0.0)),)
        scaling = tuple(Series("layers", name, name, "", points) for name in ("a", "depth only"))
        shadow = ShadowRow("a", "method", 512, "", ratio=Ratio(times[0], 0.0, 0.0))
        shadows = Shadows((ShadowCase("bear", "", "", rows=(shadow,)),))
        return dataclasses.replace(report(case(floor, *rows, size=size)), scaling=scaling, shadows=shadows)

    one, other = made(1.0, 2.0, 3.0), made(1.14, 2.0 * 1.16, 3.0 / 1.16)
    for found in (agreement(one, other), agreement(other, one)):
        assert (found.ratios, found.within) == (5, 3)
    assert agreement(one, made(1.0, 9.0)) == Agreement(4, 3, "knot / b, 2.00 and 9.00")
    assert agreement(one, made(2.0, size=(32, 32))) == Agreement(2, 0, "layers 2 / a, 1.00 and 2.00")
    assert "no ratio" in str(agreement(one, report()))


def test_the_same_report_has_not_changed() -> None:
    made = report(case(row("a", 1.0, 1e-4)))
    assert compare_reports(made, made) == ()


@pytest.mark.parametrize(
    ("before", "after", "kinds"),
    [
        ((1.0, 1e-4), (1.3, 1e-4), ["slower"]),
        ((1.0, 1e-4), (1.1, 1e-4), []),  # within what two runs differ by
        ((1.3, 1e-4), (1.0, 1e-4), ["faster"]),
        ((1.0, 1e-4), (1.0, 1e-3), ["less accurate"]),
        ((1.0, 1e-3), (1.0, 1e-4), ["more accurate"]),
        ((1.0, 1e-8), (1.0, 8e-7), []),  # rounding
        ((1.0, 1e-3), (1.5, 1e-4), ["slower", "more accurate"]),
    ],
)
def test_changes_are_told(before: tuple[float, float], after: tuple[float, float], kinds: list[str]) -> None:
    found = compare_reports(report(case(row("a", *before))), report(case(row("a", *after))))
    assert [change.kind for change in found] == kinds


def test_noise_excuses_a_difference() -> None:
    old, new = report(case(row("a", 1.0, 1e-4, noise=0.1))), report(case(row("a", 1.4, 1e-4, noise=0.05)))
    assert compare_reports(old, new) == ()
    assert "1.00 -> 1.40" in str(compare_reports(report(case(row("a", 1.0, 1e-4))), new)[0])


def test_marks_failures_and_hard_cases_are_told() -> None:
    held, broke = HardCase("H07", "far", "exact", "1e-7", True), HardCase("H07", "far", "exact", "off", False)
    old = report(case(row("a", 1, 1e-4), row("b", 1, 1e-4), row("c", 1, 1e-4)), hard=(held,))
    failed = dataclasses.replace(row("b", 1, 1e-4), wall=None, ratio=None, thickness=None, failure="crash")
    refused = dataclasses.replace(failed, method="c", failure=None, refusal="two media")
    new = report(case(row("a", 1, 1e-4, invalid=0.01), failed, refused), hard=(broke,))
    assert [change.kind for change in compare_reports(old, new)] == ["marks more", "fails", "gone", "fails"]
    assert all(change.worse for change in compare_reports(old, new))


def test_other_sizes_are_not_compared() -> None:
    old = report(case(row("a", 1.0, 1e-4)))
    new = report(case(row("a", 5.0, 1e-1), size=(128, 128), compared_size=(64, 64)))
    assert compare_reports(old, new) == ()


def test_errors_against_another_truth_are_not_compared() -> None:
    old, new = (report(case(row("a", 1.0, rms), truth_rays=rays)) for rms, rays in ((1e-4, 1), (1e-2, 8)))
    assert compare_reports(old, new) == ()


def test_another_machine_is_told() -> None:
    one, other = report(), Report(dataclasses.replace(PROVENANCE, renderer="a GPU"))
    assert machines_differ(one, one) is None
    assert "a GPU" in str(machines_differ(one, other))


def claims(*cases: CaseRecord, hard: tuple[HardCase, ...] = ()) -> list[bool | None]:
    return [claim.held for claim in checked(*cases, hard=hard)]


def checked(*cases: CaseRecord, hard: tuple[HardCase, ...] = ()) -> tuple[Claim, ...]:
    made = report(*cases, hard=hard)
    return tuple(judge(made) for experiment in experiments(False) for judge in experiment.claims)


def test_claims_hold_where_the_numbers_do() -> None:
    good = (
        row("SignedDepth", 1.1, 1e-7),
        row("constant thickness", 1.3, 1e-2, kind="counter-example"),
        row("BackFaceDepth, unmarked", 1.6, 1e-3, kind="counter-example"),
        row("SignedDepth from the camera", 1.1, 1e-4, kind="counter-example"),
        row("SignedDepth in float16", 1.1, 1e-4, kind="counter-example"),
    )
    assert claims(case(*good), case(*good, name="far slab"), hard=ALL_HARD) == [*[True] * 6, *[None] * 15, True]
    assert claims() == [None] * 22
    counts = {len([judge for one in experiments(quick) for judge in one.claims]) for quick in (False, True)}
    assert counts == {22}, "a quick run says what it has not checked"


def test_hard_cases_hold_where_each_that_there_is_has_been_measured_and_holds() -> None:
    first, last = ALL_HARD[0].id, ALL_HARD[-1].id
    found = checked(hard=ALL_HARD)[-1]
    assert (found.text, found.held) == (f"All hard cases {first} to {last} hold", True)
    assert found.measured == f"{len(ALL_HARD)} measured"
    short = checked(hard=ALL_HARD[:-2])[-1]
    assert (short.held, short.measured) == (False, f"2 not measured: {ALL_HARD[-2].id}, {last}")
    broken = dataclasses.replace(ALL_HARD[3], title="far", result="off", passed=False)
    wrong = checked(hard=(*ALL_HARD[:3], broken, *ALL_HARD[4:]))[-1]
    assert (wrong.held, wrong.measured) == (False, f"{broken.id} far: off")


@pytest.mark.parametrize(
    ("number", "change"),
    [
        (0, row("SignedDepth", 2.0, 1e-1)),
        (1, row("SignedDepth", 1.4, 1e-7)),
        (2, row("constant thickness", 1.3, 9e-6)),
        (3, row("BackFaceDepth, unmarked", 1.6, 9e-6)),
        (4, row("SignedDepth in float16", 1.1, 2e-7)),
        (5, row("SignedDepth from the camera", 1.1, 2e-7)),
    ],
)
def test_a_claim_falls_on_one_case(number: int, change: MethodRow) -> None:
    names = ("constant thickness", "BackFaceDepth, unmarked", "SignedDepth from the camera", "SignedDepth in float16")
    good = [row("SignedDepth", 1.1, 1e-7), *(row(name, 1.3, 1e-2) for name in names)]
    bad = [change if one.method == change.method else one for one in good]
    found = checked(case(*good), case(*bad, name="far slab"))[number]
    assert found.held is False
    assert found.measured.startswith("not on 'far slab'")


def test_a_claim_within_the_noise_is_undecided() -> None:
    found = checked(case(row("SignedDepth", 1.3, 1e-7, noise=0.05)))[1]
    assert found.held is None
    assert "undecided on 'knot': 1.30 ± 0.05" in found.measured


@pytest.mark.parametrize("time", [1.15, 1.31])
def test_a_figure_that_noise_leaves_open_does_not_hold_on_either_side_of_the_bar(time: float) -> None:
    vague, clear = case(row("SignedDepth", time, 1e-7, noise=0.16)), case(row("SignedDepth", 1.1, 1e-7), name="torus")
    frontier, floor = checked(clear, vague)[:2]
    assert (frontier.held, floor.held) == (None, None), "that it holds on the other case does not decide it here"
    assert floor.undecided
    assert floor.measured.startswith(f"undecided on 'knot': {time:.2f} ± 0.16")
    assert frontier.measured.startswith(f"undecided on 'knot': {time:.2f} ± 0.16 times the floor")
    slow = case(row("SignedDepth", 1.9, 1e-7, noise=0.01), name="slow")
    assert checked(vague, slow)[1].held is False, "it fails elsewhere"


def test_the_median_of_quotients_ignores_a_slow_spell() -> None:
    floor = np.array([1.0] * 10 + [3.0] * 9)  # somebody else works on the machine for half of the time
    found = ratio(list(1.2 * floor), list(floor))
    assert found is not None
    assert found.median == pytest.approx(1.2)
    assert found.noise == pytest.approx(0, abs=1e-12)
    assert ratio([], []) is None
    assert timing([]) is None


def test_the_noise_is_the_scatter_of_medians(rng: np.random.Generator) -> None:
    samples = 2.0 + 0.3 * rng.standard_normal((4000, 25))
    medians = np.median(samples, axis=1)
    told = np.median([ratio(list(line), [1.0] * 25).noise for line in samples[:500]])  # type: ignore[union-attr]
    assert told == pytest.approx(medians.std(), rel=0.1)  # the estimate from quartiles is biased by some percent


def test_everything_is_measured_in_turns_with_the_floor_between() -> None:
    order: list[str] = []

    def draw(name: str, seconds: float):  # type: ignore[no-untyped-def]
        def drawn() -> Sample:
            order.append(name)
            return Sample(seconds, seconds, None, 2 * seconds, 3 * seconds)

        return drawn

    failures: dict[str, str] = {}

    def broken() -> Sample:
        raise RuntimeError("lost")

    drawings = {"a": draw("a", 0.01), "b": draw("b", 0.02), "c": broken}
    found = interleaved(draw("floor", 0.01), drawings, 0.0, lambda name, error: failures.update({name: str(error)}))
    assert failures == {"c": "lost"}
    assert found.keys() == {"a", "b"}
    assert len(found["a"].drawn) == len(found["b"].drawn) >= 3
    measured = order[order.index("floor") + 10 :]
    assert measured == ["floor", "a", "floor", "b", "floor"] * len(found["a"].drawn)
    assert {(one.part, one.whole) for one in found["b"].drawn} == {(0.04, 0.06)}
    assert {(one.part, one.wall) for one in found["b"].floors} == {(0.02, 0.01)}


def test_the_fastest_need_no_more_than_so_many_rounds() -> None:
    tiny = Sample(1e-9, 1e-9, 1e-9, 1e-9, 1e-9)
    found = interleaved(lambda: tiny, {"a": lambda: tiny}, 0.01, lambda *_: None)
    assert len(found["a"].drawn) == len(found["a"].floors) == MOST


def test_tiny_drawings_are_repeated_within_a_sample_and_unsure_ones_measured_longer() -> None:
    def steady(seconds: float) -> Callable[[], Sample]:
        return lambda: Sample(seconds, seconds, None, seconds, seconds)

    def unsteady(seconds: float) -> Callable[[], Sample]:
        turns = itertools.cycle((0.6, 1.4))
        return lambda: steady(next(turns) * seconds)()

    # A share of 0.1 s: five rounds of 0.01 s with a floor of as much, and four times as many.
    drawings = {"sure": steady(0.01), "unsure": unsteady(0.01)}
    found = interleaved(steady(0.01), drawings, 0.23, lambda *_: None, patience=4.0)
    assert len(found["sure"].drawn) == 5
    assert 19 <= len(found["unsure"].drawn) <= 21
    # In haste: three rounds, more only of what is unsure and cheap.
    drawings = {"sure": steady(0.008), "unsure": unsteady(0.007), "dear": unsteady(0.1)}
    hasty = interleaved(steady(0.005), drawings, 0.0, lambda *_: None)
    assert {name: len(one.drawn) for name, one in hasty.items()} == {
        "sure": FEWEST,
        "unsure": FEWEST_UNSURE,
        "dear": FEWEST,
    }
    # A pace for those who wait: two rounds of what is long.
    drawings = {"sure": steady(0.008), "unsure": unsteady(0.007), "long": unsteady(0.1)}
    quick = interleaved(steady(0.005), drawings, 0.0, lambda *_: None, long=0.05)
    assert {name: len(one.drawn) for name, one in quick.items()} == {
        "sure": FEWEST,
        "unsure": FEWEST_UNSURE,
        "long": FEWEST_LONG,
    }
    # Sixteen drawings make a sample, whose mean is steady; all of them count as spent.
    tiny = interleaved(steady(2.5e-4), {"tiny": unsteady(1e-4)}, 0.1, lambda *_: None)["tiny"]
    assert tiny.times == tiny.floor_times == MOST_REPEATED
    assert [one.wall for one in tiny.drawn] == pytest.approx([1e-4] * len(tiny.drawn))
    assert 0.085 <= tiny.spent < 0.1
