"""Render a mesh with a material in Cycles: what `measure_blender` starts in Blender. Its only argument is a JSON file.

It holds ``snippet`` (the text that makes the material), ``mesh`` (an .npz file of vertices and faces), ``pose`` (camera
to world) and ``fov`` (radians), ``side`` (pixels), ``samples``, ``environment``
(three numbers, or a picture of all directions) and ``result``, an .npy file to be written: (2, side, side, 3)
radiance with two seeds, row 0 at the top. Coordinates are Blender's, +Z up.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np


def body(mesh: str, snippet: str) -> None:
    """Add the mesh, smooth, with the material that the snippet makes."""
    exec(compile(snippet, "snippet", "exec"), {})
    with np.load(mesh) as arrays:
        data = bpy.data.meshes.new("body")
        data.from_pydata(arrays["vertices"].tolist(), [], arrays["faces"].tolist())
    data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
    data.materials.append(bpy.data.materials["translucent"])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("body", data))


def camera(pose: list[list[float]], fov: float) -> None:
    """Place the camera."""
    view = bpy.data.cameras.new("camera")
    view.clip_start, view.sensor_fit, view.angle = 1e-3, "VERTICAL", fov
    one = bpy.data.objects.new("camera", view)
    one.matrix_world = np.transpose(pose)  # Blender takes columns
    bpy.context.scene.collection.objects.link(one)
    bpy.context.scene.camera = one


def world(environment: list[float] | str) -> None:
    """Light the scene by a radiance from all sides, or by a picture."""
    one = bpy.data.worlds.new("world")
    if one.node_tree is None:
        one.use_nodes = True  # before Blender 5
    bpy.context.scene.world = one
    nodes, links = one.node_tree.nodes, one.node_tree.links
    (background,) = (node for node in nodes if node.type == "BACKGROUND")
    if not isinstance(environment, str):
        background.inputs["Color"].default_value = (*environment, 1.0)
        return
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(environment)
    texture.image.colorspace_settings.name = "Non-Color"
    links.new(texture.outputs["Color"], background.inputs["Color"])


def settings(side: int, samples: int) -> None:
    """Set Cycles to what has no bias but that of its bounces, which are left: nothing clamped, blurred or denoised."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", samples, False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = cycles.light_sampling_threshold = 0
    cycles.pixel_filter_type, cycles.filter_width = "GAUSSIAN", 0.01  # the centers of pixels
    scene.render.resolution_x = scene.render.resolution_y = side
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"


def pixels(path: Path, seed: int) -> Any:
    """Render, and read what was rendered."""
    bpy.context.scene.cycles.seed = seed
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    return np.array(image.pixels[:], dtype=np.float32).reshape(height, width, 4)[::-1, :, :3]


def main(job: dict[str, Any]) -> None:
    """Render one picture."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    settings(job["side"], job["samples"])
    body(job["mesh"], job["snippet"])
    camera(job["pose"], job["fov"])
    world(job["environment"])
    result = Path(job["result"])
    np.save(result, [pixels(result.with_name(f"{seed}.exr"), seed) for seed in (0, 1)])


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[-1]).read_text(encoding="utf-8")))
