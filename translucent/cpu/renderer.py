"""Frames without OpenGL: rays on all processors, and the shading of the reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from translucent.arrays import Integers
from translucent.cpu.hits import Band, ExactRayCaster, PictureRays, PixelTracer, TracedMesh
from translucent.cpu.interactions import MicrofacetSamples
from translucent.cpu.ray_tree import DiffusionFields, RayTree
from translucent.cpu.shading import Arrays, Shader
from translucent.cpu.threads import in_threads, processors
from translucent.diffusion.cache import FieldCache
from translucent.errors import RenderError
from translucent.files.reading import require_allowed
from translucent.formulas.sampling import sample_shifts
from translucent.frames.frame import Frame
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster, embree_versions
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.reference.hits import Hits, Rays
from translucent.reference.refracted import bends
from translucent.scene.scene import Scene

#: Rays of the picture that are followed together: the working arrays stay below 100 MB.
BATCH = 1 << 14


@dataclass(frozen=True, eq=False)
class TracedRadiance:
    """Radiance of the pixels whose rays refract or reflect at interfaces.

    Attributes
    ----------
    tree : RayTree
    bending : tuple of int
        Objects with interfaces.
    """

    tree: RayTree
    bending: tuple[int, ...]

    @classmethod
    def of(
        cls,
        shader: Shader,
        caster: ExactRayCaster,
        size: tuple[int, int],
        tree: tuple[int, int],
        diffused: DiffusionFields,
    ) -> TracedRadiance:
        """Light for pictures of this size; `caster` has the objects of the shader's scene.

        `tree`: depth and forks, as of `TracedInterfaces`.
        """
        scene = shader.scene
        pixel = 2.0 * scene.camera.half_extent(size)[1] / size[1]
        rays = RayTree(shader.light, caster, size[0] / size[1], *tree, diffused, pixel)
        return cls(rays, tuple(i for i, body in enumerate(scene.objects) if body.has_interface))

    def put_into(
        self, shaded: Arrays, rays: Rays, hits: Sequence[Hits], band: Band, spread: MicrofacetSamples | None
    ) -> None:
        """Replace radiance and validity of those rays that bend; parameters as for `Shader.shade` and `RayTree.see`."""
        touched = np.zeros(len(rays), dtype=bool)
        for i in self.bending:
            touched[hits[i].pixel[hits[i].distance >= 0]] = True
        chosen = np.flatnonzero(touched & shaded["valid"])
        for begin in range(0, len(chosen), BATCH):
            self._put(shaded, rays, hits, chosen[begin : begin + BATCH], band.first_row * band.width, spread)

    def _put(
        self,
        shaded: Arrays,
        rays: Rays,
        hits: Sequence[Hits],
        some: Integers,
        first: int,
        spread: MicrofacetSamples | None,
    ) -> None:
        own = [line.on_rays(some, len(rays)) for line in hits]
        light = self.tree.see(rays.where(some), own, some + first, spread)
        shaded["radiance"][some], shaded["valid"][some] = light.radiance, light.valid


Seconds = dict[str, float]

#: Meshes of a scene and where they are, as bytes.
_Shapes = tuple[tuple[Mesh, bytes], ...]

_COLORS = ("radiance", "transmittance", "optical_depth")
_FLAGS = ("coverage", "valid")

#: Bytes that a small frame takes, as measured: half of it are the stacks and heaps of threads.
_TAKEN = 512 << 20

#: Largest number of a frame.
_LARGEST = float(np.finfo(np.float32).max)


class CpuRenderer:
    """Renderer on the CPU: hits by Embree, decided in float64, and the shading of the reference.

    Where interfaces bend rays, radiance is that of `RayTree`, and all else that of the straight rays.

    Parameters
    ----------
    threads : int, optional
        Default: as many as there are processors. Frames do not depend on it.

    Raises
    ------
    RenderError
        If embreex cannot be imported, or the process may take too little memory.
    """

    def __init__(self, threads: int | None = None) -> None:
        require_allowed("rendering", _TAKEN)
        self._threads = threads or processors()
        self._embree = embree_versions()
        self._meshes: WeakKeyDictionary[Mesh, TracedMesh] = WeakKeyDictionary()
        self._caster: tuple[_Shapes, ExactRayCaster] | None = None
        self._fields = FieldCache()
        self._closed = False

    @property
    def provenance(self) -> dict[str, str]:
        """Backend, versions of Embree and number of threads, as every frame records them."""
        return {"backend": "cpu", **self._embree, "threads": str(self._threads)}

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this renderer for the planner."""
        return Capabilities(shader_storage=False, opengl=False, scattering=False)

    def render(self, plan: RenderPlan, size: tuple[int, int]) -> Frame:
        """Run a plan.

        Parameters
        ----------
        plan : RenderPlan
            For a renderer without OpenGL. Whatever its method, solids show their true thickness. Radiance and
            transmittance are averaged over the sub-pixel samples that its request has; the other arrays belong to the
            ray through the pixel center, as all do with 1.
        size : (width, height)
            In pixels.

        Returns
        -------
        Frame
            With float32 arrays. `seconds` splits the time of all threads, divided by their number.

        Raises
        ------
        InputError
            If the size is not one.
        RenderError
            If the renderer is closed.
        """
        if self._closed:
            raise RenderError("rendering", "the renderer is closed", "make a new one")
        started = time.perf_counter()
        scene, samples = plan.scene, plan.request.samples
        shader = Shader.of(scene, plan, self._embree_meshes(scene))
        picture = PictureRays.of(scene.camera, size)
        arrays = _empty(picture.size)
        bent = self._bent_light(shader, picture, plan)
        prepared = time.perf_counter() - started
        seconds = self._draw(shader, picture, bent, partial(_store, arrays))
        seconds["prepare"] += prepared
        if samples > 1:
            for number, shift in enumerate(sample_shifts(samples).tolist(), 1):
                picture = PictureRays.of(scene.camera, size, tuple(shift))
                spread = MicrofacetSamples(number - 1, samples)
                spent = self._draw(shader, picture, bent, partial(_average, arrays, number), spread)
                seconds = {name: seconds[name] + spent[name] for name in seconds}
        seconds["total"] = time.perf_counter() - started
        return Frame(
            **arrays,
            plan=plan,
            seconds=seconds,
            provenance=self.provenance,
            scene=None,
        )

    def close(self) -> None:
        """Free the cached meshes. Closing twice is fine."""
        self._closed = True
        self._meshes.clear()
        self._fields.clear()
        self._caster = None

    def _embree_meshes(self, scene: Scene) -> dict[Mesh, RayCaster]:
        """All meshes of a scene, ready for rays; they are kept as long as the meshes are."""
        for body in scene.objects:
            if body.mesh not in self._meshes:
                self._meshes[body.mesh] = TracedMesh.of(body.mesh)
        return {body.mesh: self._meshes[body.mesh].embree for body in scene.objects}

    def _bent_light(self, shader: Shader, picture: PictureRays, plan: RenderPlan) -> TracedRadiance | None:
        """Traced radiance of a scene whose bodies have interfaces; the ray caster of the last scene is kept."""
        scene = shader.scene
        if not bends(scene) or plan.interfaces is None:
            return None
        shapes = tuple((body.mesh, body.matrix.tobytes()) for body in scene.objects)
        if self._caster is None or self._caster[0] != shapes:
            self._caster = shapes, ExactRayCaster(scene.objects)
        diffused = DiffusionFields(self._fields.of(plan).surfaces)
        return TracedRadiance.of(shader, self._caster[1], picture.size, plan.interfaces.tree, diffused)

    def _draw(
        self,
        shader: Shader,
        picture: PictureRays,
        bent: TracedRadiance | None,
        keep: Callable[[Band, Arrays], None],
        spread: MicrofacetSamples | None = None,
    ) -> Seconds:
        """Shade a picture, and pass each band of it to `keep`; returns the seconds of each part."""
        started = time.perf_counter()
        objects = shader.scene.objects
        tracers = in_threads(lambda body: PixelTracer(self._meshes[body.mesh], body, picture), objects, self._threads)
        prepared = time.perf_counter()

        def draw(band: Band) -> tuple[float, float]:
            began = time.perf_counter()
            hits = [tracer.hits(band) for tracer in tracers]
            crossed = time.perf_counter()
            rays = picture.rays(band)
            shaded = shader.shade(rays, hits)
            if bent is not None:
                bent.put_into(shaded, rays, hits, band, spread)
            keep(band, shaded)
            return crossed - began, time.perf_counter() - crossed

        intersect, shade = np.sum(in_threads(draw, picture.bands(), self._threads), axis=0) / self._threads
        return {"prepare": prepared - started, "intersect": float(intersect), "shade": float(shade)}


def _empty(size: tuple[int, int]) -> Arrays:
    """Uninitialized arrays of a frame."""
    shape = size[::-1]
    arrays: Arrays = {name: np.empty((*shape, 3), dtype=np.float32) for name in _COLORS}
    arrays["thickness"] = np.empty(shape, dtype=np.float32)
    arrays.update({name: np.empty(shape, dtype=bool) for name in _FLAGS})
    return arrays


def _store(arrays: Arrays, band: Band, shaded: Arrays) -> None:
    """Store a band in the arrays of a frame."""
    for name, array in arrays.items():
        part = _part(array, band)
        values = shaded[name].reshape(part.shape)
        with np.errstate(under="ignore"):
            part[:] = values if array.dtype == bool else np.clip(values, -_LARGEST, _LARGEST)


def _average(arrays: Arrays, number: int, band: Band, shaded: Arrays) -> None:
    """Add a sample to the running means of radiance and transmittance; `number` counts from 1."""
    for name in ("radiance", "transmittance"):
        mean = _part(arrays[name], band)
        # The first one takes the place of the pixel center.
        before = mean.astype(np.float64) if number > 1 else 0.0
        with np.errstate(under="ignore"):
            mean[:] = before + (np.clip(shaded[name].reshape(mean.shape), -_LARGEST, _LARGEST) - before) / number


def _part(array: npt.NDArray[Any], band: Band) -> npt.NDArray[Any]:
    return array[band.first_row : band.first_row + band.rows]
