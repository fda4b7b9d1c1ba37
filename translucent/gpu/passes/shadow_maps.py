"""Shadow maps: signed depth from each light and from directions of the environment, up to opaque surfaces.

A ground has a map of the environment's shadows: a point looks up each direction once, and not for each sample.
"""

from __future__ import annotations

import contextlib
import itertools
import weakref
from collections.abc import Callable, Container, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from translucent.arrays import Array, Integers
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.layout import SHADOWS, SKY_SHADOWS
from translucent.gpu.light_cameras import ShadowOccluders, holds_eye, light_key, objects_key, support_of
from translucent.gpu.passes.depth_peeling import DepthPeelingPass
from translucent.gpu.passes.fragment_lists import FragmentListsPass
from translucent.gpu.passes.opaque import OpaquePass, shadow_switches
from translucent.gpu.passes.thickness import SignedDepthPass, ThinLayerPass
from translucent.gpu.passes.transmittance import TransmittancePass
from translucent.gpu.passes.variants import Variants
from translucent.gpu.placement import AxialRange, FaceCounts, Part, PlacedScene, depth_range
from translucent.gpu.resources import Resources
from translucent.gpu.shaders import before_making, set_uniform, set_used
from translucent.gpu.shadow_atlas import GroundShadows, SeenFrom, ShadowMapKey, ShadowView, ShadowViews
from translucent.gpu.targets import Targets, add_up
from translucent.gpu.uniforms import BodyRoles, bounded_extinction, media_center
from translucent.media.medium import Medium
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import MapPlan, RenderPlan
from translucent.planning.rendered import darkened, occluding_bodies
from translucent.scene.camera import Camera
from translucent.scene.grounds import Mirror, ground_from_above, lit_side
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Light, Scene
from translucent.scene.shadow_directions import shadow_directions

#: Most parts of the directions of the environment where one sample of a pixel may have to do.
_FEW_PARTS = 16

#: Largest ratio of distances from a light that a projected depth buffer resolves: its step at the far end is
#: 2^-24 far^2 / near, so at most 1e-6 of the distance.
_FARTHEST = 16.0

#: Sine of the angle below a ground up to which light may fall on it, by rounding.
_GRAZING = 1e-4

#: Passes whose sums are read where they were added up.
_IN_PLACE = (PassName.OPAQUE, PassName.SIGNED_DEPTH, PassName.THIN_LAYER, PassName.TRANSMITTANCE)

#: Most maps that are drawn at once: a window can stop in between.
_AT_ONCE = 16

#: Those of bodies without holes.
_SUMS = (PassName.OPAQUE, PassName.SIGNED_DEPTH, PassName.TRANSMITTANCE)

#: Passes that plans for scenes without interfaces and light have.
_STEPS: dict[PassName, type[SignedDepthPass | ThinLayerPass | FragmentListsPass | DepthPeelingPass]] = {
    PassName.SIGNED_DEPTH: SignedDepthPass,
    PassName.SIGNED_DEPTH_FALLBACK: SignedDepthPass,
    PassName.THIN_LAYER: ThinLayerPass,
    PassName.THIN_LAYER_FALLBACK: ThinLayerPass,
    PassName.FRAGMENT_LISTS: FragmentListsPass,
    PassName.DEPTH_PEELING: DepthPeelingPass,
}

#: Distance from its middle up to which a ground is not squeezed, in half diagonals of what stands on it.
REACH = 1.5

#: Largest side of a map, in texels. Half as wide as a light's map, its texels are as large as those of a direction's.
MOST_TEXELS = 2048

#: Least side of a map, in texels. In a picture of 64 x 64 pixels, a bear on a ground, twice as many texels a side take
#: a third of a second more, and change it by 0.14 of 255 (root mean square), and 3 at most.
LEAST_SIDE = 128

#: Pixels of the picture across a texel, where bodies are nearest to the eye: shadows of the environment are blurred. On
#: cow, goblet and cube texels half as wide change the picture by 0.05 of 255 (root mean square), and 2 at most.
PIXELS_OF_TEXEL = 8.0


class MapJob(FrameJob):
    """Maps of shadows: a frame from a light, drawn into the atlas; depths count from the center of the scene.

    Several are drawn at once where all of them look along parallel rays, and nothing opaque ends these.

    Parameters
    ----------
    gl, plan, targets, resources
    views : sequence of ShadowView
        The plan has the camera of the first.
    center : (3,) float64
        Of the media.
    """

    for_map = True

    def __init__(
        self,
        gl: moderngl.Context,
        plan: RenderPlan,
        targets: Targets,
        resources: Resources,
        views: Sequence[ShadowView],
        center: Array,
    ) -> None:
        self._views, scene = tuple(views), plan.scene
        view = self._view = self._views[0]
        self.corner = view.corner
        self.path_only, self.two_media = not resources.shadows.spectral, resources.shadows.two_media
        self.projected_depth = self.path_only and not self.two_media and view.ends and _resolves(scene)
        zero = float(scene.camera.forward @ (center - scene.camera.eye))
        placed = replace(PlacedScene.of(scene), media=AxialRange(zero, zero + 1.0))
        super().__init__(gl, plan, targets, resources, placed=placed, with_depth=self.projected_depth)
        if len(views) > 1:
            self.uniforms.place_before([view.camera for view in views], center)

    def draw(
        self, program: moderngl.Program, objects: tuple[int, ...], faces: Mapping[int, Integers] | None = None
    ) -> None:
        """Draw the objects into each of the maps."""
        for number, view in enumerate(self._views):
            if len(self._views) > 1:
                self._view = view
                self.accumulator()
                self.uniforms.choose(number)
            super().draw(program, objects, faces)

    def roles_of(self, counts: FaceCounts) -> BodyRoles:
        """Roles of the objects, with the slots of two media."""
        roles = super().roles_of(counts)
        return replace(roles, slots=np.array(_slots(self.features.scene)[0])) if self.two_media else roles

    def at_place(self, framebuffer: moderngl.Framebuffer) -> moderngl.Framebuffer:
        """The framebuffer of the atlas, with the viewport on the part that this map takes."""
        framebuffer.viewport = (*self._view.corner, self._view.size, self._view.size)
        return framebuffer

    def accumulator(self, name: str = "accumulated") -> moderngl.Framebuffer:
        """Target in which thickness passes add up."""
        shadows = self.resources.shadows
        return self.at_place(shadows.tested if self.projected_depth else shadows.sums)

    def bind_opaque(self, unit: int) -> None:
        """Bind the depths at which opaque objects end rays of the light, if there are any, to texture `unit`."""
        if self.features.has_opaque:
            self.resources.shadows.ends.color_attachments[0].use(unit)


class ShadowMapsPass:
    """Transmittance to the first opaque surface on each ray of each light; see ``shaders/shade/shadows.glsl``.

    Each map is a frame of its own, which the light sees: its scene has no interfaces and only absorbs, and the passes
    of the plan for that scene find the paths through its media.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._opaque = OpaquePass(gl)
        self._resolve = TransmittancePass(gl)
        self._made: dict[PassName, Callable[[FrameJob, PassSpec], None]] = {}
        self._targets: dict[int, Targets] = {}
        self._placed: tuple[object, ShadowViews] | None = None
        #: What the first of the lights see, where frames that follow find the rest.
        self._looked_at: tuple[object, list[SeenFrom]] = None, []
        self._plans: dict[Hashable, RenderPlan] = {}
        self._ground = GroundShadowsPass(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Render the missing shadow maps of the frame, and write the uniforms.

        For a window they may take several frames; what is there stays until objects or lights change.
        """
        job.resources.photons_carry = bool(job.plan.opaque_to_shadows)
        atlas, scene, count = job.resources.shadows, job.scene, job.scene.environment_shadows
        # Of several samples of a pixel, each looks into its part of the directions.
        first, step = job.sample % job.samples, job.samples
        if job.bending:  # few of them may represent all
            step = min(step, _FEW_PARTS)
            first %= step
        most = job.plan.shadows.directions
        if few := most is not None and most * step < count:
            step = -(-count // most)
            first %= step
        map_key = _map_key(job)
        if atlas.held is None or not atlas.held.fits(map_key, path_only=not atlas.spectral):
            atlas.held = None
        if few and (atlas.held is None or atlas.held.step == step):
            map_key, first, step, few = replace(map_key, step=step), 0, 1, False  # no more than these
        elif atlas.held is not None and atlas.held.step > 1:
            atlas.held = None
        ground = _mapped_ground(job)
        looked_at = (first, step) if few or ground is None else (0, 1)
        if atlas.held is None or not atlas.drawn.issuperset(_read(job, atlas.views, *looked_at)):
            self._render(job, map_key, *looked_at)
        assert atlas.views is not None
        center = media_center(scene)
        media = _slots(scene)[1] if atlas.two_media else [occluding_bodies(scene)[0].medium]
        extinctions = np.array([bounded_extinction(medium, scene.diagonal) for medium in media])
        rotation = first, -step if few or job.bending else step
        if job.averaged:
            rotation = 0, max(len(atlas.views.sky), 1)  # no picture is read of what is drawn now
        job.uniforms.add(SHADOWS, atlas.views.light_uniforms(center, rotation, extinctions))
        assert atlas.held is not None
        irradiance = shadow_directions(scene.environment, count)[1][:: atlas.held.step] if count else np.zeros((0, 3))
        job.uniforms.add(SKY_SHADOWS, atlas.views.sky_uniforms(center, irradiance))
        job.uniforms.bind()
        atlas.ground = None
        if ground is not None:
            made_of = map_key, extinctions.tobytes()
            directions = range(looked_at[0], len(atlas.views.sky), looked_at[1])
            atlas.ground = self._ground.run(job, ground, irradiance, directions, made_of)

    def _render(self, job: FrameJob, map_key: ShadowMapKey, first: int, step: int) -> None:
        """Render the maps of lights, and of every so-many-th direction of the environment."""
        scene, atlas = job.scene, job.resources.shadows
        dark, lit = darkened(scene, job.plan.opaque_to_shadows), job.plan.maps[0]
        opaque = tuple(i for i, item in enumerate(scene.objects) if item.medium is None)
        key, everything = self._planned(lit, dark, opaque)
        # Sums can be added up in place; others, and what depends on whether they balance, are copied.
        in_place = all(one.name in _IN_PLACE for one in everything.passes)
        if atlas.held is None:
            views = self._views(job, map_key, opaque, in_place=in_place)
            spectral = everything.spectral or not in_place or dark is not scene
            two = spectral and dark is scene and not job.resources.media_change and _has_two_media(everything)
            atlas.make(views, spectral=spectral and not two, two_media=two)
            atlas.held = map_key
        assert atlas.views is not None
        center = media_center(scene)
        used = {key}
        missing = [view for view in _read(job, atlas.views, first, step) if view not in atlas.drawn]
        # One after the other, or some at once where only bodies are drawn, in one view as in another.
        at_once = _AT_ONCE if {one.name for one in everything.passes}.issubset(_SUMS) else 1
        for portion in _portions(missing, set(atlas.views.sky), at_once):
            view = portion[0]
            if job.plan.shadows.directions is None:
                before_making(self._gl)
            if view.size not in self._targets:
                self._targets[view.size] = Targets(self._gl, (view.size, view.size))
            # Where no opaque object blocks light, none has to be drawn; photons are those of lights alone.
            clear = dark is scene or view in atlas.views.sky
            key, plan = self._planned(*((job.plan.maps[-1], scene) if clear else (lit, dark)), view.opaque)
            used.add(key)
            plan = replace(plan, scene=replace(plan.scene, camera=view.camera))
            before = plan if dark is scene else replace(plan, spectral=True), self._targets[view.size], job.resources
            try:
                if in_place:
                    self._add_up(MapJob(self._gl, *before, portion, center))
                else:
                    self._copy(FrameJob(self._gl, *before), view, center)
            except BaseException:
                atlas.held = None  # half of a map looks like a whole one
                raise
            atlas.drawn.update(portion)
        for key in self._plans.keys() - used:
            del self._plans[key]
        for size in self._targets.keys() - {view.size for view in atlas.views}:
            self._targets.pop(size).release()
        job.uniforms.bind()

    def _views(self, job: FrameJob, map_key: ShadowMapKey, opaque: tuple[int, ...], *, in_place: bool) -> ShadowViews:
        """Places of all maps; where they are stays the same when only media change."""
        key = map_key.places, map_key.step, in_place
        if self._placed is None or self._placed[0] != key:
            if self._looked_at[0] != key:
                self._looked_at = key, []
            scene, found = job.scene, self._looked_at[1]
            supports = [support_of(item) for item in scene.objects]
            for light in [*scene.lights, *_sky_lights(scene)[:: map_key.step]][len(found) :]:
                if job.plan.shadows.directions is None:
                    before_making(self._gl)
                occluders = ShadowOccluders(light, scene, supports)
                found.append((occluders.cameras(), occluders.blocking if in_place else opaque, occluders.middle))
            limit, count = int(self._gl.info["GL_MAX_TEXTURE_SIZE"]), len(scene.lights)
            self._placed = key, ShadowViews.of(found[:count], found[count:], job.plan.shadows.size, limit)
            self._looked_at = None, []
        return self._placed[1]

    def _planned(self, maps: MapPlan, scene: Scene, opaque: tuple[int, ...]) -> tuple[Hashable, RenderPlan]:
        """Plan of a map that ends at these opaque objects alone, with a key of it."""
        # Lights move more often than objects change.
        key = tuple(map(weakref.ref, scene.objects)), scene.overlap, maps, opaque
        if key not in self._plans:
            self._plans[key] = maps.of(scene, opaque)
        return key, self._plans[key]

    def _add_up(self, light: MapJob) -> None:
        """Draw one shadow map into its place in the atlas."""
        with contextlib.ExitStack() as stack:
            stack.callback(light.release)
            for step in light.plan.passes:
                if step.name is PassName.OPAQUE:
                    ends = light.at_place(light.resources.shadows.ends)
                    self._opaque.draw_depth(light, step.objects, ends, projected=light.projected_depth)
                elif step.name is not PassName.TRANSMITTANCE:
                    self._step(step.name)(light, step)

    def _copy(self, light: FrameJob, view: ShadowView, center: Array) -> None:
        """Draw one map of shadows as a frame of its own, and copy it into the atlas."""
        with contextlib.ExitStack() as stack:
            stack.callback(light.release)
            for step in light.plan.passes:
                if step.name is PassName.OPAQUE:
                    ends = light.targets.opaque_ends()
                    ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)
                    self._opaque.draw_depth(light, step.objects, ends)
                elif step.name is not PassName.TRANSMITTANCE:
                    self._step(step.name)(light, step)
            camera, media = light.scene.camera, light.placed.media
            ahead = media.near + float(camera.forward @ (camera.eye - center))
            self._resolve.run_map(light, light.resources.shadows.both, view.corner, (ahead, media.length))

    def _step(self, name: PassName) -> Callable[[FrameJob, PassSpec], None]:
        if name not in self._made:
            self._made[name] = _STEPS[name](self._gl).run
        return self._made[name]


def _mapped_ground(job: FrameJob) -> Mirror | None:
    """Ground with a map of the environment's shadows, made once for all samples; None without such a map."""
    few = job.bending and job.plan.shadows.directions is not None
    if few or not job.scene.environment_shadows or not job.plan.has(PassName.OPAQUE):
        return None
    return ground_from_above(job.scene)


def _read(job: FrameJob, views: ShadowViews | None, first: int, step: int) -> list[ShadowView]:
    """Shadow maps that a frame needs: of lights, and of directions whose light may reach visible surfaces."""
    if views is None:
        return []
    side = None if job.any_eye or job.features.shadows_backdrop else lit_side(job.scene)
    sky = [view for view in views.sky[first::step] if side is None or view.camera.forward @ side < _GRAZING]
    return [*itertools.chain(*views.lights), *sky]


def _portions(views: Iterable[ShadowView], sky: Container[ShadowView], most: int) -> Iterator[list[ShadowView]]:
    """Views in portions that are drawn at once: each alone, or some of the sky in which nothing opaque is."""
    for alone, group in itertools.groupby(views, lambda view: view.ends or view not in sky):
        some, count = list(group), 1 if alone else most
        yield from (some[i : i + count] for i in range(0, len(some), count))


def _resolves(scene: Scene) -> bool:
    """True if a depth buffer of 24 bits resolves the scene, and clips nothing that is before the camera."""
    if scene.camera.fov_y is None:
        return True
    near, far = depth_range(scene.boxes, scene.camera, scene.diagonal)
    return far <= _FARTHEST * near


def _slots(scene: Scene) -> tuple[tuple[int, ...], list[Medium | None]]:
    """Slots of all objects by the extinction of occluders, -1 of others and of clear ones; and the
    medium of each slot, two at least.
    """
    throwing, found = set(map(id, occluding_bodies(scene))), dict[bytes, Medium | None]()
    slots = []
    for item in scene.objects:
        extinction = None if item.medium is None or id(item) not in throwing else np.asarray(item.medium.extinction)
        if extinction is None or not extinction.any():
            slots.append(-1)
        else:
            found.setdefault(extinction.tobytes(), item.medium)
            slots.append(list(found).index(extinction.tobytes()))
    return tuple(slots), [*found.values(), None, None][: max(len(found), 2)]


def _has_two_media(plan: RenderPlan) -> bool:
    """True if light goes through two media and no more."""
    names = {step.name for step in plan.passes}
    return PassName.SIGNED_DEPTH in names and names.issubset(_SUMS) and len(_slots(plan.scene)[1]) == 2


def _sky_lights(scene: Scene) -> list[Light]:
    """Lights from the directions of the environment that throw shadows."""
    if not scene.environment_shadows:
        return []
    towards, _ = shadow_directions(scene.environment, scene.environment_shadows)
    return [DirectionalLight(-direction, 1.0) for direction in towards]


def _map_key(job: FrameJob) -> ShadowMapKey:
    """Cache key of shadow maps; keeps nothing alive."""
    scene = job.scene
    inside = tuple(item.medium is None and holds_eye(item, scene) for item in scene.objects)
    media = tuple(
        None if item.medium is None else np.asarray(item.medium.extinction).tobytes() for item in scene.objects
    )
    lights = tuple(light_key(light) for light in scene.lights)
    sky = scene.environment_shadows and shadow_directions(scene.environment, scene.environment_shadows)[0].tobytes()
    sheets = job.plan.method if job.plan.method.makes_sheets else None
    places = objects_key(scene), inside, lights, sky, sheets, job.plan.shadows.size, job.plan.opaque_to_shadows
    return ShadowMapKey(places, media, _slots(scene)[0])


class GroundShadowsPass:
    """Fraction of the environment's light that bodies take from a ground; see ``shaders/shade/ground_shadows.frag``.

    The map stays until what it is made of changes. A window has another one of few directions, while things move.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        samplers = "shadow_sums", "shadow_ends"
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/ground_shadows.frag", *samplers)
        self._targets: dict[bool, moderngl.Framebuffer] = {}  # of few directions, of all
        self._made_of: dict[bool, Hashable] = {}

    def run(
        self, job: FrameJob, ground: Mirror, irradiance: Array, directions: Iterable[int], made_of: Hashable
    ) -> GroundShadows:
        """The map of a ground, by some of the directions whose maps the job's atlas has.

        Parameters
        ----------
        job : FrameJob
            Its uniforms are bound.
        ground : Mirror
        irradiance : (k, 3) float64
            From each direction, on a surface that faces it.
        directions : iterable of int
            Those that represent all.
        made_of : hashable
            Equal for frames whose atlases are equal.
        """
        scene, views = job.scene, job.resources.shadows.views
        assert views is not None
        center, bounds = media_center(scene), _bounds(scene, ground)
        middle, axes = _frame(bounds, ground)
        ahead = {i: views.sky[i].camera.forward for i in directions}
        cosines = {i: -float(ground.normal @ forward) for i, forward in ahead.items()}
        lit = [i for i, cosine in cosines.items() if cosine > 0.0]
        side, few = _side(job, bounds, axes), job.plan.shadows.directions is not None
        target = self._sized(side, few)
        key = made_of, irradiance.tobytes(), tuple(lit), middle.tobytes(), axes.tobytes()
        if key != self._made_of.get(few) or job.any_eye:  # each recording has the map, which media change
            self._made_of[few] = None
            job.resources.shadows.use(self._variants.units)
            program = self._variants.program(**shadow_switches(True, job.resources))
            values = {
                "ground_middle": middle - center,
                "ground_x": axes[0],
                "ground_y": axes[1],
                "ground_normal": ground.normal,
                "box_low": bounds[0] - center,
                "box_high": bounds[1] - center,
                "all_light": np.array([cosines[i] for i in lit]) @ irradiance[lit],
            }
            set_used(program, {name: tuple(value.tolist()) for name, value in values.items()})
            set_uniform(program, "ground_texels", side)
            target.clear()
            add_up(self._gl)
            all_radii = dict(zip(ahead, _cell_radii(np.array(list(ahead.values()))).tolist(), strict=True))
            radii = np.array([all_radii[i] for i in lit])
            parts = _footprints([views.sky[i].camera for i in lit], radii, ground, bounds, axes, side) if lit else []
            for order, (i, part) in enumerate(zip(lit, parts, strict=True)):
                set_used(program, {"number": i, "order": order, "cell_radius": float(radii[order])})
                self._variants.draw_part(part, program, target)
            self._made_of[few] = key
        rows = [(*row, float(row @ (center - middle))) for row in axes / np.square(axes).sum(axis=1, keepdims=True)]
        plane = *ground.normal.tolist(), ground.height - float(ground.normal @ center)
        return GroundShadows(scene.objects.index(ground.ground), target.color_attachments[0], tuple(rows), plane)

    def _sized(self, side: int, few: bool) -> moderngl.Framebuffer:
        """Framebuffer of a map, so many texels wide."""
        held = self._targets.get(few)
        if held is None or held.size != (side, side):
            if held is not None:
                held.color_attachments[0].release()
                held.release()
            texture = self._gl.texture((side, side), 4, dtype="f4")
            texture.filter = moderngl.LINEAR, moderngl.LINEAR
            texture.repeat_x = texture.repeat_y = False
            held = self._targets[few] = self._gl.framebuffer([texture])
            self._made_of[few] = None
        return held


def _bounds(scene: Scene, ground: Mirror) -> Array:
    """(2, 3): bounds of all objects but the ground."""
    boxes = np.stack([item.bounds for item in scene.objects if item is not ground.ground])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _cell_radii(directions: Array) -> Array:
    """(n,): radii of discs as large as the cells of unit vectors (n, 3), in radians, as of a hexagonal grid."""
    cosines = directions @ directions.T
    np.fill_diagonal(cosines, -1.0)
    apart = np.arccos(np.clip(cosines.max(axis=1), -1.0, 1.0))
    return np.asarray(np.minimum(np.sqrt(np.sqrt(0.75) / np.pi) * apart, 0.5))


def _frame(bounds: Array, ground: Mirror) -> tuple[Array, Array]:
    """Middle (3,) of the map on the ground, and two vectors (2, 3) along it, as long as where squeezing begins."""
    low, high = bounds
    middle, size = 0.5 * (low + high), REACH * 0.5 * float(np.linalg.norm(high - low)) or 1.0
    first = np.cross(ground.normal, np.eye(3)[int(np.abs(ground.normal).argmin())])
    first /= np.linalg.norm(first)
    axes = size * np.stack([first, np.cross(ground.normal, first)])
    return middle + (ground.height - middle @ ground.normal) * ground.normal, axes


def _side(job: FrameJob, bounds: Array, axes: Array) -> int:
    """Side of the map in texels: a power of two, or the largest."""
    most = min(job.plan.shadows.size // 2, MOST_TEXELS)
    if job.plan.shadows.directions is not None or job.any_eye:  # of a window, whose pictures change their size
        return most
    camera, size = job.scene.camera, job.targets.size
    away = float(np.linalg.norm(np.maximum(np.maximum(bounds[0] - camera.eye, camera.eye - bounds[1]), 0.0)))
    width = 4.0 * float(np.linalg.norm(axes[0]))  # of the map, were it not squeezed
    pixel = 2.0 * camera.half_extent(size)[1] / size[1] * (away if camera.fov_y is not None else 1.0)
    texels = width / max(PIXELS_OF_TEXEL * pixel, width / most)
    return min(1 << round(float(np.log2(max(texels, LEAST_SIDE)))), most)


def _footprints(
    cameras: Sequence[Camera], radii: Array, ground: Mirror, bounds: Array, axes: Array, side: int
) -> list[Part]:
    """Texels of the ground map in the shadow of objects from each direction (k), with cells of these radii (k,)."""
    middle, _ = _frame(bounds, ground)
    half = np.array([camera.half_extent((1, 1)) for camera in cameras])  # (k, 2)
    pose = np.stack([camera.pose for camera in cameras])
    across, forward, eye = pose[:, :3, :2].swapaxes(1, 2), -pose[:, :3, 2], pose[:, :3, 3]
    corners = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)])
    blur = np.zeros(len(cameras))
    for _ in range(2):  # the second time with what shadows are blurred by where they are longest
        points = eye[:, None] + corners @ ((half + blur[:, None])[..., None] * across)  # (k, 4, 3)
        ahead = (ground.height - points @ ground.normal) / (forward @ ground.normal)[:, None]
        points = points + ahead[..., None] * forward[:, None]
        longest = np.einsum("kcj,kj->kc", points - bounds.mean(axis=0), forward).max(axis=1)
        blur = radii * np.maximum(longest, 0.0)
    at = (points - middle) @ axes.T / np.square(axes).sum(axis=1)
    size = np.abs(at)
    place = np.where(size > 1.0, np.sign(at) * (1.0 - 0.5 / np.maximum(size, 1.0)), 0.5 * at)
    low, high = (0.5 + 0.5 * place.min(axis=1)) * side - 1.0, (0.5 + 0.5 * place.max(axis=1)) * side + 1.0
    edges = np.concatenate([np.clip(np.floor(low), 0, side), np.clip(np.ceil(high), 0, side)], axis=1)
    return [Part(*row) for row in edges.astype(int).tolist()]
