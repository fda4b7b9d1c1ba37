"""Scenes in notebooks: a small picture with a summary in words, and the viewer of `translucent page` as a widget."""

from __future__ import annotations

import atexit
import time
from functools import lru_cache
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from translucent.arguments import checked_but
from translucent.assets import web_path
from translucent.errors import InputError, RenderError, TranslucentError
from translucent.extras import install_command, require_package
from translucent.formulas.color import to_hex
from translucent.frames.writing import Bundle, bundle, png
from translucent.page.container import header_of
from translucent.page.payload import payload
from translucent.page.plans import plan_page
from translucent.planning.interfaces import InterfaceMode
from translucent.planning.methods import Method
from translucent.planning.request import RenderRequest
from translucent.renderer import Renderer
from translucent.scene.camera import check_size
from translucent.scene.scene import Object, Scene
from translucent.units import length_text, size_note

if TYPE_CHECKING:
    from translucent.notebook.widget import SceneView


#: Size of the picture of a scene, and samples of each pixel.
SIZE, SAMPLES = (240, 180), 1

#: Triangles from which on a scene is not drawn unasked, and objects that are named.
MANY_TRIANGLES, MOST_NAMES = 500_000, 6

#: Views of scenes, so that each is drawn once.
_SHOWN: WeakKeyDictionary[Scene, Bundle] = WeakKeyDictionary()


def scene_bundle(scene: Scene) -> Bundle:
    """Picture and contents of a scene, as HTML, PNG and text; the picture is left out where it would take long."""
    if scene not in _SHOWN:
        _SHOWN[scene] = _bundle(scene)
    return _SHOWN[scene]


def _bundle(scene: Scene) -> Bundle:
    sizes = dict.fromkeys(size_note(item.mesh, way="argument") for item in scene.shown)
    lines = [repr(scene), *_contents(scene), *filter(None, sizes), _view(scene)]
    if why := _takes_long(scene):
        lines.append(f"No picture, because {why}; use renderer.render(scene, size).")
        return bundle([], lines, "\n".join(lines))
    began = time.perf_counter()
    try:
        frame = _renderer().render(scene, SIZE, samples=SAMPLES)
    except TranslucentError as error:
        lines.append(f"No picture: {error}")
        return bundle([], lines, "\n".join(lines))
    took = time.perf_counter() - began
    drawn = f"{SIZE[0]} x {SIZE[1]} pixels, {SAMPLES} sample, drawn in {took:.1f} s by {frame.provenance['backend']}"
    picture = png(frame.to_srgb8(tone="neutral"))
    return bundle([(picture, f"Small picture of a scene. {'. '.join(lines[1:])}.")], [*lines, drawn], "\n".join(lines))


@lru_cache(maxsize=1)
def _renderer() -> Renderer:
    """Renderer of the pictures of all scenes, which makes its shaders once."""
    renderer = Renderer()
    atexit.register(renderer.close)
    return renderer


def _takes_long(scene: Scene) -> str:
    """Reason why a scene is not drawn automatically; empty if it is drawn."""
    faces = sum(len(item.mesh.faces) for item in scene.objects)
    if faces > MANY_TRIANGLES:
        return f"it has {faces / 1e6:.1f} million triangles"
    if scene.varies:
        return "the density of a medium varies"
    return ""


def _contents(scene: Scene) -> list[str]:
    """Lines about the objects of a scene."""
    values = [_object_text(item) for item in scene.objects[:MOST_NAMES]]
    more = len(scene.objects) - len(values)
    return [*values, f"and {more} more objects"] if more else values


def _object_text(item: Object) -> str:
    if item.medium is None:
        return f"{item.mesh.name}: opaque"
    if item.sheet_thickness is not None:
        passed = to_hex(item.medium.transmittance(item.sheet_thickness))
        return f"{item.mesh.name}: a sheet of {length_text(item.sheet_thickness)}, white light is {passed} behind it"
    reach = item.mean_thickness
    kinds = [word for word, has in (("scatters", item.medium.scatters), ("glows", item.medium.emits)) if has]
    passed = to_hex(item.medium.transmittance(reach))
    text = f"{item.mesh.name}: white light is {passed} after {length_text(reach)}, ior {item.medium.ior:g}"
    return ", ".join([text, *kinds])


def _view(scene: Scene) -> str:
    camera = scene.camera
    eye = ", ".join(f"{value:.3g}" for value in camera.eye)
    if camera.fov_y is None:
        return f"Seen from ({eye}) m, {length_text(camera.height or 0.0)} high"
    return f"Seen from ({eye}) m, {camera.fov_y:g} degrees high"


#: Samples of each pixel that the viewer adds up at rest.
VIEW_SAMPLES = 8


@checked_but("scene", "size", "method", "interfaces", "tone")
def view(
    scene: Scene,
    size: tuple[int, int] = (640, 480),
    *,
    method: Method | None = None,
    interfaces: InterfaceMode | None = None,
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
        in Python (``observe`` reports when). ``medium`` chooses which of ``media`` they are of, and ``scene`` is the
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
        raise InputError("tl.view", "the Python package anywidget is not installed", do) from None
    from translucent.notebook.widget import SceneView

    planned = plan_page(scene, RenderRequest(method, interfaces=interfaces))
    mesh = (scene.bodies or scene.objects)[0].mesh
    data = payload(planned, mesh.name, check_size(size), VIEW_SAMPLES, exposure, tone)
    values = header_of(data)["scene"]["media"]
    return SceneView(planned, data, script.read_text(encoding="utf-8"), values, size[1])
