"""Light of a scattering medium at any albedo, between a few that are solved for when a page is written.

Channels do not mix in a solution, and the grid stays: so gray albedos are enough for all colors of one density. The
logarithm of what is read at the surface, over the albedo, is smooth in sqrt(1 - albedo), to which the diffusion length
is inverse: a cubic spline between a few solutions is off by a thousandth. Its values over the grid are nearly linear
combinations of a few, which are found by singular value decomposition, vary slowly, and are kept on every other cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import distance_transform_edt

from translucent.arrays import Array
from translucent.formulas.diffuse_interface import half_space_reflectance
from translucent.media.medium import Medium
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import RenderedObject, Treatment, scatterer_of, treated, treatment_of

if TYPE_CHECKING:
    from translucent.diffusion.field import DiffusionField
    from translucent.page.container import Container

#: Reduced albedos that are solved for.
SOLVED = (0.02, 0.15, 0.45, 0.75, 0.92, 0.98, 0.995, 0.999, 1.0)

#: Functions over the grid whose combinations the others are.
RANK = 3

#: Cells of a solution along each axis for one that is kept.
COARSER = 2

#: Places between 0 and the largest sqrt(1 - albedo) at which a page has numbers.
STEPS = 65

#: Points of the surface at which the error is measured.
_POINTS = 2000

#: Fraction of the largest value from which on a logarithm says something: fits to the samples around a cell end at 0.
_LEAST_VALUE = 1e-5

_TINY = 1e-30


@dataclass(frozen=True, eq=False)
class AlbedoBlock:
    """Values of a part of the texture of diffused light, as functions of the albedo.

    Attributes
    ----------
    basis : (rank, sides, z, y, x, 3) int8
        Functions over coarse cells; those of the sides of a surface one after the other.
    coefficients : (STEPS, rank) float32
        Of these functions, at even steps of sqrt(1 - albedo): their sum is the logarithm of a value over its albedo; or
        a value, up to a constant.
    logarithmic : bool
    size : (x, y, z)
        Cells of the texture.
    """

    basis: npt.NDArray[np.int8]
    coefficients: npt.NDArray[np.float32]
    logarithmic: bool
    size: tuple[int, int, int]

    @classmethod
    def of(cls, known: Array, *, logarithmic: bool) -> AlbedoBlock:
        """Block of values (albedos, sides, x, y, z, 3) at the albedos `SOLVED`."""
        size = known.shape[2:5]
        least = known.min(axis=(0, -1))
        read = least > _LEAST_VALUE * known.max() if logarithmic else np.ones_like(least, bool)
        values = np.log(np.maximum(known / np.reshape(SOLVED, (-1, 1, 1, 1, 1, 1)), _TINY)) if logarithmic else known
        coarse = np.stack([_coarse(one, read) for one in values])
        coarse -= coarse.mean(axis=0)
        left, singular, right = np.linalg.svd(coarse.reshape(len(SOLVED), -1), full_matrices=False)
        scale = np.maximum(np.abs(right[:RANK]).max(axis=1), _TINY) / 127.0
        quantized = np.round(right[:RANK] / scale[:, None]).astype(np.int8)
        basis = quantized.reshape(-1, *coarse.shape[1:]).transpose(0, 1, 4, 3, 2, 5)
        at = _variable(np.array(SOLVED))[::-1]
        spline = CubicSpline(at, (left[:, :RANK] * singular[:RANK] * scale)[::-1])
        steps = spline(np.linspace(0.0, at[-1], STEPS)).astype(np.float32)
        return cls(np.ascontiguousarray(basis), steps, logarithmic, (size[0], size[1], size[2]))

    def entry(self, into: Container, layer: int) -> dict[str, Any]:
        """Entry in a page's header, for the first of its layers in the texture."""
        basis = into.add(self.basis.view(np.uint8))
        steps = into.add(self.coefficients)
        return {
            "layer": layer,
            "size": list(self.size),
            "logarithmic": self.logarithmic,
            "basis": basis,
            "steps": steps,
        }

    def changed(self, values: Array, before: Array, after: Array) -> Array:
        """Values (sides, x, y, z, 3) at albedos `after` (3,), as the page finds them from those at albedos `before`."""
        weights = _between(self.coefficients, after) - _between(self.coefficients, before)
        coarse = np.einsum("cr,rszyxc->sxyzc", weights, self.basis.astype(np.float64))
        x, y, z = (_linear(fine, few) for fine, few in zip(self.size, coarse.shape[1:4], strict=True))
        change = np.einsum("xa,yb,zd,sabdc->sxyzc", x, y, z, coarse, optimize=True)
        if self.logarithmic:
            return np.asarray(values * (after / before) * np.exp(change))
        return np.asarray(values + change)


@dataclass(frozen=True, eq=False)
class AlbedoLight:
    """Light of the bodies of one scattering medium at any albedo.

    Attributes
    ----------
    medium : Medium
    albedo : (3,) float64
        Its reduced albedo.
    extinction : (3,) float64
        Its reduced extinction in 1/m, which stays.
    surfaces : dict of int to tuple of AlbedoBlock
        For each object: of fluence, and of entering flux.
    ground : AlbedoBlock, optional
        Of light on the ground.
    reflectance : (STEPS,) float64
        Of a half-space, at even steps of sqrt(1 - albedo): the color of thick parts in white light.
    error : float
        Largest error of radiance at the surface at albedos between those solved for: root mean square over mean of a
        channel.
    """

    medium: Medium
    albedo: Array
    extinction: Array
    surfaces: Mapping[int, tuple[AlbedoBlock, ...]]
    ground: AlbedoBlock | None
    reflectance: Array
    error: float

    def entry(self, into: Container, first_layers: Mapping[int, int], ground_layer: int) -> dict[str, Any]:
        """Entry in a page's header, for layers of the texture; arrays go into the container."""
        blocks = [
            block.entry(into, first_layers[number] + i * block.size[2])
            for number, blocks in self.surfaces.items()
            for i, block in enumerate(blocks)
        ]
        ground = [] if self.ground is None else [self.ground.entry(into, ground_layer)]
        return {
            "albedo": self.albedo.tolist(),
            "extinction": self.extinction.tolist(),
            "anisotropy": self.medium.anisotropy,
            "least": SOLVED[0],
            "reflectance": self.reflectance.tolist(),
            "error": self.error,
            "solutions": len(SOLVED),
            "coarser": COARSER,
            "blocks": blocks + ground,
        }

    @classmethod
    @np.errstate(under="ignore")
    def of(cls, plan: RenderPlan) -> AlbedoLight:
        """Solve for the light of a plan whose scattering medium `fixed_albedo` says nothing against."""
        from translucent.diffusion.cache import FieldCache

        cache, albedo, medium = FieldCache(), *_albedo_of(plan)
        solutions = [cache.of(_plan_with(plan, np.full(3, one))) for one in SOLVED]
        grounds = [one.ground.values for one in solutions if one.ground is not None]
        ground = AlbedoBlock.of(_as_volume(np.stack(grounds)), logarithmic=False) if grounds else None
        surfaces = {
            number: tuple(
                AlbedoBlock.of(np.stack([_parts(one.surfaces[number])[i] for one in solutions]), logarithmic=True)
                for i in range(2)
            )
            for number in solutions[0].surfaces
        }
        base, error = cache.of(plan), 0.0
        for one in _tried():
            true, after = cache.of(_plan_with(plan, np.full(3, one))), np.full(3, one)
            for number, blocks in surfaces.items():
                points, normals = _surface_points(plan.scene.objects[number])
                cosine, own = np.ones(len(points)), base.surfaces[number]
                known = true.surfaces[number]
                parts = [block.changed(part, albedo, after) for block, part in zip(blocks, _parts(own), strict=True)]
                fluence, entering = (part.astype(np.float32) for part in parts)
                whole = np.ones_like(fluence)
                found = replace(known, fluence=fluence, entering=entering, cosine=own.cosine, scattered=whole)
                wanted = known.scattered_radiance(points, normals, -normals, cosine)
                off = found.scattered_radiance(points, normals, -normals, cosine) - wanted
                error = max(error, float((_rms(off) / np.maximum(wanted.mean(axis=0), _TINY)).max()))
        at = np.linspace(0.0, float(_variable(np.array(SOLVED[0]))), STEPS)
        few = at[:: (STEPS - 1) // 16]
        exact = [half_space_reflectance(float(1.0 - s * s), medium.ior) for s in few]
        reflectance = np.asarray(CubicSpline(few, exact)(at))
        extinction = np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
        return cls(medium, albedo, extinction, surfaces, ground, reflectance, error)


def fixed_albedo(plan: RenderPlan) -> str:
    """Reason for which a page cannot change the albedo of a plan's scattering media; empty if it can."""
    bodies = [item for item in plan.scene.objects if treatment_of(item) is Treatment.DIFFUSION]
    media = {scatterer_of(item) for item in bodies}
    if not bodies or plan.treated(Treatment.VOLUME) or any(item.density is not None for item in bodies):
        return "the medium has no interface or a varying density"
    if len(media) > 1:
        return "the scene has several scattering media"
    albedo, medium = _albedo_of(plan)
    if any(
        item.medium is not None and item not in bodies and scatterer_of(item) == medium for item in plan.scene.objects
    ):
        return "not all bodies of this medium use diffusion"
    if albedo.min() < SOLVED[0]:
        return "the medium hardly scatters one color channel"
    if medium.emits:
        return "the medium emits light"
    inside = [item for item in plan.scene.opaque if any(_contains(body.bounds, item.bounds) for body in bodies)]
    return "opaque objects are inside the medium" if inside else ""


def _contains(outer: Array, inner: Array) -> bool:
    return bool((outer[0] <= inner[0]).all() and (inner[1] <= outer[1]).all())


def _albedo_of(plan: RenderPlan) -> tuple[Array, Medium]:
    """Reduced albedo (3,) of the medium in which light diffuses, and the medium."""
    first = plan.scene.objects[plan.treated(Treatment.DIFFUSION)[0]]
    medium = scatterer_of(first)
    assert medium is not None
    reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    albedo: Array = reduced / np.maximum(reduced + np.asarray(medium.absorption), _TINY)
    return albedo, medium


def with_albedo(medium: Medium, albedo: Array) -> Medium:
    """Medium of a reduced albedo (3,), with the reduced extinction of another one."""
    ahead = 1.0 - medium.anisotropy
    total = np.asarray(medium.absorption) + np.asarray(medium.scattering) * ahead
    return replace(medium, absorption=(1.0 - albedo) * total, scattering=albedo * total / ahead)


def _plan_with(plan: RenderPlan, albedo: Array) -> RenderPlan:
    """The plan with another albedo of its scattering medium."""
    medium = with_albedo(_albedo_of(plan)[1], albedo)
    straight = Medium(medium.extinction, ior=medium.ior)

    def changed(item: Any) -> Any:
        if not isinstance(item, RenderedObject) or item.treatment is not Treatment.DIFFUSION:
            return item
        return treated(item, Treatment.DIFFUSION, straight, medium)

    return replace(plan, scene=replace(plan.scene, objects=[changed(item) for item in plan.scene.objects]))


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.square(values).mean(axis=0)))


def _variable(albedo: Array) -> Array:
    return np.sqrt(1.0 - albedo)


def _tried() -> Array:
    """Every second midpoint between neighboring solved albedos."""
    at = _variable(np.array(SOLVED))
    return np.asarray(1.0 - np.square(0.5 * (at[1:] + at[:-1])))[1::2]


def _between(steps: npt.NDArray[np.float32], albedo: Array) -> Array:
    """(3, rank): coefficients at albedos (3,), linear between steps."""
    at = _variable(albedo) / float(_variable(np.array(SOLVED[0]))) * (STEPS - 1)
    first = np.clip(np.floor(at).astype(int), 0, STEPS - 2)
    part = (at - first)[:, None]
    return np.asarray((1.0 - part) * steps[first] + part * steps[first + 1])


def _parts(field: DiffusionField) -> tuple[Array, Array]:
    """Values (6, x, y, z, 3) of the texture: fluence, and entering flux."""
    return field.fluence.astype(np.float64) / field.scattered, field.entering.astype(np.float64) / field.scattered


def _as_volume(values: Array) -> Array:
    """(n, 1, x, y, 1, 3): maps (n, y, x, 3)."""
    return np.asarray(values.transpose(0, 2, 1, 3)[:, None, :, :, None])


def _coarse(values: Array, read: npt.NDArray[np.bool_]) -> Array:
    """(s, x', y', z', 3): means of values (s, x, y, z, 3) over blocks of cells that are read; else of the nearest."""
    padding = [(0, -side % COARSER) for side in read.shape[1:]]
    weight = np.pad(read.astype(np.float64), [(0, 0), *padding])
    shape = [len(read)] + [part for side in weight.shape[1:] for part in (side // COARSER, COARSER)]
    count = weight.reshape(shape).sum(axis=(2, 4, 6))
    padded = np.pad(np.where(read[..., None], values, 0.0), [(0, 0), *padding, (0, 0)])
    mean = padded.reshape(*shape, 3).sum(axis=(2, 4, 6)) / np.maximum(count, 1.0)[..., None]
    for side in range(len(read)):
        if (count[side] > 0).any():
            nearest = distance_transform_edt(count[side] == 0, return_distances=False, return_indices=True)
            mean[side] = mean[side][tuple(nearest)]
    return np.asarray(mean)


def _linear(fine: int, few: int) -> Array:
    """(fine, few): weights of linear interpolation between coarse cells."""
    at = np.clip((np.arange(fine) + 0.5) / COARSER - 0.5, 0.0, few - 1.0)
    first = np.minimum(np.floor(at).astype(int), max(few - 2, 0))
    weights = np.zeros((fine, few))
    weights[np.arange(fine), first] = 1.0 - (at - first)
    weights[np.arange(fine), np.minimum(first + 1, few - 1)] += at - first
    return weights


def _surface_points(item: Any) -> tuple[Array, Array]:
    """Middles of faces (k, 3) of an object, and their normals outwards."""
    mesh = item.mesh
    faces = mesh.faces[:: max(1, len(mesh.faces) // _POINTS)]
    corners = mesh.vertices[faces] @ item.matrix[:3, :3].T + item.matrix[:3, 3]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= -1.0 if (np.linalg.det(item.matrix[:3, :3]) < 0) != mesh.diagnosis.inverted else 1.0
    length = np.linalg.norm(normals, axis=1)
    return corners.mean(axis=1)[length > 0], normals[length > 0] / length[length > 0, None]
