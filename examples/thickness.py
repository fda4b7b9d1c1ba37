"""
A knot in false colors: the thickness itself, and its error
===========================================================

Every frame carries the physics that its colors come from. Here is the length inside the knot along each pixel's ray,
with a scale, and what it differs from the float64 reference.
"""

import os

import translucent as tl
from translucent.assets import mesh_path

jade = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02)
width = int(os.environ.get("EXAMPLE_WIDTH", "640"))
size = (width, 3 * width // 4)
scene = tl.showcase(tl.load_mesh(mesh_path("knot")), jade, size=size, stage="none")
with tl.Renderer() as renderer:
    frame = renderer.render(scene, size)
print(frame.plan)

# %%
# The reference traces the same rays in float64 on the CPU. Silhouettes, where the two may see different faces, are left
# out.

truth = tl.reference.render(scene, size)
away_from_edges = tl.interior(tl.reference.hit_counts(scene, size))
print(tl.compare(frame, truth, mask=away_from_edges))

# %%
# Pictures of thickness, transmittance, validity and error. Thickness is a matter of centimetres, its error of
# nanometres, so each of the two has a scale of its own.

for path in frame.save_aovs(".", truth=truth):
    print(path)
