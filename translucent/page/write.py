"""Pages: one HTML file with the viewer's script, the scene, and a poster for the time until both are ready."""

from __future__ import annotations

import base64
import gzip
import html
import io
import os
from dataclasses import replace
from pathlib import Path

from translucent.arguments import brief, checked_but
from translucent.arrays import Pixels
from translucent.assets import web_path
from translucent.errors import InputError
from translucent.files.paths import require_output, write_text_atomically
from translucent.formulas.tone import tone_curve
from translucent.frames.frame import Frame, check_exposure
from translucent.page.payload import name_of, payload
from translucent.page.plans import PagePlan, plan_page
from translucent.planning.interfaces import InterfaceMode
from translucent.planning.methods import Method
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import Scattering
from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene.camera import check_size
from translucent.scene.scene import Scene
from translucent.version import VERSION

_TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="translucent {version}">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; img-src data:">
<title>{title}</title>
<style>
html, body {{ margin: 0; height: 100%; background: #131416; }}
#viewer {{ position: fixed; inset: 0; height: 100dvh; }}
#viewer > img {{ width: 100%; height: 100%; object-fit: contain; }}
#viewer > .failed, noscript {{ position: absolute; left: 0; right: 0; bottom: 24px; text-align: center; color: #f0f1f3;
  font: 14px system-ui, sans-serif; }}
</style>
</head>
<body>
<div id="viewer">{poster}<noscript>This page needs JavaScript to show its scene.</noscript></div>
<script type="text/plain" id="scene">{scene}</script>
<script type="text/plain" id="viewer-script">{script}</script>
<script>{start}</script>
</body>
</html>
"""

#: Unpacks the viewer's script and runs it. `translucent` is a promise of the viewer, before the script runs and after.
_START = """
window.translucent = (async () => {
  try {
    if (typeof DecompressionStream === "undefined") {
      throw new Error("this browser cannot unpack it (no DecompressionStream): use one from 2023 or later");
    }
    const packed = atob(document.getElementById("viewer-script").textContent);
    const bytes = Uint8Array.from(packed, (one) => one.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.body.append(script);
  } catch (error) {
    const failure = document.createElement("p");
    failure.className = "failed";
    failure.textContent = `This page cannot show its scene: ${error.message}.`;
    document.getElementById("viewer").append(failure);
    console.warn(`translucent: ${error.message}`);
    return undefined;
  }
  return window.translucent;
})();
"""

#: Samples of a pixel that pages add up at rest, as `translucent render` does; those of posters; and the most.
SAMPLES, POSTER_SAMPLES, MOST_SAMPLES = 16, 4, 256

#: Pixels along a side that a page may frame: its poster has as many.
MOST_SIDE = 8192


@checked_but("scene", "size", "method", "interfaces", "scattering", "shadows", "tone", "samples")
def write_page(
    scene: Scene,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] = (1280, 800),
    method: Method | None = None,
    interfaces: InterfaceMode | None = None,
    scattering: Scattering | None = None,
    shadows: ShadowMaps | None = None,
    name: str | None = None,
    exposure: float = 0.0,
    tone: str = "neutral",
    samples: int = SAMPLES,
    poster: bytes | None = None,
) -> PagePlan:
    """Write a page that shows a scene in any browser with WebGL2: one file, which fetches nothing.

    Parameters
    ----------
    scene : Scene
    path : str or PathLike
        An .html file.
    size : (width, height)
        Of the picture that the scene's camera frames.
    method, interfaces, scattering, shadows : optional
        As for `Renderer.render`.
    name : str, optional
        Title of the page. Default: the name of the first body.
    exposure : float
        Stops brighter.
    tone : {"none", "neutral", "agx"}
        Tone curve.
    samples : int
        Of each pixel that are added up while nothing moves.
    poster : bytes, optional
        A picture, PNG, JPEG or WebP, that is there until the scene is.

    Returns
    -------
    PagePlan
        With notes of what the page leaves out.

    Raises
    ------
    InputError
        If WebGL2 cannot draw the scene, or not by what was requested; if the path is no .html file, or nothing can be
        written there.
    """
    file = Path(path)
    check_output(file)
    size = check_page_size(size)
    planned = plan_page(scene, RenderRequest(method, interfaces=interfaces, scattering=scattering, shadows=shadows))
    picture = None if poster is None else check_poster(poster, "poster")
    text = page_html(planned, name or title_of(scene), size, samples, exposure, tone, picture)
    write_text_atomically(file, text)
    return planned


def check_output(path: Path) -> None:
    """Raise `InputError` before any work is done if no page can be written to the path, or its viewer was not built."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"page {str(path)!r}", "the name must end in .html", "choose a name such as viewer.html")
    require_output(path, f"page {str(path)!r}")
    web_path("page.js")


def check_page_size(size: tuple[int, int]) -> tuple[int, int]:
    """`size` as two ints; raises `InputError` if a page cannot frame so many pixels."""
    width, height = check_size(size)
    if max(width, height) > MOST_SIDE:
        requested = f"a page that frames {width}x{height} pixels"
        raise InputError(
            requested,
            f"the poster has more than {MOST_SIDE} pixels along a side",
            "use a size such as 1280x800: the page fits any window",
        )
    return width, height


def page_html(
    planned: PagePlan,
    name: str,
    size: tuple[int, int],
    samples: int = SAMPLES,
    exposure: float = 0.0,
    tone: str = "neutral",
    poster: bytes | None = None,
) -> str:
    """Text of a page; see `write_page`."""
    check_page_size(size)
    check_exposure(exposure)
    tone_curve(tone)
    if not isinstance(name, str):
        raise InputError(
            f"name {brief(name)}", "the title is not a text", "give the title of the page, for example 'Wine'"
        )
    if not isinstance(samples, int) or not 1 <= samples <= MOST_SAMPLES:
        raise InputError(
            f"samples {brief(samples)}",
            f"the number of samples must be a whole number in 1 to {MOST_SAMPLES}",
            "use a value such as 16",
        )
    name = name.encode("utf-8", "replace").decode()  # a name of a file may hold what is no character
    script = gzip.compress(web_path("page.js").read_bytes(), 9, mtime=0)
    data = payload(planned, name, size, samples, exposure, tone, albedos=True)
    picture = "" if poster is None else f'<img alt="" src="{_data_url(poster)}">'
    return _TEMPLATE.format(
        version=VERSION,
        title=html.escape(name),
        poster=picture,
        scene=base64.b64encode(data).decode("ascii"),
        script=base64.b64encode(script).decode("ascii"),
        start=_START,
    )


def title_of(scene: Scene) -> str:
    """Title of a page: the name of the first body, without the suffix of its file."""
    mesh = scene.bodies[0].mesh if scene.bodies else scene.objects[0].mesh
    return name_of(mesh) or "scene"


def poster_of(planned: PagePlan, size: tuple[int, int], exposure: float, tone: str) -> bytes:
    """Picture of a scene as its page will show it, as JPEG.

    Raises
    ------
    RenderError
        If nothing can render here.
    """
    from translucent.renderer import Renderer

    with Renderer() as renderer:
        frame = renderer.render_requested(planned.scene, size, replace(planned.request, samples=POSTER_SAMPLES))
    return jpeg(frame.to_srgb8(exposure, tone))


def jpeg(pixels: Pixels) -> bytes:
    """JPEG of pixels (h, w, 3)."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "JPEG", quality=88)
    return stream.getvalue()


def check_poster(picture: bytes, requested: str) -> bytes:
    """The picture; raises `InputError` if browsers show no such file."""
    _kind(picture, requested)
    return picture


def _data_url(picture: bytes) -> str:
    return f"data:image/{_kind(picture, 'poster')};base64,{base64.b64encode(picture).decode('ascii')}"


def _kind(picture: bytes, requested: str) -> str:
    for head, kind in {b"\x89PNG": "png", b"\xff\xd8\xff": "jpeg", b"RIFF": "webp"}.items():
        if picture.startswith(head):
            return kind
    raise InputError(
        requested, "the poster is not a PNG, JPEG or WebP picture", "use a picture in one of these formats"
    )


def frame_html(frame: Frame, exposure: float, tone: str, name: str | None) -> str:
    """Text of a page; see `Frame.to_html`."""
    requested = f"a page of {frame!r}"
    scene, request = frame.scene, frame.plan.request
    if scene is None:
        found = "the frame has no scene, because it was rendered in front of a backdrop, or made by hand"
        raise InputError(requested, found, "write a page of the whole scene: tl.write_page(scene, 'viewer.html')")
    if request.caustics is not None:
        raise InputError(
            requested,
            "the scene has caustics, which pages cannot show because WebGL2 has no photons",
            "render without caustics",
        )
    planned = plan_page(scene, request)
    poster = jpeg(frame.to_srgb8(exposure, tone)) if frame.alpha is None else None
    return page_html(planned, name or title_of(scene), frame.size, exposure=exposure, tone=tone, poster=poster)
