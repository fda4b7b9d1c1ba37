"""Optional packages: the only place that imports them, with the extra that installs each."""

from __future__ import annotations

import importlib
from typing import Any

from translucent.errors import RenderError

#: The extra that installs a package, by the name of the package's module.
EXTRAS = {
    "OpenEXR": "exr",
    "anywidget": "notebook",
    "distributed": "cluster",
    "flip_evaluator": "benchmark",
    "imageio_ffmpeg": "video",
    "imgui_bundle": "ui",
    "jinja2": "report",
    "markupsafe": "report",
    "matplotlib": "report",
    "mitsuba": "truth",
    "pxr": "usd",
    "pyoidn": "denoise",
    "tomli_w": "ui",
    "traitlets": "notebook",
    "xatlas": "bake",
}


def install_command(extra: str) -> str:
    """The command that installs an extra."""
    return f"pip install 'translucent-shading[{extra}]'"


def require_package(module: str, asked: str, otherwise: str = "") -> Any:
    """Import a package of an extra.

    Parameters
    ----------
    module : str
        One of `EXTRAS`.
    asked : str
        What the error says was asked for.
    otherwise : str
        What the user can do instead of installing it.

    Returns
    -------
    module

    Raises
    ------
    RenderError
        If it, or a package that it needs, is missing or broken; the error names the extra.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing = (error.name or module).partition(".")[0]
        found = f"the package {module} is not installed"
        if missing != module:
            found = f"the package {module} needs {missing}, which is not installed"
        elif not isinstance(error, ModuleNotFoundError):
            found = f"the package {module} cannot be imported ({error})"
        do = install_command(EXTRAS[module])
        raise RenderError(asked, found, f"{do}, or {otherwise}" if otherwise else do) from error
