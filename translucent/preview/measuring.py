"""Comparison with the float64 reference: errors of a small picture, whole pictures, and single rays."""

from __future__ import annotations

import dataclasses
import math
import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError, TranslucentWarning
from translucent.frames.appearance import thickness_samples
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, compare
from translucent.media.medium import Medium
from translucent.planning.methods import Method
from translucent.preview.worker import report, worker_renderer
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

Size = tuple[int, int]

#: Height of the picture that is compared with the reference, in pixels.
MEASURED_HEIGHT = 90

#: The same where media scatter the light of point lights, which the reference has to look for from every place: a pixel
#: takes a hundred times as long.
LIT_HEIGHT = 30

#: Largest number of triangles of a scene that is measured though nobody requests it: of 5 million, the reference takes
#: 20 seconds and 2 GB.
MOST_TRIANGLES = 2_000_000

#: Divisors of the viewport's size at which the split's reference is drawn, one after the other.
LEVELS = (8, 4, 2, 1)

#: The same where the reference follows rays through refracting interfaces: 20 times the work for a pixel.
BENT_LEVELS = (16, 8)

#: Thickness of the sheet that shows a diffuse base, in diagonals of its object.
THIN = 1e-6

#: Largest side of a texture of a diffuse base in pixels: a small picture shows no more.
MOST = 512


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
    def of(cls, frame: Frame) -> ThicknessStatistics:
        """Thickness statistics of a frame, with a histogram of 48 bins."""
        try:
            thickness = thickness_samples(frame)
        except InputError:
            thickness = np.zeros(0)
        most = float(thickness.max(initial=0.0)) or 1.0
        counts, edges = np.histogram(thickness, bins=48, range=(0.0, most))
        pixels, invalid = int(np.count_nonzero(frame.coverage)), int(np.count_nonzero(~frame.valid))
        return cls(thickness, counts / max(int(counts.max()), 1), edges, pixels, invalid)


@dataclass(frozen=True, eq=False)
class Measurement:
    """Comparison of a small picture of the viewport with the reference.

    Attributes
    ----------
    errors : tuple of Errors
        Of thickness and transmittance; empty if there is nothing to compare.
    doubt : str
        The reason for that.
    seen : ThicknessStatistics
    truth : (h, w, 3) uint8
        The reference as a picture, for a corner of the viewport, with the diffuse base of its surfaces.
    scene : Scene, optional
        The scene on show, once it is known here.
    """

    errors: tuple[Errors, ...]
    doubt: str
    seen: ThicknessStatistics
    truth: npt.NDArray[np.uint8]
    scene: Scene | None = None

    def scaled(self, factor: float) -> Measurement:
        """Measurement scaled with the model, to be measured again."""
        seen = dataclasses.replace(self.seen, thickness=factor * self.seen.thickness, edges=factor * self.seen.edges)
        return Measurement((), "the size has changed, so the picture is measured again", seen, self.truth)


@dataclass(frozen=True, eq=False)
class ReferencePicture:
    """Reference of a whole picture, its size divided by `level`; of straight rays, or with refraction."""

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
        In metres.
    layers : int
        Number of surfaces of bodies.
    body : int, optional
        Number of the first object that is hit.
    """

    thickness: float
    layers: int
    body: int | None


def measurable(scene: Scene) -> bool:
    """True if a scene is small enough to be measured automatically."""
    return sum(len(item.mesh.faces) for item in scene.objects) <= MOST_TRIANGLES


def measure(scene: Scene, method: Method | None, size: Size) -> Measurement:
    """Compare a small picture of the scene with the reference, both of straight rays."""
    lit = bool(scene.lights) and any(item.medium is not None and item.medium.scatters for item in scene.objects)
    height = LIT_HEIGHT if lit else MEASURED_HEIGHT
    small = max(round(height * size[0] / size[1]), 1), height
    plain = straight(scene)
    report(None, "drawing")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # invalid pixels are counted, below
        frame = worker_renderer().render(plain, small, method)
    report(None, "float64 reference")
    truth = reference_frame(plain, method, small)
    errors, doubt = tuple[Errors, ...](), ""
    try:
        errors = compare(frame, truth, "thickness"), compare(frame, truth, "transmittance")
    except InputError as error:
        doubt = str(error)
    colored = with_diffuse_base(plain, scene)
    inset = truth if colored is plain else reference_frame(colored, method, small)
    return Measurement(errors, doubt, ThicknessStatistics.of(frame), inset.to_srgb8())


def reference_frame(scene: Scene, method: Method | None, size: Size) -> Frame:
    """Reference of a scene, which follows rays through interfaces; straight on where sheets have holes."""
    from translucent import reference  # late: a window opens without it

    holes = any(item.has_holes for item in scene.objects)
    return reference.render(scene, size, method, refraction=False if holes else None)


def reference_plan(scene: Scene, levels: tuple[int, ...] | None = None) -> tuple[Scene, tuple[int, ...]]:
    """Scene of a whole reference picture, and the divisors of its size at which it is drawn, coarse first.

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


def crossing(scene: Scene, size: Size, pixel: Size) -> Crossing:
    """Trace the ray through a pixel's center in the reference."""
    camera = pixel_camera(scene.camera, size, pixel)
    frame = reference_frame(dataclasses.replace(straight(scene), camera=camera), None, (1, 1))
    hits = _hits(scene, camera)
    layers = sum(len(found) for item, found in zip(scene.objects, hits, strict=True) if item.medium is not None)
    return Crossing(float(frame.thickness[0, 0]), layers, _first(hits))


def first_object(scene: Scene, size: Size, pixel: Size) -> int | None:
    """Number of the first object on the ray through a pixel's center; None if there is none."""
    return _first(_hits(scene, pixel_camera(scene.camera, size, pixel)))


def _hits(scene: Scene, camera: Camera) -> list[Array]:
    """Distances at which the ray of a camera with one pixel hits each object, in order."""
    from translucent.reference.hits import camera_hits  # late: a window opens without it

    return [camera_hits(item.mesh, item.matrix, camera, (1, 1)).distance for item in scene.objects]


def _first(hits: list[Array]) -> int | None:
    found = [(float(distances[0]), i) for i, distances in enumerate(hits) if len(distances)]
    return min(found)[1] if found else None


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
    surface, holes = item.surface, None
    if item.has_holes and surface is not None and surface.color_texture is not None and item.mesh.colors is None:
        holes = Surface(color_texture=_only_alpha(surface.color_texture), alpha_cutoff=surface.alpha_cutoff)
    return dataclasses.replace(item, medium=dataclasses.replace(item.medium, ior=1.0), surface=holes)


@lru_cache(maxsize=8)
def _only_alpha(texture: Texture) -> Texture:
    pixels = np.ones((*texture.pixels.shape[:2], 4), dtype=np.float32)
    if texture.pixels.shape[2] == 4:
        pixels[..., 3] = texture.pixels[..., 3]
    return dataclasses.replace(texture, pixels=pixels)


def with_diffuse_base(straight: Scene, scene: Scene) -> Scene:
    """Scene of straight rays with the colors of opaque objects, and sheets that show the diffuse base of bodies.

    Parameters
    ----------
    straight : Scene
        Without the optical effects of interfaces; the result where there are no such colors.
    scene : Scene
        The same with them. Its objects are shown as they are, in their order.
    """
    objects: list[Object] = []
    for plain, item in zip(straight.objects, scene.shown, strict=True):
        surface = item.surface
        if item.medium is None and surface is not None:
            names = "color", "color_texture", "emissive", "emissive_texture", "alpha_cutoff"
            colors = Surface(**{name: getattr(surface, name) for name in names})
            objects.append(dataclasses.replace(plain, surface=colors))
        else:
            objects.append(plain)
        objects += _diffuse_sheet(item)
    if list(map(id, objects)) == list(map(id, straight.objects)):
        return straight
    return dataclasses.replace(straight, objects=objects)


def _diffuse_sheet(item: Object) -> list[Object]:
    """Sheet that covers a body with its diffuse base; none if all light enters."""
    surface = item.surface
    if item.medium is None or surface is None or item.covers:
        return []
    opacity, texture = 1.0 - surface.transmission, surface.color_texture
    if surface.transmission_texture is not None:
        opacity, texture = 1.0, _covering(texture, surface.transmission_texture, surface.transmission)
    elif opacity == 0.0:
        return []
    thin = THIN * float(np.linalg.norm(np.ptp(item.bounds, axis=0)))
    base = Surface(color=surface.color, color_texture=texture, opacity=opacity)
    return [Object(item.mesh, Medium(), transform=item.matrix, surface=base, sheet_thickness=thin)]


@lru_cache(maxsize=8)
def _covering(color: Texture | None, entering: Texture, transmission: float) -> Texture:
    """Texture of the color of a diffuse base, and as its opacity the fraction of light that does not enter."""
    pictures = [one for one in (color, entering) if one is not None]
    height, width = (min(max(one.pixels.shape[i] for one in pictures), MOST) for i in (0, 1))
    v, u = np.meshgrid(1.0 - (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    at = np.stack([u, v], axis=-1)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    if color is not None:
        pixels[..., :3] = color.sample(at)[..., :3]
    pixels[..., 3] = 1.0 - transmission * entering.sample(at)[..., 0]
    return Texture(np.clip(pixels, 0.0, 1.0), wrap=entering.wrap)
