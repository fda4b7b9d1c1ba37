"""Light that diffuses in bodies: grids of cut cells, what enters through surfaces, and the solution for a scene."""
