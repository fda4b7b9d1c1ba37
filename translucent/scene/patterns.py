"""Patterns of stone and ice on surfaces: textures that need no texture coordinates of the mesh.

A pattern is the same all along one oblique direction, as veins are sheets that cross a block. So its texture
coordinates are linear in the position: they have no seams, and a mesh keeps its vertices. A pattern has a size in
metres.

The textures are made from random fields whose power falls with the frequency (Saupe 1988, "Algorithms for random
fractals", section 2.4). Veins and cracks are where such a field is 0 (after Perlin 1985, "An image synthesizer").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Texels along a side of a pattern, which repeats.
TEXELS = 640

#: Directions in which the coordinates of a pattern grow, for axes x, y, z. The pattern is the same along their cross
#: product, which is about as far from all faces of a box.
ACROSS = np.array([[0.82, 0.0, -0.57], [-0.29, 0.87, -0.41]])


@dataclass(frozen=True)
class Pattern:
    """Pattern on the surfaces of a material.

    Attributes
    ----------
    period : float
        Metres after which it repeats.
    surfaced : callable
        Gives a surface the textures of the pattern.
    """

    period: float
    surfaced: Callable[[Surface], Surface]


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
    return _unrolled(mesh, scale / PATTERNS[name].period), PATTERNS[name].surfaced(surface or Surface())


@lru_cache(maxsize=4)
def _unrolled(mesh: Mesh, frequency: float) -> Mesh:
    """Mesh with texture coordinates, cached so that what renderers keep of a mesh stays."""
    return replace(mesh, uv=frequency * mesh.vertices @ ACROSS.T)


def _veined(surface: Surface) -> Surface:
    return replace(surface, color_texture=_veins())


def _frosted(surface: Surface) -> Surface:
    covered, roughness = _frost()
    return replace(surface, transmission_texture=covered, roughness_texture=roughness, diffuse_transmission=0.5)


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
def _frost() -> tuple[Texture, Texture]:
    """Cracks and patches of frost: fraction of light that passes by refraction, and factors of the roughness."""
    random = np.random.default_rng(3)
    first, second, where, patches, grains = (_field(random, decay) for decay in (2.2, 2.2, 2.2, 1.6, 1.3))
    here, there = np.clip(0.4 + 0.6 * where, 0.0, 1.0), np.clip(0.4 - 0.6 * where, 0.0, 1.0)
    cracks = np.maximum(here * _zeros(first, 0.03), 0.7 * there * _zeros(second, 0.02))
    frost = 0.4 * np.clip(patches - 0.9, 0.0, 1.0) + 0.2 * np.clip(grains - 1.0, 0.0, 1.0)
    covered = np.clip(0.75 * cracks + frost + 0.03, 0.0, 0.85)[..., None] * np.ones(3)
    return _texture(1.0 - covered), _texture(0.25 + 1.5 * covered)


def _field(random: np.random.Generator, decay: float) -> Array:
    """(n, n): periodic random field of mean 0 and variance 1, whose amplitudes fall as frequency ** -decay."""
    across = np.fft.fftfreq(TEXELS, 1.0 / TEXELS)
    frequency = np.hypot(across[:, None], np.fft.rfftfreq(TEXELS, 1.0 / TEXELS))
    amplitude = np.where(frequency > 1.0, np.maximum(frequency, 1.0) ** -decay, 0.0)
    field = np.fft.irfft2(amplitude * np.fft.rfft2(random.standard_normal((TEXELS, TEXELS))), (TEXELS, TEXELS))
    return np.asarray(field / field.std())


def _zeros(field: Array, width: float) -> Array:
    """1 where a field is 0, and less around."""
    with np.errstate(under="ignore"):
        return np.asarray(np.exp(-np.abs(field) / width))


def _texture(values: Array) -> Texture:
    return Texture(np.clip(values, 0.0, 1.0).astype(np.float32))


#: All patterns by name.
PATTERNS = {"veins": Pattern(0.15, _veined), "frost": Pattern(0.09, _frosted)}
