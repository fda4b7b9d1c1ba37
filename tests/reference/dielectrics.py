"""Bodies of glass, and the one pixel that looks at them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box
from translucent.media.medium import Medium
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Scene

Array = npt.NDArray[np.float64]

GLASS = Medium(absorption=(0.1, 0.4, 0.9), ior=1.5)
WHITE = Environment.constant((1.0, 1.0, 1.0))
BLACK = Environment.constant((0.0, 0.0, 0.0))
#: Tells directions apart: (1 + y) / 2 of the first channel, (1 - y) / 2 of the second.
UP_AND_DOWN = Environment.gradient((0.0, 1.0, 0.3), (1.0, 0.0, 0.8))
WIDE = 500.0


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    return Box(tuple(low), tuple(high)).tessellate()


def slab(bottom: float, top: float) -> Mesh:
    """So wide that no ray that is still followed comes to its ends."""
    return box((-WIDE, bottom, -WIDE), (WIDE, top, WIDE))


def oblique(degrees: float) -> Camera:
    """Looks down on the origin, this far from straight down."""
    angle = math.radians(degrees)
    eye = 10.0 * np.array([math.sin(angle), math.cos(angle), 0.0])
    return Camera.orthographic(eye, (0, 0, 0), (0, 0, 1), height=1e-3)


def pixel(scene: Scene, **options: int) -> Array:
    """(3,): what the middle of the picture sees."""
    frame = render(scene, (1, 1), **options)
    assert frame.valid.all()
    return frame.radiance[0, 0]


def reflectance(sine: float, ior: float) -> float:
    """Fresnel by the angles on both sides (Born & Wolf 1.5.2, 21a); a tangent at normal incidence."""
    if sine == 0.0:
        return ((ior - 1) / (ior + 1)) ** 2
    a, b = math.asin(sine), math.asin(sine / ior)
    return 0.5 * ((math.tan(a - b) / math.tan(a + b)) ** 2 + (math.sin(a - b) / math.sin(a + b)) ** 2)
