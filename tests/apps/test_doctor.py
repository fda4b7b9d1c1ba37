"""``translucent doctor``, and what commands do on machines without OpenGL."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command_line import Run, one_error_line, strict_json


@pytest.fixture
def no_embree(uninstalled: Callable[[str], None]) -> None:
    uninstalled("embreex.mesh_construction")


@pytest.mark.usefixtures("renderer")
def test_doctor_tells_the_backend(run: Run) -> None:
    result = run("doctor")
    assert (result.code, result.err) == (0, "")
    assert re.search(r"^Rendering uses (egl|osmesa)\.$", result.out, re.MULTILINE)
    assert "numpy" in result.out


@pytest.mark.usefixtures("renderer")
def test_doctor_as_json(run: Run) -> None:
    result = run("doctor", "--json")
    told = strict_json(result.out)
    assert (result.code, result.err) == (0, "")
    assert told["backends"][told["backend"]]["works"] is True
    assert set(told["backends"]) == {"egl", "window", "osmesa", "cpu"}


# No OpenGL


@pytest.mark.filterwarnings("default::translucent.errors.TranslucentWarning")
def test_without_opengl_render_works_on_the_cpu_and_says_so(
    run: Run, cube: Path, tmp_path: Path, no_opengl: None
) -> None:
    result = run("render", cube, "-o", tmp_path / "cube.png", "--stage", "none", "--size", "4x4", "--json")
    assert result.code == 0
    (line,) = result.err.splitlines()
    assert line.startswith("warning: rendering on the CPU, because OpenGL is not available: OpenGL 3.3 context;")
    assert "`translucent doctor` explains this machine" in line
    assert strict_json(result.out)["provenance"]["backend"] == "cpu"
    assert (tmp_path / "cube.png").exists()


def test_without_opengl_and_embree_render_fails_in_one_line_that_says_what_to_do(
    run: Run, cube: Path, tmp_path: Path, no_opengl: None, no_embree: None
) -> None:
    result = run("render", cube, "-o", tmp_path / "cube.png", "--size", "4x4")
    line = one_error_line(result, code=1)
    assert (
        "OpenGL 3.3 context; no context could be created (tried egl: no such library; osmesa: no such library); apt-get"
        in line
    )
    assert not (tmp_path / "cube.png").exists()


def test_without_opengl_doctor_says_so(run: Run, no_opengl: None) -> None:
    result = run("doctor")
    assert (result.code, result.err) == (0, "")
    assert "OpenGL egl: no: no such library" in result.out
    assert "OpenGL 3.3 does not work without a window; install it: apt-get install" in result.out
    assert "Rendering uses cpu." in result.out


def test_without_opengl_and_embree_doctor_fails(run: Run, no_opengl: None, no_embree: None) -> None:
    result = run("doctor")
    assert result.code == 1
    assert result.err.splitlines() == ["error: rendering; neither OpenGL nor Embree works; see the lines above"]


def test_without_opengl_doctor_prints_one_json_object(run: Run, no_opengl: None, no_embree: None) -> None:
    result = run("doctor", "--json")
    assert result.code == 1
    assert strict_json(result.out)["backend"] is None
