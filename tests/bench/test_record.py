"""Reports survive being written and read, and files that are no reports are refused."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bench.provenance import PROVENANCE
from translucent.bench.codec import Packed
from translucent.bench.output import read_report, write_csv, write_report
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
from translucent.errors import InputError


def full_report() -> Report:
    """Every kind of value that a report has."""
    errors = ErrorStatistics(1e-3, 2e-4, 3e-3, 4e-3, 5e-3, -1e-4)
    row = MethodRow(
        "SignedDepth",
        "SignedDepth",
        "SignedDepth()",
        "method",
        "exact",
        True,
        wall=TimeStatistics(1.0, 1.5, 0.1, 9),
        gpu=TimeStatistics(0.9, 1.4, 0.1, 9),
        frame=TimeStatistics(1.6, 2.0, 0.2, 9),
        ratio=Ratio(1.1, 0.1, 0.02),
        passes=1,
        bytes_per_pixel=61,
        thickness=errors,
        sampled=dataclasses.replace(errors, rms=7e-4),
        light=LightErrors(0.02, 0.01, (-0.1, -0.2, 0.3), 0.4),
        invalid=0.0,
        coverage_mismatch=0.0,
        pareto=True,
    )
    refused = MethodRow("BackFaceDepth", "BackFaceDepth", "", "method", "", False, refusal="two media")
    error = Packed.of(np.array([[0.0, 1e-9], [np.nan, -3e-3]]))
    picture = ReportPicture("SignedDepth", "aGk=", error, Packed.of(np.array([[True, False], [False, False]])))
    case = CaseRecord("knot", "Knot", "concave", "thickness", size=(64, 48), rows=(row, refused), pictures=(picture,))
    series = Series(
        "triangles",
        "SignedDepth",
        "SignedDepth",
        "512 x 512",
        (ScalePoint(1000, wall=TimeStatistics(1, 2, 0.5, 3)), ScalePoint(2)),
    )
    hard = HardCase("H07", "far away", "exact", "1e-7", True, 1e-7, 6e-6, "of the diagonal")
    unversioned = dataclasses.replace(PROVENANCE, commit=None, dirty=None)
    slab = Slab(0.9, 4.0, 0.5, 1.5, 0.4, 0.2, (0.0, 0.02), (0.41, 0.19), (0.38, 0.25), "diffusion")
    claim = Claim("fast", None, "-")
    return Report(unversioned, (case,), (series,), (hard,), (claim,), seconds=3.5, complete=True, slabs=(slab,))


def test_a_report_is_the_same_after_writing_and_reading(tmp_path: Path) -> None:
    report = full_report()
    write_report(report, tmp_path / "report.json")
    assert read_report(tmp_path / "report.json") == report
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999])
def test_a_truncated_file_says_so(share: float) -> None:
    text = full_report().to_json()
    with pytest.raises(InputError, match=r"old\.json; the file is cut off, or is not JSON \("):
        Report.from_json(text[: int(share * len(text))], "old.json")


@pytest.mark.parametrize("text", ["[]", "3", '{"rows": []}', '{"format": "glTF"}'])
def test_foreign_json_is_no_report(text: str) -> None:
    with pytest.raises(InputError, match="the file is JSON, but not a report"):
        Report.from_json(text)


def test_another_version_is_told() -> None:
    found = json.loads(full_report().to_json()) | {"version": 99}
    with pytest.raises(InputError, match="version 99, but this program reads version 1"):
        Report.from_json(json.dumps(found))


def broken(path: list[Any], value: Any) -> str:
    """The report with one value replaced, or left out where it is None."""
    found = json.loads(full_report().to_json())
    holder = found
    for key in path[:-1]:
        holder = holder[key]
    if value is None:
        del holder[path[-1]]
    else:
        holder[path[-1]] = value
    return json.dumps(found)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["seconds"], "long", r"seconds is 'long', not a number"),
        (["seconds"], True, r"seconds is True, not a number"),
        (["cases", 0, "rows", 0, "wall", "median"], float("nan"), r"NaN is not a JSON number"),
        (["cases", 0, "size"], [1, 2, 3], r"size is \[1, 2, 3\], not 2 values"),
        (["cases", 0, "quantity"], "mass", r"quantity is 'mass', not one of 'thickness'"),
        (["cases", 0, "rows", 1, "kind"], None, r"cases\[0\].rows\[1\].kind is missing"),
        (["provenance", "color"], "blue", r"provenance has unknown fields color"),
        (["color"], "blue", r"the report has unknown fields color"),
        (["provenance"], None, r"provenance is missing"),
        (["provenance"], [], r"provenance is \[\], not an object"),
        (["provenance", "seed"], 1.0, r"provenance.seed is 1.0, not int"),
        (["provenance", "seed"], "1", r"provenance.seed is '1', not int"),
        (["provenance", "seed"], False, r"provenance.seed is False, not int"),
        (["provenance", "command"], 3, r"provenance.command is 3, not str"),
        (["provenance", "versions"], [], r"provenance.versions is \[\], not an object"),
        (["provenance", "versions"], {"numpy": 2}, r"provenance.versions\['numpy'\] is 2, not str"),
        (["cases", 0, "rows"], [[]], r"cases\[0\].rows\[0\] is \[\], not an object"),
        (["cases", 0, "size"], "12", r"size is '12', not a list"),
        (["cases", 0, "size", 1], 0.5, r"cases\[0\].size\[1\] is 0.5, not int"),
        (["cases", 0, "rows", 0, "wall", "median"], "1 @ .x", r"rows\[0\].wall.median is '1 @ .x', not a number"),
        (["cases", 0, "pictures", 0, "png"], "!", r"cases\[0\].pictures\[0\] is damaged \("),
        (["cases", 0, "pictures", 0, "error", "shape"], [9, 9], r"pictures\[0\].error is damaged \(a shape of 9 x 9"),
        (["hard_cases", 0, "passed"], 1, r"passed is 1, not bool"),
        (["scaling"], {}, r"scaling is \{\}, not a list"),
        (["scaling"], "", r"scaling is '', not a list"),
        (["claims"], [0] * 100_000, "report.json; more than 100 values in the file are wrong"),
    ],
)
def test_a_wrong_field_is_named(path: list[Any], value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Report.from_json(broken(path, value))


def test_a_file_that_is_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no file has this path"):
        read_report(tmp_path / "none.json")
    (tmp_path / "picture").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_report(tmp_path / "picture")


def test_errors_of_all_sizes_keep_their_place_sign_and_first_digit(rng: np.random.Generator) -> None:
    error = rng.standard_normal((20, 30)) * 1e-8
    error[3, 4], error[0, 0] = np.nan, 0.0
    packed = Packed.of(error)
    found = packed.array()
    assert packed.shape == (20, 30)
    assert np.isnan(found[3, 4])
    assert found[0, 0] == 0
    known = np.isfinite(error)
    # Of float16's 11 bits the last 6 are cut off: a value loses at most 2^-4 of itself; below 2^-14 it is subnormal.
    assert (np.abs(found - error)[known] <= 2**-4 * np.abs(error[known]) + packed.scale * 2**-18).all()


def test_the_table_has_a_line_for_each_row(tmp_path: Path) -> None:
    write_csv(full_report(), tmp_path / "report.csv")
    with (tmp_path / "report.csv").open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    assert [line["method"] for line in lines] == ["SignedDepth", "BackFaceDepth"]
    assert float(lines[0]["thickness.rms"]) == 1e-3
    assert lines[0]["radiance.rms"] == ""
    assert lines[0]["light.bias"] == "-0.1 -0.2 0.3"
    assert lines[1]["refusal"] == "two media"
    assert lines[0]["size"] == "64x48"


def test_failures_are_listed_and_refusals_are_not() -> None:
    report = full_report()
    case = report.cases[0]
    bad = dataclasses.replace(case.rows[1], failure="out of memory")
    series = dataclasses.replace(report.scaling[0], points=(ScalePoint(4, failure="too large"),))
    lost = CaseRecord("model", "model", "", "thickness", failure="not closed")
    report = dataclasses.replace(
        report, cases=(dataclasses.replace(case, rows=(*case.rows, bad)), lost), scaling=(series,)
    )
    assert full_report().failures == ()
    assert report.failures == (
        "model: not closed",
        "knot / BackFaceDepth: out of memory",
        "triangles 4 / SignedDepth: too large",
    )
