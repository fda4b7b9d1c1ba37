"""
Amber: refraction at a polished surface
=======================================

An index of refraction above 1 is all that it takes: the surface mirrors the studio by Fresnel's equations, rays turn
where they enter the body and where they leave it, and the path inside is that of the refracted ray.
"""

import os

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

turn = np.radians(35.0)
cos, sin = np.cos(turn), np.sin(turn)
turned = np.eye(4)
turned[:3, :3] = [[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]

resin = tl.Medium.from_color((0.93, 0.46, 0.06), distance=0.02, ior=1.54)
amber = tl.Object(tl.load_mesh(mesh_path("amber")), resin, turned)

camera = tl.Camera.look_at((0.0, 0.06, 0.15), (0.0, 0.0145, 0.0), fov_y=24.0)
scene = tl.staged(tl.Scene([amber], camera))  # on a ground, with soft boxes to mirror

width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=16)
frame.save("amber.png", tone="neutral")
print(frame.plan)
