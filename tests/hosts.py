"""Inputs of one body's lifted passes from an engine: vertices, uniform blocks, and the truth to hold them against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import translucent as tl
from tests import references
from translucent.frames.metrics import interior
from translucent.gpu.layout import BLOCKS
from translucent.gpu.placement import Balance, PlacedScene, SampleView, face_counts
from translucent.gpu.uniforms import (
    BodyRoles,
    body_records,
    clip_rows,
    environment_uniforms,
    media_center,
    shade_uniforms,
    view_uniforms,
)

#: Bits of the grid onto which software rasterizers move vertices.
SUBPIXEL_BITS = 8

SUM = {"OPAQUE": 0, "SPECTRAL": 0}
BODY = {"WITH_NORMAL": 0, "WITH_POSITION": 0}
RESOLVE = dict.fromkeys(
    ("AVERAGE", "COMPACT", "EMISSION", "FALLBACK", "MAP", "OPAQUE", "ORDERED", "SEEN_KIND", "SEEN_MAP", "SPECTRAL")
    + ("SURFACES", "UNLIT"),
    0,
) | {"ACCUMULATED": 1}


@dataclass(frozen=True)
class Host:
    """One closed body before a camera.

    Attributes
    ----------
    offsets : (n, 3) float32
        Vertices from the center of the mesh.
    faces : (m, 3) uint32
    blocks : dict of str to bytes
        Uniform blocks, matrices row by row.
    """

    scene: tl.Scene
    size: tuple[int, int]
    offsets: np.ndarray
    faces: np.ndarray
    blocks: Mapping[str, bytes]

    @classmethod
    def of(cls, mesh: tl.Mesh, size: tuple[int, int]) -> Host:
        """Mesh that absorbs, framed by its camera."""
        medium = tl.Medium(absorption=np.array([1.0, 2.0, 4.0]) / mesh.diagonal)
        scene = tl.Scene([tl.Object(mesh, medium)], tl.Camera.framing(mesh.vertices, size))
        placed, view = PlacedScene.of(scene), SampleView(scene.camera, size)
        counts = face_counts(scene, SUBPIXEL_BITS)
        roles = BodyRoles(True, np.zeros(1), counts, np.zeros(1, np.intp))
        body = body_records(placed, roles, media_center(scene))
        body["clip_from_offset"] = clip_rows(placed, view)
        blocks = {
            "Body": body.tobytes(),
            "View": view_uniforms(view, placed),
            "Shade": shade_uniforms(scene, Balance.of(placed, tl.SignedDepth(), counts)),
            "Environment": environment_uniforms(scene.environment),
        }
        offsets = (mesh.vertices - mesh.center).astype(np.float32)
        return cls(scene, size, offsets, mesh.faces.astype(np.uint32), blocks)

    def by_columns(self, name: str, *, upside_down: bool = False) -> bytes:
        """Block with its matrices column by column, and the picture with its first row at the bottom."""
        record = np.frombuffer(self.blocks[name], BLOCKS[name].dtype).copy()
        for field in record.dtype.names or ():
            if record[field].shape[1:] == (4, 4):
                if upside_down and field == "clip_from_offset":
                    record[field][:, 1] *= -1.0
                record[field] = record[field].transpose(0, 2, 1)
        return record.tobytes()

    def check(self, thickness: np.ndarray, flags: np.ndarray) -> None:
        """Fail unless a picture's thickness and its flags (1: covered, 2: valid) are right.

        The bars are those of the renderer itself (tests/gpu/test_accuracy.py).
        """
        truth = references.render(self.scene, self.size)
        inside = interior(references.hit_counts(self.scene, self.size)) & (truth.thickness > 0)
        errors = np.abs(thickness.astype(np.float64) - truth.thickness)[inside] / self.scene.diagonal
        covered, valid = flags.astype(int) & 1 != 0, flags.astype(int) & 2 != 0
        print(f"{inside.sum()} pixels, median {np.median(errors):.2g}, p99.9 {np.quantile(errors, 0.999):.2g}")
        assert valid.all()
        assert (covered != truth.coverage).mean() <= 3e-4
        assert inside.mean() > 0.05
        assert np.median(errors) <= 1e-7
        assert np.quantile(errors, 0.999) <= 1e-5
