"""What frames share on the GPU, uploaded once: meshes, densities, environments and textures."""

from __future__ import annotations

import moderngl

from translucent.gpu.buffers import MeshCache
from translucent.gpu.densities import GridTexture
from translucent.gpu.environment_maps import EnvironmentMaps
from translucent.gpu.textures import TextureCache


class Resources:
    """The caches of one context."""

    def __init__(self, gl: moderngl.Context) -> None:
        self.meshes = MeshCache(gl)
        self.grids = GridTexture(gl)
        self.environments = EnvironmentMaps(gl)
        self.textures = TextureCache(gl)

    def release(self) -> None:
        """Free all of it."""
        for cache in (self.meshes, self.grids, self.environments, self.textures):
            cache.release()
