"""The messages panel, the latest first."""

from __future__ import annotations

from imgui_bundle import imgui

from translucent.preview.desk import ERROR, FAINT, WARNING, Desk, wrapped

COLORS = {"info": FAINT, "warning": WARNING, "error": ERROR}


def messages_panel(desk: Desk) -> None:
    """Draw the panel."""
    for text in (desk.stage.problem, desk.stage.shader_problem):
        if text:
            wrapped(text, ERROR)
    if not desk.work.messages:
        imgui.text_colored(FAINT, "Drop a model here: .glb .gltf .obj .stl .ply")
    for message in reversed(desk.work.messages):
        wrapped(message.text, COLORS[message.kind])
