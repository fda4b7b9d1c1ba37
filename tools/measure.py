"""Experiments beside those of the report, printed as its tables, or as its page with ``-o``.

``python tools/measure.py NAME [-o DIR] [--only TEXT] [--paths N] [--seconds S]``, with one of these names:

- clouds: light that is scattered many times in clouds and fog, and in uneven and thin bodies behind interfaces: errors
  of the planner's choice and of single scattering, against path traced truth
- densities: time and error of marching through a cloud of 64^3 voxels at 512 x 512
- frame: cost of a frame against a depth-only pass over its triangles: the passes that find thickness, the whole
  drawing (``frame``), and `Renderer.render` with its read-back, with radiance, thickness and validity or all arrays
- photons: caustics in fog, wax and milk, against random paths; ``--paths`` is a fraction of those of the report
- scattering: light that is scattered once, by points of fragment lists and by marching, with the depth towards lights
  from the same lists, and voxel by voxel as it is done where there are no lists
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import numpy.typing as npt
import trimesh
from scipy.ndimage import gaussian_filter

import translucent as tl
from translucent.bench.cases import CASES, Case
from translucent.bench.caustics import MediumCaustics
from translucent.bench.contenders import Contender
from translucent.bench.drawing import BenchContext, Drawing, Effort, FrameDrawing, Size
from translucent.bench.experiment import Experiment
from translucent.bench.methods import MethodComparison
from translucent.bench.output import checked_folder, table, write_outputs
from translucent.bench.record import Report
from translucent.bench.run import measured, opened, provenance
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.targets import Targets
from translucent.media.density import Density
from translucent.planning.render_plan import RenderPlan

SUN = tl.DirectionalLight((-1, -0.7, -0.3), (3, 3, 3))
SKY = tl.Environment.gradient((0.2, 0.1, 0.05), (1, 1, 1))
DARK = tl.Environment.constant((0, 0, 0))
CLOUD, FOG = (0.99, 0.98, 0.96), (0.99, 0.95, 0.8)  # albedos

#: The planner's choice.
PLANNED = Contender(name="planned", family="planned", choices={"method": None})


def puffs(voxels: int = 40) -> tl.DensityGrid:
    """A ball of noise with nothing around it."""
    place = (np.arange(voxels) + 0.5) / voxels - 0.5
    radius = np.linalg.norm(np.stack(np.meshgrid(place, place, place)), axis=0)
    noise = gaussian_filter(np.random.default_rng(0).normal(size=(voxels,) * 3), voxels / 14, mode="wrap")
    return tl.DensityGrid(np.clip((0.42 - radius) * 8 + 0.5 * noise / noise.std(), 0, 1))


def milky(extinction: float, albedo: tuple[float, ...], anisotropy: float, ior: float = 1.0) -> tl.Medium:
    """Medium of such an extinction in 1/m."""
    bright = np.array(albedo)
    return tl.Medium(extinction * (1 - bright), extinction * bright, anisotropy=anisotropy, ior=ior)


def under(body: tl.Object, eye: tuple[float, float, float], fov_y: float, lit: bool) -> tl.Scene:
    """A body in the sun, or in the light of a sky."""
    camera = tl.Camera.look_at(eye, (0, 0, 0), fov_y=fov_y)
    return tl.Scene([body], camera, [SUN] if lit else [], DARK if lit else SKY)


def cloud(extinction: float, density: Density, anisotropy: float, lit: bool) -> tl.Scene:
    """A box, half a metre wide, with a density of such a largest extinction."""
    half = np.diag([0.5, 0.5, 0.5, 1.0])
    body = tl.Object(Box().tessellate(), milky(extinction, CLOUD, anisotropy), half, density=density)
    return under(body, (0.6, 0.5, 2.2), 24.0, lit)


def behind(extinction: float, density: Density | None, anisotropy: float) -> tl.Scene:
    """A ball with an interface, of such a largest reduced extinction."""
    full = extinction / (1 - np.array(FOG) * anisotropy)
    medium = tl.Medium(full * (1 - np.array(FOG)), full * np.array(FOG), anisotropy=anisotropy, ior=1.5)
    return under(tl.Object(Sphere().tessellate(48), medium, density=density), (0.5, 0.8, 4), 32.0, lit=False)


def cloudy() -> Iterator[tuple[str, tl.Scene]]:
    """Clouds, fog and uneven bodies, with their names."""
    ball = Sphere().tessellate(32)
    for lit in (False, True):
        light = "sun" if lit else "sky"
        for extinction, anisotropy in ((4.0, 0.0), (16.0, 0.0), (40.0, 0.8)):
            name = f"cloud, extinction {extinction:g}, g {anisotropy:g}, {light}"
            yield name, cloud(extinction, puffs(), anisotropy, lit)
        yield f"linear profile, extinction 16, {light}", cloud(16.0, tl.LinearDensity(1, 1.0, 0.05), 0.0, lit)
        for depth, anisotropy in ((0.5, 0.0), (2.0, 0.0), (8.0, 0.0), (8.0, 0.7), (20.0, 0.0), (200.0, 0.0)):
            fog = tl.Object(ball, milky(0.5 * depth, FOG, anisotropy))
            yield f"ball of depth {depth:g}, g {anisotropy:g}, {light}", under(fog, (0, 1, 4), 32.0, lit)
    sides = tl.DensityGrid(np.where(np.arange(32) < 16, 0.1, 1.0).reshape(32, 1, 1))
    for anisotropy in (0.0, 0.8):
        for what, density in (("even", None), ("linear", tl.LinearDensity(1, 1.0, 0.1)), ("two halves", sides)):
            yield f"behind an interface, {what}, g {anisotropy:g}", behind(10.0, density, anisotropy)
    for depth in (0.2, 0.4):
        yield f"behind an interface, thin, {depth:g} / m, g 0.9", behind(depth, None, 0.9)


def case_of(name: str, scene: tl.Scene, **more: Any) -> Case:
    """Case of a scene, for any size of the picture."""
    return Case(name, name, name, lambda _: scene, **more)


def clouds(paths: float) -> Experiment[Any]:
    """Clouds and fog; 192 paths of each pixel."""
    half = round((paths or 192) / 2)
    cases = [
        case_of(name, scene, effect="multiple scattering", compared=24, paths=half, stored=False)
        for name, scene in cloudy()
    ]
    once = Contender(name="once", family="SingleScattering", choices={"scattering": tl.SingleScattering()})
    return MethodComparison(cases, chosen=(PLANNED, once))


def densities(paths: float) -> Experiment[Any]:
    """A cloud that fades towards the boundary; the reference of the lit one takes long."""
    x, y, z = 2.0 * (np.indices((64,) * 3) + 0.5) / 64 - 1.0
    noise: npt.NDArray[np.float64] = 1.0 + 0.8 * np.sin(10 * x) * np.sin(11.5 * y + 1.0) * np.sin(8.5 * z)
    density = tl.DensityGrid(2.0 * np.maximum(1.0 - x**2 - y**2 - z**2, 0.0) * noise)
    medium = tl.Medium(absorption=(0.5, 1, 2), scattering=(4, 3, 2), emission=(0.1, 0.2, 0.1), anisotropy=0.3)
    body = tl.Object(Sphere(radius=1).tessellate(64), medium, density=density)
    cases = []
    for name, lights in (("no light", []), ("one light", [tl.DirectionalLight((-0.3, -1, 0.2), (2, 2, 2))])):
        scene = tl.Scene([body], tl.Camera.look_at((1, 1.5, 3), (0, 0, 0)), lights)
        cases.append(case_of(name, scene, effect="density", compared=32 if lights else 512, tolerance=1e-5))
    marched = [Contender(name=f"{n} steps", family="RayMarched", method=tl.RayMarched(n)) for n in (16, 64, 256)]
    return MethodComparison(cases, chosen=marched)


@dataclass(frozen=True, kw_only=True)
class Rendered(Contender):
    """`Renderer.render` with its read-back, and radiance, thickness and validity taken, or all arrays."""

    every: bool

    def drawing(self, bench: BenchContext, scene: tl.Scene, plan: RenderPlan, targets: Targets) -> Drawing:
        """Drawing of whole frames."""

        def make() -> tl.Frame:
            frame = bench.renderer.render(scene, targets.size)
            _ = frame.arrays if self.every else (frame.radiance, frame.thickness, frame.valid)
            return frame

        return FrameDrawing(bench, make)


def frame(paths: float) -> Experiment[Any]:
    """An icosphere of 81,920 triangles, and scenes of the report."""
    ball = trimesh.creation.icosphere(subdivisions=6)
    body = tl.Object(tl.Mesh(ball.vertices, ball.faces), tl.Medium.from_color((0.2, 0.6, 0.4), distance=1.0))
    scene = tl.Scene([body], tl.Camera.look_at((0.0, 0.0, 3.2), (0.0, 0.0, 0.0)))
    known = [replace(case, compared=64) for case in CASES if case.name in ("knot", "two media", "slab")]
    choice = {"method": None}
    rendered = [
        Rendered(name=name, family="planned", choices=choice, every=name == "all arrays")
        for name in ("rendered", "all arrays")
    ]
    return MethodComparison([case_of("ball", scene, compared=64), *known], chosen=(PLANNED, *rendered))


@dataclass(frozen=True, kw_only=True)
class InVoxels(Contender):
    """March through a body that is a grid of voxels, all of density 1, so that the picture is the same."""

    def scene(self, scene: tl.Scene) -> tl.Scene:
        """The scene of voxels."""
        density = tl.DensityGrid(np.ones((32,) * 3))
        return replace(scene, objects=[replace(scene.objects[0], density=density)])


def scattering(paths: float) -> Experiment[Any]:
    """The two milky bodies of the report."""
    cases = [replace(case, shrink=1, compared=96) for case in CASES if case.effect == "scattering"]
    lists = [
        Contender(name=f"FragmentLists, {n} points", family="FragmentLists", method=tl.FragmentLists(light_points=n))
        for n in (2, 4, 8, 16)
    ]
    marched = [
        make(name=f"{n} steps, light by {where}", family="RayMarched", method=tl.RayMarched(n))
        for where, make in (("lists", Contender), ("voxels", InVoxels))
        for n in (8, 16, 32, 64, 128)
    ]
    return MethodComparison(cases, chosen=(*lists, *marched))


def photons(paths: float) -> Experiment[Any]:
    """Caustics in media, as the report has them."""
    return MediumCaustics(paths=paths or 1.0)


SIZES: dict[str, Size] = {"clouds": (24, 24), "densities": (512, 512), "frame": (1024, 1024), "scattering": (96, 96)}
EXPERIMENTS = {"clouds": clouds, "densities": densities, "frame": frame, "photons": photons, "scattering": scattering}


@click.command(help=__doc__)
@click.argument("name", type=click.Choice(list(EXPERIMENTS)))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder for a page, a table and a record.")
@click.option("--only", default="", help="Scenes with this in their names.")
@click.option("--paths", type=float, default=0.0, help="Of each pixel of a path traced truth.")
@click.option("--seconds", type=float, default=12.0, show_default=True, help="Of timing, for each scene.")
def main(name: str, output: Path | None, only: str, paths: float, seconds: float) -> None:
    """Measure one experiment."""
    experiment = EXPERIMENTS[name](paths)
    experiment = replace(experiment, shown=[one for one in experiment.shown if only in one.name])  # type: ignore[type-var]
    if not experiment.shown:
        raise click.BadParameter(f"no scene has {only!r} in its name", param_hint="--only")
    with opened(None, SIZES.get(name, (64, 64)), Effort(seconds, seconds, 1.0)) as bench:
        blank = Report(provenance(bench.renderer, f"tools/measure.py {name}", quick=False))
        *_, report = measured(bench, [experiment], [experiment.part], blank, lambda what, *_: click.echo(what))
    click.echo(table(replace(report, claims=())))
    if output is not None:
        with checked_folder(output):
            write_outputs(replace(report, complete=True), output)


if __name__ == "__main__":
    main()
