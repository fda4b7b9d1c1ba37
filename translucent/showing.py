"""The viewer that fits where it is called: a widget in a notebook, the previewer at a desk, a page elsewhere."""

from __future__ import annotations

import dataclasses
import os
import re
import subprocess
import sys
import tempfile
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from translucent.arguments import brief, checked
from translucent.assets import mesh_names, mesh_path
from translucent.errors import InputError, RenderError
from translucent.geometry.foreign import foreign_name, is_scene, unit_of
from translucent.geometry.mesh import Mesh, mesh_of
from translucent.gltf.load import SUFFIXES, load_scene
from translucent.media.medium import Medium
from translucent.media.preset import Preset
from translucent.media.presets import preset as named_preset
from translucent.mesh_files import load_mesh
from translucent.notebook.view import view
from translucent.page.write import title_of, write_page
from translucent.scene.scene import Scene
from translucent.scene.showcase import filled, showcase, with_pattern, with_roughness
from translucent.scene.stages import DEFAULT_STAGE, NO_STAGE, has_ground, staged
from translucent.scene_files import is_composed, load_composed
from translucent.threads import import_trimesh

#: Size of the picture that pages and widgets frame.
SIZE = (960, 720)


@checked
def show(
    thing: Any, material: str | Preset | Medium | None = None, unit: str | None = None, where: str | None = None
) -> Any:
    """Show a mesh or a scene in the viewer that fits: a widget, a window or a page.

    Parameters
    ----------
    thing : Scene, Mesh, trimesh.Trimesh, trimesh.Scene, pyvista.PolyData, or path
        Any object with vertices and faces, or a file or one of the toolkit's own meshes, as ``translucent render``
        takes them.
    material : str, Preset or Medium, optional
        What fills it; a text is the name of a preset. Default: the materials of a scene, and for a mesh jade green.
    unit : str, optional
        Unit of its coordinates, as for `load_mesh`.
    where : {"notebook", "window", "page"}, optional
        Default: a widget in Jupyter and marimo; the previewer's window where there is a display and its package; or
        else a page, opened in the browser if there is a display. A `Scene` has lights and a camera of its own, which
        the window would not keep: it is shown by a page there.

    Returns
    -------
    SceneView, Path or None
        The widget, which a notebook shows as the result of its cell; the file of the page; None once the window is
        closed.

    Raises
    ------
    InputError
        If it is nothing that can be shown, or there is no such preset.
    RenderError
        If the window is requested and cannot be opened.
    """
    if where not in (None, "notebook", "window", "page"):
        raise InputError(f"where {where!r}", "no viewer has this name", 'use "notebook", "window" or "page"')
    found = named_preset(material) if isinstance(material, str) else material
    where = where or ("notebook" if _in_notebook() else "window" if _at_desk(thing) else "page")
    if where == "window":
        return _window(thing, found, unit)
    scene = _scene(thing, found, unit)
    if where == "notebook":
        return view(scene, SIZE)
    path = Path(tempfile.mkdtemp(prefix="translucent-")) / f"{_file_name(title_of(scene))}.html"
    write_page(scene, path, size=SIZE)
    if _has_display():
        webbrowser.open(path.as_uri())
    return path


def _in_notebook() -> bool:
    """True in a cell of Jupyter, where IPython has a kernel, or of marimo."""
    if (marimo := sys.modules.get("marimo")) is not None and marimo.running_in_notebook():
        return True
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, "kernel")


def _has_display() -> bool:
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _at_desk(thing: object) -> bool:
    return not isinstance(thing, Scene) and _has_display() and find_spec("imgui_bundle") is not None


def _scene(thing: Any, material: Preset | Medium | None, unit: str | None) -> Scene:
    """Scene of a thing, filled with a material; on a stage, if it brings no light and no camera."""
    medium = material.medium if isinstance(material, Preset) else material
    if isinstance(thing, Scene):
        return thing if material is None else _made_of(thing, material)
    if isinstance(thing, str | Path) and is_composed(str(thing)):
        scene: Scene = load_composed(str(thing), unit, SIZE, None if medium is None else lambda _: medium)
        return staged(scene, scene.stage) if scene.stage != NO_STAGE else scene  # type: ignore[attr-defined]
    if is_scene(thing) or (isinstance(thing, str | Path) and Path(thing).suffix.lower() in SUFFIXES):
        loaded = load_scene(thing, unit, size=SIZE)
        scene = loaded if material is None else _made_of(loaded, material)
        bare = scene.bodies and not (loaded.has_camera or scene.lights or has_ground(scene))
        return staged(scene, DEFAULT_STAGE) if bare else scene
    return showcase(_mesh(thing, unit), material, SIZE)


def _made_of(scene: Scene, material: Preset | Medium) -> Scene:
    """Scene filled with a material, with the surface of a preset."""
    if isinstance(material, Preset):
        filled_with = with_roughness(filled(scene, material.medium), material.roughness)
        return with_pattern(filled_with, material.pattern)
    return filled(scene, material)


def _mesh(thing: object, unit: str | None) -> Mesh:
    if isinstance(thing, str | Path):
        own = thing in mesh_names() and not Path(thing).exists()
        return load_mesh(mesh_path(str(thing)) if own else thing, None if own else unit)
    if (mesh := thing if isinstance(thing, Mesh) else mesh_of(thing, unit)) is None:
        do = "give a Scene, a Mesh, a mesh of trimesh or PyVista, or a path"
        raise InputError(f"show {brief(thing)}", f"this is an object of type {type(thing).__name__}", do)
    return mesh


def _window(thing: Any, material: Preset | Medium | None, unit: str | None) -> None:
    """Run the previewer in a process of its own, since a window's loop needs the main thread, until it is closed."""
    from translucent.preview.actions import changed_material, preset_material
    from translucent.preview.document import Document, Material, Model, medium_fields
    from translucent.preview.session import save_session

    if isinstance(thing, Scene):
        do = "show the scene as a page, or show only a mesh: tl.show(mesh)"
        raise InputError(
            "show a Scene in the window", "the window would ignore the lights and the camera of the scene", do
        )
    with tempfile.TemporaryDirectory(prefix="translucent-") as folder:
        if isinstance(thing, str | Path):
            model = Model(str(thing), unit or "m")
        elif is_scene(thing):
            load_scene(thing, unit)  # refuses what cannot be shown
            model = Model(str(Path(folder) / f"{_file_name(foreign_name(thing))}.glb"))
            thing.scaled(unit_of(thing, unit)[0]).export(model.path)
        else:
            mesh = _mesh(thing, unit)
            model = Model(str(Path(folder) / f"{_file_name(mesh.name)}.ply"))
            import_trimesh().Trimesh(mesh.vertices, mesh.faces, process=False).export(model.path)
        document = Document(model)
        if isinstance(material, Preset):
            document = dataclasses.replace(document, material=preset_material(Material(), material.name))
        elif material is not None:
            fields = medium_fields(material)
            chosen = changed_material(Material(**fields), "absorption", fields["absorption"])
            document = dataclasses.replace(document, material=chosen)
        session = Path(folder) / "show.toml"
        save_session(session, document)
        ended = subprocess.run([sys.executable, "-m", "translucent", "preview", "--session", str(session)], check=False)
    if ended.returncode:
        raise RenderError(
            "show in a window",
            f"the previewer ended with exit code {ended.returncode}",
            "the error message of the previewer is printed above",
        )


def _file_name(name: str) -> str:
    return re.sub(r"[^\w-]+", "_", Path(name).stem) or "model"
