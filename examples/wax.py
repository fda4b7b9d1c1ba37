"""
Wax: light scattered once, from a light behind
==============================================

Coefficients may be given as they are measured, in 1/m for red, green and blue. Blue is absorbed most, so the light that
comes the longest way through the bear is the reddest.
"""

import os

import translucent as tl
from translucent.assets import mesh_path

bear = tl.load_mesh(mesh_path("bear"))  # 19 mm high
wax = tl.Medium(absorption=(80, 160, 350), scattering=(870, 800, 550), anisotropy=0.2)

# %%
# Light that is scattered once leaves a body at no more than 1 / 4 pi of what comes in, so point lights are
# bright and surroundings dark.

light = tl.PointLight(bear.center + (0.03, 0.02, -0.02), intensity=(0.022, 0.021, 0.018))
sky = tl.DirectionalLight((0.3, -0.6, -1), irradiance=(0.9, 1.0, 1.2))
dusk = tl.Environment.gradient((0.02, 0.02, 0.025), (0.05, 0.05, 0.06))

width = int(os.environ.get("EXAMPLE_WIDTH", "640"))
size = (width, 3 * width // 4)
scene = tl.showcase(bear, wax, size=size, environment=dusk, lights=[light, sky])
with tl.Renderer() as renderer:
    frame = renderer.render(scene, size, samples=4)
frame.save("wax.png")
print(frame.plan)
