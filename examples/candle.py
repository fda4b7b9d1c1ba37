"""
A candle: a medium that emits, and a point light in it
======================================================

Three kinds of objects: wax that scatters, a flame that emits, and a wick without a medium, which is opaque. A point
light in the flame lights the wax from above; a directional one lights it from behind. What enters the wax at the top
spreads downwards in it, which makes the candle bright below its rim.
"""

import os

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

white = tl.scattering_medium((0.95, 0.88, 0.72), 0.002, ior=1.44)
dull = tl.Surface(roughness=0.45)
wax = tl.Object(tl.load_mesh(mesh_path("candle")), white, surface=dull)
wick = tl.Object(tl.load_mesh(mesh_path("wick")), None, color=(0.03, 0.02, 0.02))

# %%
# Emission is radiance per metre: a flame one centimetre thick that hardly absorbs shows a hundredth of these numbers.

flame = tl.Object(tl.load_mesh(mesh_path("flame")), tl.Medium(absorption=20.0, emission=(900.0, 480.0, 130.0)))
lights = [
    tl.PointLight((0.0, 0.08, 0.0), intensity=np.array((1.0, 0.55, 0.2)) * 0.012),
    tl.DirectionalLight((0.4, -0.3, 1.0), irradiance=np.array((1.0, 0.9, 0.8)) * 1.0),
]

camera = tl.Camera.look_at((0.0, 0.13, 0.32), (0.0, 0.044, 0.0), fov_y=24.0)
evening = tl.Environment.studio(exposure=-2.5)
scene = tl.Scene([wax, wick, flame], camera, lights, evening)

width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=16)
frame.save("candle.png", tone="neutral")
print(frame.plan)
