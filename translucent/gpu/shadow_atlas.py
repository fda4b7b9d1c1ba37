"""Texture with the maps of shadows from all lights, and the uniforms by which shaders find their place in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import RenderError
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import MAX_SHADOW_VIEWS, MAX_SKY_VIEWS, SHADOWS, SKY_SHADOWS
from translucent.planning.limits import MAX_LIGHTS
from translucent.scene.camera import Camera

#: Bytes of a texel at most: sums in three channels and a count, the place of the first opaque surface, and depth.
_TEXEL = 24

#: Bytes that all maps may take together: beyond, they are smaller than requested.
MOST_BYTES = 512 << 20

#: Maps of the environment's directions along the side of a light's map.
SKY_SHARE = 4

#: Smallest maps, where there are many.
LEAST_TEXELS = 16


@dataclass(frozen=True, eq=False)
class ShadowView:
    """Map of one view from a light.

    Attributes
    ----------
    camera : Camera
    corner : (int, int)
        Of its texels in the atlas.
    size : int
        Texels along a side.
    opaque : tuple of int
        Objects that may end rays.
    middle : (3,) float64
        Of what throws shadows there, in the world.
    """

    camera: Camera
    corner: tuple[int, int]
    size: int
    opaque: tuple[int, ...]
    middle: Array

    @property
    def ends(self) -> bool:
        """True if opaque objects block some rays."""
        return bool(self.opaque)

    def rows(self, center: Array) -> npt.NDArray[np.float64]:
        """(4, 4): from points, given from `center`, to right and up (at the edges of the map 1, in perspective after
        division) and metres ahead of the light, with where their zero is; and corner and size of the map, and 1 if in
        perspective, with 2 if it has ends.
        """
        camera = self.camera
        half_width, half_height = camera.half_extent((self.size, self.size))
        axes = np.stack([camera.right / half_width, camera.up / half_height, camera.forward])
        perspective = camera.fov_y is not None
        return np.concatenate(
            [
                np.column_stack([axes, axes @ (center - camera.eye)]),
                [[*self.corner, self.size, perspective + 2 * self.ends]],
            ]
        )


#: Cameras of a light, the opaque objects that block it, and the middle (3,) of what throws shadows.
SeenFrom: TypeAlias = tuple[Sequence[Camera], tuple[int, ...], Array]


@dataclass(frozen=True, eq=False)
class ShadowViews:
    """Places of all maps in an atlas.

    Attributes
    ----------
    lights : tuple of tuple of ShadowView
        Of each light; none where nothing throws a shadow.
    sky : tuple of ShadowView
        Of directions of the environment.
    extent : (int, int)
        Width and height of the atlas.
    """

    lights: tuple[tuple[ShadowView, ...], ...]
    sky: tuple[ShadowView, ...]
    extent: tuple[int, int]

    @classmethod
    def of(cls, lights: Sequence[SeenFrom], sky: Sequence[SeenFrom], size: int, limit: int) -> ShadowViews:
        """Places for the maps of cameras, `size` texels wide, or smaller ones where they take more room than there is.

        Parameters
        ----------
        lights, sky : sequence of (sequence of Camera, tuple of int, (3,) float64)
            Of each light, with the opaque objects that block it, and the middle of what throws shadows.
        size : int
        limit : int
            Largest width of a texture.

        Raises
        ------
        RenderError
            If not even small maps fit into a texture of `limit` texels along a side.
        """
        count = sum(len(cameras) for cameras, *_ in lights)
        side = size
        while side >= LEAST_TEXELS * SKY_SHARE:
            small = side // SKY_SHARE
            places = SKY_SHARE**2 * count + len(sky)
            columns = SKY_SHARE * max(int(np.ceil(np.sqrt(places) / SKY_SHARE)), 1)
            rows = -(-count * SKY_SHARE // columns) * SKY_SHARE + -(-len(sky) // columns)
            extent = columns * small, rows * small
            if max(extent) <= limit and _TEXEL * extent[0] * extent[1] <= MOST_BYTES:
                return cls(*_placed(lights, sky, side, small, columns), extent)
            side //= 2
        raise RenderError(
            f"shadows of {len(lights)} lights and {len(sky)} directions of the environment",
            f"no texture of this OpenGL can hold all shadow maps: the largest texture is {limit} texels wide",
            "use fewer lights or directions",
        )

    def __iter__(self) -> Iterator[ShadowView]:
        """All maps."""
        yield from (view for views in self.lights for view in views)
        yield from self.sky

    def light_uniforms(self, center: Array, first_and_step: tuple[int, int], extinctions: Array) -> bytes:
        """Contents of the Shadows block, for positions that count from `center`.

        Of the directions of the environment, the first and every so-many-th after it are looked at, and count for all.
        `extinctions` (1 or 2, 3) are those of the media, where the maps are paths.
        """
        first, spans, media = 0, np.zeros((MAX_LIGHTS, 4)), np.zeros((2, 4))
        media[: len(extinctions), :3], media[1, 3] = extinctions, len(extinctions) > 1
        rows = np.zeros((MAX_SHADOW_VIEWS, 4, 4))
        for i, views in enumerate(self.lights):
            spans[i, :2] = first, len(views)
            if views:
                spans[i, 2] = np.linalg.norm(views[0].middle - views[0].camera.eye)
            for view in views:
                rows[first] = view.rows(center)
                first += 1
        return SHADOWS.pack(
            shadow_lights=spans,
            shadow_views=rows.reshape(-1, 4),
            shadow_extinction=media[0],
            shadow_second=media[1],
            sky_count=len(self.sky),
            sky_size=self.sky[0].size if self.sky else 0,
            sky_columns=self._columns,
            sky_first=first_and_step[0],
            sky_step=first_and_step[1],
        )

    def sky_uniforms(self, center: Array, irradiance: Array) -> bytes:
        """Contents of the SkyShadows block, with what each direction sends, (k, 3)."""
        rows = np.zeros((MAX_SKY_VIEWS, 4, 4))
        axes, eyes, numbers = self._sky_rows
        count = min(len(rows), len(axes), len(irradiance))
        rows[:count, :3, :3] = axes[:count]
        rows[:count, :3, 3] = np.einsum("kij,kj->ki", axes[:count], center - eyes[:count])
        rows[:count, 3, :3], rows[:count, 3, 3] = irradiance[:count], numbers[:count]
        return SKY_SHADOWS.pack(sky_views=rows.reshape(-1, 4))

    @cached_property
    def _sky_rows(self) -> tuple[Array, Array, Array]:
        """Axes (k, 3, 3), eyes (k, 3) and map numbers (k,) of the cameras of the environment's k directions.

        Numbers count from 1; they are negative if a map has ends. Every sample of a picture needs them.
        """
        origin = np.zeros(3)
        axes = np.array([view.rows(origin)[:3, :3] for view in self.sky]).reshape(-1, 3, 3)
        eyes = np.array([view.camera.eye for view in self.sky]).reshape(-1, 3)
        places = [(view.corner[0] // view.size, view.corner[1] // view.size, view.ends) for view in self.sky]
        numbers = [(y * self._columns + x + 1) * (-1 if ends else 1) for x, y, ends in places]
        return axes, eyes, np.array(numbers, dtype=np.float64)

    @property
    def _columns(self) -> int:
        """Maps of directions of the environment that fit into a row of the atlas."""
        return self.extent[0] // self.sky[0].size if self.sky else 0


def _placed(
    lights: Sequence[SeenFrom], sky: Sequence[SeenFrom], side: int, small: int, columns: int
) -> tuple[tuple[tuple[ShadowView, ...], ...], tuple[ShadowView, ...]]:
    across, number, groups = columns // SKY_SHARE, 0, []
    for cameras, opaque, middle in lights:
        places = [divmod(number + i, across) for i in range(len(cameras))]
        groups.append(
            tuple(
                ShadowView(camera, (x * side, y * side), side, opaque, middle)
                for camera, (y, x) in zip(cameras, places, strict=True)
            )
        )
        number += len(cameras)
    first = -(-number // across) * SKY_SHARE * columns
    places = [divmod(first + i, columns) for i in range(len(sky))]
    return tuple(groups), tuple(
        ShadowView(cameras[0], (x * small, y * small), small, opaque, middle)
        for (cameras, opaque, middle), (y, x) in zip(sky, places, strict=True)
    )


@dataclass(frozen=True)
class ShadowMapKey:
    """Key of the maps: equal for frames in which the maps are equal.

    Attributes
    ----------
    places : tuple
        What decides where light goes.
    media : tuple of bytes or None
        Extinction in each object.
    slots : tuple of int
        Number of the extinction of each object that throws a shadow, among all different ones; -1 of others and of 0.
    step : int
        There are maps of every so-many-th direction of the environment.
    """

    places: tuple[object, ...]
    media: tuple[bytes | None, ...]
    slots: tuple[int, ...]
    step: int = 1

    def fits(self, other: ShadowMapKey, *, path_only: bool) -> bool:
        """True if the maps can be reused for another frame; path lengths do not depend on extinction."""
        return self.places == other.places and (self.media == other.media or (path_only and self.slots == other.slots))


@dataclass(frozen=True, eq=False)
class GroundShadows:
    """Map of the environment's shadows on a ground; see ``shaders/shade/ground_map.glsl``.

    Attributes
    ----------
    number : int
        Of the object that is the ground.
    texture : moderngl.Texture
        Fraction of the light of the environment that bodies take, by channel.
    rows : tuple of 2 tuples of 4 floats
        Position on the ground, from a point that counts from the center of the media.
    plane : (float, float, float, float)
        Unit normal upwards, and metres along it from the center of the media.
    """

    number: int
    texture: moderngl.Texture
    rows: tuple[tuple[float, ...], ...]
    plane: tuple[float, ...]


class ShadowAtlas:
    """Textures with all maps: what rays of lights go through, and where each hits the first opaque surface.

    Attributes
    ----------
    held : ShadowMapKey, optional
        Key of what the textures hold.
    drawn : set of ShadowView
        Maps that are there already.
    views : ShadowViews, optional
        Places of the maps.
    spectral : bool
        The maps are optical depths (RGBA32F), since media differ, and not paths: R32F, or with counts RG32F where
        opaque objects end some.
    two_media : bool
        The maps are paths in two media (RG32F).
    ground : GroundShadows, optional
        What the maps of the environment make of a ground, in the frame that is being drawn.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._framebuffers: tuple[moderngl.Framebuffer, ...] = ()
        self._made_of: tuple[tuple[int, int], int, bool] | None = None
        self.held: ShadowMapKey | None = None
        self.drawn: set[ShadowView] = set()
        self.views: ShadowViews | None = None
        self.spectral = self.two_media = False
        self.ground: GroundShadows | None = None

    def make(self, views: ShadowViews, *, spectral: bool, two_media: bool = False) -> None:
        """Allocate textures for shadow maps; earlier contents are lost.

        Raises
        ------
        RenderError
            If OpenGL has no room.
        """
        self.held = None
        self.drawn.clear()
        ends = any(view.ends for view in views)
        components = 4 if spectral else 2 if two_media or ends else 1
        if self._made_of != (views.extent, components, ends):
            self.release()
            self._framebuffers = self._made(views.extent, components, ends)
            self._made_of = views.extent, components, ends
        self.views, self.spectral, self.two_media = views, spectral, two_media
        self.sums.viewport = (0, 0, *views.extent)
        self.sums.clear()
        if ends:
            self.ends.viewport = self.sums.viewport
            self.ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)

    @property
    def sums(self) -> moderngl.Framebuffer:
        """Framebuffer of paths or optical depths per metre ahead, with counts."""
        return self._framebuffers[0]

    @property
    def ends(self) -> moderngl.Framebuffer:
        """Framebuffer (R32F) of metres ahead of the center where opaque surfaces end rays; with a depth buffer.

        It has one texel where none does.
        """
        return self._framebuffers[1]

    @property
    def tested(self) -> moderngl.Framebuffer:
        """The framebuffer of sums with the depth buffer of opaque surfaces, which it leaves as it is."""
        return self._framebuffers[3]

    @property
    def both(self) -> moderngl.Framebuffer:
        """Framebuffer of sums and ends."""
        return self._framebuffers[2]

    def use(self, units: Mapping[str, int]) -> None:
        """Bind the textures for shaders that read `shadow_sums` and `shadow_ends` from these units."""
        if self._framebuffers:
            self.sums.color_attachments[0].use(units["shadow_sums"])
            self.ends.color_attachments[0].use(units["shadow_ends"])

    def release(self) -> None:
        """Free the textures now."""
        for attachment in (
            *(framebuffer.color_attachments[0] for framebuffer in self._framebuffers[:2]),
            *(framebuffer.depth_attachment for framebuffer in self._framebuffers[1:2]),
            *self._framebuffers,
        ):
            if attachment is not None:
                attachment.release()
        self._framebuffers, self._made_of, self.held, self.views = (), None, None, None

    def _made(self, extent: tuple[int, int], components: int, with_ends: bool) -> tuple[moderngl.Framebuffer, ...]:
        gl, of_ends = self._gl, extent if with_ends else (1, 1)
        try:
            sums, ends = gl.texture(extent, components, dtype="f4"), gl.texture(of_ends, 1, dtype="f4")
            depth = gl.depth_renderbuffer(of_ends)
        except moderngl.Error as error:
            raise RenderError(
                "shadow maps",
                (
                    f"OpenGL does not have enough memory for {_TEXEL * extent[0] * extent[1] / 1e6:.0f} "
                    f"MB of shadow maps ({error})"
                ),
                "use smaller shadow maps: shadows=tl.ShadowMaps(size=...)",
            ) from error
        for texture in (sums, ends):
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        both = gl.framebuffer([sums, ends] if with_ends else [sums])
        tested = gl.framebuffer([sums], depth if with_ends else None)
        tested.depth_mask = False
        return gl.framebuffer([sums]), gl.framebuffer([ends], depth), both, tested
