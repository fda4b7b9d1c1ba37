// Grids of all bodies in which light diffuses, below the fluence at the surface and above what enters there; and a ground's map.
// Each grid has six, beside each other: for what of a surface looks outwards and inwards along each axis (diffusion/sides.py).
uniform sampler3D diffused_light;
