"""Pages: one HTML file with the viewer's script, the scene, and a poster for the time until both are ready."""

from __future__ import annotations

import base64
import html
import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

from translucent.assets import web_path
from translucent.errors import InputError, TranslucentError
from translucent.files.paths import write_text_atomically
from translucent.page.payload import payload
from translucent.page.plans import PagePlan, plan_page
from translucent.planning.interfaces import Interfaces
from translucent.planning.methods import Method
from translucent.planning.scattering import Scattering
from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene.camera import check_size
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from translucent.renderer import Renderer

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
<script>{script}</script>
</body>
</html>
"""

#: Samples of a pixel that pages add up at rest, as `translucent render` does.
SAMPLES = 16


def write_page(
    scene: Scene,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] = (1280, 800),
    method: Method | None = None,
    interfaces: Interfaces | None = None,
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
        If WebGL2 cannot draw the scene, or not by what was asked for; if the path is no .html file, or nothing can be
        written there.
    """
    file = Path(path)
    if file.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"page {str(file)!r}", "not an .html file", "name it for example viewer.html")
    planned = plan_page(scene, method, interfaces=interfaces, scattering=scattering, shadows=shadows)
    text = page_html(planned, name or title_of(scene), check_size(size), samples, exposure, tone, poster)
    write_text_atomically(file, text)
    return planned


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
    from translucent.version import VERSION

    script = web_path("page.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    data = payload(planned, name, size, samples, exposure, tone)
    picture = "" if poster is None else f'<img alt="" src="{_data_url(poster)}">'
    return _TEMPLATE.format(
        version=VERSION,
        title=html.escape(name),
        poster=picture,
        scene=base64.b64encode(data).decode("ascii"),
        script=script,
    )


def title_of(scene: Scene) -> str:
    """Title of a page: the name of the first body, without that of its file's kind."""
    mesh = scene.bodies[0].mesh if scene.bodies else scene.objects[0].mesh
    return mesh.name.rpartition(".")[0] or mesh.name or "scene"


def poster_of(renderer: Renderer, planned: PagePlan, size: tuple[int, int], exposure: float, tone: str) -> bytes:
    """Picture of a scene as its page will show it, as JPEG."""
    from PIL import Image

    frame = renderer.render(
        planned.scene,
        size,
        planned.method,
        samples=SAMPLES,
        interfaces=planned.interfaces,
        scattering=planned.scattering,
        shadows=planned.shadows,
    )
    stream = io.BytesIO()
    Image.fromarray(frame.to_srgb8(exposure, tone)).save(stream, "JPEG", quality=88)
    return stream.getvalue()


def _data_url(picture: bytes) -> str:
    kinds = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpeg", b"RIFF": "webp"}
    for head, kind in kinds.items():
        if picture.startswith(head):
            return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"
    raise InputError("poster", "no PNG, JPEG or WebP picture", "give one of these")


__all__ = ["SAMPLES", "TranslucentError", "page_html", "poster_of", "title_of", "write_page"]
