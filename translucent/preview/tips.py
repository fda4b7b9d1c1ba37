"""Explanations of the knobs: what each is, its unit, typical values, and its name in glTF."""

from __future__ import annotations

#: Texts by field.
TIPS = {
    "model.unit": "Unit of the file's coordinates. glTF is in metres; most .stl are in mm.",
    "material.color": (
        "attenuationColor (glTF): linear color that is left of white light after attenuationDistance.\n"
        "Never black: what is left after the distance is more than nothing."
    ),
    "material.distance": (
        "attenuationDistance (glTF): length after which attenuationColor is left.\n"
        "Typical: wine 1 cm, honey 2 cm, water 5 m. Twice as long: half the extinction."
    ),
    "material.thickness": (
        "thicknessFactor (glTF), in metres: written to files, and the sheet of thin layers.\n"
        "Typical: 0.001 for a leaf or a bottle's wall. The picture uses the mesh's own thickness."
    ),
    "material.ior": (
        "ior (glTF), index of refraction, no unit; 1: light goes straight on.\n"
        "Typical: water 1.33, wine 1.36, wax 1.44, glass 1.5, crystal 1.55, diamond 2.42."
    ),
    "material.roughness": (
        "roughnessFactor (glTF), 0 to 1, no unit: how much the surface blurs what it mirrors and lets "
        "through. Typical: polished 0, soap 0.3, frosted glass 0.4, wax 0.35."
    ),
    "material.transmission": (
        "transmissionFactor (glTF), 0 to 1: share of the light that is not mirrored which enters.\n"
        "Typical: 1; the rest is an opaque, diffuse base."
    ),
    "material.dispersion": (
        "dispersion (glTF), 20 / Abbe number, no unit: how far colors part when they are refracted.\n"
        "Typical: crown glass 0.3, flint glass 0.55, diamond 0.36; 0: none."
    ),
    "material.iridescence": (
        "iridescenceFactor (glTF), 0 to 1, no unit: share of the surface with a thin film, whose interference\n"
        "colors what is mirrored. Typical: 0 none; soap bubbles, oil on water and coated glass 1."
    ),
    "material.iridescence_ior": (
        "iridescenceIor (glTF): index of refraction of the film, no unit. Typical: soapy water 1.33, oxides 2 to 2.7."
    ),
    "material.iridescence_thickness": (
        "iridescenceThicknessMaximum (glTF), in nm: thickness of the film, which sets its colors.\n"
        "Typical: 100 to 1000; below 50 it darkens what is mirrored, above 2000 its colors fade."
    ),
    "material.clearcoat": (
        "clearcoatFactor (glTF), 0 to 1, no unit: share of the surface with a clear coat of ior 1.5, which\n"
        "mirrors light from outside. Typical: 0 none; lacquer and glaze 1."
    ),
    "material.clearcoat_roughness": (
        "clearcoatRoughnessFactor (glTF), 0 to 1, no unit: how much the coat blurs what it mirrors.\n"
        "Typical: fresh lacquer 0, satin 0.3."
    ),
    "material.absorption": (
        "sigma_a in 1/m, for red, green and blue: light that is lost. Typical: water 0.3, wine 100."
    ),
    "material.scattering": (
        "sigma_s in 1/m (multiscatterColor of glTF's drafts): light that changes direction.\n"
        "Typical: clear 0, jade 200, milk 1000 and more."
    ),
    "material.emission": "Radiance that the medium adds, per metre of the ray. Typical: 0; a flame 1 to 100.",
    "material.anisotropy": (
        "g (scatterAnisotropy of glTF's drafts), -0.99 to 0.99: mean cosine of the angle of scattering.\n"
        "Typical: 0 isotropic, 0.8 milk and skin (forward), -0.3 backward."
    ),
    "look.stage": (
        "A ground that catches shadows, lamps and soft boxes, as --stage of translucent render; auto: studio,"
        " unless the model brings a camera, lights or a ground, or an environment is chosen. Quantities and "
        "the reference go without."
    ),
    "look.environment": (
        "What lights the model from all directions: a name, a color, or a picture (.hdr, .exr, .png)."
    ),
    "look.background": "What is seen behind the model; it does not light. Typical: the environment itself.",
    "look.rotation": "Turn of the environment about +Y in degrees; of a stage with its lamps. Or drag with E held.",
    "look.exposure": (
        "Brightness of the picture in stops: 1 is twice as bright. Typical: -2 to 2. Light stays as it is."
    ),
    "look.tone": (
        "Curve from light to the screen; auto: neutral on a stage, where light sources are brighter than "
        "white, else none."
    ),
    "look.light": (
        "A directional light besides, seen in media that scatter, and on opaque objects. Or drag with L held."
    ),
    "look.light_yaw": (
        "Direction of the light around the model in degrees: 0 from the front, 90 from +X, 180 from behind."
    ),
    "look.light_pitch": "Direction of the light above the horizon in degrees. Typical: 30 to 60.",
    "look.light_irradiance": (
        "Irradiance of the light in W/m2 (intensity of KHR_lights_punctual, lx there).\n"
        "Typical: 3 is as bright as white surroundings."
    ),
    "display.method": "How thickness is found; auto: the cheapest method that is exact for the scene.",
    "display.method_b": "The method right of the split, to be compared with the one on its left.",
    "display.scattering": (
        "Light scattered many times: it diffuses in the body, leaves as from a flat layer, or is left out; "
        "auto: what the body needs."
    ),
    "display.mode": (
        "Quantity on show: the picture, thickness along the view ray in false colors, transmittance, or where"
        " numbers can be trusted."
    ),
    "display.compare": (
        "What is right of the split: another method, the float64 reference, or the error of thickness."
    ),
    "display.split": "Position of the split, 0 to 1 from the left. Or drag the line.",
    "display.inset": (
        "The float64 reference as a small picture in the corner, while the view is still. It has straight "
        "rays, paint and opaque surfaces with their textures, and the holes of leaves; nothing mirrors there, "
        "and what tints clear glass is left out."
    ),
    "display.antialias": "More samples of a pixel while the view is still.",
    "display.converge": (
        "Path trace the picture while nothing changes (C): all light, with less noise the longer it goes on."
    ),
    "display.caustics": (
        "Photons carry the light of lamps through interfaces onto opaque objects while nothing changes (P): "
        "--caustics of translucent render, more and more of them. The picture that moves has none, and "
        "neither has one that converges."
    ),
    "display.unit": "Unit of the lengths in panels and scales.",
    "orbit.fov_y": "Vertical angle of view in degrees (yfov of a glTF camera, there in radians). Typical: 20 to 50.",
    "orbit.orthographic": "No perspective (O), as glTF's orthographic cameras: parallel rays, for technical views.",
}
