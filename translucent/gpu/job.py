"""State of a frame that is being rendered: its scene and plan, and the common data of its passes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.gpu.diffusion import DiffusedTexture, density_uniforms, ground_uniforms, scene_grids
from translucent.gpu.features import FrameFeatures
from translucent.gpu.layout import (
    BODY,
    BODY_STRIDE,
    DENSITY,
    ENVIRONMENT,
    LIGHTS,
    MEDIA,
    SCATTER,
    SHADE,
    SURFACES,
    VIEW,
    UniformBlock,
)
from translucent.gpu.light_cameras import media_sphere
from translucent.gpu.placement import (
    Balance,
    FaceCounts,
    FaceExtents,
    Part,
    PlacedScene,
    SampleView,
    depth_range,
    extents,
    face_counts,
    part_of,
)
from translucent.gpu.resources import Resources
from translucent.gpu.targets import Targets, add_up
from translucent.gpu.uniforms import (
    BodyRoles,
    Fields,
    LightLookup,
    body_records,
    clip_rows,
    environment_uniforms,
    light_uniforms,
    media_center,
    media_uniforms,
    object_rows,
    packed_objects,
    scatter_uniforms,
    shade_uniforms,
    surface_uniforms,
    turned_records,
    view_uniforms,
)
from translucent.planning.passes import PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.scene.backdrop import Backdrop
from translucent.scene.camera import Camera, Window
from translucent.scene.grounds import Mirror, mirror_of

#: Samples with photons, in frames of so many samples at least: drawing what they land on takes a fifth of a sample's
#: time. Of the Sobol points the second four lie in the four quarters of a pixel, and their mean in its middle.
ROUNDS, ROUNDS_FROM = range(4, 8), 8

#: Faces of an object from which on it takes longer to draw all than to choose those over some pixels.
MANY_FACES = 1 << 12


@dataclass(frozen=True, eq=False)
class TextureBackdrop:
    """Backdrop in textures of the same context, so that nothing is read back; it is visible everywhere.

    Parameters
    ----------
    color : moderngl.Texture
        RGB that is linear to the power of 1 / `gamma`. Row 0 is the bottom row, as OpenGL draws.
    depth : moderngl.Texture
        What the depth test compared, 0 to 1, at pixel centers; 1 where nothing was drawn.
    near, far : float
        Metres along the camera's forward axis where depth is 0 and 1; `far` may be ``inf`` for a perspective camera.
    orthographic : bool
        The depth is that of an orthographic camera: linear in metres.
    gamma : float
        1 for linear colors.
    ambient : (float, float, float), optional
        Linear radiance that lit the picture evenly from all around, as `Backdrop.ambient`.
    """

    color: moderngl.Texture
    depth: moderngl.Texture
    near: float
    far: float
    orthographic: bool
    gamma: float
    ambient: tuple[float, float, float] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        width, height = self.color.size
        return width, height


class UniformBuffers:
    """The buffers of all uniform blocks that programs read when they draw a scene as one camera sees it.

    Parameters
    ----------
    gl : moderngl.Context
    placed : PlacedScene
    roles : BodyRoles
        Of the objects of the scene.
    contents : mapping of UniformBlock to bytes
        Of the blocks that are alike for all samples of a picture.
    """

    def __init__(
        self,
        gl: moderngl.Context,
        placed: PlacedScene,
        roles: BodyRoles,
        contents: Mapping[UniformBlock, bytes],
    ) -> None:
        self._gl = gl
        self._placed = placed
        self._view = gl.buffer(reserve=VIEW.dtype.itemsize)
        records = body_records(placed, roles, media_center(placed.scene))
        self._content = np.zeros((len(records), BODY_STRIDE), np.uint8)
        self._records = self._content[:, : BODY.dtype.itemsize].view(BODY.dtype)[:, 0]
        self._records[:] = records
        self.bodies = gl.buffer(reserve=self._content.nbytes)
        self._first = 0
        self._constant = {block: gl.buffer(content) for block, content in contents.items()}

    def place(self, view: SampleView) -> None:
        """Write and bind the uniforms for some sample points."""
        self._records["clip_from_offset"] = clip_rows(self._placed, view)
        self.bodies.write(self._content)
        self._view.write(view_uniforms(view, self._placed))
        self.bind()

    def place_before(self, cameras: Sequence[Camera], center: Array) -> None:
        """Write the uniforms of bodies before each of these cameras, by `turned_records`; `choose` chooses one."""
        content = np.zeros((len(cameras), *self._content.shape), np.uint8)
        records = content[..., : BODY.dtype.itemsize].view(BODY.dtype)[..., 0]
        records[:] = turned_records(self._records, self._placed, cameras, center)
        self.bodies.release()
        self.bodies = self._gl.buffer(content)

    def choose(self, camera: int) -> None:
        """Choose one of the cameras of `place_before`, by its number."""
        self._first = camera * len(self._records)

    def add(self, block: UniformBlock, content: bytes) -> None:
        """Add a block that is the same for all samples; `bind` binds it."""
        if block in self._constant:
            self._constant[block].release()
        self._constant[block] = self._gl.buffer(content)

    def bind(self) -> None:
        """Bind these uniforms again after others were bound."""
        self._view.bind_to_uniform_block(VIEW.binding)
        for block, buffer in self._constant.items():
            buffer.bind_to_uniform_block(block.binding)

    def bind_body(self, number: int) -> None:
        """Bind the uniforms of one object for the next draw."""
        offset = (self._first + number) * BODY_STRIDE
        self.bodies.bind_to_uniform_block(BODY.binding, offset=offset, size=BODY.dtype.itemsize)

    def release(self) -> None:
        """Free the buffers."""
        for buffer in (self._view, self.bodies, *self._constant.values()):
            buffer.release()


class CameraView:
    """Bodies before a camera, with their uniforms, and targets of the size of a picture.

    Parameters
    ----------
    placed : PlacedScene
    roles : BodyRoles
        Of the objects of the scene.
    contents : mapping of UniformBlock to bytes
        Of blocks that are alike for all samples.
    targets, resources
    """

    def __init__(
        self,
        gl: moderngl.Context,
        placed: PlacedScene,
        roles: BodyRoles,
        contents: Mapping[UniformBlock, bytes],
        targets: Targets,
        resources: Resources,
    ) -> None:
        self.gl = gl
        self.scene = placed.scene
        self.placed = placed
        self.roles = roles
        self.targets = targets
        self.resources = resources
        self.uniforms = UniformBuffers(gl, placed, roles, contents)

    def draw(
        self, program: moderngl.Program, objects: tuple[int, ...], faces: Mapping[int, Integers] | None = None
    ) -> None:
        """Draw objects with the current state; front faces are those where a ray enters.

        Of objects whose numbers `faces` has, only these faces (k,).
        """
        for i in objects:
            body = self.scene.objects[i]
            self.uniforms.bind_body(i)
            self.gl.front_face = "cw" if body.faces_inwards else "ccw"
            if faces is None or i not in faces:
                self.resources.meshes[body.mesh].vertex_array(program, body.mesh).render()
            else:
                self.resources.meshes[body.mesh].draw_faces(program, body.mesh, faces[i])
        self.gl.front_face = "ccw"


class FrameJob(CameraView):
    """Input of a pass: the features of the frame, its bodies placed before the camera, its targets.

    Parameters
    ----------
    gl, plan, targets, resources
    backdrop : Backdrop or TextureBackdrop, optional
        What a plan with the pass of that name needs.
    placed : PlacedScene, optional
        The scene before its camera, where axial depths are to count from elsewhere than from where media begin.
    with_depth : bool
        Projections give depth.
    compact : bool
        The targets hold what `gpu.reading` reads: they need not hold what follows from the rest.

    Attributes
    ----------
    features : FrameFeatures
    compact : bool
        `Targets.compact` takes the place of `Targets.result`, which not all plans allow.
    media_apart : (objects,) int, optional
        As `FrameFeatures.media_apart`, where each of these media has an accumulator; only of what is compact.
    view : SampleView
        Sample points that the scene is placed for.
    averaging : bool
        The samples of the frame are being summed up.
    sample, samples : int
        Number of the sample that is drawn, from 0, and how many are summed up; 0 of 1 at the pixel centers.
    paths_traced : int
        Random paths of each pixel that have ended so far.
    averaged : bool
        The averages have all samples: what is drawn now belongs to the pixel centers, but no picture is read of it.
    photon_light : tuple, optional
        Light of photons on opaque objects: a texture of the pixels of a larger picture, the number of them to each
        pixel of the frame along a side, and which of those these are, right and down.
    pixel_middle : (float, float)
        Middle of what a pixel is to show, right and down from its center: of a frame that shows one of several pixels
        of a larger picture.
    report : callable
        Takes the fraction of the frame's samples, or random paths, that is done, now and then.
    corner : (int, int)
        Left and bottom of the picture in its targets.
    for_map : bool
        The frame is a map of shadows.
    path_only : bool
        The accumulator has paths of one medium alone, and counts of paths that an opaque surface ends at most.
    two_media : bool
        It has the paths in two media instead, which are the slots 0 and 1 of bodies.
    bent_apart : bool
        Rays are traced from interfaces apart from what else a sample shows.
    bending : bool
        Of a sample, that alone is drawn now.
    unsettled : dict of str to (n,) uint32
        Of a job that is bending: pixels that need more samples, by the name of their target.
    enlarged : list of (float, float), optional
        Upper left corners (right, down) of pixels whose parts are drawn, each as a block of pixels.
    faces : dict of int to (k,) int
        By number of the object: faces that are drawn of its interface, where it is not all of them.
    few_opaque : bool
        Opaque objects are shaded in a few samples, before all others, which show the mean of these.
    uneven : Part, optional
        Pixels in which the rest of these samples are shaded, rows up; the light of others is there.
    holds_opaque : bool
        That mean is there.
    shows_ground_alone : bool
        Wherever no medium covers the picture it shows that mean, in all samples. What is covered is the same for these.
    rest_is_clear : bool
        Of such a job: the targets of interfaces show none beyond what is covered.
    has_blurs : bool
        That mean has its blurred levels.
    any_eye : bool
        What is drawn is to fit all cameras.
    projected_depth : bool
        The accumulator has a depth buffer of opaque surfaces, against which passes can test.
    covered : Part
        Pixels that media may cover at the current sample points: beyond it no ray crosses a medium. Rows count up from
        the bottom, as geometry is drawn.
    """

    corner: tuple[int, int] = (0, 0)
    for_map = path_only = two_media = projected_depth = bent_apart = bending = any_eye = False
    few_opaque = holds_opaque = has_blurs = shows_ground_alone = rest_is_clear = False
    uneven: Part | None = None
    enlarged: list[tuple[float, float]] | None = None
    photon_light: tuple[moderngl.Texture, int, tuple[int, int]] | None = None
    pixel_middle = (0.0, 0.0)

    def __init__(
        self,
        gl: moderngl.Context,
        plan: RenderPlan,
        targets: Targets,
        resources: Resources,
        backdrop: Backdrop | TextureBackdrop | None = None,
        placed: PlacedScene | None = None,
        *,
        with_depth: bool = False,
        compact: bool = False,
    ) -> None:
        self.started = time.perf_counter()
        self.plan, scene = plan, plan.scene
        self.backdrop = backdrop
        self.averaging = False
        self.sample, self.samples = 0, 1
        self.paths_traced = 0
        self.averaged = False
        self.unsettled: dict[str, npt.NDArray[np.uint32]] = {}
        self.report: Callable[[float], None] = lambda fraction: None
        self.features = FrameFeatures(plan)
        self.compact = compact and self.features.can_be_compact
        self.media_apart = self.features.media_apart if self.compact else None
        placed = placed or PlacedScene.of(scene)
        counts = face_counts(scene, int(gl.info["GL_SUBPIXEL_BITS"]))
        light = resources.diffusion.of(plan)
        ground = ground_uniforms(light, media_center(scene))
        contents = _contents(self.features, placed, Balance.of(placed, plan.method, counts), targets.size, ground)
        if self.features.varies:
            contents[DENSITY] = density_uniforms(scene, self.features.slots, media_sphere(scene)[0], light)
        super().__init__(gl, placed, self.roles_of(counts), contents, targets, resources)
        self._cleared: set[str] = set()
        self._lit = False
        self._packed: tuple[tuple[Fields, ...] | None, npt.NDArray[np.float32]] | None = None
        self.faces: dict[int, Integers] = {}
        self._extents = extents(scene.boxes, scene.radii, scene.camera, targets.size)
        self._in_view = frozenset(np.flatnonzero(self._extents[:, 2] > self._extents[:, 0]).tolist())
        if self.features.marches and not self.features.scatters:
            self.light(LightLookup(media_sphere(scene)[0], (), np.zeros((0, 4)), np.zeros((0, 4))))
        self.place((0.0, 0.0), with_depth=with_depth)

    def roles_of(self, counts: FaceCounts) -> BodyRoles:
        """Roles of the objects."""
        return BodyRoles.of(self.features, counts)

    @cached_property
    def diffused_light(self) -> DiffusedTexture | None:
        """Light that diffuses in bodies; None where it does not."""
        return self.resources.diffusion.of(self.plan)

    @cached_property
    def mirror(self) -> Mirror | None:
        """Ground that mirrors the bodies."""
        return mirror_of(self.scene) if self.features.has_opaque else None

    @property
    def diffused_rows(self) -> dict[int, dict[str, npt.ArrayLike]]:
        """Fields of the objects in which light diffuses, for the table of objects."""
        light = self.diffused_light
        return {} if light is None else light.rows(media_center(self.scene))

    @cached_property
    def object_rows(self) -> tuple[Fields, ...]:
        """Media and surfaces of all objects, the same for all samples."""
        return object_rows(self.scene, self.features.sheets, self.diffused_rows)

    def object_table(self, placements: tuple[Fields, ...] | None = None) -> moderngl.Texture:
        """Table of the objects, with their placements where rays are traced; the caller releases it."""
        if self._packed is None or self._packed[0] is not placements:  # else as for the last sample of the frame
            self._packed = placements, packed_objects(self.object_rows, placements)
        table = self._packed[1]
        return self.gl.texture(table.shape[1::-1], 4, table, dtype="f4")

    @property
    def opaque_samples(self) -> int:
        """Number of samples in which opaque objects are shaded."""
        return len(ROUNDS) if self.few_opaque else self.samples

    def place(self, shift: tuple[float, float], *, with_depth: bool = False) -> None:
        """Write the uniforms for samples that are `shift` (right, down) pixels off the pixel centers."""
        scene = self.scene
        depths = depth_range(scene.boxes, scene.camera, scene.diagonal) if with_depth else None
        self.view = SampleView(scene.camera, self.targets.size, shift, depths, self.corner)
        self.uniforms.place(self.view)
        if not self.shows_ground_alone:
            self.covered = part_of(self._extents[scene.filled], shift, self.targets.size)
        self._cleared.clear()

    def enlarge(self, column: int, row: int, place: tuple[float, float], block: Part) -> None:
        """Write the uniforms for a pixel that is drawn as a square block of pixels, rows down.

        The block has its upper left corner at this place (right, down) in the picture.
        """
        camera, size, parts = self.scene.camera, self.targets.size, block.right - block.left
        window = camera.window or Window(0, 0, size)
        left, top = parts * (window.left + place[0]) - block.left, parts * (window.top + place[1]) - block.bottom
        self.choose_faces(np.array([row << 15 | column], np.uint32))
        enlarged = Window(left, top, (parts * window.whole[0], parts * window.whole[1]))
        self.uniforms.place(SampleView(replace(camera, window=enlarged), size))

    def draw(
        self, program: moderngl.Program, objects: tuple[int, ...], faces: Mapping[int, Integers] | None = None
    ) -> None:
        """Draw the objects that are in view, with the current state."""
        super().draw(program, tuple(i for i in objects if i in self._in_view), faces)

    def choose_faces(self, pixels: npt.NDArray[np.uint32] | None) -> None:
        """Draw interfaces from now on where they may cover these pixels (n,), as `pixel_words` has them; None: all."""
        self.faces = {}
        if pixels is not None:
            columns, rows = pixels & np.uint32(0x7FFF), pixels >> np.uint32(15)
            self.faces = {i: found.over(columns, rows) for i, found in self._face_extents.items()}

    @cached_property
    def _face_extents(self) -> dict[int, FaceExtents]:
        """Extents of the faces of the objects with many of them."""
        camera, objects = self.scene.camera, self.scene.objects
        many = (i for i in sorted(self._in_view) if len(objects[i].mesh.faces) >= MANY_FACES)
        return {i: FaceExtents.of(objects[i], camera, self.targets.size) for i in many}

    def light(self, lights: LightLookup) -> None:
        """Write the uniforms of the lights that media scatter; they are the same for all samples."""
        if not self._lit:
            points = self.plan.method.light_points
            content = scatter_uniforms(self.placed, self.targets.size, lights, points, self.features.stopping_slots)
            self.uniforms.add(SCATTER, content)
            self._lit = True

    def release(self) -> None:
        """Free the uniform buffers; targets and resources are the renderer's."""
        self.uniforms.release()

    @property
    def picture(self) -> moderngl.Framebuffer:
        """Framebuffer whose first attachment is the frame's radiance."""
        apart = self.features.has_surfaces or self.features.path_traced
        if apart:
            return self.targets["surfaced"]
        return self.compact_result if self.compact else self.targets["result"]

    @property
    def compact_result(self) -> moderngl.Framebuffer:
        """Target of the compact result, with optical depth only if it is not proportional to thickness."""
        return self.targets.compact(with_depth=self.plan.spectral)

    def sums_after(self, name: str) -> bool:
        """True if the pass of this name adds a sample to the averages, in place of showing it."""
        return self.averaging and name == self.features.last_pass

    def accumulator(self, name: str = "accumulated") -> moderngl.Framebuffer:
        """Target in which thickness passes add up, cleared when a frame first needs it."""
        return self._cleared_once(name, self.targets.path_and_count(self.plan.spectral, name))

    @property
    def accumulators_apart(self) -> tuple[moderngl.Framebuffer, ...]:
        """Targets of `media_apart`, cleared as the accumulator is."""
        assert self.media_apart is not None
        names = [f"medium-{number}" for number in range(int(self.media_apart.max()) + 1)]
        return tuple(self._cleared_once(name, self.targets.path_and_count(False, name)) for name in names)

    def _cleared_once(self, name: str, framebuffer: moderngl.Framebuffer) -> moderngl.Framebuffer:
        if name not in self._cleared:
            framebuffer.clear()
            self._cleared.add(name)
        return framebuffer

    def begin_adding(self, target: str) -> None:
        """Set the state in which every face adds to an accumulator."""
        self._add_to(self.accumulator(target))

    def adding(self, spec: PassSpec) -> Iterator[tuple[int, ...]]:
        """Objects of a pass in groups, by the accumulator to which their faces then add."""
        if self.media_apart is None:
            self.begin_adding(spec.target)
            yield spec.objects
            return
        for number, framebuffer in enumerate(self.accumulators_apart):
            self._add_to(framebuffer)
            yield tuple(i for i in spec.objects if self.media_apart[i] == number)

    def _add_to(self, framebuffer: moderngl.Framebuffer) -> None:
        # No depth test and no culling: all faces count, and order cannot matter to a sum.
        framebuffer.use()
        add_up(self.gl)

    def clear_layers(self) -> None:
        """Set the counts of layers to 0, as they stay beyond `covered`, where nothing else of `ordered` is read."""
        self.targets["ordered"]
        self.targets.view("ordered", 2).clear()

    def bind_opaque(self, unit: int) -> None:
        """Bind the axial depths where rays end for the shader that reads texture `unit`, if there are any."""
        if self.features.has_opaque:
            self.targets["opaque"].color_attachments[0].use(unit)

    def bind_grids(self, unit: int, light_unit: int) -> None:
        """Bind density grids, and grids of light scattered before, for the shader that reads these textures, if any."""
        if self.features.varies:
            self.resources.grids.use(unit, scene_grids(self.scene, self.features.slots))
        if self.features.scatters_again and self.diffused_light is not None:
            self.diffused_light.texture.use(light_unit)


def _contents(
    features: FrameFeatures,
    placed: PlacedScene,
    balance: Balance,
    size: tuple[int, int],
    ground: dict[str, npt.ArrayLike],
) -> dict[UniformBlock, bytes]:
    """Contents of the uniform blocks that are the same for all samples of a frame."""
    scene = placed.scene
    shine = features.has_opaque or features.has_surfaces or features.has_layers or features.path_traced
    contents = {
        SHADE: shade_uniforms(scene, balance),
        MEDIA: media_uniforms(placed, features.slots),
        LIGHTS: light_uniforms(scene, shine, ground),
        ENVIRONMENT: environment_uniforms(scene.environment),
    }
    if features.has_surfaces or features.path_traced or features.has_caustics or features.shadows_backdrop:
        contents[SURFACES] = surface_uniforms(placed, size)
    return contents
