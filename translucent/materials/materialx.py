"""MaterialX documents with one surface shader and constant inputs: OpenPBR Surface and Autodesk Standard Surface.

Both store a homogeneous medium alike; a `SurfaceShader` names the inputs. A depth of 0 makes the color a tint of the
surface: it is read as a medium without extinction.

Formula, with T the transmission color, S the scatter color and lambda the depth:
mu_t = -ln(T) / lambda, mu_s = S / lambda, mu_a = mu_t - mu_s; where a channel of mu_a is negative, all are raised by
the same amount (a shift by gray), so that none is. With T = 1 and S = 0 there is no medium, and nothing is divided by
it. Written the other way round, mu_a is never negative, so what is written is read back as it was. lambda is chosen so
that no channel of T is darker than 1e-5 and none of S is above 1.
Source: OpenPBR Surface 1.1, "Translucent base", and its node graph in MaterialX, which computes just this. Autodesk
Standard Surface 1.0.1, "Specular transmission", says in words that depth and color are as in Beer's law and that the
scatter color sets the scattering; the formula is that of its origin, Arnold, which OpenPBR took over unchanged, and
MaterialX translates the two into each other input by input.

Units: depths are in scene units; `unit` says which. Colors are linear Rec.709 (``colorspace="lin_rec709"``).
Not carried over: emission of the medium. When reading, inputs that are driven by nodes or textures are refused.
Known losses elsewhere: renderers that draw Standard Surface by MaterialX's own graph see a tint of the surface, as that
graph has no depth; from version 1.2 on, OpenPBR takes the scatter color for an albedo, mu_s = S mu_t, so that documents
that scatter must be read as version 1.1 (media that only absorb mean the same).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.color import srgb_to_linear
from translucent.materials.target import ExportTarget
from translucent.media.medium import Medium, color_at, extinction_at
from translucent.units import metres_per_unit

_LINEAR = ("lin_rec709", "none", "")
_SRGB = "srgb_texture"


@dataclass(frozen=True)
class SurfaceShader:
    """Surface shader: its name, its inputs for transmission, and the last supported version.

    Attributes
    ----------
    node, title : str
        Its name in MaterialX, and for people.
    weight, color, depth, scatter, anisotropy, ior, roughness : str
        Names of the inputs.
    default_roughness : float
        Where a document states none.
    last_version : (int, int), optional
        Scatter colors of later versions are refused; None: no later one is known.
    """

    node: str
    weight: str
    ior: str
    title: str
    default_roughness: float
    color: str = "transmission_color"
    depth: str = "transmission_depth"
    scatter: str = "transmission_scatter"
    anisotropy: str = "transmission_scatter_anisotropy"
    roughness: str = "specular_roughness"
    last_version: tuple[int, int] | None = None

    def defaults(self) -> dict[str, float | Array]:
        """Default values of the inputs that are read, which also give the types of the inputs."""
        return {
            self.weight: 0.0,
            self.color: np.ones(3),
            self.depth: 0.0,
            self.scatter: np.zeros(3),
            self.anisotropy: 0.0,
            self.ior: 1.5,
        }

    def write(
        self,
        medium: Medium,
        distance: float | None = None,
        unit: str = "m",
        roughness: float = 0.0,
    ) -> str:
        """Write a MaterialX 1.39 document with such a surface around a medium.

        Parameters
        ----------
        medium : Medium
            Emission is lost.
        distance : float, optional
            Where the color is stated, in metres; None: where the densest channel lets 1/e pass.
        unit : str
            Unit of the scene's lengths, for the depth.
        roughness : float
            Of the surface, 0 to 1.
        """
        root = ElementTree.Element("materialx", version="1.39", colorspace="lin_rec709")
        surface = ElementTree.SubElement(root, self.node, name="translucent_surface", type="surfaceshader")
        for key, value in transmission_inputs(self, medium, distance, unit, roughness).items():
            scalar = isinstance(value, float)
            text = f"{value!r}" if scalar else ", ".join(repr(channel) for channel in np.asarray(value).tolist())
            ElementTree.SubElement(surface, "input", name=key, type="float" if scalar else "color3", value=text)
        material = ElementTree.SubElement(root, "surfacematerial", name="translucent", type="material")
        link = {"name": "surfaceshader", "type": "surfaceshader", "nodename": "translucent_surface"}
        ElementTree.SubElement(material, "input", link)
        ElementTree.indent(root)
        return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'

    def read(self, text: str, unit: str = "m") -> Medium:
        """Read the medium of the first such surface in a MaterialX document, whose lengths are in `unit`.

        Raises
        ------
        InputError
            If the document is broken, has no such surface, or inputs are out of range or not constant; or if it is of a
            version later than the last supported one and scatters.
        """
        what = f"{self.title} document"
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise InputError(
                what,
                "the file declares XML entities, which may expand without limit",
                "export the file without a DOCTYPE",
            )
        try:
            root = ElementTree.fromstring(text)
        except (ElementTree.ParseError, ValueError) as error:
            raise InputError(what, f"the XML of the file is broken ({error})", "export the file again") from error
        surface = next(root.iter(self.node), None)
        if surface is None:
            raise InputError(what, f"the file has no element <{self.node}>", "export a surface of this type")
        space = root.get("colorspace", "lin_rec709")
        inputs = {element.get("name", ""): element for element in surface.iter("input")}
        stated: dict[str, float | Array] = {}
        for key, default in self.defaults().items():
            if (element := inputs.get(key)) is None:
                continue
            if (value := element.get("value")) is None:
                raise InputError(what, f"{key} is connected to a node", "give this input a constant value")
            stated[key] = parse_value(what, key, value.split(","), default, element.get("colorspace", space))
        version = surface.get("version", "")
        stated_version = tuple(map(int, re.findall(r"\d{1,9}", version)[:2]))
        newer = self.last_version is not None and stated_version > self.last_version
        if newer and np.any(stated.get(self.scatter, 0.0)):
            raise InputError(
                what,
                f"the file has version {version}, in which the scatter color has another meaning",
                "export the file as version 1.1",
            )
        return medium_of(self, stated, metres_per_unit(unit))


def transmission_inputs(
    shader: SurfaceShader, medium: Medium, distance: float | None = None, unit: str = "m", roughness: float = 0.0
) -> dict[str, float | Array]:
    """Values of a shader's inputs that hold this medium; depth 0 for one without extinction.

    Parameters
    ----------
    shader : SurfaceShader
    medium : Medium
    distance : float, optional
        Where the color is stated, in metres; see `color_at`. Shortened where the scatter color would exceed 1.
    unit : str
        Unit of the scene's lengths.
    roughness : float
        Of the surface, 0 to 1.
    """
    strongest = float(np.max(medium.scattering))
    color, metres = color_at(medium, distance)
    if strongest > 0 and strongest * metres > 1:
        color, metres = color_at(medium, 1.0 / strongest)
    depth = 0.0 if not medium.extinction.any() else metres
    return {
        shader.weight: 1.0,
        shader.color: color,
        shader.depth: depth / metres_per_unit(unit),
        shader.scatter: np.asarray(medium.scattering) * depth,
        shader.anisotropy: medium.anisotropy,
        shader.ior: medium.ior,
        shader.roughness: float(roughness),
    }


def medium_of(shader: SurfaceShader, stated: Mapping[str, float | Array], metres: float) -> Medium:
    """The medium of a shader's inputs, colors linear, whose lengths are in units of `metres`; see `Shader.defaults`."""
    what, values = f"{shader.title} surface", {**shader.defaults(), **stated}
    weight, depth, ior, anisotropy = (
        float(values[key]) for key in (shader.weight, shader.depth, shader.ior, shader.anisotropy)
    )
    color, scatter = np.asarray(values[shader.color]), np.asarray(values[shader.scatter])
    if weight == 0:
        raise InputError(what, f"{shader.weight} is 0, so the material is opaque", "use a weight above 0")
    if not ((color >= 0).all() and (color <= 1).all() and (scatter >= 0).all() and 0 <= depth < math.inf):
        raise InputError(
            what, "the transmission color is outside 0..1, or the depth is negative", "correct these values"
        )
    depth *= metres
    if depth == 0:  # a tint of the surface: there is no medium
        return Medium(ior=ior)
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):  # a medium refuses what is not finite
        scattering = scatter / depth
        absorption = extinction_at(color, depth) - scattering
        shifted = absorption - min(0.0, float(absorption.min()))
    return Medium(absorption=shifted, scattering=scattering, anisotropy=anisotropy, ior=ior)


def parse_value(what: str, key: str, parts: list[str], default: float | Array, space: str) -> float | Array:
    """Parse a number, or a color, which is converted from its color space to linear, from texts."""
    scalar = isinstance(default, float)
    try:
        numbers = np.array([float(part) for part in parts])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.shape != (1 if scalar else 3,) or not np.isfinite(numbers).all():
        kind = "a number" if scalar else "three numbers"
        raise InputError(what, f"the value of {key} is {', '.join(parts)!r}, and not {kind}", "correct this value")
    if scalar:
        return float(numbers[0])
    if space not in (*_LINEAR, _SRGB):
        raise InputError(what, f"the color space is {space!r}", "use the color space lin_rec709 or srgb_texture")
    return srgb_to_linear(numbers) if space == _SRGB else numbers


OPENPBR = SurfaceShader(
    "open_pbr_surface",
    title="OpenPBR",
    weight="transmission_weight",
    ior="specular_ior",
    default_roughness=0.3,
    last_version=(1, 1),
)
STANDARD_SURFACE = SurfaceShader(
    "standard_surface", title="Standard Surface", weight="transmission", ior="specular_IOR", default_roughness=0.2
)


def _target(shader: SurfaceShader) -> ExportTarget:
    return ExportTarget(
        shader.title,
        lambda medium, distance, roughness: shader.write(medium, distance, roughness=roughness),
        ".mtlx",
        lambda text, unit: (OPENPBR if "<open_pbr_surface" in text else STANDARD_SURFACE).read(text, unit),
        _roughness,
    )


def _roughness(text: str) -> float:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("entities may unpack into anything")
    root = ElementTree.fromstring(text)
    shader, surface = OPENPBR, root.find(f".//{OPENPBR.node}")
    if surface is None:
        shader, surface = STANDARD_SURFACE, root.find(f".//{STANDARD_SURFACE.node}")
    found = None if surface is None else surface.find(f"./input[@name='{shader.roughness}']")
    return shader.default_roughness if found is None else float(found.get("value", "0"))


OPENPBR_TARGET, STANDARD_SURFACE_TARGET = _target(OPENPBR), _target(STANDARD_SURFACE)
