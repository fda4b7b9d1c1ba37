"""Slabs in diffuse light: diffusion and the layer against adding and doubling."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Literal

import numpy as np

from translucent.arrays import Array
from translucent.bench.claims import SLAB_CLAIMS, Judge
from translucent.bench.drawing import BenchContext
from translucent.bench.experiment import Experiment, Whole
from translucent.bench.record import Part, Report, Slab
from translucent.diffusion.grid import BodyGrid, body_grid
from translucent.diffusion.solution import BodySystem
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.diffusion import ahead_mirrored, in_scattered_shares
from translucent.formulas.two_stream import (
    mirrored_reflectance,
    mirrored_transmittance,
    two_stream_absorption,
    two_stream_reflectance,
    two_stream_scattering,
    two_stream_transmittance,
)
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box
from translucent.media.medium import Medium
from translucent.planning.rendered import Treatment
from translucent.planning.scattering import Diffusion, choose_treatments
from translucent.reference import slabs
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

#: Half of the width of the slab, and of the part in its middle that is looked at, in thicknesses.
HALF_WIDTH, MIDDLE = 4.0, 1.0

#: Names of what the planner chooses.
PLANNED: dict[Treatment, Literal["diffusion", "layer", "volume", "none"]] = {
    Treatment.DIFFUSION: "diffusion",
    Treatment.LAYER: "layer",
    Treatment.VOLUME: "volume",
    Treatment.SINGLE: "none",
}


@dataclass(frozen=True)
class SlabComparison(Experiment[Whole]):
    """Slabs of all combinations of parameters; a medium has three optical depths, one in each channel."""

    part: ClassVar[Part] = "slabs"
    label: ClassVar[str] = "slabs"
    into: ClassVar[str] = "slabs"
    claims: ClassVar[tuple[Judge, ...]] = SLAB_CLAIMS

    shown: Sequence[Whole] = (Whole(),)
    albedos: Sequence[float] = (0.5, 0.8, 0.9, 0.99, 0.999, 0.9999)
    depths: Sequence[tuple[float, float, float]] = ((0.5, 1.0, 2.0), (4.0, 8.0, 16.0), (32.0, 64.0, 100.0))
    anisotropies: Sequence[float] = (0.0, 0.5, 0.9)
    indices: Sequence[float] = (1.0, 1.5)

    def added(self, report: Report, record: tuple[Slab, ...]) -> Report:
        """The report with the slabs."""
        return report.plus(self.into, record)

    def measure(self, bench: BenchContext | None, scene: Whole) -> tuple[Slab, ...]:
        """Measure all slabs, without OpenGL."""
        every = itertools.product(self.indices, self.anisotropies, self.albedos, self.depths)
        return tuple(
            one
            for ior, anisotropy, albedo, depths in every
            for one in _measured(albedo, np.array(depths), anisotropy, ior)
        )


@np.errstate(under="ignore")
def _measured(albedo: float, depths: Array, anisotropy: float, ior: float) -> list[Slab]:
    """Slabs, a metre thick, of three optical depths."""
    medium = Medium((1.0 - albedo) * depths, albedo * depths, anisotropy=anisotropy, ior=ior)
    layer, diffused = _layer(medium), _diffused(medium)
    found = []
    for i, depth in enumerate(depths.tolist()):
        passing = slabs.unscattered_fractions(depth, ior)
        in_scattered = _ahead(albedo, depth, anisotropy, ior)
        by_diffusion, by_layer = (
            (float(model[0, i]) + passing[0] + more[0], float(model[1, i]) + passing[1] + more[1])
            for model, more in ((diffused, in_scattered), (layer, (0.0, 0.0)))
        )
        body = Object(_mesh(), Medium((1.0 - albedo) * depth, albedo * depth, anisotropy=anisotropy, ior=ior))
        scene = Scene([body], Camera.look_at((0.0, 5.0, 5.0), (0.0, 0.0, 0.0)))
        treatment = choose_treatments(scene, None).of.get(0, Treatment.SINGLE)
        whole = slabs.total_fractions(albedo, depth, ior, anisotropy)
        found.append(Slab(albedo, depth, anisotropy, ior, *whole, passing, by_diffusion, by_layer, PLANNED[treatment]))
    return found


def _layer(medium: Medium) -> Array:
    """(2, 3): reflectance and transmittance of `ScatteringLayer`, of light that has been scattered.

    The same as ``scattered_out`` in ``shaders/shade/interface_light.glsl``, for the light that enters from all sides.
    """
    bare = two_stream_absorption(medium.absorption), two_stream_scattering(medium.scattering, medium.anisotropy)
    back, through = two_stream_reflectance(*bare), two_stream_transmittance(*bare)
    reflected = diffuse_interface(medium.ior).reflected
    whole_back, whole_through = (
        find(back, through, reflected) for find in (mirrored_reflectance, mirrored_transmittance)
    )
    entering = np.minimum(
        [slabs.entering_transmittance(float(depth), medium.ior) for depth in medium.extinction], through
    )
    return np.maximum(
        [
            whole_back - entering * reflected * whole_through,
            whole_through - entering * (1.0 - reflected + reflected * whole_back),
        ],
        0.0,
    )


def _diffused(medium: Medium) -> Array:
    """(2, 3): reflectance and transmittance of `Diffusion`, of light that has been scattered."""
    grid = _grid()
    top, bottom = grid.face_normals[:, 1] > 0.9, grid.face_normals[:, 1] < -0.9
    middle = np.abs(grid.points[:, [0, 2]]).max(axis=1) < MIDDLE
    flux = np.repeat(top.astype(np.float64)[:, None], 3, axis=1)
    found = BodySystem(grid, medium, 0.0).solved(flux, None, np.zeros((grid.count, 3)))
    leaving = np.stack([found.fluence[side & middle].mean(axis=0) for side in (top, bottom)])
    return diffuse_interface(medium.ior).exit_share * leaving


def _ahead(albedo: float, depth: float, anisotropy: float, ior: float) -> tuple[float, float]:
    """Reflectance and transmittance of forward-scattered light, which `Diffusion` leaves to rays.

    The same as in ``shaders/transport/traced_interfaces.frag``: it leaves where the ray ends, or is reflected there.
    """
    mu, weight = slabs.cosines(ior)
    reflected = optics.fresnel_dielectric(mu, 1 / ior) if ior > 1 else np.zeros_like(mu)
    flux = mu * weight * (1.0 - reflected)
    ahead = np.exp(-depth * (1.0 - albedo * anisotropy) / mu) - np.exp(-depth / mu)
    again = reflected * np.exp(-depth / mu)
    across = ahead / (1.0 - again**2)
    # On the mean path of diffuse light across a slab, twice its thickness.
    interface = diffuse_interface(ior)
    far, near = in_scattered_shares(interface.reflected, np.exp(-2.0 * depth * (1.0 - albedo)))
    mirrored = ahead_mirrored(
        mu, ior, interface.reflected, interface.reflected_flux, albedo * anisotropy * depth / mu, anisotropy or 1.0
    )
    leaving, turned = 1.0 - mirrored + mirrored * far, mirrored * near
    back, on = across * (again * leaving + turned), across * (leaving + again * turned)
    return float((flux * back).sum() / flux.sum()), float((flux * on).sum() / flux.sum())


@cache
def _mesh() -> Mesh:
    return Box((-HALF_WIDTH, -0.5, -HALF_WIDTH), (HALF_WIDTH, 0.5, HALF_WIDTH)).tessellate()


@cache
def _grid() -> BodyGrid:
    body = Object(_mesh(), Medium(scattering=1.0))
    return body_grid(body, Diffusion().cell_size(body))
