"""Uniform blocks and packed tables of all shaders; their layout, in Python and in GLSL, is stated here alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from translucent.planning.bodies import MAX_SLOTS
from translucent.planning.limits import MAX_LIGHTS, MAX_SCATTER_LIGHTS
from translucent.planning.methods.base import MAX_LIGHT_POINTS

#: GLSL type, size and alignment in bytes (std140) of a NumPy field. Other shapes are not used: std140 pads them oddly.
_TYPES: dict[tuple[str, tuple[int, ...]], tuple[str, int, int]] = {
    ("f", ()): ("float", 4, 4),
    ("i", ()): ("int", 4, 4),
    ("f", (2,)): ("vec2", 8, 8),
    ("f", (3,)): ("vec3", 12, 16),
    ("f", (4,)): ("vec4", 16, 16),
    ("f", (4, 4)): ("mat4", 64, 16),
}

_Fields: TypeAlias = tuple[tuple[str, str, tuple[int, ...]], ...]


@dataclass(frozen=True)
class UniformBlock:
    """A named uniform block at a fixed binding point.

    Parameters
    ----------
    name : str
        Name of the block in GLSL, and of its generated include, ``#include <name>``; after ``#include <name as other>``
        its fields are ``other.field``.
    binding : int
        Binding point, the same in every program.
    fields : tuple of (name, base, shape)
        base is "f4" or "i4"; shape one of (), (2,), (4,) or (4, 4), matrices in row-major order for column vectors;
        or (n, 4) with n > 4, an array of n vec4.
    """

    name: str
    binding: int
    fields: _Fields

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Structured dtype with the offsets of std140."""
        return _std140(self.fields)

    @property
    def glsl(self) -> str:
        """Declaration for a shader."""
        return self.named("")

    def named(self, instance: str) -> str:
        """Declaration for a shader that calls the block so; without a name its fields are global."""
        members = "".join(
            f"    vec4 {name}[{shape[0]}];\n" if _is_array(shape) else f"    {_TYPES[base[0], shape][0]} {name};\n"
            for name, base, shape in self.fields
        )
        return f"layout(std140, row_major) uniform {self.name} {{\n{members}}}{f' {instance}' if instance else ''};\n"

    def pack(self, **values: npt.ArrayLike) -> bytes:
        """Bytes of the block with these values; every field must be given."""
        return _record(f"uniform block {self.name}", self.dtype, values).tobytes()


@dataclass(frozen=True)
class PackedTable:
    """Table of records in an RGBA32F texture, one record a row.

    Parameters
    ----------
    name : str
        Name of the struct in GLSL, and of its generated include, ``#include <name>``.
    sampler : str
        Name of the texture in GLSL; the function that reads a record is called so with ``_row`` behind.
    fields : tuple of (name, "f4", shape)
        shape is one of (), (2,), (3,) or (4,).
    """

    name: str
    sampler: str
    fields: _Fields

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Structured dtype with the offsets of std140, so that no field begins in one texel and ends in the next."""
        return _std140(self.fields)

    @cached_property
    def glsl(self) -> str:
        """Declaration of struct and texture, and the function that reads a record."""
        members = "".join(f"    {_TYPES['f', shape][0]} {name};\n" for name, _, shape in self.fields)
        texels = range(self.dtype.itemsize // 16)
        fetched = "".join(f"    vec4 texel_{i} = texelFetch({self.sampler}, ivec2({i}, row), 0);\n" for i in texels)
        parts = []
        for (_, _, shape), offset in zip(self.fields, _offsets(self.fields)[0], strict=True):
            texel, first = divmod(offset // 4, 4)
            parts.append(f"texel_{texel}.{'xyzw'[first : first + int(np.prod(shape))]}")
        return (
            f"struct {self.name} {{\n{members}}};\nuniform sampler2D {self.sampler};\n"
            f"{self.name} {self.sampler}_row(int row) {{\n{fetched}    return {self.name}({', '.join(parts)});\n}}\n"
        )

    def pack(self, records: Sequence[Mapping[str, npt.ArrayLike]]) -> npt.NDArray[np.float32]:
        """(records, texels, 4): contents of the texture; every field of every record must be given."""
        packed = b"".join(_record(f"packed table {self.name}", self.dtype, record).tobytes() for record in records)
        return np.frombuffer(packed, np.float32).reshape(len(records), -1, 4)


def _offsets(fields: _Fields) -> tuple[list[int], int]:
    """Bytes at which std140 puts each field, and where the last one ends."""
    offset = 0
    offsets = []
    for _, base, shape in fields:
        size, alignment = (16 * shape[0], 16) if _is_array(shape) else _TYPES[base[0], shape][1:]
        offset = -(-offset // alignment) * alignment
        offsets.append(offset)
        offset += size
    return offsets, offset


def _std140(fields: _Fields) -> np.dtype[Any]:
    offsets, end = _offsets(fields)
    return np.dtype(
        {
            "names": [name for name, _, _ in fields],
            "formats": [(base, shape) for _, base, shape in fields],
            "offsets": offsets,
            "itemsize": -(-end // 16) * 16,
        }
    )


def _record(what: str, dtype: np.dtype[Any], values: Mapping[str, npt.ArrayLike]) -> npt.NDArray[Any]:
    record = np.zeros((), dtype=dtype)
    if values.keys() != set(dtype.names or ()):
        wrong = sorted(values.keys() ^ set(dtype.names or ()))
        raise KeyError(f"{what}: missing or unknown fields {wrong}")
    for name, value in values.items():
        record[name] = value
    return record


def _is_array(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and shape[0] > 4


#: Largest number of views from lights that media scatter: one each, or the six of a cube.
MAX_LIGHT_VIEWS = 6 * MAX_SCATTER_LIGHTS

#: Views from lights, and from directions of the environment, that shadows on opaque objects are looked up in.
MAX_SHADOW_VIEWS, MAX_SKY_VIEWS = 6 * MAX_LIGHTS, 256

#: Per frame: the view rays. Pixels count right and down from the top left corner.
VIEW = UniformBlock(
    "View",
    0,
    (
        ("frame_size", "f4", (4,)),  # width, height, and the shift of the sample point, in pixels
        ("ray_right", "f4", (4,)),
        ("ray_up", "f4", (4,)),
        ("ray_forward", "f4", (4,)),
        ("opaque_range", "f4", (2,)),  # axial depth of the nearest opaque point, and 1 / that from it to the last
        # Of a larger picture, pixels left of and above this part of it, and how many more it has across and down.
        ("beyond", "f4", (4,)),
    ),
)

#: Per body: its placement and material.
BODY = UniformBlock(
    "Body",
    1,
    (
        ("clip_from_offset", "f4", (4, 4)),
        ("world_from_normal", "f4", (4, 4)),
        ("axis", "f4", (4,)),  # camera's forward axis in object space; w: the anchor's position along it
        ("extinction", "f4", (4,)),
        ("eye_from_offset", "f4", (4, 4)),  # world axes, from the eye
        ("color", "f4", (4,)),  # what an opaque object reflects
        ("sheet_thickness", "f4", ()),
        ("sheet_ior", "f4", ()),
        ("sheet_tolerance", "f4", ()),  # metres that a sheet may be behind an opaque surface and still count
        ("axial_start", "f4", ()),  # rays start here: what is behind counts as if it were at the start
        ("count_weight", "f4", ()),  # what one face adds to the count, with the sign of its side
        ("count_offset", "f4", ()),  # what it adds whatever its side: marks what a body covers
        ("subpixel", "f4", ()),  # step of the grid onto which the rasterizer moves vertices, in pixels
        (
            "snapping_share",
            "f4",
            (),
        ),  # the same, divided by the metres of a fraction of 1
        # Axial depth: 0 where the scene's media begin along the forward axis, or at the eye; 1 where they end.
        ("axial_depth_scale", "f4", ()),  # axial depth per metre
        ("axial_depth_start", "f4", ()),  # axial depth of the anchor
        ("slot", "i4", ()),
        ("starts_unknown", "i4", ()),  # whether the eye is on the surface, so that rays start on either side of it
        ("object", "i4", ()),  # its number in the scene
        ("anchor_from_center", "f4", (4,)),  # position of the center of its mesh, from the center of the media
    ),
)

#: Bytes from the Body block of one object to that of the next: every driver in use takes offsets that are multiples of
#: 256.
BODY_STRIDE = -(-BODY.dtype.itemsize // 256) * 256

#: Per frame: the shading of path lengths.
SHADE = UniformBlock(
    "Shade",
    2,
    (
        ("extinction", "f4", (4,)),
        ("emission", "f4", (4,)),
        ("expected_count", "f4", (2,)),  # least and greatest signed count of a trustworthy pixel
        ("rounding", "f4", ()),  # metres that a path may be below 0, besides what silhouettes explain
        ("count_share", "f4", ()),  # metres along the forward axis of a fraction of 1 in a count
        ("coverage_floor", "f4", ()),  # a path not longer than this is rounding
    ),
)

#: Per frame: the media of intervals.
MEDIA = UniformBlock(
    "Media",
    3,
    (
        ("slot_extinction", "f4", (MAX_SLOTS, 4)),  # w: least winding number at the start of a ray
        ("slot_emission", "f4", (MAX_SLOTS, 4)),  # w: greatest
        ("slot_scattering", "f4", (MAX_SLOTS, 4)),  # w: axial depth from which on its surface may be open
        ("slot_phase", "f4", (MAX_SLOTS, 4)),  # parameters of the phase function
        ("media_length", "f4", ()),  # metres along the forward axis from axial depth 0 to 1
        ("slot_bits", "i4", ()),  # bits that a slot's number takes
    ),
)

#: Per frame: the environment, as a background and as a light.
ENVIRONMENT = UniformBlock(
    "Environment",
    5,
    (
        ("seen_first", "f4", (4,)),
        ("seen_second", "f4", (4,)),
        ("seen_tiles", "f4", ()),
        ("seen_turn", "f4", ()),  # of its map about +Y, as a fraction of a full turn
        ("seen_scale", "f4", ()),  # exposure, as a factor
        ("seen_kind", "i4", ()),
        ("light_first", "f4", (4,)),
        ("light_second", "f4", (4,)),
        ("light_turn", "f4", ()),
        ("light_scale", "f4", ()),
        ("light_kind", "i4", ()),
    ),
)

#: Per frame: where the interfaces of bodies are. Positions count from the center of the media.
SURFACES = UniformBlock(
    "Surfaces",
    8,
    (
        # Camera's axes, times half the view's extent (at distance 1); w: whether in perspective, and of the center of
        # the picture, which may be part of a larger one, how far up it is from the camera's axis, in these units.
        ("surface_right", "f4", (4,)),
        ("surface_up", "f4", (4,)),
        ("surface_off_axis", "f4", (4,)),  # from the camera's axis to the center; w: of the picture's, to the right
        # Metres ahead of the center of axial depth 0, from axial depth 0 to 1, ahead of the eye of the center, and
        # ahead of the center of the wall that a checkerboard is.
        ("surface_ahead", "f4", (4,)),
        ("surface_reach", "f4", ()),  # metres as far as which refracted rays look for opaque surfaces
        ("surface_eye_axial_depth", "f4", ()),
    ),
)

#: Per frame: the lights.
LIGHTS = UniformBlock(
    "Lights",
    4,
    (
        (
            "light_position",
            "f4",
            (MAX_LIGHTS, 4),
        ),  # from the center of the media, w = 1; direction to it, w = 0
        ("light_power", "f4", (MAX_LIGHTS, 4)),  # intensity or irradiance; w: radius of its part of a sphere in metres
        ("light_disc", "f4", (MAX_LIGHTS, 4)),  # vector to the center of the sphere, and its radius in metres
        ("light_cone", "f4", (MAX_LIGHTS, 4)),  # as cone_attenuation takes it
        ("light_count", "i4", ()),  # that surfaces are lit by
        ("ground_light_layer", "f4", (2,)),  # of the texture of diffused light, and texels along a side, 0 for none
        ("ground_light_plane", "f4", (4,)),  # unit normal, and metres along it from the center of the media
        ("ground_light_right", "f4", (4,)),  # position on the map, from a point
        ("ground_light_up", "f4", (4,)),
    ),
)

#: Per frame: maps of shadows, see ``shaders/shade/shadows.glsl``. Positions count from the center of the media.
SHADOWS = UniformBlock(
    "Shadows",
    9,
    (
        ("shadow_lights", "f4", (MAX_LIGHTS, 4)),  # number of the first view, how many, metres to what throws shadows
        ("shadow_views", "f4", (4 * MAX_SHADOW_VIEWS, 4)),  # rows of right, up and ahead; corner, size, perspective
        ("shadow_extinction", "f4", (4,)),  # of the one medium, where maps hold paths
        ("shadow_second", "f4", (4,)),  # of another, with w 1, where they hold those in both
        ("sky_count", "i4", ()),  # directions of the environment,
        ("sky_first", "i4", ()),  # and those of them that this sample looks at: the first,
        ("sky_step", "i4", ()),  # and every so-many-th after it; negative: these represent all
        ("sky_size", "i4", ()),  # texels along a side of their maps
        ("sky_columns", "i4", ()),  # maps in a row of the atlas
    ),
)

#: Per frame: directions of the environment that throw shadows.
SKY_SHADOWS = UniformBlock(
    "SkyShadows",
    10,
    (("sky_views", "f4", (4 * MAX_SKY_VIEWS, 4)),),  # rows of right, up and ahead; light, and number of the map
)

#: Per frame: light that is scattered into the view rays. Positions count from the center of the media.
SCATTER = UniformBlock(
    "Scatter",
    6,
    (
        ("scatter_right", "f4", (4,)),  # camera's axes, times half the extent of the view (at distance 1)
        ("scatter_up", "f4", (4,)),
        ("scatter_off_axis", "f4", (4,)),  # from the camera's axis to the center
        ("scatter_near", "f4", (4,)),  # metres of axial depth 0 ahead of the eye; ahead of the center; 1 in perspective
        # First view; how many, negative where the light is inside a body; texels along a side; first texel
        ("scatter_light_views", "f4", (MAX_SCATTER_LIGHTS, 4)),
        ("scatter_views", "f4", (4 * MAX_LIGHT_VIEWS, 4)),  # rows of x, y, w and axial depth, from a position
        ("gauss", "f4", (MAX_LIGHT_POINTS, 4)),  # points in 0..1 and their weights
        ("gauss_count", "i4", ()),
        ("scatter_light_count", "i4", ()),
        ("stopping_slots", "i4", ()),  # a bit for each slot that stops straight light, since photons carry it on
        ("stopping_extinction", "f4", ()),  # 1/m
    ),
)

#: Per frame: densities that vary, by slots. Points count from the center of the media.
DENSITY = UniformBlock(
    "Density",
    7,
    (
        ("density_rows", "f4", (3 * MAX_SLOTS, 4)),  # from a point to the unit box of the slot's body
        # Kind; axis, density at its start and end, or the densest and the logarithm of their ratio
        ("density_profile", "f4", (MAX_SLOTS, 4)),
        ("density_grid", "f4", (MAX_SLOTS, 4)),  # voxels along x, y and z; the first layer in the texture of all grids
        ("scattered_low", "f4", (MAX_SLOTS, 4)),  # corner of the cells of light scattered before; cells in a metre
        ("scattered_grid", "f4", (MAX_SLOTS, 4)),  # cells along x, y and z; the first layer in the texture of all
        # Mean cosine of scattering, 0 where cells do not know directions; fraction that counts as unscattered in cells;
        # last depth of what is scattered ahead of the environment, 0 where that is even
        ("scattered_ahead", "f4", (MAX_SLOTS, 4)),
    ),
)

BLOCKS = {
    block.name: block
    for block in (VIEW, BODY, SHADE, MEDIA, LIGHTS, ENVIRONMENT, SCATTER, DENSITY, SURFACES, SHADOWS, SKY_SHADOWS)
}

#: Objects: their placement, media and surfaces, as far as these do not vary over an object; a record for each.
#: Positions count from the center of the media.
OBJECT_ROW = PackedTable(
    "ObjectRow",
    "object_table",
    (
        # Rows of the transform of a position, less that in w, to its hierarchy.
        ("local_x", "f4", (4,)),
        ("local_y", "f4", (4,)),
        ("local_z", "f4", (4,)),
        ("first_node", "f4", (2,)),  # of its hierarchy, and how many in each order: multiples of 4096, and the rest
        ("node_count", "f4", (2,)),
        ("extinction", "f4", (3,)),  # of a thin wall: times its thickness, as is its emission
        ("outwards", "f4", ()),  # 1, or -1 where the normals of its faces point inwards
        ("emission", "f4", (3,)),
        ("type", "f4", ()),  # one of the constants ``TYPE_``
        ("color", "f4", (3,)),
        ("transmission", "f4", ()),
        ("ior", "f4", ()),
        ("dispersion", "f4", ()),
        ("roughness", "f4", ()),
        ("plain", "f4", ()),  # 1 where its surface only refracts and reflects light; of what is opaque: has none
        ("passed", "f4", (3,)),  # fraction of the light on the base that passes to the other side, with its color,
        ("passed_share", "f4", ()),  # and without
        ("emissive", "f4", (3,)),
        ("metallic", "f4", ()),
        ("one_sided", "f4", ()),
        ("rank", "f4", ()),  # the higher, the more it decides on the medium of a ray; 0: not at all
        ("not_closed", "f4", ()),  # 1 for a solid with holes
        ("slot", "f4", ()),  # the same for objects of one medium
        ("scattering", "f4", (3,)),
        ("clearcoat", "f4", ()),
        ("phase", "f4", (4,)),  # parameters of the phase function
        # Of base color around the middle of the mesh, in coordinates of the hierarchy: where it begins to get darker,
        # where it ends to, and how much of it is lost there; 0 for none.
        ("fading", "f4", (3,)),
        ("clearcoat_roughness", "f4", ()),
        ("film", "f4", (3,)),  # fraction of the surface that has it, its ior, and metres
        ("scatters_much", "f4", ()),  # 1 where what is scattered more than once leaves as from a layer
        ("stream_absorption", "f4", (3,)),
        ("longest", "f4", ()),  # metres across the body
        ("stream_scattering", "f4", (3,)),
        ("inner_mirror", "f4", ()),  # fraction of diffuse light from inside that its interface reflects
        ("grid_low", "f4", (3,)),  # corner of the grid of its diffused light, from the center of the media
        (
            "diffuses",
            "f4",
            (),
        ),  # 1 where light diffuses in it; of an opaque object, where its map has the light of lights
        ("grid_size", "f4", (3,)),  # cells along each axis
        ("first_layer", "f4", ()),  # of the grid in the texture of all grids
        ("grid_x", "f4", (3,)),  # its axes, in cells per metre
        ("exit_share", "f4", ()),
        ("grid_y", "f4", (3,)),
        ("conductance", "f4", ()),
        ("grid_z", "f4", (3,)),
        ("albedo", "f4", (3,)),
        (
            "turned",
            "f4",
            (),
        ),  # 1 - mean cosine of scattering where the grid holds the direction of entering light, else 0
        ("exit_cosines", "f4", (3,)),  # see exit_quadrature
        ("exit_weights", "f4", (3,)),
        ("ahead", "f4", (3,)),  # fraction of its extinction by light that is scattered ahead
        ("ahead_layer", "f4", ()),  # of what such events leave of the environment
        ("in_scattered_far", "f4", (3,)),  # of that light, when mirrored: fraction that leaves where a ray does,
        ("ahead_deepest", "f4", ()),  # depth of such events at the last layer; 0 for no layers
        ("in_scattered_near", "f4", (3,)),  # and on the other side
        ("inner_mirror_flux", "f4", ()),  # fraction of light as the cosine that its interface reflects from inside
        ("ahead_cosine", "f4", ()),  # mean cosine of scattering
    ),
)

TABLES = {OBJECT_ROW.name: OBJECT_ROW}
