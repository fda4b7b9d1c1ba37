"""Faults of drivers that are refused before they end the process."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import moderngl
import pytest

import translucent as tl
from translucent.errors import RenderError, TranslucentWarning
from translucent.geometry.solids import Sphere
from translucent.gpu import renderer as renderers
from translucent.gpu.context import avoid_full_cache, quick_compiles, require_interfaces

LAVAPIPE = {
    "GL_RENDERER": "zink (llvmpipe (LLVM 15.0.6, 256 bits))",
    "GL_VERSION": "4.5 (Core Profile) Mesa 22.3.6",
}


@pytest.mark.parametrize(
    "other", [{"GL_RENDERER": "llvmpipe (LLVM 15.0.6, 256 bits)"}, {"GL_VERSION": "4.6 (Core Profile) Mesa 24.0.1"}]
)
def test_only_the_driver_at_fault_is_refused(other: dict[str, str]) -> None:
    with pytest.raises(RenderError, match=r"lavapipe; this driver.*Mesa 22.3.6, crashes.*without ior and surface$"):
        require_interfaces(LAVAPIPE)
    require_interfaces(LAVAPIPE | other)


@pytest.mark.parametrize("interfaces", [None, tl.ScreenInterfaces()], ids=str)
def test_a_renderer_that_refuses_interfaces_goes_on(
    monkeypatch: pytest.MonkeyPatch, interfaces: tl.ScreenInterfaces | None
) -> None:
    from translucent.gpu.passes import interfaces as surfaces
    from translucent.gpu.passes import traced_interfaces

    def refuse(_: Any) -> None:
        require_interfaces(LAVAPIPE)

    monkeypatch.setattr(surfaces if interfaces else traced_interfaces, "require_interfaces", refuse)
    ball, camera = Sphere().tessellate(16), tl.Camera.look_at((1, 2, 3), (0, 0, 0))
    glass, dye = (tl.Scene([tl.Object(ball, tl.Medium(absorption=1.0, ior=ior))], camera) for ior in (1.5, 1.0))
    with tl.Renderer() as renderer:
        for _ in range(2):
            with pytest.raises(RenderError, match="crashes on them"):
                renderer.render(glass, (32, 24), interfaces=interfaces)
            assert renderer.render(dye, (32, 24), interfaces=interfaces).valid.all()


def test_quick_compiles_are_asked_for_while_a_context_opens_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GALLIVM_PERF", raising=False)
    with quick_compiles(False):
        assert "GALLIVM_PERF" not in os.environ
    with quick_compiles(True):
        assert os.environ["GALLIVM_PERF"] == "nopt"
    assert "GALLIVM_PERF" not in os.environ
    monkeypatch.setenv("GALLIVM_PERF", "brilinear")  # the user's word counts
    with quick_compiles(True):
        assert os.environ["GALLIVM_PERF"] == "brilinear"
    assert os.environ["GALLIVM_PERF"] == "brilinear"


linux = pytest.mark.skipif(sys.platform != "linux", reason="Mesa is Linux's")


@pytest.fixture
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Folder of Mesa's cache, which is not left out."""
    monkeypatch.setenv("MESA_SHADER_CACHE_DISABLE", "false")
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path))
    return tmp_path


def fail_with(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def fail(*_: Any) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "posix_fallocate", fail)


@linux
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("index", [False, True])
def test_a_full_cache_is_left_out_and_said_once(
    monkeypatch: pytest.MonkeyPatch, cache: Path, number: int, index: bool
) -> None:
    if index:
        (cache / "mesa_shader_cache_db").mkdir()
        (cache / "mesa_shader_cache_db" / "index").touch()
    fail_with(monkeypatch, number)
    with pytest.warns(
        TranslucentWarning,
        match=r"^Mesa's shader cache is not used; the disk of .* is full .*; free some space, or set MESA_SHA",
    ):
        avoid_full_cache()
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "true"
    avoid_full_cache()


@linux
def test_a_cache_that_mesa_cannot_write_is_left_to_mesa(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    fail_with(monkeypatch, errno.EROFS)
    avoid_full_cache()
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "false"


@linux
def test_the_index_of_a_cache_gets_its_blocks(cache: Path) -> None:
    avoid_full_cache()
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "false"
    assert not list(cache.iterdir())  # where there is none, none is made
    index = cache / "mesa_shader_cache" / "index"
    index.parent.mkdir()
    with index.open("wb") as file:
        file.write(b"what Mesa has written")
        file.truncate(8 + (20 << 16))
    avoid_full_cache()
    assert 512 * index.stat().st_blocks >= index.stat().st_size == 8 + (20 << 16)
    assert index.read_bytes().rstrip(b"\0") == b"what Mesa has written"


@linux
def test_a_frame_is_drawn_although_the_disk_of_the_cache_is_full(cache: Path) -> None:
    """Mesa without `posix_fallocate` ends by SIGBUS there."""
    code = (
        "import translucent as tl; from translucent.geometry.solids import Sphere\n"
        "scene = tl.showcase(Sphere().tessellate(12), tl.Medium(absorption=1.0), (12, 8), stage='none')\n"
        "tl.Renderer('egl').render(scene, (12, 8))"
    )
    mounted = 'mount -t tmpfs -o size=40k tmpfs "$MESA_SHADER_CACHE_DIR" || exit 77; exec "$@"'
    command = ["unshare", "-rm", "sh", "-c", mounted, "sh", sys.executable, "-c", code]
    if shutil.which("unshare") is None:
        pytest.skip("no unshare: the disk of the cache cannot be full")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 77 or "unshare" in done.stderr or "NoContextError" in done.stderr:
        pytest.skip(f"no mounts for a single process, or no OpenGL by EGL: {done.stderr}")
    assert done.returncode == 0, done.stderr
    assert "Mesa's shader cache is not used; the disk of" in done.stderr


@pytest.mark.parametrize("words", ["the framebuffer is not complete (UNSUPPORTED)", "cannot create texture"])
def test_what_opengl_has_no_memory_for_is_called_so(monkeypatch: pytest.MonkeyPatch, words: str) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise moderngl.Error(words)

    scene = tl.Scene(
        [tl.Object(Sphere().tessellate(4), tl.Medium(absorption=1.0))], tl.Camera.look_at((3, 0, 0), (0, 0, 0))
    )
    with tl.Renderer() as renderer:
        monkeypatch.setattr(renderers, "FrameJob", fail)
        with pytest.raises(RenderError) as error:
            renderer.render(scene, (4, 4))
        assert (
            str(error.value)
            == f"rendering; OpenGL does not have enough memory for the picture ({words}); choose a smaller picture"
        )
