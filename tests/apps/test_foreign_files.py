"""The command line on files that others made: what their names and links may do, and damaged files of every kind."""

from __future__ import annotations

import importlib
import json
import re
import sys
from pathlib import Path

import pytest

from tests.boxes import box_buffer, linked_box
from tests.command_line import Run, one_error_line
from translucent.commands import console

ROOT = Path(__file__).parents[2]
TITLE = "\x1b]0;owned\x07\u202e"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def test_names_in_files_command_no_terminal(run: Run, tmp_path: Path) -> None:
    (tmp_path / f"{TITLE}.obj").write_text(TRIANGLE)
    result = run("explain", tmp_path / f"{TITLE}.obj", "--preset", "jade")
    assert result.code == 0
    assert r"\x1b]0;owned\x07\u202e.obj" in result.out
    material = {"name": TITLE, "extensions": {"KHR_materials_volume": {"thicknessFactor": -1}}}
    (tmp_path / "a.gltf").write_text(json.dumps({"asset": {}, "materials": [material], "extensionsUsed": [TITLE]}))
    line = one_error_line(run("material", "show", tmp_path / "a.gltf"))
    assert r"\x1b]0;owned\x07\u202e" in line
    for text in (result.out, result.err, line):
        assert all(c.isprintable() or c == "\n" for c in text)


def test_an_error_line_is_no_longer_than_this(run: Run, tmp_path: Path) -> None:
    tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": ["x" * 9999]}]}
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    for arguments in (
        ["explain", tmp_path / "a.gltf"],
        ["explain", "y" * 999 + ".obj"],
        ["extinction", "z" * 999, "1cm"],
    ):
        assert len(one_error_line(run(*arguments))) <= len("error: ") + 300


def test_what_is_printed_goes_through_one_place() -> None:
    folder = Path(console.__file__).parent
    found = {
        path.name for path in [*folder.glob("*.py"), folder.parent / "cli.py"] if "click.echo(" in path.read_text()
    }
    assert found == {"console.py"}
    assert console._KEPT.sub("", "a\tb\n\x1b[48;2;1;2;3m        \x1b[0mc\x1b[0m") == "abc\x1b[0m"


@pytest.mark.parametrize(
    "arguments",
    [["explain"], ["material", "apply", "-o", "{}/out.glb", "--preset", "gummy"], ["bake", "-o", "{}/t.npy"]],
)
def test_links_lead_outside_only_where_that_is_said(run: Run, tmp_path: Path, arguments: list[str]) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "box.bin").write_bytes(box_buffer())
    (tmp_path / "model" / "a.gltf").write_text(json.dumps(linked_box("../box.bin")))
    words = [word.format(tmp_path) for word in arguments]
    small = ["--size", "8", "--rays", "2", "--unwrap"] if words[0] == "bake" else []
    line = one_error_line(run(*words, tmp_path / "model" / "a.gltf", *small))
    assert "leads outside the folder of the model; keep all files together, or add --allow-outside" in line
    assert {path.name for path in tmp_path.iterdir()} == {"model", "box.bin"}
    assert run(*words, tmp_path / "model" / "a.gltf", *small, "--allow-outside").code == 0


def test_damaged_files_are_read_or_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    fuzzer = importlib.import_module("fuzz_readers")
    try:
        kept = tmp_path / "kept"
        kept.mkdir()
        tally = fuzzer.fuzz(fuzzer.readers(tmp_path), 60, 7, tmp_path, kept)
    finally:
        for name in ("fuzz_readers", "fuzz_seeds"):
            sys.modules.pop(name, None)
    assert tally.faults == []
    assert re.match("60 runs: .* 0 faults", str(tally))
    assert tally.read > 3
    assert tally.refused > 33
