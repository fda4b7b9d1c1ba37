"""Plans for pages: passes that WebGL2 can draw, and notes on effects that pages leave out."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.planning.caustics import caustics_to_request
from translucent.planning.interfaces import FrontInterface
from translucent.planning.methods import DepthPeeling
from translucent.planning.passes import Note, NoteKind, PassName
from translucent.planning.plan import plan_scene
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.request import RenderRequest
from translucent.planning.shadow_maps import UNITS_WITH_SHADOWS
from translucent.scene.scene import Object, Scene, check_scene, object_names
from translucent.scene.surface import Surface

#: Triangles that a mesh keeps in any case.
LEAST_FACES = 100


def triangles(scene: Scene) -> int:
    """Triangles of all meshes of a scene, each once."""
    return sum(len(mesh.faces) for mesh in {body.mesh for body in scene.objects})


def simplified(scene: Scene, faces: int) -> Scene:
    """The scene with about so many triangles in all, by quadric error metrics (Garland & Heckbert 1997).

    Meshes with texture coordinates or colors stay as they are.

    Raises
    ------
    InputError
        If the package fast-simplification, which does it, is not installed; if the number is not above `LEAST_FACES`.
    """
    if faces < LEAST_FACES:
        raise InputError(
            f"--simplify {faces}", f"a mesh needs at least {LEAST_FACES} triangles", "use a value such as 200000"
        )
    fraction = faces / triangles(scene)
    if fraction >= 1.0:
        return scene
    coarse = {
        mesh: _coarse(mesh, max(int(fraction * len(mesh.faces)), LEAST_FACES))
        for mesh in dict.fromkeys(body.mesh for body in scene.objects)
        if mesh.uv is None and mesh.colors is None and len(mesh.faces) > LEAST_FACES
    }
    return replace(scene, objects=[replace(body, mesh=coarse.get(body.mesh, body.mesh)) for body in scene.objects])


def _coarse(mesh: Mesh, faces: int) -> Mesh:
    try:
        import fast_simplification
    except ImportError as error:
        do = "pip install fast-simplification, or reduce the model first, for example in Blender"
        raise InputError("--simplify", "the Python package fast-simplification is not installed", do) from error
    # It asks for arrays that it could write to; more haste than this makes bodies thinner, by several percent.
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)
    vertices, kept = fast_simplification.simplify(points, triangles, target_count=faces, agg=3)
    return Mesh(vertices, kept, name=mesh.name)


#: Index of refraction and roughness of variants for bodies without their own: the page puts the chosen ones in place.
USUAL_IOR, USUAL_ROUGHNESS = 1.5, 0.5


def editable(body: Object) -> str:
    """Reason for which a page cannot change the medium of a body; empty if it can."""
    medium = body.medium
    if medium is None or body.covers:
        return "opaque"
    if np.any(np.asarray(medium.scattering) > 0):
        return (
            "This medium scatters light, and its light was computed when the page was written: density, index of "
            "refraction and roughness cannot change here."
        )
    if medium.emits:
        return "This medium emits light, so it cannot change here."
    if body.density is not None:
        return "The density of this medium varies, so it cannot change here."
    return ""


def variant(scene: Scene, *, bends: bool, rough: bool) -> Scene:
    """Scene whose editable media refract or not, with rough or smooth surfaces."""
    return replace(scene, objects=[_changed(body, bends, rough) for body in scene.objects])


def _changed(body: Object, bends: bool, rough: bool) -> Object:
    if body.medium is None or editable(body):
        return body
    medium, surface = body.medium, body.surface or Surface()
    ior = (medium.ior if medium.ior != 1.0 else USUAL_IOR) if bends else 1.0
    roughness = (surface.roughness or USUAL_ROUGHNESS) if rough else 0.0
    changed = replace(surface, roughness=roughness)
    plain = body.surface is None and roughness == 0.0
    return replace(body, medium=replace(medium, ior=ior), surface=None if plain else changed)


def current(scene: Scene) -> tuple[bool, bool]:
    """Present setting of the switches: whether any editable medium refracts, and any of their surfaces is rough."""
    free = [body for body in scene.objects if body.medium is not None and not editable(body)]
    bends = any(body.medium is not None and body.medium.ior != 1.0 for body in free)
    return bends, any(body.surface is not None and body.surface.roughness > 0 for body in free)


#: Textures that WebGL2 promises in a shader. Passes that trace rays have theirs put together, and so read as many as
#: `UNITS_WITH_SHADOWS` in these.
TEXTURE_UNITS = 16

#: Triangles up to which a page traces rays: it builds their hierarchy when it is opened, 2 s for 300 000.
MOST_TRACED = 600_000

#: Triangles from which on a page is slow to load and to turn.
MANY_TRIANGLES = 1_000_000

#: Crossings of a ray that depth peeling finds in a page: each pass goes over the geometry once more.
MOST_LAYERS = 16

#: Passes that write to buffers, or take random paths, which pages have none of.
_NOT_SHOWN = {
    PassName.FRAGMENT_LISTS: "lists of fragments",
    PassName.K_BUFFER: "a k-buffer",
    PassName.LIGHT_VIEWS: "light that is scattered into rays",
    PassName.PATH_TRACE: "random paths",
    PassName.CAUSTICS: "photons",
}


@dataclass(frozen=True, eq=False)
class PagePlan:
    """Plan of a page.

    Attributes
    ----------
    scene : Scene
    plan : RenderPlan
    request : RenderRequest
    texture_units : int
        As the planner gets it.
    distance : float, optional
        In metres, at which panels show colors of media at first. Default: as far as each body is thick.
    given : Scene, optional
        The scene before pages left anything out of it; its objects have the same numbers. Default: `scene`.
    """

    scene: Scene
    plan: RenderPlan
    request: RenderRequest
    texture_units: int
    distance: float | None = None
    given: Scene | None = None

    def given_body(self, body: Object) -> Object:
        """Original body of the scene, before changes for the page."""
        return body if self.given is None else self.given.objects[list(self.scene.objects).index(body)]

    @property
    def unlit(self) -> tuple[Object, ...]:
        """Original bodies whose scattered light the page leaves out."""
        given = (self.given_body(body) for body in self.scene.objects)
        return tuple(one for one, body in zip(given, self.scene.objects, strict=True) if one is not body)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes on effects that the page leaves out or approximates."""
        lit = bool(self.scene.lights)  # their caustics are among the page's own notes
        rest = (note for note in self.plan.unmodelled if not (lit and note.kind is NoteKind.CAUSTICS))
        return (*self.own_notes, *self.plan.limits, *rest, *self.plan.remarks)

    @property
    def own_notes(self) -> tuple[Note, ...]:
        """Notes on the page, in addition to those of the plan."""
        found = []
        if self.unlit:
            media = [body.medium for body in self.unlit if body.medium is not None]
            most = max(float(_albedo(medium).max()) for medium in media)
            text = (
                f"{object_names(self.unlit)}: scattered light is missing, up to {most:.0%} of the light that a ray "
                "loses there; thickness and transmittance are exact"
            )
            found.append(Note(NoteKind.UNLIT, text))
        if self.scene.lights and any(note.kind is NoteKind.CAUSTICS for note in self.plan.unmodelled):
            found += caustics_to_request(self.scene, "pages show no caustics, but pictures do (translucent render)")
        if (count := triangles(self.scene)) > MANY_TRIANGLES:
            text = f"{count:,} triangles are slow in a browser; --simplify 300000 writes a coarser copy"
            found.append(Note(NoteKind.MANY_TRIANGLES, text))
        if any(body.density is not None for body in self.scene.objects):
            found.append(
                Note(NoteKind.STEPS, "media of varying density: the panel of the page cannot change these media")
            )
        if sum(body.covers for body in self.scene.objects) > 1:
            text = "partly transparent layers are sorted once, for the first camera"
            found.append(Note(NoteKind.LAYERS, text))
        return tuple(found)

    @property
    def most_layers(self) -> int:
        """Crossings that depth peeling is to find."""
        return self.plan.method.layer_limit or MOST_LAYERS

    def panel_distance(self, body: Object) -> float:
        """Distance in metres at which the panel shows the color of a body's medium at first; a round one by default."""
        if self.distance is not None:
            return self.distance
        metres = body.mean_thickness
        power = 10.0 ** np.floor(np.log10(metres)) if metres > 0 else 1.0
        return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda step: abs(step * power - metres)))

    def planned(self, scene: Scene) -> RenderPlan:
        """Plan of a variant of the scene."""
        return _planned(scene, self.request, self.texture_units)


def plan_page(scene: Scene, request: RenderRequest | None = None) -> PagePlan:
    """Plan a page of a scene.

    Raises
    ------
    InputError
        If WebGL2 cannot draw the scene, or not by what is requested.
    """
    check_scene(scene)
    request = request or RenderRequest()
    if request.interfaces is None and triangles(scene) > MOST_TRACED:
        request = replace(request, interfaces=FrontInterface())
    units = UNITS_WITH_SHADOWS
    found = _planned(scene, request, units)
    if found.has(PassName.SURFACES):
        units = TEXTURE_UNITS
        found = _planned(scene, request, units)
    given = scene
    if found.has(PassName.UNLIT):
        numbers = {i for step in found.passes if step.name is PassName.UNLIT for i in step.objects}
        scene = _absorbing(scene, numbers)
        found = _planned(scene, request, units)
    return PagePlan(scene, found, request, units, given=given)


def _absorbing(scene: Scene, numbers: Container[int]) -> Scene:
    """Scene in which these bodies absorb instead of scattering, because pages cannot scatter light of lights."""
    media: dict[Medium, Medium] = {}  # bodies that share a medium go on to

    def changed(body: Object) -> Object:
        assert body.medium is not None
        own = Medium(body.medium.extinction, emission=scene.source(body), ior=body.medium.ior)
        return replace(body, medium=media.setdefault(own, own))

    return replace(scene, objects=[changed(body) if i in numbers else body for i, body in enumerate(scene.objects)])


def _albedo(medium: Medium) -> Array:
    extinction = medium.extinction
    return np.asarray(medium.scattering) / np.where(extinction > 0, extinction, 1.0)


def _planned(scene: Scene, request: RenderRequest, units: int) -> RenderPlan:
    method = request.method
    if method is not None and method.needs_storage:
        found = "this method writes to storage buffers, which WebGL2 does not have"
        raise InputError(f"a page with {method}", found, "use SignedDepth, or DepthPeeling for sorted intervals")
    machine = Capabilities(shader_storage=False, texture_units=units, textured_rays=False)
    chosen = plan_scene(scene, request, machine)
    if isinstance(peeling := chosen.method, DepthPeeling) and peeling.max_layers > MOST_LAYERS:
        # What the planner says why it took it stays.
        reasons = {step.name: step.reason for step in chosen.passes}
        chosen = plan_scene(scene, replace(request, method=replace(peeling, max_layers=MOST_LAYERS)), machine)
        passes = tuple(replace(step, reason=reasons.get(step.name, step.reason)) for step in chosen.passes)
        chosen = replace(chosen, passes=passes)
    for step in chosen.passes:
        if (what := _NOT_SHOWN.get(step.name)) is not None:
            requested = f"a page of this scene with {method or chosen.method}"
            do = "omit this feature" if isinstance(chosen.method, DepthPeeling) else "use another --method"
            raise InputError(requested, f"pages do not support {what}", do)
    return chosen
