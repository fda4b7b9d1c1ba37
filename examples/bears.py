"""
Gummy bears: one mesh, three media
==================================

A mesh is data, an object is the mesh in a place, filled with a medium. The same bear is used three times, each time
filled with another color at a distance of 6 mm.
"""

import os

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

colors = ((0.75, 0.03, 0.05), (0.9, 0.55, 0.02), (0.1, 0.62, 0.08))
positions = ((-0.0135, 0.0, 0.001), (0.0, 0.0, 0.004), (0.0135, 0.0, 0.0))
angles = (-18.0, 0.0, 18.0)

bear = tl.load_mesh(mesh_path("bear"))
gummy = tl.Surface(roughness=0.22)
bears = []
for color, position, angle in zip(colors, positions, np.radians(angles), strict=True):
    cos, sin = np.cos(angle), np.sin(angle)
    transform = np.eye(4)
    transform[:3, :3] = [[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]
    transform[:3, 3] = position
    medium = tl.Medium.from_color(color, distance=0.006, ior=1.4)
    bears.append(tl.Object(bear, medium, transform, surface=gummy))

# %%
# Media that only absorb need no order: optical depths add up. But surfaces with an index of refraction could touch, and
# only the order tells where a ray leaves both, so the planner sorts; with ``ior=1`` it would take one unsorted pass.

camera = tl.Camera.look_at((0.0, 0.03, 0.09), (0.0, 0.0092, 0.0), fov_y=24.0)
scene = tl.staged(tl.Scene(bears, camera))

width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=16)
frame.save("bears.png", tone="neutral")
print(frame.plan)
