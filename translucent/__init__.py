"""Real-time translucent-material shading, with the exact thickness of the mesh along every view ray.

>>> import translucent as tl
>>> green = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)
>>> green.transmittance(0.02).round(2).tolist()
[0.18, 0.62, 0.35]
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for checkers and editors: the same names as in the table below
    from translucent import bench as bench
    from translucent import reference as reference
    from translucent.bake.attach import attach as attach
    from translucent.bake.audit.check import check_materials as check_materials
    from translucent.bake.audit.check import fix_materials as fix_materials
    from translucent.bake.audit.rules import MaterialCheck as MaterialCheck
    from translucent.bake.audit.rules import MaterialFinding as MaterialFinding
    from translucent.bake.bake import bake_thickness as bake_thickness
    from translucent.bake.bake import bake_vertex_thickness as bake_vertex_thickness
    from translucent.bake.batch import BatchReport as BatchReport
    from translucent.bake.batch import bake_many as bake_many
    from translucent.bake.lithophane import Lithophane as Lithophane
    from translucent.bake.lithophane import lithophane as lithophane
    from translucent.bake.scatter import ScatterMap as ScatterMap
    from translucent.bake.scatter import VertexScatter as VertexScatter
    from translucent.bake.scatter import bake_scatter as bake_scatter
    from translucent.bake.scatter import bake_vertex_scatter as bake_vertex_scatter
    from translucent.bake.settings import BakeSettings as BakeSettings
    from translucent.bake.thickness_map import BakeReport as BakeReport
    from translucent.bake.thickness_map import ThicknessMap as ThicknessMap
    from translucent.bake.thickness_map import VertexThickness as VertexThickness
    from translucent.bake.thickness_map import load_thickness_map as load_thickness_map
    from translucent.bake.usd_stage import write_usd as write_usd
    from translucent.errors import InputError as InputError
    from translucent.errors import RenderError as RenderError
    from translucent.errors import TranslucentError as TranslucentError
    from translucent.errors import TranslucentWarning as TranslucentWarning
    from translucent.formulas.phase import Draine as Draine
    from translucent.formulas.phase import HenyeyGreenstein as HenyeyGreenstein
    from translucent.formulas.phase import PhaseFunction as PhaseFunction
    from translucent.formulas.phase import WaterDroplets as WaterDroplets
    from translucent.frames.appearance import Appearance as Appearance
    from translucent.frames.appearance import appearance_of as appearance_of
    from translucent.frames.appearance import average_color as average_color
    from translucent.frames.appearance import medium_for_average_color as medium_for_average_color
    from translucent.frames.frame import Frame as Frame
    from translucent.frames.metrics import Errors as Errors
    from translucent.frames.metrics import compare as compare
    from translucent.frames.metrics import interior as interior
    from translucent.frames.photographs import Photograph as Photograph
    from translucent.frames.photographs import fit_photographs as fit_photographs
    from translucent.geometry.mesh import Mesh as Mesh
    from translucent.gltf.materials import read_materials as read_materials
    from translucent.gltf.write import write_medium as write_medium
    from translucent.interop.mitsuba import to_mitsuba as to_mitsuba
    from translucent.interop.mitsuba import write_mitsuba as write_mitsuba
    from translucent.materials import load_medium as load_medium
    from translucent.materials import text_block as text_block
    from translucent.media.albedo import scattering_medium as scattering_medium
    from translucent.media.conversion import DistanceMatch as DistanceMatch
    from translucent.media.conversion import clamp_colors as clamp_colors
    from translucent.media.conversion import color_at_distance as color_at_distance
    from translucent.media.conversion import condition_number as condition_number
    from translucent.media.conversion import distance_for_color as distance_for_color
    from translucent.media.conversion import extinction_from_colors as extinction_from_colors
    from translucent.media.density import DensityGrid as DensityGrid
    from translucent.media.density import ExponentialDensity as ExponentialDensity
    from translucent.media.density import LinearDensity as LinearDensity
    from translucent.media.fitting import Fit as Fit
    from translucent.media.fitting import StepFit as StepFit
    from translucent.media.fitting import fit_medium as fit_medium
    from translucent.media.fitting import fit_wedge as fit_wedge
    from translucent.media.medium import Medium as Medium
    from translucent.media.preset import Preset as Preset
    from translucent.media.presets import preset as preset
    from translucent.media.presets import presets as presets
    from translucent.mesh_files import load_mesh as load_mesh
    from translucent.notebook.view import view as view
    from translucent.page.write import write_page as write_page
    from translucent.planning.caustics import Caustics as Caustics
    from translucent.planning.interfaces import FrontInterface as FrontInterface
    from translucent.planning.interfaces import ScreenInterfaces as ScreenInterfaces
    from translucent.planning.interfaces import TracedInterfaces as TracedInterfaces
    from translucent.planning.methods import BackFaceDepth as BackFaceDepth
    from translucent.planning.methods import DepthPeeling as DepthPeeling
    from translucent.planning.methods import FragmentLists as FragmentLists
    from translucent.planning.methods import KBuffer as KBuffer
    from translucent.planning.methods import PathTraced as PathTraced
    from translucent.planning.methods import RayMarched as RayMarched
    from translucent.planning.methods import SignedDepth as SignedDepth
    from translucent.planning.methods import ThinLayer as ThinLayer
    from translucent.planning.plan import plan as plan
    from translucent.planning.render_plan import Capabilities as Capabilities
    from translucent.planning.render_plan import RenderPlan as RenderPlan
    from translucent.planning.scattering import Diffusion as Diffusion
    from translucent.planning.scattering import ScatteringLayer as ScatteringLayer
    from translucent.planning.scattering import SingleScattering as SingleScattering
    from translucent.planning.shadow_maps import ShadowMaps as ShadowMaps
    from translucent.renderer import Renderer as Renderer
    from translucent.scene.backdrop import Backdrop as Backdrop
    from translucent.scene.camera import Camera as Camera
    from translucent.scene.environment import Environment as Environment
    from translucent.scene.lights import DirectionalLight as DirectionalLight
    from translucent.scene.lights import PointLight as PointLight
    from translucent.scene.lights import SphereLight as SphereLight
    from translucent.scene.lights import SpotLight as SpotLight
    from translucent.scene.scene import Object as Object
    from translucent.scene.scene import Scene as Scene
    from translucent.scene.showcase import showcase as showcase
    from translucent.scene.stages import staged as staged
    from translucent.scene.surface import Surface as Surface
    from translucent.scene.texture import Texture as Texture
    from translucent.scene_files import load_scene as load_scene
    from translucent.showing import show as show
    from translucent.tiles import Tile as Tile
    from translucent.tiles import render_tiles as render_tiles

#: Modules of the public names. Each is imported when it is first asked for: SciPy and OpenGL take their time.
_NAMES = {
    "bake.attach": "attach",
    "bake.audit.check": "check_materials fix_materials",
    "bake.audit.rules": "MaterialCheck MaterialFinding",
    "bake.bake": "bake_thickness bake_vertex_thickness",
    "bake.batch": "BatchReport bake_many",
    "bake.lithophane": "Lithophane lithophane",
    "bake.scatter": "ScatterMap VertexScatter bake_scatter bake_vertex_scatter",
    "bake.settings": "BakeSettings",
    "bake.thickness_map": "BakeReport ThicknessMap VertexThickness load_thickness_map",
    "bake.usd_stage": "write_usd",
    "errors": "InputError RenderError TranslucentError TranslucentWarning",
    "formulas.phase": "Draine HenyeyGreenstein PhaseFunction WaterDroplets",
    "frames.appearance": "Appearance appearance_of average_color medium_for_average_color",
    "frames.frame": "Frame",
    "frames.metrics": "Errors compare interior",
    "frames.photographs": "Photograph fit_photographs",
    "geometry.mesh": "Mesh",
    "gltf.materials": "read_materials",
    "gltf.write": "write_medium",
    "interop.mitsuba": "to_mitsuba write_mitsuba",
    "materials": "load_medium text_block",
    "media.albedo": "scattering_medium",
    "media.conversion": "DistanceMatch clamp_colors color_at_distance "
    "condition_number distance_for_color extinction_from_colors",
    "media.density": "DensityGrid ExponentialDensity LinearDensity",
    "media.fitting": "Fit StepFit fit_medium fit_wedge",
    "media.medium": "Medium",
    "media.preset": "Preset",
    "media.presets": "preset presets",
    "mesh_files": "load_mesh",
    "notebook.view": "view",
    "page.write": "write_page",
    "planning.caustics": "Caustics",
    "planning.interfaces": "FrontInterface ScreenInterfaces TracedInterfaces",
    "planning.methods": "BackFaceDepth DepthPeeling FragmentLists KBuffer PathTraced RayMarched SignedDepth ThinLayer",
    "planning.plan": "plan",
    "planning.render_plan": "Capabilities RenderPlan",
    "planning.scattering": "Diffusion ScatteringLayer SingleScattering",
    "planning.shadow_maps": "ShadowMaps",
    "renderer": "Renderer",
    "scene.backdrop": "Backdrop",
    "scene.camera": "Camera",
    "scene.environment": "Environment",
    "scene.lights": "DirectionalLight PointLight SphereLight SpotLight",
    "scene.scene": "Object Scene",
    "scene.showcase": "showcase",
    "scene.stages": "staged",
    "scene.surface": "Surface",
    "scene.texture": "Texture",
    "scene_files": "load_scene",
    "showing": "show",
    "tiles": "Tile render_tiles",
}
_MODULE_OF = {name: f"translucent.{module}" for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted((*_MODULE_OF, "reference"))


def __getattr__(name: str) -> Any:
    if name in ("bench", "reference"):
        return import_module(f"translucent.{name}")
    if name == "__version__":
        return import_module("translucent.version").VERSION
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULE_OF[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
