"""Random meshes, sound and broken, drawn by every method and compared with the float64 reference.

``python tools/fuzz_validity.py [RUNS] [SEED] [--backend NAME]`` renders RUNS pictures (2000) of closed, open, flipped
and self-crossing meshes. A pixel fails if it is valid, lies off the edges of surfaces and faces, and is wrong: by more
than 1e-3 of the scene's diagonal in thickness, by more than 1e-2 in transmittance, or since its ray crosses a surface
inside out, for more than 1e-3 of the diagonal, or unequally often in and out. Prints each picture with failures, and at
the end how many pixels were compared, failed, and were marked on closed and sound meshes, where none should be. Exits
with 1 if a pixel failed, or if more than 0.1 % of the covered pixels of sound meshes were marked.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import translucent as tl
from translucent.assets import mesh_path
from translucent.errors import InputError
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.reference.hits import Hits, PictureGrid, camera_vertices
from translucent.reference.intervals import body_intervals, origin_windings, unbalanced
from translucent.reference.render import scene_hits

SIZE = (48, 36)

#: Largest errors of a pixel that is valid: of its thickness, as a share of the diagonal, and of its transmittance.
THICKNESS, TRANSMITTANCE = 1e-3, 1e-2

#: Largest share of the covered pixels of closed, sound meshes that may be marked.
MARKED = 1e-3

#: Pixels between an edge and a pixel center that a rasterizer may put on either side of it: two steps of its grid.
NEAR_EDGE = 1 / 128

METHODS: tuple[tl.Method | None, ...] = (
    None,
    tl.SignedDepth(),
    tl.FragmentLists(),
    tl.DepthPeeling(),
    tl.DepthPeeling(order="front-to-back"),
    tl.KBuffer(k=16),
    tl.BackFaceDepth(),
)

Random = np.random.Generator
Points = npt.NDArray[np.float64]


@dataclass
class Counts:
    """Pixels of all pictures so far."""

    pictures: int = 0
    compared: int = 0
    failed: int = 0
    sound: int = 0
    marked: int = 0
    refused: int = 0


def closed(random: Random) -> tl.Mesh:
    """A mesh without defects."""
    kind = random.integers(6)
    if kind == 0:
        size = 10.0 ** random.uniform(-2.5, 0, 3)
        return Box(low=tuple(-size / 2), high=tuple(size / 2)).tessellate()
    if kind == 1:
        return Sphere(radius=random.uniform(0.2, 1)).tessellate(int(random.integers(4, 24)))
    if kind == 2:
        return Torus(major=1.0, minor=random.uniform(0.05, 0.6)).tessellate(int(random.integers(6, 24)))
    if kind == 3:
        inner = Sphere(radius=random.uniform(0.1, 0.8)).tessellate(12)
        return joined(Sphere().tessellate(16), tl.Mesh(inner.vertices, inner.faces[:, ::-1]))
    if kind == 4:
        return joined(*(moved(Sphere(radius=0.5).tessellate(8), random.uniform(-0.6, 0.6, 3)) for _ in range(3)))
    mesh = tl.load_mesh(mesh_path(str(random.choice(["amber", "soap", "bangle"]))))
    return tl.Mesh((mesh.vertices - mesh.center) / mesh.diagonal * 2, mesh.faces)


def opened(random: Random) -> tl.Mesh:
    """A mesh that lacks faces."""
    mesh = closed(random)
    gone = random.random(len(mesh.faces)) < random.choice([0.02, 0.1, 0.5])
    gone[random.integers(len(gone))] = True
    return tl.Mesh(mesh.vertices, mesh.faces[~gone]) if not gone.all() else mesh


def flipped(random: Random) -> tl.Mesh:
    """A mesh some faces of which look the wrong way: any, those of a box, or all of a part."""
    mesh = closed(random)
    kind = random.integers(4)
    if kind == 0:
        wrong = random.random(len(mesh.faces)) < random.choice([0.02, 0.2])
    elif kind == 1:
        centers = mesh.vertices[mesh.faces].mean(axis=1)
        axis, low = random.integers(3), random.uniform(-0.6, 0.4) * mesh.diagonal / 2
        wrong = (centers[:, axis] > low) & (centers[:, axis] < low + random.uniform(0.05, 0.3) * mesh.diagonal)
    elif kind == 2:
        part = closed(random)
        return joined(mesh, moved(tl.Mesh(part.vertices, part.faces[:, ::-1]), random.uniform(-1.5, 1.5, 3)))
    else:
        return joined(opened(random), flat_inside_out(random))
    return tl.Mesh(mesh.vertices, np.where(wrong[:, None], mesh.faces[:, ::-1], mesh.faces))


def flat_inside_out(random: Random) -> tl.Mesh:
    """A thin box inside out, beside whatever else there is."""
    box = Box.slab((1.0, 1.0), random.choice([0.02, 0.1])).tessellate()
    return moved(tl.Mesh(box.vertices, box.faces[:, ::-1]), random.uniform(-1.5, 1.5, 3))


def window(random: Random) -> tl.Mesh:
    """A plate with a window in both of its sides that is wound backwards, and meets it with T-junctions."""
    half = random.choice([0.003, 0.02])
    low, high = sorted(random.uniform(-0.4, 0.4, 2))
    frame = [(-0.5, -0.5, 0.5, low), (-0.5, high, 0.5, 0.5), (-0.5, low, low, high), (high, low, 0.5, high)]
    parts = []
    steps = np.linspace(low, high, 5)
    cells = [(a, c, b, d) for a, b in itertools.pairwise(steps) for c, d in itertools.pairwise(steps)]
    for x0, y0, x1, y1 in frame:
        parts += [sheet(x0, y0, x1, y1, half, True), sheet(x0, y0, x1, y1, -half, False)]
    for x0, y0, x1, y1 in cells:
        parts += [sheet(x0, y0, x1, y1, half, False), sheet(x0, y0, x1, y1, -half, True)]
    return joined(*parts)


def sheet(x0: float, y0: float, x1: float, y1: float, z: float, up: bool) -> tl.Mesh:
    """Two triangles."""
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return tl.Mesh(np.array(corners), faces if up else faces[:, ::-1])


def crossing(random: Random) -> tl.Mesh:
    """A closed mesh that crosses itself, often with a lobe inside out."""
    mesh = closed(random)
    v = mesh.vertices.copy()
    kind = random.integers(3)
    if kind == 0:
        v[:, 0] *= -(v[:, 2] + random.uniform(-0.3, 0.3))
    elif kind == 1:
        v += random.normal(0, 10.0 ** random.uniform(-3, -0.7), v.shape)
    else:
        angle = random.uniform(1, 6) * v[:, 2]
        c, s = np.cos(angle), np.sin(angle)
        v[:, :2] = np.column_stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1]])
        v[:, 0] *= np.where(random.random() < 0.5, v[:, 1], 1.0)
    return tl.Mesh(v, mesh.faces)


MESHES: dict[str, Callable[[Random], tl.Mesh]] = {
    "closed": closed,
    "open": opened,
    "flipped": flipped,
    "window": window,
    "crossing": crossing,
}


def joined(*meshes: tl.Mesh) -> tl.Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return tl.Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def moved(mesh: tl.Mesh, by: Points) -> tl.Mesh:
    """A mesh at another place."""
    return tl.Mesh(mesh.vertices + by, mesh.faces)


def random_scene(random: Random) -> tuple[tl.Scene, str]:
    """One or two bodies before a camera, and what kind the first is."""
    kind = str(random.choice(list(MESHES)))
    mesh = MESHES[kind](random)
    medium = tl.Medium(absorption=tuple(random.uniform(0.2, 3, 3)))
    bodies = [tl.Object(mesh, medium)]
    overlap = random.choice(["add", "add", "add", "union", "priority"])
    if random.random() < 0.3:
        other = tl.Medium(absorption=tuple(random.uniform(0.2, 3, 3))) if random.random() < 0.5 else medium
        bodies.append(tl.Object(moved(closed(random), random.uniform(-1, 1, 3)), other, priority=1))
    center, reach = mesh.center, mesh.diagonal
    direction = random.normal(size=3)
    eye = center + direction / np.linalg.norm(direction) * reach * random.choice([0.1, 0.8, 1.5, 30])
    far = np.linalg.norm(eye - center) > 10 * reach
    target = center + random.normal(0, 0.05, 3) * reach
    if random.random() < 0.2:
        camera = tl.Camera.orthographic(eye, target, height=reach)
    else:
        camera = tl.Camera.look_at(eye, target, fov_y=2.5 if far else 60)
    return tl.Scene(bodies, camera, overlap=str(overlap)), kind


def on_edges(scene: tl.Scene, hits: list[Hits]) -> npt.NDArray[np.bool_]:
    """Pixels whose centers are so near to an edge of a face that a rasterizer may see the face beyond it."""
    found = np.zeros(SIZE[0] * SIZE[1], dtype=bool)
    grid = PictureGrid.of(scene.camera, SIZE)
    for body, line in zip(scene.objects, hits, strict=True):
        points = camera_vertices(body.mesh, body.matrix, scene.camera)
        weight = points[:, 2] if scene.camera.fov_y is not None else np.ones(len(points))
        with np.errstate(all="ignore"):
            seen = grid.pixels(points[:, :2], weight) / weight[:, None]
            corners = seen[body.mesh.faces[line.face]]
            a = corners - np.column_stack([line.pixel % SIZE[0], line.pixel // SIZE[0]])[:, None]
            b = np.roll(a, -1, axis=1)
            across = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / np.linalg.norm(b - a, axis=2)
        found[line.pixel[~(across.min(axis=1) > NEAR_EDGE)]] = True
    return found.reshape(SIZE[::-1])


def defects(scene: tl.Scene, hits: list[Hits]) -> npt.NDArray[np.bool_]:
    """Pixels on whose rays a surface is inside out for longer than a valid pixel may be wrong, or does not balance."""
    pixels = SIZE[0] * SIZE[1]
    end = np.full(pixels, np.inf)
    found = np.zeros(pixels, dtype=bool)
    for body, line in zip(scene.objects, hits, strict=True):
        origin = origin_windings(body, line, scene.camera, pixels)
        ahead = line.before(end)
        intervals = body_intervals(ahead, origin, end)
        found |= unbalanced(ahead, origin, end)
        below = np.bincount(intervals.pixel, np.minimum(intervals.thickness, 0.0), pixels)
        found |= below < -THICKNESS * scene.diagonal
    return found.reshape(SIZE[::-1])


def judge(renderer: tl.Renderer, scene: tl.Scene, method: tl.Method | None, sound: bool, counts: Counts) -> str:
    """Draw and compare; returns what is wrong, or nothing."""
    try:
        frame = renderer.render(scene, SIZE, method)
    except InputError:  # such as back-face depth of two media
        counts.refused += 1
        return ""
    truth = tl.reference.render(scene, SIZE)
    hits = scene_hits(scene, SIZE)
    # With the surfaces behind the origins: an orthographic picture counts them, too.
    counted = np.sum([np.bincount(line.pixel, minlength=SIZE[0] * SIZE[1]) for line in hits], axis=0)
    inside = tl.interior(counted.reshape(SIZE[::-1])) & ~on_edges(scene, hits)
    kept = frame.valid & inside
    wrong = np.abs(frame.thickness - truth.thickness) > THICKNESS * scene.diagonal
    wrong |= (np.abs(frame.transmittance - truth.transmittance) > TRANSMITTANCE).any(axis=2)
    bad = kept & (defects(scene, hits) | (truth.valid & wrong))
    counts.pictures += 1
    counts.compared += int(kept.sum())
    counts.failed += int(bad.sum())
    if sound and not isinstance(method, tl.BackFaceDepth):
        counts.sound += int(truth.coverage.sum())
        counts.marked += int((~frame.valid).sum())
    return f"{bad.sum()} pixels of {kept.sum()} valid and wrong, first {np.argwhere(bad)[0]}" if bad.any() else ""


def main() -> int:
    """Render until the runs are used up; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=int, nargs="?", default=2000)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--backend")
    parser.add_argument("--method", type=int, help="only this one, by its place in the list of methods")
    arguments = parser.parse_args()
    counts, kinds = Counts(), Counter[str]()
    warnings.simplefilter("ignore")
    with tl.Renderer(backend=arguments.backend) as renderer:
        for run in range(arguments.runs):
            random = np.random.default_rng((arguments.seed, run))
            scene, kind = random_scene(random)
            chosen = random.integers(len(METHODS))
            method = METHODS[chosen if arguments.method is None else arguments.method]
            sound = all(body.mesh.diagnosis.solid for body in scene.objects) and not any(
                body.mesh.diagnosis.inside_out_parts for body in scene.objects
            )
            if said := judge(renderer, scene, method, sound and kind == "closed", counts):
                kinds[f"{kind}, {type(method).__name__}"] += 1
                print(f"seed {arguments.seed}, run {run}: {kind}, {method}, {scene.overlap}: {said}", flush=True)
    print(counts, dict(kinds))
    return int(counts.failed > 0 or counts.marked > MARKED * counts.sound)


if __name__ == "__main__":
    sys.exit(main())
