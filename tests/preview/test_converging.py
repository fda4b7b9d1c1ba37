"""The still picture that goes on with random paths, until something changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels, wait
from translucent.geometry.solids import Box, Sphere
from translucent.gpu import refinement
from translucent.gpu.renderer import read_paths
from translucent.gpu.viewport import Viewport
from translucent.preview.actions import OrbitBy, SetField
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.worker import Pool
from translucent.preview.workspace import Workspace
from translucent.scene.camera import Lens


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
    more, changed = view.paths.step(broken, view.renderer, view.viewport, 1.0, work, None)
    assert (more, changed) == (False, False)
    assert "not converging: PathTraced of" in view.paths.note


def test_paths_and_photons_are_out_of_focus_where_frames_are(view: ViewportRenderer) -> None:
    """Means over one lens; of a pinhole they are further than from each other."""
    size, lens, count = (32, 16), Lens(1.0, 3.0), 16
    ink = tl.Object(Sphere().tessellate(16), tl.Medium((0.4, 0.8, 1.2)))
    floor = tl.Object(Box((-4.0, -1.2, -4.0), (4.0, -1.1, 4.0)).tessellate(), color=(0.7, 0.7, 0.7))
    camera = tl.Camera.look_at((0, 3, 6), (0, -0.5, 0))
    dark = tl.Scene([ink], camera, environment=tl.Environment.studio())
    glass = dataclasses.replace(ink, medium=tl.Medium((0.1, 0.2, 0.4), ior=1.5))
    lit = tl.Scene([glass, floor], camera, [tl.DirectionalLight((0.4, -1.0, 0.2), 3.0)])

    def through(scene: tl.Scene, number: int) -> tl.Scene:
        return dataclasses.replace(scene, camera=lens.camera(scene.camera, size, number, count))

    def off(one: np.ndarray, other: np.ndarray) -> float:
        return float(np.sqrt(np.square(one - other, dtype=np.float64).mean()) / other.mean())

    with view.current():
        renderer, engine = view.renderer, view.renderer.gpu
        sharp = renderer.render(dark, size, samples=4).radiance
        soft = np.mean([renderer.render(through(dark, i), size, samples=4).radiance for i in range(count)], axis=0)
        paths = refinement.Convergence(engine, renderer.plan(dark, tl.PathTraced(2)), size, lens)
        while paths.paths < 32 * refinement.LENS_PATHS:
            paths.step(1.0)
        seen = read_paths(paths.job)[0]
        paths.release()
        assert off(seen, soft) < 0.4 * off(sharp, soft)

        viewport, photons = Viewport(engine), tl.Caustics(1 << 12)
        viewport.resize(size)
        plan = renderer.plan(lit, caustics=photons)
        for _ in range(1 + count):
            viewport.step(0, plan, 1, count, lens=lens)
        seeds = [dataclasses.replace(photons, seed=i) for i in range(1 + count)]
        views = [lit, *(through(lit, i) for i in range(count))]
        pictures = zip(views, seeds, strict=True)
        soft = np.mean([renderer.render(one, size, samples=1, caustics=by).radiance for one, by in pictures], axis=0)
        sharp = renderer.render(lit, size, samples=4, caustics=photons).radiance
        assert off(viewport.radiance(0), soft) < 0.5 * off(sharp, soft)
