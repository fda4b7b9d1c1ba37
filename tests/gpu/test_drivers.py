"""Faults of drivers that are refused before they end the process."""

from __future__ import annotations

import os
from typing import Any

import pytest

import translucent as tl
from translucent.errors import RenderError
from translucent.geometry.solids import Sphere
from translucent.gpu.drivers import quick_compiles, require_interfaces

LAVAPIPE = {
    "GL_RENDERER": "zink (llvmpipe (LLVM 15.0.6, 256 bits))",
    "GL_VERSION": "4.5 (Core Profile) Mesa 22.3.6",
}


@pytest.mark.parametrize(
    "other", [{"GL_RENDERER": "llvmpipe (LLVM 15.0.6, 256 bits)"}, {"GL_VERSION": "4.6 (Core Profile) Mesa 24.0.1"}]
)
def test_only_the_driver_at_fault_is_refused(other: dict[str, str]) -> None:
    with pytest.raises(
        RenderError, match=r"lavapipe; this driver.*Mesa 22.3.6, ends the process.*without ior and surface$"
    ):
        require_interfaces(LAVAPIPE)
    require_interfaces(LAVAPIPE | other)


@pytest.mark.parametrize("interfaces", [None, tl.ScreenInterfaces()], ids=str)
def test_a_renderer_that_refuses_interfaces_goes_on(
    monkeypatch: pytest.MonkeyPatch, interfaces: tl.ScreenInterfaces | None
) -> None:
    from translucent.gpu.passes import surfaces, traced_interfaces

    def refuse(_: Any) -> None:
        require_interfaces(LAVAPIPE)

    monkeypatch.setattr(surfaces if interfaces else traced_interfaces, "require_interfaces", refuse)
    ball, camera = Sphere().tessellate(16), tl.Camera.look_at((1, 2, 3), (0, 0, 0))
    glass, dye = (tl.Scene([tl.Object(ball, tl.Medium(absorption=1.0, ior=ior))], camera) for ior in (1.5, 1.0))
    with tl.Renderer() as renderer:
        for _ in range(2):
            with pytest.raises(RenderError, match="ends the process"):
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
