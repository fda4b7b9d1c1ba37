"""Adaptive sampling: rays are traced from interfaces where samples of a pixel differ, elsewhere once or a few times."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import combinations

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.formulas.sampling import sample_shifts, sobol_points
from translucent.gpu.constants import ENLARGED_ACROSS, PIXEL_PARTS
from translucent.gpu.job import ROUNDS, ROUNDS_FROM, FrameJob
from translucent.gpu.passes.opaque import is_smooth
from translucent.gpu.passes.ray_generations import pixel_words
from translucent.gpu.passes.traced_interfaces import FEW_SAMPLES, interior_at_eye, mirrored_part, unsettled_part
from translucent.gpu.passes.variants import Variants
from translucent.gpu.placement import Part
from translucent.gpu.shaders import set_uniform, set_used
from translucent.gpu.targets import add_up, read_floats
from translucent.planning.passes import PassName

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]

#: Of 16 samples, the largest standard error that is as good as none, as a fraction of the light: a step of a picture
#: with 8 bits in the middle of its range, by the slope of the curve of sRGB, (2.4 / (0.5 + 0.055)) / 255. With more
#: samples it is smaller.
ERROR = 0.017

#: The same of the light that bodies add to what a ground mirrors, as a fraction of all light of the ground: that is
#: smooth but for the mirror image, so that less of an error shows.
MIRROR_ERROR = 0.005

#: Ratio of the second difference of neighboring pixels to the standard error of one sample in the middle of a pixel. An
#: edge across a pixel has a difference as large as its step. The sample finds the larger side: its error is the step
#: times the smaller part of the pixel, from 0 to 1/2, whose mean square is 1/12. Light that is linear has neither.
DIFFERENCE_TO_ERROR = 12.0**0.5

#: Samples after which deviations are measured: pictures with no more than these take all. And the most samples of a
#: pixel, as a multiple of those of the picture.
FIRST_LOOK, MORE = 3, 2

#: Samples that the variance expected from the 3 x 3 pixels counts as, and the part of it that is the variance of an
#: edge which makes their means as uneven as they are; the rest is that of samples in them. Smooth interfaces show
#: edges, which are in some pixels and not in those beside: few samples that agree may have missed one. The noise of
#: rough interfaces is alike in these pixels, and a pixel that goes by its own stops where that is low by chance.
EDGES, NOISE = {"prior": 4.0, "by_edges": 1.0 / 3.0}, {"prior": 1e6, "by_edges": 0.0}

#: Standard errors by which a pixel is off each of the eight around it, at least, so that it takes all samples: few
#: samples that agree may all have missed what is smaller than the pixel, or may all have hit it.
APART = 2.0

#: A pixel is isolated that is farther from the median of the eight around it than so many spreads of the 24 around it,
#: and from each of the eight by a fraction of that; and the least spread, as a fraction of the median. It is sure that
#: the pixel is so, by half of what it is off, if this is so many standard errors of its light.
ISOLATED, ALONE, LEAST_SPREAD, SURE = 3.5, 0.45, 0.015, 3.0

#: How often isolated pixels are looked for, at most: one may hide the next. And how many may be drawn enlarged, so that
#: it takes a few percent of the time of a large picture: those that are farthest off. Rough interfaces show more noise.
ROUNDS_AGAIN, MOST_ENLARGED, MOST_ROUGH_ENLARGED = 4, 64, 1024

#: Samples from which those of the first look are chosen.
_CHOICE = 32

#: Fractions of a pixel's light that rays lose, as in open meshes, from which on it is not worth more samples: of
#: interfaces, so that one sample of 16 makes the pixel invalid (`renderer.MOST_LOST`) whatever the others find; and of
#: what a ground mirrors, so that as many lost by the others do.
MUCH_LOST, MIRROR_LOST = 0.1, 0.005

#: Passes of a sample whose results are there, or are not read, when rays are traced from its interfaces.
_DONE = (PassName.BACKDROP, PassName.CAUSTICS)
_OF_OPAQUE = (PassName.SHADOW_MAPS, PassName.OPAQUE, PassName.CAUSTICS)
_NEEDED = (PassName.SHADOW_MAPS, PassName.OPAQUE, PassName.INTERFACES, PassName.TRACED)

Run = Callable[[tuple[PassName, ...]], None]


class AdaptiveSampling:
    """Averages over samples in two rounds: first the cheap passes for all samples, then ray tracing where pixels need
    it.

    Of n samples at low-discrepancy points, a pixel with an edge has an error of about sigma n^(-3/4), with the standard
    deviation sigma of a sample (Mitchell 1996, "Consequences of stratified sampling in graphics"). Pixels have enough
    where that does not show, unless they are isolated: brighter than all eight around them, or darker, by what shows
    and by more than `APART` standard errors. A picture with the error that N samples of each pixel leave takes least
    time if a pixel has samples in proportion to sigma^(4/5), N (sum sigma^(4/5) / sum sigma^2)^(2/3) sigma^(4/5)
    (Neyman 1934, "On the two different aspects of the representative method", for that error). Deviations are relative
    to the root of the light, between an error of the light and one of its logarithm. A few samples on one side of an
    edge agree by chance. So the variance of a pixel is shrunk towards an expected one, which is that of the pixels
    around, and in part that of an edge between them which their means show (Efron and Morris 1973, "Stein's estimation
    rule and its competitors: an empirical Bayes approach").

    The first round finds for every sample which pixels show an interface, and sums up the light of all others:
    edges are as smooth as ever. Light that media add along straight rays is summed up there as well, through the first
    interface. The second traces rays; in each pixel, their mean replaces all of its
    samples that hit an interface. Rays that a ground mirrors add their mean to the other samples. Opaque objects are
    visible through interfaces as the mean of all samples shows them; a ground alone, which is smooth, everywhere as the
    mean of a few.

    Parameters
    ----------
    gl : moderngl.Context
    """

    def __init__(self, gl: moderngl.Context) -> None:
        vertex = "geometry/fullscreen.vert"
        self._gl = gl
        self._unsettled = Variants(gl, vertex, "transport/unsettled.frag", "bent_light", "bent_spread", "average_light")
        self._part = Variants(gl, vertex, "shade/part_of_mean.frag", "sampled")
        self._left = gl.query(samples=True)
        self._wanted = 0.0

    def run(self, job: FrameJob, samples: int, run_passes: Run) -> None:
        """Sum up the samples of a job; `run_passes` runs its passes, but for some."""
        clock = _Clock(job, samples)
        job.targets["average"].clear()
        job.targets["bent"].clear()
        if job.mirror is not None:
            job.targets["mirrored"].clear()
        job.bent_apart = True
        job.samples, shifts = samples, sample_shifts(samples).tolist()
        if job.features.has_opaque:
            job.targets["opaque_mean"].clear()
            if samples >= ROUNDS_FROM and is_smooth(job):
                self._hold_opaque(job, shifts, run_passes)
        for number, shift in enumerate(shifts):
            job.sample = number
            job.place(tuple(shift))
            run_passes(())
            if job.features.has_opaque and not job.holds_opaque:
                self._add_opaque(job, samples)
            clock.outside()
        job.bending = True
        leave_out = _left_out(job)
        looks = _looks(samples)
        for number, shift in enumerate(_central_first(samples)):
            if not number or number in looks:
                left = self._find_unsettled(job, samples, number)
                if not left:
                    break
                clock.left = left
            self._trace_sample(job, number, shift, run_passes, leave_out)
            clock.bent(number)
        job.choose_faces(None)
        if samples > FIRST_LOOK:
            self._settle_isolated(job, samples, run_passes)
        job.bending = False

    def _trace_sample(
        self, job: FrameJob, number: int, shift: tuple[float, float], run_passes: Run, leave_out: tuple[PassName, ...]
    ) -> None:
        job.sample = number
        job.place(shift)
        run_passes(leave_out)

    def _settle_isolated(self, job: FrameJob, samples: int, run_passes: Run) -> None:
        """Take a sample of each of 8 x 8 parts of single pixels far off their neighbors, and more until that is sure.

        Their own samples may all have missed what is smaller than the pixel, or have hit it too often; and highlights
        are as wide as the normals within a sample. A pixel is drawn as a block of pixels, so that a few steps take the
        samples of many. They take the place of those before, which chose the pixel as they were far off: the mean of
        all would be biased. Few parts of a block may see a bubble in ice, or a random microfacet that mirrors a light:
        while the error of its mean may be half of what a pixel is off, the pixel gets as many blocks again.
        """
        targets, shown = job.targets, job.view.shift
        light, others = read_floats(targets["bent"], 0, 4), read_floats(targets["average"], 0, 4)
        inside, straight = (light[..., 3] > 0) & (others[..., 3] == 0), others[..., :3].sum(axis=-1) / samples
        inside &= min(targets.size) >= PIXEL_PARTS * ENLARGED_ACROSS
        blocks, variance, sums = np.zeros(inside.shape, int), np.zeros(inside.shape), [light]
        left = MOST_ROUGH_ENLARGED if _is_rough(job) else MOST_ENLARGED
        for number in range(ROUNDS_AGAIN):
            level = light[..., :3].sum(axis=-1) / np.where(inside, light[..., 3], 1.0) + straight
            errors = np.where(blocks > 0, np.sqrt(variance) / np.maximum(blocks, 1), np.inf)
            spreads = isolated_pixels(level, inside, errors)
            pixels = np.argwhere(spreads > 0.0)
            pixels = pixels[np.argsort(-spreads[tuple(pixels.T)], kind="stable")]
            wanted = np.maximum(blocks[tuple(pixels.T)], 1)
            pixels = np.repeat(pixels, wanted, axis=0)[:left]
            if not len(pixels):
                break
            if not number:
                sums.append(read_floats(targets["bent"], 1, 4))
            job.sample, left = _most(samples) + number, left - len(pixels)
            for first in range(0, len(pixels), ENLARGED_ACROSS**2):
                chosen = pixels[first : first + ENLARGED_ACROSS**2]
                found = self._enlarged(job, chosen, blocks, run_passes)
                for (row, column), *parts in zip(chosen.tolist(), *found, strict=True):
                    for whole, part in zip(sums, parts, strict=True):
                        whole[row, column] = part.sum(axis=(0, 1)) + (blocks[row, column] > 0) * whole[row, column]
                    blocks[row, column] += 1
                    variance[row, column] += lattice_variance(parts[0][..., :3].sum(axis=-1))
        if blocks.any():
            for attachment, whole in zip(targets["bent"].color_attachments, sums, strict=True):
                attachment.write(whole)
            # Blocks have replaced what the last sample shows, which a frame reads: it is drawn again.
            job.place(shown)
            run_passes(_all_but(job, PassName.INTERFACES))

    def _enlarged(self, job: FrameJob, pixels: Ints, before: Ints, run_passes: Run) -> list[Floats]:
        """Light (n, 8, 8, 4) of the parts of some pixels (row, column), and its square, as `bent` has them.

        Blocks of a pixel, which has had some (h, w) `before`, have their samples at other places of the parts.
        """
        entered, bent, height = job.targets["entered"], job.targets["bent"], job.targets.size[1]
        covered = job.covered
        marks = np.zeros((height, job.targets.size[0]), np.float32)
        blocks = [Part(left, top, left + PIXEL_PARTS, top + PIXEL_PARTS) for top, left in _corners(len(pixels))]
        shifts = ((sobol_points(2 ** (ROUNDS_AGAIN - 1)) + 0.5) % 1.0 - 0.5) / PIXEL_PARTS
        numbers = before[tuple(pixels.T)] + [(pixels[:i] == pixel).all(axis=1).sum() for i, pixel in enumerate(pixels)]
        job.enlarged = [(column, row) for column, row in (pixels[:, ::-1] + shifts[numbers]).tolist()]
        try:
            for block, (row, column), place in zip(blocks, pixels.tolist(), job.enlarged, strict=True):
                job.enlarge(column, row, place, block)
                entered.scissor = block.flipped(height).scissor
                run_passes(_all_but(job, PassName.INTERFACES))
                marks[block.bottom : block.top, block.left : block.right] = 1.0
        finally:
            entered.scissor = None
            job.choose_faces(None)
        job.unsettled = {"unsettled": pixel_words(marks > 0.0), "mirror_unsettled": np.zeros(0, np.uint32)}
        if job.mirror is not None:
            job.targets["mirror_unsettled"].clear()
        job.targets["unsettled"].color_attachments[0].write(marks)
        drawn = Part(0, 0, max(block.right for block in blocks), blocks[-1].top)
        job.place((0.0, 0.0))
        job.covered = drawn.flipped(height)
        for attachment in bent.color_attachments:
            attachment.write(np.zeros((drawn.top, drawn.right, 4), np.float32), viewport=drawn.scissor)
        run_passes(_all_but(job, PassName.TRACED))
        job.enlarged, job.covered = None, covered
        found = (bent.read(drawn.scissor, 4, attachment=number, dtype="f4") for number in range(2))
        shape = drawn.top // PIXEL_PARTS, PIXEL_PARTS, drawn.right // PIXEL_PARTS, PIXEL_PARTS, 4
        return [
            np.frombuffer(part, np.float32).reshape(shape).swapaxes(1, 2).reshape(-1, *shape[1:4:2], 4)[: len(pixels)]
            for part in found
        ]

    def _hold_opaque(self, job: FrameJob, shifts: Sequence[tuple[float, float]], run_passes: Run) -> None:
        """Draw the opaque objects in a few samples, whose mean all samples then show.

        After the first, only where their light is not linear from pixel to pixel: at edges of shadows and of surfaces.
        """
        job.few_opaque = True
        others = tuple(step.name for step in job.plan.passes if step.name not in _OF_OPAQUE)
        mean = job.targets["opaque_mean"]
        for number, job.sample in enumerate(ROUNDS):
            job.place(shifts[job.sample])
            run_passes(others)
            if number == 0:
                self._add_opaque(job, 1)
                light = read_floats(mean, 0, 4)
                job.uneven = uneven_part(light[..., :3], DIFFERENCE_TO_ERROR * MIRROR_ERROR)
                mean.clear(viewport=job.uneven.scissor)
            self._add_opaque(job, len(ROUNDS), job.uneven)
        self._part.bind(sampled=mean.color_attachments[0])
        job.targets.view("opaque", 1).use()
        self._gl.enable_only(moderngl.NOTHING)
        self._part.draw_fullscreen(self._part.program(HELD=True))
        job.holds_opaque = True
        if job.covered and (light[..., 3] > 0.0).all():  # a ground has no holes
            job.covered = job.covered.wider(1, job.targets.size)  # of samples less than a pixel apart
            job.shows_ground_alone = True

    def _add_opaque(self, job: FrameJob, samples: int, part: Part | None = None) -> None:
        """Add a sample of the opaque objects to their mean, in all of the picture or in a part."""
        self._part.bind(sampled=job.targets["opaque"].color_attachments[1])
        program = self._part.program(HELD=False)
        set_uniform(program, "part", 1.0 / samples)
        add_up(self._gl)
        whole = Part(0, 0, *job.targets.size)
        self._part.draw_part(whole if part is None else part, program, job.targets["opaque_mean"])

    def _find_unsettled(self, job: FrameJob, samples: int, taken: int) -> int:
        """Mark the pixels that need more samples than these; returns how many there are."""
        if not job.covered:
            return 0
        covered = job.covered.flipped(job.targets.size[1]).wider(1, job.targets.size)  # of samples a pixel apart
        expected = NOISE if _is_rough(job) else EDGES
        marked = [(("bent", "unsettled"), ERROR, MUCH_LOST, expected, unsettled_part(job, covered, "unsettled"))]
        if job.mirror is not None:
            part = unsettled_part(job, mirrored_part(job, job.mirror), "mirror_unsettled")
            marked.append((("mirrored", "mirror_unsettled"), MIRROR_ERROR, MIRROR_LOST, NOISE, part))
        finer = min(16.0 / samples, 1.0)
        values = {"samples": samples, "most": _most(samples), "first": taken == 1, "apart": APART}
        values |= {"wanted": 0.0, "measures": 1}
        own = [
            {
                **values,
                **expected,
                "difference": DIFFERENCE_TO_ERROR * finer * error,
                "error": finer * error,
                "much_lost": lost,
            }
            for _, error, lost, expected, _ in marked
        ]
        if taken == FIRST_LOOK:
            found = []
            for (names, *_, part), uniforms in zip(marked, own, strict=True):
                self._mark(job, *names, part, uniforms)
                found.append(read_floats(job.targets[names[1]], 0, 1).ravel())
            self._wanted = wanted_samples(np.concatenate(found), samples)
        left = 0
        for (names, *_, part), uniforms in zip(marked, own, strict=True):
            left += self._mark(job, *names, part, {**uniforms, "wanted": self._wanted, "measures": 0})
            if job.plan.hits == "embree":
                job.unsettled[names[1]] = pixel_words(read_floats(job.targets[names[1]], 0, 1) > 0.0)
        if taken and job.unsettled:
            job.choose_faces(np.concatenate(list(job.unsettled.values())))
        return left

    def _mark(self, job: FrameJob, source: str, mask: str, part: Part, values: dict[str, float]) -> int:
        """Mark pixels of a part of a target by the uniforms; returns how many there are."""
        job.targets[mask].clear()
        light, spread = job.targets[source].color_attachments
        average = job.targets["average"].color_attachments[0]
        self._unsettled.bind(bent_light=light, bent_spread=spread, average_light=average)
        program = self._unsettled.program(MIRROR=source == "mirrored")
        set_used(program, values)
        self._gl.enable_only(moderngl.NOTHING)
        with self._left:
            self._unsettled.draw_part(part, program, job.targets[mask])
        return int(self._left.samples)


def _is_rough(job: FrameJob) -> bool:
    """True if any body has a rough interface."""
    return any(body.surface and body.surface.roughness > 0 for body in job.scene.bodies)


def wanted_samples(deviations: Floats, samples: int) -> float:
    """Number of samples that a pixel of standard deviation 1 needs to reach the error of a picture.

    Parameters
    ----------
    deviations : array of float32
        Standard deviation of a sample in each pixel; 0 where it is not known.
    samples : int
    """
    found = deviations[deviations > 0].astype(np.float64)
    if not found.size:
        return 0.0
    # Pixels stop at the next look, with more than they need; others have too few, as deviations are estimates.
    return float(samples * ((found**0.8).sum() / np.square(found).sum()) ** (2 / 3))


def uneven_part(light: Floats, difference: float) -> Part:
    """Bounds of the pixels beside which light (h, w, 3) has a second difference of more than this fraction of it."""
    level = light.sum(axis=-1)
    bends = np.zeros(level.shape, bool)
    for before, here, after, found in (
        (level[:-2], level[1:-1], level[2:], bends[1:-1]),
        (level[:, :-2], level[:, 1:-1], level[:, 2:], bends[:, 1:-1]),
    ):
        found |= np.abs(before + after - 2.0 * here) > difference * here
    rows, columns = (np.flatnonzero(bends.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return Part(0, 0, 0, 0)
    # A sample aside of the first sees what is up to a pixel further on.
    bounds = Part(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
    return bounds.wider(1, (level.shape[1], level.shape[0]))


def isolated_pixels(
    level: Floats, inside: npt.NDArray[np.bool_], errors: npt.NDArray[np.float64] | None = None
) -> Floats:
    """(h, w): how many spreads pixels of a picture (h, w) are off, if all around are `inside` (h, w); else 0.

    Also 0 where that is sure, by the standard errors (h, w) of the pixels.
    """
    found, (height, width) = np.zeros(level.shape, np.float32), level.shape
    steps = [(y, x) for y in range(-2, 3) for x in range(-2, 3) if (y, x) != (0, 0)]
    padded = np.pad(inside, 1)
    beside = [padded[1 + y : 1 + y + height, 1 + x : 1 + x + width] for y, x in steps if max(abs(y), abs(x)) == 1]
    row, column = np.nonzero(inside & np.all(beside, axis=0))
    near = np.array([level[row + y, column + x] for y, x in steps if max(abs(y), abs(x)) == 1]).reshape(8, -1)
    own = level[row, column]
    off = np.abs(near - own).min(axis=0, initial=np.inf)
    chosen = np.flatnonzero(off > ALONE * ISOLATED * LEAST_SPREAD * np.abs(near).min(axis=0, initial=np.inf))
    row, column, own, off, near = row[chosen], column[chosen], own[chosen], off[chosen], near[:, chosen]
    median = np.median(near, axis=0)
    around = [(np.clip(row + y, 0, height - 1), np.clip(column + x, 0, width - 1)) for y, x in steps]
    wide = np.array([np.where(inside[at], level[at], median) for at in around])
    spread = 1.4826 * np.median(np.abs(wide - np.median(wide, axis=0)), axis=0)
    distance = np.abs(own - median)
    spread = np.maximum(spread, LEAST_SPREAD * np.abs(median))
    far = (distance > ISOLATED * spread) & (off > ALONE * distance)
    if errors is not None:
        far &= 0.5 * distance < SURE * errors[row, column]
    found[row[far], column[far]] = distance[far] / np.maximum(spread[far], 1e-12)
    return found


def lattice_variance(parts: Floats) -> float:
    """Variance of the mean of parts (n, n) of a pixel, which are samples in rows and columns.

    That of the means of rows, or of columns if that is larger: a line along a row is in all of its parts or in none. By
    differences of neighbors, as a slope leaves the mean right (Wolter 1984, "An investigation of some estimators of
    variance for systematic sampling").
    """
    steps = (np.diff(parts.mean(axis=axis, dtype=np.float64)) for axis in (0, 1))
    return float(max(np.square(step).mean() for step in steps) / (2.0 * len(parts)))


def _looks(samples: int) -> set[int]:
    """Numbers of samples after which settled pixels are left out.

    After the first look each time that there are sqrt(2) times as many, and after all of the picture.
    """
    if samples <= FIRST_LOOK:
        return {1}
    later = {round(samples * 2 ** (i / 2)) for i in range(-2 * samples.bit_length(), 2)}
    return {1, FIRST_LOOK} | {number for number in later if number > FIRST_LOOK}


def _most(samples: int) -> int:
    """Samples of a pixel at most."""
    return MORE * samples if samples > FIRST_LOOK else samples


def is_adaptive(job: FrameJob, samples: int) -> bool:
    """True if rays need not be traced for every sample of a job: not from the eye, nor where a denoiser follows."""
    surfaces = [body.surface for body in job.scene.bodies if body.surface is not None]
    return (
        samples >= FEW_SAMPLES
        and job.features.last_pass == PassName.TRACED
        and not any(interior_at_eye(job))
        and not (job.plan.request.denoise and any(surface.roughness > 0 for surface in surfaces))
    )


def read_averages(job: FrameJob, samples: int) -> tuple[Floats, Floats, Floats]:
    """Mean radiance (h, w, 3) and transmittance (h, w, 3) over samples, and the fraction (h, w) that can be trusted."""
    averages = job.targets["average"]
    light, spread = (read_floats(averages, i, 4) for i in range(2))
    with np.errstate(under="ignore"):
        if job.bent_apart:
            parts = {"bent": np.float32(samples) - light[..., 3]}
            if job.mirror is not None:
                parts["mirrored"] = light[..., 3].copy()
            for name, samples_of in parts.items():
                found, trusted = read_floats(job.targets[name], 0, 4), read_floats(job.targets[name], 1, 4)[..., 3]
                standing_for = samples_of / np.maximum(found[..., 3], np.float32(1.0))
                light[..., :3] += standing_for[..., None] * found[..., :3]
                spread[..., 3] += standing_for * trusted
        count = np.float32(samples)
        return light[..., :3] / count, spread[..., :3] / count, spread[..., 3] / count


def traced_samples(job: FrameJob) -> float:
    """Mean number of samples for which rays were traced, over the pixels in which they were."""
    taken = read_floats(job.targets["bent"], 0, 4)[..., 3]
    return float(taken[taken > 0].mean(dtype=np.float64)) if taken.any() else 0.0


@lru_cache(maxsize=8)
def _central_first(samples: int) -> list[tuple[float, float]]:
    """Sub-pixel shifts of the samples, the most central first: where surroundings are smooth, it is the only one.

    The others of the first look come next: of all choices, their mean with the first is nearest to that of all samples
    where light is a polynomial of degree 2. Last come those of pixels that take more samples than the picture.
    """
    shifts, more = sample_shifts(samples), sobol_points(_most(samples))[samples:]
    nearest = int(np.argmin(np.square(shifts).sum(axis=1)))
    order = [nearest, *(i for i in range(samples) if i != nearest)]
    if samples > FIRST_LOOK:
        x, y = shifts.T
        moments = np.stack([x, y, x * x, x * y, y * y], axis=1)
        others = np.array(list(combinations(order[1:_CHOICE], FIRST_LOOK - 1)))
        off = (moments[nearest] + moments[others].sum(axis=1)) / FIRST_LOOK - moments.mean(axis=0)
        best = others[int(np.argmin(np.square(off).sum(axis=1)))].tolist()
        order = [nearest, *best, *(i for i in order[1:] if i not in best)]
    shifts = shifts[order]
    if len(more):
        shifts = np.concatenate([shifts, more - more.mean(axis=0)])
    return [(right, down) for right, down in shifts.tolist()]


def _corners(count: int) -> list[tuple[int, int]]:
    """Top and left of so many blocks of parts of pixels."""
    return [(PIXEL_PARTS * (i // ENLARGED_ACROSS), PIXEL_PARTS * (i % ENLARGED_ACROSS)) for i in range(count)]


def _all_but(job: FrameJob, name: PassName) -> tuple[PassName, ...]:
    """All passes of a job but one."""
    return tuple(step.name for step in job.plan.passes if step.name != name)


def _left_out(job: FrameJob) -> tuple[PassName, ...]:
    """Passes of a sample that tracing its rays does not need."""
    # Of what the ground mirrors, media without an interface may absorb some.
    if job.mirror is not None and any(not (body.has_interface or body.covers) for body in job.scene.bodies):
        return _DONE
    return tuple(step.name for step in job.plan.passes if step.name not in _NEEDED)


class _Clock:
    """Clock that reports the fraction of the work that is done, from how long the first samples took."""

    def __init__(self, job: FrameJob, samples: int) -> None:
        self._job, self._samples = job, samples
        self._begun = time.perf_counter()
        self._outside = self._first = 0.0
        self._most = self.left = 0

    def outside(self) -> None:
        """Report a sample whose rays are not traced yet, as if tracing took as long."""
        self._job.gl.finish()
        self._job.report(0.5 * (self._job.sample + 1) / self._samples)
        self._outside = time.perf_counter() - self._begun

    def bent(self, number: int) -> None:
        """Report a sample whose rays have been traced."""
        self._job.gl.finish()
        spent = time.perf_counter() - self._begun
        if not number:
            self._first, self._most = spent - self._outside, max(self.left, 1)
        rest = (_most(self._samples) - 1 - number) * self._first * self.left / self._most
        self._job.report(0.5 + 0.5 * (spent - self._outside) / (spent - self._outside + rest))
