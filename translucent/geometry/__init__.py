"""Triangle meshes: their defects and repairs, winding numbers, normals, ray casting, and simple solids."""
