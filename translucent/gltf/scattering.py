"""Drafts of glTF extensions for media that scatter: read and written where they are asked for.

========================  ================================================================  =====================
extension                 field here                                                        default
========================  ================================================================  =====================
KHR_materials_scatter     strength: scatterStrengthFactor, 0..1                             0
                          color: multiscatterColorFactor, linear, 0..1                      (1, 1, 1)
                          anisotropy: scatterAnisotropy, -1 < g < 1                         0
KHR_materials_volume_     color: multiscatterColorFactor, or multiscatterColor or           (0, 0, 0)
scatter                   scatterAlbedo of older texts
                          anisotropy: scatterAnisotropy                                     0
========================  ================================================================  =====================

Both count only with a volume. The attenuation of KHR_materials_volume is then the extinction, sigma_t = -ln(c) / d, and
sigma_s = a sigma_t with the albedo a of single scattering (Kulla & Conty 2017, see `translucent.media.albedo`):

- KHR_materials_scatter: a is that of the color strength * color and of the anisotropy g.
- KHR_materials_volume_scatter: a is that of the color for g = 0, whatever the anisotropy.

Source: Khronos, glTF pull request 2579, KHR_materials_scatter, commit 0addbb0 of 2026-07-02 (its schema still calls the
strength scatterFactor); pull request 2453, KHR_materials_volume_scatter, commit 4608553 of 2025-07-16. Neither is
ratified: names, defaults and formulas may change.

Not read: textures of color and strength, and the thin-walled mode of KHR_materials_scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gltf.checked import Fields, Triple
from translucent.gltf.file import Json
from translucent.media.albedo import hulst_albedo, hulst_color
from translucent.media.medium import Medium

SCATTER = "KHR_materials_scatter"
VOLUME_SCATTER = "KHR_materials_volume_scatter"
DIFFUSE_TRANSMISSION = "KHR_materials_diffuse_transmission"

#: Short names of the drafts that can be written.
Draft = Literal["scatter", "volume-scatter"]
DRAFTS: dict[Draft, str] = {"scatter": SCATTER, "volume-scatter": VOLUME_SCATTER}

#: Spellings of a field, the present one first.
_STRENGTHS = ("scatterStrengthFactor", "scatterFactor")
_COLORS = ("multiscatterColorFactor", "multiscatterColor", "scatterAlbedo")


@dataclass(frozen=True)
class DraftScattering:
    """Scattering of a material, as a draft extension states it.

    Attributes
    ----------
    extension : str
    color : (3,)
        Linear color of a thick body after many events: the multi-scatter albedo.
    anisotropy : float
        Henyey-Greenstein g.
    strength : float
        Share of the color that counts.
    """

    extension: str
    color: Triple
    anisotropy: float = 0.0
    strength: float = 1.0

    @property
    def albedo(self) -> Array:
        """(3,): albedo of single scattering."""
        g = self.anisotropy if self.extension == SCATTER else 0.0
        return hulst_albedo(self.strength * np.asarray(self.color), g)

    def medium(self, extinction: Array, ior: float) -> Medium:
        """Medium with this extinction (3,) in 1/m, of which a part scatters."""
        share = self.albedo
        return Medium((1.0 - share) * extinction, share * extinction, anisotropy=self.anisotropy, ior=ior)


def read_draft(extensions: Json, problems: list[str], told: list[str]) -> DraftScattering | None:
    """Scattering that a material's extensions state; the newer draft wins. None if there is none.

    Parameters
    ----------
    extensions : dict
    problems : list of str
        Gets values of a wrong type or beyond their range.
    told : list of str
        Gets what is not read.
    """
    name = next((one for one in (SCATTER, VOLUME_SCATTER) if one in extensions), None)
    if name is None:
        return None
    fields = Fields(extensions[name], name, problems)
    told += [f"{name} has {key}, which is not read" for key in fields.values if key.endswith("Texture")]
    anisotropy = fields.number("scatterAnisotropy", 0.0, -1.0, 1.0)
    if abs(anisotropy) == 1.0:
        problems.append(f"scatterAnisotropy {anisotropy:g} is not between -1 and 1")
        anisotropy = 0.0
    color = fields.triple(_spelling(fields, _COLORS), (1.0, 1.0, 1.0) if name == SCATTER else (0.0, 0.0, 0.0))
    strength = 1.0 if name == VOLUME_SCATTER else fields.number(_spelling(fields, _STRENGTHS), 0.0, 0.0, 1.0)
    if name == SCATTER and not any(key in fields.values for key in _STRENGTHS):
        told.append(f"{name} has no scatterStrengthFactor, which is 0 by default: nothing scatters")
    return DraftScattering(name, color, anisotropy, strength)


def draft_extension(medium: Medium, draft: Draft) -> Json:
    """Extension, by its name, that states how a medium scatters; empty for one that does not."""
    if not medium.scatters:
        return {}
    extinction, scattering = medium.extinction, np.asarray(medium.scattering)
    albedo = np.divide(scattering, extinction, out=np.zeros(3), where=extinction > 0).clip(0.0, 1.0)
    color = hulst_color(albedo, medium.anisotropy if draft == "scatter" else 0.0)
    stated: Json = {"multiscatterColorFactor": color.tolist(), "scatterAnisotropy": medium.anisotropy}
    return {DRAFTS[draft]: ({"scatterStrengthFactor": 1} if draft == "scatter" else {}) | stated}


def check_draft(draft: Draft | None) -> None:
    """Raise `InputError` unless this is the name of a draft, or None."""
    if draft is not None and draft not in get_args(Draft):
        raise InputError(f"draft_extensions {draft!r}", "not known", f"use {' or '.join(map(repr, DRAFTS))}, or None")


def _spelling(fields: Fields, names: Sequence[str]) -> str:
    """The first of several names that is stated, or the first of all."""
    return next((name for name in names if name in fields.values), names[0])
