"""What every test runs under: floating-point errors raise, seeds are fixed, and no OpenGL is a failure, not a skip."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

import translucent as tl
from tests.command_line import Result, Run
from translucent.cli import main

ASSETS = Path(__file__).parents[2] / "shared" / "assets"

settings.register_profile("project", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("project")


@pytest.fixture(autouse=True)
def floating_point_errors_raise() -> Iterator[None]:
    before = np.seterr(all="raise")
    yield
    np.seterr(**before)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240611)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs ``translucent`` in this process; a suite about one verb puts that before its arguments."""
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # the command line sets its own

    def _run(*arguments: object) -> Result:
        code = main([str(argument) for argument in arguments])
        return Result(code, *capsys.readouterr())

    return _run


@pytest.fixture(scope="session")
def assets() -> Path:
    """Third-party test data, which is not part of the project."""
    if not ASSETS.is_dir():
        pytest.skip(f"third-party test data is absent: no folder {ASSETS}")
    return ASSETS


@pytest.fixture(scope="session")
def renderer() -> Iterator[tl.Renderer]:
    from translucent.gpu.context import NoContextError

    try:
        made = tl.Renderer()
    except NoContextError as error:
        pytest.fail(f"these tests need OpenGL 3.3: {error}", pytrace=False)
    with made:
        yield made
