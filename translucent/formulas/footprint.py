"""Numbers of the footprint of a pixel on rays that bend, shared by both renderers.

Differentials of rays are those of Igehy 1999, "Tracing ray differentials". The environment is averaged over an ellipse
of directions by lookups along its longer axis (McCormack et al. 1999, "Feline: fast elliptical lines for anisotropic
texture mapping"), each in a map that is blurred for the shorter one.
"""

from __future__ import annotations

#: Pixels across which differentials are taken, for one sample of a pixel; for several, over the square root of their
#: number. Over a whole pixel the footprint of a ray that has hit several curved surfaces is far from an ellipse: twice
#: the bias for a twentieth less noise.
FOOTPRINT_STEP = 0.5

#: Least cosine to a face that differentials are divided by.
LEAST_ACROSS = 0.02

#: Most lookups along an ellipse.
MOST_LOOKUPS = 2

#: Least shorter axis that the number of lookups counts with, in radians: about a pixel of the blurred maps' finest.
LEAST_BREADTH = 1e-3

#: Alpha of the microfacets of a mirror, over the standard deviation of a normal distribution of directions: half of
#: the light of both is as near to the middle. A GGX lobe has half of it within 2 alpha, the other within 1.177.
ALPHA_OF_DEVIATION = 0.59
