"""Triangle meshes: their defects and repairs, winding numbers, normals, and solids with exact chords."""
