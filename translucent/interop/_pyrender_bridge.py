"""Scenes of pyrender and of the toolkit, converted in both directions, and opaque objects drawn by pyrender.

It draws in the context of a renderer, or in one of its own. Import this module by `load_pyrender` only.
"""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
import OpenGL.platform
import pyrender
from OpenGL import GL
from OpenGL.error import Error as OpenGLError
from pyrender.constants import MAX_N_LIGHTS

from translucent.arrays import Array
from translucent.errors import InputError, RenderError
from translucent.geometry.mesh import Mesh, mended
from translucent.gpu.context import GpuContext
from translucent.gpu.job import TextureBackdrop
from translucent.gpu.placement import depth_range
from translucent.media.medium import Medium
from translucent.scene.backdrop import Backdrop
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light, Object, Overlap, Scene

#: pyrender encodes the radiance that it finds as a power, and cuts it off at 1 (its shaders/mesh.frag).
GAMMA = 2.2


@dataclass(frozen=True)
class Clipping:
    """Depth range of a pyrender camera: from `near` to `far` metres along its forward axis."""

    near: float
    far: float
    orthographic: bool

    @classmethod
    def of(cls, scene: Any) -> Clipping:
        """Depth range of the scene's camera."""
        camera = scene.main_camera_node.camera
        far = math.inf if camera.zfar is None else camera.zfar
        return cls(camera.znear, far, isinstance(camera, pyrender.OrthographicCamera))

    def metres(self, depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Distance ahead in metres from window depth, 0 to 1; ``inf`` at 1. The twin of ``shade/backdrop.frag``."""
        fraction = depth.astype(np.float64)
        nothing = fraction >= 1.0
        fraction[nothing] = 0.0
        if self.orthographic:
            metres = self.near * (1.0 - fraction) + self.far * fraction
        elif math.isinf(self.far):
            metres = self.near / (1.0 - fraction)
        else:
            metres = self.near * self.far / (self.far * (1.0 - fraction) + self.near * fraction)
        metres[nothing] = math.inf
        return np.asarray(metres)


def ambient_of(scene: Any) -> tuple[float, float, float]:
    """Radiance of the light from all around with which pyrender draws a scene."""
    red, green, blue = map(float, scene.ambient_light[:3])
    return red, green, blue


@dataclass(frozen=True, eq=False)
class PyrenderPicture:
    """Picture drawn by pyrender, and its ambient light; row 0 at the top.

    Attributes
    ----------
    colors : (h, w, 4) uint8
        Encoded.
    depth : (h, w) float64
        In metres.
    ambient : tuple of 3 floats
        Radiance of the light from all around.
    """

    colors: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float64]
    ambient: tuple[float, float, float]

    def backdrop(self) -> Backdrop:
        """Picture of the opaque objects over its background."""
        return Backdrop((self.colors[..., :3] / 255.0) ** GAMMA, self.depth, ambient=self.ambient)

    def before(self, environment: Environment, camera: Camera) -> Backdrop:
        """The picture before an environment, where it was drawn on a background without opacity."""
        height, width = self.depth.shape
        opacity = self.colors[..., 3:] / 255.0
        # At an edge the mean of the samples has the background in it, which is black.
        encoded = self.colors[..., :3] / 255.0 / np.where(opacity > 0.0, opacity, 1.0)
        positions = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1) / height
        behind = environment.radiance(camera.rays((width, height))[1], positions)
        radiance = opacity * encoded**GAMMA + (1.0 - opacity) * behind
        return Backdrop(radiance, self.depth, coverage=opacity[..., 0] > 0.0, ambient=self.ambient)


#: A camera whose optical center is off the middle by less than this, in pixels, looks through it.
_CENTERED = 1e-6

#: Meshes that have been converted, with the arrays that they are made of, as long as those of pyrender live.
_converted: WeakKeyDictionary[Any, tuple[list[Any], list[tuple[Mesh, Array]]]] = WeakKeyDictionary()


def translucent_nodes(scene: Any, names: Collection[str]) -> list[tuple[Any, str]]:
    """Visible mesh nodes that have one of these names, or whose meshes do, with that name; in a fixed order."""
    if not isinstance(scene, pyrender.Scene):
        raise InputError(
            f"pyrender scene {scene!r}", f"of type {type(scene).__name__}", "give an object of type pyrender.Scene"
        )
    nodes = sorted((node for node in scene.mesh_nodes if node.mesh.is_visible), key=_order)
    known = {name for node in nodes for name in (node.name, node.mesh.name) if name is not None}
    if unknown := sorted(set(names) - known):
        listed = ", ".join(map(repr, sorted(known))) or "no names: use scene.add(mesh, name=...)"
        raise InputError(
            f"media for {', '.join(map(repr, unknown))}",
            f"no visible node or mesh of the pyrender scene has this name; the scene has {listed}",
            "use one of these names",
        )
    chosen = []
    for node in nodes:
        if (name := next((name for name in (node.name, node.mesh.name) if name in names), None)) is not None:
            chosen.append((node, name))
    return chosen


def _order(node: Any) -> tuple[str, str, list[float]]:
    return node.name or "", node.mesh.name or "", node.matrix.ravel().tolist()


def converted(scene: Any, media: Mapping[str, Medium], size: tuple[int, int], overlap: Overlap) -> Scene:
    """See `translucent.interop.pyrender.scene_from_pyrender`."""
    objects = []
    for node, name in translucent_nodes(scene, media):
        for mesh, pose in _meshes(node, node.mesh.name or name):
            objects.append(Object(mesh, media[name], scene.get_pose(node) @ pose))
    if not objects:
        raise InputError(
            "rendering a pyrender scene", "no medium is given for any node", "give media={'name': tl.Medium(...)}"
        )
    background = Environment.constant(np.asarray(scene.bg_color[:3], dtype=np.float64) ** GAMMA)
    return Scene(objects, camera_of(scene, size), _lights(scene), background, overlap)


def _meshes(node: Any, name: str) -> list[tuple[Mesh, Array]]:
    """Meshes of a node, welded and wound, with their poses in it; several if there are instances."""
    arrays = [array for p in node.mesh.primitives for array in (p.positions, p.indices, p.poses)]
    known = _converted.get(node.mesh)
    if known is None or len(known[0]) != len(arrays) or any(a is not b for a, b in zip(known[0], arrays, strict=True)):
        placed = [(mended(raw), pose) for raw, pose in _raw_meshes(node.mesh, name)]
        known = _converted[node.mesh] = arrays, placed
    return known[1]


def _raw_meshes(mesh: Any, name: str) -> Iterator[tuple[Mesh, Array]]:
    parts = [(p, *_triangles(p, name)) for p in mesh.primitives]
    instanced = [part for part in parts if part[0].poses is not None]
    for primitive, vertices, faces in instanced:
        raw = Mesh(vertices, faces, name=name)
        for pose in primitive.poses:
            yield raw, np.asarray(pose, dtype=np.float64)
    # What is not instanced may bound a body only together.
    if single := [part for part in parts if part[0].poses is None]:
        starts = np.cumsum([0] + [len(vertices) for _, vertices, _ in single], dtype=np.int32)
        faces = np.concatenate([faces + start for (_, _, faces), start in zip(single, starts, strict=False)])
        yield Mesh(np.concatenate([vertices for _, vertices, _ in single]), faces, name=name), np.eye(4)


def _triangles(primitive: Any, name: str) -> tuple[Array, npt.NDArray[np.int32]]:
    if primitive.mode != pyrender.GLTF.TRIANGLES:
        raise InputError(
            f"the medium of {name!r}", f"the mesh has a primitive of mode {primitive.mode}", "use a mesh of triangles"
        )
    vertices = np.asarray(primitive.positions, dtype=np.float64)
    corners = np.arange(len(vertices)) if primitive.indices is None else np.asarray(primitive.indices)
    return vertices, corners.reshape(-1, 3).astype(np.int32)


def camera_of(scene: Any, size: tuple[int, int]) -> Camera:
    """The camera that a pyrender scene is drawn with, if the toolkit has such cameras."""
    node = scene.main_camera_node
    if node is None:
        raise InputError(
            "rendering a pyrender scene", "the scene has no camera", "add a camera: scene.add(camera, pose=...)"
        )
    camera, pose = node.camera, scene.get_pose(node)
    if isinstance(camera, pyrender.OrthographicCamera):
        # pyrender takes the width from the picture, whatever xmag says.
        return Camera(pose, fov_y=None, height=2.0 * camera.ymag)
    if isinstance(camera, pyrender.IntrinsicsCamera):
        off = (camera.cx - size[0] / 2, camera.cy - size[1] / 2)
        if max(map(abs, off)) > _CENTERED or not math.isclose(camera.fx, camera.fy, rel_tol=1e-9):
            raise InputError(
                "camera of the pyrender scene",
                (
                    f"the intrinsics fx {camera.fx:g}, fy {camera.fy:g}, cx {camera.cx:g}, cy {camera.cy:g} "
                    f"do not describe square pixels and a view through the middle of {size[0]}x{size[1]} "
                    "pixels"
                ),
                (
                    "render at the picture size for which the intrinsics were made, with fx = fy, or use a "
                    "PerspectiveCamera"
                ),
            )
        return Camera(pose, fov_y=math.degrees(2.0 * math.atan(size[1] / (2.0 * camera.fy))))
    if camera.aspectRatio is not None and not math.isclose(camera.aspectRatio, size[0] / size[1], rel_tol=1e-6):
        raise InputError(
            "camera of the pyrender scene",
            f"aspectRatio {camera.aspectRatio:g} would stretch a picture of {size[0]}x{size[1]} pixels",
            "omit aspectRatio: pyrender then uses the aspect ratio of the picture",
        )
    return Camera(pose, fov_y=math.degrees(camera.yfov))


def _lights(scene: Any) -> list[Light]:
    found: list[Light] = []
    for node in sorted(scene.light_nodes, key=lambda node: (node.name or "", node.matrix.ravel().tolist())):
        light, pose = node.light, scene.get_pose(node)
        if np.linalg.matrix_rank(pose[:3, :3]) < 3:
            raise InputError(
                f"light {light.name or node.name or 'without a name'!r} of the pyrender scene",
                "the transform of the light's node is singular: it, or a node above, has a scale of 0",
                "use a scale other than 0 along every axis",
            )
        power = light.intensity * np.asarray(light.color, dtype=np.float64)
        if isinstance(light, pyrender.PointLight):
            found.append(PointLight(pose[:3, 3], power))
        elif isinstance(light, pyrender.SpotLight):
            outer = min(math.degrees(light.outerConeAngle), 90.0)
            # Equal cones are an edge, there.
            inner = min(math.degrees(light.innerConeAngle), math.nextafter(outer, 0.0))
            found.append(SpotLight(pose[:3, 3], -pose[:3, 2], power, inner, outer))
        else:
            found.append(DirectionalLight(-pose[:3, 2], power))
    return found


def written(scene: Scene, near: float | None = None) -> Any:
    """See `translucent.interop.pyrender.to_pyrender`; `near` is that of the camera, if something closer is known."""
    environment = scene.environment
    part = pyrender.Scene(bg_color=np.zeros(4), ambient_light=environment.mean)
    for item in scene.opaque:
        part.add(pyrender.Mesh([_primitive(item, scene.camera)], name=item.mesh.name))
    _add_lights(part, scene)
    _add(part, _camera(scene, near), _turned(scene.camera.pose[:3, :3]))
    return part


def _primitive(item: Object, camera: Camera) -> Any:
    """Flat faces whose normals look at the camera, as all faces reflect alike on both sides; offsets from the eye."""
    vertices = item.mesh.vertices @ item.matrix[:3, :3].T + (item.matrix[:3, 3] - camera.eye)
    corners = vertices[item.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    view = camera.forward if camera.fov_y is None else corners[:, 0]
    away = np.sum(normals * view, axis=1) > 0
    normals[away] = -normals[away]
    return pyrender.Primitive(
        corners.reshape(-1, 3),
        np.repeat(normals, 3, axis=0),
        material=pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[*item.base_color, 1.0], metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True
        ),
    )


def _add_lights(part: Any, scene: Scene) -> None:
    for kind in {type(light) for light in scene.lights}:
        if (count := sum(isinstance(light, kind) for light in scene.lights)) > MAX_N_LIGHTS:
            raise InputError(
                "drawing with pyrender",
                f"the scene has {count} lights of type {kind.__name__}",
                f"use at most {MAX_N_LIGHTS} lights of each type",
            )
    for light in scene.lights:
        pose = np.eye(4)
        if isinstance(light, SpotLight | DirectionalLight):
            backward = -np.asarray(light.direction)
            right = np.cross(np.eye(3)[np.argmin(np.abs(backward))], backward)
            right /= np.linalg.norm(right)
            pose = _turned(np.column_stack([right, np.cross(backward, right), backward]))
        if not isinstance(light, DirectionalLight):
            pose[:3, 3] = np.asarray(light.position) - scene.camera.eye
        _add(part, _light(light), pose)


def _light(light: Light) -> Any:
    if isinstance(light, DirectionalLight):
        return pyrender.DirectionalLight(color=np.asarray(light.irradiance), intensity=1.0)
    color = np.asarray(light.intensity)
    if isinstance(light, SpotLight):
        cones = np.radians((light.inner_cone, light.outer_cone))
        return pyrender.SpotLight(color, intensity=1.0, innerConeAngle=cones[0], outerConeAngle=cones[1])
    return pyrender.PointLight(color=color, intensity=1.0)


def _camera(scene: Scene, near: float | None) -> Any:
    camera = scene.camera
    closest, far = depth_range(scene.boxes[~scene.filled], camera, scene.diagonal)
    if camera.fov_y is None:
        # What is behind an orthographic picture is not visible, and what is ahead has the same precision everywhere.
        far = max(far, scene.diagonal)
        return pyrender.OrthographicCamera(1.0, 0.5 * (camera.height or 1.0), znear=1e-6 * far, zfar=far)
    return pyrender.PerspectiveCamera(np.radians(camera.fov_y), znear=near or closest, zfar=far)


def _turned(rotation: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = rotation
    return pose


def _add(part: Any, item: Any, pose: Array) -> None:
    part.set_pose(part.add(item), pose)  # as it is; nodes that are made with a matrix take it apart


def opaque_part(scene: Any, hidden: Collection[Any]) -> Any:
    """Copy of a scene in which the nodes in `hidden` are invisible; shadow maps still make room for them.

    pyrender marks what it draws as bound to the context where it does so, and refuses it elsewhere. The scene that was
    given may be drawn by another renderer of pyrender, so this one gets twins of all that would be marked.
    """
    part = pyrender.Scene(bg_color=scene.bg_color, ambient_light=scene.ambient_light)
    meshes: dict[tuple[Any, bool], Any] = {}
    textures: dict[Any, Any] = {}
    for node in scene.nodes:
        mesh = light = None
        if node.mesh is not None:
            key = node.mesh, node.mesh.is_visible and node not in hidden
            if key not in meshes:
                meshes[key] = _unbound_mesh(*key, textures)
            mesh = meshes[key]
        if node.light is not None:
            light = copy.copy(node.light)
            light._shadow_texture = None
        twin = pyrender.Node(mesh=mesh, light=light, camera=node.camera)
        part.add_node(twin)
        part.set_pose(twin, scene.get_pose(node))
        if node is scene.main_camera_node:
            part.main_camera_node = twin
    return part


def _unbound_mesh(mesh: Any, visible: bool, textures: dict[Any, Any]) -> Any:
    primitives = []
    for primitive in mesh.primitives:
        twin = copy.copy(primitive)
        twin._vaid, twin._buffers = None, []
        twin.material = copy.copy(primitive.material)
        for name, value in vars(primitive.material).items():
            if isinstance(value, pyrender.Texture):
                if value not in textures:
                    textures[value] = copy.copy(value)
                    textures[value]._texid = None
                setattr(twin.material, name, textures[value])
        primitives.append(twin)
    return pyrender.Mesh(primitives, is_visible=visible)


Flags = pyrender.RenderFlags

#: Flags that change which fragments there are.
_SHAPE_FLAGS = Flags.SKIP_CULL_FACES | Flags.ALL_WIREFRAME | Flags.FLIP_WIREFRAME | Flags.ALL_SOLID
#: All flags that make a picture, without shadows of point lights, which pyrender lacks.
PICTURE_FLAGS = _SHAPE_FLAGS | Flags.SHADOWS_DIRECTIONAL | Flags.SHADOWS_SPOT


class OpaqueRenderer(pyrender.Renderer):  # type: ignore[misc]
    """Renderer of pyrender, with depth at the pixel centers.

    Colors are the mean of four samples, as ever. Of these, pyrender's own depth map has the depth of the first, which
    lies up to half a pixel off the ray that media are shaded along.

    Parameters
    ----------
    size : (width, height)
    target : int, optional
        Name of the framebuffer to draw into, with RGBA8 colors and 24 bits of depth. Default: one of its own.
    """

    def __init__(self, size: tuple[int, int], target: int | None = None) -> None:
        super().__init__(*size)
        self.dpscale = 1  # no two pixels for one on macOS
        self.viewport_width, self.viewport_height = size
        self._target = target
        self._at_centers = False

    def render(self, scene: Any, flags: int, seg_node_map: Any = None) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Draw; the encoded colors and depth, row 0 at the top, of the framebuffer of its own, else nothing."""
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)  # rows of pyrender's textures have no padding
        # Colors come from the second pass; those of the first are the quickest to have.
        self._at_centers = True
        super().render(scene, (flags & _SHAPE_FLAGS) | Flags.FLAT | Flags.OFFSCREEN)
        self._at_centers = False
        super().render(scene, flags | Flags.OFFSCREEN)
        return self._read() if self._target is None else (np.empty(0), np.empty(0))

    def delete(self) -> None:
        """Free all OpenGL objects, in their context."""
        super().delete()
        self._shadow_fb = None  # or it is freed again with the renderer, when the name may be that of somebody else

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        super()._configure_forward_pass_viewport(flags)
        if self._at_centers:
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._framebuffer)

    def _read_main_framebuffer(self, scene: Any, flags: int) -> None:
        if not self._at_centers:
            corners = (0, 0, self.viewport_width, self.viewport_height)
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._framebuffer)
            GL.glBlitFramebuffer(*corners, *corners, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)

    @property
    def _framebuffer(self) -> int:
        return self._main_fb if self._target is None else self._target

    def _read(self) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        shape = self.viewport_height, self.viewport_width
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._framebuffer)
        area = (0, 0, self.viewport_width, self.viewport_height)
        depth = np.frombuffer(GL.glReadPixels(*area, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT), np.float32)
        colors = np.frombuffer(GL.glReadPixels(*area, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE), np.uint8)
        return colors.reshape(*shape, 4)[::-1], depth.reshape(shape)[::-1]


def why_not_in(context: GpuContext) -> str | None:
    """Reason why pyrender cannot draw in this OpenGL context; None if it can."""
    with context.current() as gl:
        _forget_errors(gl)
        # PyOpenGL sees only contexts of the window system that it is bound to.
        if OpenGL.platform.GetCurrentContext() and GL.glGenVertexArrays:
            return None
    bound = type(OpenGL.platform.PLATFORM).__name__
    return f"PyOpenGL is bound to {bound}, but the context of the renderer is {context.backend!r}"


@contextmanager
def drawn_in(context: GpuContext, scene: Any, size: tuple[int, int], flags: int) -> Iterator[TextureBackdrop]:
    """Draw in the context of a renderer, for as long as the textures are needed there."""
    with context.current() as gl:
        _forget_errors(gl)
        _require_room(size)
        color, depth = gl.texture(size, 4), gl.depth_texture(size)
        depth.compare_func = ""  # is read, not compared with
        framebuffer = gl.framebuffer([color], depth)
        try:
            framebuffer.use()  # with all of its masks and without a scissor
            _forget_errors(gl)
            with _as_render_error():
                _draw(OpaqueRenderer(size, framebuffer.glo), scene, flags)
            clipping = Clipping.of(scene)
            yield TextureBackdrop(
                color, depth, clipping.near, clipping.far, clipping.orthographic, GAMMA, ambient_of(scene)
            )
        finally:
            for resource in (framebuffer, color, depth):
                resource.release()


def _forget_errors(gl: Any) -> None:
    """Clear errors of OpenGL that others, such as moderngl when it builds programs, left behind."""
    while gl.error != "GL_NO_ERROR":
        pass


def _draw(renderer: OpaqueRenderer, scene: Any, flags: int) -> None:
    try:
        renderer.render(scene, flags)
    finally:
        renderer.delete()
        GL.glBindVertexArray(0)
        GL.glUseProgram(0)
        GL.glPolygonMode(GL.GL_FRONT_AND_BACK, GL.GL_FILL)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 4)
        for state in (GL.GL_DEPTH_TEST, GL.GL_CULL_FACE, GL.GL_BLEND, GL.GL_PROGRAM_POINT_SIZE):
            GL.glDisable(state)


def drawn_apart(scene: Any, size: tuple[int, int], flags: int) -> PyrenderPicture:
    """Draw in a context that pyrender makes for itself, and read the picture back."""
    with _current_kept():
        offscreen = _offscreen(size)
        with _as_render_error():
            try:
                _require_room(size)
                offscreen._renderer = OpaqueRenderer(size)
                colors, depth = offscreen.render(scene, flags)
            finally:
                offscreen.delete()
    return PyrenderPicture(colors, Clipping.of(scene).metres(depth), ambient_of(scene))


def _offscreen(size: tuple[int, int]) -> Any:
    try:
        return pyrender.OffscreenRenderer(*size)
    except Exception as error:  # each of the window systems raises its own kinds
        raise RenderError(
            "drawing with pyrender in a separate OpenGL context",
            f"no such context can be created ({type(error).__name__}: {error})",
            "without a window, set PYOPENGL_PLATFORM=egl before anything imports pyrender",
        ) from error


def _require_room(size: tuple[int, int]) -> None:
    limit = int(GL.glGetIntegerv(GL.GL_MAX_RENDERBUFFER_SIZE))
    if max(size) > limit:
        raise RenderError(
            f"frame size {size[0]}x{size[1]}",
            f"this OpenGL allows at most {limit} pixels along a side",
            "render the picture in parts, or choose a smaller picture",
        )


@contextmanager
def _as_render_error() -> Iterator[None]:
    try:
        yield
    except RenderError:
        raise
    except (OpenGLError, RuntimeError) as error:  # of shaders that do not compile or fit, the second
        raise RenderError(
            "drawing with pyrender",
            f"OpenGL reported an error ({' '.join(str(error).split())})",
            "omit pyrender flags for shadows, which fail with textures on some drivers",
        ) from error


@contextmanager
def _current_kept() -> Iterator[None]:
    """Context manager that restores the current EGL context: pyrender leaves its own, or none."""
    if os.environ.get("PYOPENGL_PLATFORM") != "egl":
        yield  # pyrender leaves windows as it should
        return
    from OpenGL import EGL

    display, context = EGL.eglGetCurrentDisplay(), EGL.eglGetCurrentContext()
    surfaces = [EGL.eglGetCurrentSurface(which) for which in (EGL.EGL_DRAW, EGL.EGL_READ)]
    try:
        yield
    finally:
        if context:
            EGL.eglMakeCurrent(display, *surfaces, context)
