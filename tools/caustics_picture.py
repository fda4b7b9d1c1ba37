"""Picture of caustics in media of docs/measurements/shadows.md; `tools/gallery.py` draws it."""

from __future__ import annotations

import numpy as np
from PIL import Image

import translucent as tl
from translucent.bench.caustics import GLASS
from translucent.geometry.solids import Box


def main() -> None:
    """Draw a ball in fog and a ball over wax, side by side."""
    smoke = tl.Object(Box((-3.2, -4.0, -1.6), (3.2, 2.4, 1.6)).tessellate(), tl.Medium(0.02, 0.16))
    block = tl.Object(
        Box((-2.6, -2.6, -2.2), (2.6, -1.4, 2.2)).tessellate(),
        tl.Medium((0.02, 0.06, 0.2), (15.0, 14.0, 12.0), ior=1.45),
        surface=tl.Surface(roughness=0.3),
    )
    floor = tl.Object(Box((-30.0, -2.8, -30.0), (30.0, -2.6, 30.0)).tessellate(), color=(0.12, 0.13, 0.16))
    dusk = tl.Environment.gradient((0.02, 0.02, 0.03), (0.08, 0.09, 0.12))
    light = tl.SpotLight((-2.4, 6.0, 0.6), (2.4, -6.0, -0.6), [260, 250, 230], inner_cone=12.0, outer_cone=14.0)
    scenes = (
        tl.Scene([smoke, GLASS], tl.Camera.look_at((2, 0, 13), (0, -0.8, 0), fov_y=27.0), [light], dusk, "priority"),
        tl.Scene(
            [block, GLASS, floor],
            tl.Camera.look_at((2, 5.5, 7), (0.1, -1.2, 0), fov_y=38.0),
            [tl.DirectionalLight((0.6, -1.0, -0.2), (3.0, 2.9, 2.7))],
            dusk,
            "priority",
        ),
    )
    with tl.Renderer() as renderer:
        shown = [
            renderer.render(one, (360, 360), samples=4, scattering=tl.Diffusion(96), caustics=tl.Caustics(1_000_000))
            for one in scenes
        ]
    Image.fromarray(np.hstack([frame.to_srgb8() for frame in shown])).save("docs/caustics-in-media.png")


if __name__ == "__main__":
    main()
