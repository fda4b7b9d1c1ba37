"""``translucent explain``: what is known about a mesh or a scene, and how it would be rendered."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.console import echo
from translucent.commands.model import is_scene_file, medium_lines, read_scene
from translucent.commands.options import (
    caustics_option,
    common_options,
    draft_option,
    interface_options,
    medium_options,
    outside_option,
    paths_option,
    read_any_medium,
    read_caustics,
    read_interfaces,
    read_method,
    read_roughness,
    read_scattering,
    read_shadows,
    scattering_medium_options,
    scattering_options,
    shadow_options,
    stage_option,
    unit_option,
    with_environment_shadows,
)

if TYPE_CHECKING:
    from translucent.geometry.mesh import Mesh
    from translucent.gpu.traffic import FrameTraffic
    from translucent.planning.render_plan import RenderPlan
    from translucent.scene.scene import Object, Scene


@click.command(epilog="Example: translucent explain goblet")
@click.argument("model")
@medium_options
@scattering_medium_options
@unit_option
@outside_option
@draft_option
@stage_option
@click.option("--method", "method_name", metavar="NAME", help="Explain this method instead of the planner's choice.")
@paths_option
@interface_options
@scattering_options
@caustics_option
@shadow_options
@common_options
def explain(
    model: str,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None,
    scattering_color: str | None,
    mean_free_path: str | None,
    unit: str,
    allow_outside: bool,
    draft_extensions: bool,
    stage: str | None,
    method_name: str | None,
    paths: int | None,
    interfaces_name: str | None,
    interface_depth: int | None,
    interface_forks: int | None,
    scattering_name: str | None,
    diffusion_resolution: int | None,
    caustics: int | None,
    shadow_size: int | None,
    environment_shadows: int | None,
    as_json: bool,
) -> None:
    """Say what is known about MODEL, which passes would render it, and why.

    Of a .glb or .gltf file, the scene that it is, with the media of its materials.
    """
    from translucent.planning.plan import plan

    medium = read_any_medium(color, distance, preset_name, clamp, scattering_color, mean_free_path)
    roughness = read_roughness(None, preset_name)
    scene = read_scene(
        model,
        unit,
        medium,
        roughness=roughness,
        stage=stage,
        allow_outside=allow_outside,
        draft_extensions=draft_extensions,
    )
    scene = with_environment_shadows(scene, environment_shadows)
    method = read_method(method_name, None, paths)
    interfaces = read_interfaces(interfaces_name, interface_depth, interface_forks)
    scattering = read_scattering(scattering_name, diffusion_resolution)
    asked, shadows = read_caustics(caustics), read_shadows(shadow_size)
    chosen = None
    if scene.bodies:
        chosen = plan(scene, method, interfaces=interfaces, scattering=scattering, caustics=asked, shadows=shadows)
    if as_json:
        found = None if chosen is None else {**chosen.summary(), "traffic": _traffic(scene, chosen).summary()}
        echo(json.dumps({**_summary(model, scene), "plan": found}))
        return
    if is_scene_file(model):
        _tell_scene(model, scene)
    else:
        _tell_mesh(scene.objects[0].mesh)
    _tell_plan(scene, chosen)


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


def _tell_mesh(mesh: Mesh) -> None:
    low, high = mesh.bounds
    echo(
        f"{mesh.name}: {len(mesh.vertices)} vertices, {len(mesh.faces)} faces, "
        f"{' x '.join(f'{v:.4g}' for v in high - low)} m"
    )
    echo(f"mesh: {mesh.diagnosis}")
    for repair in mesh.repairs:
        echo(f"repaired: {repair}")


def _tell_scene(model: str, scene: Scene) -> None:
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
    from translucent.gpu.traffic import frame_traffic
    from translucent.planning.scattering.choice import shown

    return frame_traffic(shown(scene, chosen.given_back).with_ambient_emitted, chosen)


def _tell_plan(scene: Scene, chosen: RenderPlan | None) -> None:
    if chosen is None:
        echo("plan: none, since no object is translucent; see with --preset NAME, or --color C and --distance D")
    else:
        echo(f"plan: {chosen}")
        echo(str(_traffic(scene, chosen)))
