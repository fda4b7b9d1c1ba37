"""Paths of the files in ``shaders/``, ``meshes/`` and ``scenes/``, and of what is built out of ``web/``: beside the
package in an installed wheel, else in the checkout.
"""

from __future__ import annotations

from pathlib import Path

from translucent.errors import InputError

_PACKAGE = Path(__file__).parent


def shader_path(name: str) -> Path:
    """Path of a shader file such as ``lib/optics.glsl``; raises `InputError` where there is none."""
    path = _folder("shaders") / name
    if not path.is_file():
        raise InputError(
            f"shader {name!r}", f"this file is missing in {_folder('shaders')}", "reinstall translucent-shading"
        )
    return path


def shader_library() -> list[Path]:
    """The files of ``shaders/lib``, sorted."""
    return sorted((_folder("shaders") / "lib").glob("*.glsl"))


def shader_names() -> list[str]:
    """Names of all shader files, as `shader_path` takes them: stages, and the files that they include."""
    folder = _folder("shaders")
    files = (path for path in folder.rglob("*.*") if path.suffix in (".vert", ".frag", ".glsl"))
    return sorted(path.relative_to(folder).as_posix() for path in files)


def newest_shader() -> float:
    """Time at which a shader file was last written, in seconds since 1970."""
    newest = 0.0
    for path in _folder("shaders").rglob("*.[gvf]*"):
        try:
            newest = max(newest, path.stat().st_mtime)
        except OSError:
            continue  # it is being written
    return newest


def mesh_path(name: str) -> Path:
    """Path of a mesh that comes with the toolkit, such as ``goblet``; raises `InputError` where there is none."""
    for path in _mesh_files():
        if path.stem == name:
            return path
    raise InputError(f"mesh {name!r}", "no built-in mesh has this name", f"use one of {', '.join(mesh_names())}")


def mesh_names() -> list[str]:
    """Names of the meshes that come with the toolkit."""
    return [path.stem for path in _mesh_files()]


def scene_path(name: str) -> Path:
    """Path of a scene that comes with the toolkit, such as ``glass-of-wine``; raises `InputError` for other names."""
    path = _folder("scenes") / f"{name}.toml"
    if name not in scene_names():
        raise InputError(f"scene {name!r}", "no built-in scene has this name", f"use one of {', '.join(scene_names())}")
    return path


def scene_names() -> list[str]:
    """Names of the scenes that come with the toolkit."""
    return sorted(path.stem for path in _folder("scenes").glob("*.toml"))


def web_path(name: str) -> Path:
    """Path of a file that browsers run, such as ``page.js``; raises `InputError` where it was not built."""
    path = _web_folder() / name
    if not path.is_file():
        found = f"the file {path} does not exist, because it must be built"
        raise InputError(
            f"the script {name!r} for browsers", found, "build the script: run `make web` in the checkout (needs npm)"
        )
    return path


def _web_folder() -> Path:
    installed = _PACKAGE / "web"
    return installed if installed.is_dir() else _PACKAGE.parent / "web" / "dist"


def _mesh_files() -> list[Path]:
    return sorted(path for path in _folder("meshes").iterdir() if path.suffix in {".ply", ".glb", ".obj"})


def _folder(kind: str) -> Path:
    installed = _PACKAGE / kind
    return installed if installed.is_dir() else _PACKAGE.parent / kind
