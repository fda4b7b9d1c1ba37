"""Light that is scattered many times in clouds and fog, and in uneven and thin bodies behind interfaces, against
path-traced truth: errors of what the planner takes.

Usage: python tools/measure_clouds.py [--paths 192] [--size 24] [--only behind]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.media.density import Density

Array = npt.NDArray[np.floating]

SUN = tl.DirectionalLight((-1, -0.7, -0.3), (3, 3, 3))
SKY = tl.Environment.gradient((0.2, 0.1, 0.05), (1, 1, 1))
DARK = tl.Environment.constant((0, 0, 0))
CLOUD, FOG = (0.99, 0.98, 0.96), (0.99, 0.95, 0.8)  # albedos
HALF = np.diag([0.5, 0.5, 0.5, 1.0])


def puffs(voxels: int = 40) -> tl.DensityGrid:
    """A ball of noise with nothing around it."""
    place = (np.arange(voxels) + 0.5) / voxels - 0.5
    radius = np.linalg.norm(np.stack(np.meshgrid(place, place, place)), axis=0)
    noise = gaussian_filter(np.random.default_rng(0).normal(size=(voxels,) * 3), voxels / 14, mode="wrap")
    return tl.DensityGrid(np.clip((0.42 - radius) * 8 + 0.5 * noise / noise.std(), 0, 1))


def cloud(extinction: float, density: Density, anisotropy: float, lit: bool) -> tl.Scene:
    """A box with a density of such a largest extinction in 1/m, half a metre wide."""
    albedo = np.array(CLOUD)
    medium = tl.Medium(extinction * (1 - albedo), extinction * albedo, anisotropy=anisotropy)
    body = tl.Object(Box().tessellate(), medium, HALF, density=density)
    camera = tl.Camera.look_at((0.6, 0.5, 2.2), (0, 0, 0), fov_y=24.0)
    return tl.Scene([body], camera, [SUN] if lit else [], DARK if lit else SKY)


def ball(depth: float, anisotropy: float, lit: bool) -> tl.Scene:
    """A ball of even fog of such an optical depth through its middle."""
    albedo = np.array(FOG)
    medium = tl.Medium(0.5 * depth * (1 - albedo), 0.5 * depth * albedo, anisotropy=anisotropy)
    camera = tl.Camera.look_at((0, 1, 4), (0, 0, 0), fov_y=32.0)
    return tl.Scene([tl.Object(Sphere().tessellate(32), medium)], camera, [SUN] if lit else [], DARK if lit else SKY)


def behind(extinction: float, density: Density | None, anisotropy: float) -> tl.Scene:
    """A ball with an interface, of such a largest reduced extinction in 1/m, in the light of a sky."""
    albedo = np.array(FOG)
    full = extinction / (1 - albedo * anisotropy)
    medium = tl.Medium(full * (1 - albedo), full * albedo, anisotropy=anisotropy, ior=1.5)
    body = tl.Object(Sphere().tessellate(48), medium, density=density)
    return tl.Scene([body], tl.Camera.look_at((0.5, 0.8, 4), (0, 0, 0), fov_y=32.0), [], SKY)


def scenes() -> Iterator[tuple[str, tl.Scene]]:
    """All scenes, with their names."""
    for lit in (False, True):
        light = "sun" if lit else "sky"
        for extinction, anisotropy in ((4.0, 0.0), (16.0, 0.0), (40.0, 0.8)):
            name = f"cloud, extinction {extinction:g}, g {anisotropy:g}, {light}"
            yield name, cloud(extinction, puffs(), anisotropy, lit)
        yield f"linear profile, extinction 16, {light}", cloud(16.0, tl.LinearDensity(1, 1.0, 0.05), 0.0, lit)
        for depth, anisotropy in ((0.5, 0.0), (2.0, 0.0), (8.0, 0.0), (8.0, 0.7), (20.0, 0.0), (200.0, 0.0)):
            yield f"ball of depth {depth:g}, g {anisotropy:g}, {light}", ball(depth, anisotropy, lit)
    sides = tl.DensityGrid(np.where(np.arange(32) < 16, 0.1, 1.0).reshape(32, 1, 1))
    for anisotropy in (0.0, 0.8):
        for what, density in (("even", None), ("linear", tl.LinearDensity(1, 1.0, 0.1)), ("two halves", sides)):
            yield f"behind an interface, {what}, g {anisotropy:g}", behind(10.0, density, anisotropy)
    for depth in (0.2, 0.4):
        yield f"behind an interface, thin, {depth:g} / m, g 0.9", behind(depth, None, 0.9)


def nrmse(found: Array, one: Array, other: Array) -> float:
    """Root mean square error over the mean of the truth, whose two halves have noise of their own."""
    square = ((found - one) * (found - other)).mean()
    return float(np.sqrt(max(square, 0.0)) / (0.5 * (one + other)).mean())


def main() -> None:
    """Print a line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--paths", type=int, default=192)
    parser.add_argument("--size", type=int, default=24)
    parser.add_argument("--only", default="", help="scenes with this in their names")
    asked = parser.parse_args()
    size = asked.size, asked.size
    with tl.Renderer() as renderer:
        for name, scene in scenes():
            if asked.only not in name:
                continue
            halves = [tl.reference.path_trace(scene, size, asked.paths // 2, seed)[0].radiance for seed in (1, 2)]
            inside = tl.interior(tl.reference.hit_counts(scene, size)) & tl.reference.render(scene, size).coverage
            one, other = (half[inside] for half in halves)
            frame = renderer.render(scene, size)
            once = renderer.render(scene, size, scattering=tl.SingleScattering())
            bias = frame.radiance[inside].mean(axis=0) / (0.5 * (one + other)).mean(axis=0) - 1.0
            way = "volume" if frame.plan.given_back.volumes else "surface" if frame.plan.given_back.diffused else "once"
            print(
                f"{name:44s} {way:8s} nRMSE {nrmse(frame.radiance[inside], one, other):.3f}, bias {np.round(bias, 3)}; "
                f"scattered once {nrmse(once.radiance[inside], one, other):.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
