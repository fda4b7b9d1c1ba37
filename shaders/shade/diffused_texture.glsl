// Grids of all bodies in which light diffuses, below the fluence at the surface and above what enters there; and a ground's map.
uniform sampler3D diffused_light;
