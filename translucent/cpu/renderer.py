"""Frames without OpenGL: rays on all processors by Embree, shaded as the reference shades them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from translucent.arrays import Array, Integers, slices
from translucent.cpu.hits import Band, ExactRayCaster, PictureRays, PixelTracer, TracedMesh
from translucent.cpu.interactions import MicrofacetSamples
from translucent.cpu.ray_tree import DiffusionFields, RayTree
from translucent.diffusion.cache import FieldCache
from translucent.diffusion.photons import photon_segments
from translucent.errors import RenderError
from translucent.files.reading import require_allowed
from translucent.formulas import optics
from translucent.formulas.sampling import sample_shifts
from translucent.frames.frame import Frame
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster, embree_versions, point_from
from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.caustics import Caustics
from translucent.planning.passes import PassName
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.planning.rendered import darkened
from translucent.reference.hits import Hits, Lines, Rays, SceneTracer, TracedObject, sorted_hits
from translucent.reference.intervals import sum_signs
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.refracted import bends
from translucent.reference.render import shade_hits
from translucent.reference.surfaces import sheet_thicknesses
from translucent.scene.scene import Light, Scene
from translucent.threads import end_if_stopped, in_threads, processors

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
            raise RenderError("rendering", "the renderer has been closed", "create a new renderer")
        started = time.perf_counter()
        scene, samples = plan.scene, plan.request.samples
        fields = self._fields.of(plan)
        scattered = fields.on_opaque if fields else None
        shader = Shader.of(scene, plan, self._embree_meshes(scene), scattered)
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


#: Number of faces of one object on a line after which Embree looks for no more.
MOST_FACES = 64


class EmbreeLightPaths(LightPaths):
    """Straight paths from lights to points, with candidates by Embree and decisions in float64.

    Lines on which Embree's faces turn out to be others, or do not close a body, are traced as the reference does.
    What it may miss is a pair of faces that are within 2e-6 of the size of their mesh.

    Parameters
    ----------
    scene : Scene
    sheets : sequence of float or None
        As `sheet_thicknesses` gives them.
    meshes : mapping of Mesh to RayCaster
        All of the scene.
    """

    def __init__(self, scene: Scene, sheets: tuple[float | None, ...], meshes: Mapping[Mesh, RayCaster]) -> None:
        super().__init__(scene, sheets)
        self._meshes = meshes

    @cached_property
    def tracer(self) -> SceneTracer:
        """Ray caster for the objects."""
        found = SceneTracer(self.scene)
        found.objects = [
            _EmbreeObject(traced.body, traced.corners, self._meshes[traced.body.mesh], self.scene)
            for traced in found.objects
        ]
        return found


@dataclass(frozen=True, eq=False)
class _EmbreeObject(TracedObject):
    """Object whose candidate faces come from Embree."""

    embree: RayCaster
    scene: Scene

    def hits(self, lines: Lines) -> Hits:
        """All surfaces on the lines; `Hits.pixel` is the number of the line."""
        end_if_stopped()
        line, face = self._candidates(lines)
        hits = self.crossings(lines, [(line, face)])
        tried, crossed = (np.bincount(pixel, minlength=len(lines)) for pixel in (line, hits.pixel))
        doubtful = (tried != crossed) | (tried >= MOST_FACES)
        filled = self.body.medium is not None and self.body.sheet_thickness is None
        if filled or self.body.mesh.diagnosis.solid:
            doubtful |= sum_signs(hits, len(lines)) != 0
        if doubtful.any():
            rest = np.flatnonzero(doubtful)
            again = super().hits(lines.where(rest))
            parts = hits.where(~doubtful[hits.pixel]), replace(again, pixel=rest[again.pixel])
            hits = sorted_hits([(one.pixel, one.face, one.distance, one.sign, one.barycentric) for one in parts], 1)
        return hits.where((hits.distance >= lines.start[hits.pixel]) & (hits.distance <= lines.end[hits.pixel]))

    def _candidates(self, lines: Lines) -> tuple[Integers, Integers]:
        """Pairs (k,), (k,) of a line and a face, by rays in the ball of the mesh."""
        inverse = np.linalg.inv(self.body.matrix[:3, :3])
        with np.errstate(under="ignore"):
            origins = (
                lines.origins - point_from(self.embree.center, self.body.matrix, self.scene.camera.eye)
            ) @ inverse.T
            directions = lines.directions @ inverse.T
            directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        counted = np.ones(len(self.corners), dtype=bool)
        return self.embree.candidates(
            origins / self.embree.radius, directions, np.full(len(lines), MOST_FACES), counted
        )


#: Photons in the disc of each one: the noise of light at a point is 1.15 over the root of this number.
GATHERED = 64

#: Largest height of a photon over the plane of the point, in radii of its disc.
FLAT = 0.2

#: Least radius of a disc, as a fraction of the scene's diagonal.
LEAST_RADIUS = 1e-4

#: Factor between the largest and the smallest radius of discs that are looked for together.
TOGETHER = 1.5

#: Points at which light is gathered together.
RAY_BATCH = 1 << 14


class CausticLight(SurfaceLight):
    """Light on surfaces, with caustics of photons on opaque ones (Jensen 1996).

    The light of each photon is spread over a disc that holds so many of its neighbors (Breiman, Meisel & Purcell 1977,
    "Variable kernel estimates"). What the nearest photons of a point carry over the area that they lie in would, added
    up over all points, be more than they carry: far off a caustic it falls as slowly as the squared distance.

    Parameters
    ----------
    scene : Scene
        As rendered, with its eye as the origin of points.
    sheets, meshes
        As `EmbreeLightPaths` takes them.
    caustics : Caustics
    bending : frozenset of int
        Objects that straight light of lights does not pass, since photons carry it.
    scattered : callable, optional
        As of `SurfaceLight`.
    """

    def __init__(
        self,
        scene: Scene,
        sheets: tuple[float | None, ...],
        meshes: Mapping[Mesh, RayCaster],
        caustics: Caustics,
        bending: frozenset[int],
        scattered: Callable[[Array, Array, Array], Array] | None = None,
    ) -> None:
        super().__init__(EmbreeLightPaths(scene, sheets, meshes), scattered)
        self._dark = SurfaceLight(EmbreeLightPaths(darkened(scene, bending), sheets, meshes))
        self._discs = _discs(*_landed(scene, caustics), scene)

    def straight(self, light: Light, points: Array, before: float) -> Array:
        """(k, 3): transmittance of straight light, 0 behind bodies that refract where it goes to opaque objects."""
        return self._dark.straight(light, points, before) if before == 0.0 else super().straight(light, points, before)

    def on_opaque(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points (k, 3) of opaque objects with unit normals (k, 3)."""
        return np.asarray(super().on_opaque(points, normals) + self._gathered(points, normals))

    def _gathered(self, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance by photons whose discs contain the points."""
        found = np.zeros(points.shape)
        for first in range(0, len(points), RAY_BATCH):
            part = slice(first, first + RAY_BATCH)
            places = cKDTree(points[part])
            for discs in self._discs:
                found[part] += discs.light(places, normals[part])
        return found


@dataclass(frozen=True, eq=False)
class _Discs:
    """Photons with discs of about the same size: points from the eye, directions, power (n, 3) and radii (n,)."""

    points: Array
    directions: Array
    power: Array
    radius: Array

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def light(self, places: cKDTree, normals: Array) -> Array:
        """(k, 3): irradiance at places with unit normals (k, 3)."""
        near = places.sparse_distance_matrix(self._tree, float(self.radius.max()), output_type="ndarray")
        place, photon, distance = near["i"], near["j"], near["v"] / self.radius[near["j"]]
        height = ((self.points[photon] - places.data[place]) * normals[place]).sum(axis=1)
        reached = (distance < 1.0) & (np.abs(height) < FLAT * self.radius[photon])
        reached &= (self.directions[photon] * normals[place]).sum(axis=1) < 0.0
        place, photon, distance = place[reached], photon[reached], distance[reached]
        with np.errstate(under="ignore"):
            # Those near the edge count less (Epanechnikov), so that no photon comes or goes at once.
            kernel = 2.0 * (1.0 - distance**2) / (np.pi * self.radius[photon] ** 2)
            light = kernel[:, None] * self.power[photon]
            return np.stack([np.bincount(place, light[:, channel], len(normals)) for channel in range(3)], axis=1)


def _discs(points: Array, directions: Array, power: Array, scene: Scene) -> list[_Discs]:
    """Discs of photons by their size."""
    if not len(points):
        return []
    points = points - scene.camera.eye
    radius = cKDTree(points).query(points, k=[min(GATHERED, len(points))])[0][:, 0]
    radius = np.maximum(radius, LEAST_RADIUS * scene.diagonal)
    size = np.floor(np.log(radius) / np.log(TOGETHER))
    kinds = [np.flatnonzero(size == one) for one in np.unique(size)]
    return [_Discs(points[own], directions[own], power[own], radius[own]) for own in kinds]


def _landed(scene: Scene, caustics: Caustics) -> tuple[Array, Array, Array]:
    """Points, directions and power (n, 3) of photons that land on opaque objects after interfaces."""
    parts = [np.zeros((3, 0, 3))]
    for segments in photon_segments(scene, caustics.photons, caustics.seed):
        ends = segments.where(segments.lands & segments.bent)
        points = ends.origins + ends.length[:, None] * ends.directions
        with np.errstate(under="ignore"):
            left = ends.power * optics.transmittance(ends.extinction * ends.length[:, None])
        parts.append(np.stack([points, ends.directions, left]))
    points, directions, power = np.concatenate(parts, axis=1)
    return points, directions, power


Arrays = dict[str, npt.NDArray[Any]]
Sheets = tuple[float | None, ...]

#: Surfaces, times objects, that are shaded at a time: the working arrays stay below 100 MB.
SURFACES = 1 << 21

#: Arrays that an invalid pixel takes from the fallback; its validity and coverage are known already.
RENDERED_IMAGES = ("radiance", "transmittance", "optical_depth", "thickness")


@dataclass(frozen=True, eq=False)
class Shader:
    """Shader of pixel hits into the arrays of a frame.

    Attributes
    ----------
    scene : Scene
    sheets : tuple of float or None
        Thickness in metres of the sheet that each object is; None for a solid.
    fallback : tuple of float or None, or None
        The same where a pixel is not valid, for scenes with bodies that are not closed.
    light : SurfaceLight
        On the surfaces of the scene.
    """

    scene: Scene
    sheets: Sheets
    fallback: Sheets | None
    light: SurfaceLight

    @classmethod
    def of(
        cls,
        scene: Scene,
        plan: RenderPlan,
        meshes: Mapping[Mesh, RayCaster],
        scattered: Callable[[Array, Array, Array], Array] | None = None,
    ) -> Shader:
        """Shader for a plan of the scene; `meshes` are all of it, `scattered` is as of `SurfaceLight`."""
        sheets = sheet_thicknesses(scene, plan.method)
        drawn = {i for step in plan.passes if step.name is PassName.THIN_LAYER_FALLBACK for i in step.objects}
        diagonals = [float(np.linalg.norm(body.bounds[1] - body.bounds[0])) for body in scene.objects]
        fallback = tuple(
            FALLBACK_SHEET * diagonals[i] if i in drawn and metres is None else metres
            for i, metres in enumerate(sheets)
        )
        if plan.caustics is None:
            light = SurfaceLight(EmbreeLightPaths(scene, sheets, meshes), scattered)
        else:
            light = CausticLight(scene, sheets, meshes, plan.caustics, plan.opaque_to_shadows, scattered)
        return cls(scene, sheets, fallback if drawn else None, light)

    def shade(self, rays: Rays, hits: Sequence[Hits]) -> Arrays:
        """Shade some rays into the arrays of a frame, (n,) or (n, 3), float64 and bool.

        Parameters
        ----------
        rays : Rays
        hits : sequence of Hits
            Of each object of the scene, as `shade_hits` takes them.
        """
        surfaces = np.sum([np.bincount(line.pixel, minlength=len(rays)) for line in hits], axis=0)
        parts = []
        for some in slices(surfaces * len(hits), SURFACES):
            chosen = np.arange(some.start, some.stop)
            parts.append(self._shade(rays.where(some), [line.on_rays(chosen, len(rays)) for line in hits]))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _shade(self, rays: Rays, hits: Sequence[Hits]) -> Arrays:
        shaded = shade_hits(self.scene, rays, hits, self.sheets, self.light)
        invalid = np.flatnonzero(~shaded["valid"])
        if self.fallback is not None and invalid.size:
            lines = [line.on_rays(invalid, len(rays)) for line in hits]
            again = shade_hits(self.scene, rays.where(invalid), lines, self.fallback, self.light)
            for name in RENDERED_IMAGES:
                shaded[name][invalid] = again[name]
        return shaded
