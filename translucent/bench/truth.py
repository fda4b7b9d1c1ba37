"""Ground truth of a case, traced here or path traced beforehand, and errors of frames against it."""

from __future__ import annotations

import base64
import dataclasses
import io
import math
import time
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
import numpy.typing as npt
from PIL import Image

from translucent import reference
from translucent.arrays import Array, Mask
from translucent.bench.codec import Packed
from translucent.bench.drawing import Size
from translucent.bench.judgement import color_difference
from translucent.bench.record import ColorDifference, ErrorStatistics, LightErrors, Quantity, ReportPicture
from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.frames.metrics import compare, interior
from translucent.scene.lights import DirectionalLight, SpotLight
from translucent.scene.scene import Scene

#: Number of interfaces at which the reference follows rays. Light that goes around inside of a knot, reflected totally,
#: comes out after a hundred of them: with 48, its picture would be wrong by 6 %.
BOUNCES = 128

#: Number of rays through each pixel of each of two references before rough interfaces, whose spread is their noise.
PATHS = 128

#: Number of rays through each pixel of each of two references where the truth is a mean over pixels.
RAYS = 4

#: Width and height of the blocks over whose means errors are taken, too, in pixels.
BLOCK = 4

#: Errors that are 0 in pictures: half of the smallest that a heat map shows. Noise does not compress.
INVISIBLE = 5e-8

#: Radiance below which a picture is black, and relative errors are meaningless.
DARK = 1e-6

#: Relative and absolute difference of parameters up to which a scene is the one whose truth is stored: rounding.
SAME, SAME_ZERO = 1e-6, 1e-9


@dataclass(frozen=True)
class CaseTruth:
    """Ground truth of a case.

    Attributes
    ----------
    frame : Frame
        Of the reference.
    inside : (h, w) bool
        Pixels away from silhouettes, those of opaque objects included.
    layers : int
        The most surfaces on one ray.
    diagonal : float
        Of the bounds of all bodies, in metres.
    seconds : float
        Time of the frame.
    halves : two (h, w, 3) arrays, optional
        Radiances with independent noise, where interfaces are rough or radiance is a mean over pixels; the frame has
        the mean.
    noise : float, optional
        Of a stored truth: root mean square of its standard error, as a fraction of its mean.
    rays : int
        Through each pixel that is compared, spread over it, whose mean is its radiance; 1 along its center.
    """

    frame: Frame
    inside: Mask
    layers: int
    diagonal: float
    seconds: float
    halves: tuple[Array, Array] | None = None
    noise: float | None = None
    rays: int = 1

    @classmethod
    def over_pixels(cls, scene: Scene, size: Size, tolerance: float) -> CaseTruth:
        """Trace radiance averaged over each pixel (a box filter) where errors are taken, elsewhere along centers."""
        along = cls.of(scene, size, tolerance)
        begin = time.perf_counter()
        rays = PATHS if along.halves else RAYS
        halves = along.frame.radiance.copy(), along.frame.radiance.copy()
        valid = along.frame.valid.copy()
        used = along.compared
        for seed, half in enumerate(halves):
            half[used], sound = reference.light_over_pixels(scene, size, used, rays, tolerance, BOUNCES, seed)
            valid[used] &= sound
        frame = dataclasses.replace(along.frame, radiance=0.5 * (halves[0] + halves[1]), valid=valid)
        seconds = along.seconds + time.perf_counter() - begin
        return dataclasses.replace(along, frame=frame, seconds=seconds, halves=halves, rays=2 * rays)

    @classmethod
    def of(cls, scene: Scene, size: Size, tolerance: float) -> CaseTruth:
        """Trace the ground truth of a scene, along the centers of pixels."""
        begin = time.perf_counter()
        rough = any(body.surface is not None and body.surface.roughness > 0 for body in scene.bodies)
        frame, *others = (
            reference.render(scene, size, tolerance=tolerance, bounces=BOUNCES, paths=PATHS, seed=seed)
            for seed in range(1 + rough)
        )
        halves = None
        for other in others:
            halves = frame.radiance, other.radiance
            frame = dataclasses.replace(frame, radiance=0.5 * (halves[0] + halves[1]))
        return cls._of_frame(scene, frame, time.perf_counter() - begin, halves)

    @classmethod
    def of_paths(cls, scene: Scene, found: StoredTruth) -> CaseTruth:
        """Truth of a scene from its path traced radiance; raises `InputError` if that covers other pixels."""
        size = found.mask.shape[1], found.mask.shape[0]
        # All but the light that media scatter.
        frame, _ = reference.path_trace(scene, size, paths=2, max_events=0)
        if not np.array_equal(frame.coverage, found.mask):
            raise InputError("truth of a scene", "the stored truth has other pixels", "run tools/scattering_truth.py")
        halves = frame.radiance.copy(), frame.radiance.copy()
        for half, radiance in zip(halves, found.halves, strict=True):
            half[found.mask] = radiance
        frame = dataclasses.replace(frame, radiance=0.5 * (halves[0] + halves[1]))
        return dataclasses.replace(cls._of_frame(scene, frame, found.seconds, halves), noise=found.noise)

    @classmethod
    def _of_frame(cls, scene: Scene, frame: Frame, seconds: float, halves: tuple[Array, Array] | None) -> CaseTruth:
        counts = reference.hit_counts(scene, frame.size)
        inside = interior(counts)
        for found in reference.opaque_counts(scene, frame.size):
            inside &= interior(found)
        low, high = np.transpose([body.bounds for body in scene.bodies], (1, 0, 2))
        diagonal = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        return cls(frame, inside, int(counts.max()), diagonal, seconds, halves)

    @property
    def spread(self) -> float:
        """Standard error of the radiance of pixels, root mean square, as a fraction of the radiance's own."""
        if self.halves is None:
            return 0.0
        one, other = (half[self.compared] for half in self.halves)
        return float(np.sqrt(np.mean((one - other) ** 2))) / 2.0 / self.scale("radiance")

    @property
    def compared(self) -> Mask:
        """(h, w) pixels that errors are taken over, as far as a method calls them valid."""
        return self.inside & self.frame.coverage & self.frame.valid

    def scale(self, quantity: Quantity) -> float:
        """Normalisation of errors in a quantity."""
        if quantity == "radiance":
            with np.errstate(under="ignore"):
                rms = float(np.sqrt(np.mean(self.frame.radiance[self.compared] ** 2)))
            return rms if rms > DARK else 1.0
        return self.diagonal if quantity == "thickness" else 1.0

    def errors(self, frame: Frame, quantity: Quantity) -> tuple[ErrorStatistics, float, float] | None:
        """Errors of a frame, and fractions of invalid and of wrongly covered pixels; None without any to compare."""
        try:
            found = compare(frame, self.frame, quantity, mask=self.inside)
        except InputError:
            return None
        scale = self.scale(quantity)
        values = {name: float(getattr(found, name)) / scale for name in ErrorStatistics.__dataclass_fields__}
        if self.halves is not None and quantity == "radiance":
            values["rms"] = self._rms_without_noise(frame) / scale
        return ErrorStatistics(**values), found.invalid, found.coverage_mismatch

    def _rms_without_noise(self, frame: Frame) -> float:
        """Root mean square error in radiance, freed of the noise of the truth."""
        assert self.halves is not None
        used = self.compared & frame.coverage & frame.valid
        one, other = (half[used] for half in self.halves)
        square, uncertainty = noise_free_square(np.asarray(frame.radiance[used], np.float64), one, other)
        # Over pixels the error may be below the noise: then the standard error of its square is reported.
        return math.sqrt(max(square, uncertainty if self.rays > 1 else 0.0))

    def light_errors(self, frame: Frame, solve_seconds: float | None) -> LightErrors | None:
        """Errors of a frame as fractions of the mean of a path traced truth; None if there is no such truth."""
        used = self.compared & frame.coverage & frame.valid
        if self.halves is None or not used.any():
            return None
        rendered, halves = np.asarray(frame.radiance, np.float64), np.stack(self.halves)
        block = block_error(rendered, halves, used)
        nrmse = self._rms_without_noise(frame) / float(halves[:, used].mean())
        return LightErrors(nrmse, 0.0 if math.isnan(block) else block, bias(rendered, halves, used), solve_seconds)

    def color_difference(self, frame: Frame, quantity: Quantity) -> ColorDifference | None:
        """Visible color difference of a frame; None if there is no pixel to compare."""
        used = self.compared & frame.coverage & frame.valid
        if not used.any():
            return None
        rendered = "transmittance" if quantity == "thickness" else quantity
        return color_difference(getattr(frame, rendered)[used], getattr(self.frame, rendered)[used])

    def picture(self, method: str, frame: Frame, quantity: Quantity) -> ReportPicture:
        """Picture of a frame with its errors; the reference has none."""
        if frame is self.frame:
            return picture_of(method, frame.to_srgb8())
        result, right = (np.asarray(getattr(one, quantity), np.float64) for one in (frame, self.frame))
        covered = frame.coverage | self.frame.coverage
        error = (result - right) / self.scale(quantity)
        known = covered & frame.valid & self.frame.valid
        return picture_of(method, frame.to_srgb8(), error, known, covered & ~frame.valid)


def _blocks(picture: Array) -> Array:
    """Means over blocks of 4 x 4 pixels, without the rest at the right and below."""
    h, w = (side // BLOCK for side in picture.shape[:2])
    cut = picture[: h * BLOCK, : w * BLOCK]
    return np.asarray(cut.reshape(h, BLOCK, w, BLOCK, -1).mean(axis=(1, 3)))


def block_error(rendered: Array, halves: Array, used: Mask) -> float:
    """Root mean square error of means over blocks, freed of the truth's noise, as a fraction of the truth's mean.

    Parameters
    ----------
    rendered : (h, w, 3)
    halves : (2, h, w, 3)
        Two truths with independent noise.
    used : (h, w) bool
        Only blocks that lie wholly in it count.

    Returns
    -------
    float
        NaN where there is no such block.
    """
    whole = _blocks(used.astype(np.float64)[..., None])[..., 0] == 1.0
    if not whole.any():
        return math.nan
    parts = (_blocks(picture.astype(np.float64))[whole] for picture in (rendered, *halves))
    mean = max(float(halves[:, used].astype(np.float64).mean()), 1e-12)
    return math.sqrt(max(noise_free_square(*parts)[0], 0.0)) / mean


def nrmse(rendered: Array, halves: Array, used: Mask) -> float:
    """Root mean square error over some pixels, freed of the truth's noise, as a fraction of the truth's mean."""
    one, other = halves[:, used].astype(np.float64)
    square, _ = noise_free_square(rendered[used], one, other)
    return math.sqrt(max(square, 0.0)) / max(0.5 * float((one + other).mean()), 1e-12)


def bias(rendered: Array, halves: Array, used: Mask) -> tuple[float, float, float]:
    """Mean of each channel over some pixels, divided by the truth's, less 1."""
    right = halves[:, used].astype(np.float64).mean(axis=(0, 1))
    red, green, blue = (rendered[used].mean(axis=0) / np.maximum(right, 1e-12) - 1.0).tolist()
    return red, green, blue


def noise_free_square(rendered: Array, one: Array, other: Array) -> tuple[float, float]:
    """Mean square error against two truths, and its standard error.

    The noise of the truths is not correlated, so it is not in their product (shown - one)(shown - other).
    """
    squares = ((rendered - one) * (rendered - other)).mean(axis=-1)
    return float(squares.mean()), float(squares.std()) * max(squares.size, 1) ** -0.5


def picture_of(
    method: str,
    rendered: npt.NDArray[np.uint8],
    error: Array | None = None,
    known: Mask | bool = True,
    marked: Mask | None = None,
) -> ReportPicture:
    """Picture (h, w, 3) for the record, with its signed error (h, w) or (h, w, 3), where that is known, and marks."""
    stream = io.BytesIO()
    Image.fromarray(rendered).save(stream, format="PNG", optimize=True)
    png = base64.b64encode(stream.getvalue()).decode("ascii")
    if error is None:
        return ReportPicture(method, png)
    if error.ndim == 3:
        worst = np.abs(error).argmax(axis=-1)[..., None]
        error = np.take_along_axis(error, worst, axis=-1)[..., 0]
    error = np.where(known, np.where(np.abs(error) < INVISIBLE, 0.0, error), np.nan)
    return ReportPicture(method, png, Packed.of(error), None if marked is None else Packed.of(marked))


@dataclass(frozen=True)
class StoredTruth:
    """Stored truth of a scene: two independent, noisy estimates of its radiance.

    Attributes
    ----------
    halves : (2, k, 3) float64
        Radiance of the pixels of the mask, row by row.
    error : (k, 3) float64
        Standard error of the mean of the two.
    mask : (h, w) bool
        Pixels that bodies cover.
    parameters : (n,) float64
        See `scene_parameters`.
    paths : int
        Of each pixel, in both halves together.
    seconds : float
        Time of both.
    """

    halves: Array
    error: Array
    mask: Mask
    parameters: Array
    paths: int
    seconds: float

    @classmethod
    def traced(cls, scene: Scene, size: Size, paths: int) -> StoredTruth:
        """Path trace two independent halves of a scene, of so many paths for each pixel."""
        began = time.perf_counter()
        found = [reference.path_trace(scene, size, paths, seed) for seed in (1, 2)]
        seconds = time.perf_counter() - began
        mask = found[0][0].coverage
        halves = np.stack([frame.radiance[mask] for frame, _ in found])
        error = 0.5 * np.sqrt(sum(spread[mask] ** 2 for _, spread in found))
        return cls(halves, error, mask, scene_parameters(scene), 2 * paths, seconds)

    @property
    def noise(self) -> float:
        """Root mean square of the standard error, as a fraction of the mean radiance."""
        return float(np.sqrt((self.error**2).mean()) / self.halves.mean())

    def to_bytes(self) -> bytes:
        """Contents of its file: radiance in float16."""
        stream = io.BytesIO()
        np.savez_compressed(
            stream,
            halves=self.halves.astype(np.float16),
            error=self.error.astype(np.float16),
            mask=np.packbits(self.mask),
            size=np.array(self.mask.shape),
            parameters=self.parameters,
            paths=self.paths,
            seconds=self.seconds,
        )
        return stream.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> StoredTruth:
        """Truth of the contents of a file."""
        with np.load(io.BytesIO(content)) as found:
            size = tuple(found["size"].tolist())
            mask = np.unpackbits(found["mask"], count=int(np.prod(size))).reshape(size).astype(bool)
            halves, error = (found[name].astype(np.float64) for name in ("halves", "error"))
            return cls(halves, error, mask, found["parameters"], int(found["paths"]), float(found["seconds"]))


def truth_file(scene: str) -> str:
    """Name of the file with the truth of a scene, beside this module."""
    return f"scattering_truth/{scene.replace(' ', '_')}.npz"


def stored_truth(name: str, scene: Scene) -> StoredTruth:
    """Stored truth of a scene.

    Raises
    ------
    InputError
        If there is none, or it is of another scene than this one.
    """
    file = files("translucent.bench").joinpath(truth_file(name))
    if not file.is_file():
        raise InputError(
            f"truth of {name!r}", "no true picture of this scene is stored", "run tools/scattering_truth.py"
        )
    truth = StoredTruth.from_bytes(file.read_bytes())
    require_same_scene(name, scene, truth.parameters, "run tools/scattering_truth.py", SAME, SAME_ZERO)
    return truth


def require_same_scene(name: str, scene: Scene, stored: Array, do: str, relative: float, absolute: float) -> None:
    """Raise `InputError` if the parameters of a scene are not those whose truth is stored, up to rounding."""
    now = scene_parameters(scene)
    if now.shape != stored.shape or not np.allclose(now, stored, relative, absolute):
        raise InputError(f"truth of {name!r}", "the scene has changed since its true picture was path traced", do)


def scene_parameters(scene: Scene) -> Array:
    """Fingerprint of a scene in numbers, equal up to rounding for equal scenes.

    Meshes go in by their number of faces, volume and moments. Of a mesh with other faces in the same place little
    would show.
    """
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    found: list[npt.ArrayLike] = [
        scene.camera.pose,
        scene.camera.fov_y or scene.camera.height or 0.0,
        scene.environment.radiance(axes, np.zeros((6, 2))),
    ]
    for body in scene.objects:
        mesh, medium = body.mesh, body.medium
        found += [len(mesh.faces), len(mesh.vertices), mesh.volume, mesh.vertices.mean(axis=0)]
        found += [mesh.vertices.std(axis=0), (mesh.vertices**3).mean(axis=0), body.matrix]
        found += [0.0 if body.surface is None else body.surface.roughness]
        if medium is not None:
            found += [medium.absorption, medium.scattering, medium.emission, medium.anisotropy, medium.ior]
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            found += [light.direction, light.irradiance]
        else:
            found += [light.position, light.intensity]
            found += [light.cone] if isinstance(light, SpotLight) else []
    return np.concatenate([np.ravel(np.asarray(one, np.float64)) for one in found])
