"""The ways of showing light that is scattered many times, one file for each, and the choice among them."""

from __future__ import annotations

from translucent.planning.scattering.base import Scattering
from translucent.planning.scattering.diffusion import Diffusion
from translucent.planning.scattering.layer import ScatteringLayer
from translucent.planning.scattering.single import SingleScattering

__all__ = ["SCATTERINGS", "Diffusion", "Scattering", "ScatteringLayer", "SingleScattering"]

#: Names on the command line.
SCATTERINGS: dict[str, type[Scattering]] = {one.name: one for one in (Diffusion, ScatteringLayer, SingleScattering)}
