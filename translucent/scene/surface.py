"""Surfaces of bodies and opaque objects: roughness, tint, transmission and emission."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array, Frozen
from translucent.errors import InputError
from translucent.media.colors import ColorLike, parse_color
from translucent.media.medium import MAX_IOR
from translucent.scene.lights import MAX_RADIANCE
from translucent.scene.texture import Texture

#: Thickest film in metres: the colors of one that is thicker than a tenth of it look alike.
MAX_FILM = 1e-4

#: Largest dispersion, 20 / Abbe number: beyond it the index of red would fall below 1 for any glass.
MAX_DISPERSION = 10.0

_RANGES = (
    ("roughness", 0.0, 1.0),
    ("transmission", 0.0, 1.0),
    ("diffuse_transmission", 0.0, 1.0),
    ("dispersion", 0.0, MAX_DISPERSION),
    ("metallic", 0.0, 1.0),
    ("ior", 1.0, MAX_IOR),
    ("iridescence", 0.0, 1.0),
    ("iridescence_ior", 1.0, MAX_IOR),
    ("iridescence_thickness", 0.0, MAX_FILM),
    ("clearcoat", 0.0, 1.0),
    ("clearcoat_roughness", 0.0, 1.0),
    ("alpha_cutoff", 0.0, 1.0),
    ("opacity", 0.0, 1.0),
)

#: Smallest opacity of a layer; anything less counts as none.
LEAST_COVER = 1e-4

#: Fields that hold a texture.
TEXTURE_FIELDS = (
    "color_texture",
    "roughness_texture",
    "transmission_texture",
    "normal_texture",
    "emissive_texture",
    "occlusion_texture",
)


@checked
@dataclass(frozen=True, eq=False)
class Surface(Frozen):
    """Interface between a medium and the air around it, or the surface of an opaque object.

    What does not pass the interface by refraction (``1 - transmission``) is reflected and transmitted diffusely, by a
    diffuse base. Names and meanings are glTF's (2.0, section 3.9.2; KHR_materials_transmission, _diffuse_transmission,
    _dispersion, _iridescence and _clearcoat).

    An opaque object is a metal, or a coat with `ior` over a diffuse base, or between the two (glTF 2.0, Appendix B). A
    body has the index of refraction of its medium, and what is said to be of opaque objects has no effect on it.

    Parameters
    ----------
    roughness : float
        0 (polished) to 1; the width of the GGX microfacet distribution is its square.
    color : str or array_like (3,)
        Tints what passes the surface, once for each body; albedo of the diffuse base: 0 to 1, a color as text or
        linear RGB.
    transmission : float
        Fraction of the light that enters by refraction, 0 to 1; the rest reaches the diffuse base.
    diffuse_transmission : float
        Fraction of the light on the diffuse base that passes to the other side, 0 to 1.
    diffuse_transmission_color : str or array_like (3,)
        Tints that light.
    dispersion : float
        20 / Abbe number, 0 to 10; 0: all wavelengths bend alike.
    color_texture, roughness_texture, transmission_texture, normal_texture : Texture, optional
        Multiply the values above, over the texture coordinates of the mesh: RGB, G (and B of `metallic`), R; a normal
        map is in tangent space, with green upwards.
    occlusion_texture : Texture, optional
        R multiplies the light of the environment, and not that of lights.
    metallic : float
        Of an opaque object, 0 to 1: fraction of it that is metal, whose mirror images have the color.
    ior : float
        Of the coat of an opaque object, >= 1. With 1 it is Lambert's: nothing is mirrored but by metal.
    emissive : str or array_like (3,)
        Radiance of the surface in the dark, linear RGB or a color as text; of a body, where a ray first enters it.
    emissive_texture : Texture, optional
        Multiplies it.
    alpha_cutoff : float
        0 to 1: where the opacity of `color_texture`, times that of the vertices, is less, an opaque object or a thin
        sheet has a hole. A solid has none: what is inside would be open.
    opacity : float, optional
        Makes of a thin sheet a layer that covers this fraction of what is behind it, 0 to 1, whatever the angle, times
        the opacity of `color_texture` and of the vertices. It shows what an opaque object with this surface would,
        over what is behind (Porter and Duff's ``over``). Its medium should be clear, and its interfaces bend nothing.
    double_sided : bool
        Whether an opaque object is seen from the inside, too.
    iridescence : float
        Fraction of the surface that has a thin film on it, 0 to 1, whose interference colors what is mirrored. A sheet
        has it on the side that light comes from: a soap bubble is a sheet with a medium of ior 1 and such a film.
    iridescence_ior : float
        Of the film, >= 1: soapy water 1.33, oxides up to 2.7.
    iridescence_thickness : float
        Of the film, in metres, up to 1e-4: 100e-9 to 1000e-9 show colors.
    clearcoat : float
        Fraction of the surface that has a clear coat of ior 1.5 on it, 0 to 1. It mirrors light that comes from
        outside, and what is below gets the rest.
    clearcoat_roughness : float
        Of the clear coat, 0 to 1.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    roughness: float = 0.0
    color: ColorLike = (1.0, 1.0, 1.0)
    transmission: float = 1.0
    diffuse_transmission: float = 0.0
    diffuse_transmission_color: ColorLike = (1.0, 1.0, 1.0)
    dispersion: float = 0.0
    color_texture: Texture | None = None
    roughness_texture: Texture | None = None
    transmission_texture: Texture | None = None
    normal_texture: Texture | None = None
    metallic: float = 0.0
    ior: float = 1.5
    emissive: ColorLike = (0.0, 0.0, 0.0)
    emissive_texture: Texture | None = None
    alpha_cutoff: float = 0.0
    double_sided: bool = True
    occlusion_texture: Texture | None = None
    opacity: float | None = None
    iridescence: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: float = 400e-9
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0

    def __post_init__(self) -> None:
        for field, least, most in _RANGES:
            if (value := getattr(self, field)) is None and field == "opacity":
                continue
            if not isinstance(value, int | float | np.floating) or not least <= value <= most:
                raise InputError(
                    f"surface {field} {value!r}",
                    f"the value must lie in {least:g} to {most:g}",
                    "use a number in this range",
                )
            object.__setattr__(self, field, float(value))
        for field in ("color", "diffuse_transmission_color"):
            object.__setattr__(self, field, _color(field, getattr(self, field), 1.0))
        object.__setattr__(self, "emissive", _color("emissive", self.emissive, MAX_RADIANCE))
        for field in TEXTURE_FIELDS:
            if not isinstance(value := getattr(self, field), Texture | None):
                raise InputError(
                    f"surface {field}", f"a texture cannot have the type {type(value).__name__}", "use a tl.Texture"
                )

    @property
    def plain(self) -> bool:
        """True if light passes the surface unchanged where the indices of refraction on both sides are equal."""
        return (
            self.transmission == 1.0
            and self.transmission_texture is None
            and self.color_texture is None
            and bool((np.asarray(self.color) == 1.0).all())
            and not self.glows
            and not self.iridescence
            and not self.clearcoat
        )

    @property
    def glows(self) -> bool:
        """True if the surface emits light."""
        return bool((np.asarray(self.emissive) > 0).any())

    @property
    def textures(self) -> tuple[Texture | None, ...]:
        """Color, roughness, transmission, normal, emissive and occlusion texture."""
        return tuple(getattr(self, field) for field in TEXTURE_FIELDS)


def _color(field: str, color: ColorLike, most: float) -> Array:
    try:
        values = np.array(parse_color(color) if isinstance(color, str) else color, dtype=np.float64)
    except InputError:
        raise
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (3,) or not ((values >= 0) & (values <= most)).all():
        found = f"the value must be three numbers in 0 to {most:g}"
        raise InputError(f"surface {field} {color!r}", found, "use a color such as (1, 0.9, 0.8)")
    values.setflags(write=False)
    return values


#: Surface of a body that is given none.
SMOOTH = Surface()
