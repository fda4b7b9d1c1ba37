"""Tests of rendering, on whatever driver there is."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from translucent.errors import InputError
from translucent.gpu.context import DriverFaultError


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
