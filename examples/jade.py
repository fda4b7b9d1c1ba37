"""
A jade bangle: light that scatters many times
=============================================

``scattering_medium`` finds the medium that shows a color where it is thick; its second number is the mean free path,
the length after which light is scattered or absorbed. Nothing has to be asked for: the planner has light diffuse in
bodies that scatter much, and the plan says so.
"""

import os

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

# %%
# The bangle leans towards the eye. A transform is a 4 x 4 matrix for column vectors, in metres.

turn = np.radians(-28.0)
cos, sin = np.cos(turn), np.sin(turn)
leaning = np.eye(4)
leaning[:3, :3] = [[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]

stone = tl.scattering_medium((0.07, 0.34, 0.17), 0.003, ior=1.6)
polish = tl.Surface(roughness=0.18)
bangle = tl.Object(tl.load_mesh(mesh_path("bangle")), stone, transform=leaning, surface=polish)

camera = tl.Camera.look_at((0.02, 0.09, 0.24), (0.0, 0.036, 0.0), fov_y=24.0)
scene = tl.staged(tl.Scene([bangle], camera))

# %%
# Light that enters from the studio spreads in the stone, and leaves elsewhere: shadows are soft and green.
# It is solved for before the first picture; further ones, from elsewhere, only look it up.

width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=16)
frame.save("jade.png", tone="neutral")
print(frame.plan)
