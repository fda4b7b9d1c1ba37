"""Real-time translucent-material shading, with the exact thickness of the mesh along every view ray.

>>> import translucent as tl
>>> jade = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)
>>> jade.transmittance(0.02).round(2).tolist()
[0.18, 0.62, 0.35]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from translucent import reference
from translucent.albedo import scattering_medium
from translucent.appearance import Appearance, appearance_of, average_color, medium_for_average_color
from translucent.backdrop import Backdrop
from translucent.bake.bake import bake_thickness
from translucent.bake.batch import BatchReport, bake_many
from translucent.bake.reading import load_thickness_map
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import BakeReport, ThicknessMap, VertexThickness
from translucent.bake.vertices import bake_vertex_thickness
from translucent.camera import Camera
from translucent.conversion import (
    DistanceMatch,
    clamp_colors,
    color_at_distance,
    condition_number,
    distance_for_color,
    extinction_from_colors,
)
from translucent.density import DensityGrid, ExponentialDensity, LinearDensity
from translucent.environment import Environment
from translucent.errors import InputError, RenderError, TranslucentError, TranslucentWarning
from translucent.fitting import Fit, fit_medium, fit_wedge
from translucent.frame import Frame
from translucent.gltf.load import load_scene
from translucent.lights import DirectionalLight, PointLight
from translucent.materials import load_medium, text_block
from translucent.materials.gltf import read_materials
from translucent.materials.gltf_write import write_medium
from translucent.medium import Medium
from translucent.mesh import Mesh, load_mesh
from translucent.metrics import Errors, compare, interior
from translucent.plan import plan
from translucent.presets import Preset, preset, presets
from translucent.render_plan import Capabilities, RenderPlan
from translucent.scene import Object, Scene
from translucent.showcase import showcase
from translucent.surface import Surface
from translucent.texture import Texture
from translucent.thickness import (
    BackFaceDepth,
    DepthPeeling,
    FragmentLists,
    KBuffer,
    RayMarched,
    SignedDepth,
    ThinLayer,
)

if TYPE_CHECKING:
    from translucent.renderer import Renderer

__all__ = [
    "Appearance",
    "BackFaceDepth",
    "Backdrop",
    "BakeReport",
    "BakeSettings",
    "BatchReport",
    "Camera",
    "Capabilities",
    "DensityGrid",
    "DepthPeeling",
    "DirectionalLight",
    "DistanceMatch",
    "Environment",
    "Errors",
    "ExponentialDensity",
    "Fit",
    "FragmentLists",
    "Frame",
    "InputError",
    "KBuffer",
    "LinearDensity",
    "Medium",
    "Mesh",
    "Object",
    "PointLight",
    "Preset",
    "RayMarched",
    "RenderError",
    "RenderPlan",
    "Renderer",
    "Scene",
    "SignedDepth",
    "Surface",
    "Texture",
    "ThicknessMap",
    "ThinLayer",
    "TranslucentError",
    "TranslucentWarning",
    "VertexThickness",
    "appearance_of",
    "average_color",
    "bake_many",
    "bake_thickness",
    "bake_vertex_thickness",
    "clamp_colors",
    "color_at_distance",
    "compare",
    "condition_number",
    "distance_for_color",
    "extinction_from_colors",
    "fit_medium",
    "fit_wedge",
    "interior",
    "load_medium",
    "load_mesh",
    "load_scene",
    "load_thickness_map",
    "medium_for_average_color",
    "plan",
    "preset",
    "presets",
    "read_materials",
    "reference",
    "scattering_medium",
    "showcase",
    "text_block",
    "write_medium",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from translucent.version import VERSION

        return VERSION
    # The values need no OpenGL, so importing them does not load it.
    if name == "Renderer":
        from translucent.renderer import Renderer

        return Renderer
    if name == "bench":
        from importlib import import_module

        return import_module("translucent.bench")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
