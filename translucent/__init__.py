"""Real-time translucent-material shading, with the exact thickness of the mesh along every view ray.

>>> import translucent as tl
>>> jade = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)
>>> jade.transmittance(0.02).round(2).tolist()
[0.18, 0.62, 0.35]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from translucent import reference
from translucent.camera import Camera
from translucent.errors import InputError, RenderError, TranslucentError, TranslucentWarning
from translucent.frame import Frame
from translucent.lights import DirectionalLight, Environment, PointLight
from translucent.medium import Medium
from translucent.mesh import Mesh, load_mesh
from translucent.metrics import Errors, compare, interior
from translucent.plan import RenderPlan, plan
from translucent.presets import Preset, preset, presets
from translucent.scene import Object, Scene
from translucent.showcase import showcase
from translucent.thickness import BackFaceDepth, SignedDepth, ThinLayer

if TYPE_CHECKING:
    from translucent.gpu.renderer import Renderer

__all__ = [
    "BackFaceDepth",
    "Camera",
    "DirectionalLight",
    "Environment",
    "Errors",
    "Frame",
    "InputError",
    "Medium",
    "Mesh",
    "Object",
    "PointLight",
    "Preset",
    "RenderError",
    "RenderPlan",
    "Renderer",
    "Scene",
    "SignedDepth",
    "ThinLayer",
    "TranslucentError",
    "TranslucentWarning",
    "compare",
    "interior",
    "load_mesh",
    "plan",
    "preset",
    "presets",
    "reference",
    "showcase",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("translucent-shading")
    # The values need no OpenGL, so importing them does not load it.
    if name == "Renderer":
        from translucent.gpu.renderer import Renderer

        return Renderer
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
