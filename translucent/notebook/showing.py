"""Scenes as notebooks show them: a small picture where it is quick to make, and what is in the scene, in words."""

from __future__ import annotations

import atexit
import time
from functools import lru_cache
from weakref import WeakKeyDictionary

from translucent.errors import TranslucentError
from translucent.formulas.color import to_hex
from translucent.frames.writing import Bundle, bundle, png
from translucent.renderer import Renderer
from translucent.scene.scene import Object, Scene
from translucent.units import length_text

#: Size of the picture of a scene, and samples of each pixel.
SIZE, SAMPLES = (240, 180), 1

#: Triangles from which on a scene is not drawn unasked, and objects that are named.
MANY_TRIANGLES, MOST_NAMES = 500_000, 6

#: What was shown of a scene, so that it is drawn once.
_SHOWN: WeakKeyDictionary[Scene, Bundle] = WeakKeyDictionary()


def scene_bundle(scene: Scene) -> Bundle:
    """Picture and contents of a scene, as HTML, PNG and text; the picture is left out where it would take long."""
    if scene not in _SHOWN:
        _SHOWN[scene] = _bundle(scene)
    return _SHOWN[scene]


def _bundle(scene: Scene) -> Bundle:
    lines = [repr(scene), *_contents(scene), _view(scene)]
    if why := _takes_long(scene):
        lines.append(f"Not drawn here, since {why}: renderer.render(scene, size) does.")
        return bundle([], lines, "\n".join(lines))
    began = time.perf_counter()
    try:
        frame = _renderer().render(scene, SIZE, samples=SAMPLES)
    except TranslucentError as error:
        lines.append(f"Not drawn here: {error}")
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
    """Reason why a scene is not drawn unasked; nothing if it is."""
    faces = sum(len(item.mesh.faces) for item in scene.objects)
    if faces > MANY_TRIANGLES:
        return f"it has {faces / 1e6:.1f} million triangles"
    if scene.varies:
        return "the density of a medium varies"
    return ""


def _contents(scene: Scene) -> list[str]:
    """Lines about the objects of a scene."""
    told = [_object_text(item) for item in scene.objects[:MOST_NAMES]]
    more = len(scene.objects) - len(told)
    return [*told, f"and {more} more objects"] if more else told


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
