"""Tables of the docs: they are written from the published report, and pages include what is written."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

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


def test_pages_include_what_is_written() -> None:
    written = {*TABLES, "presets", "blender"}  # the last two by preset_reference
    included = set()
    for page in DOCS.rglob("*.md"):
        for path in re.findall(r"```\{include\} (\S+)", page.read_text(encoding="utf-8")):
            target = (page.parent / path).resolve()
            if target != ROOT / "CHANGELOG.md":
                assert target.parent == DOCS / "generated", (page, path)
                included.add(target.stem)
    assert included == written
