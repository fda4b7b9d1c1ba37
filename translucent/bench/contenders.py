"""Contenders, as data: the methods with their parameters, and the shortcuts of other renderers."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from translucent.bench.record import RowKind
from translucent.bench.scattering.engines import Engine, Frostbite, NormalizedDiffusion, PaintLayer
from translucent.errors import InputError
from translucent.planning.interfaces import FrontInterface, Interfaces, ScreenInterfaces, TracedInterfaces
from translucent.planning.methods import (
    METHODS,
    BackFaceDepth,
    DepthPeeling,
    FragmentLists,
    KBuffer,
    Method,
    PathTraced,
    RayMarched,
    SignedDepth,
    ThinLayer,
)
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.planning.methods.ray_marched import Quadrature
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.scene.scene import Scene

#: Kinds of contenders: by the plan for its method, by a shortcut of the bench, or without OpenGL.
Technique = Literal["plan", "constant", "ball", "unmarked", "half", "cpu", "march", "engine"]

#: Effects of a scene, which decide on the contenders that are measured.
Effect = Literal["absorption", "emission", "scattering", "density", "sheet", "interfaces", "multiple scattering"]

#: Refraction index of the thin layers that bend rays.
REFRACTED_IOR = 1.5

_WHOLE_FRAMES: tuple[Effect, ...] = ("interfaces", "multiple scattering")
_ALL: tuple[Effect, ...] = tuple(effect for effect in get_args(Effect) if effect not in _WHOLE_FRAMES)
_STEPS = (8, 16, 32, 64, 128, 256, 512)
_SOURCES: tuple[Effect, ...] = ("emission", "scattering", "density")

#: Largest number of steps with light scattered into each: more take seconds for a frame.
_MOST_LIT_STEPS = 128

#: Trees of traced interfaces, as depth and forks, and whether brief cases have them: from the cheapest tree to one
#: whose depth is beyond the planner's, which is among them, each with as many forks as pay there.
_TREES = {(2, 0): True, (4, 0): False, (4, 1): True, (8, 1): False, (8, 2): False, (12, 2): True, (16, 3): False}


@dataclass(frozen=True)
class Contender:
    """Contender: one row of every case that it fits.

    Attributes
    ----------
    name, family : str
        As in `translucent.bench.row.Row`.
    method : Method
        With its parameters; with `interfaces`, the planner picks another where the scene needs it. `ThinLayer` and
        shortcuts get the thickness with the least squared error of all, which nobody has who does not know the truth:
        no choice of theirs would do better.
    technique : str
    kind : {"method", "counter-example", "cpu"}
    effects : tuple of str
        Cases in which it is measured.
    brief : bool
        Measured in brief cases, too.
    quick : bool
        Measured with ``--quick``, too, if it is in brief cases.
    pictured : tuple of str
        Cases of which the report shows its picture.
    ior : {"matched", "refracted"}, optional
        Drawn with media of the index of refraction 1 and without surfaces, or else of `REFRACTED_IOR` where they have
        none of their own.
    interfaces : Interfaces, optional
        How they are found, as `translucent.Renderer.render` has it; None where they are not what is measured.
    scattering : Scattering, optional
        How light that is scattered many times is shown; None where that is not what is measured.
    engine : Engine, optional
        What an engine would show of it.
    """

    name: str
    family: str
    method: Method
    technique: Technique = "plan"
    kind: RowKind = "method"
    effects: tuple[Effect, ...] = _ALL
    brief: bool = True
    quick: bool = True
    pictured: tuple[Effect, ...] = ()
    ior: Literal["matched", "refracted"] | None = None
    interfaces: Interfaces | None = None
    scattering: Scattering | None = None
    engine: Engine | None = None

    @property
    def fitted(self) -> bool:
        """True if its thickness, in solids, is chosen to fit the truth best."""
        return self.technique in ("constant", "ball") or self.method.makes_sheets

    @property
    def samplable(self) -> bool:
        """True if several samples of a pixel are another picture, which `Renderer.render` draws."""
        return self.technique in ("plan", "cpu") and not isinstance(self.method, PathTraced)

    def refusal(self, scene: Scene) -> str | None:
        """Reason why it is not measured on a scene, though the planner would run it."""
        if self.technique in ("constant", "ball", "unmarked", "half") and scene.opaque:
            return "the shortcuts are drawn without opaque objects"
        if self.technique == "half" and any(body.sheet_thickness is not None for body in scene.bodies):
            return "signed distances of a sheet mean nothing"
        front = self.interfaces is not None and self.interfaces.one_interface
        if front and all(body.sheet_thickness is not None for body in scene.bodies):
            return "sheets have one interface, at which nothing bends"
        return None


def _ordered() -> Iterable[Contender]:
    for layers in (1, 2, 4, 8):
        name = f"DepthPeeling, {layers} layer{'s' if layers > 1 else ''}"
        yield Contender(
            name,
            "DepthPeeling",
            DepthPeeling(max_layers=layers),
            brief=layers in (2, 8),
            quick=layers == 2,
        )
    yield Contender("DepthPeeling, all layers", "DepthPeeling", DepthPeeling(max_layers=MAX_LAYERS))
    for k in (2, 4, 8):
        yield Contender(f"KBuffer, k = {k}", "KBuffer", KBuffer(k=k), brief=k == 8)
    yield Contender("FragmentLists", "FragmentLists", FragmentLists(), pictured=_SOURCES)


def _light_points() -> Iterable[Contender]:
    for points in (1, 2, 4):  # 8 is what FragmentLists does by itself
        name = f"FragmentLists, {points} light point{'s' if points > 1 else ''}"
        method = FragmentLists(light_points=points)
        yield Contender(name, "FragmentLists", method, effects=("scattering",), brief=points != 2, quick=points == 1)


def _marched() -> Iterable[Contender]:
    # Where media only absorb there is nothing to sum, and marching costs what its fragment lists cost.
    for steps in _STEPS:
        brief = steps in (8, 64)
        yield Contender(
            f"RayMarched, {steps} steps",
            "RayMarched",
            RayMarched(steps=steps),
            effects=_SOURCES if steps <= _MOST_LIT_STEPS else ("emission", "density"),
            brief=brief,
            pictured=_SOURCES if steps == 8 else (),
        )
        yield Contender(
            f"RayMarched on the CPU, {steps} steps",
            "RayMarched on the CPU",
            RayMarched(steps=steps),
            "march",
            "cpu",
            ("density",),
            brief,
            quick=steps == 8,
            pictured=("density",) if steps == 8 else (),
        )
    for rule in get_args(Quadrature):
        if rule != "midpoint":
            steps = 16 if rule == "gauss" else 64  # shaders hold 16 Gauss points
            method = RayMarched(steps=steps, quadrature=rule)
            name = f"RayMarched, {steps} steps, {rule}"
            yield Contender(name, "RayMarched", method, effects=_SOURCES, brief=rule == "equiangular")


def _as_they_are() -> Iterable[Contender]:
    """Contenders of methods without parameters worth rows of their own: none is left out."""
    for method in METHODS.values():
        if method not in (SignedDepth, ThinLayer, DepthPeeling, FragmentLists, KBuffer, RayMarched, PathTraced):
            yield Contender(method.__name__, method.__name__, method())


def _with_interfaces() -> Iterable[Contender]:
    """Ways of finding interfaces; and what viewers of glTF do, one interface before a constant thickness."""
    every: tuple[Effect, ...] = ("interfaces",)
    front, screen = FrontInterface(), ScreenInterfaces()
    yield Contender(
        "constant thickness, one interface",
        "constant thickness",
        SignedDepth(),
        "constant",
        "counter-example",
        every,
        pictured=every,
        interfaces=front,
    )
    yield Contender(
        "straight rays",
        "straight rays",
        SignedDepth(),
        kind="counter-example",
        effects=every,
        ior="matched",
        interfaces=screen,  # of which matched media have none
    )
    for one in (front, screen):
        name = type(one).__name__
        yield Contender(name, name, SignedDepth(), effects=every, pictured=every, interfaces=one)
    for (depth, forks), brief in _TREES.items():
        yield Contender(
            f"TracedInterfaces, depth {depth}, {'1 fork' if forks == 1 else f'{forks} forks'}",
            "TracedInterfaces",
            SignedDepth(),
            effects=every,
            brief=brief,
            quick=depth != 4,
            pictured=every if (depth, forks) in ((2, 0), (12, 2)) else (),
            interfaces=TracedInterfaces(depth, forks),
        )


#: Ways of showing light that is scattered many times, and whether ``--quick`` and brief cases have them.
_SCATTERINGS: dict[str, tuple[Scattering, bool]] = {
    "SingleScattering": (SingleScattering(), False),
    "ScatteringLayer": (ScatteringLayer(), True),
    "Diffusion, resolution 16": (Diffusion(16), True),
    "Diffusion, resolution 24": (Diffusion(24), False),
    "Diffusion, resolution 32": (Diffusion(32), True),
    "Diffusion, resolution 48": (Diffusion(48), False),
}

#: Paths of each pixel; with fewer than two there is no standard error.
_PATHS = (2, 4, 16)

#: What engines show of it.
_ENGINES: tuple[Engine, ...] = (PaintLayer(), NormalizedDiffusion(), Frostbite())


def _with_scattering() -> Iterable[Contender]:
    every: tuple[Effect, ...] = ("multiple scattering",)
    for engine in _ENGINES:
        yield Contender(
            engine.name,
            engine.name,
            SignedDepth(),
            "engine",
            "counter-example",
            every,
            pictured=every,
            engine=engine,
        )
    for name, (scattering, brief) in _SCATTERINGS.items():
        yield Contender(
            name,
            type(scattering).__name__,
            SignedDepth(),
            effects=every,
            brief=brief,
            pictured=every,
            scattering=scattering,
        )


def _path_traced() -> Iterable[Contender]:
    for paths in _PATHS:
        yield Contender(
            f"PathTraced, {paths} paths",
            "PathTraced",
            PathTraced(paths=paths),
            effects=_WHOLE_FRAMES,
            brief=False,
            pictured=_WHOLE_FRAMES if paths == _PATHS[-1] else (),
        )


CONTENDERS: tuple[Contender, ...] = (
    Contender("constant thickness", "constant thickness", ThinLayer(), "constant", "counter-example", pictured=_ALL),
    Contender("sphere assumption", "sphere assumption", ThinLayer(), "ball", "counter-example"),
    Contender("ThinLayer", "ThinLayer", ThinLayer(), ior="matched"),
    Contender("ThinLayer, refracted", "ThinLayer", ThinLayer(), brief=False, ior="refracted"),
    *_as_they_are(),
    Contender(
        "BackFaceDepth, unmarked",
        "BackFaceDepth",
        BackFaceDepth(),
        "unmarked",
        "counter-example",
        pictured=("absorption", "emission"),
    ),
    Contender("SignedDepth", "SignedDepth", SignedDepth(), pictured=_ALL),
    Contender(
        "SignedDepth from the camera",
        "SignedDepth",
        SignedDepth(anchored=False),
        kind="counter-example",
        pictured=("absorption",),
    ),
    Contender(
        "SignedDepth in float16", "SignedDepth", SignedDepth(), "half", "counter-example", pictured=("absorption",)
    ),
    *_ordered(),
    *_light_points(),
    *_marched(),
    *_with_interfaces(),
    *_with_scattering(),
    *_path_traced(),
    Contender("cpu backend", "cpu backend", FragmentLists(), "cpu", "cpu", (*_ALL, "interfaces"), brief=False),
)


def contenders(effect: Effect, *, quick: bool, brief: bool = False, only: Iterable[str] = ()) -> tuple[Contender, ...]:
    """Contenders on a case of this effect, with ``--quick`` or in a brief case fewer; `only` names contenders or
    families, as `check_names` accepts them.
    """
    wanted = {_slug(name) for name in only}
    return tuple(
        one
        for one in CONTENDERS
        if effect in one.effects
        and (wanted or one.brief or not (quick or brief))
        and (wanted or one.quick or not quick)
        and (not wanted or wanted & {_slug(one.name), _slug(one.family)})
    )


def check_names(names: Iterable[str]) -> None:
    """Raise `InputError` if a name is that of no contender and of no family: ``depth-peeling``, ``ThinLayer``."""
    known = {_slug(text) for one in CONTENDERS for text in (one.name, one.family)}
    families = sorted({_slug(one.family) for one in CONTENDERS})
    for name in names:
        if _slug(name) not in known:
            close = difflib.get_close_matches(_slug(name), sorted(known), n=1)
            do = f"did you mean {close[0]}?" if close else f"use some of {', '.join(families)}"
            raise InputError(f"method {name!r}", "not one that is measured", do)


def _slug(name: str) -> str:
    """Slug of a name, in lower case with words joined by dashes: ``DepthPeeling, 8 layers`` is
    ``depth-peeling-8-layers``.
    """
    spaced = "".join(f" {letter}" if letter.isupper() and i else letter for i, letter in enumerate(name))
    words = "".join(letter if letter.isalnum() else " " for letter in spaced.lower()).split()
    return "-".join(words).replace("c-p-u", "cpu")
