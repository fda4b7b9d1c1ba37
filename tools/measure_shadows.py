"""Measure shadows on opaque objects against the float64 reference, and what a light's map costs.

Errors of transmittance: in each texel of a map, at points of a ground between texels, and with those at edges; beside
them what other systems show: opaque shadow maps, one thickness for all of a body, and paths in half floats. Errors of
light of the environment by the number of its directions. Cost: processor time of one map, with all that it takes, over
that of drawing the same objects into a depth buffer of the same size.

    python tools/measure_shadows.py [--meshes bear,knot] [--only texels|points|sky|cost]
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import click
import numpy as np
import numpy.typing as npt
import trimesh

import translucent as tl
from translucent.assets import mesh_path
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.job import FrameJob
from translucent.gpu.light_cameras import outermost
from translucent.gpu.passes.depth_only import DepthOnlyPass
from translucent.gpu.passes.shadow_maps import ShadowMapsPass
from translucent.gpu.shadow_cameras import ShadowThrowers
from translucent.gpu.targets import Targets
from translucent.planning.passes import PassName

Floats = npt.NDArray[np.float64]

MESHES = "bear,knot,shell,goblet,bangle,soap"
SIZES = (512, 1024, 2048, 4096)
DARK = tl.Environment.constant((0, 0, 0))

#: Pixels along a side of the pictures of the ground.
PIXELS = 320

#: Pictures taken for a time: their median counts.
ROUNDS = 11


def ground(low: float, center: Floats, half: float) -> tl.Object:
    """A square floor."""
    corners = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]) * half + (center[0], low, center[2])
    return tl.Object(tl.Mesh(corners, [(0, 2, 1), (0, 3, 2)], name="ground"), color=(1, 1, 1))


def setups(mesh: tl.Mesh) -> Iterator[tuple[str, tl.Scene]]:
    """A body over a floor, seen from above, under a sun and under a lamp."""
    diagonal, center = mesh.diagonal, mesh.center
    body = tl.Object(mesh, tl.Medium(absorption=np.array([1, 2, 4]) / diagonal))
    floor = ground(float(mesh.bounds[0, 1]) - 0.02 * diagonal, center, 8.0 * diagonal)
    camera = tl.Camera.orthographic(center + [0, 5 * diagonal, 0], center, up=(0, 0, 1), height=2.5 * diagonal)
    place = center + np.array([-1.2, 1.6, 0.7]) * diagonal
    for name, light in (
        ("sun", tl.DirectionalLight((0.9, -1, -0.4), np.pi)),
        ("lamp", tl.PointLight(place, np.pi * diagonal**2)),
    ):
        yield name, tl.Scene([body, floor], camera, [light], DARK)


def map_camera(scene: tl.Scene) -> tl.Camera:
    """Camera of the one map of a scene with one light."""
    return ShadowThrowers(scene.lights[0], scene, [outermost(item) for item in scene.objects]).cameras()[0]


def texel_errors(renderer: tl.Renderer, scene: tl.Scene, size: int) -> Floats:
    """Errors of transmittance in the texels of a map, away from silhouettes."""
    renderer.render(scene, (8, 8), shadows=tl.ShadowMaps(size))
    with renderer.gpu.context.current():
        texture = renderer.gpu._resources.shadows.sums.color_attachments[0]
        sums = np.frombuffer(texture.read(), np.float32).reshape(size, size, texture.components)
    camera, floor = map_camera(scene), float(scene.objects[1].bounds[0, 1])
    origins, ways = (np.broadcast_to(rays, (size, size, 3)) for rays in camera.rays((size, size)))
    path = sums[::-1, :, 0] / (ways @ camera.forward)
    body = scene.objects[0]
    assert body.medium is not None
    found = np.exp(-path[..., None] * body.medium.extinction)
    points = origins + ((floor - origins[..., 1]) / ways[..., 1])[..., None] * ways
    truth = tl.reference.light_transmittance(scene, 0, points.reshape(-1, 3)).reshape(found.shape)
    seen = replace(scene, objects=[body], camera=camera)
    inside = tl.interior(tl.reference.hit_counts(seen, (size, size)))
    return np.asarray(np.abs(found - truth).max(axis=-1)[inside])


def point_errors(renderer: tl.Renderer, scene: tl.Scene) -> dict[str, tuple[Floats, Floats]]:
    """Errors of transmittance at points of the floor that the camera sees past the body: away from the outline of
    the shadow, and everywhere near the shadow.
    """
    floor = float(scene.objects[1].bounds[0, 1])
    origins, ways = (np.broadcast_to(rays, (PIXELS, PIXELS, 3)) for rays in scene.camera.rays((PIXELS, PIXELS)))
    points = (origins + ((floor - origins[..., 1]) / ways[..., 1])[..., None] * ways).reshape(-1, 3)
    truth = tl.reference.light_transmittance(scene, 0, points).reshape(PIXELS, PIXELS, 3)
    light = scene.lights[0].irradiance_on(points, np.broadcast_to((0.0, 1.0, 0.0), points.shape)) / np.pi
    dimmed = (truth < 1.0).any(axis=-1)
    frame = renderer.render(scene, (PIXELS, PIXELS))
    seen = ~frame.coverage
    away = tl.interior(dimmed.astype(int)) & dimmed & seen
    near = ~tl.interior(dimmed.astype(int)) & seen | away
    found = {
        f"map of {size}": renderer.render(scene, (PIXELS, PIXELS), shadows=tl.ShadowMaps(size)).radiance
        / light.reshape(truth.shape)
        for size in SIZES
    }
    body = scene.objects[0]
    assert body.medium is not None
    path = -np.log(np.maximum(truth[..., 0], 1e-30)) / body.medium.extinction[0]
    constant = np.exp(-np.median(path[dimmed]) * body.medium.extinction)
    found["opaque shadow map"] = np.where(dimmed[..., None], 0.0, 1.0) * np.ones(3)
    found["one thickness for all"] = np.where(dimmed[..., None], constant, 1.0)
    # The sums of signed distances from the light, each rounded to 11 bits.
    far = float(np.linalg.norm(map_camera(scene).eye - body.mesh.center))
    halves = np.float16(path + far).astype(float) - np.float16(far).astype(float)
    found["distances in half floats"] = np.exp(-np.maximum(halves, 0)[..., None] * body.medium.extinction)
    errors = {name: np.abs(values - truth).max(axis=-1) for name, values in found.items()}
    return {name: (error[away], error[near]) for name, error in errors.items()}


def sky_errors(renderer: tl.Renderer) -> dict[str, list[float]]:
    """RMS errors on a floor over their mean, by the number of directions, against 256 of them."""
    wine, place = tl.Medium(absorption=(0.5, 2, 1)), trimesh.transformations.translation_matrix((1.6, -0.3, 0.4))
    objects = [
        tl.Object(Sphere().tessellate(32), wine),
        tl.Object(Sphere(radius=0.5).tessellate(32), None, place),
        tl.Object(Box((-2, -1, -0.5), (-1.4, 0.4, 0.5)).tessellate()),
        ground(-1.0, np.zeros(3), 6.0),
    ]
    camera, found = tl.Camera.look_at((0, 3.5, 7), (0, -0.3, 0), fov_y=30), {}
    for name, environment in (
        ("white", tl.Environment.constant((1, 1, 1))),
        ("sky", tl.Environment.gradient((0.2, 0.2, 0.2), (1, 1, 1.2))),
        ("studio", tl.Environment.studio()),
    ):
        scene = tl.Scene(objects, camera, [], environment)
        many, *few = (
            renderer.render(replace(scene, environment_shadows=count), (160, 120))
            for count in (256, 8, 16, 32, 64, 128)
        )
        floor = ~many.coverage
        squares = [np.square(frame.radiance - many.radiance)[floor].mean() for frame in few]
        found[name] = [float(np.sqrt(square) / many.radiance[floor].mean()) for square in squares]
    return found


def cost(renderer: tl.Renderer, scene: tl.Scene, size: int) -> tuple[float, float]:
    """Seconds of processors for one map, and for its objects in a depth buffer of that size."""
    engine = renderer.gpu
    chosen = renderer.plan(scene, shadows=tl.ShadowMaps(size))
    spec = next(step for step in chosen.passes if step.name is PassName.SHADOW_MAPS)
    with engine.context.current():
        gl = engine.context.gl
        job, maps, floor = engine.prepare(scene, (64, 64), chosen), ShadowMapsPass(gl), DepthOnlyPass(gl)
        seen = FrameJob(
            gl, replace(scene, camera=map_camera(scene)), chosen, Targets(gl, (size, size)), engine._resources
        )
        seen.place((0.0, 0.0), with_depth=True)

        def render_map() -> None:
            job.resources.shadows.held = None
            maps.run(job, spec)

        def draw_depth() -> None:
            seen.uniforms.bind()
            floor.run(seen, (0, 1))

        times: dict[Callable[[], None], list[float]] = {render_map: [], draw_depth: []}
        for number in range(ROUNDS + 2):
            for act, taken in times.items():
                gl.finish()
                begun = time.process_time()
                act()
                gl.finish()
                if number >= 2:
                    taken.append(time.process_time() - begun)
        job.release()
        seen.release()
        return float(np.median(times[render_map])), float(np.median(times[draw_depth]))


@click.command(help=__doc__)
@click.option("--meshes", default=MESHES, show_default=True)
@click.option("--only", type=click.Choice(["texels", "points", "sky", "cost"]))
def main(meshes: str, only: str | None) -> None:
    """Print the tables."""
    with tl.Renderer() as renderer:
        for name in meshes.split(","):
            mesh = tl.load_mesh(mesh_path(name))
            for light, scene in setups(mesh):
                if only in (None, "texels"):
                    error = texel_errors(renderer, scene, 512)
                    tell(f"{name}, {light}: texels", error)
                if only in (None, "points"):
                    for what, (away, near) in point_errors(renderer, scene).items():
                        tell(f"{name}, {light}: {what}", away, f"mean with edges {near.mean():.1e}")
                if only in (None, "cost"):
                    taken, least = cost(renderer, scene, 1024)
                    click.echo(f"{name}, {light}: map / depth alone {taken / least:.2f} ({len(mesh.faces)} triangles)")
        if only in (None, "cost"):
            for light, scene in setups(Sphere().tessellate(290)):
                taken, least = cost(renderer, scene, 1024)
                triangles = len(scene.objects[0].mesh.faces)
                click.echo(f"sphere, {light}: map / depth alone {taken / least:.2f} ({triangles} triangles)")
        if only in (None, "sky"):
            for environment, errors in sky_errors(renderer).items():
                listed = ", ".join(f"{error:.3f}" for error in errors)
                click.echo(f"{environment}: 8, 16, 32, 64, 128 directions: {listed}")


def tell(what: str, error: Floats, more: str = "") -> None:
    """Print the distribution of an error."""
    click.echo(
        f"{what:38} median {np.median(error):.1e}, p99 {np.quantile(error, 0.99):.1e}, "
        f"p99.9 {np.quantile(error, 0.999):.1e} of {error.size} {more}"
    )


if __name__ == "__main__":
    main()
