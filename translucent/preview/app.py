"""The window: docked panels around a viewport, menus, and the work of a frame."""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from imgui_bundle import ImVec2, hello_imgui, imgui, implot

from translucent.errors import RenderError
from translucent.files.images import write_png
from translucent.files.paths import write_atomically
from translucent.gpu.context import avoid_full_cache, open_context
from translucent.preview.dialogs import accept_drops
from translucent.preview.document import Document
from translucent.preview.panels.material import library_panel, material_panel, scene_panel
from translucent.preview.panels.menus import file_browser, files_panel, handle_keys, keys_page, menus, status
from translucent.preview.panels.view import environments_panel, look_panel, messages_panel, method_panel
from translucent.preview.panels.viewport import viewport_panel
from translucent.preview.script import Script
from translucent.preview.session import Preferences
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.window_state import WindowState
from translucent.preview.workspace import Workspace

#: Name of the window in the system.
TITLE = "translucent"

#: sRGB color behind panels.
BACKGROUND = (0.135, 0.14, 0.15, 1.0)

#: sRGB color of menus, lists and tooltips, through which nothing is seen.
POPUP = (0.10, 0.105, 0.115, 1.0)

#: Panels, with the part of the window where each is docked.
PANELS: list[tuple[str, str, Callable[[WindowState], None]]] = [
    ("Viewport", "MainDockSpace", viewport_panel),
    ("Material", "Left", material_panel),
    ("Library", "Left", library_panel),
    ("Scene", "Left", scene_panel),
    ("Method", "Right", method_panel),
    ("Look", "Right", look_panel),
    ("Environments", "Right", environments_panel),
    ("Files", "Right", files_panel),
    ("Messages", "Below", messages_panel),
]

#: Fractions of the width of a window of this many pixels that panels take on its right and left. In wider ones they
#: keep their widths, and the viewport gets the rest.
NARROW, RIGHT, LEFT = 1280, 0.27, 0.25

#: Frames per second of a window that has nothing to do, and of one that waits for other processes: they need the time
#: more. Whatever the user does wakes it at once.
IDLE_FPS, WAITING_FPS = 9.0, 20.0

#: Seconds between frames of a window that has nothing to show yet: the thread that reads the model needs the time more.
READING = 0.03


def run(
    document: Document,
    size: tuple[int, int] = (1600, 1000),
    scale: float = 1.0,
    script: Script | None = None,
    screenshot: str | None = None,
    allow_outside: bool = False,
) -> Workspace:
    """Open the window, and return when it is closed.

    Parameters
    ----------
    document : Document
    size : (width, height)
        Of the window.
    scale : float
        Of letters and fields, besides that of the display.
    script : Script, optional
        Actions to do, one a frame, before the window closes.
    screenshot : str, optional
        A .png of the window as it was at the end.
    allow_outside : bool
        Whether models may link to files outside their folders.

    Raises
    ------
    RenderError
        If the window cannot be opened.
    """
    window = _Window(document, script, allow_outside)
    params = window.params(size, scale)
    with _warnings_as_messages(window.work):
        avoid_full_cache()
        try:
            hello_imgui.run(params)
        except RuntimeError as error:
            if window.failure is not None:  # it left a table open, for example, which Dear ImGui objects to
                raise window.failure from error
            if "glfw" not in str(error).lower():
                raise
            found = f"no window can be opened on display {os.environ.get('DISPLAY', '')!r}"
            raise RenderError(
                "preview", found, "to render without a window, run translucent render MODEL -o picture.png"
            ) from error
        finally:
            window.work.close()
    if window.failure is not None:
        raise window.failure
    if screenshot is not None:
        pixels = hello_imgui.final_app_window_screenshot()
        write_atomically(Path(screenshot), partial(write_png, pixels=pixels))
    return window.work


def leave(work: Workspace, code: int = 0) -> None:
    """End the process here, with this exit code, if threads of a closed window are still at work.

    At exit CPython before 3.14 unwinds the stacks of threads that nobody waits for, at which C++ libraries abort.
    """
    if not work.ended:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


@contextmanager
def _warnings_as_messages(work: Workspace) -> Iterator[None]:
    """Context manager that shows warnings in the window instead of a terminal."""
    before = warnings.showwarning
    warnings.showwarning = lambda message, *_, **__: work.tell("warning", str(message))
    try:
        yield
    finally:
        warnings.showwarning = before


class _Window:
    """Callbacks of the window."""

    def __init__(self, document: Document, script: Script | None, allow_outside: bool) -> None:
        # The model is read while the window opens.
        self.work = Workspace(document, allow_outside)
        self.script = script
        self.failure: BaseException | None = None
        self.state: WindowState | None = None
        self._drops: object = None

    @property
    def remembers(self) -> bool:
        """True if preferences and the places of panels are read, and kept for the next window."""
        return self.script is None or self.script.remembers

    def params(self, size: tuple[int, int], scale: float) -> Any:
        """Parameters of the window."""
        params = hello_imgui.RunnerParams()
        window = params.app_window_params
        window.window_title, window.window_geometry.size = TITLE, size
        window.restore_previous_geometry = self.remembers
        if not self.remembers:
            params.ini_folder_type = hello_imgui.IniFolderType.temp_folder
            params.ini_disable = True
            window.window_geometry.size_auto = False
        else:
            params.ini_folder_type = hello_imgui.IniFolderType.app_user_config_folder
            params.ini_filename = "translucent/preview.ini"
        # The window is text and one picture that is smooth already: eight samples of it would be lost time.
        options = hello_imgui.OpenGlOptions()
        options.anti_aliasing_samples = 0
        params.renderer_backend_options.open_gl_options = options
        if scale != 1.0:
            params.dpi_aware_params.dpi_window_size_factor = scale
        imgui_window = params.imgui_window_params
        imgui_window.default_imgui_window_type = hello_imgui.DefaultImGuiWindowType.provide_full_screen_dock_space
        imgui_window.show_menu_bar = True
        imgui_window.show_menu_app = imgui_window.show_menu_view = False
        imgui_window.show_status_bar = True
        imgui_window.show_status_fps = False
        params.fps_idling.fps_idle = IDLE_FPS
        imgui_window.background_color = imgui.ImVec4(*BACKGROUND)
        callbacks = params.callbacks
        callbacks.setup_imgui_style = self._guarded(_style)
        callbacks.post_init = self._guarded(self._opened)
        callbacks.before_exit = self._guarded(self._closed)
        callbacks.show_menus = self._with_state(menus)
        callbacks.show_status = self._with_state(status)
        callbacks.show_gui = self._with_state(_popups)
        callbacks.pre_new_frame = self._with_state(self._step)
        params.docking_params = self._docking(min(1.0, NARROW * scale / size[0]))
        return params

    def _guarded(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Guard a callback: an exception closes the window, and is raised afterwards, instead of ending the process."""

        def call() -> None:
            try:
                callback()
            except BaseException as error:  # noqa: BLE001 - raised when the window is closed
                self.failure = self.failure or error
                hello_imgui.get_runner_params().app_shall_exit = True

        return call

    def _with_state(self, callback: Callable[[WindowState], None]) -> Callable[[], None]:
        """Guarded callback with the state of the window, once there is one."""
        return self._guarded(lambda: None if self.state is None else callback(self.state))

    def _docking(self, narrow: float) -> Any:
        """Docking layout: panels on both sides, with a fraction of the width that they have in a narrow window."""
        docking = hello_imgui.DockingParams()
        docking.docking_splits = [
            hello_imgui.DockingSplit("MainDockSpace", "Right", imgui.Dir.right, RIGHT * narrow),
            # Of what the first has left.
            hello_imgui.DockingSplit("MainDockSpace", "Left", imgui.Dir.left, LEFT * narrow / (1.0 - RIGHT * narrow)),
            hello_imgui.DockingSplit("Right", "Below", imgui.Dir.down, 0.16),
        ]
        windows = []
        for label, space, panel in PANELS:
            window = hello_imgui.DockableWindow(label, space)
            window.gui_function = self._with_state(partial(_show, panel))
            window.can_be_closed = False
            if label == "Viewport":
                window.imgui_window_flags = imgui.WindowFlags_.no_scrollbar
            windows.append(window)
        docking.dockable_windows = windows
        return docking

    def _opened(self) -> None:
        implot.create_context()
        view = ViewportRenderer(open_context("window").gl, self.work.compiler)
        self.state = state = WindowState(self.work, view)
        self._drops = accept_drops(lambda paths: self._guarded(lambda: state.take_dropped(paths))())
        if self.remembers:
            known = Preferences.read()
            self.work.recent, state.folders = known.recent, known.folders
            state.environments.take(known.environments)

    def _closed(self) -> None:
        if (state := self.state) is None:
            return
        if self.remembers:
            stage = self.work.document.look.stage
            Preferences(self.work.recent, state.folders, state.environments.path, stage).write()
        self.state = None
        state.view.close()
        implot.destroy_context()

    def _step(self, state: WindowState) -> None:
        state.take_answers()
        if self.work.loaded is None:
            time.sleep(READING)
        runner = hello_imgui.get_runner_params()
        runner.fps_idling.enable_idling = state.idle and self.script is None
        runner.fps_idling.fps_idle = WAITING_FPS if state.more else IDLE_FPS
        if self.script is not None and self.script.step(state):
            for text in filter(None, (state.view.problem, state.view.shader_problem)):
                self.work.refuse(RenderError("the picture in the window may be wrong", text))
            runner.app_shall_exit = True


def _style() -> None:
    """Style of the window, without panel backgrounds: on a software rasterizer they took most of a frame's time."""
    style = imgui.get_style()
    # Nor is the whole window dimmed behind a page or a browser, which is to blend each of its pixels.
    plain = imgui.Col_.window_bg, imgui.Col_.docking_empty_bg, imgui.Col_.child_bg, imgui.Col_.modal_window_dim_bg
    for part in plain:
        style.set_color_(part, imgui.ImVec4(0.0, 0.0, 0.0, 0.0))
    style.set_color_(imgui.Col_.popup_bg, imgui.ImVec4(*POPUP))
    imgui.get_io().config_flags |= imgui.ConfigFlags_.nav_enable_keyboard  # Escape closes menus and lists


def _show(panel: Callable[[WindowState], None], state: WindowState) -> None:
    if not imgui.is_window_docked():  # windows have no background of their own, see _style
        low, size = imgui.get_window_pos(), imgui.get_window_size()
        color = imgui.get_color_u32(imgui.ImVec4(*BACKGROUND))
        imgui.get_window_draw_list().add_rect_filled(low, ImVec2(low.x + size.x, low.y + size.y), color)
    panel(state)


def _popups(state: WindowState) -> None:
    handle_keys(state)
    file_browser(state)
    keys_page(state)
