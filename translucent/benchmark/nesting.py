"""Nested bodies for Mitsuba, which has no priorities: each interface once, with the media on both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from translucent.arrays import Array
from translucent.files.paths import make_folder
from translucent.interop.mitsuba import SAMPLES, beyond_mitsuba, to_mitsuba, units_per_metre
from translucent.scene.scene import Object, Scene


def mitsuba_scene(
    made: Scene, size: tuple[int, int], folder: Path | None = None, samples: int = SAMPLES
) -> dict[str, Any]:
    """Dictionary of a scene for ``mitsuba.load_dict``, with nested bodies where they overlap by priority.

    Parameters
    ----------
    made : Scene
    size : (int, int)
        Width and height in pixels.
    folder : Path, optional
        Where meshes and pictures are written.
    samples : int
        Paths of each pixel.

    Raises
    ------
    InputError
        If Mitsuba has no words for something in the scene.
    """
    if made.overlap != "priority":
        return to_mitsuba(made, size, folder, samples=samples)
    return _nested(made, size, folder, samples)


def lacking_in_mitsuba(made: Scene) -> str:
    """Name the feature of a scene that Mitsuba cannot represent; empty if Mitsuba represents all features."""
    return next((found for part in _parts(made) for found, _ in beyond_mitsuba(part)), "")


def _parts(made: Scene) -> list[Scene]:
    """Scenes of one body each where bodies overlap by priority; else the scene."""
    return [replace(made, objects=[body]) for body in made.bodies] if made.overlap == "priority" else [made]


def _nested(made: Scene, size: tuple[int, int], folder: Path | None, samples: int) -> dict[str, Any]:
    """Bodies in each other for Mitsuba: each interface once, with the medium on either side of it.

    A face belongs to its body where that body has the highest priority of all just behind the face, and not just
    before it. `to_mitsuba` describes the rest of the scene, and each body by itself.
    """
    bodies, parts = made.bodies, _parts(made)
    alone = []
    for i, part in enumerate(parts):
        place = None if folder is None else folder / f"body-{i}"
        if place is not None:
            make_folder(place)
        alone.append(to_mitsuba(part, size, place, samples=samples))
    units = np.array([units_per_metre(part) for part in parts])
    larger = units.min() / units
    described = dict(alone[int(units.argmin())])
    del described["object_0"]
    for one, factor in zip(alone, larger, strict=True):
        one["object_0"]["interior"]["scale"] /= factor
    ranks = np.array([body.priority for body in bodies] + [-np.inf])
    away = 1e-4 * made.diagonal
    for i, body in enumerate(bodies):
        corners = body.mesh.vertices[body.mesh.faces] @ body.matrix[:3, :3].T + body.matrix[:3, 3]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals *= away / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        middle = corners.mean(axis=1)
        before, behind = (_strongest(bodies, middle + side * normals) for side in (1.0, -1.0))
        path = Path(alone[i]["object_0"]["filename"])
        header, data = path.read_bytes().split(b"end_header\n", 1)
        vertices = np.frombuffer(data, np.dtype("<f4"), 18 * len(corners)).reshape(-1, 3, 6).copy()
        vertices[..., :3] *= larger[i]
        for other in np.unique(before):
            kept = (behind == i) & (before == other) & (ranks[before] < body.priority)
            if not kept.any():
                continue
            shell = path.with_name(f"{i}-{other}.ply")
            count = int(kept.sum())
            faces = np.zeros(count, np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
            faces["count"], faces["corners"] = 3, np.arange(3 * count).reshape(-1, 3)
            text = header.replace(b"vertex %d\n" % (3 * len(corners)), b"vertex %d\n" % (3 * count))
            text = text.replace(b"face %d\n" % len(corners), b"face %d\n" % count)
            shell.write_bytes(text + b"end_header\n" + vertices[kept].tobytes() + faces.tobytes())
            shape = {**alone[i]["object_0"], "filename": str(shell)}
            if other < len(bodies):
                outside = bodies[other].medium
                shape["bsdf"] = {**shape["bsdf"], "ext_ior": float(outside.ior)}
                shape["exterior"] = alone[other]["object_0"]["interior"]
            described[f"interface_{i}_{other}"] = shape
    return described


def _strongest(bodies: Sequence[Object], points: Array) -> npt.NDArray[np.int64]:
    """Index of the body with the highest priority at each point; the number of bodies where there is none."""
    found = np.full(len(points), len(bodies), np.int64)
    for i in sorted(range(len(bodies)), key=lambda i: bodies[i].priority):
        mesh, matrix = bodies[i].mesh, np.linalg.inv(bodies[i].matrix)
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        found[solid.contains(points @ matrix[:3, :3].T + matrix[:3, 3])] = i
    return found
