"""Faults of drivers that cannot be worked around, refused before they do harm, and how quickly they compile; see
``docs/drivers.md``.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from translucent.errors import RenderError


class DriverFaultError(RenderError):
    """Error for a request that would crash the process through a fault of the driver."""


def require_interfaces(info: Mapping[str, Any]) -> None:
    """Raise `DriverFaultError` where the driver crashes on the shading of interfaces.

    Lavapipe 22 reads before the first of its constant buffers where it inlines uniforms into that shader.
    """
    if str(info["GL_RENDERER"]).startswith("zink (llvmpipe") and "Mesa 22." in str(info["GL_VERSION"]):
        raise DriverFaultError(
            "interfaces of bodies with zink over lavapipe",
            f"this driver, {info['GL_VERSION']}, ends the process on them",
            "use another driver, a newer Mesa, or media without ior and surface",
        )


#: Mesa's variable that leaves out what makes the code of its software rasterizer faster (docs.mesa3d.org/envvars.html).
_QUICK = "GALLIVM_PERF", "nopt"


@contextmanager
def quick_compiles(wanted: bool) -> Iterator[None]:
    """Have an OpenGL that is opened meanwhile compile in half the time: the same picture, drawn a fifth slower.

    Mesa's software rasterizer does, where it is the first of its process, and the variable is not set otherwise.
    """
    name, value = _QUICK
    if not wanted or name in os.environ:
        yield
        return
    os.environ[name] = value
    try:
        yield
    finally:
        del os.environ[name]
