"""What glTF materials make of the objects that have them: bodies, thin walls, or opaque objects.

=================================================  ==================================================================
material                                           object
=================================================  ==================================================================
transmissionFactor > 0 and thicknessFactor > 0     body: the medium of attenuationColor at attenuationDistance, and
                                                   the ior; its thickness is the true one of the mesh, along each
                                                   ray, and thicknessFactor and thicknessTexture are not needed
transmissionFactor > 0, no volume or thickness 0   thin wall: a sheet without an inside, which light crosses once per
                                                   face, tinted by baseColorFactor. It is infinitely thin by the
                                                   specification; here a sheet that hardly adds to the thickness
everything else                                    opaque: reflects baseColorFactor diffusely. A volume alone, or with
                                                   transmissionFactor 0, lets no light in
=================================================  ==================================================================

The tint of a wall is that of a straight view. A slanted view has it deeper, as in a pane with the wall's ior: at most
by the 1.34th power with the ior of 1.5 that materials have by default.

Metal, roughness, normal maps and occlusion are not read: surfaces do not reflect or blur here.
Source: glTF 2.0, section 3.9, KHR_materials_transmission (infinitely thin) and KHR_materials_volume.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from translucent.gltf.fields import extension, label, number, numbers, refused, section
from translucent.gltf.left_out import LeftOut
from translucent.materials.color_distance import extinction_at
from translucent.materials.gltf import DEFAULT_IOR, TRANSMISSION, GltfMaterial, materials_of
from translucent.materials.gltf_file import GltfFile, Json
from translucent.medium import Medium
from translucent.scene import OPAQUE_COLOR

Array = npt.NDArray[np.float64]

#: Lets light into a volume, too, spread by the surface; here it passes straight.
_DIFFUSE = "KHR_materials_diffuse_transmission"


@dataclass(frozen=True, eq=False)
class Surface:
    """What an object of a material is.

    Attributes
    ----------
    color : (3,)
        baseColorFactor, linear: what an opaque object reflects, and by which a wall tints.
    medium : Medium or None
        What fills a body.
    wall_ior : float or None
        Index of refraction of a thin wall; None if it is none.
    """

    color: npt.ArrayLike = OPAQUE_COLOR
    medium: Medium | None = None
    wall_ior: float | None = None

    def wall_medium(self, thickness: float) -> Medium:
        """The medium that tints like the wall when it fills a sheet of this thickness in metres."""
        return Medium(absorption=extinction_at(self.color, thickness), ior=self.wall_ior or DEFAULT_IOR)


def surface_reader(file: GltfFile, metres: float, left_out: LeftOut) -> Callable[[int | None], Surface]:
    """A function from the index of a material to its surface, each read once; None is that of no material.

    Parameters
    ----------
    file : GltfFile
    metres : float
        Per unit of the file, in which attenuation distances are.
    left_out : LeftOut
        Gets what the surfaces do not hold.
    """
    materials, entries = materials_of(file), file.items("materials")

    @cache
    def read(index: int | None) -> Surface:
        if index is None:
            return Surface()
        name = label(entries, index)
        surface = _surface(file, f"material {name}", materials[index], entries[index], metres)
        _note_losses(file, name, surface, materials[index], entries[index], left_out)
        return surface

    return read


def _surface(file: GltfFile, where: str, material: GltfMaterial, entry: Json, metres: float) -> Surface:
    color = numbers(file, where, _base(file, where, entry), "baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3]
    if not ((color >= 0) & (color <= 1)).all():
        raise refused(file, f"{where}: baseColorFactor {color.tolist()} is not in 0..1", "mend the file")
    diffuse = number(file, where, extension(file, where, entry, _DIFFUSE), "diffuseTransmissionFactor", 0.0)
    if (medium := material.medium()) is not None and (material.transmission > 0 or diffuse > 0):
        return Surface(color, Medium(absorption=medium.extinction / metres, ior=medium.ior))
    return Surface(color, wall_ior=(material.ior or DEFAULT_IOR) if material.transmission > 0 else None)


def _base(file: GltfFile, where: str, entry: Json) -> Json:
    return section(file, where, entry, "pbrMetallicRoughness")


def _note_losses(
    file: GltfFile, name: str, surface: Surface, material: GltfMaterial, entry: Json, left_out: LeftOut
) -> None:
    if "baseColorTexture" in _base(file, name, entry):
        left_out.add("base color textures", name)
    if any(material.emissive):
        left_out.add("glowing surfaces", name)
    if (mode := entry.get("alphaMode", "OPAQUE")) != "OPAQUE":
        left_out.add(f"transparency by alphaMode {mode}", name)
    if surface.medium is not None and (np.asarray(surface.color) != 1).any():
        left_out.add("tints of the surfaces of bodies (baseColorFactor)", name)
    if surface.medium is not None and material.transmission == 0:
        left_out.add("diffuse transmission, drawn as clear", name)
    if 0 < material.transmission < 1:
        left_out.add("transmissionFactor below 1, drawn as 1", name)
    if material.transmission > 0 and "transmissionTexture" in extension(file, name, entry, TRANSMISSION):
        left_out.add("transmission textures", name)
