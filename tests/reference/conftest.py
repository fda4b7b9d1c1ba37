from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from translucent.planning.methods import Method
from translucent.reference import line_hits, pixel_rays, shade_hits, sheet_thicknesses
from translucent.scene.scene import Scene

#: Arrays of a frame by name, (h, w) or (h, w, 3).
Shade = Callable[..., dict[str, npt.NDArray[Any]]]


@pytest.fixture(autouse=True)
def strict_floats() -> Iterator[None]:
    with np.errstate(all="raise"):
        yield


@pytest.fixture(scope="session")
def shade() -> Shade:
    """The arrays of a picture as `render` makes them, whatever the planner thinks of the scene."""

    def arrays(scene: Scene, size: tuple[int, int], method: Method | None = None) -> dict[str, npt.NDArray[Any]]:
        hits = [line_hits(body.mesh, body.matrix, scene.camera, size) for body in scene.objects]
        found = shade_hits(scene, pixel_rays(scene.camera, size), hits, sheet_thicknesses(scene, method))
        return {name: array.reshape(size[::-1] + array.shape[1:]) for name, array in found.items()}

    return arrays
