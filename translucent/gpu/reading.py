"""Arrays of a frame, read from the targets of a job."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.frames.frame import (
    Deferred,
    copied,
    coverage_of,
    optical_depth_of,
    thickness_of,
    transmittance_of,
    transmitted_of,
    valid_of,
)
from translucent.gpu.adaptive import read_averages
from translucent.gpu.balance import COVERAGE_FLOOR
from translucent.gpu.body_uniforms import bounded_extinction
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.targets import read_floats

#: Largest share of a pixel's light that may come along rays that went astray.
MOST_LOST = 0.005

Floats = npt.NDArray[np.float32]


def read_arrays(job: FrameJob, samples: int) -> dict[str, Any]:
    """Arrays of a job's frame by their names in `Frame`, with radiance and transmittance averaged if sampled.

    What is compact is read at once, too, since the next frame is drawn into the same targets; arrays are made from it
    when they are asked for.
    """
    found = _compact_arrays(job) if job.compact else _whole_arrays(job)
    trusted = None
    if samples > 1:
        found["radiance"], found["transmittance"], trusted = read_averages(job, samples)
    if job.features.path_traced:
        found["radiance"], found["standard_error"], lost = read_paths(job)
        found["valid"] &= lost <= MOST_LOST
    elif job.features.traced:
        # Rays that end inside a body, or in more of them than they can remember, have no right color.
        share = read_floats(job.targets.surfaced(), 1, 4)[..., 3] if trusted is None else trusted
        found["valid"] &= share >= np.float32(1.0 - MOST_LOST)
    if job.plan.ordered:
        counts = read_floats(job.targets.ordered(), 2, 4)[::-1]
        found["layers"] = np.rint(counts[..., 0]).astype(np.int32)
        found["truncated"] = np.rint(counts[..., 0] - counts[..., 1]).astype(np.int32)
    if job.features.has_surfaces:
        found["normals"] = _read_normals(job)
    return found


def _whole_arrays(job: FrameJob) -> dict[str, Any]:
    result = job.targets.result()
    flags = np.empty(job.targets.size[::-1], dtype=np.uint8)
    result.read_into(flags, components=1, attachment=4, alignment=1)
    return {
        "radiance": read_floats(job.picture, 0, 3),
        "transmittance": read_floats(result, 1, 3),
        "optical_depth": read_floats(result, 2, 3),
        "thickness": read_floats(result, 3, 1),
        "coverage": (flags & 1).astype(bool),
        "valid": (flags & 2).astype(bool),
    }


def _compact_arrays(job: FrameJob) -> dict[str, Any]:
    marked = _fixed(read_floats(job.compact_result, 1, 1))
    if job.plan.spectral:
        values = _fixed(read_floats(job.compact_result, 2, 3))
        depth, through = Deferred(copied, values), Deferred(transmittance_of, values)
    else:
        extinction = bounded_extinction(job.scene.bodies[0].medium, job.scene.diagonal).astype(np.float32)
        depth = Deferred(optical_depth_of, marked, extinction)
        through = Deferred(transmitted_of, marked, extinction)
    return {
        "radiance": read_floats(job.compact_result, 0, 3),
        "transmittance": through,
        "optical_depth": depth,
        "thickness": Deferred(thickness_of, marked),
        "coverage": Deferred(coverage_of, marked, COVERAGE_FLOOR * job.scene.diagonal),
        "valid": Deferred(valid_of, marked),
    }


def _fixed(values: Floats) -> Floats:
    """The values, read-only: arrays are made from them at any time."""
    values.setflags(write=False)
    return values


def _read_normals(job: FrameJob) -> Floats:
    """(h, w, 3): normals of the interfaces that the interfaces pass has found, 0 where there is none."""
    width, height = job.targets.size
    normals = np.zeros((height, width, 3), dtype=np.float32)
    if job.covered:
        found = read_floats(job.targets.entered(), 0, 4)[::-1]
        np.copyto(normals, found[..., :3], where=found[..., 3:] < float(CONSTANTS["NOTHING"]))
    return normals


def read_paths(job: FrameJob) -> tuple[Floats, Floats, Floats]:
    """Radiance (h, w, 3) of random paths, its standard error, and the share (h, w) of them that were lost."""
    count = job.paths_traced
    known = job.targets.paths()
    mean, squares = read_floats(known, 0, 4), read_floats(known, 1, 3)
    with np.errstate(under="ignore"):
        error = np.sqrt(squares / np.float32(count * (count - 1.0)))
        return np.ascontiguousarray(mean[..., :3]), error, mean[..., 3] / np.float32(count)
