"""The scripts and the notebook of examples/ run, and make what their pages show."""

from __future__ import annotations

import json
import runpy
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.little import with_few_shadows
from translucent.formulas.color import srgb_to_linear

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


@pytest.fixture(autouse=True)
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renderer: tl.Renderer) -> None:
    """Little pictures, with few shadows, by the one renderer that all tests share."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EXAMPLE_WIDTH", "48")
    with_few_shadows(monkeypatch)
    monkeypatch.setattr(tl, "Renderer", lambda: nullcontext(renderer))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_makes_its_picture(script: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = runpy.run_path(str(script), run_name="__main__")
    frame = names["frame"]
    assert frame.size == (48, 36)
    assert frame.valid[frame.coverage].all()
    assert 0.03 < frame.coverage.mean() < 0.7  # in view, and not cut off
    assert str(frame.plan) in capsys.readouterr().out
    with Image.open(tmp_path / f"{script.stem}.png") as picture:
        assert np.ptp(np.asarray(picture.convert("L"))) > 50  # neither all black nor all white


def test_every_script_names_one_concept() -> None:
    for script in SCRIPTS:
        title, line = script.read_text(encoding="utf-8").splitlines()[1:3]
        assert ": " in title, script
        assert line == "=" * len(title), script


@pytest.fixture
def no_windows() -> Iterator[None]:
    """Plots are drawn, and shown to nobody."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    before = mpl.get_backend()
    plt.switch_backend("agg")
    yield
    plt.close("all")
    plt.switch_backend(before)


@pytest.mark.usefixtures("no_windows")
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook: Path) -> None:
    names: dict[str, Any] = {}
    for i, cell in enumerate(json.loads(notebook.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{notebook.name}[{i}]", "exec"), names)
    assert names["errors"].rms < 1e-6 * names["bear"].diagonal
    sent = srgb_to_linear(np.array([0x7B, 0x1E, 0x3A]) / 255.0)
    np.testing.assert_allclose(names["wine"].transmittance(0.01), sent, rtol=1e-12)


def test_a_notebook_is_kept_without_results() -> None:
    for notebook in NOTEBOOKS:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), notebook
