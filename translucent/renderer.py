"""The public renderer: plans a scene, and runs the plan with OpenGL, or on the CPU where there is none."""

from __future__ import annotations

import dataclasses
import sys
import warnings
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, get_args
from weakref import WeakKeyDictionary

import numpy as np

from translucent.arguments import brief, checked, checked_but
from translucent.arrays import Floats
from translucent.errors import InputError, RenderError, TranslucentWarning
from translucent.extras import require_package
from translucent.formulas.tone import tone_curve
from translucent.frames.denoising import denoised
from translucent.frames.frame import Frame, check_exposure
from translucent.gpu.context import Backend, NoContextError
from translucent.gpu.job import TextureBackdrop
from translucent.gpu.renderer import GpuRenderer
from translucent.planning.caustics import Caustics
from translucent.planning.interfaces import InterfaceMode
from translucent.planning.methods import Method
from translucent.planning.passes import NoteKind
from translucent.planning.plan import plan_scene
from translucent.planning.render_plan import RenderPlan
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import Scattering
from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene.backdrop import Backdrop
from translucent.scene.camera import check_size
from translucent.scene.grounds import before_page, page_radiance
from translucent.scene.scene import Scene, check_scene
from translucent.version import VERSION

if TYPE_CHECKING:
    import moderngl

    from translucent.cpu.renderer import CpuRenderer

#: Backends that a user may ask for.
BACKENDS = (*get_args(Backend), "cpu")

#: Samples of the picture that helps to denoise random paths: its time is small beside theirs.
GUIDE_SAMPLES = 16


@checked
class Renderer:
    """Renderer of scenes with OpenGL, or on the CPU. Use it as a context manager: leaving it frees everything.

    Parameters
    ----------
    backend : {"egl", "window", "osmesa", "cpu"}, optional
        None picks: EGL, else OSMesa, else, with a `TranslucentWarning`, the CPU.
    context : moderngl.Context, optional
        Draw with a context that somebody else owns, such as a window's. It must be current during every call, and is
        never released.

    Raises
    ------
    InputError
        If the backend is not known.
    RenderError
        If nothing can render here; the message lists what was tried.
    """

    def __init__(self, backend: str | None = None, context: moderngl.Context | None = None) -> None:
        if backend is not None and backend not in BACKENDS:
            raise InputError(f"backend {backend!r}", "no backend has this name", f"use one of {', '.join(BACKENDS)}")
        if context is not None and backend is not None:
            raise InputError(
                f"backend {backend!r}",
                "a context is given, too, and it already determines the backend",
                "omit the backend or the context",
            )
        self._plans: WeakKeyDictionary[Scene, dict[RenderRequest, RenderPlan]] = WeakKeyDictionary()
        self._closed = False
        self._asked = backend, context
        self._made: GpuRenderer | CpuRenderer = _engine(backend, context)

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def _engine(self) -> GpuRenderer | CpuRenderer:
        """Engine that draws: a new one after an interrupted frame, whose state on the GPU is unknown."""
        if not self._closed and isinstance(self._made, GpuRenderer) and self._made.interrupted:
            self._made = _engine(*self._asked)
        return self._made

    @property
    def gpu(self) -> GpuRenderer:
        """Engine that draws with OpenGL.

        Raises
        ------
        RenderError
            If this renderer has none.
        """
        return self._gpu("drawing with OpenGL")

    @property
    def provenance(self) -> dict[str, str]:
        """Backend, device, driver and versions, as every frame records them."""
        return {
            **self._engine.provenance,
            "numpy": np.__version__,
            "python": sys.version.split()[0],
            "translucent": VERSION,
        }

    @checked_but("scene", "method", "interfaces", "scattering", "caustics", "shadows")
    def plan(
        self,
        scene: Scene,
        method: Method | None = None,
        *,
        over_backdrop: bool = False,
        interfaces: InterfaceMode | None = None,
        scattering: Scattering | None = None,
        caustics: Caustics | None = None,
        shadows: ShadowMaps | None = None,
    ) -> RenderPlan:
        """Plan that `render` would run with this renderer, with or without a backdrop."""
        request = RenderRequest(method, 1, interfaces, scattering, caustics, shadows, over_backdrop=over_backdrop)
        return self.plan_requested(scene, request)

    def plan_requested(self, scene: Scene, request: RenderRequest) -> RenderPlan:
        """Plan for a rendering request, see `plan`."""
        check_scene(scene)
        plans = self._plans.setdefault(scene, {})
        if request not in plans:
            plans[request] = plan_scene(scene, request, self._engine.capabilities)
        return plans[request]

    @checked_but("scene", "size", "samples", "backdrop", "method", "interfaces", "scattering", "caustics", "shadows")
    def render(
        self,
        scene: Scene,
        size: tuple[int, int],
        method: Method | None = None,
        samples: int = 1,
        backdrop: Backdrop | TextureBackdrop | None = None,
        *,
        transparent: bool = False,
        interfaces: InterfaceMode | None = None,
        scattering: Scattering | None = None,
        caustics: Caustics | None = None,
        shadows: ShadowMaps | None = None,
        adaptive: bool = True,
        denoise: bool = False,
        progress: Callable[[float], None] | None = None,
    ) -> Frame:
        """Render a scene.

        Parameters
        ----------
        scene : Scene
        size : (width, height)
            In pixels.
        method : Method, optional
            How to find thickness; None lets the planner pick. `PathTraced` makes the radiance by random paths, too.
        samples : int
            Sub-pixel samples over which radiance and transmittance are averaged, for smooth edges. The other arrays
            belong to the ray through the pixel center, as all do with 1.
        adaptive : bool
            Trace rays from interfaces for more samples of a pixel where they or neighbors differ, up to twice
            `samples`, elsewhere for one or a few; not for a transparent frame. False: for all everywhere.
        backdrop : Backdrop or TextureBackdrop, optional
            A picture of everything opaque, drawn elsewhere. The same for all samples of a pixel.
        transparent : bool
            Leave out the environment as far as it is seen behind everything, and give the frame an `alpha`; it still
            lights, and is mirrored. Costs a second rendering: alpha is one minus the difference between frames before
            white and before black (Smith & Blinn 1996). Of shadow catchers, such as the ground of a stage, no more is
            seen than what their shadows take from what is behind.
        interfaces : TracedInterfaces, ScreenInterfaces or FrontInterface, optional
            How to find the interfaces at which light refracts and reflects: by rays through the meshes, drawn in screen
            space, or drawn where rays enter alone; None lets the planner pick. Thickness, optical depth and
            transmittance stay those of the straight ray.
        scattering : Diffusion, ScatteringLayer or SingleScattering, optional
            How to show light that media scatter more than once: as it diffuses in the body, as a flat layer gives it
            back, or not at all; None lets the planner pick for each body.
        caustics : Caustics, optional
            Photons that carry the light of lights through interfaces, and by their mirrors, onto opaque objects and
            into media. None, the default: some where a clear body gathers light on an opaque object and they take less
            than a third of the time of the picture, as with 16 samples. `Caustics(0)`: none.
        shadows : ShadowMaps, optional
            How sharp shadows on opaque objects are. Without OpenGL they are traced.
        denoise : bool
            Take the noise of random paths, and of rough interfaces and what they mirror, out of the picture by Open
            Image Denoise (the extra ``denoise``). Such a picture has no standard error, and no known one: its plan and
            its provenance say so. What has no noise stays as it is. For paths in media that scatter, a picture by
            diffusion is rendered as well, and helps.
        progress : callable, optional
            Takes the share of the work that is done, 0 to 1; with OpenGL.

        Returns
        -------
        Frame
            With float32 arrays. Pixels that cannot be trusted are False in `valid`, and one `TranslucentWarning`
            counts them.

        Raises
        ------
        InputError
            If the size is not positive, or no method can render the scene; if the backdrop is of another size, or the
            scene has opaque objects besides it; if interfaces, scattering or caustics cannot be had
            as asked for.
        RenderError
            If the frame is larger than this OpenGL allows, or a backdrop is given to a renderer without OpenGL.
        """
        over_backdrop = backdrop is not None and not transparent
        request = RenderRequest(
            method,
            samples,
            interfaces,
            scattering,
            caustics,
            shadows,
            transparent=transparent,
            adaptive=adaptive,
            denoise=denoise,
            over_backdrop=over_backdrop,
        )
        return self.render_requested(scene, size, request, backdrop, progress)

    def render_requested(
        self,
        scene: Scene,
        size: tuple[int, int],
        request: RenderRequest,
        backdrop: Backdrop | TextureBackdrop | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Frame:
        """Render a request; see `render`."""
        self._require_open()
        size = check_size(size)
        if request.over_backdrop:
            _check_backdrop(backdrop, size)
        elif backdrop is not None:
            raise InputError(
                "a transparent frame", "the frame also has a backdrop", "omit the backdrop, or transparent=True"
            )
        request = dataclasses.replace(request, pixels=size[0] * size[1])
        plan = self.plan_requested(scene, request)
        if request.denoise:
            require_package("pyoidn", "denoise", "render with more samples")  # before any work is done
        try:
            if request.transparent:
                frame = self._render_transparent(plan, size, progress)
            elif backdrop is not None:
                frame = self._gpu("a backdrop").render(plan, size, backdrop)
            else:
                frame = self._run(plan, size, progress)
        except BaseException as error:
            self._note_interruption(error)
            raise
        frame.provenance.update(self.provenance)
        if not request.over_backdrop:  # such a scene is not all that is seen
            frame = frame.rendered_from(scene, plan)
        if request.denoise and plan.has_noise:
            frame = denoised(frame, plan.scene, self._guide(scene, size, plan))
        _warn(frame)
        return frame

    def _guide(self, scene: Scene, size: tuple[int, int], plan: RenderPlan) -> Floats | None:
        """Radiance without noise that helps to denoise random paths in media that scatter; None for other pictures."""
        if plan.paths is None or not any(body.medium.scatters for body in scene.bodies if body.medium):
            return None
        request = dataclasses.replace(plan.request, method=None, denoise=False, samples=GUIDE_SAMPLES)
        return self._run(self.plan_requested(scene, request), size, None).radiance

    def _run(self, plan: RenderPlan, size: tuple[int, int], progress: Callable[[float], None] | None) -> Frame:
        engine = self._engine
        return (
            engine.render(plan, size, report=progress) if isinstance(engine, GpuRenderer) else engine.render(plan, size)
        )

    def _render_transparent(
        self, plan: RenderPlan, size: tuple[int, int], progress: Callable[[float], None] | None
    ) -> Frame:
        white = page_radiance(plan.scene)
        request = dataclasses.replace(plan.request, adaptive=False)
        before_black, before_white = (
            self._run(dataclasses.replace(plan, scene=before_page(plan.scene, level), request=request), size, progress)
            for level in (0.0, white)
        )
        passed = np.clip((before_white.radiance.astype(np.float64) - before_black.radiance) / white, 0.0, 1.0)
        alpha = 1.0 - passed.mean(axis=-1)
        return dataclasses.replace(before_black, alpha=alpha.astype(np.float32), passed=passed.astype(np.float32))

    @checked_but("scene", "exposure", "tone", "method", "interfaces", "scattering", "shadows")
    def draw(
        self,
        scene: Scene,
        framebuffer: moderngl.Framebuffer,
        method: Method | None = None,
        exposure: float = 0.0,
        tone: str = "none",
        *,
        interfaces: InterfaceMode | None = None,
        scattering: Scattering | None = None,
        shadows: ShadowMaps | None = None,
    ) -> RenderPlan:
        """Render a scene into a framebuffer of this renderer's context, sRGB-encoded, without reading anything back.

        Parameters
        ----------
        scene : Scene
        framebuffer : moderngl.Framebuffer
            Its size is the frame's.
        method : Method, optional
        exposure : float
            Stops brighter.
        tone : {"none", "neutral", "agx"}
            Tone curve: clamped to 0..1, Khronos PBR Neutral, or AgX.
        interfaces : TracedInterfaces, ScreenInterfaces or FrontInterface, optional
        scattering : Diffusion, ScatteringLayer or SingleScattering, optional
        shadows : ShadowMaps, optional
            As for `render`.

        Raises
        ------
        InputError
            If no method can render the scene, there is no such curve, or the exposure is beyond 100 stops.
        RenderError
            If the framebuffer is larger than this OpenGL allows, or the renderer has none.
        """
        request = RenderRequest(method, interfaces=interfaces, scattering=scattering, shadows=shadows)
        return self.draw_requested(scene, framebuffer, request, exposure, tone)

    def draw_requested(
        self,
        scene: Scene,
        framebuffer: moderngl.Framebuffer,
        request: RenderRequest,
        exposure: float = 0.0,
        tone: str = "none",
    ) -> RenderPlan:
        """Render a request into a framebuffer; see `draw`."""
        self._require_open()
        tone_curve(tone)
        check_exposure(exposure)
        chosen = self.plan_requested(scene, request)
        try:
            self.gpu.draw(chosen, framebuffer, exposure, tone)
        except BaseException as error:
            self._note_interruption(error)
            raise
        return chosen

    def close(self) -> None:
        """Free all resources. Closing twice is fine."""
        if not self._closed:
            self._closed = True
            self._made.close()

    def _note_interruption(self, error: BaseException) -> None:
        """Mark the engine as unusable after an exception that may come at any point, such as Ctrl-C."""
        if not isinstance(error, Exception) and isinstance(self._made, GpuRenderer):
            self._made.interrupt()

    def _gpu(self, what: str) -> GpuRenderer:
        if not isinstance(self._engine, GpuRenderer):
            raise RenderError(
                what, "this renderer works on the CPU, and has no OpenGL", 'use a backend other than "cpu"'
            )
        return self._engine

    def _require_open(self) -> None:
        if self._closed:
            raise RenderError("rendering", "the renderer has been closed", "create a new renderer")


def _engine(backend: str | None, context: moderngl.Context | None) -> GpuRenderer | CpuRenderer:
    if backend == "cpu":
        return _cpu_renderer()
    try:
        return GpuRenderer(backend, context)
    except NoContextError as error:
        if backend is not None:
            raise
        try:
            engine = _cpu_renderer()
        except RenderError as other:
            raise error from other
        warnings.warn(
            f"rendering on the CPU, because OpenGL is not available: {error}", TranslucentWarning, stacklevel=4
        )
        return engine


def _cpu_renderer() -> CpuRenderer:
    # Where there is OpenGL, nobody waits for Embree to load.
    from translucent.cpu.renderer import CpuRenderer

    return CpuRenderer()


def _check_backdrop(backdrop: Backdrop | TextureBackdrop | None, size: tuple[int, int]) -> None:
    if not isinstance(backdrop, Backdrop | TextureBackdrop):
        raise InputError(
            f"backdrop {brief(backdrop)}", f"of type {type(backdrop).__name__}", "give an object of type tl.Backdrop"
        )
    if backdrop.size != size:
        asked = f"backdrop of {backdrop.size[0]}x{backdrop.size[1]}"
        raise InputError(asked, f"the frame has {size[0]}x{size[1]} pixels", "render both in the same size")


def _warn(frame: Frame) -> None:
    for effect in frame.plan.unmodelled:
        if effect.kind is NoteKind.LIGHTS_LEFT_OUT:
            warnings.warn(str(effect), TranslucentWarning, stacklevel=4)
    if not frame.valid.all():
        text = frame.plan.invalid_text(*(int(np.count_nonzero(kind)) for kind in (~frame.valid, frame.coverage)))
        warnings.warn(text, TranslucentWarning, stacklevel=4)
