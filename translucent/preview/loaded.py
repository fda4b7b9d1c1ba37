"""A model as it was read."""

from __future__ import annotations

from dataclasses import dataclass

from translucent.preview.document import Material, Model
from translucent.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Loaded:
    """Loaded model: its scene, and the material that its bodies came with."""

    model: Model
    scene: Scene
    material: Material

    @property
    def bare(self) -> bool:
        """True if the model is a mesh, and no scene of a file."""
        return not hasattr(self.scene, "has_camera")

    @property
    def triangles(self) -> int:
        """Number of triangles that are drawn."""
        return sum(len(item.mesh.faces) for item in self.scene.objects)
