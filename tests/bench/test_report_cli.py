"""``translucent report``: from a record to its files, what the changes are, and errors that leave all as it was."""

from __future__ import annotations

import dataclasses
import json
import signal
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.bench.conftest import HASTE
from tests.bench.provenance import PROVENANCE
from tests.command_line import Run
from translucent.assets import mesh_path
from translucent.bench.cases import effect_of, model_cases
from translucent.bench.record import CaseRecord, ErrorStatistics, MethodRow, Ratio, Report, TimeStatistics
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.scene.lights import DirectionalLight
from translucent.scene.showcase import showcase


@pytest.fixture
def run(run: Run) -> Run:
    return partial(run, "report")


def record(ratio: float = 1.1, rms: float = 3e-8, **more: Any) -> Report:
    timing, errors = TimeStatistics(10.0 * ratio, 11.0, 0.1, 9), ErrorStatistics(rms, rms, rms, rms, rms, 0.0)
    row = MethodRow(
        "SignedDepth", "SignedDepth", "SignedDepth()", "method", "exact", True, timing, ratio=Ratio(ratio, 0, 0)
    )
    case = CaseRecord("knot", "Knot", "concave", "thickness", rows=(dataclasses.replace(row, thickness=errors),))
    made = Report(PROVENANCE, cases=(case,), seconds=3.0, complete=True)
    return dataclasses.replace(made, **more)


@pytest.fixture
def new(tmp_path: Path) -> Path:
    path = tmp_path / "new.json"
    path.write_text(record().to_json())
    return path


FILES = ["report.csv", "report.html", "report.json", "report.svg"]


def test_a_page_is_made_again_from_its_record(run: Run, new: Path, tmp_path: Path) -> None:
    folder = tmp_path / "not there" / "yet"
    result = run("--from", new, "-o", folder)
    assert (result.code, result.err) == (0, "")
    assert sorted(path.name for path in folder.iterdir()) == FILES
    assert json.loads((folder / "report.json").read_text()) == json.loads(new.read_text())
    assert "knot" in result.out
    assert "1.10" in result.out
    assert str(folder / "report.html") in result.out


def test_without_a_folder_the_table_is_printed(run: Run, new: Path) -> None:
    result = run("--from", new)
    assert result.code == 0
    assert "SignedDepth" in result.out
    assert "÷ floor" in result.out


def test_json_is_one_object(run: Run, new: Path, tmp_path: Path) -> None:
    result = run("--from", new, "-o", tmp_path, "--json")
    found = json.loads(result.out)
    assert found["answers"] == [
        {"case": "knot", "method": "SignedDepth", "ratio": 1.1, "quantity": "thickness", "rms_error": 3e-8}
        | {"p999_error": 3e-8, "good_enough": True, "seen": None, "cheaper": None, "cheaper_seen": None}
    ]
    assert sorted(Path(path).name for path in found["files"]) == FILES
    assert found["changes"] is None
    assert found["agreement"] is None


def test_changes_are_told(run: Run, new: Path, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    old.write_text(record(ratio=0.6, rms=1e-9).to_json())
    result = run("--from", new, "--compare", old)
    assert result.code == 1, "what calls it wants to know without reading"
    assert "slower: knot / SignedDepth: 0.60 -> 1.10" in result.out
    assert "1 thing got worse; slower: knot / SignedDepth" in result.err
    assert result.err.count("\n") == 1
    assert run("--from", old, "--compare", new)[0] == 0, "faster is no failure"
    same = run("--from", new, "--compare", new)
    assert same.code == 0
    assert "no method became slower" in same.out
    assert "1 of 1 ratios to the floor (100.0%) agree within 15%" in same.out
    found = json.loads(run("--from", new, "--compare", old, "--json").out)
    assert [change["kind"] for change in found["changes"]] == ["slower"]
    assert found["agreement"] == {"ratios": 1, "within": 0, "farthest": "knot / SignedDepth, 0.60 and 1.10"}


def test_times_of_two_machines_are_no_comparison(run: Run, new: Path, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    old.write_text(record(provenance=dataclasses.replace(PROVENANCE, renderer="a GPU")).to_json())
    assert "warning: the two reports come from different machines" in run("--from", new, "--compare", old).err


def test_what_failed_is_told_and_the_rest_is_written(run: Run, tmp_path: Path) -> None:
    whole = record()
    broken = CaseRecord("mine", "Mine", "", "thickness", failure="12 holes")
    path = tmp_path / "part.json"
    path.write_text(dataclasses.replace(whole, cases=(broken, *whole.cases)).to_json())
    result = run("--from", path, "-o", tmp_path / "out")
    assert result.code == 1
    assert "12 holes" in result.err
    assert result.err.count("\n") == 1
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == FILES


def test_a_report_without_numbers_has_no_figure(run: Run, new: Path, tmp_path: Path) -> None:
    run("--from", new, "-o", tmp_path / "out")
    empty = tmp_path / "empty.json"
    empty.write_text(record(cases=()).to_json())
    assert run("--from", empty, "-o", tmp_path / "out").code == 0
    assert not (tmp_path / "out" / "report.svg").exists(), "an old figure beside a new page would be a lie"


@pytest.mark.parametrize("option", ["--from", "--compare"])
def test_a_truncated_record_is_an_error_before_any_work(run: Run, new: Path, tmp_path: Path, option: str) -> None:
    cut = tmp_path / "cut.json"
    cut.write_text(new.read_text()[:300])
    more = ["--from", new] if option == "--compare" else []
    result = run(option, cut, *more, "-o", tmp_path / "out")
    assert result.code == 2
    assert "cut.json; the file is cut off, or is not JSON (" in result.err
    assert result.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["a file", "a file/below"])
def test_a_folder_that_cannot_be_is_an_error_before_any_work(run: Run, new: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "a file").write_text("kept")
    result = run("--from", new, "-o", tmp_path / name)
    assert result.code == 2
    assert "a file' is not a folder; choose another path" in result.err
    assert (tmp_path / "a file").read_text() == "kept"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--from", "x.json", "-o", "out", "--quick"], "--from measures nothing, so this option has no effect"),
        (["--from", "x.json", "-o", "out", "knot"], "--from measures nothing, so this option has no effect"),
        (["--from", "x.json", "--preset", "jade"], "--from measures nothing, so this option has no effect"),
        (["--from", "x.json", "--only", "shadow"], "the report has no part 'shadow'; did you mean shadows?"),
        (
            ["knot", "--only", "shadows"],
            "a MODEL is measured as one of the scenes, so the part 'scenes' is needed; add the part scenes",
        ),
        (
            ["--preset", "jade"],
            "--preset jade; the command needs a MODEL for this medium, because the built-in scenes keep their own",
        ),
        (["knot", "--color", "teal"], "--distance is missing"),
        (["knot", "--preset", "skim_mlik"], "did you mean skim_milk"),
        (["--from", "absent.json", "-o", "out"], "no file has this path"),
        (["--limit", "0"], "--limit 0; the time must be above 0; give seconds, such as 600"),
        (["--from", "x.json", "--limit", "5"], "--from measures nothing, so this option has no effect"),
    ],
    ids=[
        *("from and quick", "from and a model", "from a medium", "no such part", "a model in no part"),
        *("no model", "no distance", "preset", "no file has this path", "no time", "from and a limit"),
    ],
)
def test_bad_usage(run: Run, arguments: list[str], message: str, tmp_path: Path, in_tmp_path: Path) -> None:
    result = run(*arguments)
    assert result.code == 2
    assert message in result.err
    assert not list(tmp_path.iterdir())


@pytest.fixture
def nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """The models that the test asks for, and none of the toolkit's scenes, sizes and hard cases."""
    from translucent.bench import run as measuring
    from translucent.bench.methods import MethodComparison

    def few(quick: bool, extra: Any = (), methods: Any = ()) -> Any:
        return (MethodComparison(extra, methods, quick),)

    monkeypatch.setattr(measuring, "experiments", few)
    monkeypatch.setattr(measuring, "QUICK", HASTE)


SMALL = ("--quick", "--size", "64x48", "--methods", "signed-depth,constant-thickness")


@pytest.mark.usefixtures("nothing_else", "empty_plots")
def test_a_part_is_measured_anew_in_an_old_report(run: Run, new: Path, tmp_path: Path) -> None:
    result = run("--from", new, "--only", "shadows,hard-cases", "-o", tmp_path / "out")
    assert (result.code, result.err) == (0, "")
    made = Report.from_json((tmp_path / "out" / "report.json").read_text())
    assert made.cases == record().cases
    (renewal,) = made.renewals
    assert renewal.parts == ("shadows", "hard-cases")
    assert renewal.provenance.command.startswith("translucent report -o")
    assert "--only shadows,hard-cases --from" in renewal.provenance.command
    assert "measured anew" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.usefixtures("nothing_else")
def test_a_model_of_the_user_is_measured(run: Run, tmp_path: Path) -> None:
    result = run("knot", "bear", "-o", tmp_path, *SMALL, "--json")
    assert result.code == 0
    answers = json.loads(result.out)["answers"]
    assert [(answer["case"], answer["method"]) for answer in answers] == [
        ("model knot", "SignedDepth"),
        ("model bear", "SignedDepth"),
    ]
    made = Report.from_json((tmp_path / "report.json").read_text())
    assert made.complete
    assert made.cases[0].size == (64, 48)
    assert {row.family for row in made.cases[0].rows} == {"depth only", "SignedDepth", "constant thickness"}
    assert made.provenance.command == (
        f"translucent report knot bear -o {tmp_path} --size 64x48 --methods signed-depth,constant-thickness --quick"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES


@pytest.mark.usefixtures("nothing_else", "empty_plots")
@pytest.mark.parametrize("medium", [["--preset", "merlot"], ["--color", "teal", "--distance", "5mm"]], ids=str)
def test_a_medium_for_the_model_says_what_would_be_seen_in_it(run: Run, tmp_path: Path, medium: list[str]) -> None:
    more = ("--quick", "--size", "64x48", "--methods", "signed-depth,thin-layer")
    result = run("bear", *medium, "-o", tmp_path, *more)
    assert result.code == 0
    assert "  with it, nobody would see the difference: no pixel is off by more than " in result.out
    made = Report.from_json((tmp_path / "report.json").read_text())
    rows = {row.method: row for row in made.cases[0].rows}
    assert made.cases[0].quantity == "thickness"
    # Interfaces, of ior 1.33, would cost the same on top of each method.
    assert made.cases[0].why == "a model of yours" + (", without its interfaces" if "merlot" in medium else "")
    assert rows["SignedDepth"].passes == 1
    assert all(word in made.provenance.command.split() for word in medium)
    assert rows["SignedDepth"].color_difference is not None
    assert rows["SignedDepth"].color_difference.max < 0.1
    assert rows["ThinLayer"].color_difference is not None
    assert rows["ThinLayer"].color_difference.median > 2.3
    page = (tmp_path / "report.html").read_text()
    assert "In this medium, nobody would see the difference" in page
    assert "color_difference.p999" in (tmp_path / "report.csv").read_text().splitlines()[0]


@pytest.mark.usefixtures("nothing_else", "empty_plots")
def test_interrupted_the_finished_scenes_are_written(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from translucent.bench.methods import MethodComparison

    measure = MethodComparison.measure

    def impatient(self: MethodComparison, bench: Any, case: Any) -> Any:
        if case.name == "model bear":
            raise KeyboardInterrupt
        return measure(self, bench, case)

    monkeypatch.setattr(MethodComparison, "measure", impatient)
    result = run("knot", "bear", "-o", tmp_path, *SMALL)
    assert result.code == 130
    assert "error: interrupted" in result.err
    made = Report.from_json((tmp_path / "report.json").read_text())
    assert [case.name for case in made.cases] == ["model knot"]
    assert "Not complete." in (tmp_path / "report.html").read_text()


@pytest.mark.skipif(sys.platform == "win32", reason="there a scene is finished")
@pytest.mark.usefixtures("nothing_else", "empty_plots")
def test_a_limit_ends_measuring_and_what_was_not_measured_is_named(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from translucent.bench.methods import MethodComparison

    now, left = [0.0], list[float]()

    def patient(self: MethodComparison, bench: Any, case: Any) -> Any:
        if case.name == "model bear":  # takes until the alarm
            left.append(signal.getitimer(signal.ITIMER_REAL)[0])
            now[0] += 3600.0
            signal.raise_signal(signal.SIGALRM)
        return self.blank(bench, case)

    monkeypatch.setattr(MethodComparison, "measure", patient)
    monkeypatch.setattr("translucent.commands.report.time", SimpleNamespace(monotonic=lambda: now[0]))
    result = run("knot", "bear", "shell", "-o", tmp_path, "--limit", "3600", *SMALL)
    assert result.code == 0
    assert len(left) == 1
    assert 0.0 < left[0] <= 3600.0
    assert result.err.splitlines() == [
        "preparing the report: the first measurement takes the longest",
        *(f"reading {name}" for name in ("knot", "bear", "shell")),
        "measuring 1 of 3: case model knot",
        "measuring 2 of 3: case model bear",
        "warning: not measured within 3600 s: case model bear, case model shell",
    ]
    made = Report.from_json((tmp_path / "report.json").read_text())
    assert [case.name for case in made.cases] == ["model knot"]
    assert made.unmeasured == ("case model bear", "case model shell")
    assert not made.complete
    assert "Not measured: case model bear, case model shell." in (tmp_path / "report.html").read_text()


@pytest.mark.usefixtures("nothing_else", "empty_plots")
def test_a_case_that_fails_leaves_the_others(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from translucent.bench.truth import CaseTruth

    trace = CaseTruth.of

    def failing(scene: Any, *arguments: Any) -> CaseTruth:
        if "knot" in scene.objects[0].mesh.name:
            raise RuntimeError("no luck")
        return trace(scene, *arguments)

    monkeypatch.setattr(CaseTruth, "of", failing)
    result = run("knot", "bear", "-o", tmp_path, *SMALL)
    assert result.code == 1
    assert "model knot: RuntimeError: no luck" in result.err
    assert "model bear" in result.out
    assert "no luck" in (tmp_path / "report.html").read_text()


@pytest.mark.usefixtures("nothing_else", "empty_plots")
def test_a_model_that_is_no_solid_is_a_row_that_failed(run: Run, tmp_path: Path) -> None:
    result = run("leaf", "bear", "-o", tmp_path, *SMALL)
    assert result.code == 1
    assert "measuring 'leaf'; no method can render it as solid:" in result.err
    assert "246 open edges" in result.err
    assert "model bear" in result.out
    assert "246 open edges" in (tmp_path / "report.html").read_text()


def test_models_of_one_name_are_told_apart() -> None:
    scene = showcase(load_mesh(mesh_path("bear")), stage="none")
    cases = model_cases({"a/x.stl": scene, "b/x.stl": scene, "c/y.stl": scene})
    assert [case.title for case in cases] == ["a/x.stl", "b/x.stl", "y.stl"]
    assert {case.effect for case in cases} == {"absorption"}


def test_what_no_font_can_show_of_a_files_name_is_escaped() -> None:
    (case,) = model_cases({"a/\x1b[31m\n.stl": showcase(load_mesh(mesh_path("bear")), stage="none")})
    assert (case.name, case.title) == (r"model \x1b[31m\n.stl", r"\x1b[31m\n.stl")


def test_media_decide_what_is_worth_measuring() -> None:
    mesh = load_mesh(mesh_path("bear"))
    mist = Medium(absorption=(1, 1, 1), scattering=(1, 1, 1))
    assert effect_of(showcase(mesh, mist, lights=[DirectionalLight((0, -1, 0), (1, 1, 1))])) == "scattering"
    assert effect_of(showcase(mesh, mist, stage="none")) == "absorption", "without a light there is nothing to scatter"
    assert effect_of(showcase(mesh, Medium(absorption=(1, 1, 1), emission=(1, 1, 1)), stage="none")) == "emission"
    scene = showcase(mesh, stage="none")
    sheet = dataclasses.replace(scene, objects=[dataclasses.replace(scene.objects[0], sheet_thickness=1e-3)])
    assert effect_of(sheet) == "sheet"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["absent.stl"], "absent.stl"),
        (["--size", "0x5"], "size"),
        (["--methods", "magic"], "method 'magic'; the report does not measure this method"),
        (["--backend", "magic"], "magic"),
    ],
    ids=["model", "size", "method", "backend"],
)
def test_bad_input_is_found_before_measuring(run: Run, tmp_path: Path, arguments: list[str], message: str) -> None:
    result = run("-o", tmp_path / "out", *arguments)
    assert result.code == 2
    assert message in result.err
    assert result.err.splitlines()[-1].startswith("error: ")
    assert result.err.count("error: ") == 1
    assert not (tmp_path / "out").exists()


def test_help_has_an_example(run: Run) -> None:
    assert "Example: translucent report" in run("--help").out
