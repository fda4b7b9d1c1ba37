"""Pages of frames: the scene of a frame, seen as the frame sees it."""

from __future__ import annotations

from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.page.plans import plan_page
from translucent.page.write import jpeg, page_html, title_of


def frame_html(frame: Frame, exposure: float, tone: str, name: str | None) -> str:
    """Text of a page; see `Frame.to_html`."""
    asked = f"a page of {frame!r}"
    scene, choices = frame.scene, frame.choices
    if scene is None:
        found = "it holds no scene: it was drawn before a backdrop, or put together by hand"
        raise InputError(asked, found, "write one of the whole scene: tl.write_page(scene, 'viewer.html')")
    if choices.caustics is not None:
        raise InputError(asked, "it has caustics, and WebGL2 has no photons", "render without caustics")
    planned = plan_page(
        scene,
        choices.method,
        interfaces=choices.interfaces,
        scattering=choices.scattering,
        shadows=choices.shadows,
    )
    poster = jpeg(frame.to_srgb8(exposure, tone)) if frame.alpha is None else None
    return page_html(planned, name or title_of(scene), frame.size, exposure=exposure, tone=tone, poster=poster)
