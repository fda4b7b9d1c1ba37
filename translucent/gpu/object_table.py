"""Table of the objects of a scene, as shaders read it: the placement, medium and surface of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.two_stream import two_stream_absorption, two_stream_scattering
from translucent.gpu.body_uniforms import MAX_SCENE_OPTICAL_DEPTH, bounded_extinction
from translucent.gpu.constants import OBJECT_TYPES
from translucent.gpu.layout import OBJECT_ROW
from translucent.media.medium import VACUUM, Medium
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import SMOOTH

#: Fields of an object, by their names in `OBJECT_ROW`.
Fields = Mapping[str, npt.ArrayLike]

#: Placement of an object where no rays are traced.
_UNPLACED: Fields = dict.fromkeys(("local_x", "local_y", "local_z", "first_node", "node_count", "fading"), 0.0)

#: Fields of a body in which no light diffuses.
_NO_DIFFUSION: Fields = {
    "diffuses": 0.0,
    "grid_low": 0.0,
    "cells_per_metre": 0.0,
    "grid_size": 1.0,
    "first_layer": 0.0,
    "albedo": 0.0,
    "conductance": 0.0,
    "emergent_fluxes": 0.0,
    "exit_share": 0.0,
    "mean_cosine": 1.0,
    "ahead": 0.0,
    "haze_far": 0.0,
    "haze_near": 0.0,
}


def object_rows(
    scene: Scene, sheets: Mapping[int, float], diffused: Mapping[int, Fields] | None = None
) -> tuple[Fields, ...]:
    """Media and surfaces of all objects.

    Parameters
    ----------
    scene : Scene
    sheets : dict of int to float
        Thickness in metres of the objects that are drawn without an inside, by their numbers.
    diffused : dict of int to dict, optional
        Fields of those in which light diffuses.
    """
    ranks = np.unique([body.priority for body in scene.objects], return_inverse=True)[1] + 1.0
    numbers: dict[Medium | None, int] = {}
    rows = []
    for i, body in enumerate(scene.objects):
        decides = i not in sheets and body.medium is not None and (body.has_interface or scene.overlap == "priority")
        own = {"rank": ranks[i] if decides else 0.0, "slot": numbers.setdefault(body.medium, len(numbers))}
        diffusion = (diffused or {}).get(i, _NO_DIFFUSION)
        rows.append({**_medium(scene, body, sheets.get(i)), **_surface(body, sheets.get(i)), **own, **diffusion})
    return tuple(rows)


def packed_objects(rows: Sequence[Fields], placements: Sequence[Fields] | None = None) -> npt.NDArray[np.float32]:
    """(objects, texels, 4): contents of the table; `placements` are those of `SceneHierarchies.place`."""
    placed = placements or [_UNPLACED] * len(rows)
    return OBJECT_ROW.pack([{**row, **place} for row, place in zip(rows, placed, strict=True)])


def _medium(scene: Scene, body: Object, sheet: float | None) -> Fields:
    medium, metres = body.medium or VACUUM, 1.0 if sheet is None else sheet
    extinction = metres * bounded_extinction(medium, scene.diagonal)
    with np.errstate(under="ignore"):
        albedo = medium.scattering / np.where(medium.extinction > 0, medium.extinction, 1.0)
    stream = two_stream_absorption(medium.absorption), two_stream_scattering(medium.scattering, medium.anisotropy)
    limit = MAX_SCENE_OPTICAL_DEPTH / max(scene.diagonal, float(np.finfo(np.float64).tiny))
    return {
        "extinction": extinction,
        "scattering": extinction * albedo,
        "emission": metres * np.asarray(medium.emission),
        "phase": medium.phase_function.parameters,
        "stream_absorption": np.minimum(stream[0], limit),
        "stream_scattering": np.minimum(stream[1], limit),
        "inner_mirror": diffuse_interface(medium.ior).reflected,
        "scatters_much": treatment_of(body) is Treatment.LAYER,
        "longest": np.linalg.norm(body.bounds[1] - body.bounds[0]),
    }


def _surface(body: Object, sheet: float | None) -> Fields:
    surface, opaque = body.surface or SMOOTH, body.medium is None
    return {
        "type": OBJECT_TYPES.index(_type(body, sheet)),
        "outwards": -1.0 if body.mesh.diagnosis.inverted else 1.0,
        "not_closed": not opaque and not body.mesh.diagnosis.solid,
        "plain": body.surface is None if opaque else body.plain,
        "one_sided": not surface.double_sided,
        "color": body.base_color if opaque else np.asarray(surface.color),
        "transmission": surface.transmission,
        "ior": surface.ior if body.medium is None else body.medium.ior,
        "dispersion": surface.dispersion,
        "roughness": surface.roughness,
        "metallic": surface.metallic,
        "emissive": np.asarray(surface.emissive),
        "passed": surface.diffuse_transmission * np.asarray(surface.diffuse_transmission_color),
        "passed_share": surface.diffuse_transmission,
        "film": (surface.iridescence, surface.iridescence_ior, surface.iridescence_thickness),
        "clearcoat": surface.clearcoat,
        "clearcoat_roughness": surface.clearcoat_roughness,
    }


def _type(body: Object, sheet: float | None) -> str:
    if body.medium is None:
        return "OPAQUE"
    if body.covers:
        return "UNSEEN"
    return "SOLID" if sheet is None else "THIN_WALL" if body.has_interface else "ABSORBER"
