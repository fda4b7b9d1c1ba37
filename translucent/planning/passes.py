"""Passes of a plan, each with its reason and its expected cost."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal


class PassName(StrEnum):
    """Name of a pass in plans, in their JSON and in `Frame.seconds`."""

    SHADOW_MAPS = "shadow_maps"
    OPAQUE = "opaque"
    BACKDROP = "backdrop"
    CAUSTICS = "caustics"
    SIGNED_DEPTH = "signed_depth"
    SIGNED_DEPTH_FALLBACK = "signed_depth_fallback"
    THIN_LAYER = "thin_layer"
    THIN_LAYER_FALLBACK = "thin_layer_fallback"
    BACK_FACE_DEPTH = "back_face_depth"
    UNLIT = "unlit"
    LIGHT_VIEWS = "light_views"
    DEPTH_PEELING = "depth_peeling"
    FRAGMENT_LISTS = "fragment_lists"
    K_BUFFER = "k_buffer"
    INTERFACES = "interfaces"
    TRANSMITTANCE = "transmittance"
    SURFACES = "surfaces"
    TRACED = "traced_interfaces"
    LAYERS = "layers"
    PATH_TRACE = "path_trace"  # also without OpenGL

    # Without OpenGL.
    INTERSECT = "intersect"
    SHADE = "shade"
    MARCH = "march"

    # Printed as the word that it is, also where frames show their seconds.
    __repr__ = str.__repr__


@dataclass(frozen=True)
class PassSpec:
    """One pass of a plan.

    Attributes
    ----------
    name : PassName
        What the pass is called in `Frame.seconds`.
    reason : str
        Why the scene needs it.
    objects : tuple of int
        Indices into `Scene.objects` of what it draws; empty for a pass over pixels.
    geometry_passes : int
        How often it draws them, or for depth peeling is expected to.
    target : {"accumulated", "fallback", "unlit"}
        Where its paths add up: the fallback is read where the other does not balance, and pixels are marked invalid
        where there is any in the last.
    cost : float
        Expected time, in multiples of drawing the same objects into a depth buffer.
    """

    name: PassName
    reason: str
    objects: tuple[int, ...] = ()
    geometry_passes: int = 0
    target: Literal["accumulated", "fallback", "unlit"] = "accumulated"
    cost: float = 0.0
