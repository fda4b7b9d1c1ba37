"""Base class of thickness methods: a frozen configuration, its passes, and traits to choose by; and the ray tracer.

Rays are traced by Embree on the processors, or by shaders.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import brief
from translucent.errors import InputError
from translucent.geometry.ray_caster import embree_refusal
from translucent.planning.passes import Note, PassSpec
from translucent.scene.scene import Scene

#: Largest number of points in an interval: more change nothing that float32 could show.
MAX_LIGHT_POINTS = 16


@dataclass(frozen=True)
class Method:
    """A method to find the thickness of bodies along each view ray; see its subclasses.

    A subclass states its `passes`, and overrides what else is not true of it: traits, `limits`, `check`. What any plan
    has beside (declared sheets, fallbacks of open bodies, opaque objects, shading) is the planner's.

    Attributes
    ----------
    name : str
        On the command line.
    cost : float
        Time of its pass in multiples of drawing the same geometry into a depth buffer, as measured on a software
        rasterizer (`translucent report`).
    ordered : bool
        Finds the intervals of each ray in their order.
    makes_sheets : bool
        Takes every face for a sheet, without an inside.
    tells_media_apart : bool
        Bodies may be filled with different media.
    convex_only : bool
        Pixels that enter a body more than once are marked invalid.
    needs_storage : bool
        Its shaders write to buffers: OpenGL 4.3.
    samples_lights : bool
        Follows lights into media that scatter.
    finds_exits : bool
        Finds where each ray first leaves all bodies.
    peels : bool
        Draws the geometry again for every layer or two.
    marches : bool
        Steps through the intervals, so that what fills them may vary.
    follows_paths : bool
        Follows random paths of light, in place of all that shows interfaces and scattering; thickness is found by
        another method.
    """

    name: ClassVar[str] = ""
    cost: ClassVar[float] = 1.0
    ordered: ClassVar[bool] = False
    makes_sheets: ClassVar[bool] = False
    tells_media_apart: ClassVar[bool] = True
    convex_only: ClassVar[bool] = False
    needs_storage: ClassVar[bool] = False
    samples_lights: ClassVar[bool] = False
    finds_exits: ClassVar[bool] = False
    peels: ClassVar[bool] = False
    marches: ClassVar[bool] = False
    follows_paths: ClassVar[bool] = False

    @property
    def layer_limit(self) -> int | None:
        """Largest number of surfaces on a ray; None where there is no limit. Pixels with more are marked
        invalid.
        """
        return None

    @property
    def light_points(self) -> int:
        """Number of points in each interval at which light from each light is evaluated, where a medium scatters."""
        return 1

    @property
    def usual_thickness(self) -> float | None:
        """Thickness in metres of faces that declare none, where the method makes sheets."""
        return None

    @property
    def counts_from_camera(self) -> bool:
        """True if distances count from the camera, and lose digits with distance."""
        return False

    def check(self, scene: Scene) -> None:
        """Raise `InputError` if the method cannot find the thickness of this scene."""

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Passes of the method, each with its reason; `why` says why this method was chosen."""
        raise NotImplementedError

    def limits(self, scene: Scene) -> list[Note]:
        """Notes on where its thickness is not exact, beyond the limits of every method: see
        `translucent.planning.limits`.
        """
        return []

    def with_thickness(self, thickness: float) -> Method:
        """The method with that thickness, in metres, of faces that declare none; itself where it makes no sheets."""
        return self

    def with_paths(self, paths: int) -> Method:
        """The method with so many paths of each pixel; itself where it follows none."""
        return self


def check_count(what: str, value: object, most: int, *, least: int = 1, example: int = 8) -> None:
    """Raise `InputError` unless a value is a whole number from `least` to `most`."""
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise InputError(
            f"{what} {brief(value)}",
            f"the value must be a whole number in {least} to {most}",
            f"use a value such as {example}",
        )


def check_method(method: object) -> None:
    """Raise `InputError` for a value that is not a method; None leaves the choice to the planner."""
    if method is not None and not isinstance(method, Method):
        raise InputError(
            f"method {brief(method)}", "this is not a thickness method", "use a method such as tl.SignedDepth()"
        )


#: What finds the surfaces that rays hit, by its names; and what plans call it.
HITS = {"embree": "Embree", "gl": "OpenGL"}

#: Time with Embree, as a fraction of that with shaders.
EMBREE_COST = 0.5


#: Samples of a whole picture below which OpenGL finds the hits on processors, too: a bear of 64 x 64 pixels takes .05 s
#: less, and .2 s less where no shader is in the driver's cache; with 16000 samples Embree is as fast.
SMALL_PICTURE = 8192


def check_hits(what: str, hits: str | None) -> None:
    """Raise `InputError` unless this is one of `HITS`, or None."""
    if hits is not None and hits not in HITS:
        raise InputError(
            f"{what} hits {brief(hits)}", "no ray caster has this name", f"use {' or '.join(map(repr, HITS))}"
        )


def chosen_hits(what: str, requested: str | None, software: bool, shader_storage: bool) -> tuple[str, str]:
    """Ray tracer of a plan, one of `HITS`, and the reason why it is not Embree where that would be faster.

    Parameters
    ----------
    what : str
        Whose rays: the name of its class.
    requested : str, optional
        One of `HITS`.
    software : bool
        OpenGL draws on the processors.
    shader_storage : bool
        It has compute shaders that write to buffers.

    Raises
    ------
    InputError
        If Embree is requested and cannot be used.
    """
    if requested == "gl" or (requested is None and not (software and shader_storage)):
        return "gl", ""
    refusal = embree_refusal() if shader_storage else "this OpenGL has no compute shaders, which need version 4.3"
    if not refusal:
        return "embree", ""
    if requested is not None:
        do = "pip install -U embreex, or omit hits" if shader_storage else "leave hits out"
        raise InputError(f'{what}(hits="embree")', refusal, do)
    return "gl", f"{refusal}, so OpenGL finds the hits, in about twice the time; pip install -U embreex"
