"""Light of photons in media against random paths of light: fog and a block of wax below a ball of glass in a wide sun.

No path finds a lamp behind glass: the truth has a disc of the environment 24 degrees wide, and the picture under
test lamps spread over it. Errors are root mean squares over the mean, freed of the noise of the truth, below the ball.

    python tools/measure_photons.py [--share 0.1]
    python tools/measure_photons.py --picture docs/caustics-in-media.png
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

import translucent as tl
from translucent.arrays import Array
from translucent.geometry.solids import Box, Sphere
from translucent.scene.environment_map import row_solid_angles, texel_directions

SIZE, MAP_HEIGHT, RADIUS, LAMPS, AT_ONCE = (24, 24), 128, np.radians(12.0), 32, 8
GLASS = tl.Object(Sphere().tessellate(48), tl.Medium(ior=1.5), priority=1)
NIGHT = tl.Environment.constant((0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Case:
    """Scene without lights, paths of each pixel, and the rows and columns that count."""

    scene: tl.Scene
    paths: int
    counted: tuple[slice, slice]


def fog() -> Case:
    """A ball in thin fog."""
    medium = tl.Medium(absorption=0.02, scattering=0.2)
    box = tl.Object(Box((-2.0, -3.5, -1.5), (2.0, 1.5, 1.5)).tessellate(), medium)
    camera = tl.Camera.look_at((0, -1, 12), (0, -1, 0), fov_y=24.0)
    return Case(tl.Scene([box, GLASS], camera, [], NIGHT, "priority"), 3072, (slice(14, 23), slice(5, 19)))


def wax() -> Case:
    """A ball above a block."""
    medium = tl.Medium(absorption=0.1, scattering=8.0, ior=1.4)
    block = tl.Object(Box((-2.2, -2.5, -2.2), (2.2, -1.3, 2.2)).tessellate(), medium)
    camera = tl.Camera.look_at((0, 6, 5), (0, -1.3, 0), fov_y=38.0)
    return Case(tl.Scene([block, GLASS], camera, [], NIGHT, "priority"), 192, (slice(9, 20), slice(4, 20)))


def truth(case: Case, share: float, seed: int) -> Array:
    """Radiance (h, w) by random paths."""
    up = texel_directions(MAP_HEIGHT, 2 * MAP_HEIGHT)[..., 1] > np.cos(RADIUS)
    angles = np.broadcast_to(row_solid_angles(MAP_HEIGHT, 2 * MAP_HEIGHT)[:, None], up.shape)
    sun = np.where(up, 3.0 / angles[up].sum(), 0.0)[..., None] * np.ones(3, np.float32)
    scene = replace(case.scene, environment=tl.Environment.image(sun.astype(np.float32)))
    paths = max(int(share * case.paths), 2)
    return np.asarray(tl.reference.path_trace(scene, SIZE, paths=paths, seed=seed)[0].radiance[..., 0])


def shown(case: Case, renderer: tl.Renderer, caustics: tl.Caustics | None) -> Array:
    """Radiance (h, w) with lamps, some at a time."""
    number = np.arange(LAMPS)
    fall = (number + 0.5) / LAMPS * (1.0 - np.cos(RADIUS))
    turn, across = np.pi * (1.0 + np.sqrt(5.0)) * number, np.sqrt(fall * (2.0 - fall))
    ways = -np.stack([across * np.cos(turn), 1.0 - fall, across * np.sin(turn)], axis=1)
    total = np.zeros(SIZE[::-1])
    for first in range(0, LAMPS, AT_ONCE):
        lights = [tl.DirectionalLight(way, 3.0 / LAMPS) for way in ways[first : first + AT_ONCE]]
        total += renderer.render(replace(case.scene, lights=lights), SIZE, samples=4, caustics=caustics).radiance[
            ..., 0
        ]
    return total


def picture(path: Path) -> None:
    """Draw a ball in fog and a ball over wax, side by side."""
    smoke = tl.Object(Box((-3.2, -4.0, -1.6), (3.2, 2.4, 1.6)).tessellate(), tl.Medium(0.02, 0.16))
    block = tl.Object(
        Box((-2.6, -2.6, -2.2), (2.6, -1.4, 2.2)).tessellate(),
        tl.Medium((0.02, 0.06, 0.2), (15.0, 14.0, 12.0), ior=1.45),
        surface=tl.Surface(roughness=0.3),
    )
    floor = tl.Object(Box((-30.0, -2.8, -30.0), (30.0, -2.6, 30.0)).tessellate(), color=(0.12, 0.13, 0.16))
    dusk = tl.Environment.gradient((0.02, 0.02, 0.03), (0.08, 0.09, 0.12))
    lamp = tl.SpotLight((-2.4, 6.0, 0.6), (2.4, -6.0, -0.6), [260, 250, 230], inner_cone=12.0, outer_cone=14.0)
    scenes = (
        tl.Scene([smoke, GLASS], tl.Camera.look_at((2, 0, 13), (0, -0.8, 0), fov_y=27.0), [lamp], dusk, "priority"),
        tl.Scene(
            [block, GLASS, floor],
            tl.Camera.look_at((2, 5.5, 7), (0.1, -1.2, 0), fov_y=38.0),
            [tl.DirectionalLight((0.6, -1.0, -0.2), (3.0, 2.9, 2.7))],
            dusk,
            "priority",
        ),
    )
    with tl.Renderer() as renderer:
        shown = [
            renderer.render(one, (360, 360), samples=4, scattering=tl.Diffusion(40), caustics=tl.Caustics(1_000_000))
            for one in scenes
        ]
    Image.fromarray(np.hstack([frame.to_srgb8() for frame in shown])).save(path)


def main() -> None:
    """Compare both scenes, with photons and without."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--share", type=float, default=1.0, help="of the paths, which take some minutes")
    parser.add_argument("--picture", type=Path, help="of both, and nothing else")
    asked = parser.parse_args()
    if asked.picture is not None:
        return picture(asked.picture)
    compare(asked.share)
    return None


def compare(share: float) -> None:
    """Print how far both scenes are from their truths."""
    with tl.Renderer() as renderer:
        for name, case in (("fog", fog()), ("wax", wax())):
            began = time.perf_counter()
            one, other = (truth(case, share, seed)[case.counted] for seed in (1, 2))
            mean = 0.5 * float((one + other).mean())
            noise = float((one - other).std()) / 2.0 / np.sqrt(one.size) / mean
            print(f"{name}: the mean of the truth is uncertain by {noise:.1%}, {time.perf_counter() - began:.0f} s")
            for told, caustics in (("with photons", tl.Caustics(400_000)), ("without", None)):
                began = time.perf_counter()
                found = shown(case, renderer, caustics)[case.counted]
                squares = (found - one) * (found - other)
                spread = 2.0 * float(squares.std()) / np.sqrt(squares.size)
                error, most = (np.sqrt(max(float(squares.mean()) + more, 0.0)) / mean for more in (0.0, spread))
                off = float(found.mean()) / mean - 1.0
                seconds = time.perf_counter() - began
                print(f"  {told}: nRMSE {error:.3f}, at most {most:.3f}, mean {off:+.1%}, {seconds:.0f} s")


if __name__ == "__main__":
    main()
