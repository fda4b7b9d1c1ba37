"""
Soap bubbles over a glazed dish: thin films and clear coats
===========================================================

Light that is reflected at both sides of a film some hundred nanometres thick interferes, and the film is colored. A
soap bubble is a sheet around air with such a film, a dish has one between a clear coat and its glaze.
"""

import os

import numpy as np
import trimesh

import translucent as tl

# %%
# Names and ranges are glTF's (KHR_materials_iridescence, KHR_materials_clearcoat); lengths are metres. The medium of a
# bubble has the index 1: all that it mirrors, the film does. Films of soap get thinner with time.


ball = trimesh.creation.icosphere(subdivisions=4)
sphere = tl.Mesh(ball.vertices, ball.faces, name="bubble")


def bubble(center: tuple[float, float, float], radius: float, nanometres: float) -> tl.Object:
    """A bubble of a film that is so many nanometres thick."""
    place = np.diag([radius, radius, radius, 1.0])
    place[:3, 3] = center
    soap = tl.Surface(iridescence=1.0, iridescence_ior=1.33, iridescence_thickness=nanometres * 1e-9)
    return tl.Object(sphere, tl.Medium(), place, sheet_thickness=1e-6, surface=soap)


bubbles = [
    bubble((-0.05, 0.095, 0.0), 0.05, 350),
    bubble((0.055, 0.075, 0.03), 0.032, 250),
    bubble((0.035, 0.15, -0.03), 0.026, 520),
]

# %%
# The dish is opaque: dark blue glaze under the film, and a clear coat over all of it.

angle = np.linspace(0.0, np.pi / 2.6, 16)
inner = np.column_stack([0.11 * np.sin(angle), 0.11 * (1.0 - np.cos(angle))])
profile = np.concatenate([inner, (inner + [0.004, -0.004])[::-1], [[0.0, -0.004]]])
turned = trimesh.creation.revolve(profile, sections=96)
glaze = tl.Surface(
    color=(0.01, 0.02, 0.06),
    roughness=0.35,
    iridescence=1.0,
    iridescence_ior=2.2,
    iridescence_thickness=260e-9,
    clearcoat=1.0,
)
dish = tl.Object(tl.Mesh(turned.vertices[:, [0, 2, 1]], turned.faces[:, ::-1], name="dish"), surface=glaze)

# %%
# Rays are traced, so that bubbles mirror the dish and show their far sides. Films cost only where they are: without
# one, nothing of them is in any shader.

dark = tl.Environment.constant((0.03, 0.03, 0.04))
scene = tl.Scene(
    [*bubbles, dish],
    tl.Camera.look_at((0.0, 0.24, 0.42), (0.0, 0.065, 0.0), fov_y=30.0),
    environment=tl.Environment.studio().with_background(dark),
)
width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=4, interfaces=tl.TracedInterfaces())
frame.save("bubble.png", tone="neutral")
print(frame.plan)
