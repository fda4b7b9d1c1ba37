"""The plan of a frame: its method, passes and notes; and the capabilities of the machine that it is made for."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace

from translucent.arguments import checked
from translucent.planning.caustics import Caustics
from translucent.planning.interfaces import INTERIOR_SIZE, InterfaceMode, TracedInterfaces
from translucent.planning.methods import Method, PathTraced
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.rendered import Treatment, occluder_scene, occluders, treatment_of
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import Diffusion
from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene.scene import Scene


@checked
@dataclass(frozen=True)
class Capabilities:
    """Capabilities of the machine that a plan is made for.

    Attributes
    ----------
    shader_storage : bool
        Shaders can write to buffers: OpenGL 4.3.
    opengl : bool
        There is OpenGL at all; else rays are traced on the CPU, which finds all intervals whatever the method.

    scattering : bool
        Light that media scatter can be followed.
    texture_units : int
        Textures that one shader can read.
    textured_rays : bool
        Rays can read textures of surfaces wherever they hit one.
    software : bool
        OpenGL draws on the processors, as Mesa's llvmpipe does.
    """

    shader_storage: bool = True
    opengl: bool = True
    scattering: bool = True
    texture_units: int = 32
    textured_rays: bool = True
    software: bool = False


@dataclass(frozen=True)
class MapPlan:
    """Plan of maps of shadows: how the paths of light through the bodies of a scene are found.

    Attributes
    ----------
    method : Method
    passes : tuple of PassSpec
        Over the objects of an `occluder_scene` of all `occluders`.
    spectral : bool
    """

    method: Method
    passes: tuple[PassSpec, ...]
    spectral: bool

    def of(self, scene: Scene, opaque: Container[int]) -> RenderPlan:
        """Plan of a map for which no more than these of the opaque objects of a scene are drawn."""
        everything, numbers = occluders(scene), occluders(scene, opaque)
        place = {number: i for i, number in enumerate(numbers)}
        passes = []
        for step in self.passes:
            objects = tuple(place[everything[i]] for i in step.objects if everything[i] in place)
            if objects or step.name is not PassName.OPAQUE:
                passes.append(replace(step, objects=objects))
        return RenderPlan(occluder_scene(scene, numbers), self.method, tuple(passes), self.spectral)


@dataclass(frozen=True)
class RenderPlan:
    """Plan of a frame: the method and passes that run, each with its reason.

    Attributes
    ----------
    scene : Scene
        The scene as it is rendered: each object with its `Treatment`, and media with what they emit of the ambient
        radiance. Plans are equal whatever their scenes are.
    method : Method
        How thickness is found.
    passes : tuple of PassSpec
        In order.
    spectral : bool
        The passes add up optical depth per channel, since media differ, and not only thickness.
    limits : tuple of Note
        Where thickness, transmittance or emission are not exact, and why; empty for an exact plan.
    unmodelled : tuple of Note
        What the scene requests and no pass renders.
    remarks : tuple of Note
        What is rendered right, and a picture hardly shows: bodies that are black; or is slower than need be.
    interfaces : Interfaces, optional
        How interfaces are found; None where none changes light, or none is rendered.
    hits : str
        What finds the surfaces that traced rays and photons hit: "embree" or "gl"; empty where OpenGL traces neither.
    diffusion : Diffusion
        Grid of the bodies in which light diffuses.
    traced : bool
        Rays are traced on the processors, which finds all surfaces on each. Of the `method` only one thing counts
        then: whether bodies are sheets.
    paths : PathTraced, optional
        The random paths that make the radiance, in place of interfaces and treatments; None where none do.
    caustics : Caustics, optional
        The photons that land on opaque objects, and light media; None where none do.
    opaque_to_shadows : frozenset of int
        Numbers of the objects through which no straight light of the lights falls onto others, since photons carry what
        their interfaces bend.
    shadows : ShadowMaps
        How shadows on opaque objects are found, if the plan has the pass.
    maps : tuple of MapPlan
        Then, of the maps of lights, and of the maps of the environment if they differ.
    exchanging : tuple of int
        Numbers of the opaque objects whose light is found by way of interfaces and of each other.
    glowing : tuple of int
        Numbers of the clear bodies that light a flat ground below them by what their media emit, and of clear bodies
        around these.
    textured : bool
        Rays and photons on the GPU read textures of surfaces wherever they hit one.
    request : RenderRequest
        What was requested.
    """

    scene: Scene = field(compare=False)
    method: Method
    passes: tuple[PassSpec, ...]
    spectral: bool = False
    limits: tuple[Note, ...] = ()
    unmodelled: tuple[Note, ...] = ()
    remarks: tuple[Note, ...] = ()
    interfaces: InterfaceMode | None = None
    hits: str = ""
    diffusion: Diffusion = field(default_factory=Diffusion)
    traced: bool = False
    paths: PathTraced | None = None
    caustics: Caustics | None = None
    opaque_to_shadows: frozenset[int] = frozenset()
    shadows: ShadowMaps = field(default_factory=ShadowMaps)
    maps: tuple[MapPlan, ...] = ()
    exchanging: tuple[int, ...] = ()
    glowing: tuple[int, ...] = ()
    textured: bool = False
    request: RenderRequest = field(default_factory=RenderRequest, compare=False)

    @property
    def runs(self) -> str:
        """Description of how thickness is found: the method, or the ray tracing in place of it; and of random paths."""
        if self.paths is not None:
            return f"{self.paths}, thickness by {self.method}"
        if not self.traced:
            return str(self.method)
        what = "all surfaces on each ray, in float64"
        sheet = self.method.usual_thickness
        return what if sheet is None else f"{what}, as sheets of {sheet:g} m"

    def treated(self, *treatments: Treatment) -> tuple[int, ...]:
        """Numbers of the objects with one of these treatments."""
        return tuple(i for i, item in enumerate(self.scene.objects) if treatment_of(item) in treatments)

    @property
    def diffuses(self) -> bool:
        """True if light is solved for on grids."""
        return bool(self.treated(Treatment.DIFFUSION, Treatment.VOLUME))

    @property
    def solves(self) -> bool:
        """True if light is solved for before anything is drawn: on grids, or on opaque objects."""
        return self.diffuses or bool(self.exchanging or self.glowing)

    @property
    def multiple_scattering(self) -> str:
        """Text on the models of multiple scattering and the number of bodies of each; empty without any."""
        modes = (
            (Treatment.DIFFUSION, f"diffuses ({self.diffusion})"),
            (Treatment.VOLUME, f"is added along view rays ({self.diffusion})"),
            (Treatment.LAYER, "leaves as from flat layers"),
        )
        counts = ((len(self.treated(treatment)), mode) for treatment, mode in modes)
        return ", and ".join(
            f"{mode} in {count} {'body' if count == 1 else 'bodies'}" for count, mode in counts if count
        )

    @property
    def exact(self) -> bool:
        """True if all but what is `unmodelled` is exact for the meshes as given, up to float32."""
        return not self.limits

    @property
    def ordered(self) -> bool:
        """True if the method finds the intervals of each ray in their order."""
        return self.method.ordered

    @property
    def has_noise(self) -> bool:
        """True if anything is drawn at random: paths, or microfacets of rough interfaces and of what mirrors."""
        rough = any(item.surface is not None and item.surface.roughness > 0 for item in self.scene.objects)
        return self.paths is not None or (isinstance(self.interfaces, TracedInterfaces) and rough)

    @property
    def geometry_passes(self) -> int:
        """Total number of draws of the geometry."""
        return sum(step.geometry_passes for step in self.passes)

    @property
    def cost(self) -> float:
        """Expected time, in depth-only draws: the sum over the passes, each in draws of its own objects."""
        return sum(step.cost for step in self.passes)

    def has(self, *names: PassName) -> bool:
        """True if the plan has a pass with one of these names."""
        return any(step.name in names for step in self.passes)

    def says(self, kind: NoteKind) -> bool:
        """True if a note of this kind is among the `limits`, the effects not modelled or the `remarks`."""
        return any(note.kind is kind for note in (*self.limits, *self.unmodelled, *self.remarks))

    def invalid_text(self, invalid: int, covered: int) -> str:
        """Warning of so many pixels that cannot be trusted."""
        unbalanced = "rays that do not leave each body as often as they enter"
        if isinstance(self.interfaces, TracedInterfaces):
            unbalanced += f", or that are inside more than {INTERIOR_SIZE} bodies at once"
        why = "; ".join(map(str, self.limits)) or unbalanced
        return f"{invalid} pixels are not valid ({covered} are covered): {why}"

    def summary(self) -> dict[str, object]:
        """Plan as values that JSON can hold."""
        return {
            "method": self.runs,
            "exact": self.exact,
            "interfaces": None if self.interfaces is None else str(self.interfaces),
            "hits": self.hits or None,
            "given_back": self.multiple_scattering or None,
            "caustics": None if self.caustics is None else str(self.caustics),
            "cost": round(self.cost, 2),
            "passes": [
                {
                    "name": step.name.value,
                    "reason": step.reason,
                    "geometry_passes": step.geometry_passes,
                    "cost": round(step.cost, 2),
                }
                for step in self.passes
            ],
            "limits": [str(note) for note in self.limits],
            "unmodelled": [str(note) for note in self.unmodelled],
            "remarks": [str(note) for note in self.remarks],
        }

    def __str__(self) -> str:
        digits = 1 if self.cost < 10 else 0
        cost = f", at about the cost of {self.cost:.{digits}f} depth-only draws" if self.cost else ""
        lines = [f"{self.runs}: {'exact' if self.exact else 'not exact everywhere'}{cost}"]
        lines += [f"  {i}. {step.name}: {step.reason}" for i, step in enumerate(self.passes, 1)]
        if mode := self.multiple_scattering:
            lines.append(f"  multiply scattered light {mode}")
        lines += [f"  limit: {limit}" for limit in self.limits]
        lines += [f"  approximation: {effect}" for effect in self.unmodelled]
        lines += [f"  remark: {remark}" for remark in self.remarks]
        return "\n".join(lines)
