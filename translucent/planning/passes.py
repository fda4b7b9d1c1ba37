"""Passes and notes: what plans consist of."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, Self


class NoteKind(StrEnum):
    """Subject of a note, by which programs know it; its text is for people alone."""

    # Where thickness, transmittance or emission are not exact.
    OPEN_MESH = "open mesh"
    CLOSED_AS_SHEETS = "closed as sheets"
    DUPLICATED_FACES = "duplicated faces"
    INSIDE_OUT = "inside out"
    NOT_CONVEX = "not convex"
    SEVERAL_BODIES = "several bodies"
    LAYER_LIMIT = "layer limit"
    STEPS = "steps"
    DISTANCE_FROM_CAMERA = "distance from camera"
    DENSE_SCATTERING = "dense scattering"
    SHEETS_WITHOUT_ORDER = "sheets without order"
    UNLIT = "unlit"
    NOISE = "noise"
    SPHERE_LIGHTS = "sphere lights"

    # What the scene requests and no pass renders.
    LIGHTS_LEFT_OUT = "lights left out"
    ONLY_REMOVES = "only removes"
    SCATTERED_AGAIN = "scattered again"
    SPREAD_INSIDE = "spread inside"
    DIFFUSED_LIGHT = "diffused light"
    LAYER_INSTEAD = "layer instead"
    DIMMED_AMBIENT = "dimmed ambient"
    UNUSED_LIGHTS = "unused lights"
    SHADOWS = "shadows"
    CAUSTICS = "caustics"
    REFRACTION = "refraction"
    TOUCHING_INTERFACES = "touching interfaces"
    LATER_REFRACTION = "later refraction"
    CUT_OFF_PATHS = "cut-off paths"
    ONE_INTERFACE = "one interface"
    OPAQUE_SURFACES = "opaque surfaces"
    REFLECTED_LIGHT = "reflected light"
    LAYERS = "layers"
    GLOW = "glow"
    TEXTURES = "textures"
    COATS = "coats"
    HOLES = "holes"
    INVISIBLE = "invisible"
    UNUSED_PRIORITIES = "unused priorities"

    # What is right and shows nothing.
    BLACK = "black"
    OPAQUE_BODIES = "opaque bodies"
    UNSEEN_BODIES = "unseen bodies"
    SLOW_HITS = "slow hits"
    DENOISED = "denoised"

    # What a page in a browser does with a scene.
    MANY_TRIANGLES = "many triangles"


class Note(str):
    """Note of a plan: a string with a kind, by which programs know it.

    Attributes
    ----------
    kind : NoteKind
    """

    __slots__ = ("kind",)

    kind: NoteKind

    def __new__(cls, kind: NoteKind, text: str) -> Self:
        """Make a note of this kind with this text."""
        note = super().__new__(cls, text)
        note.kind = kind
        return note

    def __getnewargs__(self) -> tuple[NoteKind, str]:  # type: ignore[override]  # copies and pickles keep the kind
        return self.kind, str(self)


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
