"""Notes of a plan: where it is not exact, and what it does not render."""

from __future__ import annotations

from enum import StrEnum
from typing import Self


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

    # What the scene asks for and no pass renders.
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
    LAYERS = "layers"
    GLOW = "glow"
    TEXTURES = "textures"
    COATS = "coats"
    HOLES = "holes"
    INVISIBLE = "invisible"
    UNUSED_PRIORITIES = "unused priorities"

    # What is right and shows nothing.
    BLACK = "black"

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
