"""Diagnosis of this machine: OpenGL, packages, and which features lack something."""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any, get_args

from translucent.errors import RenderError
from translucent.geometry.ray_caster import embree_versions
from translucent.gpu.context import Backend, NoContextError, open_context
from translucent.gpu.targets import SHADER_STORAGE
from translucent.threads import processors

#: Optional packages, and the purpose of each.
OPTIONAL = {
    "OpenEXR": "writing .exr files (pip install 'translucent-shading[exr]')",
    "imgui-bundle": "the window of translucent preview (pip install 'translucent-shading[ui]')",
    "xatlas": "baking meshes without texture coordinates (pip install 'translucent-shading[bake]')",
    "pyoidn": "pictures without noise, render --denoise (pip install 'translucent-shading[denoise]')",
    "usd-core": "USD stages, bake --usd (pip install 'translucent-shading[usd]')",
    "matplotlib": "the page of translucent report (pip install 'translucent-shading[report]')",
    "distributed": "baking on a Dask cluster (pip install 'translucent-shading[cluster]')",
    "imageio-ffmpeg": "turntables as .mp4 (pip install 'translucent-shading[video]')",
    "lavavu-osmesa": "a software OpenGL where the system has none (pip install --no-deps lavavu-osmesa)",
}
CORE = ("numpy", "scipy", "trimesh", "moderngl", "glcontext", "pillow", "click", "pyrender", "embreex")


@dataclass(frozen=True)
class BackendReport:
    """Report on one OpenGL backend: its properties, or why it does not work."""

    name: str
    works: bool
    detail: str


def examine_backends(names: Sequence[str] = get_args(Backend)) -> list[BackendReport]:
    """Try each backend in turn."""
    reports = []
    # The window first: it is whatever context is current, and the others leave theirs behind.
    for name in sorted(names, key=lambda name: name != "window"):
        try:
            context = open_context(name)
        except RenderError as error:
            detail = error.attempts[-1].error if isinstance(error, NoContextError) else str(error)
            reports.append(BackendReport(name, False, detail or ""))
            continue
        info = context.info
        detail = f"{context.renderer}; {info['GL_VERSION']}; textures up to {info['GL_MAX_TEXTURE_SIZE']}"
        if context.gl.version_code < SHADER_STORAGE:
            detail += "; no fragment lists, k-buffer or scattered light, because these need OpenGL 4.3"
        reports.append(BackendReport(name, True, detail))
        if name != "window":
            context.gl.release()
    reports.append(_examine_cpu())
    return reports


def _examine_cpu() -> BackendReport:
    try:
        found = embree_versions()
    except RenderError as error:
        return BackendReport("cpu", False, str(error))
    return BackendReport("cpu", True, f"Embree {found['embree']}, on {processors()} processors")


def examine() -> dict[str, Any]:
    """Facts about this machine, ready for JSON."""
    backends = examine_backends()
    usable = [report.name for report in backends if report.works and report.name != "window"]
    return {
        "translucent": _version("translucent-shading"),
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "packages": {name: _version(name) for name in CORE},
        "optional": {name: _version(name) for name in OPTIONAL},
        "backends": {report.name: {"works": report.works, "detail": report.detail} for report in backends},
        "backend": usable[0] if usable else None,
    }


def report(facts: dict[str, Any]) -> str:
    """The facts as text, with advice on whatever is missing."""
    lines = [
        f"translucent {facts['translucent']}, Python {facts['python']}, {facts['platform']}",
        "packages: " + ", ".join(f"{name} {found or 'MISSING'}" for name, found in facts["packages"].items()),
    ]
    for name, found in facts["optional"].items():
        lines.append(f"optional: {name} {found or 'not installed'}: {OPTIONAL[name]}")
    for name, state in facts["backends"].items():
        kind = "without OpenGL:" if name == "cpu" else "OpenGL"
        lines.append(f"{kind} {name}: {'works' if state['works'] else 'no'}: {state['detail']}")
    if facts["backend"] in (None, "cpu"):
        lines.append(
            "OpenGL 3.3 does not work without a window; install it: apt-get install libegl1 libgl1 "
            "libgl1-mesa-dri, or pip install --no-deps lavavu-osmesa (Linux x86-64)."
        )
    if facts["backend"] is not None:
        lines.append(f"Rendering uses {facts['backend']}.")
    return "\n".join(lines)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
