"""Measurements in a worker process: errors against the reference, histograms, crossings of one ray."""

from __future__ import annotations

import dataclasses
import math
import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.assets import newest_shader
from translucent.errors import InputError, TranslucentWarning
from translucent.formulas.color import to_hex
from translucent.frames.appearance import average_color, thickness_samples
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, compare
from translucent.media.medium import Medium
from translucent.planning.methods import Method
from translucent.preview.tasks import Report
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Thickness of the sheet that stands for paint, in diagonals of its object.
THIN = 1e-6

#: Largest side of a texture of paint in pixels: a small picture shows no more.
MOST = 512


def with_paint(straight: Scene, scene: Scene) -> Scene:
    """Scene of straight rays, with the matt colors of opaque objects, and layers of paint on bodies.

    Parameters
    ----------
    straight : Scene
        Without the optical effects of interfaces.
    scene : Scene
        The same with them. Its objects are shown as they are, in their order.
    """
    objects: list[Object] = []
    for plain, item in zip(straight.objects, scene.shown, strict=True):
        if item.medium is None and item.surface is not None:
            plain = dataclasses.replace(plain, surface=_matt(item.surface))
        objects.append(plain)
        if (paint := _paint(item)) is not None:
            objects.append(paint)
    return dataclasses.replace(straight, objects=objects)


def shows_paint(scene: Scene) -> bool:
    """True if its surfaces show more than straight rays do without them."""
    return any((item.medium is None and item.surface is not None) or _paint(item) is not None for item in scene.shown)


def _matt(surface: Surface) -> Surface:
    return Surface(
        color=surface.color,
        color_texture=surface.color_texture,
        emissive=surface.emissive,
        emissive_texture=surface.emissive_texture,
        alpha_cutoff=surface.alpha_cutoff,
    )


def _paint(item: Object) -> Object | None:
    """Layer that covers as much of a body as does not let light in; None if all does."""
    surface = item.surface
    if item.medium is None or surface is None or item.covers:
        return None
    if surface.transmission == 1.0 and surface.transmission_texture is None:
        return None
    texture = surface.color_texture
    if surface.transmission_texture is not None:
        texture = _covering(texture, surface.transmission_texture, surface.transmission)
    opacity = 1.0 if surface.transmission_texture is not None else 1.0 - surface.transmission
    paint = Surface(color=surface.color, color_texture=texture, opacity=opacity)
    thin = THIN * float(np.linalg.norm(np.ptp(item.bounds, axis=0)))
    return Object(item.mesh, Medium(), transform=item.matrix, surface=paint, sheet_thickness=thin)


@lru_cache(maxsize=8)
def _covering(color: Texture | None, entering: Texture, transmission: float) -> Texture:
    """Texture of the color of paint, and as its opacity the share of light that does not enter."""
    pictures = [one for one in (color, entering) if one is not None]
    height, width = (min(max(one.pixels.shape[i] for one in pictures), MOST) for i in (0, 1))
    v, u = np.meshgrid(1.0 - (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    at = np.stack([u, v], axis=-1)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    if color is not None:
        pixels[..., :3] = color.sample(at)[..., :3]
    pixels[..., 3] = 1.0 - transmission * entering.sample(at)[..., 0]
    return Texture(np.clip(pixels, 0.0, 1.0), wrap=entering.wrap)


Size = tuple[int, int]

#: Height of the picture that is compared with the reference, in pixels.
MEASURED_HEIGHT = 90

#: The same where media scatter light of lamps, which the reference has to look for from every place: a pixel takes a
#: hundred times as long.
LIT_HEIGHT = 30

#: Largest number of triangles of a scene that is measured without being asked to: of 5 million, the reference takes 20
#: seconds and 2 GB.
MOST_TRIANGLES = 2_000_000

#: Shares of the viewport's size at which the split's reference is drawn, one after the other.
LEVELS = (8, 4, 2, 1)

#: Bodies with an interface are followed through refraction in the reference: 20 times the work for a pixel.
BENT_LEVELS = (16, 8)


@dataclass(frozen=True, eq=False)
class ThicknessStatistics:
    """Thickness of a model in its picture.

    Attributes
    ----------
    thickness : (n,) float64
        Of the covered, valid pixels, in metres.
    counts, edges : ndarray
        Their histogram.
    pixels, invalid : int
        Covered pixels, and those of all that cannot be trusted.
    """

    thickness: Array
    counts: Array
    edges: Array
    pixels: int
    invalid: int

    @classmethod
    def of(cls, thickness: Array, pixels: int, invalid: int) -> ThicknessStatistics:
        """Thickness statistics of a frame, with a histogram of 48 bins."""
        most = float(thickness.max(initial=0.0)) or 1.0
        counts, edges = np.histogram(thickness, bins=48, range=(0.0, most))
        return cls(thickness, counts / max(int(counts.max()), 1), edges, pixels, invalid)

    def average_hex(self, medium: Medium) -> str:
        """The model's average color before white light."""
        return to_hex(average_color(self.thickness, medium)) if self.thickness.size else "#ffffff"


@dataclass(frozen=True, eq=False)
class Compared:
    """Comparison of a small picture of the viewport with the truth.

    Attributes
    ----------
    errors : tuple of Errors
        Of thickness and transmittance; empty if there is nothing to compare.
    doubt : str
        Why they are empty.
    seen : ThicknessStatistics
    truth : (h, w, 3) uint8
        The reference as a picture, for a corner of the viewport, with the paint of its surfaces.
    """

    errors: tuple[Errors, ...]
    doubt: str
    seen: ThicknessStatistics
    truth: npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Measurement(Compared):
    """Comparison together with its scene and method."""

    scene: Scene
    method: Method | None


@dataclass(frozen=True, eq=False)
class ReferencePicture:
    """Reference of a whole picture, at a share of its size; of straight rays, or with refraction."""

    scene: Scene
    method: Method | None
    frame: Frame
    level: int
    straight: bool = False


@dataclass(frozen=True)
class Crossing:
    """Crossing of one ray in the float64 reference.

    Attributes
    ----------
    thickness : float
        Metres.
    layers : int
        Surfaces of bodies.
    optical_depth, transmittance : tuple of 3 floats
    valid : bool
    body : int, optional
        Number of the first object that is met.
    """

    thickness: float
    layers: int
    optical_depth: tuple[float, ...]
    transmittance: tuple[float, ...]
    valid: bool
    body: int | None


@lru_cache(maxsize=1)
def _renderer(written: float) -> Renderer:
    """Renderer of the worker process, for one version of the shaders."""
    return Renderer()


def measurable(scene: Scene) -> bool:
    """True if a scene is small enough to be measured without being asked to."""
    return sum(len(item.mesh.faces) for item in scene.objects) <= MOST_TRIANGLES


def measure(report: Report, scene: Scene, method: Method | None, size: Size) -> Compared:
    """Compare a small picture of the scene with the reference, as straight rays see both."""
    lit = bool(scene.lights) and any(item.medium is not None and item.medium.scatters for item in scene.objects)
    height = LIT_HEIGHT if lit else MEASURED_HEIGHT
    small = max(round(height * size[0] / size[1]), 1), height
    plain = straight(scene)
    report(None, "drawing")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # invalid pixels are counted, below
        frame = _renderer(newest_shader()).render(plain, small, method)
    report(None, "float64 reference")
    truth = _reference(plain, small, method)
    errors: tuple[Errors, ...] = ()
    doubt = ""
    try:
        errors = (compare(frame, truth, "thickness"), compare(frame, truth, "transmittance"))
    except InputError as error:
        doubt = str(error)
    covered = int(np.count_nonzero(frame.coverage))
    try:
        samples = thickness_samples(frame)
    except InputError:
        samples = np.zeros(0)
    seen = ThicknessStatistics.of(samples, covered, int(np.count_nonzero(~frame.valid)))
    shown = _reference(with_paint(plain, scene), small, method) if shows_paint(scene) else truth
    return Compared(errors, doubt, seen, shown.to_srgb8())


def straight(scene: Scene) -> Scene:
    """Scene without the optical effects of interfaces, so that every method and the reference see the same rays.

    The ground of a stage is left out, too: it ends no ray that it does not shadow, and shadows take the reference long.
    """
    return dataclasses.replace(scene, objects=[_index_matched(item) for item in scene.shown], environment_shadows=0)


def _index_matched(item: Object) -> Object:
    if item.medium is None:
        return item if item.surface is None else dataclasses.replace(item, surface=None)
    if not item.has_interface:
        return item
    medium = dataclasses.replace(item.medium, ior=1.0)
    return dataclasses.replace(item, medium=medium, surface=_holes(item))


def _holes(item: Object) -> Surface | None:
    """Surface that has the holes of a thin sheet, and changes no light beside them."""
    surface = item.surface
    if not item.has_holes or surface is None or surface.color_texture is None or item.mesh.colors is not None:
        return None
    return Surface(color_texture=_only_alpha(surface.color_texture), alpha_cutoff=surface.alpha_cutoff)


@lru_cache(maxsize=8)
def _only_alpha(texture: Texture) -> Texture:
    pixels = np.ones((*texture.pixels.shape[:2], 4), dtype=np.float32)
    if texture.pixels.shape[2] == 4:
        pixels[..., 3] = texture.pixels[..., 3]
    return dataclasses.replace(texture, pixels=pixels)


def _reference(scene: Scene, size: Size, method: Method | None = None) -> Frame:
    """Reference of a scene, which follows rays through interfaces; straight on where sheets have holes."""
    from translucent import reference  # late: a window opens without it

    holes = any(item.has_holes for item in scene.objects)
    return reference.render(scene, size, method, refraction=False if holes else None)


def truth_plan(scene: Scene, levels: tuple[int, ...] | None = None) -> tuple[Scene, tuple[int, ...]]:
    """Plan of the reference of a whole picture: its scene, and the shares of its size at which it is drawn, coarse
    first.

    With `levels` given it is that of straight rays, for differences of thickness.
    """
    bent = any(item.has_interface for item in scene.objects) and levels is None
    textured = any(
        item.mesh.colors is not None or (item.surface is not None and any(item.surface.textures))
        for item in scene.objects
    )
    if not bent or textured:
        return straight(scene), levels or LEVELS
    return scene, BENT_LEVELS


def truth_frame(report: Report, scene: Scene, method: Method | None, size: Size) -> Frame:
    """Render the reference of a picture."""
    return _reference(scene, size, method)


def crossing(report: Report, scene: Scene, size: Size, pixel: Size) -> Crossing:
    """Trace the ray through a pixel's center in the reference."""
    from translucent.reference.hits import camera_hits

    camera = pixel_camera(scene.camera, size, pixel)
    one = dataclasses.replace(straight(scene), camera=camera)
    frame = _reference(one, (1, 1))
    layers, nearest, body = 0, math.inf, None
    for i, item in enumerate(scene.objects):
        hits = camera_hits(item.mesh, item.matrix, camera, (1, 1))
        layers += len(hits.distance) if item.medium is not None else 0
        if len(hits.distance) and hits.distance[0] < nearest:
            nearest, body = float(hits.distance[0]), i
    return Crossing(
        float(frame.thickness[0, 0]),
        layers,
        tuple(frame.optical_depth[0, 0].tolist()),
        tuple(frame.transmittance[0, 0].tolist()),
        bool(frame.valid[0, 0]),
        body,
    )


def first_object(scene: Scene, size: Size, pixel: Size) -> int | None:
    """Number of the first object on the ray through a pixel's center; None if there is none."""
    from translucent.reference.hits import camera_hits

    camera = pixel_camera(scene.camera, size, pixel)
    nearest, found = math.inf, None
    for i, item in enumerate(scene.objects):
        hits = camera_hits(item.mesh, item.matrix, camera, (1, 1))
        if len(hits.distance) and hits.distance[0] < nearest:
            nearest, found = float(hits.distance[0]), i
    return found


def pixel_camera(camera: Camera, size: Size, pixel: Size) -> Camera:
    """Camera with one pixel, whose ray is that of a pixel of another camera."""
    half_width, half_height = camera.half_extent(size)
    x = ((pixel[0] + 0.5) / size[0] * 2 - 1) * half_width
    y = (1 - (pixel[1] + 0.5) / size[1] * 2) * half_height
    across = x * camera.right + y * camera.up
    if camera.fov_y is None:
        eye = camera.eye + across
        return Camera.orthographic(eye, eye + camera.forward, camera.up, height=2 * half_height / size[1])
    fov = 2.0 * math.degrees(math.atan(half_height / size[1]))
    return Camera.look_at(camera.eye, camera.eye + camera.forward + across, camera.up, fov_y=fov)
