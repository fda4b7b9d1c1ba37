"""MaterialX documents with one surface shader and constant inputs: OpenPBR Surface and Autodesk Standard Surface.

Both store a homogeneous medium alike; the modules `openpbr` and `standard_surface` name the inputs.

Formula, with T the transmission color, S the scatter color and lambda the depth:
mu_t = -ln(T) / lambda, mu_s = S / lambda, mu_a = mu_t - mu_s; where a channel of mu_a is negative, all are raised by
the same amount (a shift by grey), so that none is. With T = 1 and S = 0 there is no medium, and nothing is divided by
it. Written the other way round, mu_a is never negative, so what is written is read back as it was. lambda is chosen so
that no channel of T is darker than 1e-5 and none of S is above 1.
Source: OpenPBR Surface 1.1, "Translucent base"; Autodesk Standard Surface 1.0.1, "Transmission".

Units: depths are in scene units; `unit` says which. Colors are linear Rec.709 (``colorspace="lin_rec709"``).
Not carried over: emission of the medium. When reading, inputs that are driven by nodes or textures are refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from translucent.color import srgb_to_linear
from translucent.errors import InputError
from translucent.materials.color_distance import color_at, extinction_at
from translucent.medium import Medium
from translucent.units import metres_per_unit

Array = npt.NDArray[np.float64]

_LINEAR = ("lin_rec709", "none", "")
_SRGB = "srgb_texture"


@dataclass(frozen=True)
class Shader:
    """Name of a surface shader and of its inputs for transmission, with the default of its index of refraction."""

    node: str
    weight: str
    ior: str
    title: str
    color: str = "transmission_color"
    depth: str = "transmission_depth"
    scatter: str = "transmission_scatter"
    anisotropy: str = "transmission_scatter_anisotropy"
    default_ior: float = 1.5


def transmission_inputs(
    shader: Shader, medium: Medium, distance: float | None = None, unit: str = "m"
) -> dict[str, float | Array]:
    """Values of a shader's inputs that hold this medium; depth 0 for one without extinction.

    Parameters
    ----------
    shader : Shader
    medium : Medium
    distance : float, optional
        Where the color is stated, in metres; see `color_at`. Shortened where the scatter color would exceed 1.
    unit : str
        Unit of the scene's lengths.
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
    }


def write_shader(shader: Shader, medium: Medium, distance: float | None, name: str, unit: str) -> str:
    """A MaterialX 1.39 document with one material."""
    root = ElementTree.Element("materialx", version="1.39", colorspace="lin_rec709")
    surface = ElementTree.SubElement(root, shader.node, name=f"{name}_surface", type="surfaceshader")
    for key, value in transmission_inputs(shader, medium, distance, unit).items():
        scalar = isinstance(value, float)
        text = f"{value!r}" if scalar else ", ".join(repr(channel) for channel in np.asarray(value).tolist())
        ElementTree.SubElement(surface, "input", name=key, type="float" if scalar else "color3", value=text)
    material = ElementTree.SubElement(root, "surfacematerial", name=name, type="material")
    ElementTree.SubElement(material, "input", name="surfaceshader", type="surfaceshader", nodename=f"{name}_surface")
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def read_shader(shader: Shader, text: str, unit: str) -> Medium:
    """The medium of the first such shader in a MaterialX document."""
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(f"{shader.title} document", f"its XML is broken ({error})", "export it again") from error
    surface = next(root.iter(shader.node), None)
    if surface is None:
        raise InputError(f"{shader.title} document", f"it has no <{shader.node}>", "export that surface")
    space = root.get("colorspace", "lin_rec709")
    inputs = {element.get("name", ""): element for element in surface.iter("input")}
    weight, depth = _number(shader, inputs, shader.weight, 0.0), _number(shader, inputs, shader.depth, 0.0)
    ior = _number(shader, inputs, shader.ior, shader.default_ior)
    if weight == 0:
        raise InputError(f"{shader.title} document", f"{shader.weight} is 0, so it is opaque", "raise the weight")
    color = _color(shader, inputs, shader.color, 1.0, space)
    scatter = _color(shader, inputs, shader.scatter, 0.0, space)
    if not ((color >= 0).all() and (color <= 1).all() and (scatter >= 0).all() and 0 <= depth < math.inf):
        raise InputError(
            f"{shader.title} document", "a transmission color outside 0..1, or a negative depth", "correct the values"
        )
    metres = depth * metres_per_unit(unit)
    if metres == 0:  # a tint of the surface: there is no medium
        return Medium(ior=ior)
    scattering = scatter / metres
    absorption = extinction_at(color, metres) - scattering
    return Medium(
        absorption=absorption - min(0.0, float(absorption.min())),
        scattering=scattering,
        anisotropy=_number(shader, inputs, shader.anisotropy, 0.0),
        ior=ior,
    )


def _text(shader: Shader, inputs: dict[str, ElementTree.Element], key: str) -> str | None:
    if key not in inputs:
        return None
    value = inputs[key].get("value")
    if value is None:
        raise InputError(f"{shader.title} document", f"{key} comes from a node", "give it a constant value")
    return value


def _number(shader: Shader, inputs: dict[str, ElementTree.Element], key: str, default: float) -> float:
    text = _text(shader, inputs, key)
    try:
        return default if text is None else float(text)
    except ValueError:
        raise InputError(f"{shader.title} document", f"{key} is {text!r}, not a number", "correct it") from None


def _color(shader: Shader, inputs: dict[str, ElementTree.Element], key: str, default: float, space: str) -> Array:
    text = _text(shader, inputs, key)
    if text is None:
        return np.full(3, default)
    try:
        triple = np.array([float(part) for part in text.split(",")])
    except ValueError:
        triple = np.zeros(0)
    if triple.shape != (3,) or not np.isfinite(triple).all():
        raise InputError(f"{shader.title} document", f"{key} is {text!r}, not three numbers", "correct it")
    space = inputs[key].get("colorspace", space)
    if space not in (*_LINEAR, _SRGB):
        raise InputError(f"{shader.title} document", f"color space {space!r}", "use lin_rec709 or srgb_texture")
    return srgb_to_linear(triple) if space == _SRGB else triple
