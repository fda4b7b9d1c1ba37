"""The viewport: the picture, mouse input, and overlays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from imgui_bundle import ImVec2, imgui

from translucent.arrays import Array
from translucent.frames.aovs import false_colors, marks
from translucent.preview.actions import OrbitBy, Pan, Zoom
from translucent.preview.document import camera_of, length_text, triple_text
from translucent.preview.panels.gizmos import gizmos
from translucent.preview.panels.widgets import accepts_preset, begin_drag, em, packed
from translucent.preview.viewport_renderer import thickest, worst
from translucent.preview.window_state import ProbedPixel, WindowState, pixel_at
from translucent.scene.camera import Camera
from translucent.units import metres_per_unit, short_length

#: Degrees of orbit for the width of the viewport, and factor of a step of the wheel.
DEGREES, WHEEL = 270.0, 1.15

#: sRGB colors of the largest differences, as in ``present/compare.frag``.
THINNER, THICKER = (0.13, 0.40, 0.80), (0.80, 0.15, 0.18)

#: Diameter of a coin of one euro, rounded, in metres; and the width of a model from which on a hand is beside it.
COIN, HAND_FROM = 0.024, 0.25

#: Outline of a hand, from the wrist around the thumb, in centimetres: right of its middle, and up from the wrist.
HAND = (
    (-3, 0), (-3.4, 3), (-5.4, 5.4), (-7, 8.4), (-6.2, 9.2), (-4, 7), (-3.6, 10), (-3.8, 15.5), (-2.8, 16), (-2, 10.8),
    (-1.2, 17.6), (0, 18), (0.4, 10.8), (1.6, 16.6), (2.6, 16.4), (2.4, 10.2), (3.8, 13.8), (4.7, 13.4), (3.9, 8.4),
    (3.6, 4), (3, 0),
)  # fmt: skip

#: Pixels of a side below which nothing is drawn.
SMALLEST = 32

WHITE, BLACK, SHADE = 0xFFFFFFFF, 0xFF000000, 0xB0181818


def viewport_panel(state: WindowState) -> None:
    """Draw the picture in the whole window, and its overlays."""
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    scale = imgui.get_io().display_framebuffer_scale
    pixels = int(room.x * scale.x), int(room.y * scale.y)
    if min(pixels) < SMALLEST:
        return  # panels have no places yet: a model would be framed for a viewport that nobody sees
    state.more = state.draw(pixels)
    if imgui.is_window_docked():
        # Behind all panels, where this one is transparent: on a software rasterizer imgui takes long for pictures.
        bottom = imgui.get_io().display_size.y - corner.y - room.y
        state.view.show_in((round(corner.x * scale.x), round(bottom * scale.y), *pixels))
    else:
        texture = state.view.viewport.texture
        imgui.image(imgui.ImTextureRef(texture.glo), room, ImVec2(0, 1), ImVec2(1, 0))
        imgui.set_cursor_screen_pos(corner)
    taken = gizmos(state, corner, room)
    buttons = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_right
    if taken:
        imgui.dummy(room)  # a gizmo takes no click on an item
    else:
        imgui.invisible_button("##viewport", room, buttons | imgui.ButtonFlags_.mouse_button_middle)
    mouse = imgui.get_io().mouse_pos
    position = (mouse.x - corner.x) / room.x, (mouse.y - corner.y) / room.y
    if accepts_preset():
        state.drop_preset(state.dragged, position)
    state.hovered = None
    if not taken:
        _mouse(state, position, room)
    over = imgui.get_window_draw_list()
    over.push_clip_rect(corner, ImVec2(corner.x + room.x, corner.y + room.y), True)
    _selected(state, over, corner, room)
    _lights(state, over, corner, room)
    _split(state, over, corner, room)
    _scale(state, over, corner, room)
    _ruler(state, over, corner, room)
    _inset(state, over, corner, room)
    _probe(state, over, corner, room)
    _status(state, over, corner, room)
    over.pop_clip_rect()


def _mouse(state: WindowState, position: tuple[float, float], room: ImVec2) -> None:
    """Act on the mouse, at a position in fractions of the viewport."""
    io = imgui.get_io()
    begin_drag(state)
    if imgui.is_item_activated():
        state.pressed_at = position
    if imgui.is_item_active() and (io.mouse_delta.x or io.mouse_delta.y):
        right, down = io.mouse_delta.x, io.mouse_delta.y
        turning = imgui.is_mouse_dragging(0, 0.0)
        split = state.get("display.split") if state.get("display.compare") != "off" else None
        near = split is not None and abs(state.pressed_at[0] - split) * room.x < em(0.7)
        if split is not None and turning and (state.dragging_split or near):
            state.dragging_split = True
            state.change("display.split", min(max(position[0], 0.0), 1.0))
        elif turning and imgui.is_key_down(imgui.Key.l):
            state.turn_light(180.0 * right / room.x, -180.0 * down / room.y)
        elif turning and imgui.is_key_down(imgui.Key.e):
            state.change("look.rotation", math.remainder(state.get("look.rotation") + DEGREES * right / room.x, 360.0))
        elif turning and not io.key_shift:
            state.work.do(OrbitBy(-DEGREES * right / room.x, DEGREES * down / room.x))
        else:
            state.work.do(Pan(right / room.y, down / room.y))
    if not imgui.is_mouse_down(0):
        state.dragging_split = False
    if imgui.is_item_hovered() and io.mouse_wheel:
        state.work.do(Zoom(WHEEL**io.mouse_wheel, (position[0] - 0.5) * room.x / room.y, position[1] - 0.5))
    moved = (position[0] - state.pressed_at[0]) * room.x, (position[1] - state.pressed_at[1]) * room.y
    if imgui.is_item_deactivated() and math.hypot(*moved) < em(0.3):
        state.pick(position, state.select)
    state.hovered = None
    if imgui.is_item_hovered() and not imgui.is_any_mouse_down():
        state.hovered = position


def _selected(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    """Draw the corners of the selected object's box, and its name."""
    orbit = state.work.document.orbit
    if state.target is None or orbit is None or state.target in state.work.document.hidden:
        return
    item, camera = state.objects[state.target], camera_of(orbit)
    places = on_screen(camera, item.bounds, (room.x, room.y))
    if places is None:
        return
    low, high = places.min(axis=0), places.max(axis=0)
    side = em(0.9)
    for x, right in ((low[0], 1.0), (high[0], -1.0)):
        for y, down in ((low[1], 1.0), (high[1], -1.0)):
            at = ImVec2(corner.x + x, corner.y + y)
            for color, wide in ((BLACK, 0.25), (WHITE, 0.1)):
                over.add_line(at, ImVec2(at.x + right * side, at.y), color, em(wide))
                over.add_line(at, ImVec2(at.x, at.y + down * side), color, em(wide))
    _label(over, ImVec2(corner.x + low[0], corner.y + low[1] - em(1.4)), state.name_of(state.target))


def _lights(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    """Draw the places of the lights that the user has added, with the sizes of their spheres."""
    orbit = state.work.document.orbit
    if orbit is None:
        return
    camera = camera_of(orbit)
    for number, light in enumerate(state.work.document.lights):
        points = np.array([light.position, np.asarray(light.position) + max(light.radius, 1e-9) * camera.up])
        if (places := places_on_screen(camera, points, (room.x, room.y))) is None:
            continue
        at = ImVec2(corner.x + places[0, 0], corner.y + places[0, 1])
        radius = max(float(np.hypot(*(places[1] - places[0]))), em(0.3))
        for color, wide in ((BLACK, 0.25), (WHITE, 0.1)):
            over.add_circle(at, radius, color, 0, em(wide))
        _label(over, ImVec2(at.x + radius + em(0.4), at.y - em(0.5)), f"light {number + 1}")


def on_screen(camera: Camera, bounds: Array, size: tuple[float, float]) -> Array | None:
    """Places (8, 2) of a box's corners in a picture, right and down in pixels; None if one is behind the camera."""
    corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return places_on_screen(camera, corners, size)


def places_on_screen(camera: Camera, points: Array, size: tuple[float, float]) -> Array | None:
    """Places (n, 2) of points (n, 3) in a picture, right and down in pixels; None if one is behind the camera."""
    local = (points - camera.eye) @ np.stack([camera.right, camera.up, camera.forward], axis=1)
    half = np.array(camera.half_extent((max(int(size[0]), 1), max(int(size[1]), 1))))
    if camera.fov_y is not None:
        if local[:, 2].min() <= 0.0:
            return None
        half = half * local[:, 2:]
    return np.asarray((local[:, :2] / half * (1.0, -1.0) + 1.0) / 2.0 * size)


def _split(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    display = state.work.document.display
    if display.compare == "off":
        return
    x = corner.x + display.split * room.x
    for color, wide in ((BLACK, 0.12), (WHITE, 0.0)):  # seen on every background
        over.add_line(ImVec2(x, corner.y), ImVec2(x, corner.y + room.y), color, em(0.1 + wide))
        over.add_circle_filled(ImVec2(x, corner.y + 0.5 * room.y), em(0.45 + 0.5 * wide), color)
    plans = state.view.plans
    left = type(plans[0].method).__name__ if plans[0] is not None else display.method
    right = {"reference": "float64 reference", "error": "thickness minus the reference"}
    right |= {"method": display.method_b, "snapshot": f"snapshot {display.snapshot}"}
    name = right[display.compare]
    if display.compare == "snapshot":
        left = "now"
        if state.work.document.snapshot(display.snapshot) is None:
            name = "no snapshot; store a snapshot with Shift 1"
    if display.compare == "method" and plans[1] is not None:
        name = type(plans[1].method).__name__
    if display.compare in ("reference", "error"):
        truth = state.work.truth
        if state.view.presenter.truth is None:
            name += ": being drawn ..."
        elif truth is not None and truth.level > 1:
            name += f", 1/{truth.level} so far"
    top = corner.y + em(0.4)
    width = imgui.calc_text_size(left).x
    if x - corner.x > width + em(1.2):  # a side that is too narrow for its name has none
        _label(over, ImVec2(x - width - em(0.8), top), left)
    if corner.x + room.x - x > imgui.calc_text_size(name).x + em(1.2):
        _label(over, ImVec2(x + em(0.8), top), name)
    if display.compare == "error" and state.view.presenter.truth is not None:
        _error_scale(state, over, ImVec2(corner.x + room.x, corner.y + room.y))


def _error_scale(state: WindowState, over: imgui.ImDrawList, end: ImVec2) -> None:
    """Draw the scale of differences of thickness in the lower right corner."""
    unit = state.get("display.unit")
    most = worst(state.work) / metres_per_unit(unit)
    width, height, line = em(18.0), em(0.8), imgui.get_text_line_height()
    left, top = end.x - width - em(1.4), end.y - em(1.6) - height - line
    over.add_rect_filled(ImVec2(left - em(0.6), top - 1.3 * line), ImVec2(end.x - em(0.6), end.y - em(0.7)), SHADE)
    over.add_text(ImVec2(left, top - 1.2 * line), WHITE, f"error of thickness, {unit}; orange: invalid")
    _color_bar(over, left, top, width, [error_color(2.0 * (i + 0.5) / 48 - 1.0) for i in range(48)])
    for fraction, text in ((0.0, f"-{most:.2g}"), (0.5, "0"), (1.0, f"+{most:.2g}")):
        wide = imgui.calc_text_size(text).x
        over.add_text(ImVec2(left + fraction * (width - wide), top + height), WHITE, text)


def _color_bar(
    over: imgui.ImDrawList, left: float, top: float, width: float, colors: Sequence[Sequence[float]]
) -> None:
    for i, color in enumerate(colors):
        begin, end = left + width * i / len(colors), left + width * (i + 1) / len(colors)
        over.add_rect_filled(ImVec2(begin, top), ImVec2(end + 1.0, top + em(0.8)), packed(color))


def error_color(fraction: float) -> tuple[float, float, float]:
    """sRGB color of a difference of thickness, -1 to 1 of the largest, as ``present/compare.frag`` shows it."""
    end = THINNER if fraction < 0.0 else THICKER
    mixed = math.sqrt(min(abs(fraction), 1.0))
    red, green, blue = (0.95 + mixed * (channel - 0.95) for channel in end)
    return red, green, blue


def _ruler(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    """Draw a ruler before the model, on the ground, and a coin or a hand beside it."""
    orbit, loaded = state.work.document.orbit, state.work.loaded
    if not state.get("display.ruler") or orbit is None or loaded is None:
        return
    low, high = loaded.scene.shown_bounds
    camera, wide = camera_of(orbit), float(high[0] - low[0])
    step, count = ruler(wide)
    y, z = low[1], high[2]
    ends = low[0] + step * np.arange(count + 1)
    marks_on = np.stack([ends, np.full(count + 1, y), np.full(count + 1, z)], axis=1)
    inner = marks_on - (0.0, 0.0, 0.05 * wide)
    _drawn_lines(over, camera, corner, room, np.stack([marks_on[[0, -1]], *np.stack([marks_on, inner], axis=1)]))
    places = places_on_screen(camera, marks_on, (room.x, room.y))
    if places is not None:
        text = f"{short_length(step * count)}, {short_length(step)} apart"
        right = corner.x + places[-1, 0] - imgui.calc_text_size(text).x
        _label(over, ImVec2(right, corner.y + places[-1, 1] + em(0.5)), text)
    name, outline = reference_outline(wide)
    around = outline + (low[0] + 0.35 * wide, y, z + 0.1 * wide - outline[:, 2].min())
    _drawn_lines(over, camera, corner, room, np.stack([around, np.roll(around, -1, axis=0)], axis=1))
    places = places_on_screen(camera, around, (room.x, room.y))
    if places is not None:
        _label(over, ImVec2(corner.x + places[:, 0].min(), corner.y + places[:, 1].max() + em(0.3)), name)


def _drawn_lines(over: imgui.ImDrawList, camera: Camera, corner: ImVec2, room: ImVec2, ends: Array) -> None:
    """Draw lines (n, 2, 3) of the world, in white on black."""
    places = places_on_screen(camera, ends.reshape(-1, 3), (room.x, room.y))
    if places is None:
        return
    for color, wide in ((BLACK, 0.25), (WHITE, 0.1)):
        for (x0, y0), (x1, y1) in places.reshape(-1, 2, 2).tolist():
            begin, end = ImVec2(corner.x + x0, corner.y + y0), ImVec2(corner.x + x1, corner.y + y1)
            over.add_line(begin, end, color, em(wide))


def ruler(wide: float) -> tuple[float, int]:
    """Distance of the marks of a ruler for a model so wide, in metres, and their number: steps of 1, 2 or 5."""
    least = max(wide, 1e-9) / 10.0
    power = 10.0 ** math.floor(math.log10(least))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least * (1 - 1e-9))
    return step, max(round(wide / step), 1)


def reference_outline(wide: float) -> tuple[str, Array]:
    """Name and outline (n, 3) on the ground of a thing of known size: a coin, or for models past it a hand."""
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    if wide < HAND_FROM:
        return "coin, 24 mm", 0.5 * COIN * np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=1)
    x, y = (0.01 * np.array(HAND)).T
    return "hand, 18 cm", np.stack([x, 0.0 * x, -y], axis=1)


def _scale(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    """Draw the scale of false colors with lengths, or the legend of validity."""
    display = state.work.document.display
    if display.mode not in ("thickness", "validity"):
        return
    left, bottom = corner.x + em(1.0), corner.y + room.y - em(1.0)
    if display.mode == "validity":
        _label(over, ImVec2(left, bottom - em(1.4)), "blue: valid    orange: not valid    dimmed: no medium")
        return
    width, height = min(em(18.0), room.x - em(2.0)), em(0.8)
    top = bottom - height - em(1.5)
    over.add_rect_filled(ImVec2(left - em(0.6), top - em(2.0)), ImVec2(left + width + em(0.9), bottom + em(0.3)), SHADE)
    over.add_text(ImVec2(left, top - em(1.6)), WHITE, f"thickness, {display.unit}")
    colors = false_colors()
    _color_bar(over, left, top, width, [(colors[round(i * 255 / 63)] / 255.0).tolist() for i in range(64)])
    most = thickest(state.work) / metres_per_unit(display.unit)
    free = left - em(1.0)
    for value in marks(most):
        text = f"{value:.4g}"
        half = 0.5 * imgui.calc_text_size(text).x
        x = left + width * value / most
        over.add_line(ImVec2(x, top + height), ImVec2(x, top + height + em(0.25)), WHITE)
        if x - half > free:
            over.add_text(ImVec2(x - half, top + height + em(0.2)), WHITE, text)
            free = x + half + em(0.4)


def _inset(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    """Draw the float64 reference as a small picture in the corner, if it is of this scene."""
    measured = state.work.measured
    if not state.get("display.inset") or measured is None or measured.scene is not state.work.scene():
        return
    texture = state.texture("inset", measured.truth)
    width = min(em(14.0), 0.3 * room.x)
    height = width * texture.height / texture.width
    low = ImVec2(corner.x + room.x - width - em(0.6), corner.y + room.y - height - em(0.6))
    high = ImVec2(low.x + width, low.y + height)
    over.add_image(imgui.ImTextureRef(texture.glo), low, high)
    over.add_rect(low, high, WHITE)
    text = "reference, straight rays"
    if measured.errors:
        text += f"; error {length_text(measured.errors[0].median, state.get('display.unit'))}"
    _label(over, ImVec2(min(low.x, high.x - imgui.calc_text_size(text).x - em(0.6)), low.y - em(1.5)), text)


def _probe(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    position = state.hovered or state.pinned
    if position is None:
        return
    lines = probe_lines(state, position)
    if not lines:
        return
    x, y = corner.x + position[0] * room.x, corner.y + position[1] * room.y
    width = max(imgui.calc_text_size(line).x for line in lines) + em(1.0)
    height = imgui.get_text_line_height_with_spacing() * len(lines) + em(0.6)
    left = x + em(1.2) if x + em(1.2) + width < corner.x + room.x else max(x - em(1.2) - width, corner.x)
    top = min(max(y + em(0.6), corner.y), corner.y + room.y - height)
    over.add_circle(ImVec2(x, y), em(0.3), WHITE)
    over.add_rect_filled(ImVec2(left, top), ImVec2(left + width, top + height), 0xD8181818, em(0.2))
    for i, line in enumerate(lines):
        at = top + em(0.3) + i * imgui.get_text_line_height_with_spacing()
        over.add_text(ImVec2(left + em(0.5), at), WHITE, line)


def probe_lines(state: WindowState, position: tuple[float, float]) -> list[str]:
    """Lines about a probed pixel: values of the frame on show, and of the float64 reference when they are there."""
    scene, viewport = state.work.scene(), state.view.viewport
    if scene is None:
        return []
    pixel = pixel_at(position, viewport.size)
    display = state.work.document.display
    right = display.compare == "method" and position[0] > display.split
    probe = state.view.probe(*pixel, 1 if right else 0)
    probed = state.probed
    if probed is None or probed.pixel != pixel or probed.scene is not scene:
        probed = state.probed = ProbedPixel(pixel, scene)
    if probe is None:
        return []
    known = probed.crossing
    if known is None and not probed.requested and state.work.lanes["ray"].task is None:
        probed.requested = True
        state.work.cross(scene, viewport.size, pixel, partial(setattr, probed, "crossing"))
    if not probe.covered and probe.valid:
        return ["no medium"]
    with np.errstate(under="ignore"):
        passed = np.exp(-np.asarray(probe.optical_depth))
    plan = state.view.plans[1 if right else 0]
    why = "; ".join(plan.limits) if plan is not None and plan.limits else "entries and exits of its ray differ"
    lines = [
        f"thickness {length_text(probe.thickness, display.unit)}",
        f"sigma_t d {triple_text(probe.optical_depth)}",
        f"T {triple_text(passed)}",
        "valid" if probe.valid else f"not valid: {why}",
    ]
    if known is not None:
        lines.insert(1, f"reference {length_text(known.thickness, display.unit)}, {known.layers} layers")
        if known.body is not None:
            lines.insert(0, scene.objects[known.body].mesh.name)
    return lines


def _status(state: WindowState, over: imgui.ImDrawList, corner: ImVec2, room: ImVec2) -> None:
    """Draw the status: why the picture is incomplete or simpler, and work under way."""
    y = corner.y + em(0.4) + (em(1.8) if state.get("display.compare") != "off" else 0.0)
    slow = [task.progress for task in state.work.busy if task.name and task.seconds > 1.0]
    for text in (*state.view.notes, *slow):
        y += _label(over, ImVec2(corner.x + em(0.6), y), text, room.x - em(2.0)) + em(0.5)


def _label(over: imgui.ImDrawList, at: ImVec2, text: str, width: float = 0.0) -> float:
    """Draw a text on a dark ground, wrapped at a width unless that is 0, and return its height."""
    size = imgui.calc_text_size(text, False, width)
    low, high = ImVec2(at.x - em(0.25), at.y - em(0.1)), ImVec2(at.x + size.x + em(0.25), at.y + size.y + em(0.1))
    over.add_rect_filled(low, high, SHADE, em(0.15))
    over.add_text(imgui.get_font(), imgui.get_font_size(), at, WHITE, text, width)
    return size.y
