"""Tests of rendering, on whatever driver there is."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from translucent.errors import InputError
from translucent.gpu.context import DriverFaultError
from translucent.gpu.passes import light_views


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, None, None]:
    """Skip what the driver is known to end the process on, or has no buffers for, and say so."""
    try:
        return (yield)
    except DriverFaultError as error:
        pytest.skip(str(error))
    except InputError as error:
        if "this OpenGL has no shader storage buffers" not in str(error):
            raise
        pytest.skip(str(error))


@pytest.fixture(autouse=True)
def small_views(monkeypatch: pytest.MonkeyPatch) -> None:
    """Views from lights of a 16th of the usual number of texels: enough for the small pictures of tests."""
    monkeypatch.setattr(light_views, "_SIDES", (256, 128))


@pytest.fixture
def large_views(small_views: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Views from lights of the usual number of texels, for what is held to a ten-thousandth."""
    monkeypatch.setattr(light_views, "_SIDES", (1024,))
