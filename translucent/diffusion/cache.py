"""Cache of the multiply scattered light of scenes: solved again only where lights, a medium or a mesh change."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock

import numpy as np

from translucent.arrays import Array, Integers
from translucent.diffusion.entering import (
    Occluders,
    bounding_ball,
    opaque_surfaces,
    radiance_without_suns,
    suns_of,
)
from translucent.diffusion.environment_ahead import behind_body
from translucent.diffusion.exchange import BodyHits, GroundMap, GroundPoints, OpaqueSurfaces
from translucent.diffusion.field import DiffusingBody, DiffusionField, EnclosedBody, lit_by_each_other
from translucent.diffusion.irradiance_maps import EnclosedPaths, IrradianceMap, emitted_irradiance, irradiance_maps
from translucent.diffusion.keys import (
    bending_key,
    coefficients_of,
    diffusing_media,
    diffusion_key,
    kept,
    media_lit_by_photons,
    opaque_key,
    photons_on_opaque,
    place_of,
    roughness_of,
)
from translucent.diffusion.lit_body import (
    BodyShape,
    LitBody,
    body_shape,
    inclusion_colors,
    inclusions_of,
    may_light,
    own_frame,
)
from translucent.diffusion.photons import EnteringPhotons, FineCells, photons_in_media
from translucent.diffusion.solution import BodySystem
from translucent.diffusion.volume import DiffusingVolume, PhotonFluence, VolumeField, VolumeGrid
from translucent.geometry.ray_caster import RayCaster
from translucent.media.medium import Medium
from translucent.planning.bodies import enclosed_bodies
from translucent.planning.caustics import Caustics, opaque_to_shadows
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import Treatment, treatment_of
from translucent.planning.scattering import Diffusion
from translucent.scene.grounds import ground_below
from translucent.scene.scene import Object, Scene
from translucent.threads import one_blas_thread

#: Bodies, and lit scenes, that are kept.
KEPT_BODIES, KEPT_SCENES = 16, 6


@dataclass(frozen=True, eq=False)
class Fields:
    """Multiply scattered light of the bodies of a scene, by the number of the object.

    Attributes
    ----------
    surfaces : dict of int to DiffusionField
    volumes : dict of int to VolumeField
    ground : GroundMap, optional
        Light that the bodies with surfaces send to a ground.
    maps : dict of int to IrradianceMap
        Light on opaque objects that interfaces and opaque objects send there.
    """

    surfaces: dict[int, DiffusionField]
    volumes: dict[int, VolumeField]
    ground: GroundMap | None = None
    maps: dict[int, IrradianceMap] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """True if there is any."""
        return bool(self.surfaces or self.volumes or self.maps or self.ground)

    def on_opaque(self, points: Array, normals: Array, sky: Array) -> Array:
        """(k, 3): irradiance at points (k, 3) of opaque objects by all but the straight light of lights.

        `sky` (k, 3) is that of the environment, as far as nothing blocks it.
        """
        found = sky if self.ground is None else np.maximum(sky + self.ground.irradiance(points, normals), 0.0)
        for own in self.maps.values():
            found = np.where(own.holds(points)[:, None], own.at(points, normals), found)
        return found


NO_FIELDS = Fields({}, {})


class FieldCache:
    """Cache of `Fields` by plan, and of the geometry and linear systems behind them. Threads may share it.

    Parameters
    ----------
    warm_starts : bool
        Solutions start from those of earlier scenes: quicker, and no longer the same whatever these were, within the
        tolerance of the solver.
    """

    def __init__(self, *, warm_starts: bool = False) -> None:
        self._warm_starts = warm_starts
        self._lock = Lock()
        self._opaque: OrderedDict[Hashable, OpaqueSurfaces | None] = OrderedDict()
        self._bodies: OrderedDict[Hashable, LitBody] = OrderedDict()
        self._paths: OrderedDict[Hashable, EnclosedPaths] = OrderedDict()
        self._shapes: OrderedDict[Hashable, BodyShape] = OrderedDict()
        self._systems: OrderedDict[Hashable, BodySystem] = OrderedDict()
        self._grids: OrderedDict[Hashable, VolumeGrid] = OrderedDict()
        self._volumes: OrderedDict[Hashable, DiffusingVolume] = OrderedDict()
        self._scenes: OrderedDict[Hashable, Fields] = OrderedDict()

    def of(self, plan: RenderPlan) -> Fields:
        """Multiply scattered light of a plan; the same object until something changes it.

        With caustics, photons carry what interfaces of other bodies bend into them.
        """
        if not plan.solves:
            return NO_FIELDS
        scene, diffusion, key = plan.scene, plan.diffusion, diffusion_key(plan)
        if (known := self._scenes.get(key)) is not None:
            return known  # nobody waits for other light that a thread looks for
        without = self.of(replace(plan, exchanging=())) if plan.exchanging else None

        def make() -> Fields:
            if without is not None:
                return replace(without, maps=irradiance_maps(scene, plan.exchanging, photons_on_opaque(plan)))
            places = tuple(opaque_key(item) for item in scene.opaque)
            opaque = kept(self._opaque, places, lambda: opaque_surfaces(scene.opaque), 1)
            media, bent = diffusing_media(scene), self._bent(plan)
            solid = [i for i in media if treatment_of(scene.objects[i]) is Treatment.DIFFUSION]
            bodies, others = self._bodies_of(scene, {i: media[i] for i in solid}, places, opaque, diffusion)
            alone = {i: own.solved(scene, i, bent.entering.get(i), bent.stops.get(i)) for i, own in bodies.items()}
            surfaces = {
                i: replace(
                    bodies[i].field_of(found),
                    behind=behind_body(scene.environment, media[i], scene.objects[i].mean_thickness),
                )
                for i, found in lit_by_each_other(bodies, others, alone).items()
            }
            volumes = {
                i: self._volume(scene.objects[i], medium, diffusion).field(scene, bent.volumes.get(i))
                for i, medium in media.items()
                if i not in bodies
            }
            ground = ground_map(scene, {i: own.lit for i, own in bodies.items()}, surfaces, plan.glowing)
            return Fields(surfaces, volumes, ground)

        with self._lock, one_blas_thread():
            return kept(self._scenes, key, make, KEPT_SCENES)

    def keep(self, plan: RenderPlan, fields: Fields) -> None:
        """Store the light of a plan, found by another solver, and that without maps, for quicker pictures."""
        with self._lock:
            kept(self._scenes, diffusion_key(plan), lambda: fields, KEPT_SCENES)
            if plan.exchanging:
                without = replace(fields, maps={})
                kept(self._scenes, diffusion_key(replace(plan, exchanging=())), lambda: without, KEPT_SCENES)

    def has(self, key: Hashable) -> bool:
        """True if the light of this `diffusion_key` is known."""
        return key in self._scenes

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            for store in (
                self._opaque,
                self._bodies,
                self._paths,
                self._shapes,
                self._systems,
                self._grids,
                self._volumes,
                self._scenes,
            ):
                store.clear()

    def _bodies_of(
        self,
        scene: Scene,
        media: Mapping[int, Medium],
        places: Hashable,
        opaque: OpaqueSurfaces | None,
        diffusion: Diffusion,
    ) -> tuple[dict[int, DiffusingBody], dict[int, tuple[int, ...]]]:
        """Bodies with surfaces, by number, and for each the numbers of the bodies that light it."""
        objects, inside = scene.objects, () if opaque is None else opaque.objects
        inner = {i: inclusions_of(objects[i], inside) for i in media}
        alone = {i: LitBody(self._shape(objects[i], inner[i], diffusion), Occluders(objects[i], opaque)) for i in media}
        others = {i: tuple(k for k in alone if k != i and may_light(alone[k], alone[i])) for i in alone}
        bodies, enclosed = {}, enclosed_bodies(scene)
        for i, medium in media.items():
            around = tuple((place_of(objects[k]), alone[k].shape) for k in others[i])
            key = place_of(objects[i]), alone[i].shape, places, around
            make = partial(replace, alone[i], others=tuple(alone[k] for k in others[i]))
            lit = kept(self._bodies, key, make, KEPT_BODIES)
            paths = None
            if i in enclosed:
                # The light of all others that paths come to is of their samples in this order.
                others[i] = tuple(k for k in alone if k != i)
                shapes = tuple(one.shape for one in alone.values())
                follow = partial(EnclosedPaths, scene, i, alone)
                paths = kept(self._paths, (i, shapes, places, bending_key(scene)), follow, KEPT_BODIES)
            bodies[i] = self._body(lit, medium, inclusion_colors(lit.grid, inner[i]), diffusion, paths)
        return bodies, others

    def _shape(self, body: Object, inner: tuple[Object, ...], diffusion: Diffusion) -> BodyShape:
        own = own_frame(body)
        step = diffusion.cell_size(own)
        key = place_of(own), body.density, step, tuple(place_of(item) for item in inner)
        return kept(self._shapes, key, lambda: body_shape(own, step, inner), KEPT_BODIES)

    def _body(
        self, lit: LitBody, medium: Medium, colors: Array, diffusion: Diffusion, paths: EnclosedPaths | None
    ) -> DiffusingBody:
        shape, roughness = lit.shape, roughness_of(lit.casters.body)
        outside = None if paths is None else paths.outside

        def make() -> BodySystem:
            return BodySystem(
                shape.grid,
                medium,
                roughness,
                shape.densities,
                walls=shape.walls,
                colors=colors,
                corrected=diffusion.corrected,
                warm_starts=self._warm_starts,
                outside=outside,
            )

        around = b"" if outside is None else outside.tobytes()
        system = kept(self._systems, (shape, medium, roughness, colors.tobytes(), around), make, KEPT_BODIES)
        if paths is not None:
            return EnclosedBody(paths, lit, medium, roughness, system)
        return DiffusingBody(lit, medium, roughness, system)

    def _volume(self, body: Object, medium: Medium, diffusion: Diffusion) -> DiffusingVolume:
        grid, key = self._grid(body, diffusion), (_density_place(body, diffusion), coefficients_of(medium))

        def make() -> DiffusingVolume:
            return DiffusingVolume(grid, medium, warm_starts=self._warm_starts)

        return kept(self._volumes, key, make, KEPT_BODIES)

    def _grid(self, body: Object, diffusion: Diffusion) -> VolumeGrid:
        place = _density_place(body, diffusion)
        return kept(self._grids, place, lambda: VolumeGrid(body, diffusion.cell_size(body)), KEPT_BODIES)

    def _bent(self, plan: RenderPlan) -> _Bent:
        """Light that photons carry into bodies."""
        scene, caustics = plan.scene, plan.caustics
        enclosed = [] if plan.caustics is not None else list(enclosed_bodies(scene))
        if enclosed and (lights := (*scene.lights, *suns_of(scene.environment))):
            found = photons_in_media(replace(scene, lights=lights), Caustics(0), {}, enclosed)
            around = opaque_surfaces([scene.objects[k] for k in sorted(opaque_to_shadows(scene) - {*enclosed})])
            return _Bent({}, found.entering, dict.fromkeys(enclosed, None if around is None else around.caster))
        if caustics is None or not (lit := media_lit_by_photons(scene)):
            return _Bent({}, {}, {})
        fogs = [i for i in lit if treatment_of(scene.objects[i]) is Treatment.VOLUME]
        grids = {i: self._grid(scene.objects[i], plan.diffusion).grid for i in fogs}
        cells = {i: FineCells.of(own.cells.low, own.cells.step, own.number.shape) for i, own in grids.items()}
        found = photons_in_media(scene, caustics, cells, [i for i in lit if i not in fogs])
        bending = opaque_to_shadows(scene)
        bent = {i: opaque_surfaces([scene.objects[k] for k in sorted(bending - {i})]) for i in lit}
        stops = {i: None if surfaces is None else surfaces.caster for i, surfaces in bent.items()}
        return _Bent({i: PhotonFluence(cells[i], found.fluence[i], stops[i]) for i in fogs}, found.entering, stops)


@dataclass(frozen=True, eq=False)
class _Bent:
    """Light of photons in bodies without an interface, in other bodies, and occluders of the straight light of each."""

    volumes: dict[int, PhotonFluence]
    entering: dict[int, EnteringPhotons]
    stops: dict[int, RayCaster | None]


def ground_map(
    scene: Scene, lit: Mapping[int, LitBody], surfaces: Mapping[int, DiffusionField], glowing: Sequence[int] = ()
) -> GroundMap | None:
    """Light that bodies, by their numbers, send to the ground below them; None without one.

    The media of `glowing` bodies emit it, in others it has diffused. Unless maps of the environment's shadows do it,
    the environment's light that these keep from it is subtracted. They and opaque objects hide each other.
    """
    sources = sorted({*lit, *glowing})
    if not sources or (ground := ground_below(scene, sources)) is None:
        return None
    low, high = scene.boxes[sources].transpose(1, 0, 2)
    points = GroundPoints(ground, scene.objects.index(ground.ground), np.stack([low.min(axis=0), high.max(axis=0)]))
    total = emitted_irradiance(scene, glowing, points) if glowing else np.zeros(points.points.shape)
    for i, body in lit.items():
        others = [other.nearest for other in lit.values() if other is not body]
        if body.casters.opaque is not None and (len(scene.opaque) > 1 or ground.has_walls):
            others.append(lambda *rays, caster=body.casters.opaque.caster: caster.nearest(*rays)[::-1])

        def nearest(
            origins: Array, directions: Array, body: LitBody = body, others: Sequence[BodyHits] = others
        ) -> tuple[Array, Integers]:
            distance, sample = body.nearest(origins, directions)
            for other in others:
                hit = np.flatnonzero(np.isfinite(distance))
                hidden = other(origins[hit], directions[hit])[0] < distance[hit]
                distance[hit[hidden]] = np.inf
            return distance, sample

        def light(sample: Integers, directions: Array, leaving: Array = surfaces[i].leaving) -> Array:
            sent = leaving[sample] / np.pi
            return sent if scene.environment_shadows else sent - radiance_without_suns(scene.environment, directions)

        total += points.irradiance(bounding_ball(scene.objects[i]), nearest, light)
    return points.map(total)


def _density_place(body: Object, diffusion: Diffusion) -> Hashable:
    return place_of(body), body.density, diffusion.cell_size(body)
