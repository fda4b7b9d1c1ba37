"""Measure how near baked scattered light is to the light that diffuses in pictures.

``python tools/measure_scatter.py [MODEL...] [--preset NAME]...`` prints three things; default: bear and sphere of the
toolkit, in wax, jade and milk. The check of each bake, as `translucent bake --check` makes it. The error at the
vertices in the light of one round light, by its angular radius: what is lost beyond the second band. And, with
``--picture FILE``, that of the whole picture in the studio: mirror image of the environment plus what is baked, beside
`translucent render`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt
from PIL import Image

import translucent as tl
from translucent.assets import mesh_path
from translucent.bake.scatter import LitAlone, exit_radiance
from translucent.bake.scatter_job import Baked, check_scatter
from translucent.formulas.color import linear_to_srgb
from translucent.geometry.normals import vertex_normals
from translucent.scene.environment_map import texel_directions
from translucent.scene.scene import Scene
from translucent.scene.showcase import showcase, with_roughness

Array = npt.NDArray[np.float64]

#: Angular radii of the light in degrees, and where it is.
RADII, TOWARDS = (60, 30, 10), np.ones(3) / np.sqrt(3.0)

SIZE = (320, 320)

#: Extinction in 1/m of a body that shows only its mirrored light.
BLACK = 1e7


def round_light(radius: float) -> tl.Environment:
    """Darkness but for a round light."""
    inside = texel_directions(128, 256) @ TOWARDS > np.cos(np.radians(radius))
    return tl.Environment.image(inside[..., None] * np.ones(3))


def nrmse(found: Array, true: Array) -> float:
    return float(np.sqrt(((found - true) ** 2).mean()) / true.mean())


def of_round_lights(baked: tl.VertexScatter) -> str:
    alone = LitAlone(tl.Object(baked.mesh, medium=baked.medium, surface=tl.Surface(roughness=baked.roughness)), 32)
    errors = []
    for radius in RADII:
        true = exit_radiance(alone.field(round_light(radius)), baked.mesh.vertices, vertex_normals(baked.mesh))
        errors.append(f"{radius} degrees {nrmse(baked.radiance(round_light(radius).harmonics()), true):.1%}")
    return f"round light  {', '.join(errors)}"


def whole(baked: tl.VertexScatter, given_back: Array) -> tuple[Array, Array, float]:
    """The picture with what is baked, that of a renderer, and nRMSE where the body is."""
    behind = tl.Environment.constant(0.06)
    scene = showcase(baked.mesh, baked.medium, SIZE, environment=tl.Environment.studio().with_background(behind))
    scene = with_roughness(scene, baked.roughness)
    black = tl.Medium(absorption=BLACK, ior=baked.medium.ior)
    mirror: Scene = dataclasses.replace(scene, objects=[dataclasses.replace(scene.objects[0], medium=black)])
    with tl.Renderer() as renderer:
        true = renderer.render(scene, SIZE, samples=1, scattering=tl.Diffusion())
        found = renderer.render(mirror, SIZE, samples=1).radiance + given_back
    seen = given_back.any(axis=2)
    return found, np.asarray(true.radiance, np.float64), nrmse(found[seen], true.radiance[seen])


@click.command(help=__doc__)
@click.argument("models", nargs=-1)
@click.option("--preset", "presets", multiple=True, default=("wax", "jade", "whole_milk"), show_default=True)
@click.option("--picture", type=click.Path(path_type=Path), help="Baked and rendered, a column for each preset.")
def main(models: tuple[str, ...], presets: tuple[str, ...], picture: Path | None) -> None:
    columns = []
    for model in models or ("bear", "sphere"):
        mesh = tl.load_mesh(model if Path(model).suffix else mesh_path(model))
        for name in presets:
            preset = tl.preset(name)
            baked = tl.bake_vertex_scatter(mesh, preset.medium, roughness=preset.roughness or 0.0)
            check = check_scatter(Baked(baked, mesh, np.eye(3)), baked.values, SIZE)
            print(f"{model}, {name}", *str(check).split("\n"), of_round_lights(baked), sep="\n  ")
            if picture is not None:
                found, true, error = whole(baked, check["studio"].baked)
                print(f"  picture      nRMSE {error:.1%}")
                columns.append(np.concatenate([found, true]))
    if picture is not None:
        shown = linear_to_srgb(np.clip(0.7 * np.concatenate(columns, axis=1), 0.0, 1.0))
        Image.fromarray(np.rint(255.0 * shown).astype(np.uint8)).save(picture)


if __name__ == "__main__":
    main()
