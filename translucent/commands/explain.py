"""``translucent explain``: a mesh or a scene, and how it would be rendered; ``translucent doctor``: this machine."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.console import echo
from translucent.commands.model import SceneRequest, is_scene_file, medium_lines, models_argument, read_scene
from translucent.commands.options import BodyOptions, ChoiceOptions, FileOptions, stage_option
from translucent.commands.verbs import VerbCommand, common_options, group, option, takes
from translucent.errors import TranslucentError
from translucent.units import size_note, tall

if TYPE_CHECKING:
    from translucent.geometry.mesh import Mesh
    from translucent.gpu.pass_costs import FrameTraffic
    from translucent.planning.render_plan import RenderPlan
    from translucent.scene.scene import Object, Scene


@dataclass(frozen=True, kw_only=True)
class _ExplainedChoices(ChoiceOptions):
    method: str | None = option(
        metavar="NAME", help="Explain the plan for this method, instead of the planner's choice."
    )


@dataclass(frozen=True, kw_only=True)
class ExplainOptions:
    """Options of ``translucent explain``."""

    medium: BodyOptions = group(BodyOptions)
    file: FileOptions = group(FileOptions)
    stage: str | None = stage_option()
    choices: _ExplainedChoices = group(_ExplainedChoices, without=("thickness", "adaptive"))


@click.command(
    cls=VerbCommand,
    usual="color distance preset height stage method as_json",
    epilog="Example: translucent explain goblet",
)
@models_argument()
@takes(ExplainOptions)
def explain(model: str, given: ExplainOptions, as_json: bool) -> None:
    """Print facts about MODEL, and the plan to render MODEL.

    The plan lists the passes of the renderer, each with its reason, and the approximations. It is a plan for any
    picture: by its size, its samples and the OpenGL driver, render may add caustics, and let Embree find the hits.

    A .glb or .gltf file keeps its camera, lights and media. Several models, each with its material: goblet:crystal
    wine:red_wine.
    """
    from translucent.planning.plan import plan_scene

    requested = SceneRequest(
        medium=given.medium.read(),
        keeps_ior=given.medium.keeps_ior,
        change=given.medium.change,
        file=given.file,
        environment_shadows=given.choices.environment_shadows,
        roughness=given.medium.surface_roughness(),
        pattern=given.medium.surface_pattern,
        stage=given.stage,
    )
    scene, request = read_scene(model, requested), given.choices.read()
    chosen = plan_scene(scene, request) if scene.bodies else None
    if as_json:
        found = None if chosen is None else {**chosen.summary(), "traffic": _traffic(scene, chosen).summary()}
        echo(json.dumps({**_summary(model, scene), "plan": found}))
        return
    echo(_sentence(model, scene, chosen))
    if is_scene_file(model):
        _echo_scene(model, scene)
    else:
        _echo_mesh(scene.objects[0].mesh)
    if chosen is None:
        echo("plan: none, because no object is translucent; add --preset NAME, or --color C and --distance D")
    else:
        echo(f"plan: {chosen}")
        echo(str(_traffic(scene, chosen)))


def _sentence(model: str, scene: Scene, chosen: RenderPlan | None) -> str:
    """Answer in one sentence: whether and how the picture is made."""
    if chosen is None:
        return f"{Path(model).name} is opaque. To make it translucent, give it a medium."
    count = len(scene.bodies)
    what = f"{count} bod{'y' if count == 1 else 'ies'}"
    how = [
        "refracted and reflected light" if chosen.interfaces is not None else "straight rays",
        *(["multiple scattering"] if chosen.multiple_scattering else []),
        *(["random paths"] if chosen.paths is not None else []),
    ]
    exact = "is exact" if chosen.exact else "is not exact everywhere (see the limits below)"
    return (
        f"{Path(model).name} shows {what}, {tall(scene.shown_bounds)}, with {' and '.join(how)}, "
        f"in {len(chosen.passes)} passes; its thickness {exact}."
    )


def _summary(model: str, scene: Scene) -> dict[str, Any]:
    if not is_scene_file(model):
        return {"mesh": scene.objects[0].mesh.summary()}
    return {
        "objects": [
            {
                **item.mesh.summary(),
                "kind": _kind(item),
                "transform": item.matrix.tolist(),
                "extinction": None if item.medium is None else item.medium.extinction.tolist(),
            }
            for item in scene.shown
        ],
        "lights": len(scene.lights),
        "left_out": list(getattr(scene, "left_out", ())),
    }


def _kind(item: Object) -> str:
    if item.medium is None:
        return "opaque"
    if item.covers:
        return "layer"
    return "body" if item.sheet_thickness is None else "thin wall"


def _echo_mesh(mesh: Mesh) -> None:
    low, high = mesh.bounds
    echo(
        f"{mesh.name}: {len(mesh.vertices)} vertices, {len(mesh.faces)} faces, "
        f"{' x '.join(f'{v:.4g}' for v in high - low)} m"
    )
    echo(f"mesh: {mesh.diagnosis}")
    for repair in mesh.repairs:
        echo(f"repaired: {repair}")
    if note := size_note(mesh):
        echo(f"size: {note}")


def _echo_scene(model: str, scene: Scene) -> None:
    low, high = scene.shown_bounds
    echo(
        f"{model}: {len(scene.shown)} objects, {len(scene.bodies)} of them translucent, {len(scene.lights)} lights, "
        f"{' x '.join(f'{v:.4g}' for v in high - low)} m"
    )
    for item in scene.shown:
        kind, size = _kind(item), " x ".join(f"{v:.4g}" for v in item.bounds[1] - item.bounds[0])
        # Only what bounds a solid has to be closed.
        state = f"; {item.mesh.diagnosis}" if kind == "body" else ""
        echo(f"  {item.mesh.name!r}, {kind}: {len(item.mesh.faces)} faces, {size} m{state}")
        for repair in item.mesh.repairs if kind == "body" else ():
            echo(f"    repaired: {repair}")
    for line in medium_lines(scene):
        echo(f"medium: {line}")


def _traffic(scene: Scene, chosen: RenderPlan) -> FrameTraffic:
    from translucent.gpu.pass_costs import frame_traffic

    return frame_traffic(chosen)


@click.command(epilog="Example: translucent doctor")
@common_options
def doctor(as_json: bool) -> None:
    """Print facts about this machine: OpenGL and packages."""
    from translucent import doctor as examination

    facts = examination.examine()
    echo(json.dumps(facts) if as_json else examination.report(facts))
    if facts["backend"] is None:
        raise TranslucentError("rendering", "neither OpenGL nor Embree works", "see the lines above")
