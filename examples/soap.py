"""
Soap: a rough surface over a medium, lit from behind
====================================================

Light that enters behind spreads in the bar before it leaves in front: edges, where it has a short way, are lighter than
the middle, and nothing has a hard shadow. The surface is rough, so it shows a soft highlight in place of a mirrored
studio.
"""

import os

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

turn = np.radians(24.0)
cos, sin = np.cos(turn), np.sin(turn)
turned = np.eye(4)
turned[:3, :3] = [[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]

soap = tl.scattering_medium((0.9, 0.66, 0.34), 0.006, ior=1.45)
waxy = tl.Surface(roughness=0.35)
bar = tl.Object(tl.load_mesh(mesh_path("soap")), soap, turned, surface=waxy)

# %%
# A light's direction is the one in which its light travels: this one comes from behind the bar's far edge, and above.

behind = tl.DirectionalLight((-0.3, -0.5, 0.8), irradiance=1.5)
camera = tl.Camera.look_at((0.0, 0.13, 0.21), (0.0, 0.012, 0.0), fov_y=24.0)
scene = tl.Scene([bar], camera, [behind], tl.Environment.studio())

width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=16)
frame.save("soap.png", tone="neutral")
print(frame.plan)
