"""Request for a picture: one value that callers hand to the planner and the renderer."""

from __future__ import annotations

from dataclasses import dataclass

from translucent.arguments import brief
from translucent.errors import InputError
from translucent.planning.caustics import Caustics
from translucent.planning.flags import Flags
from translucent.planning.interfaces import FrontInterface, InterfaceMode, ScreenInterfaces, TracedInterfaces
from translucent.planning.methods import Method
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.planning.shadow_maps import ShadowMaps

#: More samples per pixel change nothing that 8 bits could show.
MAX_SAMPLES = 4096

#: Names that configurations of interfaces had, and what to write instead.
_OLD_NAMES = {"both": ScreenInterfaces(), "front": FrontInterface()}

#: Choices, their types, what these are called, and examples.
_TYPES: tuple[tuple[str, type, str, tuple[object, ...]], ...] = (
    ("method", Method, "a thickness method", ("SignedDepth()",)),
    ("interfaces", InterfaceMode, "a choice of interfaces", (TracedInterfaces(), ScreenInterfaces(), FrontInterface())),
    ("scattering", Scattering, "a choice of scattering", (Diffusion(), ScatteringLayer(), SingleScattering())),
    ("caustics", Caustics, "tl.Caustics", ("Caustics(photons=1_000_000)",)),
    ("shadows", ShadowMaps, "a choice of shadows", ("ShadowMaps(size=2048)",)),
)


@dataclass(frozen=True)
class RenderRequest(Flags):
    """Request for a picture of a scene; None leaves a choice to the planner. See `Renderer.render`.

    Parameters
    ----------
    method : Method, optional
    samples : int
    interfaces : TracedInterfaces, ScreenInterfaces or FrontInterface, optional
    scattering : Diffusion, ScatteringLayer or SingleScattering, optional
    caustics : Caustics, optional
    shadows : ShadowMaps, optional
    transparent : bool
    denoise : bool
        Take noise out of the picture when it is drawn.
    pixels : int
        Of the picture, by which the planner weighs what takes as long however large it is; 0 if they are not known.
    over_backdrop : bool
        Everything opaque is a picture that is drawn elsewhere.
    **flags : bool
        See `Flags`.

    Raises
    ------
    InputError
        If a value is none of these.
    """

    method: Method | None = None
    samples: int = 1
    interfaces: InterfaceMode | None = None
    scattering: Scattering | None = None
    caustics: Caustics | None = None
    shadows: ShadowMaps | None = None
    transparent: bool = False
    denoise: bool = False
    over_backdrop: bool = False
    pixels: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.samples, int) or not 1 <= self.samples <= MAX_SAMPLES:
            found = f"the number of samples must be a whole number in 1 to {MAX_SAMPLES}"
            raise InputError(f"samples {brief(self.samples)}", found, "use a value such as 16")
        for name, kind, what, examples in _TYPES:
            value = getattr(self, name)
            if value is not None and not isinstance(value, kind):
                *others, last = (f"tl.{example}" for example in examples)
                do = f"give {', '.join(others)} or {last}" if others else f"give for example {last}"
                if name == "interfaces" and isinstance(value, str) and value in _OLD_NAMES:
                    do = f"write interfaces=tl.{_OLD_NAMES[value]}"
                raise InputError(f"{name} {brief(value)}", f"this is not {what}", do)
        if self.denoise and (self.transparent or self.over_backdrop):
            what = "a transparent frame" if self.transparent else "a backdrop"
            do = f"omit denoise, or omit {what.removeprefix('a ')}"
            raise InputError("denoise", f"{what} needs the difference of two pictures, which cannot be denoised", do)
        if self.over_backdrop and self.caustics is not None:
            found = "the objects of a backdrop have no mesh that photons could hit"
            raise InputError("caustics in front of a backdrop", found, "omit the caustics or the backdrop")
