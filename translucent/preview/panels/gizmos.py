"""Gizmos in the viewport: handles that move, rotate and scale, and the axes of the world, which choose views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui, imguizmo

from translucent.arrays import Array
from translucent.preview.document import Orbit, Placed, camera_of, triple_of
from translucent.preview.panels.widgets import em, tooltip
from translucent.preview.scenes import degrees_of, rotation_matrix
from translucent.preview.window_state import VIEWS, WindowState
from translucent.scene.camera import Camera

guizmo = imguizmo.im_guizmo

#: What a gizmo does, and in which axes.
OPERATIONS = {
    "move": (guizmo.OPERATION.translate, guizmo.MODE.world),
    "rotate": (guizmo.OPERATION.rotate, guizmo.MODE.world),
    "scale": (guizmo.OPERATION.scale, guizmo.MODE.local),
}

#: Axes of the world, their colors as ImGui packs them, and the views along them from both ends.
AXES = (
    ("X", (1.0, 0.0, 0.0), 0xFF4A4AE8, "right", "left"),
    ("Y", (0.0, 1.0, 0.0), 0xFF4FBF5A, "top", "bottom"),
    ("Z", (0.0, 0.0, 1.0), 0xFFE8863A, "front", "back"),
)

#: Length of an axis on the screen, and radius of the circle at its end, in ems.
AXIS, END = 2.3, 0.62

#: Length of handles, where the picture is 2 long.
SIZE = 0.2

#: Nearest and farthest distance that the gizmo's projection keeps apart, in distances of the camera.
NEAR, FAR = 0.01, 100.0


def gizmos(state: WindowState, corner: ImVec2, room: ImVec2) -> bool:
    """Draw the gizmos of the viewport; returns whether the mouse is theirs."""
    orbit = state.work.document.orbit
    if orbit is None:
        return False
    guizmo.begin_frame()
    guizmo.set_drawlist(imgui.get_window_draw_list())
    guizmo.set_rect(corner.x, corner.y, room.x, room.y)
    guizmo.set_orthographic(orbit.orthographic)
    guizmo.set_gizmo_size_clip_space(SIZE)
    busy = _handles(state, orbit, room)
    return _axes(state, corner, room) or busy


def _handles(state: WindowState, orbit: Orbit, room: ImVec2) -> bool:
    """Draw the handles of the selected light, or of the object that moves; returns whether the mouse is at them."""
    lights, moved = state.work.document.lights, state.moved
    if state.light is not None and state.light < len(lights):
        matrix = np.eye(4)
        matrix[:3, 3] = lights[state.light].position
        if (found := _manipulated(state, orbit, room, "move", matrix)) is not None:
            state.change_light("position", triple_of(found[:3, 3]))
    elif moved is not None and state.gizmo in OPERATIONS and moved not in state.work.document.hidden:
        place = state.work.document.place_of(moved)
        middle = _middle(state, moved)
        if (found := _manipulated(state, orbit, room, state.gizmo, gizmo_matrix(place, middle))) is not None:
            state.place(place_from(place, found, middle, state.gizmo), state.drag)
    else:
        return False
    hovered = guizmo.get_hovered_move_type() != guizmo.MOVETYPE.mt_none
    if hovered and imgui.is_mouse_clicked(0):
        state.drag += 1
    return bool(hovered or guizmo.is_using())


def _middle(state: WindowState, number: int) -> Array:
    """(3,): middle of the box of an object where the model has it."""
    assert state.work.loaded is not None
    return np.asarray(state.work.loaded.scene.objects[number].bounds.mean(axis=0))


def gizmo_matrix(place: Placed, middle: Array) -> Array:
    """(4, 4): axes and origin of the gizmo of an object with this middle, in its place."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix(place.rotation) * np.asarray(place.scale)
    matrix[:3, 3] = middle + np.asarray(place.location)
    return matrix


def place_from(place: Placed, matrix: Array, middle: Array, gizmo: str) -> Placed:
    """Place of an object after its gizmo, which moves, rotates or scales, has changed its matrix (4, 4)."""
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    match gizmo:
        case "move":
            return replace(place, location=triple_of(matrix[:3, 3] - middle))
        case "rotate":
            return replace(place, rotation=degrees_of(matrix[:3, :3] / lengths))
    return replace(place, scale=triple_of(np.clip(lengths, 1e-6, 1e6)))


def _manipulated(state: WindowState, orbit: Orbit, room: ImVec2, operation: str, matrix: Array) -> Array | None:
    """Matrix (4, 4) after the gizmo has been dragged; None if it has not. Lengths are scaled to those of the camera."""
    unit, camera = orbit.distance, camera_of(orbit)
    scaled = matrix.copy()
    scaled[:3, 3] /= unit
    held = _matrix16(scaled)
    views = _matrix16(view_matrix(camera, unit)), _matrix16(projection_matrix(camera, (room.x, room.y), unit))
    if not guizmo.manipulate(*views, *OPERATIONS[operation], held):
        return None
    found = np.asarray(held.values, dtype=np.float64).reshape(4, 4).T
    found[:3, 3] *= unit
    return found if np.isfinite(found).all() else None


def _matrix16(matrix: Array) -> guizmo.Matrix16:
    return guizmo.Matrix16(matrix.T.reshape(-1).tolist())


def view_matrix(camera: Camera, unit: float) -> Array:
    """(4, 4): from the world to the camera, in units of so many metres."""
    matrix = np.linalg.inv(camera.pose)
    matrix[:3, 3] /= unit
    return np.asarray(matrix, dtype=np.float64)


def projection_matrix(camera: Camera, room: tuple[float, float], unit: float) -> Array:
    """(4, 4): OpenGL's projection of a camera, in units of so many metres."""
    half_width, half_height = camera.half_extent((max(int(room[0]), 1), max(int(room[1]), 1)))
    if camera.fov_y is None:
        matrix = np.diag([unit / half_width, unit / half_height, -2.0 / FAR, 1.0])
        matrix[2, 3] = -1.0
        return matrix
    matrix = np.diag([1.0 / half_width, 1.0 / half_height, -(FAR + NEAR) / (FAR - NEAR), 0.0])
    matrix[2, 3], matrix[3, 2] = -2.0 * FAR * NEAR / (FAR - NEAR), -1.0
    return matrix


def _axes(state: WindowState, corner: ImVec2, room: ImVec2) -> bool:
    """Draw the axes of the world in the upper right corner: a click at an end sees the model from there."""
    orbit = state.work.document.orbit
    assert orbit is not None
    camera, over = camera_of(orbit), imgui.get_window_draw_list()
    center = ImVec2(corner.x + room.x - em(AXIS + 1.6), corner.y + em(AXIS + 1.4))
    ends = []
    for name, axis, color, positive, negative in AXES:
        for sign, view in ((1.0, positive), (-1.0, negative)):
            along = sign * np.asarray(axis)
            x, y, depth = along @ camera.right, -(along @ camera.up), float(along @ camera.forward)
            at = ImVec2(float(center.x + em(AXIS) * x), float(center.y + em(AXIS) * y))
            ends.append((depth, name if sign > 0 else "", at, color, view))
    over_any = False
    for _, name, at, color, _view in sorted(ends, key=lambda end: -end[0]):  # far ones first
        if name:
            over.add_line(center, at, color, em(0.14))
            over.add_circle_filled(at, em(END), color)
            size = imgui.calc_text_size(name)
            over.add_text(ImVec2(at.x - 0.5 * size.x, at.y - 0.5 * size.y), 0xFF101010, name)
        else:
            over.add_circle_filled(at, em(0.8 * END), 0xC0303030)
            over.add_circle(at, em(0.8 * END), color)
    for _, _, at, _, view in sorted(ends, key=lambda end: end[0]):  # near ones take the mouse first
        imgui.set_cursor_screen_pos(ImVec2(at.x - em(END), at.y - em(END)))
        if imgui.invisible_button(f"##axis {view}", ImVec2(em(2 * END), em(2 * END))):
            state.view_from(view)
        over_any |= imgui.is_item_hovered() or imgui.is_item_active()
        tooltip(f"View from: {view}")
    imgui.set_cursor_screen_pos(corner)
    return over_any


def view_buttons(state: WindowState) -> None:
    """Draw a button for each view by name."""
    width = imgui.get_content_region_avail().x
    for i, name in enumerate(VIEWS):
        size = imgui.calc_text_size(name).x + 2 * imgui.get_style().frame_padding.x
        if i:
            imgui.same_line()
            if imgui.get_cursor_pos_x() + size > width:
                imgui.new_line()
        if imgui.small_button(name):
            state.view_from(name)
