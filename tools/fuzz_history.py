"""Pairs of random scenes A and B, drawn as B, A, B, A by one renderer, and memory over many frames and renderers.

``python tools/fuzz_history.py [PAIRS] [SEED] [--backend NAME]`` draws PAIRS pairs (400) of scenes that often share
meshes, bodies or lights, A being none that is refused, and compares both pictures of A with each other, and that of a
new renderer with them wherever light diffuses, elsewhere in every fifth pair. A pair fails if any array differs by more
than 1e-7 of its largest value; the largest difference of all is printed at the end.
``--frames N`` and ``--renderers N`` draw so many frames with one renderer, and one with each of so many, and print the
memory of the process on the way: it should not grow. Exits with 1 if pictures differ.
"""

from __future__ import annotations

import argparse
import ctypes
import dataclasses
import gc
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import translucent as tl
from translucent.assets import mesh_path
from translucent.errors import TranslucentError
from translucent.geometry.solids import Box, Sphere, Torus

#: Scenes that frames go through again and again when memory is measured: each has its programs, which stay.
DISTINCT = 40

#: Largest difference between pictures of one scene, as a share of the largest value of the array.
SAME = 1e-7

#: Pairs for each renderer, and of how many without diffusion one is compared with a new one.
PAIRS_EACH, COMPARED_WITH_NEW = 100, 5

Random = np.random.Generator
Options = dict[str, Any]

MESHES = (
    Sphere().tessellate(16),
    Torus(major=0.8, minor=0.35).tessellate(16),
    Box((-0.7, -0.7, -0.7), (0.7, 0.7, 0.7)).tessellate(),
    tl.Mesh(Sphere().tessellate(12).vertices, Sphere().tessellate(12).faces[:-40], name="open"),
    tl.load_mesh(mesh_path("amber")),
)
GROUND = tl.Mesh(
    np.array([(-4.0, 0.0, -4.0), (4.0, 0.0, -4.0), (4.0, 0.0, 4.0), (-4.0, 0.0, 4.0)]), np.array([(0, 2, 1), (0, 3, 2)])
)
CLOUD = tl.DensityGrid(np.random.default_rng(0).uniform(0, 2, (6, 5, 4)))
ENVIRONMENTS = (
    tl.Environment.gradient((0.2, 0.19, 0.16), (1.2, 1.4, 1.6)),
    tl.Environment.studio(),
    tl.Environment.studio(rotation=70.0),
    tl.Environment.constant((0, 0, 0)),
)
METHODS = (*[None] * 8, tl.SignedDepth(), tl.FragmentLists(), tl.DepthPeeling(), tl.ThinLayer(0.1), tl.PathTraced(2))
INTERFACES = (*[None] * 5, tl.ScreenInterfaces(), tl.FrontInterface(), tl.TracedInterfaces(3, 1))
SCATTERING = (*[tl.Diffusion(8)] * 4, tl.Diffusion(10), tl.ScatteringLayer(), tl.SingleScattering(4))
#: Arguments of `Renderer.render` that the plan follows from.
PLANNED = ("method", "interfaces", "scattering", "caustics", "shadows")
SIZES = ((24, 16), (24, 16), (20, 15))


def random_medium(random: Random) -> tl.Medium:
    """Glass, something that glows, scatters or absorbs; often of one of a few colors."""
    absorption = np.round(random.uniform(0.05, 2.0, 3), 1)
    kind, ior = random.integers(4), float(random.choice([1.0, 1.3, 1.5]))
    if kind == 0:
        return tl.Medium(absorption, emission=random.uniform(0, 1, 3))
    if kind == 1:
        return tl.Medium(absorption, ior=ior)
    scattering = 10.0 ** random.uniform(-1, 1.3)
    return tl.Medium(0.1 * absorption, scattering, anisotropy=float(random.choice([0.0, 0.6])), ior=ior)


def random_object(random: Random, priority: int = 0) -> tl.Object:
    """A body or, now and then, a sheet or something opaque."""
    mesh = MESHES[random.integers(len(MESHES))]
    matrix = np.diag([*[2.0 / mesh.diagonal] * 3, 1.0])
    matrix[:3, 3] = random.choice([-0.6, 0.0, 0.5], 3) - 2.0 * mesh.center / mesh.diagonal
    if random.random() < 0.15:
        return tl.Object(mesh, None, matrix, color=random.uniform(0.1, 0.9, 3))
    surface = tl.Surface(roughness=float(random.choice([0.0, 0.0, 0.3])), iridescence=float(random.choice([0, 0, 1.0])))
    more: Options = {"surface": surface} if random.random() < 0.3 else {}
    if random.random() < 0.1:
        more["sheet_thickness"] = 0.05
    elif random.random() < 0.1:
        more["density"] = CLOUD
    return tl.Object(mesh, random_medium(random), matrix, priority=priority, **more)


def random_lights(random: Random) -> list[Any]:
    """None to two lights."""
    place = random.choice([-2.0, 1.5, 3.0], 3)
    lights = [tl.PointLight(place, 20.0), tl.DirectionalLight(-place, 2.0), tl.SpotLight(place, -place, 30.0)]
    return [lights[i] for i in random.choice(3, random.integers(3), replace=False)]


def random_scene(random: Random) -> tl.Scene:
    """One to three objects, half of them on a ground."""
    objects = [random_object(random, priority) for priority in range(random.integers(1, 4))]
    if all(item.medium is None for item in objects):
        objects.append(tl.Object(MESHES[0], random_medium(random)))
    if random.random() < 0.5:
        low = min(float(item.bounds[0][1]) for item in objects)
        objects.append(tl.Object(tl.Mesh(GROUND.vertices + (0, low - 0.01, 0), GROUND.faces, name="ground")))
    eye = random.choice([-1.0, 0.5, 1.0], 3) * (2, 1, 4)
    return tl.Scene(
        objects,
        tl.Camera.look_at(eye, (0, 0, 0), fov_y=45.0),
        random_lights(random),
        ENVIRONMENTS[random.integers(len(ENVIRONMENTS))],
        str(random.choice(["add", "add", "union", "priority"])),
        ambient=(0.5, 0.4, 0.3) if random.random() < 0.1 else (0, 0, 0),
        environment_shadows=int(random.choice([0, 0, 8])),
    )


def random_options(random: Random) -> Options:
    """Arguments of `Renderer.render`."""

    def one(values: tuple[Any, ...]) -> Any:
        return values[random.integers(len(values))]

    options = {
        "size": one(SIZES),
        "method": one(METHODS),
        "interfaces": one(INTERFACES),
        "scattering": one(SCATTERING),
        "samples": one((1, 1, 4)),
        "caustics": tl.Caustics(500, seed=int(random.integers(2))) if random.random() < 0.1 else None,
        "shadows": one((None, None, tl.ShadowMaps(128, directions=4))),
        "transparent": bool(random.random() < 0.1),
        "adaptive": bool(random.random() < 0.7),
    }
    if isinstance(options["method"], tl.PathTraced):
        options |= {"interfaces": None, "scattering": None, "caustics": None}
    return options


def changed(random: Random, scene: tl.Scene, options: Options) -> tuple[tl.Scene, Options]:
    """The scene with one or two things different, as when a user moves on."""
    for _ in range(random.integers(1, 3)):
        other, kind = random_scene(random), random.integers(6)
        if kind == 0:
            scene = dataclasses.replace(scene, lights=other.lights)
        elif kind == 1:
            scene = dataclasses.replace(scene, environment=other.environment)
        elif kind == 2:
            scene = dataclasses.replace(scene, camera=other.camera)
        elif kind == 3:
            options = {**options, **dict([list(random_options(random).items())[random.integers(9)]])}
        elif kind == 4:
            scene = dataclasses.replace(scene, objects=[*scene.objects, other.objects[0]])
        else:
            first = scene.objects[0]
            medium = None if first.medium is None else random_medium(random)
            first = dataclasses.replace(first, medium=medium, density=None if medium is None else first.density)
            scene = dataclasses.replace(scene, objects=[first, *scene.objects[1:]])
    return scene, options


def copied(scene: tl.Scene) -> tl.Scene:
    """The same scene of other objects that have the same meshes."""
    return dataclasses.replace(scene, objects=[dataclasses.replace(item) for item in scene.objects])


def draw(renderer: tl.Renderer, scene: tl.Scene, options: Options) -> tl.Frame | str:
    """The frame, or why there is none."""
    try:
        return renderer.render(scene, **options)
    except TranslucentError as error:
        return str(error)


def difference(one: tl.Frame | str, other: tl.Frame | str) -> tuple[str, float]:
    """Text on the differences of two frames, empty if none, and the largest as a fraction of the largest value."""
    if isinstance(one, str) or isinstance(other, str):
        return ("", 0.0) if one == other else (f"{one} | {other}", np.inf)
    if str(one.plan) != str(other.plan):
        return f"plans differ: {one.plan} | {other.plan}", np.inf
    found, largest = [], 0.0
    arrays, others = one.arrays, other.arrays
    for name in arrays:
        a, b = (np.nan_to_num(values[name].astype(np.float64)) for values in (arrays, others))
        off = float(np.abs(a - b).max(initial=0.0)) / max(float(np.abs(a).max(initial=0.0)), 1e-300)
        largest = max(largest, off)
        if off > SAME:
            found.append(f"{name} by {off:.2g} of the largest in {np.count_nonzero(a != b)} values")
    return "; ".join(found), largest


def random_request(random: Random, renderer: tl.Renderer) -> tuple[tl.Scene, Options]:
    """A scene and arguments for `Renderer.render` that the planner does not refuse."""
    while True:
        scene, options = random_scene(random), random_options(random)
        with suppress(TranslucentError):
            renderer.plan(scene, **{name: options[name] for name in PLANNED})
            return scene, options


def compare(pairs: int, seed: int, backend: str | None) -> int:
    """Draw the pairs; how many of them fail."""
    failed = unequal = refused = solved = 0
    largest = 0.0
    for first in range(0, pairs, PAIRS_EACH):
        with tl.Renderer(backend) as renderer:
            for run in range(first, min(first + PAIRS_EACH, pairs)):
                random = np.random.default_rng((seed, run))
                scene, options = random_request(random, renderer)
                if random.random() < 0.6:
                    other = changed(random, scene, options)
                else:
                    other = random_scene(random), random_options(random)
                draw(renderer, *other)
                before = draw(renderer, scene, options)
                draw(renderer, copied(other[0]), other[1])
                again = scene if random.random() < 0.3 else copied(scene)
                after = draw(renderer, again, options)
                said, off = difference(before, after)
                diffuses = isinstance(before, tl.Frame) and before.plan.diffuses
                refused, solved = refused + isinstance(before, str), solved + diffuses
                if not said and (diffuses or run % COMPARED_WITH_NEW == 0):
                    with tl.Renderer(backend) as new:
                        said, apart = difference(fresh := draw(new, scene, options), after)
                    off = max(off, apart)
                    said = said and f"not as of a new renderer: {said}"
                    after = fresh
                largest = max(largest, off)
                if said:
                    failed += 1
                    print(f"seed {seed}, run {run}: {said}\n  {options}", flush=True)
                elif isinstance(before, tl.Frame) and isinstance(after, tl.Frame):
                    unequal += any(not np.array_equal(before.arrays[k], after.arrays[k]) for k in before.arrays)
    print(
        f"{pairs} pairs: {failed} failed, {unequal} others not equal bit for bit; {solved} diffuse, {refused} refused; "
        f"largest difference {largest:.2g} of the largest value"
    )
    return failed


def memory() -> float:
    """Megabytes of this process that are in memory; what waits for the collector, or is kept by malloc, is freed."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


def grow(frames: int, renderers: int, backend: str | None) -> None:
    """Print the memory over frames of one renderer, and over renderers."""
    with tl.Renderer(backend) as renderer:
        for number in range(frames):
            random = np.random.default_rng((1, number % DISTINCT))
            draw(renderer, *random_request(random, renderer))
            if (number + 1) % 100 == 0:
                print(f"{number + 1} frames: {memory():.0f} MB", flush=True)
    for number in range(renderers):
        random = np.random.default_rng((2, number % 10))
        with tl.Renderer(backend) as renderer:
            draw(renderer, *random_request(random, renderer))
        if (number + 1) % 50 == 0:
            print(f"{number + 1} renderers: {memory():.0f} MB", flush=True)


def main() -> int:
    """Run what is asked for; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", type=int, nargs="?", default=400)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--backend")
    parser.add_argument("--frames", type=int, default=0)
    parser.add_argument("--renderers", type=int, default=0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.frames or asked.renderers:
        grow(asked.frames, asked.renderers, asked.backend)
        return 0
    return int(compare(asked.pairs, asked.seed, asked.backend) > 0)


if __name__ == "__main__":
    sys.exit(main())
