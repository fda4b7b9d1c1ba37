"""Pages that show a scene in any browser: one file each, with the renderer's passes as WebGL2 plays them."""

from __future__ import annotations
