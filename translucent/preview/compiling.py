"""Preparation of new kinds of pictures in a worker process: compiled shaders, and the normals of large meshes.

A driver takes up to a second to compile what a new kind of scene needs, and meanwhile the window would stand still. But
drivers keep what they have compiled on disk, for all processes (Mesa and NVIDIA do): another process that draws a frame
of that kind first leaves the window almost nothing to do. Blender compiles its shaders in such a way since 4.2.
"""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, TypeVar
from weakref import WeakSet

import numpy as np
import numpy.typing as npt

from translucent.assets import newest_shader
from translucent.errors import RenderError, TranslucentError
from translucent.formulas.tone import TONES
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals, has_drawn_normals, keep_drawn_normals, made_normals
from translucent.geometry.solids import Box
from translucent.gpu.compile_budget import CompileBudget, ProgramName
from translucent.gpu.packed_meshes import PackedMesh, has_packed, keep_packed, pack_mesh
from translucent.gpu.photon_light import PhotonLight
from translucent.gpu.renderer import GpuRenderer
from translucent.gpu.viewport import MODES, RIGHT_SIDES, Shown, Viewport
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering.diffusion import LEAST_RESOLUTION, Diffusion
from translucent.preview.tasks import CancelledError, Lane, Report, Task, problem
from translucent.preview.worker import PATIENCE, Pool, Urgency
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Largest number of triangles whose hierarchy is built without a worker process.
PACKED_AT_ONCE = 20_000

#: Held while normals are made.
_smoothing = threading.Lock()

UNTIL = "interfaces in screen space, until rays can be traced through the mesh"
NEVER = "interfaces in screen space, since the mesh could not be prepared for rays"


class Tracing:
    """Maker of what rays need of the meshes of the scene on show, one mesh at a time.

    Attributes
    ----------
    told : str
        Why rays are not traced, or nothing.
    """

    def __init__(self) -> None:
        self.told = ""
        self._refused: WeakSet[Mesh] = WeakSet()
        self._asked: tuple[Mesh, Task] | None = None

    def ready(self, scene: Scene, pool: Pool, lane: Lane) -> bool:
        """True if rays can be traced through all meshes at once; else what is missing is requested."""
        self.told = ""
        missing = [mesh for mesh in dict.fromkeys(item.mesh for item in scene.objects) if not _is_ready(mesh)]
        if not missing:
            return True
        if self._asked is not None and (self._asked[1].cancelled or self._asked[1].error is not None):
            self._refused.add(self._asked[0])
            self._asked = None
        if self._refused.intersection(missing):
            self.told = NEVER
            return False
        self.told = UNTIL
        if lane.task is None:
            mesh = missing[0]
            task = lane.start("preparing rays", lambda task: _prepare(task, pool, mesh), lambda _: None)
            self._asked = mesh, task
        return False


def _is_ready(mesh: Mesh) -> bool:
    return len(mesh.faces) <= PACKED_AT_ONCE or has_packed(mesh)


def _prepare(task: Task, pool: Pool, mesh: Mesh) -> None:
    have_smoothed(task, pool, mesh)
    keep_packed(mesh, pool.call(task, packed, mesh, drawn_normals(mesh), urgency=Urgency.PICTURE))


def have_smoothed(task: Task, pool: Pool, mesh: Mesh) -> None:
    """Have a worker process make the `drawn_normals` of a mesh, once: who asks meanwhile waits for the same."""
    while not _smoothing.acquire(timeout=PATIENCE):
        task.report(task.share, task.detail)
    try:
        if not has_drawn_normals(mesh):
            keep_drawn_normals(mesh, pool.call(task, smoothed, mesh, urgency=Urgency.PICTURE))
    finally:
        _smoothing.release()


def smoothed(report: Report, mesh: Mesh) -> npt.NDArray[np.float32]:
    """`drawn_normals` of a mesh."""
    report(None, "normals")
    return made_normals(mesh)


def packed(report: Report, mesh: Mesh, normals: npt.NDArray[np.float32]) -> PackedMesh:
    """`packed_mesh` of a mesh."""
    report(None, "hierarchy")
    return pack_mesh(mesh, normals)


#: Size of the frames that are drawn to have their shaders compiled. No power of two: drivers compile another code for
#: pictures whose sides are, and those of windows seldom are.
FRAME = (80, 48)

#: Sides of small pictures in place of large ones, by whether those are powers of two.
SIDES = {True: 64, False: 60}

#: Largest number of triangles whose normals are made without the worker process.
SMOOTHED_AT_ONCE = 20_000

#: Largest number of directions of the environment that throw shadows.
SHADOWS = 16

#: Number of nested boxes that stand in for a mesh: rays then cross as many layers as methods can tell apart. For a
#: convex mesh it is one, since lights go straight on to a convex body, and have to be followed to others.
BOXES = 4

Result = TypeVar("Result")


@dataclass(frozen=True)
class Compiled:
    """Result of a request.

    Attributes
    ----------
    programs : frozenset of ProgramName or None
        That the driver now keeps; None if no other process can draw here.
    problem : str
        Why that is, or the compiler's message; or nothing.
    """

    programs: frozenset[ProgramName] | None
    problem: str = ""


class Compiler:
    """Compiler of shaders and smoother of meshes in a worker process.

    Parameters
    ----------
    pool : Pool

    Attributes
    ----------
    budget : CompileBudget
        For the context that waits.
    lane : Lane
        One request after the other; a task that nobody waits for has no name.
    device : str
        What the context draws with, as in `GpuContext.renderer`: another one's code would be of no use to it.
    """

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self.budget = CompileBudget()
        self.lane = Lane("compile")
        self.device = ""

    def begin(self, scene: Scene, plans: Sequence[RenderPlan], then: Callable[[Compiled], None]) -> None:
        """Start the worker process, with a frame like the one on show; from now on, the context waits for it."""
        self.budget.postpones = True
        self.budget.elsewhere |= self.budget.needed

        def work(task: Task) -> Compiled:
            self._call(task, show_frames, stand_in(scene), plans[0], self.device)
            return self._make(task, scene, plans)

        self.lane.start("", _guarded(work), then)

    def lacks_normals(self, scene: Scene, plans: Sequence[RenderPlan]) -> bool:
        """True if the context should wait for normals."""
        return self.budget.postpones and bool(unsmoothed(scene, plans))

    def ask(
        self,
        name: str,
        scene: Scene,
        plans: Sequence[RenderPlan],
        then: Callable[[Compiled], None],
    ) -> Task:
        """Request the programs and normals for plans of a scene."""
        return self.lane.start(name, _guarded(lambda task: self._make(task, scene, plans)), then)

    def _make(self, task: Task, scene: Scene, plans: Sequence[RenderPlan]) -> Compiled:
        for mesh in unsmoothed(scene, plans):
            have_smoothed(task, self._pool, mesh)
        return self._call(task, compile_frames, stand_in(scene), tuple(map(_quick, plans)), self.device)

    def take(self, found: Compiled, missing: ProgramName | None = None) -> None:
        """Let the context build what is ready, and what was `missing`: if it is not ready, the window tells why."""
        if found.programs is None:
            self.budget.postpones = False
        else:
            self.budget.elsewhere |= found.programs
        if missing is not None:
            self.budget.elsewhere.add(missing)

    def _call(self, task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
        return self._pool.call(task, work, *arguments, urgency=Urgency.PICTURE)


def _guarded(work: Callable[[Task], Compiled]) -> Callable[[Task], Compiled]:
    """Guard work so that it always has a result: if it fails, one that says why."""

    def call(task: Task) -> Compiled:
        try:
            return work(task)
        except CancelledError:
            raise
        except Exception as error:  # noqa: BLE001 - whatever it is, the window can do the work itself
            return Compiled(None, problem(error))

    return call


def unsmoothed(scene: Scene, plans: Sequence[RenderPlan]) -> list[Mesh]:
    """Large meshes that plans draw with normals not made yet."""
    drawn = {
        i
        for plan in plans
        for step in plan.passes
        for i in step.objects
        if step.name is PassName.INTERFACES or (step.name is PassName.OPAQUE and scene.objects[i].surface is not None)
    }
    meshes = (scene.objects[i].mesh for i in sorted(drawn))
    return [mesh for mesh in meshes if len(mesh.faces) > SMOOTHED_AT_ONCE and not has_drawn_normals(mesh)]


def compile_frames(report: Report, scene: Scene, plans: Sequence[RenderPlan], device: str) -> Compiled:
    """Draw a scene by plans, as it is drawn while it moves and at rest, and return the programs that this needed."""
    engine, budget = _engine(newest_shader(), device)
    trouble = ""
    with engine.context.current() as gl:
        picture, viewport = gl.framebuffer([gl.texture(FRAME, 4)]), Viewport(engine)
        try:
            viewport.resize(FRAME)
            for number, plan in enumerate(plans):
                report(number / len(plans), type(plan.method).__name__)
                engine.draw(scene, picture, plan, 0.0, "none")
                viewport.restart()
                for _ in range(2):  # into other kinds of targets: the centers of pixels, and what is added to them
                    viewport.step(0, scene, plan, 1, 1)
                if plan.caustics is not None:
                    _light_by_photons(engine, scene, plan)
        except TranslucentError as error:
            trouble = str(error)
        finally:
            gl.finish()
            viewport.release()
            picture.release()
    return Compiled(frozenset(budget.needed), trouble)


def _light_by_photons(engine: GpuRenderer, scene: Scene, plan: RenderPlan) -> None:
    """Draw a picture by photons that have been followed before."""
    viewport = Viewport(engine)
    viewport.resize(FRAME)
    light = PhotonLight(engine, scene, viewport.size, plan)
    light.step(0.0)
    light.show()
    viewport.step(0, scene, plan, 1, photons=light.texture)
    light.release()
    viewport.release()


def show_frames(report: Report, scene: Scene, plan: RenderPlan, device: str) -> None:
    """Show a frame in all ways that a window has, and two beside each other."""
    engine, _ = _engine(newest_shader(), device)
    with engine.context.current():
        viewport = Viewport(engine)
        viewport.resize(FRAME)
        for side in (0, 1):
            viewport.step(side, scene, plan, 1)
        for mode, right_side, tone in product(MODES, RIGHT_SIDES, TONES):
            report(None, mode)
            viewport.present(Shown(mode, right_side, 0.5, tone=tone))
        viewport.release()


@lru_cache(maxsize=1)
def _engine(written: float, device: str) -> tuple[GpuRenderer, CompileBudget]:
    """Renderer of the worker process, for one version of the shaders.

    Raises
    ------
    RenderError
        If it draws with another device than the window.
    """
    engine, budget = GpuRenderer(), CompileBudget()
    if (own := engine.context.renderer) != device:
        raise RenderError("another process", f"it draws with {own}, and the window with {device}", "mend the drivers")
    engine.context.gl.extra = budget
    return engine, budget


def _quick(plan: RenderPlan) -> RenderPlan:
    """Plan that needs the same programs, with few cells for light that diffuses."""
    back = dataclasses.replace(plan.given_back, diffusion=Diffusion(LEAST_RESOLUTION))
    return dataclasses.replace(plan, given_back=back)


def stand_in(scene: Scene) -> Scene:
    """Stand-in for a scene that needs the same programs, and is quick to send and draw: boxes for meshes, and no
    pictures.
    """
    return dataclasses.replace(
        scene,
        objects=[_object_like(item) for item in scene.objects],
        environment=_environment_like(scene.environment),
        environment_shadows=min(scene.environment_shadows, SHADOWS),
    )


def _object_like(item: Object) -> Object:
    surface = None if item.surface is None else _surface_like(item.surface)
    # What is as flat as a ground takes part in shadows in another way than boxes.
    simple = item.medium is None and len(item.mesh.faces) <= len(Box().tessellate().faces)
    return dataclasses.replace(item, mesh=item.mesh if simple else _boxes(item.mesh), surface=surface)


def _boxes(mesh: Mesh) -> Mesh:
    box = Box().tessellate()
    size = np.maximum(mesh.bounds[1] - mesh.bounds[0], 0.1 * mesh.diagonal)  # a leaf may be flat
    # Nothing of a convex body is between a light and its interface.
    shares = np.linspace(1.0, 0.5, 1 if mesh.diagnosis.convex else BOXES)
    vertices = (mesh.center + shares[:, None, None] * size * box.vertices).reshape(-1, 3)
    faces = (box.faces + len(box.vertices) * np.arange(len(shares))[:, None, None]).reshape(-1, 3)
    uv = None if mesh.uv is None else np.zeros((len(vertices), 2))
    colors = None if mesh.colors is None else np.ones((len(vertices), 4))
    return Mesh(vertices, faces, uv, mesh.name, colors=colors)


def _surface_like(surface: Surface) -> Surface:
    pictures: dict[str, Any] = {
        field.name: _texture_like(value)
        for field in dataclasses.fields(surface)
        if isinstance(value := getattr(surface, field.name), Texture)
    }
    return dataclasses.replace(surface, **pictures)


def _texture_like(texture: Texture) -> Texture:
    height, width, channels = texture.pixels.shape
    pixels = np.ones((_side_like(height), _side_like(width), channels), dtype=np.float32)
    return dataclasses.replace(texture, pixels=pixels)


def _environment_like(environment: Environment) -> Environment:
    background = environment.background and _environment_like(environment.background)
    if environment.map is not None:
        side = _side_like(environment.map.size[1])
        return dataclasses.replace(environment, map=EnvironmentMap(np.ones((side, 2 * side, 3))), background=background)
    # One color: nothing is to be blurred.
    return dataclasses.replace(environment, second=environment.first, background=background)


def _side_like(side: int) -> int:
    return 1 if side == 1 else SIDES[math.log2(side).is_integer()]
