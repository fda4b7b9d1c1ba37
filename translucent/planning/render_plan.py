"""What a plan is made of: passes, each with its reason and its expected cost, and what the machine can do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from translucent.planning.methods import Method, ThinLayer

#: Where rays bend that cross a body: where they enter and where they leave it, or only where they enter.
Borders: TypeAlias = Literal["both", "front"]


@dataclass(frozen=True)
class Capabilities:
    """What the machine that a plan is made for can do.

    Attributes
    ----------
    shader_storage : bool
        Shaders can write to buffers: OpenGL 4.3.
    opengl : bool
        There is OpenGL at all; else rays are traced on the CPU, which finds all intervals whatever the method.

    scattering : bool
        Light that media scatter can be followed.
    """

    shader_storage: bool = True
    opengl: bool = True
    scattering: bool = True


@dataclass(frozen=True)
class PassSpec:
    """One pass of a plan.

    Attributes
    ----------
    name : str
        What the pass is called in `Frame.seconds`.
    reason : str
        Why the scene needs it.
    objects : tuple of int
        Indices into `Scene.objects` of what it draws; empty for a pass over pixels.
    geometry_passes : int
        How often it draws them, or for depth peeling is expected to.
    target : {"accumulated", "fallback", "unlit"}
        Where its paths add up: the fallback is read where the other does not balance, and pixels are marked invalid
        where there is any in the last.
    cost : float
        Expected time, in multiples of drawing the same objects into a depth buffer.
    """

    name: str
    reason: str
    objects: tuple[int, ...] = ()
    geometry_passes: int = 0
    target: Literal["accumulated", "fallback", "unlit"] = "accumulated"
    cost: float = 0.0


@dataclass(frozen=True)
class RenderPlan:
    """What runs and why.

    Attributes
    ----------
    method : Method
        How thickness is found.
    passes : tuple of PassSpec
        In order.
    spectral : bool
        The passes add up optical depth per channel, since media differ, and not only thickness.
    limits : tuple of str
        Where thickness, transmittance or emission are not exact, and why; empty for an exact plan.
    unmodelled : tuple of str
        What the scene asks for and no pass renders.
    borders : {"both", "front"}
        Where rays bend, if anything in the scene bends them.
    traced : bool
        Rays are traced on the processors, which finds all surfaces on each. Of the `method` only one thing counts
        then: whether bodies are sheets.
    """

    method: Method
    passes: tuple[PassSpec, ...]
    spectral: bool = False
    limits: tuple[str, ...] = ()
    unmodelled: tuple[str, ...] = ()
    borders: Borders = "both"
    traced: bool = False

    @property
    def runs(self) -> str:
        """What finds the thickness, in words: the method, or what is traced in place of it."""
        if not self.traced:
            return str(self.method)
        what = "all surfaces on each ray, in float64"
        return f"{what}, as sheets of {self.method.thickness:g} m" if isinstance(self.method, ThinLayer) else what

    @property
    def exact(self) -> bool:
        """Whether all but what is `unmodelled` is exact for the meshes as given, up to float32."""
        return not self.limits

    @property
    def ordered(self) -> bool:
        """Whether the method finds the intervals of each ray in their order."""
        return self.method.ordered

    @property
    def geometry_passes(self) -> int:
        """How often geometry is drawn in all."""
        return sum(step.geometry_passes for step in self.passes)

    @property
    def cost(self) -> float:
        """Expected time, in depth-only draws: the sum over the passes, each in draws of its own objects."""
        return sum(step.cost for step in self.passes)

    def summary(self) -> dict[str, object]:
        """The plan in values that JSON can hold."""
        return {
            "method": self.runs,
            "exact": self.exact,
            "borders": self.borders,
            "cost": round(self.cost, 2),
            "passes": [
                {
                    "name": step.name,
                    "reason": step.reason,
                    "geometry_passes": step.geometry_passes,
                    "cost": round(step.cost, 2),
                }
                for step in self.passes
            ],
            "limits": list(self.limits),
            "unmodelled": list(self.unmodelled),
        }

    def __str__(self) -> str:
        cost = f", at about the cost of {self.cost:.1f} depth-only draws" if self.cost else ""
        lines = [f"{self.runs}: {'exact' if self.exact else 'not exact everywhere'}{cost}"]
        lines += [f"  {i}. {step.name}: {step.reason}" for i, step in enumerate(self.passes, 1)]
        lines += [f"  limit: {limit}" for limit in self.limits]
        lines += [f"  not modelled: {effect}" for effect in self.unmodelled]
        return "\n".join(lines)
