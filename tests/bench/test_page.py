"""The page of a report: complete, self-contained, escaped, the same for the same record, and made without OpenGL."""

from __future__ import annotations

import base64
import dataclasses
import io
import itertools
import re
import subprocess
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterator
from html import unescape
from html.parser import HTMLParser
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from tests.bench.provenance import PROVENANCE
from translucent.bench import figures as numbers
from translucent.bench.codec import Packed
from translucent.bench.judgement import mark_frontier
from translucent.bench.output import build_page, checked_folder
from translucent.bench.plots import overview_svg
from translucent.bench.record import (
    CaseRecord,
    Claim,
    ErrorStatistics,
    HardCase,
    LightErrors,
    MethodRow,
    Ratio,
    Report,
    ReportPicture,
    ScalePoint,
    Series,
    Slab,
    TimeStatistics,
)
from translucent.errors import RenderError

FAMILIES = ("SignedDepth", "BackFaceDepth", "constant thickness", "KBuffer", "FragmentLists", "something new")


def unlike() -> Iterator[float]:
    """Numbers that all differ in two digits."""
    return itertools.cycle((1.0 + k / 10) * 10.0**e for e in (-7, -6, -5, -4, -3, -2) for k in range(90))


def measured(method: str, family: str, ratio: float, rms: float, values: Iterator[float], **more: Any) -> MethodRow:
    def timing() -> TimeStatistics:
        return TimeStatistics(1e3 * next(values), 1e3 * next(values), 1e3 * next(values), 11)

    def errors(rms: float) -> ErrorStatistics:
        return ErrorStatistics(rms, next(values), next(values), next(values), next(values), -next(values))

    row = MethodRow(
        method=method,
        family=family,
        parameters=f"{family}()",
        kind="method",
        promise=f"what {method} promises",
        exact=True,
        wall=timing(),
        gpu=timing(),
        frame=timing(),
        ratio=Ratio(ratio, next(values), next(values)),
        frame_ratio=Ratio(ratio + 1.23, next(values), next(values)),
        passes=2,
        layers=17,
        ms_per_layer=next(values),
        bytes_per_pixel=1234,
        thickness=errors(rms),
        transmittance=errors(next(values)),
        radiance=errors(next(values)),
        invalid=0.0,
        coverage_mismatch=next(values),
    )
    return dataclasses.replace(row, **more)


def png() -> str:
    stream = io.BytesIO()
    Image.new("RGB", (8, 6), (10, 200, 30)).save(stream, format="PNG")
    return base64.b64encode(stream.getvalue()).decode("ascii")


def case(name: str = "knot", title: str = "A knot", **more: Any) -> CaseRecord:
    values = unlike()
    rows = [
        MethodRow("depth only", "depth only", "", "floor", "", True, wall=TimeStatistics(9.87, 10.1, 0.21, 11)),
        *(
            measured(f"{family}, 4 of them", family, 1.1 + i, 10.0 ** (i - 8), values)
            for i, family in enumerate(FAMILIES)
        ),
        measured("marking", "KBuffer", 1.02, 1e-7, values, invalid=0.25),
        measured("on the processor", "cpu backend", 400.0, 0.0, values, kind="cpu"),
        MethodRow("refusing", "ThinLayer", "", "method", "", False, refusal="no sheets here"),
        MethodRow("breaking", "RayMarched", "", "method", "", False, failure="a shader that does not compile"),
    ]
    error = np.linspace(-1e-3, 1e-3, 48).reshape(6, 8)
    pictures = (
        ReportPicture("reference", png()),
        ReportPicture("marking", png(), Packed.of(error), Packed.of(error > 5e-4)),
    )
    record = CaseRecord(
        name=name,
        title=title,
        why="concave",
        quantity="thickness",
        closed=True,
        absorption_only=True,
        triangles=20160,
        bodies=1,
        layers=8,
        size=(640, 480),
        compared_size=(64, 48),
        diagonal=0.1,
        compared_pixels=777,
        reference_seconds=1.5,
        rows=tuple(mark_frontier(rows, "thickness")),
        pictures=pictures,
    )
    return dataclasses.replace(record, **more)


def report(**more: Any) -> Report:
    points = tuple(
        ScalePoint(x, wall=TimeStatistics(x / 100, x / 90, 0.1, 5), ratio=Ratio(1.25, 0.1, 0.01)) for x in (1000, 10000)
    )
    lost = ScalePoint(100000, failure="out of memory")
    made = Report(
        provenance=PROVENANCE,
        cases=(case(), case("broken", "A broken model", rows=(), pictures=(), failure="12 holes")),
        scaling=(Series("triangles", "SignedDepth", "SignedDepth", "one frame size", (*points, lost)),),
        hard_cases=(
            HardCase("H01", "grazing", "exact", "as promised", True, 1.5e-7, 2e-6, "of the diagonal"),
            HardCase("H02", "colors", "a clear error", "a traceback", False),
        ),
        claims=(Claim("it is fast", True, "1.1"), Claim("it is exact", False, "1e-1"), Claim("on a GPU", None, "none")),
        seconds=12.0,
        complete=True,
    )
    return dataclasses.replace(made, **more)


class Elements(HTMLParser):
    """All elements of a page with their attributes, and all of its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def page() -> str:
    return build_page(report())


def figure(of: Report) -> str:
    svg = overview_svg(of)
    assert svg is not None
    return svg


def cells(page: str) -> Counter[str]:
    """The texts of all cells of tables."""
    return Counter(
        unescape(re.sub(r"<[^>]*>", "", cell)).strip() for cell in re.findall(r"<td[^>]*>(.*?)</td>", page, re.DOTALL)
    )


def test_nothing_is_fetched(page: str) -> None:
    for tag, attributes in Elements(page).found:
        assert tag not in {"script", "iframe", "object", "embed", "base"}
        assert not {name for name in attributes if name.startswith("on")}
        for name in ("src", "href", "xlink:href", "srcset", "action"):
            assert (attributes.get(name) or "#").startswith(("#", "data:")), (tag, attributes)
    assert all(inside.startswith("#") for inside in re.findall(r"url\(([^)]*)\)", page))
    assert "@import" not in page
    assert set(re.findall(r"https?://[^\s\"'<]*", page)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }


def test_links_lead_somewhere_and_identifiers_are_unique(page: str) -> None:
    found = Elements(page).found
    identifiers = Counter(attributes["id"] for _, attributes in found if "id" in attributes)
    assert identifiers.most_common(1)[0][1] == 1
    targets = {a["href"][1:] for _, a in found if (a.get("href") or "").startswith("#")}  # type: ignore[index]
    targets |= set(re.findall(r"url\(#([^)]*)\)", page))
    assert targets
    assert targets <= identifiers.keys()


def test_cases_of_one_name_have_pages_of_their_own() -> None:
    page = build_page(report(cases=(case(), case(), case("КНОТ"), case("***"))))
    identifiers = Counter(attributes["id"] for _, attributes in Elements(page).found if "id" in attributes)
    assert identifiers.most_common(1)[0][1] == 1


SHOWN: dict[str, Callable[[Any], str]] = {
    "wall": numbers.ms_text,
    "gpu": numbers.ms_text,
    "frame": numbers.ms_text,
    "ratio": numbers.ratio_text,
    "thickness": numbers.error_text,
    "transmittance": numbers.error_text,
    "radiance": numbers.error_text,
    "ms_per_layer": numbers.ms_text,
    "coverage_mismatch": numbers.fraction_text,
}


def test_every_number_of_a_row_is_in_a_table(page: str) -> None:
    expected: Counter[str] = Counter()
    for row in report().cases[0].rows:
        for name, text in SHOWN.items():
            value = getattr(row, name)
            parts = [value] if isinstance(value, float) else dataclasses.asdict(value).items() if value else []
            for part in parts:
                if isinstance(part, float):
                    expected[text(part)] += 1
                elif part[0] == "rounds":
                    expected["11"] += name == "wall"
                elif part[0] == "bias":
                    expected[numbers.signed_error_text(part[1])] += 1
                else:
                    expected[text(part[1])] += 1
        if row.frame_ratio is not None:
            expected[numbers.ratio_text(row.frame_ratio.median)] += 1
            expected.update(["2", "17", numbers.count_text(1234)])
    assert sum(expected.values()) > 200
    assert not expected - cells(page)


def test_texts_of_the_record_are_shown(page: str) -> None:
    text = " ".join(" ".join(Elements(page).text).split())
    for shown in (
        "A knot", "12 holes", "breaking: a shader that does not compile", "refusing : no sheets here", "out of memory",
        "broken: 12 holes", "knot / breaking: a shader", "H01", "a traceback", "1.5e-7", "of the diagonal", "2.0e-6",
        "1 of 2 keep", "it is exact", "does not hold", "not checked", "0123abc", "changes that are not committed",
        "translucent report -o out", "what marking promises", "777 pixels", "20 160 triangles",
    ):  # fmt: skip
        assert shown in text


@pytest.mark.usefixtures("empty_plots")
def test_slabs_and_scattered_light_have_tables() -> None:
    known = case()
    light = LightErrors(0.0123, 0.0045, (0.0678, -0.0912, 0.0034), 0.567)
    lit = dataclasses.replace(known.rows[1], light=light)
    record = dataclasses.replace(known, rows=(known.rows[0], lit, *known.rows[2:]), truth_noise=0.0314)
    shares = [(0.4, 0.2), (0.0, 0.1), (0.411, 0.19), (0.33, 0.25)]
    slabs = tuple(Slab(0.9, depth, 0.5, 1.5, *shares[0], *shares[1:], "layer") for depth in (2.0, 4.0))
    page = build_page(report(cases=(record,), slabs=slabs))
    found = cells(page)
    for text in ("0.012", "4.5e-3", "+6.8 %", "−9.1 %", "+0.3 %", "567", "0.9", "+0.011", "−0.070"):
        assert found[text], text
    assert "3.14 % of the mean" in " ".join(page.split())
    assert "of 4 × 4" not in build_page(report())
    assert 'class="good"' in page
    assert 'class="bad planned"' in page


def test_errors_of_many_samples_stand_beside_those_of_one() -> None:
    known = case()
    sampled = dataclasses.replace(known.rows[1], sampled=ErrorStatistics(0.0123, 0.0045, 0.067, 0.0912, 0.34, -0.056))
    record = dataclasses.replace(
        known, rows=(known.rows[0], sampled, *known.rows[2:]), truth_rays=8, truth_spread=0.0712
    )
    page = build_page(report(cases=(record,)))
    found = cells(page)
    for text in (
        "radiance, 16 samples",
        "0.012",
        "4.5e-3",
        "0.067",
        "0.091",
        "0.34",
        numbers.signed_error_text(-0.056),
    ):
        assert found[text], text
    assert found["0.012"] > 1, "beside the plot, too"
    assert "mean of 8 rays spread over each, which is uncertain by 7.12 %" in " ".join(page.split())
    assert "16 samples" not in build_page(report())


@pytest.mark.usefixtures("empty_plots")
def test_banners() -> None:
    def of(**more: Any) -> str:
        changed = dataclasses.replace(PROVENANCE, **{k: v for k, v in more.items() if hasattr(PROVENANCE, k)})
        rest = {k: v for k, v in more.items() if not hasattr(PROVENANCE, k)}
        return " ".join(Elements(build_page(report(provenance=changed, **rest))).text)

    plain = of(software=False, renderer="A GPU")
    assert "A GPU" in plain
    for words, text in (
        ("Software rasterizer", of(software=True)),
        ("Not complete.", of(software=False, complete=False)),
        ("A quick run", of(software=False, quick=True)),
    ):
        assert words in text
        assert words not in plain


def test_the_same_record_gives_the_same_bytes(page: str) -> None:
    assert build_page(Report.from_json(report().to_json())) == page
    assert figure(report()) == figure(report())


EVIL = """<script>alert('1')</script>"><img src=x onerror="alert(1)"> {{ 7 * 7 }} & ]]> $x^2$ \x1b]0;x\x07"""


def poisoned(value: Any) -> Any:
    """The value with hostile text wherever the record has free text."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        if isinstance(value, Packed):
            return value
        fixed = {"kind", "quantity", "axis", "format", "png"}
        changed = {f.name: poisoned(getattr(value, f.name)) for f in dataclasses.fields(value) if f.name not in fixed}
        return dataclasses.replace(value, **changed)
    if isinstance(value, str):
        return value + EVIL
    if isinstance(value, tuple):
        return tuple(poisoned(item) for item in value)
    if isinstance(value, dict | types.MappingProxyType):
        return {key + EVIL: poisoned(item) for key, item in value.items()}
    return value


def test_text_stays_text() -> None:
    evil = poisoned(report())
    page = build_page(evil)
    elements = Elements(page)
    assert not [tag for tag, attributes in elements.found if tag == "script" or "onerror" in attributes]
    assert sum("<script>alert('1')</script>" in part for part in elements.text) > 50
    assert " 49 " not in page
    for svg in (figure(evil), *re.findall(r"<svg .*?</svg>", page, re.DOTALL)):
        assert not ElementTree.fromstring(svg).findall(".//{*}script")


@pytest.mark.usefixtures("empty_plots")
def test_a_picture_is_nothing_but_a_picture() -> None:
    evil = case(pictures=(ReportPicture("reference", '"><script>'),))
    assert not [tag for tag, _ in Elements(build_page(report(cases=(evil,)))).found if tag == "script"]


@pytest.mark.parametrize(
    "more",
    [
        {"cases": ()},
        {"cases": (), "scaling": (), "hard_cases": (), "claims": (), "complete": False},
        {"cases": (case(rows=case().rows[:2]),)},
        {"cases": (case(rows=case().rows[8:9]),)},
        {"cases": (case(rows=case().rows[:1]),)},
    ],
    ids=["no case", "nothing", "one method", "an error of zero", "only the floor"],
)
def test_little_makes_a_page_too(more: dict[str, Any]) -> None:
    assert "Where the numbers come from" in build_page(report(**more))


def test_a_long_list_of_methods_stands_below_its_plot() -> None:
    values = unlike()
    rows = [measured(f"RayMarched, {2**i} steps", "RayMarched", 2.0 + 7 * i % 30, 0.5**i, values) for i in range(30)]
    page = build_page(report(cases=(case(rows=tuple(rows)),)))
    assert 'class="plot tall"' in page
    assert 'class="plot tall"' not in build_page(report())
    order = re.findall(r"RayMarched, (\d+) steps</td><td>", page)
    assert [int(steps) for steps in order[:30]] == [2**i for i in range(30)]


def test_drawings_say_what_they_show_and_follow_the_theme(page: str) -> None:
    svg = next(s for s in re.findall(r"<svg .*?</svg>", page, re.DOTALL) if "Cost against error" in s)
    assert "SignedDepth, 4 of them: 1.10 x depth-only, RMS error 1.0e-8" in svg
    assert "var(--green)" in svg
    assert "#0102" not in page
    # Black and white come from matplotlib's defaults, and would vanish in one of the themes.
    assert not re.findall(r"(?:fill|stroke): ?#(?:000000|ffffff)", svg)


def test_the_figure_names_its_methods_and_is_a_file_of_its_own() -> None:
    svg = figure(report(cases=(case(convex=True, title="A sphere"), case())))
    root = ElementTree.fromstring(svg)
    text = "".join(root.itertext())
    assert "A knot, 640 × 480, software rasterizer" in text
    assert "SignedDepth, 4 of them" in text
    assert "on the processor" not in text
    assert "prefers-color-scheme: dark" in text
    assert overview_svg(report(cases=())) is None


def test_names_are_no_formulas_and_long_ones_are_cut() -> None:
    values = unlike()
    rows = (measured("$k^2$ layers", "KBuffer", 2.0, 1e-3, values), measured("x" * 200, "KBuffer", 3.0, 1e-4, values))
    text = "".join(ElementTree.fromstring(figure(report(cases=(case(rows=rows),)))).itertext())
    assert "$k^2$ layers" in text
    assert "x" * 39 + "…" in text


def test_no_opengl_is_needed() -> None:
    code = (
        "import sys; from pathlib import Path; from translucent.bench.record import Report; "
        "from translucent.bench.output import build_page; "
        "build_page(Report.from_json(sys.stdin.read())); "
        "assert not {'moderngl', 'OpenGL', 'glcontext', 'embreex'} & sys.modules.keys()"
    )
    subprocess.run(
        [sys.executable, "-c", code], input=report(cases=(case(rows=case().rows[:2]),)).to_json(), text=True, check=True
    )


@pytest.mark.parametrize("package", ["matplotlib", "jinja2"])
def test_a_missing_package_is_named_with_its_extra(
    package: str, uninstalled: Callable[[str], None], tmp_path: Any
) -> None:
    uninstalled(package)
    missing = rf"the package {package} is not installed; pip install .*\[report\]"
    with pytest.raises(RenderError, match=missing), checked_folder(tmp_path / "out"):
        raise AssertionError("it is needed")
    assert not list(tmp_path.iterdir())
