"""Time of finding light that diffuses where the medium or the light changes, and how much of it is the linear solver.

Usage: python tools/measure_solves.py [--resolution 32] [--rounds 7]
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np

import translucent as tl
from translucent.assets import mesh_path
from translucent.diffusion import cell_system
from translucent.diffusion.field import DiffusingBody
from translucent.diffusion.lit_body import lit_body

CAMERA = tl.Camera.look_at((0, 0, 5), (0, 0, 0))


def bear(absorption: float) -> tl.Object:
    """A bear of ten mean free paths, an absorption of it that is like no other."""
    mesh = tl.load_mesh(mesh_path("bear"))
    unit = 10.0 / float(np.ptp(mesh.bounds, axis=0).max())
    medium = tl.Medium(absorption * unit * np.array((0.02, 0.1, 0.5)), unit * np.array((20, 15, 10)), ior=1.4)
    return tl.Object(mesh, medium)


def lit(body: tl.Object, turn: int) -> tl.Scene:
    """The bear in a studio that is turned, with a light from elsewhere each time."""
    light = tl.DirectionalLight((np.cos(turn), -1.0, np.sin(turn)), (1, 1, 1))
    return tl.Scene([body], CAMERA, [light], tl.Environment.studio(rotation=37.0 * turn))


def main() -> None:
    """Print medians of rounds, without the first, in which the geometry is found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, default=32)
    parser.add_argument("--rounds", type=int, default=7)
    asked = parser.parse_args()
    spent: dict[str, float] = defaultdict(float)
    rows = defaultdict(list)

    def timed(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def timing(*given: Any, **named: Any) -> Any:
            began = time.perf_counter()
            found = call(*given, **named)
            spent[name] += time.perf_counter() - began
            return found

        return timing

    with (
        patch.object(cell_system, "conjugate_gradients", timed("solver", cell_system.conjugate_gradients)),
        patch.object(cell_system, "_balance", timed("matrix", cell_system._balance)),
    ):
        body = bear(1.0)
        geometry = lit_body(body, None, tl.Diffusion(asked.resolution).cell_size(body))
        for turn in range(asked.rounds + 1):
            body = bear(1.0 + 0.1 * turn)
            assert body.medium is not None
            diffusing = timed("medium", DiffusingBody)(geometry, body.medium, 0.0)
            for name in ("light, the medium new", "light"):
                before = spent["solver"]
                timed(name, diffusing.field)(lit(body, 2 * turn + (name == "light")), 0)
                rows[f"{name}: solver"].append(spent["solver"] - before)
            for name in ("medium", "matrix", "light, the medium new", "light"):
                rows[name].append(spent[name])
            spent.clear()
    print(f"{geometry.grid.count} cells, {len(geometry.grid.points)} samples; medians of {asked.rounds} rounds, in ms")
    for name, seconds in rows.items():
        print(f"{name:28s} {1e3 * np.median(seconds[1:]):6.0f}")


if __name__ == "__main__":
    main()
