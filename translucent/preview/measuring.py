"""What the background finds out: errors against the reference, histograms, what is on one ray."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent import reference
from translucent.appearance import thickness_samples
from translucent.camera import Camera
from translucent.errors import InputError, TranslucentWarning
from translucent.frame import Frame
from translucent.gpu.passes.variants import PostponedError
from translucent.metrics import Errors, compare
from translucent.preview.compiling import Compiler
from translucent.preview.numbers import Seen
from translucent.preview.tasks import Task
from translucent.reference.hits import camera_hits
from translucent.renderer import Renderer
from translucent.scene import Object, Scene
from translucent.thickness import Method

Size = tuple[int, int]

#: Height of the picture that is compared with the reference, in pixels.
MEASURED_HEIGHT = 90

#: Shares of the viewport's size at which the split's reference is drawn, one after the other.
LEVELS = (8, 4, 2, 1)

#: Bodies with a border are followed through refraction in the reference: 20 times the work for a pixel.
BENT_LEVELS = (16, 8)


@dataclass(frozen=True, eq=False)
class Measured:
    """A small picture of what the viewport shows, beside the truth.

    Attributes
    ----------
    scene : Scene
        What was measured.
    method : Method, optional
    errors : tuple of Errors
        Of thickness and transmittance; empty if there is nothing to compare.
    doubt : str
        Why they are empty.
    seen : Seen
    truth : (h, w, 3) uint8
        The reference as a picture, for a corner of the viewport.
    """

    scene: Scene
    method: Method | None
    errors: tuple[Errors, ...]
    doubt: str
    seen: Seen
    truth: npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Truth:
    """The reference of a whole picture, at a share of its size."""

    scene: Scene
    method: Method | None
    frame: Frame
    level: int


@dataclass(frozen=True)
class Crossing:
    """What the float64 reference finds on one ray.

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


class Measuring:
    """A renderer that belongs to the thread of a lane.

    Parameters
    ----------
    compiler : Compiler
        Compiles what frames need: done in this thread, it would stop the window.
    """

    def __init__(self, compiler: Compiler) -> None:
        self._compiler = compiler
        self._renderer: Renderer | None = None
        self._written = 0.0

    def render(self, scene: Scene, size: Size, method: Method | None) -> Frame:
        """A frame; the renderer is made when first needed, in the thread that needs it."""
        if self._written != self._compiler.written:
            self.close()  # it has compiled other shaders
        if self._renderer is None:
            self._renderer, self._written = Renderer(), self._compiler.written
            self._renderer.gpu.context.gl.extra = self._compiler.ledger
        while True:
            try:
                return self._renderer.render(scene, size, method)
            except PostponedError as missing:
                self._compiler.compile(scene, [self._renderer.plan(scene, method)], missing.program)

    def close(self) -> None:
        """Free it, in its thread."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def measure(measuring: Measuring, task: Task, scene: Scene, method: Method | None, size: Size) -> Measured:
    """Compare a small picture of the scene with the reference, as straight rays see both."""
    height = MEASURED_HEIGHT
    small = max(round(height * size[0] / size[1]), 1), height
    plain = straight(scene)
    task.report(None, "drawing")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # invalid pixels are counted, below
        frame = measuring.render(plain, small, method)
    task.report(None, "float64 reference")
    truth = reference.render(plain, small, method)
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
    seen = Seen.of(samples, covered, int(np.count_nonzero(~frame.valid)))
    return Measured(scene, method, errors, doubt, seen, truth.to_srgb8())


def straight(scene: Scene) -> Scene:
    """The scene without what borders do to light, so that every method and the reference see the same rays."""
    return dataclasses.replace(scene, objects=[_index_matched(item) for item in scene.objects])


def _index_matched(item: Object) -> Object:
    if item.medium is None:
        return item if item.surface is None else dataclasses.replace(item, surface=None)
    if not item.has_interface:
        return item
    medium = dataclasses.replace(item.medium, ior=1.0)
    return dataclasses.replace(item, medium=medium, surface=None)


def truth_levels(
    task: Task,
    scene: Scene,
    method: Method | None,
    size: Size,
    deliver: Callable[[Truth], None],
    levels: tuple[int, ...] | None = None,
) -> None:
    """The reference of the whole picture, coarse first; each level goes to `deliver`.

    With `levels` given it is that of straight rays, for differences of thickness.
    """
    bent = any(item.has_interface for item in scene.objects) and levels is None
    seen = scene
    if not bent or any(item.surface is not None and any(item.surface.textures) for item in scene.objects):
        seen, bent = straight(scene), False
    levels = levels or (BENT_LEVELS if bent else LEVELS)
    for number, level in enumerate(levels):
        task.report(number / len(levels), f"at 1/{level}")
        small = max(size[0] // level, 1), max(size[1] // level, 1)
        deliver(Truth(scene, method, reference.render(seen, small, method), level))


def crossing(scene: Scene, size: Size, pixel: Size) -> Crossing:
    """What the reference finds on the ray through a pixel's center."""
    camera = pixel_camera(scene.camera, size, pixel)
    one = dataclasses.replace(straight(scene), camera=camera)
    frame = reference.render(one, (1, 1))
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


def pixel_camera(camera: Camera, size: Size, pixel: Size) -> Camera:
    """A camera with one pixel, whose ray is that of a pixel of another camera."""
    half_width, half_height = camera.half_extent(size)
    x = ((pixel[0] + 0.5) / size[0] * 2 - 1) * half_width
    y = (1 - (pixel[1] + 0.5) / size[1] * 2) * half_height
    across = x * camera.right + y * camera.up
    if camera.fov_y is None:
        eye = camera.eye + across
        return Camera.orthographic(eye, eye + camera.forward, camera.up, height=2 * half_height / size[1])
    fov = 2.0 * math.degrees(math.atan(half_height / size[1]))
    return Camera.look_at(camera.eye, camera.eye + camera.forward + across, camera.up, fov_y=fov)
