"""Ground truth of a case, and errors of frames against it."""

from __future__ import annotations

import base64
import dataclasses
import io
import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image

from translucent import reference
from translucent.arrays import Array
from translucent.bench.codec import Packed
from translucent.bench.drawing import Size
from translucent.bench.judgement import color_difference
from translucent.bench.record import ColorDifference, ErrorStatistics, LightErrors, Quantity, ReportPicture
from translucent.bench.scattering.stored import stored_truth
from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.frames.metrics import compare, interior
from translucent.scene.scene import Scene

#: Number of interfaces at which the reference follows rays. What goes around inside of a knot, reflected totally, comes
#: out after a hundred of them: with 48, its picture would be wrong by 6 %.
BOUNCES = 128

#: Number of rays through each pixel of each of two references before rough interfaces, whose spread is their noise.
PATHS = 128

#: Number of rays through each pixel of each of two references where the truth is a mean over pixels.
RAYS = 4

#: Width and height of the blocks over whose means errors are taken, too, in pixels.
BLOCK = 4

#: Errors that pictures need not tell from 0: half of the smallest that a heat map shows. Noise does not compress.
INVISIBLE = 5e-8


#: Radiance below which a picture is black, and relative errors are meaningless.
DARK = 1e-6


@dataclass(frozen=True)
class Truth:
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
        Of the bounds of what light enters, in metres.
    seconds : float
        That the frame took.
    halves : two (h, w, 3) arrays, optional
        Radiances with noise that has nothing to do with each other's, where interfaces are rough or radiance is a mean
        over pixels; the frame has the mean.
    noise : float, optional
        Of a stored truth: root mean square of its standard error, as a share of its mean.
    rays : int
        Through each pixel that is compared, spread over it, whose mean is its radiance; 1 along its center.
    """

    frame: Frame
    inside: npt.NDArray[np.bool_]
    layers: int
    diagonal: float
    seconds: float
    halves: tuple[Array, Array] | None = None
    noise: float | None = None
    rays: int = 1

    @classmethod
    def over_pixels(cls, scene: Scene, size: Size, tolerance: float) -> Truth:
        """Trace the radiance that a camera with a box filter takes, where errors are taken; elsewhere along centers."""
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
    def of(cls, scene: Scene, size: Size, tolerance: float) -> Truth:
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
    def stored(cls, name: str, scene: Scene) -> Truth:
        """Truth of a scene that the package brings; raises `InputError` where it is that of another scene."""
        found = stored_truth(name, scene)
        size = found.mask.shape[1], found.mask.shape[0]
        # All but the light that media scatter.
        frame, _ = reference.path_trace(scene, size, paths=2, max_events=0)
        if not np.array_equal(frame.coverage, found.mask):
            raise InputError(f"truth of {name!r}", "it covers other pixels", "run tools/scattering_truth.py")
        halves = frame.radiance.copy(), frame.radiance.copy()
        for half, radiance in zip(halves, found.halves, strict=True):
            half[found.mask] = radiance
        frame = dataclasses.replace(frame, radiance=0.5 * (halves[0] + halves[1]))
        return dataclasses.replace(cls._of_frame(scene, frame, found.seconds, halves), noise=found.noise)

    @classmethod
    def _of_frame(cls, scene: Scene, frame: Frame, seconds: float, halves: tuple[Array, Array] | None) -> Truth:
        size = frame.size
        counts = reference.hit_counts(scene, size)
        inside = interior(counts)
        for seen in reference.opaque_counts(scene, size):
            inside &= interior(seen)
        low, high = np.transpose([body.bounds for body in scene.bodies], (1, 0, 2))
        diagonal = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        return cls(frame, inside, int(counts.max()), diagonal, seconds, halves)

    @property
    def spread(self) -> float:
        """Standard error of the radiance of pixels, root mean square, as a share of the radiance's own."""
        if self.halves is None:
            return 0.0
        one, other = (half[self.compared] for half in self.halves)
        return float(np.sqrt(np.mean((one - other) ** 2))) / 2.0 / self.scale("radiance")

    @property
    def compared(self) -> npt.NDArray[np.bool_]:
        """(h, w) pixels that errors are taken over, as far as a method calls them valid."""
        return self.inside & self.frame.coverage & self.frame.valid

    def scale(self, quantity: Quantity) -> float:
        """Scale of errors in a quantity, of which they are shares."""
        if quantity == "radiance":
            with np.errstate(under="ignore"):
                rms = float(np.sqrt(np.mean(self.frame.radiance[self.compared] ** 2)))
            return rms if rms > DARK else 1.0
        return self.diagonal if quantity == "thickness" else 1.0

    def errors(self, frame: Frame, quantity: Quantity) -> tuple[ErrorStatistics, float, float] | None:
        """Errors of a frame; and the shares of the invalid and of the wrongly covered pixels. None: none to compare."""
        try:
            found = compare(frame, self.frame, quantity, mask=self.inside)
        except InputError:
            return None
        scale = self.scale(quantity)
        values = {
            field.name: float(getattr(found, field.name)) / scale for field in dataclasses.fields(ErrorStatistics)
        }
        if self.halves is not None and quantity == "radiance":
            values["rms"] = self._rms_without_noise(frame, *self.halves) / scale
        return ErrorStatistics(**values), found.invalid, found.coverage_mismatch

    def _rms_without_noise(self, frame: Frame, one: Array, other: Array) -> float:
        """Root mean square error in radiance: noise of the two halves is not correlated, so their product has none."""
        used = self.compared & frame.coverage & frame.valid
        shown = np.asarray(frame.radiance, np.float64)
        products = ((shown - one) * (shown - other))[used].mean(axis=1)
        # Over pixels the error may be less than noise can tell: then the standard error of its square is told.
        least = float(products.std()) * max(len(products), 1) ** -0.5 if self.rays > 1 else 0.0
        return math.sqrt(max(float(products.mean()), least))

    def light_errors(self, frame: Frame, solve_seconds: float | None) -> LightErrors | None:
        """Errors of a frame as shares of the mean of a path traced truth; None if there is no such truth."""
        used = self.compared & frame.coverage & frame.valid
        if self.halves is None or not used.any():
            return None
        mean = float(self.frame.radiance[used].mean())
        shown = np.asarray(frame.radiance, np.float64)
        off = [shown - half for half in self.halves]
        whole = _blocks(used.astype(np.float64)[..., None])[..., 0] == 1.0
        coarse = (_blocks(off[0]) * _blocks(off[1]))[whole]
        bias = shown[used].mean(axis=0) / self.frame.radiance[used].mean(axis=0) - 1.0
        return LightErrors(
            self._rms_without_noise(frame, *self.halves) / mean,
            math.sqrt(max(float(coarse.mean()), 0.0)) / mean if whole.any() else 0.0,
            (float(bias[0]), float(bias[1]), float(bias[2])),
            solve_seconds,
        )

    def color_difference(self, frame: Frame, quantity: Quantity) -> ColorDifference | None:
        """Visible color difference of a frame; None if there is no pixel to compare."""
        used = self.compared & frame.coverage & frame.valid
        if not used.any():
            return None
        shown = "transmittance" if quantity == "thickness" else quantity
        return color_difference(getattr(frame, shown)[used], getattr(self.frame, shown)[used])

    def picture(self, method: str, frame: Frame, quantity: Quantity) -> ReportPicture:
        """Picture of a frame with its errors; the reference has none."""
        stream = io.BytesIO()
        Image.fromarray(frame.to_srgb8()).save(stream, format="PNG", optimize=True)
        png = base64.b64encode(stream.getvalue()).decode("ascii")
        if frame is self.frame:
            return ReportPicture(method, png)
        result, right = (np.asarray(getattr(f, quantity), np.float64) for f in (frame, self.frame))
        error = result - right
        if error.ndim == 3:
            worst = np.abs(error).argmax(axis=-1)[..., None]
            error = np.take_along_axis(error, worst, axis=-1)[..., 0]
        error = error / self.scale(quantity)
        error = np.where(np.abs(error) < INVISIBLE, 0.0, error)
        covered = frame.coverage | self.frame.coverage
        error = np.where(covered & frame.valid & self.frame.valid, error, np.nan)
        return ReportPicture(method, png, Packed.of(error), Packed.of(covered & ~frame.valid))


def _blocks(picture: Array) -> Array:
    """Means over blocks of 4 x 4 pixels, without what is left over at the right and below."""
    h, w = (side // BLOCK for side in picture.shape[:2])
    cut = picture[: h * BLOCK, : w * BLOCK]
    return np.asarray(cut.reshape(h, BLOCK, w, BLOCK, -1).mean(axis=(1, 3)))
