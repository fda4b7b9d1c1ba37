"""Texture with the maps of shadows from all lights, and the uniforms by which shaders find their place in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import RenderError
from translucent.gpu.layout import MAX_LIGHTS, MAX_SHADOW_VIEWS, MAX_SKY_VIEWS, SHADOWS, SKY_SHADOWS
from translucent.scene.camera import Camera

#: Bytes of a texel: transmittance, and the place of the first opaque surface.
_TEXEL = 16

#: Bytes that all maps may take together: beyond, they are smaller than asked for.
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
    """

    camera: Camera
    corner: tuple[int, int]
    size: int

    def rows(self, center: Array) -> npt.NDArray[np.float64]:
        """(4, 4): from points, given from `center`, to right and up (at the edges of the map 1, in perspective after
        division) and metres ahead of the light, with where their zero is; and corner, size and perspective of the map.
        """
        camera = self.camera
        half_width, half_height = camera.half_extent((self.size, self.size))
        axes = np.stack([camera.right / half_width, camera.up / half_height, camera.forward])
        perspective = camera.fov_y is not None
        return np.concatenate([np.column_stack([axes, axes @ (center - camera.eye)]), [[*self.corner, self.size, perspective]]])


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
    def of(cls, lights: Sequence[Sequence[Camera]], sky: Sequence[Camera], size: int, limit: int) -> ShadowViews:
        """Places for the maps of cameras, `size` texels wide, or smaller ones where they take more room than there is.

        Raises
        ------
        RenderError
            If not even small maps fit into a texture of `limit` texels along a side.
        """
        count = sum(len(cameras) for cameras in lights)
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
            f"no texture of this OpenGL, at most {limit} texels wide, holds their maps",
            "use fewer",
        )

    def __iter__(self) -> Iterator[ShadowView]:
        """All maps."""
        yield from (view for views in self.lights for view in views)
        yield from self.sky

    def light_uniforms(self, center: Array, first_and_step: tuple[int, int]) -> bytes:
        """Contents of the Shadows block, for positions that count from `center`.

        Of the directions of the environment, the first and every so-many-th after it are looked at, and count for all.
        """
        first, spans = 0, np.zeros((MAX_LIGHTS, 4))
        rows = np.zeros((MAX_SHADOW_VIEWS, 4, 4))
        for i, views in enumerate(self.lights):
            spans[i, :2] = first, len(views)
            for view in views:
                rows[first] = view.rows(center)
                first += 1
        return SHADOWS.pack(
            shadow_lights=spans,
            shadow_views=rows.reshape(-1, 4),
            sky_count=len(self.sky),
            sky_size=self.sky[0].size if self.sky else 0,
            sky_columns=self._columns,
            sky_first=first_and_step[0],
            sky_step=first_and_step[1],
        )

    def sky_uniforms(self, center: Array, irradiance: Array) -> bytes:
        """Contents of the SkyShadows block, with what each direction sends, (k, 3)."""
        rows = np.zeros((MAX_SKY_VIEWS, 4, 4))
        for row, view, light in zip(rows, self.sky, irradiance, strict=False):
            row[:] = view.rows(center)
            x, y = np.floor_divide(view.corner, view.size)
            row[3] = [*light, y * self._columns + x]
        return SKY_SHADOWS.pack(sky_views=rows.reshape(-1, 4))

    @property
    def _columns(self) -> int:
        """Maps of directions of the environment that fit into a row of the atlas."""
        return self.extent[0] // self.sky[0].size if self.sky else 0


def _placed(
    lights: Sequence[Sequence[Camera]], sky: Sequence[Camera], side: int, small: int, columns: int
) -> tuple[tuple[tuple[ShadowView, ...], ...], tuple[ShadowView, ...]]:
    across, number, groups = columns // SKY_SHARE, 0, []
    for cameras in lights:
        places = [divmod(number + i, across) for i in range(len(cameras))]
        groups.append(
            tuple(ShadowView(camera, (x * side, y * side), side) for camera, (y, x) in zip(cameras, places, strict=True))
        )
        number += len(cameras)
    first = -(-number // across) * SKY_SHARE * columns
    places = [divmod(first + i, columns) for i in range(len(sky))]
    return tuple(groups), tuple(
        ShadowView(camera, (x * small, y * small), small) for camera, (y, x) in zip(sky, places, strict=True)
    )


class ShadowAtlas:
    """RGBA32F texture with all maps: transmittance, and metres ahead of the scene's center of the first opaque surface."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._framebuffer: moderngl.Framebuffer | None = None
        #: Key of what the texture holds.
        self.held: object = None
        self.views: ShadowViews | None = None

    def target(self, extent: tuple[int, int]) -> moderngl.Framebuffer:
        """Framebuffer of the texture, in this size."""
        self.held = None
        if self._framebuffer is None or self._framebuffer.size != extent:
            self.release()
            try:
                texture = self._gl.texture(extent, 4, dtype="f4")
            except moderngl.Error as error:
                raise RenderError(
                    "maps of shadows",
                    f"OpenGL has no room for {_TEXEL * extent[0] * extent[1] / 1e6:.0f} MB of them ({error})",
                    "give shadows=tl.ShadowMaps(size=...) a smaller size",
                ) from error
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
            self._framebuffer = self._gl.framebuffer([texture])
        return self._framebuffer

    def use(self, unit: int) -> None:
        """Bind the texture for the shader that reads texture `unit`."""
        if self._framebuffer is not None:
            self._framebuffer.color_attachments[0].use(unit)

    def release(self) -> None:
        """Free the texture now."""
        if self._framebuffer is not None:
            self._framebuffer.color_attachments[0].release()
            self._framebuffer.release()
        self._framebuffer, self.held, self.views = None, None, None
