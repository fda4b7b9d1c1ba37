"""Ray marching: steps through every interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.planning.bodies import solids_of
from translucent.planning.methods.base import MAX_LIGHT_POINTS, Method, check_count
from translucent.planning.methods.fragment_lists import FragmentLists
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.scene import Scene

#: Largest number of steps of a ray through one interval.
MAX_STEPS = 65536

#: Largest number of Gauss-Legendre points in an interval; smooth sources need far fewer for all digits of float64.
MAX_GAUSS_POINTS = 256

#: Transmittance of every channel below which a march on the GPU looks for no more sources.
LEAST_SEEN = 1e-5

Quadrature = Literal["left", "midpoint", "exponential", "jittered", "equiangular", "gauss"]


@checked
@dataclass(frozen=True)
class RayMarched(Method):
    """Steps along each ray through every interval inside the bodies; the error depends on their number.

    The only method where density varies from place to place. Quadratures and their orders of convergence, by steps N:

    - ``left``: the source at the beginning of each step, 1 / N (Riemann);
    - ``midpoint``: in its middle, 1 / N^2;
    - ``exponential``: the source in its middle, constant over the step, and its attenuation in closed form, 1 / N^2
      (Max 1995, section 4); exact for homogeneous media without scattering;
    - ``jittered``: at a random place in each step, N^-1.5 (stratified Monte Carlo, Mitchell 1996);
    - ``equiangular``: steps of equal angles as seen from a point light, and the middle of each (Kulla & Fajardo 2012);
    - ``gauss``: Gauss-Legendre points, beyond any order for smooth sources in homogeneous media; where density varies
      1 / N^2, since depths are sums over steps.

    Parameters
    ----------
    steps : int
        Through each interval between neighboring surfaces, 1 to 65536; at most 256 Gauss-Legendre points.
    quadrature : {"left", "midpoint", "exponential", "jittered", "equiangular", "gauss"}
    jitter : bool
        Moves all samples of a pixel by one random fraction of a step: bands turn into noise. For quadratures with steps
        and fixed places in them: not for ``jittered`` and ``gauss``.
    seed : int
        Of the random numbers, 0 to 2^32 - 1.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    name: ClassVar[str] = "ray-marched"
    cost: ClassVar[float] = FragmentLists.cost
    step_cost: ClassVar[float] = 0.1
    ordered: ClassVar[bool] = True
    needs_storage: ClassVar[bool] = True
    samples_lights: ClassVar[bool] = True
    finds_exits: ClassVar[bool] = True
    marches: ClassVar[bool] = True

    steps: int = 256
    quadrature: Quadrature = "midpoint"
    jitter: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        check_count("RayMarched steps", self.steps, MAX_STEPS)
        if self.quadrature not in (known := get_args(Quadrature)):
            raise InputError(
                f"RayMarched quadrature {self.quadrature!r}",
                "no quadrature has this name",
                f"use one of {', '.join(known)}",
            )
        if self.quadrature == "gauss":
            check_count("RayMarched steps of gauss", self.steps, MAX_GAUSS_POINTS)
        if self.jitter and self.quadrature in ("jittered", "gauss"):
            raise InputError(
                f"RayMarched quadrature {self.quadrature!r} with jitter",
                "the samples of this quadrature have no fixed position in a step",
                "omit jitter, or use the quadrature midpoint",
            )
        if not isinstance(self.seed, int) or not 0 <= self.seed < 1 << 32:
            raise InputError(
                f"RayMarched seed {self.seed!r}",
                "the seed must be a whole number in 0 to 2^32 - 1",
                "use a value such as 0",
            )

    @property
    def light_points(self) -> int:
        """Number of points in each interval at which light from each light is evaluated: its steps."""
        return self.steps

    def check(self, scene: Scene) -> None:
        """Raise `InputError` for more Gauss-Legendre points than shaders hold."""
        if self.quadrature == "gauss" and self.steps > MAX_LIGHT_POINTS:
            raise InputError(
                f"{self}", f"shaders support at most {MAX_LIGHT_POINTS} Gauss-Legendre points", "use fewer steps"
            )

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Passes: one draw of all solids, and the steps."""
        reason = f"{why}; one draw fills a list for each pixel, then {self.steps} steps through each interval"
        cost = self.cost + self.step_cost * self.steps
        return (PassSpec(PassName.FRAGMENT_LISTS, reason, solids_of(scene), 1, cost=cost),)

    def limits(self, scene: Scene) -> list[Note]:
        """Notes on the error of a sum over steps."""
        what = "optical depth, emission and scattered light are" if scene.varies else "emission and scattered light are"
        text = (
            f"{what} summed over {self.steps} steps in each interval ({self.quadrature}), down to a transmittance "
            f"of {LEAST_SEEN:g}"
        )
        if scene.varies and scene.lights:
            text += "; optical depths towards lights are exact, and computed for each step and light"
        return [Note(NoteKind.STEPS, text)]
