"""Shadows and caustics of the report: really drawn, in haste; claims fall where numbers do. No time is judged."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.bench.provenance import PROVENANCE
from translucent.bench import shadows
from translucent.bench.caustics import CAUSTIC_SCENES, MEDIUM_SCENES, GroundCaustics, SkyShadows
from translucent.bench.claims import SHADOW_CLAIMS
from translucent.bench.drawing import BenchContext
from translucent.bench.judgement import compare_reports
from translucent.bench.output import build_page, table
from translucent.bench.record import (
    CONSTANT,
    HALF,
    OPAQUE,
    CausticCase,
    CausticMediumCase,
    CausticRow,
    ErrorStatistics,
    Ratio,
    Report,
    ShadowCase,
    ShadowRow,
    Shadows,
    SkyRow,
    TimeStatistics,
)
from translucent.bench.run import experiments
from translucent.bench.shadows import SHADOW_SCENES, WINE, LightScene, ShadowMapComparison, map_camera, over_ground
from translucent.geometry.solids import Box, Sphere

HASTE = ShadowMapComparison((), (128, 256), texels=64, pixels=56, seconds=0.0)


def told(*objects: tl.Object, light: str = "sun") -> LightScene:
    return LightScene("mine", "Mine", "mine", lambda: over_ground(objects, light))


BALL = tl.Object(Sphere().tessellate(48), WINE)
BLOCK = tl.Object(Box((-0.3, 1.3, -0.3), (0.3, 1.5, 0.3)).tessellate())


def test_maps_are_nearer_than_what_others_throw(bench: BenchContext) -> None:
    # Texels of the map that was rounded to half floats before.
    haste = dataclasses.replace(HASTE, usual=256, texels=256)
    made = haste.measure(bench, dataclasses.replace(told(BALL), pictured=True))
    assert made.failure is None
    rows = {row.method: row for row in made.rows}
    assert not [row.failure or row.refusal for row in made.rows if row.failure or row.refusal]
    assert made.texels is not None
    assert made.texels.p999 < 1e-5
    assert made.order is not None
    assert 0.8 < made.order < 2.2
    off = {name: row.errors.median for name, row in rows.items() if row.errors is not None}
    assert 10 * off["map of 256"] < off[HALF] < 0.1 * off[CONSTANT] < 0.1 * off[OPAQUE]
    for name in ("map of 128", "map of 256"):
        assert rows[name].ratio is not None
        assert rows[name].ratio.median > 0.3  # type: ignore[union-attr]
        assert rows[name].wall is not None
    assert [picture.method for picture in made.pictures] == ["reference", "map of 256", OPAQUE, CONSTANT, HALF]
    error = made.pictures[2].error
    assert error is not None
    assert np.nanmin(error.array()) < -0.5, "an opaque map takes light away"


def test_what_is_opaque_is_in_the_way_of_maps_and_keeps_some_rows_out(bench: BenchContext) -> None:
    made = HASTE.measure(bench, told(BALL, BLOCK, light="point light"))
    assert (made.failure, made.opaque, made.texels) == (None, True, None)
    rows = {row.method: row for row in made.rows}
    assert rows[HALF].refusal == "drawn without opaque objects"
    assert rows["map of 256"].errors is not None
    assert rows["map of 256"].errors.median < 1e-4


def test_what_fails_is_told_and_leaves_the_rest(bench: BenchContext, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> object:
        raise MemoryError("no room for\nthe map")

    monkeypatch.setattr(shadows, "map_times", failing)
    made = HASTE.measure(bench, told(BALL))
    rows = {row.method: row for row in made.rows}
    assert rows["map of 128"].failure == "MemoryError: no room for the map"
    assert rows[OPAQUE].errors is not None
    broken = HASTE.measure(bench, LightScene("gone", "Gone", "", failing))  # type: ignore[arg-type]
    assert broken.failure == "MemoryError: no room for the map"
    report = Report(PROVENANCE, shadows=Shadows((made, broken), sky_failure="no sky"))
    assert [line.partition(":")[0] for line in report.failures] == [
        *("shadows, gone", "shadows, mine / map of 128", "shadows, mine / map of 256"),
        "shadows of the environment",
    ]
    assert "no room for the map" in build_page(report)
    assert "failed: MemoryError" in table(report)


def test_the_largest_ground_is_left_out_of_maps_wherever_it_stands() -> None:
    plate = tl.Object(Box((-0.4, -1.3, -0.4), (0.4, -1.2, 0.4)).tessellate())
    heights = []
    for objects in ((BALL, plate), (plate, BALL)):
        scene = over_ground(objects, "sun")
        first = dataclasses.replace(scene, objects=[scene.objects[-1], *scene.objects[:-1]])
        heights += [map_camera(one).height for one in (scene, first)]
    assert heights == pytest.approx([heights[0]] * 4)
    assert heights[0] is not None
    assert heights[0] < 4.0  # the ground is 50 wide


def test_scenes_are_those_of_the_design() -> None:
    names = {scene.name for scene in SHADOW_SCENES}
    assert len(names) == len(SHADOW_SCENES)
    lights = {"sun", "point light"}
    assert {
        f"{mesh}, {light}" for mesh in ("bear", "knot", "shell", "goblet", "bangle", "soap") for light in lights
    } <= names
    assert {"bear, spot", "stack", "two media", "textured", "in a glass", "stone"} <= names


def test_directions_come_nearer_to_light_from_everywhere(renderer: tl.Renderer) -> None:
    few = SkyShadows(environments=("sky",), directions=(4, 48), size=(16, 12), strata=8)
    rows = {row.directions: row.error for row in few.rows(renderer)}
    assert rows[48] < 0.06
    assert rows[48] < 0.5 * rows[4] < 0.15


def test_a_caustic_has_the_power_of_the_truth(bench: BenchContext) -> None:
    made = GroundCaustics((), (20_000,), 4_000, (32, 24)).measure(bench, CAUSTIC_SCENES[0])
    assert made.failure is None
    (row,) = made.rows
    assert abs(row.power) < 0.02
    assert row.nrmse <= row.most < 0.5
    assert [picture.method for picture in made.pictures] == ["the picture", "reference", "20,000 photons"]


def test_a_quick_run_has_few_scenes(bench: BenchContext) -> None:
    def steps(quick: bool) -> list[str]:
        parts = [one for one in experiments(quick) if one.part == "shadows"]
        return [f"{one.label}{scene.name}" for one in parts for scene in one.scenes(bench)]

    quick, full = steps(True), steps(False)
    assert quick == ["shadow, bear, sun", "shadow, two media", "shadows of environments", "caustic, glass ball"]
    assert len(full) == len(SHADOW_SCENES) + 1 + len(CAUSTIC_SCENES) + len(MEDIUM_SCENES)
    assert set(quick) < set(full)


def errors(median: float, p999: float) -> ErrorStatistics:
    return ErrorStatistics(p999, median, p999, p999, p999, 0.0)


def case(texels: float = 1e-6, order: float = 1.4, cost: float = 1.2, half: float = 1e-3, **more: Any) -> ShadowCase:
    timing = TimeStatistics(9.0, 9.5, 0.1, 5)
    rows = (
        ShadowRow(
            "map of 1024", "method", 1024, "", errors(3e-6, 1e-3), 2e-4, wall=timing, ratio=Ratio(cost, 0.01, 0.01)
        ),
        ShadowRow(OPAQUE, "counter-example", 1024, "", errors(0.7, 0.9), 0.5),
        ShadowRow(HALF, "counter-example", 1024, "", errors(half, half), half),
    )
    return ShadowCase("bear", "Bear", "", texels=errors(1e-8, texels), texel_size=512, order=order, rows=rows, **more)


GOOD = Shadows(
    (case(),),
    (SkyRow("sky", 8, 0.1, 0.1), SkyRow("sky", 32, 0.04, 0.2)),
    None,
    (CausticCase("ball", "Ball", "", 1000, 1e-3, (CausticRow(250_000, 0.002, 0.1, 0.12, 1.0),)),),
    (
        CausticMediumCase(
            *("wax", "Wax", "", 192, 0.02),
            (CausticRow(0, 0.08, 0.22, 0.29, 1.0), CausticRow(400_000, -0.015, 0.08, 0.19, 1.0)),
        ),
    ),
)


def held(**changes: Any) -> list[bool | None]:
    return [judge(Report(PROVENANCE, shadows=dataclasses.replace(GOOD, **changes))).held for judge in SHADOW_CLAIMS]


def test_claims_fall_where_a_number_does() -> None:
    assert held() == [True, True, True, None, True, True, True, True, True, True]
    assert held(cases=(case(texels=2e-5),))[0] is False
    assert held(cases=(case(order=0.8),))[1] is False
    assert held(cases=(case(), case(cost=1.5)))[2] is False
    assert held(cases=(case(cost=1.31),))[2] is None, "closer to the bar than the noise"
    assert held(cases=(case(cost=1.5, opaque=True),))[2:4] == [None, False]
    assert held(cases=(case(cost=1.5, alike=False),))[2:4] == [None, False]
    assert held(cases=(case(half=2e-5),))[4] is False
    assert held(sky=(SkyRow("sky", 8, 0.1, 0.1), SkyRow("sky", 32, 0.06, 0.2)))[5:7] == [False, False]
    for row, expected in (
        (CausticRow(250_000, 0.02, 0.1, 0.12, 1.0), [False, True]),
        (CausticRow(250_000, 0.0105, 0.1, 0.12, 1.0), [None, True]),
        (CausticRow(250_000, 0.0, 0.15, 0.25, 1.0), [True, None]),
        (CausticRow(250_000, 0.0, 0.3, 0.4, 1.0), [True, False]),
        (CausticRow(62_500, 0.5, 0.3, 0.4, 1.0), [None, None]),
    ):
        caustic = dataclasses.replace(GOOD.caustics[0], rows=(row,))
        assert held(caustics=(caustic,))[7:9] == expected
    for error, most, found in ((0.25, 0.3, False), (0.1, 0.3, None)):
        row = CausticRow(400_000, 0.0, error, most, 1.0)
        assert held(media=(dataclasses.replace(GOOD.media[0], rows=(row,)),))[-1] is found
    assert {judge(Report(PROVENANCE)).held for judge in SHADOW_CLAIMS} == {None}


def test_the_page_the_table_and_the_record_have_them() -> None:
    made = Report(PROVENANCE, shadows=GOOD, complete=True)
    assert Report.from_json(made.to_json()) == made
    page = build_page(made)
    assert page.count("<svg") >= 4
    for text in ("Shadows and caustics", "in rays of texels, p99.9", "1.20", "4.00 %", "+0.20 %", "-1.5 %", OPAQUE):
        assert text in page, text
    assert "Shadows and caustics" not in build_page(Report(PROVENANCE, complete=True))
    text = table(made)
    assert "sky, 32 directions: error 4.0% of the mean" in text
    assert "250,000 photons: power +0.20%, nRMSE 0.100, at most 0.120" in text
    assert "caustic in wax, 0 photons: mean +8.0%, nRMSE 0.220, at most 0.290" in text


def test_reports_are_compared_by_shadows_too() -> None:
    old, new = (Report(PROVENANCE, shadows=Shadows((case(**more),))) for more in ({}, {"cost": 1.6, "half": 1e-2}))
    assert [change.kind for change in compare_reports(old, new)] == ["slower", "less accurate"]
    assert [change.kind for change in compare_reports(new, old)] == ["faster", "more accurate"]
    gone = dataclasses.replace(case(), rows=(), failure="no ground")
    assert [change.kind for change in compare_reports(old, Report(PROVENANCE, shadows=Shadows((gone,))))] == ["fails"]
