"""One picture from the command line, Python, the window and a page: what is asked for alike looks alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run
from tests.preview.waiting import wait
from translucent.assets import mesh_path
from translucent.cli import cli
from translucent.media.colors import parse_color
from translucent.page import write
from translucent.page.plans import PagePlan, plan_page
from translucent.planning.request import RenderRequest
from translucent.preview import exports
from translucent.preview.actions import Action, ChoosePreset, SetField, SetOrbit
from translucent.preview.document import Document, Export, Look, Model, orbit_of
from translucent.preview.exports import Recipe, python_code, write_picture
from translucent.preview.scenes import request_of
from translucent.preview.workspace import Workspace
from translucent.scene.scene import Scene

SIZE = (48, 36)
#: As few as show each of a picture's parts: see `test_as_many_samples_are_taken_wherever_none_are_asked_for`.
SAMPLES = 4

#: Options of the command line, arguments of `showcase`, and actions in the window.
CASES: dict[str, tuple[list[str], tuple[object, ...], list[Action]]] = {
    "color": (
        ["--color", "#ace5c9", "--distance", "4mm"],
        ("#ace5c9", 0.004),
        [
            SetField("material.color", parse_color("#ace5c9").tolist()),
            SetField("material.distance", 4e-3),
        ],
    ),
    "marble": (["--preset", "marble"], ("marble",), [ChoosePreset("marble")]),
}


@pytest.mark.parametrize("case", CASES)
def test_a_picture_is_the_same_from_wherever_it_is_asked_for(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    few_shadows: None,
    coarse_light: None,
    one_renderer: None,
    case: str,
) -> None:
    options, arguments, actions = CASES[case]
    sized = ("--size", f"{SIZE[0]}x{SIZE[1]}", "--samples", str(SAMPLES))
    assert run("render", "bear", "-o", tmp_path / "a.npz", *sized, *options).code == 0
    pictures = {"command line": tmp_path / "a.npz"}

    work = Workspace(Document(Model("bear"), look=Look(stage="auto"), export=Export(samples=SAMPLES)))
    work.size = SIZE
    wait(work, lambda: work.loaded is not None)
    for action in actions:
        work.do(action)
    wait(work, lambda: not work.relights)
    work._lighting.begun = True  # no picture is on show that the stage would come after
    wait(work, lambda: len(work.scene().objects) == 2)  # type: ignore[union-attr]
    # The window frames the model closer than a picture with the shadow: here it has the view of the others.
    mesh = tl.load_mesh(mesh_path("bear"))
    camera = _shown(mesh, arguments).camera
    work.do(SetOrbit(orbit_of(camera, work.scene().shown_bounds.mean(axis=0))))  # type: ignore[union-attr]
    scene, loaded = work.scene(), work.loaded
    assert scene is not None
    assert loaded is not None
    write_picture(str(tmp_path / "b.npz"), scene, SIZE, request=request_of(work.document), samples=SAMPLES)
    pictures["window"] = tmp_path / "b.npz"
    recipe = python_code(Recipe(work.document, loaded, scene, SIZE))
    monkeypatch.chdir(tmp_path)
    exec(recipe.replace("bear.png", "c.npz"), {})
    pictures["recipe of the window"] = tmp_path / "c.npz"
    work.close()

    recorded: list[PagePlan] = []

    def plan(scene: Scene, request: RenderRequest) -> PagePlan:
        recorded.append(plan_page(scene, request))
        return recorded[-1]

    monkeypatch.setattr("translucent.page.plans.plan_page", plan)
    monkeypatch.setattr("translucent.page.write.payload", lambda *_, **__: b"")  # no browser looks at it here
    assert run("page", "bear", "-o", tmp_path / "a.html", *sized, *options, "--poster", "none").code == 0
    with tl.Renderer() as renderer:
        renderer.render(recorded[0].scene, SIZE, samples=SAMPLES).save(tmp_path / "d.npz")
        pictures["page"] = tmp_path / "d.npz"
        renderer.render(_shown(mesh, arguments), SIZE, samples=SAMPLES).save(tmp_path / "e.npz")
        pictures["Python"] = tmp_path / "e.npz"
    radiance = {name: _radiance(path) for name, path in pictures.items()}
    for name, found in radiance.items():
        np.testing.assert_allclose(found, radiance["command line"], atol=1e-3, err_msg=name)


def test_as_many_samples_are_taken_wherever_none_are_asked_for() -> None:
    options = {
        (verb, option.name): option.default for verb in ("render", "page") for option in cli.commands[verb].params
    }
    told = {options["render", "samples"], options["page", "samples"], Document().export.samples}
    assert {*told, exports.SAMPLES, write.SAMPLES} == {16}


def _shown(mesh: tl.Mesh, arguments: tuple[object, ...]) -> Scene:
    medium, distance = (*arguments, None, None)[:2]
    return tl.showcase(mesh, medium, SIZE, distance=distance)  # type: ignore[arg-type]


def _radiance(path: Path) -> np.ndarray:
    with np.load(path) as arrays:
        return np.asarray(arrays["radiance"])
