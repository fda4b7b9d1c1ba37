"""Results of a bake: a map or a value per vertex, its standard error, and a report."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from translucent.arrays import Floats, Mask
from translucent.bake.settings import BakeSettings
from translucent.geometry.mesh import Mesh


@dataclass(frozen=True)
class BakeReport:
    """Report of a bake.

    Attributes
    ----------
    rays : int
        Traced, those included that went on behind a first surface.
    seconds : float
        From call to result.
    mrays_per_second : float
    samples : int
        Points of the surface from which rays started.
    texels : int
        With a value of their own, before padding; 0 for vertices.
    overlapping_texels : int
        Whose center is inside several triangles in UV; the first triangle has it.
    faces_without_texel : int
        Triangles so small in UV that other triangles have all texels which they touch.
    degenerate_faces : int
        Triangles without area; they are left out.
    udim_tiles : tuple of int
        Tiles that the UVs lie in, 1001 being 0 <= u, v <= 1.
    uv_from : str
        "mesh", "xatlas", or "" for vertices.
    escaped : float
        Share of the rays that left the mesh without an exit.
    missed : float
        Share of the samples from which no surface of the high mesh was found.
    mean_standard_error, max_standard_error : float
        Over texels or vertices with a value, in its unit.
    above_tolerance : int
        Samples whose standard error is still above the tolerance after the last ray they may have.
    warnings : tuple of str
    """

    rays: int
    seconds: float
    mrays_per_second: float
    samples: int
    texels: int
    overlapping_texels: int
    faces_without_texel: int
    degenerate_faces: int
    udim_tiles: tuple[int, ...]
    uv_from: str
    escaped: float
    missed: float
    mean_standard_error: float
    max_standard_error: float
    above_tolerance: int
    warnings: tuple[str, ...] = ()

    def summary(self) -> dict[str, object]:
        """Report as values that JSON can hold."""
        return {**asdict(self), "udim_tiles": list(self.udim_tiles), "warnings": list(self.warnings)}


@dataclass(frozen=True, eq=False)
class BakedMap:
    """Data of a `ThicknessMap`, for writers."""

    values: Floats
    coverage: Mask
    standard_error: Floats
    escaped: float
    mesh: Mesh
    settings: BakeSettings
    report: BakeReport


@dataclass(frozen=True, eq=False)
class BakedVertices:
    """Data of a `VertexThickness`, for writers."""

    values: Floats
    standard_error: Floats
    mesh: Mesh
    settings: BakeSettings
    report: BakeReport
