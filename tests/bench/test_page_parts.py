"""The parts of the page: advice, labels that do not touch, pictures of error, numbers as text."""

from __future__ import annotations

import base64
import dataclasses
import io
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from translucent.bench import figures as numbers
from translucent.bench.codec import Packed
from translucent.bench.figures import COLORS, FAMILIES, place_labels, short_count, spread, style_of
from translucent.bench.judgement import advise, summarize
from translucent.bench.output import STEPS, heat_map, scale_colors
from translucent.bench.record import CaseRecord, ErrorStatistics, MethodRow, Ratio, ReportPicture, RowKind


def row(method: str, ratio: float, rms: float, kind: RowKind = "method", invalid: float = 0.0) -> MethodRow:
    errors = ErrorStatistics(rms, rms, rms, rms, rms, 0.0)
    return MethodRow(method, method, "", kind, "", True, ratio=Ratio(ratio, 0, 0), thickness=errors, invalid=invalid)


def scene(*rows: MethodRow) -> CaseRecord:
    return CaseRecord("a", "A", "", "thickness", rows=rows)


SIGNED, LISTS = row("SignedDepth", 1.1, 3e-8), row("FragmentLists", 5.0, 2e-8)
CONSTANT, HALF = row("constant thickness", 0.5, 0.2, "counter-example"), row("float16", 1.0, 3e-5, "counter-example")


def test_the_cheapest_that_is_good_enough_is_advised() -> None:
    advice = advise(scene(LISTS, SIGNED, CONSTANT, HALF))
    assert advice is not None
    assert advice.row == SIGNED
    assert advice.good_enough
    assert advice.cheaper is None, "what takes shortcuts is no advice"
    assert advice.constant == CONSTANT
    assert advice.times_better == pytest.approx(0.2 / 1e-6)


def test_few_pixels_that_are_plainly_wrong_are_not_good_enough() -> None:
    """Limits of thickness: an RMS of 1e-4 of the diagonal, and ten times that in all but one pixel of a thousand."""
    errors = ErrorStatistics(2e-5, 1e-8, 1e-7, 2e-3, 0.1, 0.0)
    flawed = dataclasses.replace(row("flawed", 1.0, 0.0), thickness=errors)
    advice = advise(scene(flawed, SIGNED))
    assert advice is not None
    assert advice.row == SIGNED
    almost = dataclasses.replace(flawed, thickness=dataclasses.replace(errors, p999=9e-4))
    advice = advise(scene(almost, SIGNED))
    assert advice is not None
    assert advice.row == almost


def test_among_equals_the_exact_one_is_advised() -> None:
    limited = dataclasses.replace(row("KBuffer", 4.9, 2e-8), exact=False)
    exact = dataclasses.replace(LISTS, exact=True)
    for rows in ((limited, exact), (exact, limited)):
        advice = advise(scene(*rows))
        assert advice is not None
        assert advice.row == exact


def test_the_processor_is_advised_where_nothing_else_runs() -> None:
    one, other = row("march, 8", 90.0, 0.1, "cpu"), row("march, 64", 300.0, 1e-5, "cpu")
    advice = advise(scene(one, other))
    assert advice is not None
    assert advice.row == other
    assert advice.cheaper == one


def test_shortcuts_and_methods_that_mark_pixels_are_not_advised() -> None:
    marking = row("BackFaceDepth", 1.05, 1e-8, invalid=0.01)
    advice = advise(scene(LISTS, HALF, marking, row("cpu", 0.9, 0.0, "cpu")))
    assert advice is not None
    assert advice.row == LISTS


def test_where_none_is_good_enough_the_most_accurate_is_named() -> None:
    advice = advise(scene(row("a", 1.0, 0.1), row("b", 2.0, 0.01)))
    assert advice is not None
    assert advice.row.method == "b"
    assert not advice.good_enough
    assert advise(scene(CONSTANT)) is None
    assert advise(scene()) is None


def test_a_method_that_is_hardly_cheaper_is_no_alternative() -> None:
    advice = advise(scene(SIGNED, row("ThinLayer", 1.08, 0.1)))
    assert advice is not None
    assert advice.cheaper is None


def test_scenes_with_one_answer_share_a_line() -> None:
    one, two, three = scene(SIGNED), scene(row("SignedDepth", 1.2, 1e-8)), scene(LISTS)
    found = summarize([(case, advise(case)) for case in (three, one, two, scene())])
    assert [(row.method, *rest) for row, *rest in found] == [
        ("SignedDepth", ["A", "A"], 1.1, 1.2),
        ("FragmentLists", ["A"], 5.0, 5.0),
    ]


@pytest.mark.parametrize("crowd", ["one place", "a line", "a cloud", "corners"])
def test_labels_do_not_touch(crowd: str, rng: np.random.Generator) -> None:
    bounds = (0.0, 0.0, 700.0, 450.0)
    points = {
        "one place": np.tile([60.0, 380.0], (6, 1)) + rng.normal(0, 2, (6, 2)),
        "a line": np.stack([np.linspace(10, 690, 40), np.full(40, 20.0)], axis=1),
        "a cloud": rng.uniform((20, 20), (680, 430), (45, 2)),
        "corners": np.array([[0.0, 0.0], [700.0, 0.0], [0.0, 450.0], [700.0, 450.0]]),
    }[crowd]
    sizes = np.stack([rng.uniform(8, 20, len(points)), np.full(len(points), 13.0)], axis=1)
    centers = place_labels(points, sizes, bounds, np.full(len(points), 5.0))
    apart = np.abs(centers[:, None] - centers[None])
    over = (apart < (sizes[:, None] + sizes[None]) / 2).all(axis=2)
    assert not over[~np.eye(len(points), dtype=bool)].any()
    assert (centers - sizes / 2 >= bounds[:2]).all()
    assert (centers + sizes / 2 <= bounds[2:]).all()
    # The farthest ring of candidates is 95 from the symbol; labels reach half their size beyond.
    assert (np.hypot(*(centers - points).T) < 5 + 95 + 20).all()


def test_places_on_a_line_keep_order_gap_and_bounds() -> None:
    wanted = np.array([50.0, 10.0, 11.0, 12.0, 99.0, 99.0])
    found = spread(wanted, 10.0, 0.0, 100.0)
    order = np.argsort(wanted, kind="stable")
    assert (np.diff(found[order]) >= 10.0 - 1e-9).all()
    assert found.min() >= 0.0
    assert found.max() <= 100.0
    assert found[0] == 50.0
    assert found[[1, 2, 3]].mean() == pytest.approx(11.0)
    assert spread(np.array([]), 10.0, 0.0, 100.0).size == 0


def pixels(error: npt.NDArray[Any], invalid: npt.NDArray[Any] | None = None) -> npt.NDArray[Any]:
    """(h, w, 4) of the picture of an error."""
    address = heat_map(ReportPicture("a", "", Packed.of(error), None if invalid is None else Packed.of(invalid)))
    assert address is not None
    kind, data = address.split(",")
    assert kind == "data:image/png;base64"
    return np.array(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA")).astype(int)


def test_the_sign_of_an_error_is_its_hue_and_its_size_the_shade() -> None:
    magnitudes = 3 * np.array(STEPS[:-1])
    shown = pixels(np.array([magnitudes, -magnitudes, np.full(len(magnitudes), 1e-9)]))
    red, _, blue, alpha = np.moveaxis(shown, 2, 0)
    assert (alpha == 255).all()
    assert (red[0] > blue[0]).all()
    assert (blue[1] > red[1]).all()
    assert (np.abs(red[2] - blue[2]) < 3).all()
    assert (np.diff(shown[:2, :, :3].sum(axis=2), axis=1) < 0).all(), "larger is darker"


def test_the_scale_names_the_colors_of_the_pictures() -> None:
    legend = {label: color for color, label in scale_colors()}
    assert len(legend) == 2 * len(STEPS) + 1
    for value, label in ((2e-3, "+10⁻³"), (-2e-3, "−10⁻³"), (0.7, "+0.1"), (5e-8, "0"), (-2e-7, "−10⁻⁷")):
        r, g, b, _ = pixels(np.array([[value]]))[0, 0]
        assert legend[label] == f"#{r:02x}{g:02x}{b:02x}"


def test_uncovered_pixels_are_transparent_and_invalid_ones_striped() -> None:
    error = np.full((12, 12), np.nan)
    error[:, 6:] = 1e-3
    invalid = np.zeros((12, 12), dtype=bool)
    invalid[:, :3] = True
    shown = pixels(error, invalid)
    assert (shown[:, 3:6, 3] == 0).all()
    assert (shown[:, :3, 3] == 255).all()
    assert len(np.unique(shown[:, :3].reshape(-1, 4), axis=0)) == 2
    assert len(np.unique(shown[:, 6:].reshape(-1, 4), axis=0)) == 1
    assert heat_map(ReportPicture("reference", "")) is None


def test_numbers_as_text() -> None:
    texts = {
        3.94e-8: "3.9e-8",
        0.0: "0",
        None: "–",
        -2e-5: "-2.0e-5",
        0.02: "0.02",
        0.217: "0.22",
        12.3: "12",
        123.4: "123",
        4e5: "4.0e5",
    }
    assert {x: numbers.error_text(x) for x in texts} == texts
    assert [numbers.signed_error_text(x) for x in (1e-3, -1e-3, 0.0, None)] == ["+1.0e-3", "-1.0e-3", "0", "–"]
    assert [numbers.ratio_text(x) for x in (1.116, 9.999, 16.32, 99.96, 240.4)] == [
        "1.12",
        "10.0",
        "16.3",
        "100",
        "240",
    ]
    assert [numbers.ms_text(x) for x in (0.01234, 1.234, 12.34, 1234.0, 0.0, None)] == [
        *("0.0123", "1.23", "12.3", "1234", "0", "–"),
    ]
    assert [numbers.fraction_text(x) for x in (0.0, 5e-5, 0.0123, 0.1, 0.16, 1.0)] == [
        *("0", "< 0.01 %", "1.23 %", "10.0 %", "16.0 %", "100.0 %"),
    ]
    assert [numbers.power_text(x) for x in (1e-8, 0.1, 10.0, 1e4)] == ["10⁻⁸", "0.1", "10", "10⁴"]
    assert numbers.rounded_text(121399.2) == "120\u202f000"
    assert numbers.count_text(1234567) == "1\u202f234\u202f567"
    assert [numbers.limit_text(x) for x in (1e-4, 1e-6)] == ["1e-4", "1e-6"]
    assert [short_count(x) for x in (4, 65536, 1e6)] == ["4", "65.5k", "1M"]


def contrast(one: str, other: str) -> float:
    """Contrast of two colors, as WCAG 2 defines it: 1 to 21."""

    def luminance(color: str) -> float:
        channels = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    brighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (brighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_colors_stand_out_from_the_page(theme: int) -> None:
    for name, pair in COLORS.items():
        if name in ("paper", "panel", "line"):
            continue
        # WCAG 2: 4.5 for text, 3 for symbols.
        least = 4.5 if name in ("ink", "muted", "good", "bad") else 3.0
        assert contrast(pair[theme], COLORS["paper"][theme]) >= least, name


def test_families_differ_in_symbol_and_not_by_color_alone() -> None:
    markers = [style.marker for style in FAMILIES.values()]
    assert len(markers) == len(set(markers))
    assert style_of("never heard of") == style_of("never heard of")
    assert math.isfinite(len(style_of("").marker))
