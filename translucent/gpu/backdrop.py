"""A backdrop that another renderer has left in textures of the same OpenGL context."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl


@dataclass(frozen=True, eq=False)
class TextureBackdrop:
    """Backdrop in textures of the same context, so that nothing is read back; it is seen everywhere.

    Parameters
    ----------
    color : moderngl.Texture
        RGB that is linear to the power of 1 / `gamma`. Row 0 is the bottom row, as OpenGL draws.
    depth : moderngl.Texture
        What the depth test compared, 0 to 1, at pixel centers; 1 where nothing was drawn.
    near, far : float
        Metres along the camera's forward axis where depth is 0 and 1; `far` may be ``inf`` for a perspective camera.
    orthographic : bool
        The depth is that of an orthographic camera: linear in metres.
    gamma : float
        1 for linear colors.
    ambient : (float, float, float), optional
        Linear radiance that lit the picture evenly from all around, as `Backdrop.ambient`.
    """

    color: moderngl.Texture
    depth: moderngl.Texture
    near: float
    far: float
    orthographic: bool
    gamma: float
    ambient: tuple[float, float, float] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        width, height = self.color.size
        return width, height
