"""Results of a bake that can be saved: a map, or a value per vertex."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from translucent.bake.baked import BakedMap, BakedVertices
from translucent.bake.writing import save_map, save_vertices


@dataclass(frozen=True, eq=False)
class ThicknessMap(BakedMap):
    """Baked thickness map, from `translucent.bake_thickness`.

    Attributes
    ----------
    values : (h, w) float32
        Metres, but dimensionless for mode "local". Row 0 is the top of the image: v = 1 as trimesh and OBJ count,
        v = 0 in glTF. Padded beyond `coverage`; 0 elsewhere.
    coverage : (h, w) bool
        Texels that a triangle touches, before padding.
    standard_error : (h, w) float32
        Of `values`, in their unit; 0 where a mode takes no samples, and beyond `coverage`.
    escaped : float
        Share of rays that left the mesh without an exit: above 0 for meshes with holes.
    mesh : Mesh
        With the uv that the map belongs to; new ones where the mesh that was given had none.
    settings : BakeSettings
    report : BakeReport
    """

    def save(self, path: str | Path) -> None:
        """Write the map as .exr, .png, .npy or, into a copy of the model, .glb.

        Raises
        ------
        InputError
            If the suffix is not known.
        RenderError
            If the file cannot be written.
        """
        save_map(self, Path(path))


@dataclass(frozen=True, eq=False)
class VertexThickness(BakedVertices):
    """Thickness per vertex, from `translucent.bake_vertex_thickness`.

    Attributes
    ----------
    values : (n,) float32
        Metres, but dimensionless for mode "local"; 0 for vertices of no face. Vertices at one position are equal.
    standard_error : (n,) float32
        Of `values`, in their unit.
    mesh : Mesh
    settings : BakeSettings
    report : BakeReport
    """

    def save(self, path: str | Path) -> None:
        """Write the values as .ply or .glb attribute, or as .npy.

        Raises
        ------
        InputError
            If the suffix is not known.
        RenderError
            If the file cannot be written.
        """
        save_vertices(self, Path(path))
