"""Resources shared by frames on the GPU, uploaded once: meshes, densities, environments, textures, and light views."""

from __future__ import annotations

import moderngl

from translucent.gpu.buffers import MeshCache
from translucent.gpu.densities import GridTexture
from translucent.gpu.diffusion import DiffusionCache
from translucent.gpu.environment_maps import EnvironmentMaps
from translucent.gpu.hierarchies import HierarchyCache
from translucent.gpu.shadow_atlas import ShadowAtlas
from translucent.gpu.storage import Storage
from translucent.gpu.textures import TextureCache


class Resources:
    """Caches of one context."""

    def __init__(self, gl: moderngl.Context) -> None:
        #: Textures that one shader can read.
        self.texture_units = int(gl.info["GL_MAX_TEXTURE_IMAGE_UNITS"])
        self.meshes = MeshCache(gl)
        self.grids = GridTexture(gl)
        self.environments = EnvironmentMaps(gl)
        self.textures = TextureCache(gl)
        self.hierarchies = HierarchyCache(gl)
        self.diffusion = DiffusionCache(gl)
        self._shadows = ShadowAtlas(gl), ShadowAtlas(gl)
        #: Photons carry the light that interfaces turn, so that bodies are opaque to lights: their maps are others.
        self.photons_carry = False
        #: Media change after passes have been recorded, so that maps must not know which of them are alike.
        self.media_change = False
        #: Views from lights, which are the same for frames of all sizes.
        self.light_lists = Storage(gl, "light that media scatter")

    @property
    def shadows(self) -> ShadowAtlas:
        """Maps of shadows of the frame that is being drawn."""
        return self._shadows[self.photons_carry]

    def release(self) -> None:
        """Free all caches."""
        caches = (
            self.meshes,
            self.grids,
            self.environments,
            self.textures,
            self.hierarchies,
            self.diffusion,
            *self._shadows,
            self.light_lists,
        )
        for cache in caches:
            cache.release()
