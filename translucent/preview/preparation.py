"""Preparation of pictures in worker processes: normals and hierarchies of large meshes, and compiled shaders.

A driver takes up to a second to compile the shaders of a new type of scene, and meanwhile the window would stand still.
But drivers keep what they have compiled on disk, for all processes (Mesa and NVIDIA do): another process that draws a
frame of that type first leaves the window almost nothing to do. Blender compiles its shaders like this since 4.2.
"""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any
from weakref import ref

import numpy as np

from translucent.assets import newest_shader
from translucent.errors import RenderError, TranslucentError
from translucent.formulas.tone import TONES
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals, has_drawn_normals, keep_drawn_normals, made_normals
from translucent.geometry.solids import Box
from translucent.gpu.embree_hits import mesh_scene
from translucent.gpu.hierarchies import has_packed, keep_packed, pack_mesh
from translucent.gpu.refinement import PhotonPicture
from translucent.gpu.renderer import GpuRenderer
from translucent.gpu.shaders import CompileBudget, ProgramName
from translucent.gpu.viewport import MODES, RIGHT_SIDES, Shown, Viewport
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import LEAST_RESOLUTION, Diffusion
from translucent.preview.tasks import CancelledError, Lane, Task, problem
from translucent.preview.worker import PATIENCE, Pool, Urgency, report
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.scene import Object, Scene
from translucent.scene.texture import Texture

#: Largest numbers of triangles whose hierarchy is built, and whose normals are made, without a worker process.
PACKED_AT_ONCE, SMOOTHED_AT_ONCE = 20_000, 20_000

#: Size of the frames that are drawn to have their shaders compiled. No power of two: drivers compile another code for
#: pictures whose sides are, and those of windows seldom are.
FRAME = (80, 48)

#: Sides of small pictures in place of large ones, by whether those are powers of two.
SIDES = {True: 64, False: 60}

#: Largest number of directions of the environment whose shadows are drawn.
SHADOWS = 16

#: Number of nested boxes that replace a mesh: rays then cross as many layers as methods can separate. For a convex
#: mesh it is one, since lights go straight on to a convex body, and have to be followed to others.
BOXES = 4

_smoothing = threading.Lock()


def untraceable(scene: Scene, pool: Pool, lane: Lane, *, embree: bool) -> str:
    """Reason why rays cannot be traced through the meshes of a scene yet; empty if they can.

    The hierarchy of the first mesh that lacks one is requested, and its Embree scene where `embree` finds hits.
    """
    meshes = dict.fromkeys(item.mesh for item in scene.objects)
    missing = [mesh for mesh in meshes if len(mesh.faces) > PACKED_AT_ONCE and not has_packed(mesh)]
    if not missing:
        return ""
    if any(lane.failed(ref(mesh)) for mesh in missing):
        return "Reflections are approximate, because the mesh could not be prepared for ray tracing"
    mesh = missing[0]

    def prepare(task: Task) -> None:
        make_normals(task, pool, mesh)
        task.report(None, "hierarchy")
        keep_packed(mesh, pool.call(task, pack_mesh, mesh, drawn_normals(mesh), urgency=Urgency.PICTURE))
        if embree:
            mesh_scene(mesh)

    lane.request(ref(mesh), "preparing reflections", prepare)
    return "The mesh is being prepared for ray tracing; until then, reflections are approximate"


def make_normals(task: Task, pool: Pool, mesh: Mesh) -> None:
    """Make the `drawn_normals` of a mesh in a worker process, once: other threads that need them wait."""
    task.report(None, "normals")
    while not _smoothing.acquire(timeout=PATIENCE):
        task.report(task.share, task.detail)
    try:
        if not has_drawn_normals(mesh):
            keep_drawn_normals(mesh, pool.call(task, made_normals, mesh, urgency=Urgency.PICTURE))
    finally:
        _smoothing.release()


def unsmoothed(plans: Sequence[RenderPlan]) -> list[Mesh]:
    """Large meshes that plans draw with normals not made yet."""
    drawn = {
        i: item.mesh
        for plan in plans
        for step in plan.passes
        for i, item in ((i, plan.scene.objects[i]) for i in step.objects)
        if step.name is PassName.INTERFACES or (step.name is PassName.OPAQUE and item.surface is not None)
    }
    return _large_without_normals(drawn[i] for i in sorted(drawn))


def make_large_normals(task: Task, pool: Pool, meshes: Iterable[Mesh]) -> None:
    """Make the `drawn_normals` of the large meshes among these in a worker process."""
    for mesh in _large_without_normals(meshes):
        make_normals(task, pool, mesh)


def _large_without_normals(meshes: Iterable[Mesh]) -> list[Mesh]:
    return [mesh for mesh in meshes if len(mesh.faces) > SMOOTHED_AT_ONCE and not has_drawn_normals(mesh)]


@dataclass(frozen=True)
class Compiled:
    """Result of compiling shaders.

    Attributes
    ----------
    programs : frozenset of ProgramName or None
        Programs that the driver now keeps; None if no other process can draw here.
    problem : str
        The reason for that, or the compiler's message; or nothing.
    """

    programs: frozenset[ProgramName] | None
    problem: str = ""


class Compiler:
    """Compiler of shaders, and maker of normals, in a worker process.

    Parameters
    ----------
    pool : Pool

    Attributes
    ----------
    budget : CompileBudget
        Budget of the context that waits.
    lane : Lane
        Runs one request after the other; a task that nobody waits for has no name.
    device : str
        Device of the context, as in `GpuContext.renderer`: another one's code would be of no use to it.
    """

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self.budget = CompileBudget()
        self.lane = Lane("compile")
        self.device = ""

    def begin(self, plans: Sequence[RenderPlan], then: Callable[[Compiled], None]) -> None:
        """Start the worker process, with a frame like the one on show; from now on, the context waits for it."""
        self.budget.postpones = True
        self.budget.elsewhere |= self.budget.needed
        self.request("", plans, then, presents=True)

    def request(
        self,
        name: str,
        plans: Sequence[RenderPlan],
        then: Callable[[Compiled], None],
        *,
        presents: bool = False,
    ) -> Task:
        """Request the programs and normals for plans; with `presents`, also the programs that show a frame."""

        def work(task: Task) -> Compiled:
            try:
                make_large_normals(task, self._pool, unsmoothed(plans))
                given = tuple(map(_quick, plans)), self.device, presents
                return self._pool.call(task, compile_frames, *given, urgency=Urgency.PICTURE)
            except CancelledError:
                raise
            except Exception as error:  # noqa: BLE001 - whatever it is, the window can do the work itself
                return Compiled(None, problem(error))

        return self.lane.start(name, work, then)


def compile_frames(plans: Sequence[RenderPlan], device: str, presents: bool = False) -> Compiled:
    """Draw plans, as they are drawn while things move and at rest, and return the programs that this needed.

    With `presents`, the first picture is shown in all modes of the window.
    """
    engine, budget = _engine(newest_shader(), device)
    trouble = ""
    with engine.context.current() as gl:
        picture, viewport = gl.framebuffer([gl.texture(FRAME, 4)]), Viewport(engine)
        try:
            viewport.resize(FRAME)
            if presents:
                for side in (0, 1):
                    viewport.step(side, plans[0], 1)
                for mode, right_side, tone in product(MODES, RIGHT_SIDES, TONES):
                    report(None, mode)
                    viewport.present(Shown(mode, right_side, 0.5, tone=tone))
            for number, plan in enumerate(plans):
                report(number / len(plans), type(plan.method).__name__)
                engine.draw(plan, picture, 0.0, "none")
                viewport.restart()
                for _ in range(2):  # into other types of targets: the centers of pixels, and what is added to them
                    viewport.step(0, plan, 1, 1)
                if plan.caustics is not None:
                    light = PhotonPicture(engine, plan, FRAME)
                    light.step(0.0)
                    light.show()
                    viewport.step(1, plan, 1, photons=light.texture)
                    light.release()
        except TranslucentError as error:
            trouble = str(error)
        finally:
            gl.finish()
            viewport.release()
            picture.release()
    return Compiled(frozenset(budget.needed), trouble)


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
        raise RenderError(
            "the process that prepares pictures",
            f"this process uses the driver {own}, but the window uses {device}",
            "repair the installation of the graphics drivers",
        )
    engine.context.gl.extra = budget
    return engine, budget


def _quick(plan: RenderPlan) -> RenderPlan:
    """Plan that needs the same shader programs, but is quick to draw."""
    return dataclasses.replace(plan, scene=stand_in(plan.scene), diffusion=Diffusion(LEAST_RESOLUTION))


def stand_in(scene: Scene) -> Scene:
    """Scene that needs the same shader programs, but is quick to draw: boxes for meshes, and no textures."""
    return dataclasses.replace(
        scene,
        objects=[_object_like(item) for item in scene.objects],
        environment=_environment_like(scene.environment),
        environment_shadows=min(scene.environment_shadows, SHADOWS),
    )


def _object_like(item: Object) -> Object:
    surface, pictures = item.surface, dict[str, Any]()
    for field in dataclasses.fields(surface) if surface is not None else ():
        if isinstance(texture := getattr(surface, field.name), Texture):
            height, width, channels = texture.pixels.shape
            pixels = np.ones((_side_like(height), _side_like(width), channels), dtype=np.float32)
            pictures[field.name] = dataclasses.replace(texture, pixels=pixels)
    if surface is not None:
        surface = dataclasses.replace(surface, **pictures)
    # A mesh as flat as a ground casts its shadow with another method than boxes.
    simple = item.medium is None and len(item.mesh.faces) <= len(Box().tessellate().faces)
    return dataclasses.replace(item, mesh=item.mesh if simple else _boxes(item.mesh), surface=surface)


def _boxes(mesh: Mesh) -> Mesh:
    box = Box().tessellate()
    size = np.maximum(mesh.bounds[1] - mesh.bounds[0], 0.1 * mesh.diagonal)  # a leaf may be flat
    # Nothing of a convex body is between a light and its interface.
    fractions = np.linspace(1.0, 0.5, 1 if mesh.diagnosis.convex else BOXES)
    vertices = (mesh.center + fractions[:, None, None] * size * box.vertices).reshape(-1, 3)
    faces = (box.faces + len(box.vertices) * np.arange(len(fractions))[:, None, None]).reshape(-1, 3)
    uv = None if mesh.uv is None else np.zeros((len(vertices), 2))
    colors = None if mesh.colors is None else np.ones((len(vertices), 4))
    return Mesh(vertices, faces, uv, mesh.name, colors=colors)


def _environment_like(environment: Environment) -> Environment:
    background = environment.background and _environment_like(environment.background)
    if environment.map is not None:
        side = _side_like(environment.map.size[1])
        return dataclasses.replace(environment, map=EnvironmentMap(np.ones((side, 2 * side, 3))), background=background)
    # One color: nothing is to be blurred.
    return dataclasses.replace(environment, second=environment.first, background=background)


def _side_like(side: int) -> int:
    return 1 if side == 1 else SIDES[math.log2(side).is_integer()]
