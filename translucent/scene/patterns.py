"""Patterns of stone, ice and skin: textures that need no texture coordinates of the mesh, and bubbles of air in ice.

A texture is the same all along one oblique direction, as veins are sheets that cross a block. So its texture
coordinates are linear in the position: they have no seams, and a mesh keeps its vertices. A texture has a size in
metres.

The textures are made from random fields whose power falls with the frequency (Saupe 1988, "Algorithms for random
fractals", section 2.4). Veins are where such a field is 0 (after Perlin 1985, "An image synthesizer").

Ice freezes from outside to inside, and pushes the air of the water before it. So its rim is clear, and its middle is
full of bubbles. Many are long, along the direction of freezing. The slower water freezes, the larger they are: they
grow with the body (Carte 1961, "Air bubbles in ice"). Here they are cavities of the mesh.

Skin has more blood in some places than in others, and more melanin. Such blotches have no direction, as veins have. So
the texture coordinates of skin swing along two more directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array, Mask
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.geometry.winding import line_crossings
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture
from translucent.threads import import_trimesh

#: Texels along a side of a pattern, which repeats.
TEXELS = 640

#: Directions in which the coordinates of a pattern grow, for axes x, y, z. The pattern is the same along their cross
#: product, which is about as far from all faces of a box.
ACROSS = np.array([[0.82, 0.0, -0.57], [-0.29, 0.87, -0.41]])

#: Cells along the longest side of a body, in which places for bubbles are looked for, and how far the lines that find
#: them are off the grid, so that they miss the edges of boxes.
CELLS = 40
OFF_GRID = np.array([0.0137, 0.0071, 0.0113])

#: Typical radius of a bubble, as a fraction of the depth of the deepest point of the body: 0.2 mm in a cube of 4 cm.
BUBBLE = 0.008

#: Semi-axis of bubbles that have 80 faces and not 20, as a fraction of the diagonal of the body.
LARGE = 0.004

#: Standard deviation of the slopes of melted ice along each of two directions.
SLOPE = 0.06

#: Change of the logarithm of skin's diffuse reflectance, red, green and blue: by 0.1 % more blood in it, three quarters
#: of it oxygenated (absorption by Prahl 1999), and by melanin, a filter on top (wavelength ** -3.48, Jacques 1998).
BLOOD = np.array([-0.037, -0.113, -0.060])
MELANIN = np.array([-0.05, -0.072, -0.134])

#: Coordinates of a pattern without a grain swing along these two directions, with this period in metres. The slope
#: of a swing is below 1, the slope of the coordinates themselves.
SWINGS = np.cross(*ACROSS) + np.array([[0.5], [-0.5]]) * ACROSS
SWING_PERIOD, SWING_SLOPE = 0.13, 0.7


@dataclass(frozen=True)
class Pattern:
    """Pattern on the surfaces of a material.

    Attributes
    ----------
    period : float
        Metres after which its textures repeat.
    surfaced : callable
        Gives a surface the textures of the pattern.
    bubbles : int
        Number of bubbles in a closed body.
    grain : bool
        Whether its textures are uniform along one direction.
    """

    period: float
    surfaced: Callable[[Surface], Surface]
    bubbles: int = 0
    grain: bool = True


def uniform_scale(transform: npt.ArrayLike) -> float:
    """World lengths per length of a mesh, whatever its direction: the cube root of the change of volume."""
    return float(abs(np.linalg.det(np.asarray(transform, dtype=np.float64)[:3, :3])) ** (1.0 / 3.0))


@checked
def patterned(mesh: Mesh, surface: Surface | None, name: str, scale: float = 1.0) -> tuple[Mesh, Surface | None]:
    """Apply a pattern to a mesh and its surface, unless the surface has textures of its own.

    Parameters
    ----------
    mesh : Mesh
        Texture coordinates that it has are replaced.
    surface : Surface, optional
    name : str
        One of `PATTERNS`, or nothing.
    scale : float
        World lengths per length of the mesh.

    Raises
    ------
    InputError
        If there is no such pattern.
    """
    if not name or (surface is not None and any(surface.textures)):
        return mesh, surface
    if name not in PATTERNS:
        found = f"no pattern has the name {name!r}"
        raise InputError(f"pattern of {mesh.name!r}", found, f"use one of {', '.join(PATTERNS)}")
    chosen = PATTERNS[name]
    return _marked(mesh, scale, chosen), chosen.surfaced(surface or Surface())


@lru_cache(maxsize=4)
def _marked(mesh: Mesh, scale: float, pattern: Pattern) -> Mesh:
    """Mesh with texture coordinates and bubbles, cached so that what renderers keep of a mesh stays."""
    if pattern.bubbles and mesh.diagnosis.solid:
        mesh = _with_cavities(mesh, *_bubbles(mesh, pattern.bubbles))
    places = scale * mesh.vertices
    across = places @ ACROSS.T
    if not pattern.grain:
        length = SWING_PERIOD / (2.0 * np.pi)
        first, second = (places @ SWINGS.T / length).T
        swings = np.stack([np.cos(first) + np.cos(second), np.sin(first) - np.sin(second)], axis=1)
        across += SWING_SLOPE * length * swings
    return replace(mesh, uv=across / pattern.period)


def _with_cavities(mesh: Mesh, middles: Array, axes: Array) -> Mesh:
    """Mesh with ellipsoidal cavities: middles (k, 3), and semi-axes (k, 3, 3) as rows of right-handed matrices."""
    trimesh = import_trimesh("trimesh.creation")
    coarse, fine = trimesh.icosahedron(), trimesh.icosphere(subdivisions=1)
    large = np.linalg.norm(axes, axis=-1).max(axis=1, initial=0.0) > LARGE * mesh.diagonal
    vertices, faces, count = [mesh.vertices], [mesh.faces], len(mesh.vertices)
    for i, (middle, own) in enumerate(zip(middles, axes, strict=True)):
        ball = fine if large[i] else coarse
        vertices.append(np.asarray(ball.vertices @ own + middle))
        faces.append(np.asarray(ball.faces[:, ::-1] + count, dtype=np.int32))
        count += len(ball.vertices)
    points = np.concatenate(vertices)
    opaque = np.ones((count - len(mesh.vertices), 4))
    colors = None if mesh.colors is None else np.concatenate([mesh.colors, opaque])
    added = f"{len(middles)} bubbles of air added by the pattern"
    changed = replace(mesh, vertices=points, faces=np.concatenate(faces), uv=None, colors=colors)
    return replace(changed, repairs=(*mesh.repairs, added))


def _bubbles(mesh: Mesh, count: int) -> tuple[Array, Array]:
    """Middles (k, 3) and semi-axes (k, 3, 3) of at most `count` bubbles in a closed mesh, apart from all else."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    inside, low, step = _cells_inside(mesh)
    depth = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1, 1:-1]
    deepest = float(depth.max())
    along = np.stack(np.gradient(gaussian_filter(depth, 0.5 * deepest)), axis=-1).reshape(-1, 3)
    random = np.random.default_rng(5)
    weights = np.where(depth > 2.0, depth, 0.0).ravel() ** 5
    if not weights.any():
        return np.zeros((0, 3)), np.zeros((0, 3, 3))
    cells = random.choice(weights.size, 10 * count, p=weights / weights.sum())
    middles = np.stack(np.unravel_index(cells, depth.shape), axis=1) + random.uniform(size=(len(cells), 3))
    width = BUBBLE * deepest * np.exp(0.45 * random.standard_normal(len(cells)))
    # Round in the middle, which freezes at once from all sides, and long around it.
    long = random.uniform(size=len(cells)) > depth.ravel()[cells] / deepest
    width *= np.where(long, 0.6, 1.0)
    length = width * np.where(long, random.uniform(4.0, 20.0, len(cells)), 1.0)
    chosen = np.zeros(0, dtype=np.int64)
    for i in np.flatnonzero(length < depth.ravel()[cells] - 2.0):
        apart = np.square(middles[chosen] - middles[i]).sum(axis=1) > np.square(length[chosen] + length[i])
        if apart.all():
            chosen = np.append(chosen, i)
        if len(chosen) == count:
            break
    axes = _frames(along[cells[chosen]] + 1e-3 * random.standard_normal((len(chosen), 3)))
    axes *= np.stack([width[chosen], width[chosen], length[chosen]], axis=1)[..., None]
    return low + step * middles[chosen], step * axes


def _frames(last: Array) -> Array:
    """(k, 3, 3): right-handed orthonormal rows, the last along these vectors."""
    last = last / np.linalg.norm(last, axis=1, keepdims=True)
    first = np.cross(last, np.eye(3)[np.abs(last).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(last, first), last], axis=1)


def _cells_inside(mesh: Mesh) -> tuple[Mask, Array, float]:
    """Cells (nx, ny, nz) whose middles are inside a closed mesh, their lower corner (3,), and their side."""
    low, high = mesh.bounds
    step = float((high - low).max()) / CELLS
    shape = np.ceil((high - low) / step).astype(np.int64)
    scaled = (mesh.vertices - low) / step - 0.5 + OFF_GRID
    changes = np.zeros((int(shape[0] * shape[1]), int(shape[2]) + 1), dtype=np.int64)
    lines = int(shape[0]), int(shape[1])
    for line, height, sign in line_crossings(scaled[:, :2], scaled[:, 2], mesh.faces, lines):
        np.add.at(changes, (line, np.clip(np.ceil(height), 0, shape[2]).astype(np.int64)), sign)
    return np.cumsum(changes, axis=1)[:, :-1].reshape(shape) > 0, low, step


def _veined(surface: Surface) -> Surface:
    return replace(surface, color_texture=_veins())


def _melted(surface: Surface) -> Surface:
    return replace(surface, normal_texture=_waves())


def _blotched(surface: Surface) -> Surface:
    return replace(surface, color_texture=_blood_and_melanin())


@lru_cache(maxsize=1)
def _blood_and_melanin() -> Texture:
    """Blotches of blood, 7 mm to 13 cm wide, and smaller ones of melanin: factors of what passes the surface."""
    random = np.random.default_rng(3)
    wide, small, melanin = (_field(random, decay, least, 60.0) for decay, least in ((1.5, 3), (1.0, 15), (0.8, 10)))
    blood = np.clip(1.2 + 0.4 * wide + 0.2 * small, 0.0, None)
    melanin = np.clip(0.5 + 0.2 * melanin, 0.0, None)
    return _texture(np.exp(blood[..., None] * BLOOD + melanin[..., None] * MELANIN))


@lru_cache(maxsize=1)
def _veins() -> Texture:
    """Gray veins, wide and faint ones around sharp ones, and clouds: factors of what passes the surface."""
    random = np.random.default_rng(11)
    first, second, where, clouds = (_field(random, decay) for decay in (2.1, 1.9, 2.0, 1.9))
    here, there = np.clip(0.5 + 0.6 * where, 0.0, 1.0), np.clip(0.4 - 0.6 * where, 0.0, 1.0)
    dark = here * (0.6 * _zeros(first, 0.045) + 0.3 * _zeros(first, 0.35)) + there * 0.35 * _zeros(second, 0.03)
    dark = np.clip(dark + 0.25 * np.clip(0.4 + 0.4 * clouds, 0.0, 1.0), 0.0, 1.0)
    return _texture(1.0 - dark[..., None] * np.array([0.70, 0.69, 0.67]))


@lru_cache(maxsize=1)
def _waves() -> Texture:
    """Normals of an uneven surface, as melting leaves it."""
    field = _field(np.random.default_rng(5), 3.0)
    slopes = np.stack([np.roll(field, 1, axis) - np.roll(field, -1, axis) for axis in (1, 0)], axis=-1)
    slopes *= SLOPE / slopes.std()
    normals = np.concatenate([slopes * (1.0, -1.0), np.ones((TEXELS, TEXELS, 1))], axis=-1)
    return _texture(0.5 + 0.5 * normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def _field(random: np.random.Generator, decay: float, least: float = 1.5, most: float = np.inf) -> Array:
    """(n, n): periodic random field of mean 0 and variance 1, whose amplitudes fall as frequency ** -decay.

    Only frequencies from `least` to `most` in a period are in it.
    """
    across = np.fft.fftfreq(TEXELS, 1.0 / TEXELS)
    frequency = np.hypot(across[:, None], np.fft.rfftfreq(TEXELS, 1.0 / TEXELS))
    amplitude = np.where((frequency >= least) & (frequency <= most), np.maximum(frequency, 1.0) ** -decay, 0.0)
    field = np.fft.irfft2(amplitude * np.fft.rfft2(random.standard_normal((TEXELS, TEXELS))), (TEXELS, TEXELS))
    return np.asarray(field / field.std())


def _zeros(field: Array, width: float) -> Array:
    """1 where a field is 0, and less around."""
    with np.errstate(under="ignore"):
        return np.asarray(np.exp(-np.abs(field) / width))


def _texture(values: Array) -> Texture:
    return Texture(np.clip(values, 0.0, 1.0).astype(np.float32))


#: All patterns by name.
PATTERNS = {
    "veins": Pattern(0.15, _veined),
    "bubbles": Pattern(0.06, _melted, 1200),
    "blotches": Pattern(0.4, _blotched, grain=False),
}
