# mypy: ignore-errors
"""Render scenes of the benchmark by Blender: ``PYTHON blender_scene.py cycles|eevee SAMPLES``, with bpy.

Each line of standard input is a folder of a scene and the .exr to write; each line of the answer begins with ``@`` and
is JSON. It runs in a Python of its own, with nothing of this toolkit.
"""

import json
import math
import sys
import time
from pathlib import Path

import bpy
import mathutils

#: glTF's (x, y, z) in Blender's axes, which are z up.
AXES = mathutils.Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))

#: Cells of EEVEE's volumes along the view; twice as many are the most that it has.
CELLS = 128


def new_node(tree, kind, **values):
    """Add a node, with values for its inputs by name."""
    node = tree.nodes.new(kind)
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node


def material_of(description, number, engine):
    """Glass or a transparent surface, and a volume with the coefficients of the medium; or a diffuse surface.

    Rays that EEVEE refracts do not see volumes: its clear glass gets the color of the mean chord.
    """
    material = bpy.data.materials.new(f"benchmark {number}")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if description["type"] == "opaque":
        color = (*description["diffuse_reflectance"], 1.0)
        surface = new_node(tree, "ShaderNodeBsdfDiffuse", Color=color, Roughness=0.0)
        tree.links.new(surface.outputs[0], output.inputs["Surface"])
        return material
    if description["ior"] == 1.0:
        surface = tree.nodes.new("ShaderNodeBsdfTransparent")
    else:
        surface = new_node(tree, "ShaderNodeBsdfGlass", IOR=description["ior"], Roughness=description["roughness"])
        surface.distribution = "MULTI_GGX"
        if hasattr(material, "use_raytrace_refraction"):
            material.use_raytrace_refraction = True  # EEVEE
    tree.links.new(surface.outputs[0], output.inputs["Surface"])
    if engine == "eevee" and description["ior"] != 1.0 and not any(description["scattering"] + description["emission"]):
        color = [math.exp(-each * description["mean_chord"]) for each in description["absorption"]]
        surface.inputs["Color"].default_value = (*color, 1.0)
        return material
    volume = tree.nodes.new("ShaderNodeVolumeCoefficients")
    for name, value in (("Absorption", "absorption"), ("Scatter", "scattering"), ("Emission", "emission")):
        volume.inputs[f"{name} Coefficients"].default_value = description[value]
    volume.inputs["Anisotropy"].default_value = description["anisotropy"]
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    return material


def build(folder, engine, samples):
    """Set up the scene of a folder."""
    description = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(folder / "scene.glb"))
    scene = bpy.context.scene
    for item in list(bpy.data.objects):
        if item.type == "LIGHT":
            bpy.data.objects.remove(item)
    for number, one in enumerate(description["objects"]):
        mesh = bpy.data.objects[f"object_{number}"]
        mesh.data.materials.clear()
        mesh.data.materials.append(material_of(one, number, engine))
    for light in description["lights"]:
        add_light(scene, light)
    world = bpy.data.worlds.new("world")
    scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    picture = tree.nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(str(folder / "environment.exr"))
    picture.image.colorspace_settings.name = "Linear Rec.709"
    turned = new_node(tree, "ShaderNodeMapping", Rotation=(0, 0, -math.pi / 2))
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], turned.inputs["Vector"])
    tree.links.new(turned.outputs[0], picture.inputs["Vector"])
    background = tree.nodes.new("ShaderNodeBackground")
    tree.links.new(picture.outputs[0], background.inputs["Color"])
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    set_camera(scene, description["camera"])
    scene.render.resolution_x, scene.render.resolution_y = description["size"]
    scene.render.resolution_percentage = 100
    scene.render.filter_size = 1.0
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    if engine == "cycles":
        use_cycles(scene, samples)
    else:
        use_eevee(scene, samples, description)


def set_camera(scene, description):
    """Place the camera, with its vertical angle."""
    camera = bpy.data.objects.new("benchmark camera", bpy.data.cameras.new("benchmark"))
    scene.collection.objects.link(camera)
    pose = mathutils.Matrix.Identity(4)
    columns = description["right"], description["up"], [-value for value in description["forward"]], description["eye"]
    for column, values in enumerate(columns):
        for row in range(3):
            pose[row][column] = values[row]
    camera.matrix_world = AXES @ pose
    camera.data.sensor_fit = "VERTICAL"
    camera.data.angle_y = math.radians(description["fov_y_degrees"])
    away = pose.translation.length
    camera.data.clip_start, camera.data.clip_end = 1e-3 * away, 1e2 * away
    scene.camera = camera


def add_light(scene, description):
    """Add a point or directional light: watts are 4 pi times the intensity in W/sr."""
    strength = description.get("irradiance") or description["intensity"]
    brightest = max(strength)
    data = bpy.data.lights.new("light", "SUN" if description["type"] == "directional" else "POINT")
    data.color = [value / brightest for value in strength]
    item = bpy.data.objects.new("light", data)
    scene.collection.objects.link(item)
    if description["type"] == "directional":
        data.energy, data.angle = brightest, 0.0
        item.rotation_mode = "QUATERNION"
        item.rotation_quaternion = (AXES.to_3x3() @ mathutils.Vector(description["direction"])).to_track_quat("-Z", "Y")
    else:
        data.energy, data.shadow_soft_size = brightest * 4 * math.pi, 0.0
        item.location = AXES @ mathutils.Vector(description["position"])


def use_cycles(scene, samples):
    """Configure Cycles: no limits, clamps or filters that bias the picture, with denoising."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_adaptive_sampling = "CPU", samples, False
    cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    for name in ("max", "diffuse", "glossy", "transmission", "volume", "transparent_max"):
        setattr(cycles, f"{name}_bounces", 128)


def use_eevee(scene, samples, description):
    """Configure EEVEE: screen-space ray tracing, finest shadows and volumes.

    A sample takes a volume for as thick as the cells of a grid along the view, or does not see it, by chance. So thin
    bodies get more cells: with the fewer ones they lose most of their color.
    """
    scene.render.engine = "BLENDER_EEVEE"
    eevee = scene.eevee
    eevee.taa_render_samples, eevee.use_raytracing, eevee.use_shadows = samples, True, True
    eevee.ray_tracing_options.resolution_scale = "1"
    bodies = [
        (bpy.data.objects[f"object_{i}"], one) for i, one in enumerate(description["objects"]) if one["type"] == "body"
    ]
    thin = any(CELLS * one["mean_chord"] < max(item.dimensions) for item, one in bodies)
    eevee.volumetric_tile_size, eevee.volumetric_samples = "2", 2 * CELLS if thin else CELLS


def main(engine, samples):
    """Render the scenes named on standard input."""
    print("@" + json.dumps({"version": bpy.app.version_string}), flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        try:
            build(Path(order["folder"]), engine, samples)
            bpy.context.scene.render.filepath = order["picture"]
            begin = time.perf_counter()
            bpy.ops.render.render(write_still=True)
            print("@" + json.dumps({"seconds": time.perf_counter() - begin}), flush=True)
        except Exception as error:  # noqa: BLE001 - the next scene may work
            print("@" + json.dumps({"error": f"{type(error).__name__}: {error}"}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
