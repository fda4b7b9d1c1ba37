"""Bodies in which light diffuses, solved for on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from translucent.arguments import brief, checked
from translucent.errors import InputError
from translucent.planning.methods.base import check_count
from translucent.planning.scattering.base import Scattering
from translucent.scene.scene import Object

#: Resolutions that make sense: below, no body has an inside; above, the memory told in the error is needed.
LEAST_RESOLUTION, MOST_RESOLUTION = 8, 128

#: Resolution from which on solutions are corrected by uniform light. At 12, pixels of milk, jade and wax in bear and
#: candle change by less than 0.5 of 255 by that, and are 0.5 to 5.6 off those at 32.
LEAST_CORRECTED = 16

#: Cells in the bounds of a body, most of them empty; each takes about 150 bytes.
MOST_IN_BOX = 2_000_000

#: Bytes that a cell takes, with its share of samples on the surface and of what they see.
CELL_BYTES = 4000


@checked
@dataclass(frozen=True)
class Diffusion(Scattering):
    """Light scattered many times, as it diffuses in the body and leaves through its surface.

    The diffusion equation on cells that the mesh cuts, lit by what enters: the environment and lights, shadowed by the
    body and by opaque objects, and light of the body that falls on it again. Solved on the CPU where the light, the
    medium or the mesh changes; a picture then takes two look-ups. Light that passes unscattered is seen along rays as
    ever. Where the density varies, it does so from cell to cell. Without an interface, as in clouds, rays gather what
    is scattered into them on their way, from a solution by discrete ordinates that diffusion accelerates.

    Parameters
    ----------
    resolution : int
        A body gets about resolution^3 / 4 cells, whatever its shape, 8 to 128: a ball is 0.8 times as many cells wide.
    """

    name: ClassVar[str] = "diffusion"
    gives_back: ClassVar[bool] = True

    resolution: int = 32

    def __post_init__(self) -> None:
        if isinstance(self.resolution, int) and self.resolution > MOST_RESOLUTION:
            cells = 0.25 * min(self.resolution, 10**9) ** 3
            raise InputError(
                f"Diffusion resolution {brief(self.resolution)}",
                f"a body would have {cells:.2g} cells and take about {CELL_BYTES * cells / 1e9:.0f} GB",
                f"give at most {MOST_RESOLUTION}; 32 is enough where scattering dominates",
            )
        check_count("Diffusion resolution", self.resolution, MOST_RESOLUTION, least=LEAST_RESOLUTION, example=32)

    @property
    def corrected(self) -> bool:
        """True if the solution is corrected by uniform light, which takes as long as all else: not on coarse grids,
        whose other errors are five times as large, or more.
        """
        return self.resolution >= LEAST_CORRECTED

    @checked
    def cell_size(self, body: Object) -> float:
        """Side of a cell in metres."""
        volume = abs(body.mesh.volume * float(np.linalg.det(body.matrix[:3, :3])))
        return float(np.cbrt(4.0 * volume) / self.resolution)

    def refusal(self, body: Object) -> str | None:
        """Reason: no closed solid wound outwards, or thinner than a cell everywhere."""
        if body.sheet_thickness is not None:
            return "it is a sheet"
        if not body.mesh.diagnosis.sound:
            return "its mesh is not closed"
        if not body.mesh.volume > 0.0:
            return "its mesh is inside out"
        extent = np.asarray(body.bounds[1]) - np.asarray(body.bounds[0])
        if (box := float(np.prod(extent / self.cell_size(body) + 2.0))) > MOST_IN_BOX:
            return f"its bounds, nearly empty, would hold {box:.2g} cells of {self.cell_size(body):.2g} m"
        if body.mean_thickness < self.cell_size(body):
            return f"it is thinner than a cell everywhere, {self.cell_size(body):.2g} m at this resolution"
        return None
