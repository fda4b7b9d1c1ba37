"""Contenders: the methods with their parameters, and the shortcuts of other renderers, each a row of a case."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from translucent import reference
from translucent.bench.drawing import BenchContext, Drawing, FrameDrawing, PlanDrawing, ShortcutDrawing, Size
from translucent.bench.engines import Engine, Frostbite, NormalizedDiffusion, PaintLayer, visible_points
from translucent.bench.record import Quantity, RowKind
from translucent.errors import InputError, closest_name
from translucent.frames.frame import Frame
from translucent.gpu.passes.shortcuts import HalfFloatPass, NearestFace, NearestFacePass, Shortcut, UnmarkedBackFacePass
from translucent.gpu.targets import Targets
from translucent.planning.interfaces import FrontInterface, ScreenInterfaces, TracedInterfaces
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
from translucent.planning.passes import NoteKind, PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.renderer import Renderer
from translucent.scene.scene import Object, Scene

#: Effects of a scene, which decide on the contenders that are measured.
Effect = Literal[
    "absorption", "emission", "scattering", "density", "sheet", "interfaces", "multiple scattering", "all light"
]

#: Contender whose choices are the planner's.
PLANNED = "as planned"

#: Contender whose target has half of the bits.
IN_FLOAT16 = "SignedDepth in float16"

#: Refraction index of the thin layers that bend rays.
REFRACTED_IOR = 1.5

_WHOLE_FRAMES: tuple[Effect, ...] = ("interfaces", "multiple scattering", "all light")
_ALL: tuple[Effect, ...] = tuple(effect for effect in get_args(Effect) if effect not in _WHOLE_FRAMES)
_SOURCES: tuple[Effect, ...] = ("emission", "scattering", "density")
_INTERFACES: tuple[Effect, ...] = ("interfaces",)
_SCATTERING: tuple[Effect, ...] = ("multiple scattering",)

#: Steps of marching; with more than so many, light scattered into each takes seconds for a frame.
_STEPS, _MOST_LIT_STEPS = (8, 16, 32, 64, 128, 256, 512), 128

#: Light that a sum of one event each does not have; rows say so by their effect.
_LIT = (NoteKind.SCATTERED_AGAIN,)

#: Effects that change pictures, but not the thickness along straight rays.
_BESIDE_THICKNESS = (
    *_LIT,
    NoteKind.LIGHTS_LEFT_OUT,
    NoteKind.ONLY_REMOVES,
    NoteKind.REFRACTION,
    NoteKind.LATER_REFRACTION,
    NoteKind.CUT_OFF_PATHS,
)

#: Trees of traced interfaces, as depth and forks, and whether brief cases have them: from the cheapest to that of the
#: planner, and one with more forks.
_TREES = {
    (2, 0): True,
    (4, 0): False,
    (4, 1): True,
    (8, 1): False,
    (8, 2): False,
    (12, 2): True,
    (16, 3): False,
    (24, 2): True,
}

#: Treatments of light that is scattered many times, whether brief cases have them, and what they promise: no bound.
_DIFFUSES = "no bound: light diffuses, which it does a few mean free paths below the surface"
_SCATTERINGS: dict[str, tuple[Scattering, bool, str]] = {
    "SingleScattering": (
        SingleScattering(),
        False,
        "light of punctual lights scattered once; the rest is lost",
    ),
    "ScatteringLayer": (
        ScatteringLayer(),
        True,
        "no bound: exact for a wide flat slab in diffuse light; nothing spreads sideways",
    ),
    "Diffusion, resolution 16": (Diffusion(16), True, _DIFFUSES),
    "Diffusion, resolution 24": (Diffusion(24), False, _DIFFUSES),
    "Diffusion, resolution 32": (Diffusion(32), True, _DIFFUSES),
    "Diffusion, resolution 48": (Diffusion(48), False, _DIFFUSES),
}

#: Paths of each pixel; with fewer than two there is no standard error.
_PATHS = (2, 4, 16)


@dataclass(frozen=True, kw_only=True)
class Contender:
    """Method of the public API, or a technique of another renderer: one row in each case that it can render.

    Attributes
    ----------
    name, family : str
        As in a row.
    method : Method
        With its parameters. A thin layer gets the thickness with the least squared error of all, which nobody has who
        does not know the truth: no choice would do better.
    choices : mapping of str to object
        Requested of the planner in place of `method`, which then follows from the scene.
    shortcut : callable, optional
        Makes what finds the thickness in place of a plan's passes, of the context and the thickness that is assumed.
    engine : Engine, optional
        Its light, on a frame of our own, is what is drawn.
    kind : {"method", "counter-example", "cpu"}
        Without OpenGL, it is drawn by the backend ``cpu``; a method that marches, by the reference.
    effects : tuple of str
        Cases in which it is measured.
    brief : bool
        Measured in brief cases, too.
    quick : bool
        Measured with ``--quick``, too, if it is in brief cases.
    pictured : tuple of str
        Cases whose page shows its picture.
    ior : {"matched", "refracted"}, optional
        Drawn with media of the index of refraction 1 and without surfaces, or else of `REFRACTED_IOR` where they have
        none of their own.
    fits : bool
        A shortcut that assumes a thickness.
    said, shown : str
        Its promise where that does not follow from the plan, and its parameters where they are not the method's.
    thickness : float
        That it assumes, in metres, once it is fitted.
    """

    name: str
    family: str
    method: Method = field(default_factory=SignedDepth)
    choices: Mapping[str, Any] = field(default_factory=dict)
    shortcut: Callable[[BenchContext, float], Shortcut] | None = None
    engine: Engine | None = None
    kind: RowKind = "method"
    effects: tuple[Effect, ...] = _ALL
    brief: bool = True
    quick: bool = True
    pictured: tuple[Effect, ...] = ()
    ior: Literal["matched", "refracted"] | None = None
    fits: bool = False
    said: str = ""
    shown: str = ""
    thickness: float = 0.0

    def scene(self, scene: Scene) -> Scene:
        """Scene with the contender's index of refraction."""
        if self.ior is None:
            return scene

        def bent(body: Object) -> Object:
            if body.medium is None:
                return body
            own = body.medium.ior if body.medium.ior > 1 else REFRACTED_IOR
            ior = 1.0 if self.ior == "matched" else own
            surface = None if self.ior == "matched" else body.surface
            return dataclasses.replace(body, medium=dataclasses.replace(body.medium, ior=ior), surface=surface)

        return dataclasses.replace(scene, objects=[bent(body) for body in scene.objects])

    def refusal(self, scene: Scene) -> str | None:
        """Reason why it is not measured on a scene, though the planner would run it."""
        interfaces = self.choices.get("interfaces")
        if self.shortcut is not None and scene.opaque:
            return "the shortcuts are drawn without opaque objects"
        if self.name == IN_FLOAT16 and any(body.sheet_thickness is not None for body in scene.bodies):
            return "signed distances of a sheet mean nothing"
        if interfaces is not None and interfaces.one_interface and _sheets(scene):
            return "sheets have one interface, at which nothing bends"
        return None

    def plan(self, bench: BenchContext, scene: Scene) -> RenderPlan:
        """Plan of the contender; raises `InputError` if the planner refuses."""
        if self.kind != "cpu":
            return bench.renderer.plan(scene, **(self.choices or {"method": self.method}))
        if bench.cpu is None:
            raise InputError(self.name, "Embree cannot be loaded", "pip install embreex")
        return bench.cpu.plan(scene, scattering=SingleScattering())  # as the reference has it

    def drawing(self, bench: BenchContext, scene: Scene, plan: RenderPlan, targets: Targets) -> Drawing:
        """Frame of the contender, ready to be drawn."""
        if self.shortcut is not None:
            return ShortcutDrawing(bench, scene, targets, plan, self.shortcut(bench, self.thickness))
        if self.engine is not None:
            return FrameDrawing(bench, partial(_engine_frame, bench.renderer, scene, targets.size, self.engine))
        if self.kind == "cpu" and isinstance(self.method, RayMarched):
            return FrameDrawing(bench, partial(reference.march, scene, targets.size, self.method))
        if self.kind == "cpu":
            return FrameDrawing(bench, partial(self.sampled, bench, scene, targets.size, 1))
        return PlanDrawing(bench, plan, targets)

    def sampled(self, bench: BenchContext, scene: Scene, size: Size, samples: int) -> Frame:
        """Frame with several samples of each pixel."""
        if self.kind != "cpu":
            return bench.renderer.render(scene, size, samples=samples, **self.choices)
        assert bench.cpu is not None, "there is a plan for it"
        return bench.cpu.render(scene, size, samples=samples, scattering=SingleScattering())

    def passes_of(self, plan: RenderPlan) -> int | None:
        """Number of draws of the geometry; None without OpenGL."""
        if self.kind == "cpu":
            return None
        return 1 if self.fits or self.engine is not None else plan.geometry_passes

    def parameters(self, plan: RenderPlan | None) -> str:
        """Configuration as Python writes it, followed by that of interfaces."""
        if scattering := self.engine or self.choices.get("scattering"):
            return str(scattering)
        interfaces = self.choices.get("interfaces") if plan is None else plan.interfaces
        found = self.shown or str(self.method if plan is None or not self.choices else plan.method)
        if self.thickness:
            found = f"{self.thickness:.4g} m, of least squared error"
        return found if interfaces is None else f"{found}, {interfaces}"

    def fitted(self, bench: BenchContext, scene: Scene, truth: Frame) -> Contender:
        """The contender with the thickness, or the settings of an engine, of least squared error.

        Thickness is proportional to what is assumed, so one picture suffices: with t for 1 m, the best is <t d> / <t t>
        over all pixels that truth or picture cover. That of sheets is declared.
        """
        if self.engine is not None:
            visible = visible_points(bench.renderer, scene, truth.size)
            return dataclasses.replace(self, engine=self.engine.fitted(visible, truth.radiance))
        if not (self.fits or (self.method.makes_sheets and not _sheets(scene))):
            return self
        probe = float(scene.diagonal)
        trial = self._assuming(probe)
        frame = drawn_once(bench, trial, scene, trial.plan(bench, scene), truth.size).frame
        used = truth.valid & (truth.coverage | frame.coverage)
        shape = np.asarray(frame.thickness, np.float64)[used] / probe
        best = float(np.sum(shape * truth.thickness[used]) / max(np.sum(shape**2), np.finfo(np.float64).tiny))
        return self._assuming(best)

    def _assuming(self, thickness: float) -> Contender:
        method = ThinLayer(thickness) if self.method.makes_sheets else self.method
        return dataclasses.replace(self, method=method, thickness=thickness)

    def promise(self, plan: RenderPlan, scene: Scene, quantity: Quantity) -> tuple[str, bool]:
        """Accuracy that is promised in a quantity, in words, and whether it is exact."""
        if self.said:
            return self.said, False
        points = self.method.light_points
        media = [(body.medium, body.density) for body in scene.bodies if body.medium is not None]
        if self.method.marches and any(medium.emits or medium.scatters or density for medium, density in media):
            return f"sums over {points} steps in each interval", False
        if plan.has(PassName.LIGHT_VIEWS):
            return f"{points} points of an interval look at the lights; {'; '.join(plan.limits)}".rstrip("; "), False
        beside = _BESIDE_THICKNESS if quantity == "thickness" else _LIT
        limits = [*plan.limits, *(effect for effect in plan.unmodelled if effect.kind not in beside)]
        return "; ".join(map(str, limits)) or "exact", not limits


def _engine_frame(renderer: Renderer, scene: Scene, size: Size, engine: Engine) -> Frame:
    visible = visible_points(renderer, scene, size)
    return visible.frame(engine.light(visible))


class Drawn(NamedTuple):
    """Frame of a contender, its bytes per pixel, and the seconds of the diffusion solve; None where there are none."""

    frame: Frame
    bytes_per_pixel: int | None
    solve_seconds: float | None


def drawn_once(bench: BenchContext, contender: Contender, scene: Scene, plan: RenderPlan, size: Size) -> Drawn:
    """Draw a contender once."""
    targets = Targets(bench.gl, size)
    try:
        drawing = contender.drawing(bench, scene, plan, targets)
        try:
            drawing.draw()
            return Drawn(drawing.read(), drawing.bytes_per_pixel, drawing.solve_seconds)
        finally:
            drawing.release()
    finally:
        targets.release()


def _sheets(scene: Scene) -> bool:
    return all(body.sheet_thickness is not None for body in scene.bodies)


def _nearest_face(sphere: bool) -> Callable[[BenchContext, float], Shortcut]:
    return lambda bench, thickness: NearestFace(bench.own(NearestFacePass), sphere=sphere, size=thickness)


def _straight_lines() -> Iterable[Contender]:
    """Thickness along straight rays: shortcuts, and methods that need no order."""
    shortcut = partial(Contender, kind="counter-example")
    nearest = "none: the nearest face alone, with the best thickness that there is"
    for name, size, sphere in (("constant thickness", "constant", False), ("sphere assumption", "diameter", True)):
        yield shortcut(
            name=name,
            family=name,
            said=nearest,
            shown=f"best {size} in metres",
            shortcut=_nearest_face(sphere),
            fits=True,
            pictured=() if sphere else _ALL,
        )
    yield Contender(name="ThinLayer", family="ThinLayer", method=ThinLayer(), ior="matched")
    yield Contender(name="ThinLayer, refracted", family="ThinLayer", method=ThinLayer(), ior="refracted", brief=False)
    for method in METHODS.values():
        # Those without parameters worth rows of their own, whichever there are.
        if method not in (SignedDepth, ThinLayer, DepthPeeling, FragmentLists, KBuffer, RayMarched, PathTraced):
            yield Contender(name=method.__name__, family=method.__name__, method=method())
    yield shortcut(
        name="BackFaceDepth, unmarked",
        family="BackFaceDepth",
        method=BackFaceDepth(),
        said="exact for convex bodies; says nothing where a body is not",
        shown="BackFaceDepth() without its mask",
        shortcut=lambda bench, _: bench.own(UnmarkedBackFacePass),
        pictured=("absorption", "emission"),
    )
    signed = partial(Contender, family="SignedDepth")
    pictured: tuple[Effect, ...] = ("absorption",)
    camera = SignedDepth(anchored=False)
    yield signed(name="SignedDepth", pictured=_ALL)
    yield signed(name="SignedDepth from the camera", method=camera, kind="counter-example", pictured=pictured)
    yield signed(
        name=IN_FLOAT16,
        kind="counter-example",
        said="none: 11 bits for sums of signed distances",
        shown="SignedDepth(anchored=True) into float16",
        shortcut=lambda bench, _: bench.own(HalfFloatPass),
        pictured=pictured,
    )


def _in_order() -> Iterable[Contender]:
    """Methods that put surfaces in order, and march."""
    for layers in (1, 2, 4, 8):
        yield Contender(
            name=f"DepthPeeling, {layers} layer{'s' if layers > 1 else ''}",
            family="DepthPeeling",
            method=DepthPeeling(max_layers=layers),
            brief=layers in (2, 8),
            quick=layers == 2,
        )
    every = DepthPeeling(max_layers=MAX_LAYERS)
    yield Contender(name="DepthPeeling, all layers", family="DepthPeeling", method=every)
    for k in (2, 4, 8):
        yield Contender(name=f"KBuffer, k = {k}", family="KBuffer", method=KBuffer(k=k), brief=k == 8)
    lists = partial(Contender, family="FragmentLists")
    yield lists(name="FragmentLists", method=FragmentLists(), pictured=_SOURCES)
    for points in (1, 2, 4):  # 8 is what FragmentLists does by itself
        name = f"FragmentLists, {points} light point{'s' if points > 1 else ''}"
        method = FragmentLists(light_points=points)
        yield lists(name=name, method=method, effects=("scattering",), brief=points != 2, quick=points == 1)
    # Where media only absorb there is nothing to sum, and marching costs what its fragment lists cost.
    for steps in _STEPS:
        yield Contender(
            name=f"RayMarched, {steps} steps",
            family="RayMarched",
            method=RayMarched(steps=steps),
            effects=_SOURCES if steps <= _MOST_LIT_STEPS else ("emission", "density"),
            brief=steps in (8, 64),
            pictured=_SOURCES if steps == 8 else (),
        )
        yield Contender(
            name=f"RayMarched on the CPU, {steps} steps",
            family="RayMarched on the CPU",
            kind="cpu",
            method=RayMarched(steps=steps),
            said=f"sums over {steps} steps in each interval",
            shown=f"reference.march with {RayMarched(steps=steps)}",
            effects=("density",),
            brief=steps in (8, 64),
            quick=steps == 8,
            pictured=("density",) if steps == 8 else (),
        )
    for rule in get_args(Quadrature):
        if rule != "midpoint":
            steps = 16 if rule == "gauss" else 64  # shaders hold 16 Gauss points
            marched = RayMarched(steps=steps, quadrature=rule)
            name, brief = f"RayMarched, {steps} steps, {rule}", rule == "equiangular"
            yield Contender(name=name, family="RayMarched", method=marched, effects=_SOURCES, brief=brief)


def _with_interfaces() -> Iterable[Contender]:
    """Contenders for interfaces, including glTF viewers: one interface in front of a constant thickness."""
    made = partial(Contender, effects=_INTERFACES)
    front, screen = FrontInterface(), ScreenInterfaces()
    yield made(
        name="constant thickness, one interface",
        family="constant thickness",
        choices={"interfaces": front},
        said="none: the best constant thickness, and rays that bend once, where they enter",
        shown="best constant in metres",
        shortcut=_nearest_face(sphere=False),
        fits=True,
        kind="counter-example",
        pictured=_INTERFACES,
    )
    yield made(
        name="straight rays",
        family="straight rays",
        kind="counter-example",
        ior="matched",
        choices={"interfaces": screen},  # matched media have none
        said="none: interfaces are left out",
    )
    for one in (front, screen):
        name = type(one).__name__
        yield made(name=name, family=name, pictured=_INTERFACES, choices={"interfaces": one})
    for (depth, forks), brief in _TREES.items():
        yield made(
            name=f"TracedInterfaces, depth {depth}, {'1 fork' if forks == 1 else f'{forks} forks'}",
            family="TracedInterfaces",
            brief=brief,
            quick=depth != 4,
            pictured=_INTERFACES if (depth, forks) in ((2, 0), (12, 2)) else (),
            choices={"interfaces": TracedInterfaces(depth, forks)},
        )


def _with_scattering() -> Iterable[Contender]:
    """Contenders for multiple scattering, including the approximations of game engines."""
    often: dict[str, Any] = {"effects": _SCATTERING, "pictured": _SCATTERING}
    for engine in (PaintLayer(), NormalizedDiffusion(), Frostbite()):
        yield Contender(
            name=engine.name,
            family=engine.name,
            kind="counter-example",
            engine=engine,
            said=engine.promise,
            choices={"scattering": SingleScattering()},
            **often,
        )
    for name, (scattering, brief, said) in _SCATTERINGS.items():
        family, choices = type(scattering).__name__, {"scattering": scattering}
        yield Contender(name=name, family=family, brief=brief, said=said, choices=choices, **often)


def _planned() -> Iterable[Contender]:
    """Contender that the planner chooses."""
    said = "no bound: its notes say what is left out"
    lit: tuple[Effect, ...] = ("all light",)
    yield Contender(name=PLANNED, family=PLANNED, effects=lit, pictured=lit, choices={"method": None}, said=said)


def _path_traced() -> Iterable[Contender]:
    for paths in _PATHS:
        yield Contender(
            name=f"PathTraced, {paths} paths",
            family="PathTraced",
            method=PathTraced(paths=paths),
            effects=_WHOLE_FRAMES,
            brief=False,
            pictured=_WHOLE_FRAMES if paths == _PATHS[-1] else (),
        )


CONTENDERS: tuple[Contender, ...] = (
    *_straight_lines(),
    *_in_order(),
    *_with_interfaces(),
    *_with_scattering(),
    *_planned(),
    *_path_traced(),
    Contender(
        name="cpu backend",
        family="cpu backend",
        kind="cpu",
        shown='Renderer(backend="cpu")',
        method=FragmentLists(),
        effects=(*_ALL, "interfaces"),
        brief=False,
    ),
)


def contenders(effect: Effect, *, quick: bool, brief: bool = False, only: Iterable[str] = ()) -> tuple[Contender, ...]:
    """Contenders on a case of this effect, with ``--quick`` or in a brief case fewer; `only` names contenders or
    families, as `check_names` accepts them.
    """
    requested = {_slug(name) for name in only}
    return tuple(
        one
        for one in CONTENDERS
        if effect in one.effects
        and (requested or one.brief or not (quick or brief))
        and (requested or one.quick or not quick)
        and (not requested or requested & {_slug(one.name), _slug(one.family)})
    )


def check_names(names: Iterable[str]) -> None:
    """Raise `InputError` if a name is that of no contender and of no family: ``depth-peeling``, ``ThinLayer``."""
    known = {_slug(text) for one in CONTENDERS for text in (one.name, one.family)}
    for name in names:
        if _slug(name) not in known:
            families = sorted({_slug(one.family) for one in CONTENDERS})
            do = closest_name(_slug(name), sorted(known), f"use some of {', '.join(families)}")
            raise InputError(f"method {name!r}", "the report does not measure this method", do)


def _slug(name: str) -> str:
    """Slug of a name, in lower case with words joined by dashes: ``DepthPeeling, 8 layers`` is
    ``depth-peeling-8-layers``.
    """
    spaced = "".join(f" {letter}" if letter.isupper() and i else letter for i, letter in enumerate(name))
    words = "".join(letter if letter.isalnum() else " " for letter in spaced.lower()).split()
    return "-".join(words).replace("c-p-u", "cpu")
