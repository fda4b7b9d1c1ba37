"""The viewer of `translucent page` in a notebook, as a widget whose material and camera are Python objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from translucent.assets import web_path
from translucent.errors import InputError, RenderError
from translucent.extras import install_command, require_package
from translucent.page.container import header_of
from translucent.page.payload import payload
from translucent.page.plans import plan_page
from translucent.planning.interfaces import Interfaces
from translucent.planning.methods import Method
from translucent.scene.camera import check_size
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from translucent.notebook.widget import SceneView

#: Samples of each pixel that the viewer adds up at rest.
SAMPLES = 8


def view(
    scene: Scene,
    size: tuple[int, int] = (640, 480),
    *,
    method: Method | None = None,
    interfaces: Interfaces | None = None,
    exposure: float = 0.0,
    tone: str = "neutral",
) -> SceneView:
    """Show a scene in a notebook, to turn and to change, by the viewer of `translucent page`.

    It works wherever anywidgets do: Jupyter, marimo, VS Code, Colab.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        Of the picture that the scene's camera frames. The view is as wide as its cell, and as high as this in CSS
        pixels.
    method, interfaces : optional
        As for `Renderer.render`.
    exposure : float
        Stops brighter.
    tone : {"none", "neutral", "agx"}
        Tone curve.

    Returns
    -------
    SceneView
        A widget. Its traits are the material of one medium, ``color``, ``distance``, ``ior``, ``roughness`` and
        ``preset``, and ``camera``, a `Camera`: set in Python they are seen in the viewer, and changed there they change
        in Python (``observe`` tells when). ``medium`` chooses which of ``media`` they are of, and ``scene`` is the
        scene as it is shown, to be rendered.

    Raises
    ------
    InputError
        If anywidget is not installed, or the viewer was not built; if WebGL2 cannot draw the scene.
    """
    script = web_path("widget.js")
    try:
        require_package("anywidget", "tl.view")
    except RenderError:
        do = f"{install_command('notebook')}, or write a page with tl.write_page"
        raise InputError("tl.view", "the package anywidget is not installed", do) from None
    from translucent.notebook.widget import SceneView

    planned = plan_page(scene, method, interfaces=interfaces)
    mesh = (scene.bodies or scene.objects)[0].mesh
    data = payload(planned, mesh.name, check_size(size), SAMPLES, exposure, tone)
    told = header_of(data)["scene"]["media"]
    return SceneView(scene, data, script.read_text(encoding="utf-8"), told, size[1])
