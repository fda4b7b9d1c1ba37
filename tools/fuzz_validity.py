"""Random meshes, sound and broken, with and without opaque objects, drawn by every method and held against the truth.

``python tools/fuzz_validity.py [RUNS] [SEED] [--backend NAME]`` renders RUNS pictures (2000) of closed, open, flipped
and self-crossing meshes, alone, on grounds and stages, with walls inside and behind, and before backdrops; by all
methods, the renderer without OpenGL and the reference. The truth is that of tools/ray_truth.py, which shares no code
with them. A pixel fails if it is valid, lies off the edges of surfaces and faces, and is wrong: by more than 1e-3 of
the bodies' diagonal in thickness, or by more than 1e-2 in transmittance; or since its ray crosses a surface inside out,
for more than 1e-3 of the diagonal, or unequally often in and out, unless all that is open lies behind an opaque
surface; or since its thickness is not that of the mesh before faces were taken out or turned, and the ray passes one of
these. Prints each picture with failures, and at the end how many pixels were compared, failed, and were marked on
closed and sound meshes, where none should be. Exits with 1 if a pixel failed, or if more than 0.1 % of the covered
pixels of sound meshes were marked.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from ray_truth import Damaged, Truth

import translucent as tl
from translucent.assets import mesh_path
from translucent.errors import InputError
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.gpu.context import DriverFaultError

SIZE = (48, 36)

#: Largest errors of a pixel that is valid: of its thickness, as a share of the diagonal, and of its transmittance.
THICKNESS, TRANSMITTANCE = 1e-3, 1e-2

#: Largest share of the covered pixels of closed, sound meshes that may be marked.
MARKED = 1e-3

#: Pixels between an edge and a pixel center that a rasterizer may put on either side of it: two steps of its grid.
NEAR_EDGE = 1 / 128

#: Methods of the renderer with OpenGL, and what else draws.
METHODS: tuple[tl.Method | Literal["cpu", "reference"] | None, ...] = (
    None,
    tl.SignedDepth(),
    tl.FragmentLists(),
    tl.DepthPeeling(),
    tl.DepthPeeling(order="front-to-back"),
    tl.KBuffer(k=16),
    tl.BackFaceDepth(),
    tl.RayMarched(steps=8),
    "cpu",
    "reference",
)

Random = np.random.Generator
Points = npt.NDArray[np.float64]
Renderers = dict[str, tl.Renderer]


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


def opened(random: Random) -> Damaged:
    """A mesh that lacks faces."""
    mesh = closed(random)
    gone = random.random(len(mesh.faces)) < random.choice([0.02, 0.1, 0.5])
    gone[random.integers(len(gone))] = True
    if random.random() < 0.3:  # all of a part of it
        centers = mesh.vertices[mesh.faces].mean(axis=1)
        gone = centers @ random.normal(size=3) > 0.2 * mesh.diagonal
    if gone.all() or not gone.any():
        return Damaged(mesh)
    return Damaged(tl.Mesh(mesh.vertices, mesh.faces[~gone]), mesh, gone)


def flipped(random: Random) -> Damaged:
    """A mesh with faces that look the wrong way: any, those of a box, or all of a part."""
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
        return Damaged(joined(mesh, moved(tl.Mesh(part.vertices, part.faces[:, ::-1]), random.uniform(-1.5, 1.5, 3))))
    else:
        return Damaged(joined(opened(random).mesh, flat_inside_out(random)))
    return Damaged(tl.Mesh(mesh.vertices, np.where(wrong[:, None], mesh.faces[:, ::-1], mesh.faces)), mesh, wrong)


def flat_inside_out(random: Random) -> tl.Mesh:
    """A thin box inside out, beside whatever else there is."""
    box = Box.slab((1.0, 1.0), random.choice([0.02, 0.1])).tessellate()
    return moved(tl.Mesh(box.vertices, box.faces[:, ::-1]), random.uniform(-1.5, 1.5, 3))


def window(random: Random) -> Damaged:
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
    return Damaged(joined(*parts))


def sheet(x0: float, y0: float, x1: float, y1: float, z: float, up: bool) -> tl.Mesh:
    """Two triangles."""
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return tl.Mesh(np.array(corners), faces if up else faces[:, ::-1])


def crossing(random: Random) -> Damaged:
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
    return Damaged(tl.Mesh(v, mesh.faces))


MESHES: dict[str, Callable[[Random], Damaged]] = {
    "closed": lambda random: Damaged(closed(random)),
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


@dataclass(frozen=True, eq=False)
class Picture:
    """What is drawn: bodies, what stands around them, and what the first of them was."""

    scene: tl.Scene
    damaged: Damaged
    mesh: str
    place: str
    backdrop: tl.Backdrop | None = None

    def __str__(self) -> str:
        return f"{self.mesh}, {self.place}, {self.scene.overlap}, ior {self.scene.bodies[0].medium.ior}"


def random_picture(random: Random) -> Picture:
    """One or two bodies before a camera, and often something opaque."""
    kind = str(random.choice(list(MESHES)))
    damaged = MESHES[kind](random)
    mesh = damaged.mesh
    ior = 1.5 if random.random() < 0.2 else 1.0
    medium = tl.Medium(absorption=tuple(random.uniform(0.2, 3, 3)), ior=ior)
    bodies = [tl.Object(mesh, medium)]
    overlap = random.choice(["add", "add", "add", "union", "priority"])
    if random.random() < 0.3:
        other = medium
        if random.random() < 0.5:
            other = dataclasses.replace(medium, absorption=tuple(random.uniform(0.2, 3, 3)))
        bodies.append(tl.Object(moved(closed(random), random.uniform(-1, 1, 3)), other, priority=1))
    place = str(random.choice(list(PLACES)))
    center, reach = mesh.center, mesh.diagonal
    direction = random.normal(size=3)
    if place in ("ground", "stage"):
        direction[1] = abs(direction[1]) + 0.05
    eye = center + direction / np.linalg.norm(direction) * reach * random.choice([0.1, 0.8, 1.5, 30])
    far = np.linalg.norm(eye - center) > 10 * reach
    target = center + random.normal(0, 0.05, 3) * reach
    if random.random() < 0.2:
        camera = tl.Camera.orthographic(eye, target, height=reach)
    else:
        camera = tl.Camera.look_at(eye, target, fov_y=2.5 if far else 60)
    picture = Picture(tl.Scene(bodies, camera, overlap=str(overlap)), damaged, kind, place)
    return PLACES[place](picture, random)


def with_opaque(picture: Picture, mesh: tl.Mesh) -> Picture:
    """The picture with an opaque object."""
    objects = [*picture.scene.objects, tl.Object(mesh)]
    return dataclasses.replace(picture, scene=dataclasses.replace(picture.scene, objects=objects))


def on_ground(picture: Picture, random: Random) -> Picture:
    """On a ground, or sunk into it."""
    low, high = picture.scene.bounds
    height = low[1] + (high[1] - low[1]) * random.choice([-1e-3, random.uniform(0, 0.6)])
    half = random.choice([1.0, 8.0]) * float(np.linalg.norm(high - low))
    plate = sheet(-half, -half, half, half, 0.0, True)
    middle = np.array([(low[0] + high[0]) / 2, height, (low[2] + high[2]) / 2])
    return with_opaque(picture, tl.Mesh(plate.vertices[:, [1, 2, 0]] + middle, plate.faces))


def with_wall(picture: Picture, random: Random, *, behind: bool = False) -> Picture:
    """With a plate or a box inside, or a plate behind that looks at the camera."""
    low, high = picture.scene.bounds
    size, center = float(np.linalg.norm(high - low)), (low + high) / 2
    camera = picture.scene.camera
    if behind:
        half = size * random.uniform(0.5, 2)
        plate = sheet(-half, -half, half, half, -size * random.uniform(0.3, 1), True)
        return with_opaque(picture, tl.Mesh(plate.vertices @ camera.pose[:3, :3].T + center, plate.faces))
    if random.random() < 0.5:
        lengths = size * random.uniform(0.05, 0.6, 3)
        inner = Box(low=tuple(-lengths / 2), high=tuple(lengths / 2)).tessellate()
    else:
        half = size * random.uniform(0.1, 1)
        inner = sheet(-half, -half, half, half, 0.0, True)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    center = center + random.normal(0, 0.15, 3) * size
    return with_opaque(picture, tl.Mesh(inner.vertices @ turn.T + center, inner.faces))


def before_backdrop(picture: Picture, random: Random) -> Picture:
    """Before a picture drawn elsewhere, through the bodies or behind them."""
    low, high = picture.scene.bounds
    camera = picture.scene.camera
    size = float(np.linalg.norm(high - low))
    ahead = float(((low + high) / 2 - camera.eye) @ camera.forward) + size * random.uniform(-0.4, 0.8)
    rows = np.linspace(0.8, 1.2, SIZE[1])[:, None] ** random.choice([0.0, 1.0])
    depth = max(ahead, 0.02 * size) * rows * np.ones(SIZE)[:, :1].T
    depth[:, : random.integers(SIZE[0] // 2)] = np.inf
    return dataclasses.replace(picture, backdrop=tl.Backdrop(np.full((*depth.shape, 3), 0.5), depth))


#: What stands around bodies, and how often.
PLACES: dict[str, Callable[[Picture, Random], Picture]] = {
    "alone": lambda picture, random: picture,
    "ground": on_ground,
    "wall inside": with_wall,
    "wall behind": lambda picture, random: with_wall(picture, random, behind=True),
    "stage": lambda picture, random: dataclasses.replace(picture, scene=tl.staged(picture.scene)),
    "backdrop": before_backdrop,
}


def draw(renderers: Renderers, picture: Picture, method: tl.Method | str | None) -> tl.Frame:
    """The frame of a picture."""
    if not isinstance(method, str):
        return renderers["gl"].render(picture.scene, SIZE, method, backdrop=picture.backdrop)
    if picture.backdrop is not None:
        raise InputError(f"{method} before a backdrop", "it draws its own", "leave it out")
    # What is asked for is which pixels are trusted, and not how grounds are lit.
    scene = dataclasses.replace(picture.scene, lights=(), environment_shadows=0)
    return renderers["cpu"].render(scene, SIZE) if method == "cpu" else tl.reference.render(scene, SIZE)


def judge(renderers: Renderers, picture: Picture, method: tl.Method | str | None, counts: Counts) -> str:
    """Draw and compare; returns what is wrong, or nothing."""
    try:
        frame = draw(renderers, picture, method)
    except (InputError, DriverFaultError):  # such as back-face depth of two media
        counts.refused += 1
        return ""
    scene = picture.scene
    boxes = scene.boxes[scene.filled]
    diagonal = float(np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)))
    end = np.full(SIZE[::-1], np.inf) if picture.backdrop is None else picture.backdrop.depth
    truth = Truth.of(scene, SIZE, picture.damaged, end, THICKNESS * diagonal, NEAR_EDGE)
    kept = frame.valid & tl.interior(truth.counted) & ~truth.unclear & np.isfinite(truth.optical_depth).all(axis=2)
    wrong = np.abs(frame.thickness - truth.thickness) > THICKNESS * diagonal
    wrong |= (np.abs(frame.transmittance - np.exp(-truth.optical_depth)) > TRANSMITTANCE).any(axis=2)
    if scene.overlap == "add":
        wrong |= np.abs(frame.thickness - truth.intact_thickness) > THICKNESS * diagonal
    bad = kept & (truth.broken | wrong)
    counts.pictures += 1
    counts.compared += int(kept.sum())
    counts.failed += int(bad.sum())
    solid = all(body.mesh.diagnosis.sound for body in scene.bodies)
    if solid and picture.mesh == "closed" and not isinstance(method, tl.BackFaceDepth):
        counts.sound += int((truth.thickness > 0).sum())
        counts.marked += int((~frame.valid).sum())
    return f"{bad.sum()} pixels of {kept.sum()} valid and wrong, first {np.argwhere(bad)[0]}" if bad.any() else ""


def main() -> int:
    """Render until the runs are used up; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=int, nargs="?", default=2000)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--first", type=int, default=0, help="the first run, to do them in portions")
    parser.add_argument("--backend")
    parser.add_argument("--method", type=int, help="only this one, by its place in the list of methods")
    arguments = parser.parse_args()
    counts, kinds = Counts(), Counter[str]()
    warnings.simplefilter("ignore")
    with tl.Renderer(backend=arguments.backend) as gl, tl.Renderer(backend="cpu") as cpu:
        for run in range(arguments.first, arguments.runs):
            random = np.random.default_rng((arguments.seed, run))
            picture = random_picture(random)
            chosen = random.integers(len(METHODS))
            method = METHODS[chosen if arguments.method is None else arguments.method]
            if said := judge({"gl": gl, "cpu": cpu}, picture, method, counts):
                name = method if isinstance(method, str) else type(method).__name__
                kinds[f"{picture.mesh}, {picture.place}, {name}"] += 1
                print(f"seed {arguments.seed}, run {run}: {picture}, {method}: {said}", flush=True)
    print(counts, dict(kinds))
    return int(counts.failed > 0 or counts.marked > MARKED * counts.sound)


if __name__ == "__main__":
    sys.exit(main())
