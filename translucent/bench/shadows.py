"""Shadows of bodies on a ground: maps of several sizes and the shortcuts of others, against the float64 reference."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from translucent import reference
from translucent.arrays import Array, Integers
from translucent.bench.claims import SHADOW_MAP_CLAIMS, USUAL, Judge
from translucent.bench.drawing import BenchContext, Sample, Samples, ShortcutDrawing, interleaved
from translucent.bench.experiment import Experiment, one_line
from translucent.bench.record import (
    CONSTANT,
    HALF,
    OPAQUE,
    ErrorStatistics,
    Part,
    ReportPicture,
    ShadowCase,
    ShadowRow,
)
from translucent.bench.shapes import across, placed, toolkit
from translucent.bench.truth import picture_of
from translucent.errors import RenderError
from translucent.frames.frame import Frame
from translucent.frames.metrics import interior
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.job import FrameJob
from translucent.gpu.light_cameras import ShadowOccluders, support_of
from translucent.gpu.passes.shortcuts import DepthOnlyPass, HalfFloatPass
from translucent.gpu.targets import Targets
from translucent.media.medium import Medium
from translucent.planning.passes import PassName
from translucent.planning.shadow_maps import ShadowMaps
from translucent.reference.hits import Lines
from translucent.reference.light_paths import LightPaths, direction_and_distance
from translucent.reference.surfaces import sheet_thicknesses
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light, Object, Overlap, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

DARK = Environment.constant((0.0, 0.0, 0.0))
WINE, LEAF = Medium(absorption=(0.5, 2.0, 1.0)), Medium(absorption=(2.0, 0.3, 1.0))

#: Direction of sunlight: towards the eye, so that shadows lie in front of their occluders.
SUNWARDS = (0.7, -1.0, 0.5)
#: Position of point and spot lights, from the middle of the objects, in diagonals of these.
PLACE = (-0.9, 1.6, -0.8)

#: Square ground of 2 x 2, as vertices and faces.
QUAD = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], dtype=np.float64)
QUAD_FACES = np.array([(0, 2, 1), (0, 3, 2)], dtype=np.int32)

#: Distance from a point of the ground to its occluders, as a fraction of the scene: it is not its own shadow.
_CONTACT = 1e-9

#: Light beside which nothing is seen, as a fraction of that where it is bright.
_FAINT = 0.01

_PROMISES = {
    OPAQUE: "none: all or nothing",
    CONSTANT: "none: the best share of each body's diagonal that there is",
    HALF: "none: 11 bits for sums of signed distances",
}


@dataclass(frozen=True)
class LightScene:
    """Scene of a shadow or of a caustic.

    Attributes
    ----------
    name, title, why : str
        As in its record.
    make : callable
        Makes it, always the same.
    pictured, quick : bool
        With pictures; measured with ``--quick``, too.
    """

    name: str
    title: str
    why: str
    make: Callable[[], Scene]
    pictured: bool = False
    quick: bool = False


def over_ground(
    objects: Sequence[Object],
    light: str,
    *,
    gap: float = 0.02,
    surface: Surface | None = None,
    overlap: Overlap = "add",
) -> Scene:
    """Objects above a ground, which is the last object, with all of their shadow in view.

    Parameters
    ----------
    objects : sequence of Object
    light : {"sun", "point light", "spot"}
        All about equally bright on the ground.
    gap : float
        Height above the ground, in diagonals of the objects.
    surface : Surface, optional
        Of the ground; default: white.
    overlap : str
    """
    corners = np.concatenate([item.bounds for item in objects])
    low, high = corners.min(axis=0), corners.max(axis=0)
    center, diagonal = 0.5 * (low + high), float(np.linalg.norm(high - low))
    height = float(low[1]) - gap * diagonal
    floor = Mesh(
        8.0 * diagonal * QUAD + (center[0], height, center[2]),
        QUAD_FACES,
        uv=0.5 * (QUAD[:, [0, 2]] + 1.0),
        name="ground",
    )
    ground = Object(floor, color=(1.0, 1.0, 1.0)) if surface is None else Object(floor, surface=surface)
    box = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    place, power = center + np.array(PLACE) * diagonal, 4.0 * np.pi * diagonal**2
    shining: Light
    if light == "sun":
        shining = DirectionalLight(SUNWARDS, np.pi)
        directions = np.broadcast_to(np.asarray(shining.direction), box.shape)
    else:
        spot = SpotLight(place, center - place, power, 14.0, 30.0)
        shining = spot if light == "spot" else PointLight(place, power)
        directions = box - place
    thrown = box + ((height - box[:, 1]) / directions[:, 1])[:, None] * directions
    camera = Camera.framing(np.concatenate([box, thrown]), direction=(-0.1, -1.1, -1.0), fov_y=30.0)
    return Scene([*objects, ground], camera, [shining], DARK, overlap)


def _body(mesh: Mesh) -> Object:
    return Object(mesh, Medium(absorption=across(mesh, 1.0, 2.0, 4.0)))


def _stack() -> Scene:
    plate, ball = Box((-1.0, -0.25, -0.8), (1.0, 0.25, 0.8)).tessellate(), Sphere(radius=0.6).tessellate(96)
    return over_ground([Object(plate, WINE), placed(ball, WINE, (0.1, 0.86, 0.0))], "sun")


def _two_media() -> Scene:
    ball, box = Sphere().tessellate(96), Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate()
    return over_ground([Object(ball, WINE), placed(box, LEAF, (1.3, 0.1, 0.2))], "point light")


def _textured() -> Scene:
    tiles = np.where(np.indices((64, 64)).sum(axis=0)[..., None] % 2, (0.85, 0.8, 0.7), (0.35, 0.4, 0.45))
    surface = Surface(roughness=1.0, color_texture=Texture(tiles))
    return over_ground([_body(toolkit("knot"))], "point light", surface=surface)


def _in_a_glass() -> Scene:
    # Straight light: that of bent light is in the caustics.
    glass = Object(toolkit("goblet"), Medium(absorption=(60.0, 25.0, 35.0)), priority=1)
    wine = Object(toolkit("wine"), Medium.from_color((0.62, 0.05, 0.09), 0.02))
    return over_ground([glass, wine], "spot", overlap="priority")


def _stone() -> Scene:
    stone = placed(Sphere(radius=0.5).tessellate(96), None, (-1.3, 1.0, 0.2))
    return over_ground([Object(Sphere().tessellate(96), WINE), stone], "sun")


def _single(name: str, light: str, *, pictured: bool = False, quick: bool = False) -> LightScene:
    shape = "a bar of soap" if name == "soap" else f"a {name}"
    title = f"{name.capitalize()}, {light}"

    def make() -> Scene:
        return over_ground([_body(toolkit(name))], light)

    return LightScene(f"{name}, {light}", title, f"{shape} over a ground", make, pictured, quick)


SHADOW_SCENES: tuple[LightScene, ...] = (
    _single("bear", "sun", pictured=True, quick=True),
    _single("bear", "point light"),
    _single("bear", "spot"),
    *(
        _single(name, light)
        for name in ("knot", "shell", "goblet", "bangle", "soap")
        for light in ("sun", "point light")
    ),
    LightScene(
        "fine ball",
        "Ball of 83,520 triangles, sun",
        "many triangles, each of a few texels",
        lambda: over_ground([_body(Sphere().tessellate(290))], "sun"),
    ),
    LightScene(
        "stack",
        "Stack of two bodies, sun",
        "a ball on a plate, of one medium: what passes one, passes the other",
        _stack,
    ),
    LightScene(
        "two media",
        "Two media, point light",
        "a ball and a box of other colors, whose shadows cross",
        _two_media,
        pictured=True,
        quick=True,
    ),
    LightScene("textured", "Knot over tiles, point light", "a ground with a texture", _textured, pictured=True),
    LightScene(
        "in a glass",
        "Wine in a glass, spot",
        "a body inside another, which gives way to it",
        _in_a_glass,
        pictured=True,
    ),
    LightScene("stone", "Ball and stone, sun", "something opaque between the light and a body", _stone, pictured=True),
)


@dataclass(frozen=True)
class ShadowMapComparison(Experiment[LightScene]):
    """Shadow maps by their size, beside opaque ones, one thickness for each body, and float16.

    Parameters
    ----------
    shown : sequence of LightScene
    sizes : sequence of int
        Texels along a side of maps.
    usual, texels, pixels : int
        Widths of the maps of shortcuts and pictures, of the map whose texels are compared, and of pictures.
    seconds : float
        Of timing, for each map.
    """

    part: ClassVar[Part] = "shadows"
    label: ClassVar[str] = "shadow, "
    into: ClassVar[str] = "shadows.cases"
    claims: ClassVar[tuple[Judge, ...]] = SHADOW_MAP_CLAIMS

    shown: Sequence[LightScene] = SHADOW_SCENES
    sizes: Sequence[int] = (512, 1024, 2048, 4096)
    usual: int = USUAL
    texels: int = 512
    pixels: int = 256
    seconds: float = 1.0

    def blank(self, bench: BenchContext, scene: LightScene) -> ShadowCase:
        """Record of a scene without numbers."""
        return ShadowCase(scene.name, scene.title, scene.why)

    def truth(self, bench: BenchContext, scene: LightScene) -> Ground:
        """Light on the ground."""
        return Ground(bench.renderer, scene.make(), self.pixels, self.usual, pictured=scene.pictured)

    def contenders(self, truth: Ground) -> Sequence[ShadowRow]:
        """Rows without numbers."""
        maps = [ShadowRow(f"map of {size}", "method", size, "exact in each texel's ray") for size in self.sizes]
        return [*maps, *(ShadowRow(name, "counter-example", self.usual, said) for name, said in _PROMISES.items())]

    def row(self, bench: BenchContext, ground: Ground, row: ShadowRow) -> ShadowRow:
        """Errors of one technique; of maps, times, too."""
        if row.method == HALF and ground.occluded:
            return dataclasses.replace(row, refusal="drawn without opaque objects")
        try:
            found = ground.shown_by(bench, row)
            errors = error_statistics((found - ground.truth)[ground.away])
            row = dataclasses.replace(row, errors=errors, edges=ground.edges(found))
            if row.kind == "method":
                times = map_times(bench, ground.scene, row.size, self.seconds)
                row = dataclasses.replace(row, wall=times.timing("wall"), ratio=times.ratio("part"))
            if row.size == self.usual:
                ground.picture(row.method, found)
        except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row
            return dataclasses.replace(row, errors=None, edges=None, failure=one_line(error))
        return row

    def record(self, bench: BenchContext, blank: ShadowCase, ground: Ground, rows: Sequence[ShadowRow]) -> ShadowCase:
        """Record of a scene, with errors in the rays of texels."""
        scene = ground.scene
        media = {tuple(item.medium.extinction.tolist()) for item in scene.bodies if item.medium is not None}
        sizes = [(row.size, row.edges) for row in rows if row.kind == "method" and row.edges]
        order = None
        if len(sizes) > 1:
            x, y = np.log2(np.array(sizes, dtype=np.float64)).T
            order = float(-np.polyfit(x, y, 1)[0])
        # Texels do not resolve what is before the first opaque surface.
        texels = None if ground.occluded else error_statistics(texel_errors(bench.renderer, scene, self.texels))
        return dataclasses.replace(
            blank,
            triangles=sum(len(item.mesh.faces) for item in scene.objects[:-1]),
            bodies=len(scene.bodies),
            opaque=ground.occluded,
            alike=len(media) == 1,
            compared_points=int(ground.away.sum()),
            reference_seconds=ground.seconds,
            texels=texels,
            texel_size=self.texels,
            order=order,
            rows=tuple(rows),
            pictures=tuple(ground.pictures),
        )


class Ground:
    """Ground of a scene, its last object, in the light of its one light source.

    Parameters
    ----------
    renderer : Renderer
    scene : Scene
    pixels, usual : int
        Width and height of pictures, and of their maps.
    pictured : bool
        Collect pictures.

    Attributes
    ----------
    truth : (h, w, 3) float64
        Transmittance from the light to the points that pixels see.
    seconds : float
        Time of the truth.
    bare : (h, w, 3) float64
        Radiance with nothing in the light, for which bodies are made clear.
    frame : Frame
        The picture.
    bright : float
        Of `bare` where it is bright.
    seen : (h, w) bool
        Pixels that show the ground by itself, in light.
    inside, away : (h, w) bool
        Of these, those away from all outlines of shadows, inner ones included; and of those, the ones in the shadow.
    near : (h, w) bool
        Of these, those in the shadow or next to it.
    occluded : bool
        Some occluders are opaque.
    pictures : list of ReportPicture
    """

    def __init__(
        self, renderer: Renderer, scene: Scene, pixels: int, usual: int = USUAL, *, pictured: bool = False
    ) -> None:
        self.renderer, self.scene, self.size, self.usual = renderer, scene, (pixels, pixels), usual
        began = time.perf_counter()
        points = _on_ground(scene.camera, scene, self.size)
        self.truth = reference.light_transmittance(scene, 0, points.reshape(-1, 3)).reshape(points.shape)
        self.seconds = time.perf_counter() - began
        self.bare = self._radiance(self._with([]))
        self.frame = self._drawn(scene)
        self.bright = float(np.quantile(self.bare, 0.99))
        _, nearest = reference.opaque_counts(scene, self.size)
        ground = ~self.frame.coverage & (nearest == len(scene.objects) - 1)
        self.seen = ground & np.asarray(self.bare.min(axis=-1) > _FAINT * self.bright)
        inside = interior(self.seen)
        for counts in _crossings(scene, points):
            inside &= interior(counts)
        dimmed = np.asarray((self.truth < 1.0).any(axis=-1))
        self.inside = inside & self.seen
        self.away = self.inside & dimmed
        self.near = (dimmed | ~interior(dimmed)) & self.seen
        self.occluded = len(scene.opaque) > 1
        self.pictures: list[ReportPicture] = []
        self._pictured = pictured
        self.picture("reference", self.truth)

    def shown_by(self, bench: BenchContext, row: ShadowRow) -> Array:
        """(h, w, 3): transmittance on the ground by the technique of a row."""
        if row.method == OPAQUE:
            return self._unblocked(range(len(self.scene.objects) - 1))
        if row.method == CONSTANT:
            return self._constant()
        found = self.shown(row.size)
        if row.method == HALF:
            halve(bench, self.scene, row.size)
            found = self.shown(row.size)
            bench.renderer.gpu.shadows.held = None
        return found

    def shown(self, size: int | None = None) -> Array:
        """(h, w, 3): transmittance on the ground, as pictures with maps of this size show it."""
        return self._relative(self._radiance(self.scene, size))

    def edges(self, found: Array) -> float:
        """Mean absolute error, by the worst channel, over the shadow and next to it."""
        return float(np.abs(found - self.truth).max(axis=-1)[self.near].mean())

    def picture(self, method: str, found: Array) -> None:
        """Collect a picture of the scene with this light on its ground, and the error of transmittance there."""
        if not self._pictured:
            return
        light = np.where(self.seen[..., None], found * self.bare, self.frame.radiance) / self.bright
        rendered = dataclasses.replace(self.frame, radiance=light.astype(np.float32)).to_srgb8()
        error = None if found is self.truth else found - self.truth
        self.pictures.append(picture_of(method, rendered, error, self.seen))

    def _unblocked(self, objects: Sequence[int]) -> Array:
        """Transmittance by opaque shadow maps of these objects."""
        stones = [dataclasses.replace(self.scene.objects[i], medium=None, surface=None, density=None) for i in objects]
        return self._relative(self._radiance(self._with(stones)))

    def _constant(self) -> Array:
        """Transmittance with one thickness for each body: the fraction of its diagonal that fits best."""
        from scipy.optimize import minimize_scalar

        parts = []
        for i, item in enumerate(self.scene.objects[:-1]):
            extinction = np.full(3, np.inf) if item.medium is None else np.asarray(item.medium.extinction)
            depth = extinction * float(np.linalg.norm(item.bounds[1] - item.bounds[0]))
            parts.append((self._unblocked([i]), depth))

        def rendered(fraction: float) -> Array:
            with np.errstate(under="ignore"):
                dimmed = [left + (1.0 - left) * np.exp(-fraction * depth) for left, depth in parts]
                return np.asarray(np.prod(dimmed, axis=0))

        def off(fraction: float) -> float:
            return float(((rendered(fraction) - self.truth)[self.near] ** 2).mean())

        return rendered(float(minimize_scalar(off, bounds=(1e-3, 1.0), method="bounded").x))

    def _with(self, stones: Sequence[Object]) -> Scene:
        """The scene with these objects in place of its own, and a clear body, since a scene needs one."""
        clear = dataclasses.replace(self.scene.bodies[0], medium=Medium(), surface=None)
        return dataclasses.replace(self.scene, objects=[clear, *stones, self.scene.objects[-1]])

    def _drawn(self, scene: Scene, size: int | None = None) -> Frame:
        return self.renderer.render(scene, self.size, shadows=ShadowMaps(size or self.usual))

    def _radiance(self, scene: Scene, size: int | None = None) -> Array:
        return np.asarray(self._drawn(scene, size).radiance, np.float64)

    def _relative(self, radiance: Array) -> Array:
        """Radiance of the ground, divided by the radiance without shadows."""
        lit = self.bare > 0
        return np.where(lit, radiance / np.where(lit, self.bare, 1.0), 1.0)


def _on_ground(camera: Camera, scene: Scene, size: tuple[int, int]) -> Array:
    """Points (h, w, 3) of the ground of a scene on the rays of a camera."""
    origins, directions = (np.broadcast_to(part, (*size[::-1], 3)) for part in camera.rays(size))
    height = float(scene.objects[-1].bounds[0, 1])
    return np.asarray(origins + ((height - origins[..., 1]) / directions[..., 1])[..., None] * directions)


def _crossings(scene: Scene, points: Array) -> list[Integers]:
    """Number of crossings with each object but the ground between points (h, w, 3) and the light."""
    paths = LightPaths(scene, sheet_thicknesses(scene))
    places = points.reshape(-1, 3) - scene.camera.eye
    travel, distance = direction_and_distance(paths.lights[0], places)
    lines = Lines(places, -travel, np.full(len(places), _CONTACT * scene.diagonal), distance)
    objects = paths.tracer.objects[:-1]
    return [np.bincount(one.hits(lines).pixel, minlength=len(places)).reshape(points.shape[:2]) for one in objects]


def error_statistics(differences: Array) -> ErrorStatistics:
    """Statistics of differences (n, 3), each by its worst channel."""
    worst = np.abs(differences).max(axis=-1)
    if not worst.size:
        raise ValueError("no point is away from outlines")
    p50, p99, p999 = np.quantile(worst, (0.5, 0.99, 0.999)).tolist()
    rms, bias = float(np.sqrt((worst**2).mean())), float(np.mean(differences))
    return ErrorStatistics(rms, p50, p99, p999, float(worst.max()), bias)


def map_camera(scene: Scene) -> Camera:
    """Camera of the one map of a scene with one light; raises `RenderError` if there are more."""
    cameras = ShadowOccluders(scene.lights[0], scene, [support_of(item) for item in scene.objects]).cameras()
    if len(cameras) != 1:
        raise RenderError(
            "shadow map of one light",
            f"this light needs {len(cameras)} shadow maps",
            "move the light away from the objects that it illuminates",
        )
    return cameras[0]


def texel_errors(renderer: Renderer, scene: Scene, size: int) -> Array:
    """Errors (n, 3) of transmittance in the rays of a map's texels that end on the ground, away from outlines."""
    renderer.render(scene, (8, 8), shadows=ShadowMaps(size))
    sums = np.flipud(_sums(renderer, size))
    camera = map_camera(scene)
    advance = 1.0 / (np.broadcast_to(camera.rays((size, size))[1], (size, size, 3)) @ camera.forward)
    depth = sums[..., :3] if sums.shape[-1] > 2 else sums @ _extinctions(scene)[: sums.shape[-1]]
    found = np.exp(-depth * advance[..., None])
    counts = reference.hit_counts(dataclasses.replace(scene, objects=list(scene.bodies), camera=camera), (size, size))
    inside = interior(counts) & (counts > 0)
    points = _on_ground(camera, scene, (size, size))[inside]
    return np.asarray(found[inside] - reference.light_transmittance(scene, 0, points))


def _extinctions(scene: Scene) -> Array:
    """(k, 3): extinction of each medium, in order."""
    found = {item.medium.extinction.tobytes(): item.medium.extinction for item in scene.bodies if item.medium}
    return np.array(list(found.values()))


def _sums(renderer: Renderer, size: int) -> Array:
    """(size, size, 1, 2 or 4): texels of the renderer's shadow map, the bottom row first."""
    with renderer.gpu.context.current():
        texture = renderer.gpu.shadows.sums.color_attachments[0]
        return np.frombuffer(texture.read(), np.float32).reshape(size, size, -1).astype(np.float64)


def halve(bench: BenchContext, scene: Scene, size: int) -> None:
    """Round the sums of the renderer's shadow map to float16.

    Signed distances are added up as in pictures, from the center of the media; only their sums have 11 bits.
    """
    renderer, camera = bench.renderer, map_camera(scene)
    rendered = dataclasses.replace(scene, objects=list(scene.bodies), camera=camera, lights=[])
    targets = Targets(bench.gl, (size, size))
    drawing = ShortcutDrawing(bench, rendered, targets, renderer.plan(rendered), bench.own(HalfFloatPass))
    try:
        drawing.draw()
        frame = drawing.read()
    finally:
        drawing.release()
        targets.release()
    forward = np.broadcast_to(camera.rays((size, size))[1] @ camera.forward, (size, size))[..., None]
    values = np.array(_sums(renderer, size))
    if values.shape[-1] > 1:
        depth = np.flipud(np.asarray(frame.optical_depth, np.float64) * forward)
        if values.shape[-1] == 2:  # the paths in two media that have these optical depths
            values = depth @ np.linalg.pinv(_extinctions(scene))
        else:
            values[..., :3] = depth
    else:
        values[..., :1] = np.flipud(np.asarray(frame.thickness, np.float64)[..., None] * forward)
    texture = renderer.gpu.shadows.sums.color_attachments[0]
    texture.write(np.ascontiguousarray(values, dtype=np.float32).tobytes())


def map_times(bench: BenchContext, scene: Scene, size: int, seconds: float) -> Samples:
    """Times of rendering one shadow map, and of its depth-only floor."""
    failed: list[Exception] = []
    with _map_and_floor(bench, scene, size) as (draw_map, draw_depth):
        found = interleaved(draw_depth, {"map": draw_map}, seconds, lambda _, error: failed.append(error))
    if failed:
        raise failed[0]
    return found["map"]


@contextmanager
def _map_and_floor(
    bench: BenchContext, scene: Scene, size: int
) -> Iterator[tuple[Callable[[], Sample], Callable[[], Sample]]]:
    """Drawing of the map of a scene, and of the same objects into a depth buffer."""
    gl = bench.gl
    plan = bench.renderer.plan(scene, shadows=ShadowMaps(size))
    spec = next(step for step in plan.passes if step.name is PassName.SHADOW_MAPS)
    objects = tuple(range(len(scene.objects)))
    small, large = Targets(gl, (16, 16)), Targets(gl, (size, size))
    job = FrameJob(gl, plan, small, bench.resources)
    lit = dataclasses.replace(scene, camera=map_camera(scene))
    rendered = FrameJob(gl, dataclasses.replace(plan, scene=lit), large, bench.resources)
    maps, floor = bench.step(spec.name), bench.own(DepthOnlyPass)
    job.place((0.0, 0.0))
    rendered.place((0.0, 0.0), with_depth=True)

    def make() -> None:
        job.resources.shadows.held = None
        maps.run(job, spec)

    def draw() -> None:
        rendered.uniforms.bind()
        floor.run(rendered, objects)

    try:
        yield partial(bench.timed, make), partial(bench.timed, draw)
    finally:
        for one in (job, rendered, small, large):
            one.release()
        bench.resources.shadows.release()
