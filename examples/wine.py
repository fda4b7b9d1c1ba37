"""
Wine in a glass: two media in one place
=======================================

A young red wine, whose color changes from the edge to the middle, in a crystal glass. The wine's mesh reaches a little
into the glass, as every mesh of a filled vessel should: with ``overlap="priority"`` the object of the higher priority
has what both claim, so there is neither a gap nor a doubled layer where they touch.
"""

import os

import translucent as tl
from translucent.assets import mesh_path

# %%
# The wine is a color at a distance: what 2 cm of it leave of white light. Crystal is one of the named media.

red = tl.Medium.from_color((0.62, 0.05, 0.09), distance=0.02, ior=1.34)
glass = tl.Object(tl.load_mesh(mesh_path("goblet")), tl.preset("crystal").medium, priority=1)
wine = tl.Object(tl.load_mesh(mesh_path("wine")), red)

camera = tl.Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
scene = tl.Scene([glass, wine], camera, environment=tl.Environment.studio(), overlap="priority")

# %%
# Priorities need the surfaces of each ray in order. The planner sees that and says so in the plan below.

width = int(os.environ.get("EXAMPLE_WIDTH", "960"))
with tl.Renderer() as renderer:
    frame = renderer.render(scene, (width, 3 * width // 4), samples=16)
frame.save("wine.png", tone="neutral")
print(frame.plan)
