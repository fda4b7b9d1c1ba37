"""Placement of objects in a frame, in float64: positions, covered pixels, and weights of their faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.gpu.constants import CONSTANTS
from translucent.planning.bodies import open_around_eye
from translucent.planning.methods import Method
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

#: Distance to a surface, as a fraction of the diagonal, within which the eye is on it; all nearer ahead is clipped.
NEAR_SURFACE = 1e-6


@dataclass(frozen=True)
class AxialRange:
    """Nearest and farthest distance along the camera's forward axis, in metres from the eye."""

    near: float
    far: float

    @classmethod
    def of(cls, objects: Sequence[Object], camera: Camera) -> AxialRange:
        """Range of the scene ahead of the eye, or of an orthographic picture."""
        return cls.of_boxes(np.array([item.bounds for item in objects]), camera)

    @classmethod
    def of_boxes(cls, boxes: Array, camera: Camera) -> AxialRange:
        """Extents in the picture of boxes with these bounds (n, 2, 3)."""
        depths = _corners(boxes - camera.eye) @ camera.forward
        near = max(float(depths.min()), 0.0)
        # A flat scene has one depth; any length will do.
        return cls(near, near + (max(float(depths.max()), 0.0) - near or float(np.abs(depths).max()) or 1.0))

    @property
    def length(self) -> float:
        """Length in metres, above 0."""
        return self.far - self.near


@dataclass(frozen=True, eq=False)
class PlacedScene:
    """Scene placed before its camera; arrays have a row for each of its objects.

    Attributes
    ----------
    scene : Scene
    matrices : (objects, 4, 4) float64
        From the object to the world.
    anchors : (objects, 3) float64
        World-space vector from the eye to the center of the mesh.
    open_from : (objects,) float64
        Metres ahead of the eye, along the camera's axis, from which on the surface of a body may be open.
    cut : (objects,) bool
        The eye, or an orthographic image plane, is within the object's bounds: distances count from there.
    expected_counts : (objects, 2) float64
        Least and greatest signed count that a ray may have: exits minus entries ahead of its origin. It is the winding
        number of the body at the origin.
    media : AxialRange
        Of all its media.
    opaque : AxialRange, optional
        Of what is opaque, if anything is.
    """

    scene: Scene
    matrices: Array
    anchors: Array
    open_from: Array
    cut: Mask
    expected_counts: Array
    media: AxialRange
    opaque: AxialRange | None

    @classmethod
    def of(cls, scene: Scene) -> PlacedScene:
        """Place the objects of a scene before its camera."""
        camera, objects = scene.camera, scene.objects
        matrices = np.array([item.transform for item in objects])
        centers = np.array([item.mesh.center for item in objects])
        anchors = (matrices[:, :3, :3] @ centers[..., None])[..., 0] + (matrices[:, :3, 3] - camera.eye)
        cut = _cut(scene.boxes - camera.eye, camera)
        expected = np.zeros((len(objects), 2))
        for i in np.flatnonzero(cut & scene.filled).tolist():
            expected[i] = _expected_count(objects[i], camera)
        open_from = np.array([item.open_from(camera) if item.medium is not None else np.inf for item in objects])
        opaque = AxialRange.of_boxes(scene.boxes[~scene.filled], camera) if scene.opaque else None
        media = AxialRange.of_boxes(scene.boxes[scene.filled], camera)
        return cls(scene, matrices, anchors, open_from, cut, expected, media, opaque)

    @property
    def on_surface(self) -> Mask:
        """(objects,): whether the eye is on the surface of each object: some rays begin inside, and others outside."""
        return np.asarray(self.expected_counts[:, 0] != self.expected_counts[:, 1])

    @property
    def starts_inside(self) -> bool:
        """True if rays may start inside a body."""
        return bool((self.expected_counts[:, 1] > 0).any())

    def camera_from_offset(self, camera: Camera) -> Array:
        """(objects, 3, 4): from offsets to metres right of, above and ahead of the eye."""
        rows = np.stack([camera.right, camera.up, camera.forward])
        return np.concatenate([rows @ self.matrices[:, :3, :3], rows @ self.anchors[..., None]], axis=2)


@dataclass(frozen=True)
class SampleView:
    """Camera with the sample points of a picture.

    Attributes
    ----------
    camera : Camera
    size : (int, int)
        Width and height in pixels.
    shift : (float, float)
        Of the sample points from the pixel centers, right and down, in pixels.
    depth_range : (float, float), optional
        Write depth between these metres; else all depths are alike, so that nothing is clipped but what is behind.
    corner : (int, int)
        Left and bottom of the picture in its target, in pixels.
    """

    camera: Camera
    size: tuple[int, int]
    shift: tuple[float, float] = (0.0, 0.0)
    depth_range: tuple[float, float] | None = None
    corner: tuple[int, int] = (0, 0)


def depth_range(boxes: Array, camera: Camera, diagonal: float) -> tuple[float, float]:
    """Nearest and farthest distance along the view axis that a depth buffer must hold, in metres, for these bounds."""
    depths = _corners(boxes - camera.eye) @ camera.forward
    near, far = float(depths.min()), float(depths.max())
    margin = 1e-3 * diagonal
    if camera.fov_y is None:
        return near - margin, far + margin
    return max(near - margin, 1e-4 * diagonal), max(far + margin, diagonal)


def _corners(boxes: Array) -> Array:
    """(n, 8, 3): the corners of boxes (n, 2, 3)."""
    choice = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)])
    return np.asarray(boxes[:, choice, np.arange(3)])


def _cut(boxes: Array, camera: Camera) -> Mask:
    """(n,): whether rays start within these bounds (n, 2, 3), which count from the eye."""
    low, high = boxes[:, 0], boxes[:, 1]
    if camera.fov_y is None:
        # The corner of the bounds that is farthest behind decides.
        forward = camera.forward
        return np.asarray(np.where(forward > 0, low, high) @ forward < 0)
    margin = NEAR_SURFACE * np.linalg.norm(high - low, axis=1)[:, None]
    return np.asarray((low <= margin).all(axis=1) & (high >= -margin).all(axis=1))


def _expected_count(body: Object, camera: Camera) -> tuple[float, float]:
    """Valid signed counts of a body whose bounds contain the eye or part of the image plane."""
    if body.sheet_thickness is not None or camera.fov_y is None:
        # An orthographic ray is a whole line: it leaves a body as often as it enters, some of it behind the picture.
        return 0.0, 0.0
    number = round(body.winding_number(camera.eye), 6)
    local = np.linalg.solve(body.matrix[:3, :3], camera.eye - body.matrix[:3, 3])
    if body.mesh.diagnosis.solid and body.mesh.is_near(local, NEAR_SURFACE * body.mesh.diagonal):
        # On the surface, and where float32 cannot decide, a ray may start on either side of it.
        return max(float(np.ceil(number)) - 1.0, 0.0), float(np.floor(number)) + 1.0
    return float(round(number)), float(round(number))


#: Rounding of float32 that vertices may suffer, as a fraction of their distance from the eye, with room to spare.
_ROUNDING = 1e-5

#: Pixels around the bounds: the rasterizer snaps vertices to a grid finer than that.
_MARGIN = 1.0


@dataclass(frozen=True)
class Part:
    """Rectangle of pixels, counted right and up from the bottom left corner as OpenGL counts them."""

    left: int
    bottom: int
    right: int
    top: int

    def __bool__(self) -> bool:
        """True if it has any pixels."""
        return self.right > self.left and self.top > self.bottom

    @property
    def scissor(self) -> tuple[int, int, int, int]:
        """Left, bottom, width and height."""
        return self.left, self.bottom, self.right - self.left, self.top - self.bottom

    def flipped(self, height: int) -> Part:
        """This rectangle with its rows counted from the top of a picture of this height."""
        return Part(self.left, height - self.top, self.right, height - self.bottom)

    def wider(self, pixels: int, size: tuple[int, int]) -> Part:
        """This rectangle with so many pixels more on each side, within a picture of a size."""
        left, bottom = max(self.left - pixels, 0), max(self.bottom - pixels, 0)
        return Part(left, bottom, min(self.right + pixels, size[0]), min(self.top + pixels, size[1]))

    def rows(self, first: int, last: int) -> Part:
        """The part of its rows from `first` on that are before `last`."""
        return Part(self.left, max(self.bottom, first), self.right, min(self.top, last))

    def rest(self, size: tuple[int, int]) -> tuple[Part, ...]:
        """Parts that together are all other pixels of a picture, each once."""
        width, height = size
        if not self:
            return (Part(0, 0, width, height),)
        parts = (
            Part(0, 0, width, self.bottom),
            Part(0, self.bottom, self.left, self.top),
            Part(self.right, self.bottom, width, self.top),
            Part(0, self.top, width, height),
        )
        return tuple(part for part in parts if part)


def extents(boxes: Array, radii: Array, camera: Camera, size: tuple[int, int]) -> Array:
    """(n, 4): left, bottom, right and top edge of what objects may cover, in pixels, at most 2 pixels off the picture;
    right of left nowhere for objects out of view.

    An object lies within its bounds (n, 2, 3) and within a ball of radius (n,) around their center. They enclose the
    images of all faces, since they come from the corners of bounds, and from the ball. Bounds that reach behind the
    eye, and may yet be in view, give all of the picture.
    """
    count = len(boxes)
    bounds = boxes - camera.eye
    choice = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)])
    corners = bounds[:, choice, np.arange(3)]
    frame = np.stack([camera.right, camera.up, camera.forward])
    in_view = np.einsum("ncj,ij->nci", corners, frame)
    slack = _ROUNDING * np.abs(corners).max(axis=(1, 2))[:, None]
    half = np.array(camera.half_extent(size))
    across, ahead = in_view[..., :2], in_view[..., 2]
    flat = camera.fov_y is None
    # Sample points are shifted by less than a pixel: what is four beyond the edge is out of view for all of them.
    wide = half * (1.0 + 8.0 / np.array(size))
    center = np.array(camera.center(size))
    spread = np.ones_like(ahead)[..., None] if flat else np.maximum(ahead + slack, 0.0)[..., None]
    most, least = (center * half + wide) * spread, (center * half - wide) * spread
    beyond = (across - slack[..., None] > most).all(axis=1) | (across + slack[..., None] < least).all(axis=1)
    hidden = beyond.any(axis=1)
    if not flat:  # an orthographic ray is a whole line, whose faces count behind the picture, too
        hidden |= (ahead < -slack).all(axis=1)
    near = np.ones_like(ahead) if flat else ahead - slack
    whole = (near <= 0.0).any(axis=1)
    near = np.where(whole[:, None], 1.0, near)[..., None]
    far = np.ones_like(near) if flat else (np.abs(ahead) + slack)[..., None]
    # An edge is farthest out at the near end of the slack where it is on that side, and at the far end elsewhere.
    low, high = across - slack[..., None], across + slack[..., None]
    low, high = np.where(low < 0.0, low / near, low / far), np.where(high > 0.0, high / near, high / far)
    least_of_ball, most_of_ball = _sides_of_balls(in_view.mean(axis=1), radii + slack[:, 0], flat=flat)
    low, high = np.maximum(low.min(axis=1), least_of_ball), np.minimum(high.max(axis=1), most_of_ball)
    limits = np.stack([low, high], axis=1) / half
    pixels = np.clip((limits - center + 1.0) * 0.5 * size, -2.0, np.array(size) + 2.0)
    pixels[whole] = [[-2.0, -2.0], [size[0] + 2.0, size[1] + 2.0]]
    pixels[hidden] = 0.0
    return np.asarray(pixels.reshape(count, 4))


def _sides_of_balls(centers: Array, radii: Array, *, flat: bool) -> tuple[Array, Array]:
    """(n, 2) each: least and most that balls reach to the right and up at distance 1, or in metres where rays are
    parallel; infinite for a ball that is not all ahead of the eye. Centers (n, 3): right, up and ahead of the eye.
    """
    across, ahead = centers[:, :2], centers[:, 2:]
    reach = radii[:, None]
    if flat:
        return across - reach, across + reach
    # Seen along an axis of the picture, a ball is a disc between two tangents through the eye.
    distance = np.hypot(across, ahead)
    front = ahead > reach
    angle, aside = np.arctan2(across, ahead), np.arcsin(np.where(front, reach / np.where(front, distance, 1.0), 0.0))
    return np.where(front, np.tan(angle - aside), -np.inf), np.where(front, np.tan(angle + aside), np.inf)


def part_of(edges: Array, shift: tuple[float, float], size: tuple[int, int]) -> Part:
    """Smallest part that holds all of these extents at sample points `shift` (right, down) pixels off the centers."""
    if not len(edges := edges[edges[:, 2] > edges[:, 0]]):
        return Part(0, 0, 0, 0)
    low, high = edges[:, :2].min(axis=0), edges[:, 2:].max(axis=0)
    moved = np.array([-shift[0], shift[1]])
    first = np.clip(np.floor(low + moved - _MARGIN), 0, size).astype(int).tolist()
    last = np.clip(np.ceil(high + moved + _MARGIN), 0, size).astype(int).tolist()
    return Part(first[0], first[1], last[0], last[1])


#: Pixels by which samples may be farther off the center of theirs than its sides, and rasterizers round.
_BEYOND = 0.5


@dataclass(frozen=True, eq=False)
class FaceExtents:
    """Pixels that each of the faces of an object may cover in samples of a picture, whose top left pixel is 0, 0.

    Attributes
    ----------
    low, high : (2, n) int32
        First column and row, and those after the last.
    """

    low: npt.NDArray[np.int32]
    high: npt.NDArray[np.int32]

    @classmethod
    def of(cls, body: Object, camera: Camera, size: tuple[int, int]) -> FaceExtents:
        """Extents before a camera; of faces that reach behind the eye all of the picture."""
        right, up, ahead = np.stack([camera.right, camera.up, camera.forward]) @ (body.world_vertices - camera.eye).T
        flat, faces, limits = camera.fov_y is None, body.mesh.faces.T, np.array(size)[:, None]
        behind = np.zeros(len(ahead), bool) if flat else ahead <= _ROUNDING * body.mesh.diagonal
        distance = 1.0 if flat else np.where(behind, 1.0, ahead)
        center, middle = camera.center(size)
        off = np.stack([right, -up]) / distance / np.array(camera.half_extent(size))[:, None]
        pixels = np.clip(0.5 * limits * (1.0 + off - [[center], [-middle]]), -1.0, limits + 1.0)
        low, high = (np.where(behind, edge, pixels) for edge in (0.0, limits))
        low = np.minimum.reduce([low[:, corner] for corner in faces])
        high = np.maximum.reduce([high[:, corner] for corner in faces])
        edges = np.floor(low - _BEYOND), np.floor(high + _BEYOND) + 1.0
        return cls(*(np.clip(edge, 0, limits).astype(np.int32) for edge in edges))

    def over(self, columns: npt.NDArray[np.integer], rows: npt.NDArray[np.integer]) -> Integers:
        """Faces (k,), in their order, that may cover any of the pixels in columns (n,) and rows (n,)."""
        if not len(columns):
            return np.zeros(0, np.int64)
        first, last = (np.array([end(columns), end(rows)], np.int64)[:, None] for end in (np.min, np.max))
        near = np.flatnonzero(((self.low <= last) & (self.high > first)).all(axis=0))
        if len(columns) == 1:
            return near
        (width,), (height,) = last - first + 1
        # Each entry has the number of pixels left of and above it.
        total = np.zeros((height + 1, width + 1), np.int64)
        places = (rows - first[1]) * width + (columns - first[0])
        total[1:, 1:] = np.bincount(places, minlength=width * height).reshape(height, width)
        total = total.cumsum(axis=0).cumsum(axis=1)
        ends = (edge[:, near] - first for edge in (self.low, self.high))
        (left, top), (right, bottom) = (np.clip(end, 0, [[width], [height]]) for end in ends)
        found = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]
        return np.asarray(near[found > 0])


#: Count that is invalid in every pixel.
UNEXPECTED = float(CONSTANTS["UNEXPECTED"])

#: Share of the diagonal below which a path is the rounding of a sum that should be 0.
COVERAGE_FLOOR = 2e-7

#: Counts of open bodies must not cancel: the first gets 16 times the weight of closed ones, the next 16 times that, and
#: so on, as far as float32 counts exactly. Beyond, all have the last weight.
OPEN_WEIGHTS = tuple(16.0**k for k in range(1, 6))

#: Share of the diagonal that a path may be below 0 by rounding; it then counts as 0. Steep faces have the largest
#: errors, of some 1e-5.
ROUNDING = 1e-5


@dataclass(frozen=True, eq=False)
class FaceCounts:
    """Contribution of one face of each object to the signed count of a pixel.

    Attributes
    ----------
    weights : (objects,) float64
        With the sign of its side.
    offsets : (objects,) float64
        Whatever its side: not 0 marks all pixels that the body covers.
    subpixel : float
        Step of the grid onto which the rasterizer moves vertices, in pixels; 0 where nothing is put down to it.
    snapping_share : float
        The same over the scene's diagonal, in the fraction of the count.
    """

    weights: Array
    offsets: Array
    subpixel: float
    snapping_share: float


@dataclass(frozen=True)
class Balance:
    """Bounds within which the sums of a pixel are valid.

    Attributes
    ----------
    expected_count : (float, float)
        Least and greatest sum of signed counts.
    rounding : float
        How far below 0 a path may be, in metres, by the rounding of float32 alone.
    coverage_floor : float
        Metres from which on a path is not the rounding of 0.
    """

    expected_count: tuple[float, float]
    rounding: float
    coverage_floor: float

    @classmethod
    def of(cls, placed: PlacedScene, method: Method, counts: FaceCounts) -> Balance:
        """Bounds for a frame of a scene that a method draws with these counts."""
        floor = COVERAGE_FLOOR * placed.scene.diagonal
        return cls(_bounds_of_count(placed, method, counts), _rounding(placed, method), floor)


def count_weights(scene: Scene) -> list[float]:
    """Weight of each object's faces in a pixel's signed count."""
    weights = []
    used = 0
    for body in scene.objects:
        is_open = body.medium is not None and body.sheet_thickness is None and not body.mesh.diagnosis.solid
        weights.append(OPEN_WEIGHTS[min(used, len(OPEN_WEIGHTS) - 1)] if is_open else 1.0)
        used += is_open
    return weights


def face_counts(scene: Scene, subpixel_bits: int) -> FaceCounts:
    """Contribution of each object's faces to a pixel's count, with a rasterizer of this precision."""
    # Where a body is broken, paths below 0 are more likely to be real than swapped at a silhouette; and the weights of
    # open bodies leave no room in the fraction of a count.
    sound = all(body.mesh.diagnosis.sound for body in scene.bodies if body.sheet_thickness is None)
    subpixel = 0.5**subpixel_bits if sound else 0.0
    around = open_around_eye(scene)
    offsets = np.array([UNEXPECTED if i in around else count_offset(body) for i, body in enumerate(scene.objects)])
    return FaceCounts(np.array(count_weights(scene)), offsets, subpixel, subpixel / scene.diagonal)


def count_offset(body: Object) -> float:
    """Count that each face adds whatever its side, which invalidates all pixels of a body that is inside out."""
    return UNEXPECTED if body.medium is not None and body.mesh.diagnosis.inside_out else 0.0


def _bounds_of_count(placed: PlacedScene, method: Method, counts: FaceCounts) -> tuple[float, float]:
    if method.makes_sheets:
        return 0.0, 0.0
    low, high = (counts.weights[:, None] * placed.expected_counts).sum(axis=0)
    return float(low), float(high)


def _rounding(placed: PlacedScene, method: Method) -> float:
    """Largest rounding error of a path in float32, in metres.

    Next to a silhouette a rasterizer may swap two faces, and a path is then below 0 by as much as it misplaces
    them; that differs from pixel to pixel, and goes along with what they hold (``thickness/snapping.glsl``).
    """
    reach = placed.scene.diagonal
    if method.counts_from_camera:
        # Distances from the camera cancel with an error that grows with them.
        reach += float(np.linalg.norm(placed.anchors, axis=1).max())
    return ROUNDING * reach
