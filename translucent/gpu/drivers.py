"""Faults of drivers that cannot be worked around, refused before they do harm; see ``docs/drivers.md``."""

from __future__ import annotations

from collections.abc import Mapping
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
