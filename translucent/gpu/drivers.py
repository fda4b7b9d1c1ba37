"""Faults of drivers, avoided or refused before they do harm, and how quickly they compile; see ``docs/drivers.md``."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from translucent.errors import RenderError, TranslucentWarning


class DriverFaultError(RenderError):
    """Error for a request that would crash the process through a fault of the driver."""


def require_interfaces(info: Mapping[str, Any]) -> None:
    """Raise `DriverFaultError` where the driver crashes on the shading of interfaces, and of lit opaque surfaces.

    Lavapipe 22 reads before the first of its constant buffers where it inlines uniforms into that shader.
    """
    if str(info["GL_RENDERER"]).startswith("zink (llvmpipe") and "Mesa 22." in str(info["GL_VERSION"]):
        raise DriverFaultError(
            "interfaces of bodies, or surfaces of opaque objects in lights, with zink over lavapipe",
            f"this driver, {info['GL_VERSION']}, ends the process on them",
            "use another driver, a newer Mesa, or objects without ior and surface",
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


#: Bytes of the index that Mesa's cache of compiled shaders maps into memory (``disk_cache_os.c``), and of room for it
#: and for the shaders of a session, where there is none yet.
_INDEX, _ROOM = 8 + (20 << 16), 1 << 24


def avoid_full_cache() -> None:
    """Leave out Mesa's cache of compiled shaders in this process, with a warning, where the disk has no room for it.

    To be called before OpenGL is opened. Some builds of Mesa map an index that has no blocks on the disk yet, and
    a write to it ends the process by SIGBUS where the disk, or the user's quota, is full.
    """
    off = "MESA_SHADER_CACHE_DISABLE"
    if not sys.platform.startswith("linux") or os.environ.get(off, "").lower() in ("1", "true", "yes", "y", "t"):
        return
    for folder in _cache_folders():
        try:
            _allocate_cache(folder)
        except OSError as error:
            # Where Mesa may not write at all it leaves the cache out by itself.
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                continue
            os.environ[off] = "true"
            found = f"no room in {str(folder)!r} ({error.strerror})"
            do = "free some, or set MESA_SHADER_CACHE_DIR: shaders are not kept, so that each process compiles its own"
            warnings.warn(f"Mesa's cache of shaders; {found}; {do}", TranslucentWarning, stacklevel=2)
            return


def _cache_folders() -> list[Path]:
    """Folders in which Mesa may keep its cache: the one that is set, or that of the user, which versions take from
    ``HOME`` or from the system's list of users.
    """
    for name in ("MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR", "XDG_CACHE_HOME"):
        if name in os.environ:
            return [Path(os.environ[name])]
    found = {os.environ.get("HOME", "")}
    with suppress(KeyError):  # a user whom the system does not list
        import pwd

        found.add(pwd.getpwuid(os.getuid()).pw_dir)
    return [Path(home, ".cache") for home in sorted(found) if home]


def _allocate_cache(folder: Path) -> None:
    """Give the index of a cache all its blocks on the disk; where there is none yet, only try."""
    if sys.platform == "linux":  # for checkers of types: other systems lack posix_fallocate
        indices = list(folder.glob("mesa_shader_cache*/index"))
        for index in indices:
            with index.open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, _INDEX)
        if not indices:
            there = next(path for path in (folder, *folder.absolute().parents) if path.is_dir())
            with tempfile.TemporaryFile(dir=there) as file:
                os.posix_fallocate(file.fileno(), 0, _ROOM)
