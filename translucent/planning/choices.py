"""Choices of how to render a scene, as they are asked for: None leaves one to the planner."""

from __future__ import annotations

from dataclasses import dataclass

from translucent.planning.caustics import Caustics
from translucent.planning.interfaces import Interfaces
from translucent.planning.methods import Method
from translucent.planning.scattering import Scattering
from translucent.planning.shadow_maps import ShadowMaps


@dataclass(frozen=True)
class RenderChoices:
    """Choices with which a scene is asked to be rendered; see `Renderer.render`.

    Parameters
    ----------
    method : Method, optional
    interfaces : TracedInterfaces, ScreenInterfaces or FrontInterface, optional
    scattering : Diffusion, ScatteringLayer or SingleScattering, optional
    caustics : Caustics, optional
    shadows : ShadowMaps, optional
    """

    method: Method | None = None
    interfaces: Interfaces | None = None
    scattering: Scattering | None = None
    caustics: Caustics | None = None
    shadows: ShadowMaps | None = None
