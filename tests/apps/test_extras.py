"""Packages that are missing: each verb names the extra that brings them, in one line, and leaves no file."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

import translucent as tl
from tests.bench.provenance import PROVENANCE
from tests.command_line import Run, one_error_line
from translucent.bench.record import Report
from translucent.extras import EXTRAS, require_package
from translucent.preview.document import Document
from translucent.preview.session import save_session

PROJECT = Path(__file__).parents[2] / "pyproject.toml"


@pytest.mark.parametrize(
    ("module", "extra", "arguments"),
    [
        ("OpenEXR", "exr", "render bear -o {}/t.exr --preset gummy"),
        ("OpenEXR", "exr", "render bear -o {}/t.png --preset gummy --environment {here}"),
        ("OpenEXR", "exr", "bake bear -o {}/t.exr"),
        ("OpenEXR", "exr", "bake bear --out-dir {}/maps"),
        ("pxr", "usd", "bake bear --usd {}/bear.usda"),
        ("xatlas", "bake", "bake bear -o {}/t.npy --size 16"),
        ("imageio_ffmpeg", "video", "render bear -o {}/t.mp4 --preset gummy --turntable 3"),
        ("distributed", "cluster", "bake bear --out-dir {}/maps --format npy --dask tcp://farm:8786"),
        ("jinja2", "report", "report -o {}/out"),
        ("markupsafe", "report", "report -o {}/out"),
        ("matplotlib", "report", "report -o {}/out"),
        ("imgui_bundle", "ui", "preview bear"),
    ],
)
def test_a_missing_package_is_told_with_its_extra(
    module: str,
    extra: str,
    arguments: str,
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    uninstalled: Callable[[str], None],
) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    (tmp_path / "sky.exr").write_bytes(b"")
    monkeypatch.setenv("DISPLAY", ":99")
    uninstalled(module)
    words = [word.format(folder, here=tmp_path / "sky.exr") for word in arguments.split()]
    line = one_error_line(run(*words), 1)
    assert f"the package {module} is not installed; pip install 'translucent-shading[{extra}]'" in line
    assert not list(folder.iterdir())


def test_a_report_without_what_its_packages_need_is_told(tmp_path: Path) -> None:
    """In a process of its own, where no module of the page has been imported yet."""
    (tmp_path / "old.json").write_text(Report(PROVENANCE, cases=(), seconds=1.0, complete=True).to_json())
    code = "import sys; sys.modules['markupsafe'] = None; from translucent.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "report", "--from", "old.json", "-o", "out"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "markupsafe is not installed; pip install 'translucent-shading[report]'" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_session_needs_its_package(tmp_path: Path, uninstalled: Callable[[str], None]) -> None:
    uninstalled("tomli_w")
    with pytest.raises(tl.RenderError, match=r"tomli_w is not installed; pip install 'translucent-shading\[ui\]'"):
        save_session(tmp_path / "s.toml", Document())


def test_a_package_may_lack_what_it_needs_or_be_broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "xatlas", raising=False)
    (tmp_path / "xatlas.py").write_text("import no_such_package")
    with pytest.raises(tl.RenderError, match="new UVs; the package xatlas needs no_such_package, which is not"):
        require_package("xatlas", "new UVs")
    (tmp_path / "xatlas.py").write_text("raise ImportError('libstdc++ is too old', name='xatlas')")
    with pytest.raises(tl.RenderError, match=r"cannot be imported \(libstdc\+\+ is too old\); pip install"):
        require_package("xatlas", "new UVs")


def test_every_extra_that_is_named_is_one() -> None:
    known = tomllib.loads(PROJECT.read_text())["project"]["optional-dependencies"]
    assert set(EXTRAS.values()) <= set(known)
    assert set(known) - {"all", "osmesa"} == set(EXTRAS.values())
