"""The Blender snippet in Blender itself: a slab of the material, rendered by Cycles, lets through what ours does."""

from __future__ import annotations

import json
import runpy
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.formulas.interface import slab_reflectance, slab_transmittance
from translucent.materials.blender import absorption_node, blender_snippet

JADE = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)
MILK = tl.Medium(absorption=(14, 25, 142), scattering=(70, 122, 19), anisotropy=0.25)
GLOW = tl.Medium(absorption=(100, 200, 300), emission=(50, 200, 0))

SIDE, EYE = 8, 1.0  # pixels; distance of the camera from the slab's middle in metres

#: Arguments: snippet, thickness, samples, result. The world is white, and only the camera sees it, so that what is
#: scattered into the view adds nothing; with glass around the volume, all rays do, which it turns into others.
SLAB = f"""
import json, sys
import bpy
snippet, thickness, samples, result = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.read_factory_settings(use_empty=True)
with open(snippet) as stream:
    exec(compile(stream.read(), "snippet", "exec"), {{}})
bpy.ops.mesh.primitive_cube_add(size=1)
slab = bpy.context.object
slab.scale = (4, 4, float(thickness))
slab.data.materials.append(bpy.data.materials["translucent"])
scene = bpy.context.scene
view = bpy.data.cameras.new("camera")
view.type, view.ortho_scale, view.clip_start = "ORTHO", 1, 0.01
scene.camera = bpy.data.objects.new("camera", view)
scene.camera.location = (0, 0, {EYE})
scene.collection.objects.link(scene.camera)
scene.world = bpy.data.worlds.new("world")
if scene.world.node_tree is None:
    scene.world.use_nodes = True
(background,) = (node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
background.inputs["Color"].default_value = (1, 1, 1, 1)
glass = any(node.type == "BSDF_GLASS" for node in slab.active_material.node_tree.nodes)
for ray in () if glass else ("diffuse", "glossy", "transmission", "scatter"):
    setattr(scene.world.cycles_visibility, ray, False)
scene.render.engine = "CYCLES"
cycles = scene.cycles
cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", int(samples), False, False
cycles.volume_bounces, cycles.sample_clamp_direct, cycles.sample_clamp_indirect = 0, 0, 0
cycles.pixel_filter_type = "BOX"
scene.render.resolution_x = scene.render.resolution_y = {SIDE}
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = result + ".exr"
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(scene.render.filepath)
image.colorspace_settings.name = "Non-Color"
with open(result, "w") as stream:
    json.dump(list(image.pixels), stream)
"""

Render = Callable[[str, float, int], np.ndarray]


TOOL = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "measure_blender.py"))


@pytest.fixture(scope="session")
def blender() -> list[str]:
    """Command that starts a script in Blender: by a Python that has its module, or by the program."""
    if (command := TOOL["blender_command"]()) is None:
        pytest.skip(TOOL["ABSENT"])
    return list(command)


@pytest.fixture
def slab(blender: list[str], tmp_path: Path) -> Render:
    """(64, 3): what a camera sees of a white world through a slab with a snippet's material."""

    def _slab(snippet: str, thickness: float, samples: int) -> np.ndarray:
        (tmp_path / "slab.py").write_text(SLAB)
        (tmp_path / "snippet.py").write_text(snippet)
        result = tmp_path / "result.json"
        arguments = ["--", tmp_path / "snippet.py", thickness, samples, result]
        done = subprocess.run(
            [*blender, str(tmp_path / "slab.py"), *map(str, arguments)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return np.array(json.loads(result.read_text())).reshape(SIDE * SIDE, 4)[:, :3]

    return _slab


def length_error(medium: tl.Medium) -> np.ndarray:
    """Relative error of a transmittance: each end of the path is rounded to float32, at the distance of the eye."""
    return 8 * np.finfo(np.float32).eps * (EYE * medium.extinction + 1)


@pytest.mark.parametrize("thickness", [0.005, 0.02, 0.05])
def test_absorption_in_cycles_is_ours(slab: Render, thickness: float) -> None:
    seen = slab(blender_snippet(JADE), thickness, 1)
    expected = JADE.transmittance(thickness)
    assert (np.abs(seen - expected) <= length_error(JADE) * expected).all()


def test_a_color_picked_for_the_node_is_no_color_at_a_distance(slab: Render) -> None:
    # What an artist gets who types the color and 1 / distance into the node: exp(-(1 - c)) instead of c.
    color, density = absorption_node(JADE)
    right = blender_snippet(JADE)
    wrong = right.replace(f"({', '.join(map(repr, [*color.tolist(), 1.0]))})", "(0.18, 0.62, 0.35, 1.0)")
    wrong = wrong.replace(repr(density), repr(1 / 0.02))
    assert wrong != right
    np.testing.assert_allclose(slab(wrong, 0.02, 1)[0], np.exp([-0.82, -0.38, -0.65]), rtol=1e-4)


def test_emission_in_cycles_is_ours(slab: Render) -> None:
    seen, passed = slab(blender_snippet(GLOW), 0.01, 1), GLOW.transmittance(0.01)
    expected = passed + np.asarray(GLOW.emission) / GLOW.extinction * (1 - passed)
    assert (np.abs(seen - expected) <= length_error(GLOW) * (expected + 1)).all()


def test_a_scattering_volume_in_cycles_lets_through_what_ours_does(slab: Render) -> None:
    seen, expected = slab(blender_snippet(MILK), 0.01, 16384), MILK.transmittance(0.01)
    noise = seen.std(axis=0) / SIDE  # of the mean over the pixels, which have their own random numbers
    assert (noise < 1e-3).all()  # the naive values would be off by 0.1
    assert (np.abs(seen.mean(axis=0) - expected) <= 5 * noise).all()


@pytest.mark.parametrize("thickness", [0.005, 0.05])
def test_glass_around_the_volume_in_cycles_is_ours(slab: Render, thickness: float) -> None:
    """Seen straight on before a white world: all that a thin wall mirrors and lets through, of any order."""
    medium = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02, ior=1.5)
    seen, depth = slab(blender_snippet(medium), thickness, 1024), medium.extinction * thickness
    expected = slab_reflectance(0.04, depth) + slab_transmittance(0.04, depth)
    noise = seen.std(axis=0) / SIDE
    assert (noise < 2e-3).all()  # without the surface all would be off by 0.01 to 0.05
    assert (np.abs(seen.mean(axis=0) - expected) <= 5 * noise + length_error(medium)).all()


def test_a_ball_that_scatters_in_cycles_is_ours(blender: list[str]) -> None:
    """All that the material has: an interface that bends and mirrors, absorption, and scattering many times ahead."""
    side, samples = 8, 64
    medium = tl.Medium(absorption=(1, 4, 9), scattering=(120, 100, 80), anisotropy=0.4, ior=1.4)
    down, right = np.mgrid[:16, :32] / 16
    sky = np.stack([1 + 0.5 * np.sin(np.pi * right), 1.5 - down, 0.6 + 0.4 * np.cos(np.pi * right)], axis=-1)
    scene = TOOL["ball"](medium, 0.0, tl.Environment.image(sky), side)
    first, second = TOOL["in_cycles"](blender, scene, blender_snippet(medium), side, samples)
    frame, error = tl.reference.path_trace(scene, (side, side), samples)
    body = tl.reference.hit_counts(scene, (side, side)) > 0
    np.testing.assert_allclose(first[~body], frame.radiance[~body], rtol=1e-3)  # the same camera and the same sky
    noise = np.sqrt((error[body] ** 2 + (first - second)[body] ** 2 / 4).sum(axis=0))
    total, seen = frame.radiance[body].sum(axis=0), 0.5 * (first + second)[body].sum(axis=0)
    assert (noise <= 0.02 * total).all()
    # What Cycles leaves out after its bounces is less than the noise. Without those of the material it is half.
    assert (np.abs(seen - total) <= 4 * noise).all()
