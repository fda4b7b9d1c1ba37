"""Hard cases of views: the eye inside, far away, near a surface; wide angles, odd sizes, units, opaque objects."""

from __future__ import annotations

import numpy as np

from translucent import reference
from translucent.bench.hard.cases import SIZE, Checks, Hard
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.media.medium import Medium
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import framing, showcase

GLASS = Medium(absorption=(0.5, 1.0, 2.0))


def _torus() -> Mesh:
    return Torus().tessellate(64)


def _eyes(checks: Checks) -> None:
    ball, core = Sphere().tessellate(48), Sphere(radius=0.5).tessellate(48)
    one, nested = [Object(ball, GLASS)], [Object(ball, GLASS), Object(core, Medium(absorption=(2, 1, 1)))]
    checks.picture("inside one", Scene(one, Camera.look_at((0.2, 0.1, 0.6), (1, 0.3, 0), fov_y=70)))
    checks.picture("inside two", Scene(nested, Camera.look_at((0.1, 0.1, 0.2), (1, 0.3, 0), fov_y=70)))
    eye = ball.vertices[ball.faces[900]].mean(axis=0)
    inwards = Scene(one, Camera.look_at(eye, (0, 0, 0), fov_y=60))
    frame, truth = checks.render(inwards), reference.render(inwards, SIZE)
    checks.holds("on a surface, inwards: no pixel marked", frame.valid.all())
    away = np.median(np.abs(frame.thickness - truth.thickness)) / inwards.diagonal
    checks.error("on a surface", away)


def _near_plane(checks: Checks) -> None:
    """An eye just before a wall: any near plane would cut it."""
    box = Object(Box((-1, -1, -1), (1, 1, 1)).tessellate(), GLASS)
    for gap in (1e-2, 1e-4, 1e-6):
        scene = Scene([box], Camera.look_at((0.1, 0.2, 1 + gap), (0, 0, 0), fov_y=80))
        checks.picture(f"{gap:g} m before the wall", scene)


def _far(checks: Checks) -> None:
    mesh = _torus()
    for diameters in (1e2, 1e4):
        away = np.array((0.6, 0.5, 0.8)) / np.linalg.norm((0.6, 0.5, 0.8))
        fov = float(2 * np.degrees(np.arctan(0.5 / diameters)))
        camera = Camera.look_at(away * diameters * mesh.diagonal, (0, 0, 0), fov_y=fov)
        checks.picture(f"{diameters:g} diameters", Scene([Object(mesh, GLASS)], camera))


def _slab(checks: Checks) -> None:
    thin = 1e-4
    scene = showcase(Box.slab(thickness=thin).tessellate(), GLASS, SIZE, stage="none")
    frame, truth = checks.render(scene), reference.render(scene, SIZE)
    checks.error("of its own thickness", checks.compared(frame, truth, scene).p999 / thin)
    checks.holds("no pixel marked", frame.valid.all())


def _elsewhere(checks: Checks) -> None:
    mesh = _torus()
    for offset in ((1e6, 0, 0), (-1e6, 1e6, 1e6)):
        matrix = np.eye(4)
        matrix[:3, 3] = offset
        body = Object(mesh, GLASS, matrix)
        checks.picture(f"at {offset} m", Scene([body], framing([body], SIZE)))


def _units(checks: Checks) -> None:
    mesh = _torus()
    for unit in (1e-6, 1e6):
        medium = Medium(absorption=np.array((0.5, 1.0, 2.0)) / unit)
        scaled = Mesh(mesh.vertices * unit, mesh.faces, name="torus")
        checks.picture(f"{unit:g} m", showcase(scaled, medium, SIZE, stage="none"))


def _angles(checks: Checks) -> None:
    """Corner pixels included: a wall so wide that it fills the picture."""
    wall = Box((-60, -60, -1.5), (60, 60, -1)).tessellate()
    for fov in (90.0, 150.0):
        scene = Scene([Object(wall, GLASS)], Camera.look_at((0, 0, 0), (0, 0, -1), fov_y=fov))
        frame, truth = checks.render(scene), reference.render(scene, SIZE)
        relative = np.abs(frame.thickness / truth.thickness - 1)
        checks.error(f"{fov:g} degrees", relative.max())
        checks.holds("corners are longer than the middle", frame.thickness[0, 0] > frame.thickness[48, 48])


def _opaque(checks: Checks) -> None:
    ball, wall = Sphere().tessellate(48), Box((-0.5, -0.5, -0.05), (0.5, 0.5, 0.05)).tessellate()
    camera = Camera.look_at((0.3, 0.4, 4), (0, 0, 0), fov_y=40)
    for name, z in (("in front", 1.5), ("inside", 0.1), ("behind", -1.6)):
        matrix = np.eye(4)
        matrix[2, 3] = z
        checks.picture(name, Scene([Object(ball, GLASS), Object(wall, None, matrix)], camera))
    both = Scene([Object(ball, GLASS), Object(ball, None)], camera)
    frame = checks.render(both)
    checks.error("coincident: nothing before it", frame.thickness.max() / both.diagonal)


def _sizes(checks: Checks) -> None:
    """Sizes of pictures that a body fills: few pixels suffer from the grid of 1/256 pixel that rasterizers draw on."""
    wedge = Box((-6000, -1, -1), (6000, 1, 1)).tessellate()
    camera = Camera.orthographic((0, 1, 5), (0, 0.05, 0), height=1.0)
    scene = Scene([Object(wedge, GLASS)], camera)
    for size in ((1, 1), (1, 33), (33, 1), (8192, 1)):
        frame, truth = checks.render(scene, size), reference.render(scene, size)
        checks.holds(f"{size[0]} x {size[1]}: its shape, no pixel marked", frame.thickness.shape == size[::-1])
        checks.holds("no pixel marked", frame.valid.all())
        checks.error("error", np.abs(frame.thickness - truth.thickness).max() / scene.diagonal)


def _on_pixels(checks: Checks) -> None:
    """A grid of vertices on pixel centers, and edges along their rows and columns, in front of and behind a box."""
    count = 16
    camera = Camera.orthographic((0, 0, 5), (0, 0, 0), height=float(count))
    x, y = np.meshgrid(np.arange(-6, 7) + 0.5, np.arange(-6, 7) + 0.5, indexing="ij")
    n = len(x)
    top = np.stack([x.ravel(), y.ravel(), np.ones(n * n)], axis=1)
    bottom = top * (1, 1, -1)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    a = (i * n + j).ravel()
    quads = np.stack([a, a + n, a + n + 1, a + 1], axis=1)
    edge = np.concatenate(
        [np.arange(n) * n, (n - 1) * n + np.arange(n), (np.arange(n) * n + n - 1)[::-1], np.arange(n)[::-1]]
    )
    rim = edge[np.concatenate([[True], np.diff(edge) != 0])][:-1]
    following = np.roll(rim, -1)
    sides = np.stack([rim, rim + n * n, following + n * n, following], axis=1)
    squares = np.concatenate([quads, quads[:, ::-1] + n * n, sides])
    faces = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    mesh = Mesh(np.concatenate([top, bottom]), faces, name="grid")
    checks.holds("the mesh is closed", mesh.diagnosis.solid)
    scene = Scene([Object(mesh, GLASS)], camera)
    frame = checks.render(scene, (count, count))
    inner = frame.thickness[3:-3, 3:-3]
    checks.error("thickness 2 in every pixel", np.abs(inner - 2).max() / scene.diagonal)
    checks.holds("no pixel counted twice or left out", frame.valid.all())


def _two_sizes(checks: Checks) -> None:
    large, small = Sphere().tessellate(64), Sphere(radius=1e-4).tessellate(48)
    matrix = np.eye(4)
    matrix[:3, 3] = (0, 0, 1.0 + 5e-4)
    scene = Scene(
        [Object(large, GLASS), Object(small, Medium(absorption=(5e3,) * 3), matrix)],
        Camera.look_at((0, 0, 1.0015), (0, 0, 0), fov_y=20),
    )
    frame, truth = checks.render(scene), reference.render(scene, SIZE)
    found = checks.compared(frame, truth, scene, "optical_depth")
    checks.error("optical depth behind a ball 10,000 times as small", found.p999)
    checks.holds("no pixel marked", frame.valid.all())


EXACTLY = "exact: 99.9 % of the pixels within a hundred roundings of float32"

CASES = (
    Hard("H05", "eye inside one body, inside nested ones, on a surface", EXACTLY, _eyes),
    Hard("H06", "near plane cuts the body", f"{EXACTLY}; there is none", _near_plane),
    Hard("H07", "body 10,000 diameters away", EXACTLY, _far),
    Hard(
        "H08",
        "slab of 1e-4 relative thickness",
        "exact: distances up to half of its width are rounded, 10,000 times its thickness",
        _slab,
        1e4 * 16 * float(np.finfo(np.float32).eps),
        "of its thickness",
    ),
    Hard("H09", "scene 1e6 m from the origin", EXACTLY, _elsewhere),
    Hard("H10", "units of 1e-6 m and 1e6 m", EXACTLY, _units),
    Hard(
        "H11",
        "90 and 150 degrees of view, corner pixels",
        f"{EXACTLY}, relative to each path",
        _angles,
        unit="relative",
    ),
    Hard("H19", "opaque object in front, inside, behind, coincident", EXACTLY, _opaque),
    Hard("H20", "frames of 1 x 1, 1 x N, 8192 wide", EXACTLY, _sizes),
    Hard("H21", "vertices on pixel centers, edges along pixel rows", f"{EXACTLY}; every face counts once", _on_pixels),
    Hard(
        "H22",
        "two bodies of very different size in one frame",
        "exact: optical depth within a hundred roundings of the large body's",
        _two_sizes,
        2 * 2.0 * 100 * float(np.finfo(np.float32).eps) / 2,
        "optical depth",
    ),
)
