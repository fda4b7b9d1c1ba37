"""Translucent glTF 2.0 materials: the volume of the KHR extensions, read and checked.

============================  =======================================================  =======================
extension                     field here                                               default
============================  =======================================================  =======================
KHR_materials_transmission    transmission: fraction of light that enters, 0..1           0
KHR_materials_volume          attenuation_color: linear, 0..1 per channel              (1, 1, 1)
KHR_materials_volume          attenuation_distance: metres of the **world**, > 0       infinity
KHR_materials_volume          thickness (factor), >= 0, in **mesh** space              0: thin-walled
KHR_materials_volume          thickness_texture: its G channel multiplies the factor   none
KHR_texture_transform         thickness_transform: of the UVs of that texture          none
KHR_materials_ior             ior: 0 or >= 1                                           1.5
KHR_materials_dispersion      dispersion = 20 / Abbe number, >= 0                      0
KHR_materials_iridescence     iridescence: fraction of the surface with a thin film, 0..1  0
KHR_materials_iridescence     iridescence_ior: of the film, >= 1                       1.3
KHR_materials_iridescence     iridescence_thickness: **metres** of the file's nm       400e-9
KHR_materials_clearcoat       clearcoat, clearcoat_roughness: 0..1                     0
KHR_materials_emissive_...    emissive: factor times strength, linear, of the surface  (0, 0, 0)
============================  =======================================================  =======================

Formula: sigma_t = -ln(attenuation_color) / attenuation_distance; T(x) = attenuation_color^(x / attenuation_distance).
The extension's text calls the distance "the average distance that light travels before interacting with a particle";
by its formula that is so only for a color of 1/e. Here the formula rules: it is where white light has the color.
A node's scale acts on the thickness and not on the distance; `translucent.gltf.nodes` does that.

Source: Khronos, glTF 2.0, and the ratified texts of the extensions above.

A film whose thickness varies by a texture has the mean of its least and its greatest here.

Not carried into a `Medium`: emission of the surface, dispersion, films, clear coats, base color, roughness, textures of
transmission. Not known to ratified glTF: scattering, anisotropy and emission of the volume. A medium that scatters is
written as its extinction, so that what passes straight on is the same; `translucent.gltf.write` says so in a warning.

Drafts of extensions for media that scatter are read and written where they are requested:

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

Source of the drafts: Khronos, glTF pull request 2579, KHR_materials_scatter, commit 0addbb0 of 2026-07-02 (its schema
still calls the strength scatterFactor); pull request 2453, KHR_materials_volume_scatter, commit 4608553 of 2025-07-16.
Neither is ratified: names, defaults and formulas may change.

Not read of them: textures of color and strength, and the thin-walled mode of KHR_materials_scatter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, Literal

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gltf.file import GltfFile, Json, JsonFields, Triple, read_gltf
from translucent.gltf.textures import TEXTURE_TRANSFORM, TextureTransform, texture_transform
from translucent.media.albedo import hulst_albedo, hulst_color
from translucent.media.conversion import html_strip
from translucent.media.medium import BLACKEST, Medium, extinction_at

TRANSMISSION = "KHR_materials_transmission"
VOLUME = "KHR_materials_volume"
IOR = "KHR_materials_ior"
EMISSIVE_STRENGTH = "KHR_materials_emissive_strength"
DISPERSION = "KHR_materials_dispersion"
IRIDESCENCE = "KHR_materials_iridescence"
CLEARCOAT = "KHR_materials_clearcoat"
#: Extensions that must not be used with a volume.
EXCLUDED = ("KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness")

#: Default index of refraction.
DEFAULT_IOR = 1.5

_VOLUME_KEYS = {
    "thicknessFactor", "thicknessTexture", "attenuationDistance", "attenuationColor", "extensions", "extras",
}  # fmt: skip
_UNSUMMARIZED = ("scatter", "has_volume", "transmits", "warnings")

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
        Fraction of the color that counts.
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
        """Medium with this extinction (3,) in 1/m; its albedo scatters."""
        fraction = self.albedo
        return Medium((1.0 - fraction) * extinction, fraction * extinction, anisotropy=self.anisotropy, ior=ior)


def read_draft(extensions: JsonFields, notes: list[str]) -> DraftScattering | None:
    """Scattering that a material's extensions state; the newer draft wins. None if there is none.

    Parameters
    ----------
    extensions : JsonFields
    notes : list of str
        Gets what is not read.
    """
    name = next((one for one in (SCATTER, VOLUME_SCATTER) if one in extensions.values), None)
    if name is None:
        return None
    fields = extensions.section(name)
    notes += [f"{name} has {key}, which is not read" for key in fields.values if key.endswith("Texture")]
    anisotropy = fields.number("scatterAnisotropy", 0.0, -1.0, 1.0)
    if abs(anisotropy) == 1.0:
        fields.refuse(f"scatterAnisotropy {anisotropy:g} is not between -1 and 1")
        anisotropy = 0.0
    default: Triple = (1.0, 1.0, 1.0) if name == SCATTER else (0.0, 0.0, 0.0)
    color = fields.numbers(_spelling(fields, _COLORS), default, 0.0, 1.0)
    strength = 1.0 if name == VOLUME_SCATTER else fields.number(_spelling(fields, _STRENGTHS), 0.0, 0.0, 1.0)
    if name == SCATTER and not any(key in fields.values for key in _STRENGTHS):
        notes.append(f"{name} has no scatterStrengthFactor; the default is 0, so nothing scatters")
    return DraftScattering(name, color, anisotropy, strength)


def draft_extension(medium: Medium, draft: Draft) -> Json:
    """Name of the extension that states scattering of the material; empty if there is none."""
    if not medium.scatters:
        return {}
    extinction, scattering = medium.extinction, np.asarray(medium.scattering)
    albedo = np.divide(scattering, extinction, out=np.zeros(3), where=extinction > 0).clip(0.0, 1.0)
    color = hulst_color(albedo, medium.anisotropy if draft == "scatter" else 0.0)
    stated: Json = {"multiscatterColorFactor": color.tolist(), "scatterAnisotropy": medium.anisotropy}
    return {DRAFTS[draft]: ({"scatterStrengthFactor": 1} if draft == "scatter" else {}) | stated}


def _spelling(fields: JsonFields, names: Sequence[str]) -> str:
    """The first of several names that is stated, or the first of all."""
    return next((name for name in names if name in fields.values), names[0])


@dataclass(frozen=True)
class GltfMaterial:
    """Volume of a glTF material; lengths and ranges are those of the module's table.

    Parameters
    ----------
    index : int
        In the file's list of materials.
    name : str
        Empty if it has none.
    scatter : DraftScattering, optional
        How the volume scatters, where drafts of extensions are read.
    has_volume : bool
        Whether KHR_materials_volume is there.
    transmits : bool
        Whether light can enter: by transmission, by diffuse transmission, or by an extension that is not known.
    thickness_texture : int, optional
        Index in the file's list of textures.
    thickness_transform : TextureTransform
        Which UVs it is read at; see `translucent.gltf.nodes.thickness_at`.
    warnings : tuple of str
        What is allowed, and yet not as it should be.
    """

    index: int
    name: str = ""
    transmission: float = 0.0
    ior: float = DEFAULT_IOR
    thickness: float = 0.0
    attenuation_color: Triple = (1.0, 1.0, 1.0)
    attenuation_distance: float = math.inf
    dispersion: float = 0.0
    emissive: Triple = (0.0, 0.0, 0.0)
    iridescence: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: float = 400e-9
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    thickness_texture: int | None = None
    thickness_transform: TextureTransform = field(default_factory=TextureTransform)
    scatter: DraftScattering | None = None
    has_volume: bool = False
    transmits: bool = False
    warnings: tuple[str, ...] = ()

    @property
    def has_thickness_texture(self) -> bool:
        """True if a texture scales the thickness."""
        return self.thickness_texture is not None

    @property
    def kind(self) -> Literal["opaque", "thin wall", "volume"]:
        """Kind of object that the material makes."""
        return "opaque" if not self.transmits else "thin wall" if self.medium() is None else "volume"

    def medium(self) -> Medium | None:
        """Medium inside; None if the material is opaque, or a thin wall without an inside (thickness 0).

        A black channel is read as `BLACKEST`, and an ior of 0 (which glTF has for old materials) as 1.5; both are among
        the warnings. The index of refraction is the only thing that a medium takes from the surface.
        """
        if not (self.has_volume and self.transmits and self.thickness > 0):
            return None
        extinction = extinction_at(self.attenuation_color, self.attenuation_distance)
        ior = self.ior or DEFAULT_IOR
        return Medium(absorption=extinction, ior=ior) if self.scatter is None else self.scatter.medium(extinction, ior)

    def _repr_html_(self) -> str:
        """Name and swatches of the medium, for notebooks."""
        medium, distance = self.medium(), self.attenuation_distance
        head = f"<div>{self.index} {escape(repr(self.name))}: {self.kind}</div>"
        if medium is None:
            return head
        return head + html_strip(medium.extinction, distance if math.isfinite(distance) else None)

    def summary(self) -> dict[str, Any]:
        """Fields and medium as values that JSON can hold; None is an infinite distance."""
        medium, textured = self.medium(), self.has_thickness_texture
        return {
            **{name: getattr(self, name) for name in self.__dataclass_fields__ if name not in _UNSUMMARIZED},
            "thickness_transform": vars(self.thickness_transform) if textured else None,
            "attenuation_color": list(self.attenuation_color),
            "attenuation_distance": self.attenuation_distance if math.isfinite(self.attenuation_distance) else None,
            "emissive": list(self.emissive),
            "extinction": None if medium is None else medium.extinction.tolist(),
            "scattering": None if medium is None else np.asarray(medium.scattering).tolist(),
            "warnings": list(self.warnings),
        }


@checked
def read_materials(path: str | Path, *, draft_extensions: bool = False) -> list[GltfMaterial]:
    """Read all materials of a .gltf or .glb file, in its order, without the files that it links to.

    Parameters
    ----------
    path : path
    draft_extensions : bool
        Whether to read extensions that are drafts, too; see `translucent.gltf.materials`.

    Raises
    ------
    InputError
        If the file cannot be read, or a value has a wrong type or is out of its range; all such values of the first
        bad material are named.
    """
    return materials_of(read_gltf(path), draft_extensions=draft_extensions)


def materials_of(file: GltfFile, *, draft_extensions: bool = False) -> list[GltfMaterial]:
    """Read all materials of an open file; see `read_materials`."""
    return [_material(file, index, entry, draft_extensions) for index, entry in enumerate(file.items("materials"))]


def volume_extensions_of(index: int, material: Json) -> Json:
    """Extensions of a material in a file's JSON; raises `InputError` if one of them excludes a volume."""
    found: Json = material.setdefault("extensions", {})
    if excluded := [name for name in EXCLUDED if name in found]:
        requested = f"material {index} {material.get('name', '')!r}"
        raise InputError(
            requested,
            f"the extension {excluded[0]} of the material excludes a volume",
            "use another material for this object",
        )
    return found


def _film_thickness(film: JsonFields) -> float:
    """Thickness of a film in nanometres: the mean of both ends where a texture chooses between them."""
    least, greatest = (
        film.number(f"iridescenceThickness{end}", nm, 0.0) for end, nm in (("Minimum", 100.0), ("Maximum", 400.0))
    )
    return 0.5 * (least + greatest) if "iridescenceThicknessTexture" in film.values else greatest


def _material(file: GltfFile, index: int, entry: Json, draft_extensions: bool) -> GltfMaterial:
    name = str(entry.get("name", ""))
    problems: list[str] = []
    notes: list[str] = []
    fields = JsonFields(file, f"material {index} {name!r}", entry, problems)
    stated = fields.section("extensions")
    extensions = stated.values
    transmission, volume, ior, strength, dispersion, film, coat = (
        stated.section(key)
        for key in (TRANSMISSION, VOLUME, IOR, EMISSIVE_STRENGTH, DISPERSION, IRIDESCENCE, CLEARCOAT)
    )
    problems += [
        f"{key} must not be inside pbrMetallicRoughness"
        for key in fields.section("pbrMetallicRoughness").section("extensions").values
        if key.startswith("KHR_materials_")
    ]
    scale = strength.number("emissiveStrength", 1.0, 0.0)
    red, green, blue = fields.numbers("emissiveFactor", (0.0, 0.0, 0.0), 0.0, 1.0)
    index_of_refraction = ior.number("ior", DEFAULT_IOR, 0.0)
    texture, transform = _thickness_texture(volume, len(file.items("textures")))
    if 0 < index_of_refraction < 1:
        problems.append(f"the ior is {index_of_refraction:g}, but must be 0, or at least 1")
    found = GltfMaterial(
        index=index,
        name=name,
        transmission=(fraction := transmission.number("transmissionFactor", 0.0, 0.0, 1.0)),
        ior=index_of_refraction,
        thickness=volume.number("thicknessFactor", 0.0, 0.0),
        attenuation_color=volume.numbers("attenuationColor", (1.0, 1.0, 1.0), 0.0, 1.0),
        attenuation_distance=volume.number("attenuationDistance", math.inf, 0.0, above=True),
        dispersion=dispersion.number("dispersion", 0.0, 0.0),
        iridescence=film.number("iridescenceFactor", 0.0, 0.0, 1.0),
        iridescence_ior=film.number("iridescenceIor", 1.3, 1.0),
        iridescence_thickness=1e-9 * _film_thickness(film),
        clearcoat=coat.number("clearcoatFactor", 0.0, 0.0, 1.0),
        clearcoat_roughness=coat.number("clearcoatRoughnessFactor", 0.0, 0.0, 1.0),
        emissive=(scale * red, scale * green, scale * blue),
        thickness_texture=texture,
        thickness_transform=transform,
        scatter=read_draft(stated, notes) if draft_extensions else None,
        has_volume=VOLUME in extensions,
        transmits=fraction > 0 or _lets_light_in(extensions),
    )
    if problems:
        raise file.refused(f"{fields.where}: {', '.join(problems)}", "correct the file")
    return GltfMaterial(**{**vars(found), "warnings": (*_warnings(found, entry, extensions, volume.values), *notes)})


def _thickness_texture(volume: JsonFields, count: int) -> tuple[int | None, TextureTransform]:
    """Index of the thickness texture, below `count`, and its transform; None if there is none."""
    key = "thicknessTexture"
    info = volume.section(key)
    if key not in volume.values or info.values is not volume.values[key]:
        return None, TextureTransform()
    index = info.values.get("index")
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < count:
        volume.refuse(f"{key} has the index {index!r}, but the file has {count} textures")
        return None, TextureTransform()
    return index, texture_transform(info)


def _lets_light_in(extensions: Json) -> bool:
    """True if light may enter other than by transmission: diffusely, or by an extension that is not known."""
    return any(
        key == DIFFUSE_TRANSMISSION or (not key.startswith("KHR_") and key not in EXCLUDED) for key in extensions
    )


def _warnings(found: GltfMaterial, entry: Json, extensions: Json, volume: Json) -> list[str]:
    """Warnings about valid but suspicious values; the first three are those of the glTF validator."""
    if not found.has_volume:
        return []
    notes = [f"{VOLUME} has an unknown property {key!r}" for key in volume if key not in _VOLUME_KEYS]
    if TRANSMISSION not in extensions and not _lets_light_in(extensions):
        notes.append(f"{VOLUME} without {TRANSMISSION}: no light enters, so the material is opaque")
    if entry.get("doubleSided") is True and found.thickness > 0:
        notes.append("the material is double-sided, but a volume should not be")
    notes += [f"{key} excludes {VOLUME}" for key in EXCLUDED if key in extensions]
    black = [c for c, value in zip(("red", "green", "blue"), found.attenuation_color, strict=True) if value == 0]
    if black and math.isfinite(found.attenuation_distance):
        verb = "is" if len(black) == 1 else "are"
        notes.append(f"attenuationColor {' and '.join(black)} {verb} 0 and was read as {BLACKEST:g}, to stay finite")
    if found.ior == 0:
        notes.append(f"ior is 0 and was read as {DEFAULT_IOR:g}")
    if found.thickness == 0 and math.isfinite(found.attenuation_distance):
        notes.append("thicknessFactor is 0: the material is a thin wall, and its attenuation has no effect")
    texture = volume.get("thicknessTexture")
    for key in texture.get("extensions", {}) if isinstance(texture, dict) else ():
        if key != TEXTURE_TRANSFORM:
            notes.append(f"thicknessTexture has {key}, which is not read")
    return notes
