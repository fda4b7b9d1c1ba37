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

from translucent.errors import RenderError
from translucent.extras import require_package
from translucent.preview.document import Document
from translucent.preview.script import Script
from translucent.preview.workspace import Workspace

#: Name of the window in the system.
TITLE = "translucent"

#: sRGB color behind panels.
BACKGROUND = (0.135, 0.14, 0.15, 1.0)

#: sRGB color of menus, lists and tooltips, through which nothing is seen.
POPUP = (0.10, 0.105, 0.115, 1.0)

#: Parts of the width of a window of this many pixels that panels take on its right and left. In wider ones they keep
#: their widths, and the viewport gets the rest.
NARROW, RIGHT, LEFT = 1280, 0.27, 0.25

#: Frames per second of a window that has nothing to do, and of one that waits for other processes: they need the time
#: more. Whatever the user does wakes it at once.
IDLE_FPS, WAITING_FPS = 9.0, 20.0

#: Seconds between frames of a window that has nothing to show yet: the thread that reads the model needs the time more.
READING = 0.03


def require_display() -> None:
    """Raise if there is no display for a window, or no package that could open one.

    Raises
    ------
    RenderError
        It names the way without a window.
    """
    without = "without a window: translucent render MODEL -o picture.png"
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise RenderError("preview", "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)", without)
    require_package("imgui_bundle", "preview", without)


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
        Does what it says, one action a frame, and then closes the window.
    screenshot : str, optional
        A .png of the window as it was at the end.
    allow_outside : bool
        Whether models may link to files outside their folders.

    Raises
    ------
    RenderError
        If there is no display, or the window cannot be opened.
    """
    require_display()
    from imgui_bundle import hello_imgui

    from translucent.gpu.drivers import avoid_full_cache

    window = _Window(document, script, allow_outside)
    params = window.params(size, scale)
    with _told_as_messages(window.work):
        avoid_full_cache()
        try:
            hello_imgui.run(params)
        except RuntimeError as error:
            if "glfw" not in str(error).lower():
                raise
            found = f"no window can be opened on display {os.environ.get('DISPLAY', '')!r}"
            raise RenderError("preview", found, "without a window: translucent render MODEL -o picture.png") from error
        finally:
            window.work.close()
    if window.failure is not None:
        raise window.failure
    if screenshot is not None:
        from translucent.files.images import write_png
        from translucent.files.paths import write_atomically

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
def _told_as_messages(work: Workspace) -> Iterator[None]:
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
        self.state: Any = None
        self._drops: object = None

    @property
    def remembers(self) -> bool:
        """True if files opened lately, folders and the places of panels are read, and kept for the next window."""
        return self.script is None or self.script.remembers

    def params(self, size: tuple[int, int], scale: float) -> Any:
        """Parameters of the window."""
        from imgui_bundle import hello_imgui, imgui

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
        params.callbacks.setup_imgui_style = self._guarded(self._style)
        params.callbacks.post_init = self._guarded(self._opened)
        params.callbacks.before_exit = self._guarded(self._closed)
        params.callbacks.show_menus = self._guarded(self._menus)
        params.callbacks.show_status = self._guarded(self._status)
        params.callbacks.show_gui = self._guarded(self._popups)
        params.callbacks.pre_new_frame = self._guarded(self._step)
        params.docking_params = self._docking(min(1.0, NARROW * scale / size[0]))
        return params

    def _guarded(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Guard a callback: an exception closes the window, and is raised afterwards, instead of ending the process."""

        def call() -> None:
            try:
                callback()
            except BaseException as error:  # noqa: BLE001 - raised when the window is closed
                self._fail(error)

        return call

    def _fail(self, error: BaseException) -> None:
        from imgui_bundle import hello_imgui

        self.failure = self.failure or error
        hello_imgui.get_runner_params().app_shall_exit = True

    def _docking(self, share: float) -> Any:
        """Docking layout: panels on both sides, with a share of the width that they have in a narrow window."""
        from imgui_bundle import hello_imgui, imgui

        from translucent.preview.panels.files import files_panel
        from translucent.preview.panels.look import environments_panel, look_panel
        from translucent.preview.panels.material import library_panel, material_panel
        from translucent.preview.panels.method import messages_panel, method_panel
        from translucent.preview.panels.scene import scene_panel
        from translucent.preview.panels.viewport import viewport_panel

        docking = hello_imgui.DockingParams()
        docking.docking_splits = [
            hello_imgui.DockingSplit("MainDockSpace", "Right", imgui.Dir.right, RIGHT * share),
            # Of what the first has left.
            hello_imgui.DockingSplit("MainDockSpace", "Left", imgui.Dir.left, LEFT * share / (1.0 - RIGHT * share)),
            hello_imgui.DockingSplit("Right", "Below", imgui.Dir.down, 0.16),
        ]
        panels: list[tuple[str, str, Callable[[Any], None]]] = [
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
        windows = []
        for label, space, panel in panels:
            window = hello_imgui.DockableWindow(label, space)
            window.gui_function = self._guarded(partial(self._show, panel))
            window.can_be_closed = False
            if label == "Viewport":
                window.imgui_window_flags = imgui.WindowFlags_.no_scrollbar
            windows.append(window)
        docking.dockable_windows = windows
        return docking

    def _show(self, panel: Callable[[Any], None]) -> None:
        from imgui_bundle import ImVec2, imgui

        if self.state is None:
            return
        if not imgui.is_window_docked():  # windows have no background of their own, see _style
            low, size = imgui.get_window_pos(), imgui.get_window_size()
            color = imgui.get_color_u32(imgui.ImVec4(*BACKGROUND))
            imgui.get_window_draw_list().add_rect_filled(low, ImVec2(low.x + size.x, low.y + size.y), color)
        panel(self.state)

    def _style(self) -> None:
        """Style of the window, without panel backgrounds: on a software rasterizer they took most of a frame's time."""
        from imgui_bundle import imgui

        style = imgui.get_style()
        # Nor is the whole window dimmed behind a page or a browser, which is to blend each of its pixels.
        plain = imgui.Col_.window_bg, imgui.Col_.docking_empty_bg, imgui.Col_.child_bg, imgui.Col_.modal_window_dim_bg
        for part in plain:
            style.set_color_(part, imgui.ImVec4(0.0, 0.0, 0.0, 0.0))
        style.set_color_(imgui.Col_.popup_bg, imgui.ImVec4(*POPUP))
        imgui.get_io().config_flags |= imgui.ConfigFlags_.nav_enable_keyboard  # Escape closes menus and lists

    def _opened(self) -> None:
        from imgui_bundle import implot

        from translucent.gpu.context import open_context
        from translucent.preview.dialogs import accept_drops
        from translucent.preview.session import read_environments, read_folders, read_recent
        from translucent.preview.viewport_renderer import ViewportRenderer
        from translucent.preview.window_state import WindowState

        implot.create_context()
        self.state = WindowState(self.work, ViewportRenderer(open_context("window").gl, self.work.compiler))
        self._drops = accept_drops(self._dropped)
        if self.remembers:
            self.work.recent = read_recent()
            self.state.folders = read_folders()
            self.state.environments.take(read_environments())

    def _dropped(self, paths: list[str]) -> None:
        from translucent.preview.panels.files import take_dropped

        if self.state is not None:
            self._guarded(lambda: take_dropped(self.state, paths))()

    def _closed(self) -> None:
        from imgui_bundle import implot

        from translucent.preview.session import write_environments, write_folders, write_recent, write_stage

        if self.remembers and self.state is not None:
            write_folders(self.state.folders)
            write_environments(self.state.environments.path)
        if self.remembers:
            write_recent(self.work.recent)
            write_stage(self.work.document.look.stage)
        if self.state is not None:
            self.state.view.close()
            self.state = None
            implot.destroy_context()

    def _step(self) -> None:
        from imgui_bundle import hello_imgui

        from translucent.preview.panels.files import take_answers

        if self.state is None:
            return
        take_answers(self.state)
        if self.work.loaded is None:
            time.sleep(READING)
        idling = hello_imgui.get_runner_params().fps_idling
        idling.enable_idling = self.state.waits and self.script is None
        idling.fps_idle = WAITING_FPS if self.state.more else IDLE_FPS
        if self.script is not None and self.script.step(self.state):
            for text in filter(None, (self.state.view.problem, self.state.view.shader_problem)):
                self.work.refuse(RenderError("the picture is not what it should be", text))
            hello_imgui.get_runner_params().app_shall_exit = True

    def _menus(self) -> None:
        from translucent.preview.panels.menus import menus

        if self.state is not None:
            menus(self.state)

    def _popups(self) -> None:
        from translucent.preview.panels.files import file_browser
        from translucent.preview.panels.menus import handle_keys, keys_page

        if self.state is not None:
            handle_keys(self.state)
            file_browser(self.state)
            keys_page(self.state)

    def _status(self) -> None:
        from translucent.preview.panels.menus import status

        if self.state is not None:
            status(self.state)
