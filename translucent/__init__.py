"""Real-time translucent-material shading, with the exact thickness of the mesh along every view ray.

>>> import translucent as tl
>>> jade = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)
>>> jade.transmittance(0.02).round(2).tolist()
[0.18, 0.62, 0.35]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from translucent import reference
from translucent.bake.bake import bake_thickness
from translucent.bake.baked import BakeReport
from translucent.bake.batch import BatchReport, bake_many
from translucent.bake.reading import load_thickness_map
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import ThicknessMap, VertexThickness
from translucent.bake.vertices import bake_vertex_thickness
from translucent.errors import InputError, RenderError, TranslucentError, TranslucentWarning
from translucent.frames.appearance import Appearance, appearance_of, average_color, medium_for_average_color
from translucent.frames.frame import Frame
from translucent.frames.metrics import Errors, compare, interior
from translucent.geometry.mesh import Mesh
from translucent.gltf.load import load_scene
from translucent.gltf.materials import read_materials
from translucent.gltf.write import write_medium
from translucent.materials import load_medium, text_block
from translucent.media.albedo import scattering_medium
from translucent.media.conversion import (
    DistanceMatch,
    clamp_colors,
    color_at_distance,
    condition_number,
    distance_for_color,
    extinction_from_colors,
)
from translucent.media.density import DensityGrid, ExponentialDensity, LinearDensity
from translucent.media.fitting import Fit, fit_medium, fit_wedge
from translucent.media.medium import Medium
from translucent.media.presets import Preset, preset, presets
from translucent.mesh_files import load_mesh
from translucent.planning.methods import (
    BackFaceDepth,
    DepthPeeling,
    FragmentLists,
    KBuffer,
    RayMarched,
    SignedDepth,
    ThinLayer,
)
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.scene.backdrop import Backdrop
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import showcase
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

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
