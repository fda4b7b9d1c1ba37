"""The scripts and the notebook of examples/ run, and make what their pages show."""

from __future__ import annotations

import ast
import json
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.formulas.color import srgb_to_linear

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


@pytest.fixture(autouse=True)
def small(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    in_tmp_path: Path,
    few_shadows: None,
    coarse_light: None,
    one_renderer: None,
) -> None:
    """Little pictures, with few shadows and coarse light, by the one renderer that all tests share."""
    monkeypatch.setenv("EXAMPLE_WIDTH", "48")


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


def run_notebook(name: str) -> tuple[dict[str, Any], list[Any]]:
    """Names that a notebook leaves, and what its cells show."""
    names: dict[str, Any] = {}
    shown = []
    for i, cell in enumerate(json.loads((ROOT / "examples" / name).read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]), f"{name}[{i}]")
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, f"{name}[{i}]", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), f"{name}[{i}]", "eval"), names)
            if (show := getattr(value, "_repr_mimebundle_", None)) is not None:
                shown.append(show())
    return names, shown


@pytest.mark.usefixtures("no_windows")
def test_the_notebook_about_color_runs() -> None:
    names, (frame,) = run_notebook("color_at_a_distance.ipynb")
    assert "text/html" in frame[0]
    assert names["errors"].rms < 1e-6 * names["bear"].diagonal
    sent = srgb_to_linear(np.array([0x7B, 0x1E, 0x3A]) / 255.0)
    np.testing.assert_allclose(names["wine"].transmittance(0.01), sent, rtol=1e-12)


def test_the_notebook_about_notebooks_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renderer: tl.Renderer, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra notebook)")
    from translucent.notebook import view as module
    from translucent.notebook import view as showing

    gummy = tl.preset("gummy").medium
    told = {"extinction": gummy.extinction.tolist(), "ior": gummy.ior, "roughness": 0.0, "distance": 0.002}
    told["preset"] = ""
    (tmp_path / "widget.js").write_text("export default { render() {} };")  # no browser looks at it here
    monkeypatch.setattr(module, "web_path", lambda name: tmp_path / name)
    monkeypatch.setattr(module, "payload", lambda *_: b"")
    monkeypatch.setattr(module, "header_of", lambda _: {"scene": {"media": [told]}})
    monkeypatch.setattr(showing, "_renderer", lambda: renderer)
    monkeypatch.setattr(showing, "SIZE", (48, 36))
    names, shown = run_notebook("scene_in_a_notebook.ipynb")
    scene, frame, view, again = shown
    for data, metadata in (scene, frame, again):
        assert metadata["image/png"]["alt"] in data["text/html"]
    assert "application/vnd.jupyter.widget-view+json" in view[0]
    assert "the color is #" in capsys.readouterr().out
    whisky = names["shown"]
    assert whisky.size == (48, 36)
    body = names["view"].scene.bodies[0]
    np.testing.assert_allclose(body.medium.extinction, tl.preset("whisky").medium.extinction)
    covered = whisky.coverage & names["frame"].coverage
    np.testing.assert_allclose(whisky.thickness[covered], names["frame"].thickness[covered], rtol=1e-5)
    names["view"].close()


def test_each_notebook_has_a_test() -> None:
    assert [path.name for path in NOTEBOOKS] == ["color_at_a_distance.ipynb", "scene_in_a_notebook.ipynb"]


def test_a_notebook_is_kept_without_results() -> None:
    for notebook in NOTEBOOKS:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), notebook
