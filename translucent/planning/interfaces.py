"""Ways to find the interfaces at which light refracts and reflects, and the choice among them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.planning.bodies import indices, overlapping_pair
from translucent.planning.methods.base import check_count, check_hits
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.rendered import Treatment, treatment_of
from translucent.planning.shadow_maps import dims_interfaces
from translucent.scene.grounds import mirror_of
from translucent.scene.scene import Object, Scene, object_names

#: Time of drawing the interfaces where rays enter and where they leave, in depth-only draws of the same geometry, as
#: measured on a software rasterizer.
DRAW_COST = 4.0

#: Time of shading both, likewise, beside 90,000 triangles.
SHADE_COST = 8.0

#: Time of drawing one interface of each body, as a fraction of that of two; measured likewise.
ONE_DRAWN = 0.4

#: Time of shading one interface, as a fraction of that of two; measured likewise.
ONE_SHADED = 0.45

#: Note of a plan in which rays hit interfaces as far as the first interval shows them.
LATER_REFRACTION = Note(
    NoteKind.LATER_REFRACTION,
    ("after the first body on a ray, the ray goes straight, and later interfaces reflect only the environment"),
)


@dataclass(frozen=True)
class InterfaceMode:
    """A method to find the interfaces at which light refracts and reflects; see its subclasses.

    Attributes
    ----------
    name : str
        On the command line.
    traced : bool
        Follows rays through the meshes, from interface to interface.
    one_interface : bool
        Bends rays where they enter a body, and not where they leave it.
    finds_exits : bool
        Draws the interface where rays leave a body, beside that where they enter.
    """

    name: ClassVar[str] = ""
    traced: ClassVar[bool] = False
    one_interface: ClassVar[bool] = False
    finds_exits: ClassVar[bool] = False

    @property
    def tree(self) -> tuple[int, int]:
        """Number of interfaces that a traced ray may hit, and of forks."""
        return 0, 0

    def refusal(self, scene: Scene) -> tuple[str, str] | None:
        """Reason why this method cannot render a scene, and advice; None if it can."""
        return None

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes that find and shade interfaces; `straight` if all of them are of sheets, which bend no ray."""
        raise NotImplementedError

    def unmodelled(self) -> list[Note]:
        """Notes on refracted and reflected light that is not rendered."""
        raise NotImplementedError


def with_interfaces(scene: Scene) -> tuple[int, ...]:
    """Indices of the objects whose interfaces change light."""
    return indices(scene, lambda item: item.has_interface)


def starts_inside(scene: Scene, body: Object) -> bool:
    """True if rays of the camera may start inside a body."""
    if scene.camera.fov_y is None:
        return picture_cuts(scene, body)
    low, high = body.bounds - scene.camera.eye
    around = bool((low <= 0).all() and (high >= 0).all())
    # On a surface the winding number is the mean of both sides.
    return around and round(abs(body.winding_number(scene.camera.eye)), 6) >= 0.5


def picture_cuts(scene: Scene, body: Object) -> bool:
    """True if an orthographic picture's plane, where its rays start, cuts the bounds of a body."""
    if scene.camera.fov_y is not None:
        return False
    low, high = body.bounds - scene.camera.eye
    forward = scene.camera.forward
    return bool(np.where(forward > 0, low, high) @ forward < 0 < np.where(forward > 0, high, low) @ forward)


def touching_interfaces(scene: Scene) -> str | None:
    """Reason why touching bodies with interfaces need ordered surfaces; None if none may touch."""
    solids = [body for body in scene.bodies if body.sheet_thickness is None]
    bends = np.array([body.has_interface for body in solids])
    if not bends.any() or (found := overlapping_pair(solids, lambda one, other: bends[one] | bends[other])) is None:
        return None
    earlier, later = (solids[index] for index in found)
    names = f"{earlier.mesh.name!r} and {later.mesh.name!r}"
    return f"interfaces of {names} may touch, so the order of surfaces decides where a ray leaves both"


def owners(scene: Scene) -> str:
    """Names of the objects whose interfaces change light."""
    return object_names(scene.objects[i] for i in with_interfaces(scene))


def effects_of(scene: Scene, *, bends: bool = True, mirrored: str = "the environment") -> str:
    """Effects of the interfaces of a scene: whether they bend rays, and what they mirror."""
    bodies = [body for body in scene.bodies if body.has_interface]
    surfaces = [body.surface for body in bodies if body.surface is not None]
    effects = []
    if any(body.medium is not None and body.medium.ior > 1 for body in bodies):
        effects.append(f"interfaces reflect {mirrored}{' and refract rays' if bends else ''} (ior above 1)")
    if any(surface.roughness > 0 for surface in surfaces):
        effects.append("rough interfaces blur the light")
    if bends and any(surface.dispersion > 0 for surface in surfaces):
        effects.append("dispersion refracts each color channel differently")
    if any(surface.iridescence for surface in surfaces):
        effects.append("thin films color the reflection")
    if any(surface.clearcoat for surface in surfaces):
        effects.append("clear coats reflect above the interfaces")
    if any(surface.transmission < 1 for surface in surfaces):
        effects.append("a diffuse base reflects light that does not enter")
    if any((np.asarray(surface.color) != 1).any() or surface.color_texture for surface in surfaces):
        effects.append("colors tint light that enters")
    if any(treatment_of(body) is Treatment.LAYER for body in bodies):
        effects.append("multiply scattered light leaves as from a flat layer (Kubelka and Munk, Saunderson)")
    if any(treatment_of(body) is Treatment.DIFFUSION for body in bodies):
        effects.append("multiply scattered light diffuses in the body and leaves through the surface")
    return "; ".join(effects) or "interfaces"


#: Note of a plan in which rays refract at the front interface alone.
ONE_INTERFACE = Note(
    NoteKind.ONE_INTERFACE,
    "FrontInterface: rays refract only where they enter a body, so they leave curved bodies in wrong directions",
)


@dataclass(frozen=True)
class FrontInterface(InterfaceMode):
    """The interface where each ray enters a body, and none where it leaves, as viewers of glTF have it.

    In one draw less than `ScreenInterfaces`; right for thin bodies, wrong for curved ones (KHR_materials_volume,
    Khronos 2021, leaves what happens inside to the viewer). Absorption is that of the straight ray.
    """

    name: ClassVar[str] = "front"
    one_interface: ClassVar[bool] = True

    def refusal(self, scene: Scene) -> tuple[str, str] | None:
        """Reason if rays start inside a body, where there is no front interface."""
        for body in scene.bodies:
            if body.has_interface and body.sheet_thickness is None and starts_inside(scene, body):
                return (
                    f"rays start inside {body.mesh.name!r}, so no interface is in front of it",
                    "use ScreenInterfaces(), or move the camera outside",
                )
        return None

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes: one draw of all bodies with interfaces, and one over pixels."""
        found = f"{owners(scene)}: normal and position of the interface where each ray enters"
        shaded = f"{effects_of(scene)}; rays are refracted where they enter, and then go straight"
        return (
            PassSpec(PassName.INTERFACES, found, with_interfaces(scene), 1, cost=DRAW_COST * ONE_DRAWN),
            PassSpec(PassName.SURFACES, shaded, cost=SHADE_COST * ONE_SHADED),
        )

    def unmodelled(self) -> list[Note]:
        """Notes on later refraction, and on missing refraction at exits."""
        return [LATER_REFRACTION, ONE_INTERFACE]


@dataclass(frozen=True)
class ScreenInterfaces(InterfaceMode):
    """The interface where each ray enters a body and the one where it leaves, both drawn in screen space (Wyman 2005).

    What lies farther on is crossed straight, interfaces mirror the environment only, and refracted rays find opaque
    surfaces as far as the picture shows them.
    """

    name: ClassVar[str] = "screen"
    finds_exits: ClassVar[bool] = True

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes: two draws of all bodies with interfaces, or one of sheets; and one over pixels."""
        objects, names = with_interfaces(scene), owners(scene)
        if straight:
            # What bends on entering a sheet bends back on leaving it: each has one interface, that towards the eye.
            return (
                PassSpec(
                    PassName.INTERFACES,
                    f"{names}: normal and position of the first sheet on each ray",
                    objects,
                    1,
                    cost=DRAW_COST * ONE_DRAWN,
                ),
                PassSpec(
                    PassName.SURFACES,
                    f"{effects_of(scene, bends=False)}; rays go straight through sheets",
                    cost=SHADE_COST,
                ),
            )
        found = f"{names}: normals and positions of the interfaces where each ray enters and leaves"
        shaded = f"{effects_of(scene)}; the refracted path through the first interval is followed"
        return (
            PassSpec(PassName.INTERFACES, found, objects, 2, cost=DRAW_COST),
            PassSpec(PassName.SURFACES, shaded, cost=SHADE_COST),
        )

    def unmodelled(self) -> list[Note]:
        """Notes on later refraction."""
        return [LATER_REFRACTION]


#: Largest number of interfaces that a ray may hit: each takes a walk through the meshes.
MAX_DEPTH = 64

#: Bodies that a traced ray can be in at once.
INTERIOR_SIZE = 8

#: Largest number of forks: rays multiply with each.
MAX_FORKS = 4

#: Time of tracing, in depth-only draws of the same geometry, on a software rasterizer: on polished bodies 45 to 185 in
#: the published report, beside 8,000 to 41,000 triangles at 256 x 256; beside 90,000 at 512 x 512 that is about this.
TRACE_COST = 50.0


@checked
@dataclass(frozen=True)
class TracedInterfaces(InterfaceMode):
    """All interfaces that a ray hits, found by rays through the meshes: a tree of reflected and refracted ones.

    The tree of Whitted 1980: at an interface the reflected ray takes the Fresnel reflectance, the refracted one the
    rest (Born & Wolf 1999, section 1.5). Bodies see themselves, each other and opaque objects, and may touch or hold
    the eye.

    Parameters
    ----------
    depth : int
        Interfaces that a ray may hit, from 1; behind the last one it sees the environment, as if nothing was ahead, and
        blurred if it ends in a body.
    forks : int
        How often a ray may go on as the weaker of the two, reflected or refracted, from 0; the mirror image at the
        first interface is free. The stronger one is always followed; a weaker one beyond that, or behind more than 16
        interfaces, sees the environment.
    hits : {"embree", "gl"}, optional
        What finds the surfaces that rays hit: Embree on the processors, or shaders. None lets the planner pick: Embree
        where OpenGL draws on the processors, too, but for pictures of few samples; else shaders.
    """

    name: ClassVar[str] = "traced"
    traced: ClassVar[bool] = True

    depth: int = 8
    forks: int = 2
    hits: str | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        check_hits("TracedInterfaces", self.hits)
        check_count("TracedInterfaces depth", self.depth, MAX_DEPTH)
        check_count("TracedInterfaces forks", self.forks, MAX_FORKS, least=0, example=2)

    @property
    def tree(self) -> tuple[int, int]:
        """`depth` and `forks`."""
        return self.depth, self.forks

    def refusal(self, scene: Scene) -> tuple[str, str] | None:
        """Reason against traced rays: they start in different media, or cross a varying density."""
        solids = [body for body in scene.bodies if body.sheet_thickness is None]
        if cut := [body for body in solids if picture_cuts(scene, body)]:
            return (
                f"the image plane of the orthographic camera, where rays start, cuts {object_names(cut)}",
                "use ScreenInterfaces(), or move the camera outside",
            )
        if varying := [body for body in solids if body.density is not None]:
            return (
                f"{object_names(varying)}: the density varies, but traced rays cross each medium in one step",
                "use ScreenInterfaces()",
            )
        return None

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes: one draw of all bodies with interfaces, and one over pixels that traces."""
        found = f"{owners(scene)}: normal and position of the first interface on each ray"
        effects = effects_of(scene, bends=not straight, mirrored="the surroundings")
        traced = f"{effects}; rays are traced on from this interface, through at most {self._count}"
        if self.forks:
            traced += f", and {self._times} along the weaker of the reflected and the refracted ray"
        if (mirror := mirror_of(scene)) is not None:
            traced += f"; {mirror.ground.mesh.name!r} reflects the objects on it, once"
        if dims_interfaces(scene):
            traced += "; straight rays to the lights find how much bodies dim highlights and diffuse reflection"
        return (
            PassSpec(PassName.INTERFACES, found, with_interfaces(scene), 1, cost=DRAW_COST * ONE_DRAWN),
            PassSpec(PassName.TRACED, traced, cost=TRACE_COST),
        )

    def unmodelled(self) -> list[Note]:
        """Notes on rays that are cut off."""
        often = f" more often than {self._times}" if self.forks else ""
        text = (
            f"rays that cross more than {self._count}, or follow the weaker of the reflected and the refracted "
            f"ray{often}, see the environment, as if nothing were in front of it"
        )
        return [Note(NoteKind.CUT_OFF_PATHS, text)]

    @property
    def _times(self) -> str:
        return {1: "once", 2: "twice"}.get(self.forks, f"{self.forks} times")

    @property
    def _count(self) -> str:
        return "1 interface" if self.depth == 1 else f"{self.depth} interfaces"


#: Names on the command line.
INTERFACES: dict[str, type[InterfaceMode]] = {
    one.name: one for one in (TracedInterfaces, ScreenInterfaces, FrontInterface)
}


#: Interfaces that rays may hit if no number is requested: light that the wall of a glass guides around a drink needs
#: them, and few other rays go as far.
USUAL_DEPTH = 24


def chosen_interfaces(scene: Scene, requested: InterfaceMode | None, *, sheets: bool) -> tuple[InterfaceMode, str]:
    """The method by which interfaces are found, and why it is not the one that the planner would rather take.

    Parameters
    ----------
    scene : Scene
    requested : InterfaceMode, optional
    sheets : bool
        All bodies are drawn as sheets.

    Raises
    ------
    InputError
        If what is requested cannot be done in the scene.
    """
    solid = not sheets and any(scene.objects[i].sheet_thickness is None for i in with_interfaces(scene))
    # Sheets, which bend no ray, need no tracing.
    chosen = requested or (TracedInterfaces(depth=USUAL_DEPTH) if solid else ScreenInterfaces())
    if chosen.one_interface and not solid:
        return ScreenInterfaces(), ""  # sheets have one interface, whatever is requested
    if sheets or not with_interfaces(scene) or (refusal := chosen.refusal(scene)) is None:
        return chosen, ""
    found, do = refusal
    if requested is not None:
        raise InputError(str(requested), found, do)
    return ScreenInterfaces(), found
