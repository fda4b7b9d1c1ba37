"""Tables of the docs: they are written from the published report, and pages include what is written."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import translucent as tl

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
REPORT = json.loads((DOCS / "reports" / "software.json").read_text(encoding="utf-8"))
CASES = {case["title"]: case for case in REPORT["cases"]}


def extension(name: str) -> ModuleType:
    """An extension of the site, without Sphinx."""
    spec = importlib.util.spec_from_file_location(name, DOCS / "_ext" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MEASUREMENTS = extension("measurements")
TABLES: dict[str, list[str]] = MEASUREMENTS.tables(REPORT)


def cells(table: str, title: str) -> list[str]:
    """The cells of the row that begins with this title."""
    line = next(line for line in TABLES[table] if line.startswith(f"| {title} |"))
    return [cell.strip() for cell in line.split("|")[2:-1]]


def measured(case: str, method: str) -> dict[str, Any]:
    return next(row for row in CASES[case]["rows"] if row["method"] == method)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (0.0, "0"),
        (4.13e-08, "4.1e-8"),
        (0.00996, "1.0e-2"),
        (0.0414, "0.041"),
        (1.62, "1.6"),
        (4799.6, "4,800"),
    ],
)
def test_numbers_have_two_digits(value: float | None, text: str) -> None:
    assert MEASUREMENTS.number(value) == text


@pytest.mark.parametrize("values", [[0.0123, 5.4, None, 7.3e-05], [1.0], [0.0, 123456.0]])
def test_a_span_is_from_the_least_to_the_largest(values: list[float | None]) -> None:
    some = [value for value in values if value is not None]
    ends = [float(part.replace(",", "")) for part in MEASUREMENTS.span(values).split(" to ")]
    assert (ends[0], ends[-1]) == pytest.approx((min(some), max(some)), rel=0.05)


def test_signed_depth_is_what_was_measured() -> None:
    for title in ("Sphere", "Menger sponge", "Thin slab, far away"):
        row = measured(title, "SignedDepth")
        layers, time, middle, worst = map(float, cells("signed_depth", title))
        assert layers == CASES[title]["layers"]
        assert time == pytest.approx(row["ratio"]["median"], abs=0.005)
        assert (middle, worst) == pytest.approx((row["thickness"]["median"], row["thickness"]["p999"]), rel=0.05)


def test_errors_of_light_are_what_was_measured() -> None:
    glass = measured("Glass knot", "TracedInterfaces, depth 12, 2 forks")
    assert float(cells("interfaces", "Glass knot")[3]) == pytest.approx(glass["sampled"]["rms"], rel=0.05)
    jade = measured("Ring of jade", "Diffusion, resolution 32")
    assert float(cells("scattering", "Ring of jade")[2]) == pytest.approx(jade["light"]["nrmse"], rel=0.05)


def test_the_worst_scene_is_in_the_choice_of_methods() -> None:
    rows = [measured(title, "ScatteringLayer") for title in CASES if "jade" in title or "Hollow ball" in title]
    line = next(line for line in TABLES["which"] if "flat layer" in line)
    assert MEASUREMENTS.number(max(row["light"]["nrmse"] for row in rows)) in line


def test_a_broken_promise_is_named() -> None:
    for claim in REPORT["claims"]:
        line = next(line for line in TABLES["claims"] if f"| {claim['text']} |" in line)
        assert ("| no |" in line) == (claim["held"] is False)


@pytest.mark.parametrize("name", [name for name in TABLES if name not in ("methods", "provenance")])
def test_rows_are_as_wide_as_their_header(name: str) -> None:
    assert len(TABLES[name]) > 3
    assert len({line.count("|") for line in TABLES[name]}) == 1


@pytest.mark.parametrize(
    ("built", "failed", "written"), [(True, False, "page"), (False, False, "picture"), (True, True, "")]
)
def test_the_front_page_has_a_scene_or_a_picture(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, built: bool, failed: bool, written: str
) -> None:
    live = extension("live_scene")

    def web_path(name: str) -> str:
        if not built:
            raise tl.InputError(name, "it is not built", "make web")
        return name

    monkeypatch.setattr(live, "web_path", web_path)
    monkeypatch.setattr(live, "write_scene", lambda path: path.write_text("page"))
    app = SimpleNamespace(builder=SimpleNamespace(name="html"), outdir=tmp_path, srcdir=DOCS)
    live.write_live(app, ValueError() if failed else None)
    page = tmp_path / "live.html"
    assert page.exists() == bool(written)
    if written == "picture":
        shown = re.findall(r'src="([^"]+)" alt="\w', page.read_text(encoding="utf-8"))
        assert [(tmp_path / name).exists() for name in shown] == [True]
    elif written:
        assert page.read_text(encoding="utf-8") == "page"


def test_the_reference_of_the_web_module_has_no_links_to_headings_that_are_too_deep() -> None:
    written = (
        "# name\n\n## Classes\n\n[`Pass`](#pass) takes [three](https://threejs.org) and [`Pass[]`](index.md#pass-2).\n"
    )
    written += "\n## References\n\nRe-exports [Pass](index.md#pass)\n"
    page = extension("typescript_reference").as_section(written, "translucent-three")
    assert page == "\n## Classes of `translucent-three`\n\n`Pass` takes [three](https://threejs.org) and `Pass[]`.\n\n"


def test_pages_include_what_is_written() -> None:
    written = {
        *TABLES,
        "presets",
        "blender",
        "typescript",
        "benchmark_machines",
        "benchmark_scores",
        "benchmark_thickness",
        "benchmark_truths",
    }  # by preset_reference, typescript_reference and benchmark_results
    included = set()
    for page in DOCS.rglob("*.md"):
        for path in re.findall(r"```\{include\} (\S+)", page.read_text(encoding="utf-8")):
            target = (page.parent / path).resolve()
            if target != ROOT / "CHANGELOG.md":
                assert target.parent == DOCS / "generated", (page, path)
                included.add(target.stem)
    assert included == written


#: A figure that somebody has measured, or a bound: a number with a unit of time or memory, a percentage, or a factor.
FIGURE = re.compile(
    r"(?<![\w.#/-])\d[\d.,]*(?: to \d[\d.,]*)? ?(?:%|(?:ms|s|us|µs|seconds?|minutes?|times|[kMG]B|megabytes?|fps)\b)"
)

#: Numbers that define something: limits, defaults and examples. What is measured is generated, or dated in docs/notes/.
DEFINED = {
    "docs/baking-files.md": {"2 %"},
    "docs/benchmark.md": {"0.5 %", "5 %", "10 %", "15 %", "97 %", "99 %", "99.9 %"},
    "docs/measurements/renderers.md": {"99 %"},
    "docs/baking.md": {"0.2 %", "64 times", "5 %", "35 %"},
    "docs/gltf.md": {"1.5 times", "3 times", "10 %", "25 %", "2 %", "5 %", "0.139 s", "1.17 s"},
    "docs/guides/sizes-and-units.md": {"10 %"},
    "docs/photographs.md": {"60 %", "1 %", "95 %", "10 %"},
    "docs/physics/interfaces.md": {"0.4 %", "0.5 %"},
    "docs/preview.md": {"0.1 %"},
    "docs/report-scenes.md": {"3 %", "15 %"},
    "docs/report.md": {"0.1 %"},
    "docs/scenes.md": {"1.5 seconds"},
}


def test_no_measured_figure_is_typed_by_hand() -> None:
    apart = ("docs/generated/", "docs/gallery_of_examples/", "docs/notes/")
    found = {}
    for path in (ROOT / "README.md", *DOCS.rglob("*.md")):
        name = path.relative_to(ROOT).as_posix()
        prose = re.sub(r"(?ms)^ *```.*?^ *```$", "", path.read_text(encoding="utf-8"))
        figures = set(FIGURE.findall(prose))
        if figures and not name.startswith(apart):
            found[name] = figures
    pages = {*found, *DEFINED}
    typed = {name: more for name in pages if (more := found.get(name, set()) - DEFINED.get(name, set()))}
    gone = {name: less for name in pages if (less := DEFINED.get(name, set()) - found.get(name, set()))}
    assert (typed, gone) == ({}, {})
