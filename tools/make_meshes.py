"""Make the meshes in meshes/ and their README: ``python tools/make_meshes.py``. The same bytes on every run.

Every shape is a formula written here: surfaces of revolution, swept tubes, and implicit surfaces that marching cubes
turns into triangles. Shapes are modelled in centimetres, stand on or around y = 0 with y up, and are written in metres
as binary PLY with float32 positions and 16-bit indices.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere, SphericalShell, revolve

ROOT = Path(__file__).resolve().parents[1]
CENTIMETRE = 0.01

Array = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int32]
Point = tuple[float, float, float]
Field = Callable[[Array], Array]


@dataclass(frozen=True)
class Shape:
    """One file: its mesh in centimetres, and what the README says of it."""

    what: str
    how: str
    mesh: Mesh

    @property
    def size(self) -> Array:
        """(3,): extent along x, y and z in centimetres."""
        low, high = self.mesh.bounds
        return np.asarray(high - low)


# Implicit shapes: fields (..., 3) -> (...), negative inside, about the distance to the surface.


def ellipsoid(center: Point, radii: Point) -> Field:
    """Distance to an ellipsoid to first order: exact on the surface and in its gradient there."""

    def field(p: Array) -> Array:
        q = (p - np.array(center)) / np.array(radii)
        distance = np.linalg.norm(q, axis=-1)
        slope = np.linalg.norm(q / np.array(radii), axis=-1)
        return np.asarray(distance * (distance - 1.0) / np.maximum(slope, 1e-9))

    return field


def capsule(a: Point, b: Point, radius_a: float, radius_b: float) -> Field:
    """A limb from `a` to `b` whose radius changes evenly."""
    start, axis = np.array(a), np.array(b) - np.array(a)

    def field(p: Array) -> Array:
        share = np.clip((p - start) @ axis / (axis @ axis), 0.0, 1.0)
        gap = np.linalg.norm(p - start - share[..., None] * axis, axis=-1)
        return np.asarray(gap - (radius_a + share * (radius_b - radius_a)))

    return field


def both_sides(part: Field) -> Field:
    """`part`, given at x > 0, and its mirror image."""
    return lambda p: part(np.concatenate([np.abs(p[..., :1]), p[..., 1:]], axis=-1))


def smooth_min(a: Array, b: Array, blend: float) -> Array:
    """Union of two fields with a fillet of about `blend` (the quadratic polynomial form of Quilez)."""
    h = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(np.minimum(a, b) - 0.25 * blend * h * h)


def smooth_max(a: Array, b: Array, blend: float) -> Array:
    return -smooth_min(-a, -b, blend)


def gradient(field: Field, p: Array, step: float) -> Array:
    shifts = step * np.eye(3)
    return np.stack([field(p + s) - field(p - s) for s in shifts], axis=-1) / (2.0 * step)


def implicit_surface(field: Field, low: Point, high: Point, cell: float) -> Mesh:
    """Triangles of `field` = 0: marching cubes, then evened out along the surface and drawn back onto it."""
    from scipy.sparse import coo_array
    from skimage.measure import marching_cubes

    axes = [np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    vertices, faces, _, _ = marching_cubes(field(grid), 0.0, spacing=(cell, cell, cell))  # type: ignore[no-untyped-call]
    p = vertices.astype(np.float64) + np.array(low)
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    ones = np.ones(2 * len(start))
    links = coo_array((ones, (np.r_[start, end], np.r_[end, start])), shape=(len(p), len(p))).tocsr()
    share = 1.0 / links.sum(axis=1)
    for _ in range(12):
        p = project(field, p + 0.5 * ((links @ p) * share[:, None] - p), cell)
    mesh = Mesh(p, faces.astype(np.int32))
    return mesh if mesh.volume > 0 else Mesh(p, faces[:, ::-1].astype(np.int32))


def project(field: Field, p: Array, cell: float) -> Array:
    """Newton steps onto `field` = 0, each no longer than half a cell."""
    for _ in range(2):
        g = gradient(field, p, 1e-3 * cell)
        step = field(p)[:, None] * g / np.maximum((g * g).sum(axis=1, keepdims=True), 1e-6)
        length = np.linalg.norm(step, axis=1, keepdims=True)
        p = p - step * np.minimum(1.0, 0.5 * cell / np.maximum(length, 1e-12))
    return p


def gummy_bear() -> Mesh:
    parts: list[tuple[Field, float]] = [
        (ellipsoid((0, 0.65, 0.17), (0.41, 0.44, 0.37)), 0.14),
        (ellipsoid((0, 1.46, 0.06), (0.46, 0.40, 0.40)), 0.18),
        (ellipsoid((0, 1.35, 0.38), (0.24, 0.17, 0.22)), 0.10),
        (ellipsoid((0, 1.43, 0.58), (0.085, 0.06, 0.055)), 0.06),
        (both_sides(ellipsoid((0.345, 1.80, 0.03), (0.19, 0.19, 0.12))), 0.09),
        (both_sides(capsule((0.46, 0.98, 0.06), (0.43, 0.90, 0.44), 0.17, 0.15)), 0.14),
        (both_sides(capsule((0.31, 0.29, 0.08), (0.37, 0.25, 0.52), 0.24, 0.21)), 0.12),
        (both_sides(ellipsoid((0.385, 0.29, 0.62), (0.205, 0.235, 0.13))), 0.08),
        (both_sides(ellipsoid((0.17, 1.57, 0.405), (0.06, 0.07, 0.055))), 0.05),
    ]
    inner_ear = both_sides(ellipsoid((0.355, 1.81, 0.19), (0.11, 0.11, 0.10)))

    def field(p: Array) -> Array:
        value = ellipsoid((0, 0.74, 0), (0.50, 0.58, 0.40))(p)
        for part, blend in parts:
            value = smooth_min(value, part(p), blend)
        value = smooth_max(value, -inner_ear(p), 0.09)
        # Cast in an open mold: a flat back, and it stands.
        value = smooth_max(value, -p[..., 2] - 0.30, 0.14)
        return smooth_max(value, 0.03 - p[..., 1], 0.08)

    return standing(implicit_surface(field, (-0.75, -0.1, -0.5), (0.75, 2.15, 0.95), 0.0305))


def soap_bar() -> Mesh:
    half, corner = np.array([4.5, 1.5, 3.0]), 1.15

    def field(p: Array) -> Array:
        # A box with round corners; its large faces bulge a little, as a pressed bar's do.
        bulge = 0.22 * ((p[..., 0] / half[0]) ** 2 + (p[..., 2] / half[2]) ** 2)
        height = np.abs(p[..., 1]) * (1.0 + np.minimum(bulge, 0.3))
        q = np.stack([np.abs(p[..., 0]), height, np.abs(p[..., 2])], axis=-1) - (half - corner)
        body = np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0) - corner
        # In both large faces an oval dent; on its floor, raised, a leaf.
        depth = half[1] - np.abs(p[..., 1])
        oval = 2.2 * (np.hypot(p[..., 0] / 3.3, p[..., 2] / 1.95) - 1.0)
        dent = smooth_max(oval, depth - 0.30, 0.45)
        raised = smooth_max(0.6 * pointed_oval(p[..., 0], p[..., 2], 2.2, 0.95), 0.11 - depth, 0.24)
        return smooth_max(body, -smooth_max(dent, -raised, 0.24), 0.25)

    return standing(implicit_surface(field, (-4.8, -1.8, -3.3), (4.8, 1.8, 3.3), 0.148))


def pointed_oval(x: Array, z: Array, half_length: float, half_width: float) -> Array:
    """A leaf's outline along x: where two circles cross."""
    radius = (half_length**2 + half_width**2) / (2.0 * half_width)
    return np.asarray(np.hypot(x, np.abs(z) + radius - half_width) - radius)


def standing(mesh: Mesh) -> Mesh:
    """`mesh` with its lowest point at y = 0."""
    return Mesh(mesh.vertices - np.array([0.0, mesh.bounds[0, 1], 0.0]), mesh.faces)


# Tubes and surfaces of revolution.


def knot_curve(t: Array) -> Array:
    """(n, 3): a (2, 3) torus knot, seen as a trefoil along z."""
    across = 2.9 + 1.25 * np.cos(3.0 * t)
    return np.stack([across * np.cos(2.0 * t), across * np.sin(2.0 * t), 1.25 * np.sin(3.0 * t)], axis=-1)


#: Radius of the knot's tube in centimetres.
KNOT_TUBE = 0.8


def torus_knot(sections: int = 360, sides: int = 28) -> Mesh:
    fine = 2.0 * np.pi * np.arange(20_001) / 20_000
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(knot_curve(fine), axis=0), axis=1))]
    t = np.interp(length[-1] * np.arange(sections) / sections, length, fine)
    step = 1e-4
    tangent = knot_curve(t + step) - knot_curve(t - step)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The normal of the torus that carries the knot closes after one turn, where a transported frame would not.
    normal = np.stack([np.cos(3.0 * t) * np.cos(2.0 * t), np.cos(3.0 * t) * np.sin(2.0 * t), np.sin(3.0 * t)], axis=1)
    normal -= (normal * tangent).sum(axis=1, keepdims=True) * tangent
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    side = np.cross(tangent, normal)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * side[:, None]
    p = knot_curve(t)[:, None] + KNOT_TUBE * ring
    return standing(Mesh(p.reshape(-1, 3), loops(sections, sides)))


def loops(rows: int, columns: int) -> Faces:
    """Faces of a grid that closes both ways, along rows x columns outwards."""
    index = np.arange(rows * columns).reshape(rows, columns)
    ahead, up = np.roll(index, -1, axis=1), np.roll(index, -1, axis=0)
    a, b, c, d = (corner.ravel() for corner in (index, ahead, np.roll(ahead, -1, axis=0), up))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)


def turned(profile: Array, segments: int) -> Mesh:
    """Profile (radius, height) revolved around y."""
    vertices, faces = revolve(profile, segments)
    return Mesh(vertices[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0]), faces)


def bangle() -> Mesh:
    """A ring of 5.8 cm inner diameter, flat inside and round outside, on its edge: the hole is seen along z."""
    angle = 2.0 * np.pi * np.arange(36) / 36
    c, s = np.cos(angle), np.sin(angle)
    flat = np.where(c < 0, 0.55, 1.0)
    # A superellipse: an even curve where an ellipse would come to an edge.
    section = np.stack(
        [3.18 + 0.52 * flat * np.sign(c) * np.abs(c) ** 0.85, 0.6 * np.sign(s) * np.abs(s) ** 0.85], axis=1
    )
    return standing(Mesh(*revolve(section, 176, closed=True)))


#: Radius of a candle and height of its rim, in centimetres.
CANDLE_RADIUS, CANDLE_RIM = 2.4, 7.0


def arc(center: tuple[float, float], radius: float, start: float, end: float, points: int) -> Array:
    """(points, 2): part of a circle, angles in degrees from the axis of the radius."""
    angle = np.radians(np.linspace(start, end, points))
    return np.asarray(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def candle() -> Mesh:
    """A pillar candle that has burnt for a while: a round foot, an upright side, a soft rim, and a hollow top."""
    foot, rim = 0.25, 0.35
    side = np.linspace(foot, CANDLE_RIM - rim, 24)[1:-1]
    hollow = np.linspace(CANDLE_RADIUS - 2 * rim, 0.0, 18)[1:]
    depth = 0.8 * (1.0 - (hollow / (CANDLE_RADIUS - 2 * rim)) ** 2) ** 1.5
    profile = [
        np.stack([np.linspace(0.0, CANDLE_RADIUS - foot, 10)[:-1], np.zeros(9)], axis=1),
        arc((CANDLE_RADIUS - foot, foot), foot, -90, 0, 8),
        np.stack([np.full(len(side), CANDLE_RADIUS), side], axis=1),
        arc((CANDLE_RADIUS - rim, CANDLE_RIM - rim), rim, 0, 180, 16),
        np.stack([hollow, CANDLE_RIM - rim - depth], axis=1),
    ]
    return turned(np.concatenate(profile), 96)


def wick() -> Mesh:
    """The wick of the candle, from within the wax to the flame."""
    return turned(np.array([(0.0, 5.7), (0.08, 5.75), (0.08, 6.85), (0.06, 6.95), (0.0, 7.0)]), 16)


def flame() -> Mesh:
    """A drop around the top of the wick, pointed upwards."""
    share = np.linspace(0.0, 1.0, 40)
    radius = 0.46 * np.sin(np.pi * share) ** 0.9 * (1.0 - share) ** 0.45 * 1.35
    radius[[0, -1]] = 0.0
    return turned(np.stack([radius, 6.6 + 2.7 * share], axis=1), 40)


def amber() -> Mesh:
    """A polished pebble: an ellipsoid that three waves have dented."""

    def field(p: Array) -> Array:
        waves = np.sin(1.1 * p[..., 0] + 0.6) * np.sin(1.3 * p[..., 1] + 1.1) * np.sin(1.2 * p[..., 2] - 0.4)
        return ellipsoid((0, 0, 0), (2.6, 1.5, 1.9))(p) + 0.16 * waves

    return standing(implicit_surface(field, (-3.0, -2.0, -2.4), (3.0, 2.0, 2.4), 0.088))


#: Radius and height in centimetres of the bowl's inner wall, from its lowest point to the rim.
BOWL = np.array([
    (0, 9.3), (1.1, 9.5), (2.3, 10.25), (3.35, 11.55), (3.93, 13.2), (3.98, 14.8), (3.72, 16.8), (3.35, 18.7),
    (3.1, 19.92),
])  # fmt: skip
WALL = 0.15
#: Points along the inner wall, and the one up to which the wine stands.
WALL_POINTS, FILL_POINT = 44, 25
TURNS = 120


def bowl_wall() -> tuple[Array, Array]:
    """Inner wall (n, 2) from the lowest point to the rim, and its unit normals away from the axis."""
    from scipy.interpolate import CubicSpline

    chord = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(BOWL, axis=0), axis=1))]
    free = (2, np.zeros(2))
    curve = CubicSpline(chord, BOWL, bc_type=((1, np.array([1.0, 0.0])), free))
    at = np.linspace(0.0, chord[-1], WALL_POINTS)
    tangent = curve(at, 1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    wall = curve(at)
    wall[0, 0] = 0.0
    return wall, np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)


def goblet() -> Mesh:
    from scipy.interpolate import CubicSpline

    wall, normal = bowl_wall()
    joint = 9
    outer = wall[joint:] + WALL * normal[joint:]
    tangent = np.array([-normal[joint, 1], normal[joint, 0]])
    edge = np.linspace(-np.pi / 2, np.pi / 2, 9)
    foot = np.stack([3.42 + 0.11 * np.cos(edge), 0.11 + 0.11 * np.sin(edge)], axis=1)
    under = np.stack([np.linspace(0.0, 3.42, 8)[:-1], 0.12 * np.cos(np.linspace(0.0, np.pi / 2, 8)[:-1])], axis=1)
    waist = [(2.5, 0.35), (1.5, 0.62), (0.75, 1.15), (0.46, 2.1), (0.37, 4.0), (0.36, 6.2), (0.43, 7.7), (0.78, 8.65)]
    knots = np.array([foot[-1], *waist, outer[0]])
    chord = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))]
    stem = CubicSpline(chord, knots, bc_type=((1, np.array([-1.0, 0.05])), (1, tangent)))
    at = np.linspace(0.0, chord[-1], 44)[1:-1]
    # A half circle from the outer to the inner wall.
    turn = np.linspace(0.0, np.pi, 8)[1:-1, None]
    up = np.array([-normal[-1, 1], normal[-1, 0]])
    rim = wall[-1] + WALL / 2 * normal[-1] + WALL / 2 * (np.cos(turn) * normal[-1] + np.sin(turn) * up)
    return turned(np.concatenate([under, foot, stem(at), outer, rim, wall[::-1]]), TURNS)


def wine() -> Mesh:
    """The lower part of the bowl: below, the goblet's own inner wall point for point; above, a level surface."""
    wall = bowl_wall()[0][: FILL_POINT + 1]
    level = np.stack([wall[-1, 0] * np.linspace(1.0, 0.0, 7)[1:], np.full(6, wall[-1, 1])], axis=1)
    # Downwards like the goblet's wall, so that both cut each quad along the same diagonal; then turned outwards.
    inwards = turned(np.concatenate([wall, level])[::-1], TURNS)
    return Mesh(inwards.vertices, inwards.faces[:, ::-1])


#: Of a tumbler in centimetres: radius inside at the floor and at the rim, height of the floor and of the rim, wall.
TUMBLER = (3.25, 3.75, 1.1, 10.5)
TUMBLER_WALL, DRINK_POINT = 0.22, 31


def tumbler_wall() -> Array:
    """Inner wall (n, 2) of the tumbler, from the middle of its floor to the rim: a round corner, then straight."""
    low, high, floor, rim = TUMBLER
    corner = 0.7
    lean = (high - low) / (rim - floor)
    flat = np.stack([np.linspace(0.0, low - corner, 9)[:-1], np.full(8, floor)], axis=1)
    side = np.stack(
        [low + lean * np.linspace(corner, rim - floor, 25)[1:], np.linspace(floor + corner, rim, 25)[1:]], 1
    )
    return np.concatenate([flat, arc((low - corner, floor + corner), corner, -90.0, 0.0, 9), side])


def tumbler() -> Mesh:
    """A straight glass with a thick foot."""
    wall = tumbler_wall()
    radius, rim = wall[-1]
    outer = np.array([(3.30, 0.35), (radius + TUMBLER_WALL, rim)])
    side = outer[0] + np.linspace(0.0, 1.0, 10)[:, None] * (outer[1] - outer[0])
    under = np.stack([np.linspace(0.0, 2.95, 9)[:-1], np.zeros(8)], axis=1)
    edge = arc((2.95, 0.35), 0.35, -90.0, 0.0, 8)[:-1]
    lip = arc((radius + TUMBLER_WALL / 2, rim), TUMBLER_WALL / 2, 0.0, 180.0, 8)[1:-1]
    return turned(np.concatenate([under, edge, side, lip, wall[::-1]]), 96)


def drink() -> Mesh:
    """What fills the tumbler: its inner wall point for point, and a level surface."""
    wall = tumbler_wall()[: DRINK_POINT + 1]
    level = np.stack([wall[-1, 0] * np.linspace(1.0, 0.0, 9)[1:], np.full(8, wall[-1, 1])], axis=1)
    inwards = turned(np.concatenate([wall, level])[::-1], 96)
    return Mesh(inwards.vertices, inwards.faces[:, ::-1])


def ice_cube() -> Mesh:
    """A cube with round edges whose sides have melted a little unevenly, about the origin."""
    half, corner = 1.15, 0.3

    def field(p: Array) -> Array:
        waves = np.sin(1.7 * p[..., 0] + 0.4) * np.sin(1.9 * p[..., 1] - 0.8) * np.sin(1.6 * p[..., 2] + 1.3)
        q = np.abs(p) - (half - corner)
        body = np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0) - corner
        return np.asarray(body + 0.09 * waves)

    return implicit_surface(field, (-1.4, -1.4, -1.4), (1.4, 1.4, 1.4), 0.1)


def lantern() -> Mesh:
    """A lantern of wax, open at the top: a thick wall around a hollow for a light."""
    outer = [
        np.stack([np.linspace(0.0, 4.0, 12)[:-1], np.zeros(11)], axis=1),
        arc((4.0, 0.4), 0.4, -90.0, 0.0, 8),
        np.stack([np.full(12, 4.4), np.linspace(0.4, 11.2, 14)[1:-1]], axis=1),
        arc((3.95, 11.2), 0.45, 0.0, 180.0, 16),
        np.stack([np.full(10, 3.5), np.linspace(11.2, 2.0, 12)[1:-1]], axis=1),
        arc((2.7, 2.0), 0.8, 0.0, -90.0, 10),
        np.stack([np.linspace(2.7, 0.0, 9)[1:], np.full(8, 1.2)], axis=1),
    ]
    return turned(np.concatenate(outer), 96)


def sheet(rows: int, columns: int) -> Faces:
    """Faces of an open grid, seen counter-clockwise with columns to the right and rows upwards."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (corner.ravel() for corner in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)


def leaf(rows: int = 96, columns: int = 29) -> Mesh:
    """A leaf with its stalk, folded along the midrib, arched along its length, with faint veins and a wavy margin."""
    s, t = np.meshgrid(np.linspace(0.0, 1.0, rows), np.linspace(-1.0, 1.0, columns), indexing="ij")
    blade = np.clip((s - 0.2) / 0.8, 0.0, 1.0)
    outline = 4.45 * blade**0.62 * (1.0 - blade) ** 1.05
    half = np.hypot(outline, 0.075 * (1.0 - s) + 0.004)
    across, along = t * half, 9.0 * s
    rib = np.sqrt(across**2 + 0.01) - 0.1
    fold = 0.38 * rib
    veins = 0.022 * np.sin(2.0 * np.pi * (8.0 * blade - 1.5 * rib)) * np.minimum(rib, 0.6)
    wave = 0.035 * np.sin(11.0 * blade + np.sign(t)) * across**2
    arch = 1.1 * np.sin(np.pi * (0.12 + 0.7 * s))
    p = np.stack([across, arch + fold + veins + wave, 4.5 - along], axis=-1).reshape(-1, 3)
    uv = np.stack([0.5 + across / 5.0, s], axis=-1).reshape(-1, 2)
    return Mesh(p - np.array([0.0, p[:, 1].min(), 0.0]), sheet(rows, columns), uv)


def shapes() -> dict[str, Shape]:
    """Every mesh of the project by file name."""
    return {
        "sphere.ply": Shape("Ball", "sphere in rings", standing(Sphere(radius=2.0).tessellate(128))),
        "shell.ply": Shape(
            "Hollow ball, 4 mm wall", "two nested spheres, the inner one wound inwards",
            standing(SphericalShell(2.5, 2.1).tessellate(88)),
        ),
        "knot.ply": Shape("Knot of a 1.6 cm tube", "tube along a (2, 3) torus knot", torus_knot()),
        "bear.ply": Shape("Gummy bear", "smooth union of ellipsoids and capsules, marching cubes", gummy_bear()),
        "soap.ply": Shape("Bar of soap with a stamped dent", "rounded box less a dent, marching cubes", soap_bar()),
        "goblet.ply": Shape("Wine glass, 1.5 mm wall", "spline profile, revolved", goblet()),
        "wine.ply": Shape("The wine in goblet.ply", "the goblet's inner wall and a level top", wine()),
        "bangle.ply": Shape("Jade bangle", "D-shaped section, revolved", bangle()),
        "candle.ply": Shape("Pillar candle", "rounded profile, revolved", candle()),
        "wick.ply": Shape("The wick of candle.ply", "profile, revolved", wick()),
        "flame.ply": Shape("The flame of candle.ply", "drop, revolved", flame()),
        "amber.ply": Shape("Polished pebble", "dented ellipsoid, marching cubes", amber()),
        "tumbler.ply": Shape("Straight glass with a thick foot", "profile, revolved", tumbler()),
        "drink.ply": Shape("What fills tumbler.ply", "the tumbler's inner wall and a level top", drink()),
        "ice.ply": Shape("Ice cube", "rounded and dented box, marching cubes", ice_cube()),
        "lantern.ply": Shape("Lantern of wax, 9 mm wall, open at the top", "profile, revolved", lantern()),
        "leaf.ply": Shape("Leaf with texture coordinates, one sheet", "outline, fold and arch on a grid", leaf()),
    }  # fmt: skip


# Files.


def ply(mesh: Mesh) -> bytes:
    """Binary little-endian PLY in metres; texture coordinates as s, t."""
    columns = [("x", 0), ("y", 1), ("z", 2)]
    data = mesh.vertices * CENTIMETRE
    if mesh.uv is not None:
        columns += [("s", 3), ("t", 4)]
        data = np.concatenate([data, mesh.uv], axis=1)
    if len(data) > np.iinfo(np.uint16).max + 1:
        raise ValueError(f"{len(data)} vertices do not fit 16-bit indices")
    # A grid of 2^-26 m, so that the last bit of another machine's sine does not show.
    data = (np.rint(data * 2.0**26) / 2.0**26 + 0.0).astype("<f4")
    records: Any = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("index", "<u2", 3)])
    records["count"], records["index"] = 3, mesh.faces
    lines = ["ply", "format binary_little_endian 1.0", "comment made by tools/make_meshes.py, in metres, MIT licence"]
    lines += [f"element vertex {len(data)}", *(f"property float {name}" for name, _ in columns)]
    lines += [f"element face {len(records)}", "property list uchar ushort vertex_indices", "end_header", ""]
    return b"".join(["\n".join(lines).encode("ascii"), data.tobytes(), records.tobytes()])


def readme(made: dict[str, Shape]) -> str:
    rows = [
        f"| `{name}` | {shape.what} | {shape.how} | {' × '.join(f'{v:.2f}' for v in shape.size)} "
        f"| {len(shape.mesh.faces)} | {'yes' if shape.mesh.diagnosis.solid else 'no'} |"
        for name, shape in made.items()
    ]
    table = "\n".join(rows)
    return f"""# Meshes

Small meshes for examples and tests, all made by `tools/make_meshes.py`, which also writes this page: edit that file and
run it again. They are part of the project and under its MIT license.

Unit: metre. y is up; each stands on y = 0, but for wine and drink, which stand in their glasses, for wick and flame,
which are on their candle, and for the ice cube, which is about the origin. Binary PLY, positions in float32, faces
counter-clockwise seen from outside.

| file | what | how made | size in cm (x × y × z) | triangles | closed |
|---|---|---|---|---|---|
{table}

The side of the wine and the inside of the goblet are the same vertices, so the two bodies share a face exactly. So do
the drink and the tumbler.
"""


def build() -> dict[str, bytes]:
    """Every file of meshes/ by name."""
    made = shapes()
    return {name: ply(shape.mesh) for name, shape in made.items()} | {"README.md": readme(made).encode("utf-8")}


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the meshes in meshes/ and their README.")
    parser.add_argument("--output", type=Path, default=ROOT / "meshes", help="folder to write to")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in build().items():
        (folder / name).write_bytes(data)
        print(f"{name}: {len(data) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
