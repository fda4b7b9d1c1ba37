"""The still picture that goes on with random paths, until something changes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels, wait
from translucent.gpu import refinement
from translucent.preview.actions import OrbitBy, SetField
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.worker import Pool
from translucent.preview.workspace import Workspace


@pytest.fixture
def view() -> Iterator[ViewportRenderer]:
    made = ViewportRenderer()
    yield made
    made.close()


def test_a_still_picture_converges_until_something_changes(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refinement, "MOST_PATHS", 16)
    work.do(SetField("material.ior", 1.5))
    finish(view, work)
    interactive = pixels(view)
    assert view.paths.note == ""
    work.do(SetField("display.converge", True))
    told = []
    while view.draw(work, SIZE):
        told.append(view.paths.note)
    assert view.problem == ""
    assert "tracing the first paths" in told
    assert any(text.startswith("converging: 4 paths, standard error ") for text in told)
    assert view.paths.note.startswith("converged: 16 paths")
    scene = work.scene()
    assert scene is not None
    with view.current():
        truth = view.renderer.render(scene, SIZE, tl.PathTraced(16), samples=2)
    # They are the same paths, whatever the passes.
    assert np.abs(pixels(view) - truth.to_srgb8().astype(int)).max() <= 1
    assert np.abs(pixels(view) - interactive).mean() > 1.0
    noisy = pixels(view)
    given: list[np.ndarray] = []

    def call(_: Pool, task: object, work: object, radiance: np.ndarray, *arguments: object) -> np.ndarray:
        given.append(radiance)
        return np.full_like(radiance, 0.25)

    monkeypatch.setattr(Pool, "call", call)
    work.do(SetField("display.denoise", True))
    wait(work, lambda: not view.draw(work, SIZE) and "denoised after 16 paths" in view.paths.note)
    np.testing.assert_allclose(given[0], truth.radiance, rtol=1e-3, atol=1e-4)
    assert (pixels(view) == pixels(view)[0, 0]).all(), "what the denoiser made is on show"
    work.do(SetField("display.denoise", False))
    finish(view, work)
    np.testing.assert_array_equal(pixels(view), noisy)
    probe = view.probe(SIZE[0] // 2, SIZE[1] // 2)
    assert probe is not None
    assert probe.thickness == pytest.approx(truth.thickness[SIZE[1] // 2, SIZE[0] // 2], rel=1e-5)
    work.do(OrbitBy(20.0, 10.0))
    assert view.draw(work, SIZE)
    assert view.paths.note == ""
    work.do(OrbitBy(-20.0, -10.0))
    work.do(SetField("display.converge", False))
    finish(view, work)
    assert (np.abs(pixels(view) - interactive).max(axis=2) > 1).mean() < 2e-3


def test_what_paths_cannot_follow_stays_as_it_is_and_says_so(view: ViewportRenderer, work: Workspace) -> None:
    work.do(SetField("display.converge", True))
    work.do(SetField("display.mode", "thickness"))
    finish(view, work)
    assert view.paths.note == ""  # a quantity is as exact as it will be
    scene = work.scene()
    assert scene is not None
    body = scene.objects[0]
    hole = tl.Mesh(body.mesh.vertices, body.mesh.faces[1:])
    broken = tl.Scene([tl.Object(hole, body.medium)], scene.camera, environment=scene.environment)
    more, changed = view.paths.step(broken, view.renderer, view.viewport, 1.0, work)
    assert (more, changed) == (False, False)
    assert "not converging: PathTraced of" in view.paths.note
