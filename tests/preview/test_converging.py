"""The still picture that goes on with random paths, until something changes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels
from translucent.gpu import convergence
from translucent.preview.actions import Change, Turn
from translucent.preview.stage import Stage
from translucent.preview.workspace import Workspace


@pytest.fixture
def stage() -> Iterator[Stage]:
    made = Stage()
    yield made
    made.close()


def test_a_still_picture_converges_until_something_changes(
    stage: Stage, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(convergence, "MOST_PATHS", 16)
    work.do(Change("material.ior", 1.5))
    finish(stage, work)
    interactive = pixels(stage)
    assert stage.converging.told == ""
    work.do(Change("display.converge", True))
    told = []
    while stage.draw(work, SIZE):
        told.append(stage.converging.told)
    assert stage.problem == ""
    assert "converging: the first paths" in told
    assert any(text.startswith("converging: 4 paths, standard error ") for text in told)
    assert stage.converging.told.startswith("converged: 16 paths")
    scene = work.scene()
    assert scene is not None
    with stage.current():
        truth = stage.renderer.render(scene, SIZE, tl.PathTraced(16), samples=2)
    # They are the same paths, whatever the passes.
    assert np.abs(pixels(stage) - truth.to_srgb8().astype(int)).max() <= 1
    assert np.abs(pixels(stage) - interactive).mean() > 1.0
    probe = stage.probe(80, 48)
    assert probe is not None
    assert probe.thickness == pytest.approx(truth.thickness[48, 80], rel=1e-5)
    work.do(Turn(20.0, 10.0))
    assert stage.draw(work, SIZE)
    assert stage.converging.told == ""
    work.do(Turn(-20.0, -10.0))
    work.do(Change("display.converge", False))
    finish(stage, work)
    assert (np.abs(pixels(stage) - interactive).max(axis=2) > 1).mean() < 2e-3


def test_what_paths_cannot_follow_stays_as_it_is_and_says_so(stage: Stage, work: Workspace) -> None:
    work.do(Change("display.converge", True))
    work.do(Change("display.mode", "thickness"))
    finish(stage, work)
    assert stage.converging.told == ""  # a quantity is as exact as it will be
    scene = work.scene()
    assert scene is not None
    body = scene.objects[0]
    hole = tl.Mesh(body.mesh.vertices, body.mesh.faces[1:])
    broken = tl.Scene([tl.Object(hole, body.medium)], scene.camera, environment=scene.environment)
    more, changed = stage.converging.step(broken, stage.renderer, stage.viewport, 1.0)
    assert (more, changed) == (False, False)
    assert "not converging: PathTraced of" in stage.converging.told
