"""Adapters: how the benchmark drives renderers, each a function from a scene to linear radiance and seconds."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.bench.experiment import one_line
from translucent.benchmark.browser import BABYLON, FILAMENT, MODEL_VIEWER, THREE, WebRenderer, open_page
from translucent.benchmark.export import export_scene, lacking_in_mitsuba, mean_chord, mitsuba_scene
from translucent.benchmark.results import (
    Results,
    SceneResult,
    floor_seconds,
    read_results,
    scored,
    this_machine,
    today,
    write_picture,
    write_thickness,
)
from translucent.benchmark.scenes import FEATURES, BenchmarkScene, Feature
from translucent.errors import InputError, RenderError, closest_name
from translucent.files.images import read_exr
from translucent.files.paths import make_folder
from translucent.interop.pyrender import load_pyrender
from translucent.planning.interfaces import FrontInterface, ScreenInterfaces
from translucent.planning.methods import BackFaceDepth, PathTraced, RayMarched, ThinLayer
from translucent.planning.scattering import ScatteringLayer, SingleScattering
from translucent.renderer import Renderer
from translucent.version import VERSION

ALL: frozenset[Feature] = frozenset(FEATURES)


class SceneNotSupportedError(Exception):
    """Error for a scene that a renderer cannot represent or render; the message says why. It is not counted as a
    failure.
    """


class Rendered(NamedTuple):
    """A picture: radiance (h, w, 3), if any; seconds, if known; thickness (h, w) in metres, NaN where not known."""

    radiance: npt.NDArray[Any] | None
    seconds: float | None
    thickness: npt.NDArray[Any] | None = None


class Session(NamedTuple):
    """Started renderer: its function that draws a scene, its version and its device."""

    draw: Callable[[BenchmarkScene, Path], Rendered]
    version: str
    device: str = ""


@dataclass(frozen=True)
class Adapter:
    """A renderer as the benchmark drives it.

    Attributes
    ----------
    name, title : str
    settings : str
        What it is asked for, and why these are its best for pictures like these.
    features : set of str
        What it can do; scenes that need more are not its.
    missing : callable
        Why it cannot run here; empty if it can.
    start : callable
        Starts it, as a context of a `Session`.
    """

    name: str
    title: str
    settings: str
    features: frozenset[Feature]
    missing: Callable[[], str]
    start: Callable[[], AbstractContextManager[Session]]

    def lacks(self, scene: BenchmarkScene) -> str:
        """Features of a scene that it does not have, in words; empty if it has all."""
        lacking = [name for name in scene.needs if name not in self.features]
        return f"the renderer has no {', '.join(lacking)}" if lacking else ""


def run_adapter(
    adapter: Adapter,
    scenes: Sequence[BenchmarkScene],
    folder: Path,
    said: Callable[[str], None] | None = None,
) -> Results:
    """Render scenes by an adapter into a folder, score them, and write results.json, which holds failures too.

    Raises
    ------
    InputError
        If the renderer cannot run here.
    """
    if why := adapter.missing():
        raise InputError(f"adapter {adapter.name!r}", why.split("; ")[0], why.partition("; ")[2] or "see the docs")
    make_folder(folder)
    begun = read_results(folder)
    found: dict[str, SceneResult] = dict(begun.scenes) if begun.date else {}
    with adapter.start() as session, tempfile.TemporaryDirectory(prefix="translucent-benchmark-") as temporary:
        results = Results(
            adapter.title, session.version, adapter.settings, this_machine(), session.device, today(), VERSION
        )
        for scene in scenes:
            if said is not None:
                said(scene.name)
            found[scene.name] = _drawn(adapter, session, scene, Path(temporary), folder)
            dataclasses.replace(results, scenes=found).write(folder)  # what is done is kept, if the run is ended
    results = dataclasses.replace(results, scenes=found)
    results = scored(results, folder)
    results.write(folder)
    return results


def _drawn(adapter: Adapter, session: Session, scene: BenchmarkScene, temporary: Path, folder: Path) -> SceneResult:
    """Render one scene; its files are written."""
    for old in folder.glob(f"{scene.name}.*"):
        if old.name.removeprefix(scene.name) in (".exr", ".npy", ".thickness.exr", ".thickness.npy"):
            old.unlink()
    if lacking := adapter.lacks(scene):
        return SceneResult(lacking=lacking)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rendered = session.draw(scene, export_scene(scene, temporary / scene.name))
    except SceneNotSupportedError as error:
        return SceneResult(lacking=str(error))
    except Exception as error:  # noqa: BLE001 - one scene that fails leaves the others alone
        return SceneResult(failure=one_line(error))
    if rendered.radiance is not None:
        write_picture(folder / f"{scene.name}.exr", rendered.radiance)
    if rendered.thickness is not None:
        write_thickness(folder / f"{scene.name}.thickness.exr", rendered.thickness)
    return SceneResult(rendered.seconds, floor_seconds(scene))


# --- this toolkit ----------------------------------------------------------------------------------------------------


def _ours(name: str, title: str, settings: str, features: frozenset[Feature] = ALL, **options: Any) -> Adapter:
    """An adapter of this toolkit with options of `Renderer.render`."""

    @contextmanager
    def start() -> Iterator[Session]:
        with Renderer() as renderer:

            def draw(scene: BenchmarkScene, _: Path) -> Rendered:
                made = scene.make()
                chosen = dict(options)
                if not scene.thickness and not isinstance(chosen.get("method"), PathTraced):
                    chosen.pop("method", None)
                renderer.render(made, scene.size, **chosen)  # compiles, solves, finds rays' trees
                begin = time.perf_counter()
                frame = renderer.render(made, scene.size, **chosen)
                radiance = np.asarray(frame.radiance)
                seconds = time.perf_counter() - begin
                thickness = np.where(frame.valid, frame.thickness, np.nan) if scene.thickness else None
                return Rendered(radiance, seconds, thickness)

            provenance = renderer.provenance
            yield Session(draw, VERSION, f"{provenance['renderer']}, {provenance['driver']}")

    return Adapter(name, title, settings, features, lambda: "", start)


_STRAIGHT = frozenset[Feature]({"absorption", "sheets", "shadows", "emission", "nesting"})


def _needs(module: str, package: str = "") -> Callable[[], str]:
    """Why a renderer cannot run here that is a Python module, of a package that may have another name."""
    name = package or module
    return lambda: "" if importlib.util.find_spec(module) else f"{name} is not installed; pip install {name}"


# --- Mitsuba ---------------------------------------------------------------------------------------------------------


def _mitsuba(paths: int) -> Adapter:
    """Mitsuba 3 with few paths for each pixel."""

    @contextmanager
    def start() -> Iterator[Session]:
        mitsuba: Any = importlib.import_module("mitsuba")
        variants = mitsuba.variants()
        variant = next(
            (one for one in ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb") if _works(mitsuba, one)), variants[0]
        )
        mitsuba.set_variant(variant)

        def draw(scene: BenchmarkScene, folder: Path) -> Rendered:
            made = scene.make()
            if lacking := lacking_in_mitsuba(made):
                raise SceneNotSupportedError(lacking)
            described = mitsuba_scene(made, scene.size, folder, samples=paths)
            described["sensor"]["far_clip"] = 1e9  # a scene is 2000 m away
            loaded = mitsuba.load_dict(described)
            np.array(mitsuba.render(loaded, seed=1))  # compiles
            begin = time.perf_counter()
            radiance = np.array(mitsuba.render(loaded, seed=2))
            return Rendered(radiance, time.perf_counter() - begin)

        yield Session(draw, mitsuba.__version__, f"variant {variant}, {os.cpu_count()} threads")

    settings = f"volpathmis without a depth limit, {paths} paths per pixel, box filter"
    features = ALL - {"emission", "sheets"}
    return Adapter(f"mitsuba-{paths}", f"Mitsuba 3, {paths} paths", settings, features, _needs("mitsuba"), start)


# --- Blender, as a module in a Python of its own ---------------------------------------------------------------------


def _blender(engine: str, samples: int, title: str, settings: str, features: frozenset[Feature]) -> Adapter:
    """An engine of Blender, in the Python that the variable BLENDER_PYTHON names, or this one."""
    python = os.environ.get("BLENDER_PYTHON", "")

    def missing() -> str:
        if python:
            return "" if shutil.which(python) else f"BLENDER_PYTHON={python!r} is not a program; name a Python"
        if importlib.util.find_spec("bpy") is None:
            return "bpy is not installed; pip install bpy, or set BLENDER_PYTHON to a Python with bpy"
        return ""

    @contextmanager
    def start() -> Iterator[Session]:
        script = str(files("translucent.benchmark").joinpath("peers", "blender_scene.py"))
        command = [python or sys.executable, script, engine, str(samples)]
        # EEVEE refuses Mesa's software driver for its version, and works on it.
        environment = {"MESA_GL_VERSION_OVERRIDE": "4.6", **os.environ}
        with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, text=True, env=environment) as process:
            assert process.stdin is not None
            assert process.stdout is not None

            def answer() -> dict[str, Any]:
                assert process.stdout is not None
                for line in process.stdout:
                    if line.startswith("@"):
                        found: dict[str, Any] = json.loads(line[1:])
                        return found
                raise RenderError(
                    f"Blender's {engine}",
                    f"Blender ended with exit code {process.wait()}",
                    "run the script of this adapter by hand to see the error",
                )

            def draw(scene: BenchmarkScene, folder: Path) -> Rendered:
                assert process.stdin is not None
                picture = folder / "picture.exr"
                process.stdin.write(json.dumps({"folder": str(folder), "picture": str(picture)}) + "\n")
                process.stdin.flush()
                reply = answer()
                if "error" in reply:
                    raise RenderError(f"Blender's {engine}", reply["error"], "read the script of this adapter")
                _, channels = read_exr(picture, "the picture")
                return Rendered(np.stack([channels[name] for name in "RGB"], axis=-1), reply["seconds"])

            yield Session(
                draw, answer()["version"], f"CPU, {os.cpu_count()} threads" if engine == "cycles" else "OpenGL"
            )
            process.stdin.close()

    return Adapter(engine, title, settings, features, missing, start)


# --- renderers of the web ---------------------------------------------------------------------------------------------


def _web(renderer: WebRenderer, title: str, settings: str, features: frozenset[Feature]) -> Adapter:
    """A renderer of the web in headless Chromium."""

    @contextmanager
    def start() -> Iterator[Session]:
        with open_page(renderer) as page:
            yield Session(lambda scene, folder: Rendered(*page.draw(scene, folder)), renderer.version(), page.device)

    return Adapter(renderer.name, title, settings, features, renderer.missing, start)


_GLTF = frozenset[Feature]({"absorption", "refraction", "roughness", "shadows"})


# --- gVXR: thickness by adding up signed distances, as in X-ray pictures ----------------------------------------------


def _gvxr() -> Adapter:
    """Adapter of gVirtualXRay, whose L-buffer contains only thickness."""

    @contextmanager
    def start() -> Iterator[Session]:
        try:
            gvxr: Any = importlib.import_module("gvxrPython3").gvxr
        except ImportError as error:
            raise RenderError("adapter 'gvxr'", f"it cannot be loaded ({error})", "install this library") from error
        gvxr.createOpenGLContext()

        def draw(scene: BenchmarkScene, _: Path) -> Rendered:
            made = scene.make()
            if not scene.thickness or made.overlap != "add":
                raise SceneNotSupportedError("the renderer computes only thickness")
            camera, (width, height) = made.camera, scene.size
            reach = float((made.boxes.reshape(-1, 3) - camera.eye @ np.eye(3)).dot(camera.forward).max())
            away = 1.05 * reach
            gvxr.removePolygonMeshesFromSceneGraph()
            gvxr.usePointSource()
            gvxr.setSourcePosition(*camera.eye.tolist(), "m")
            gvxr.setDetectorPosition(*(camera.eye + away * camera.forward).tolist(), "m")
            gvxr.setDetectorUpVector(*camera.up.tolist())
            gvxr.setDetectorNumberOfPixels(width, height)
            side = 2 * away * math.tan(math.radians(camera.fov_y or 45.0) / 2) / height
            gvxr.setDetectorPixelSize(side, side, "m")
            gvxr.setMonoChromatic(0.1, "MeV", 1)
            thickness = np.zeros((height, width))
            seconds = 0.0
            for number, item in enumerate(made.bodies):
                vertices = item.world_vertices
                name = f"{scene.name} {number}"
                gvxr.makeTriangularMesh(name, vertices.ravel().tolist(), item.mesh.faces.ravel().tolist(), "m")
                gvxr.addPolygonMeshAsInnerSurface(name)
                gvxr.setHU(name, 0)
                gvxr.computeLBuffer(name)  # uploads
                begin = time.perf_counter()
                gvxr.computeLBuffer(name)
                found = np.array(gvxr.getLastLBuffer(), np.float64).reshape(height, width)
                seconds += time.perf_counter() - begin
                thickness += 0.01 * found[::-1]  # centimetres, the last row first
            return Rendered(None, seconds, thickness)

        version = f"{gvxr.getMajorVersionOfCoreGVXR()}.{gvxr.getMinorVersionOfCoreGVXR()}"
        yield Session(draw, version, gvxr.getOpenGlRenderer())
        gvxr.destroyAllWindows()

    settings = "L-buffer of each body, one ray per pixel"
    return Adapter("gvxr", "gVirtualXRay", settings, frozenset({"absorption"}), _needs("gvxrPython3", "gvxr"), start)


# --- pyrender: alpha blending -----------------------------------------------------------------------------------------


def _pyrender() -> Adapter:
    """Adapter of the rasterizer pyrender, in which each body has one opacity and one emission."""

    @contextmanager
    def start() -> Iterator[Session]:
        pyrender: Any = load_pyrender("egl")

        def draw(scene: BenchmarkScene, _: Path) -> Rendered:
            made = scene.make()
            if made.environment.kind != "constant" or made.opaque:
                raise SceneNotSupportedError("the renderer supports only a constant background and no opaque objects")
            drawn = pyrender.Scene(bg_color=np.ones(4), ambient_light=np.zeros(3))
            for item in made.bodies:
                assert item.medium is not None
                # It blends values that are encoded by 1 / 2.2.
                passed = np.exp(-np.asarray(item.medium.extinction) * mean_chord(item) / 2.2)
                alpha = 1 - float(passed.min())
                glow = ((passed - passed.min()) / alpha) ** 2.2
                material = pyrender.MetallicRoughnessMaterial(
                    baseColorFactor=[0.0, 0.0, 0.0, alpha],
                    emissiveFactor=glow,
                    metallicFactor=0.0,
                    alphaMode="BLEND",
                )
                corners = item.mesh.vertices[item.mesh.faces] @ item.matrix[:3, :3].T + item.matrix[:3, 3]
                normals = np.repeat(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), 3, axis=0)
                normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
                primitive = pyrender.Primitive(corners.reshape(-1, 3), normals, material=material)
                drawn.add(pyrender.Mesh([primitive]))
            camera = made.camera
            reach = np.linalg.norm(made.boxes.reshape(-1, 3) - camera.eye, axis=1).max()
            lens = pyrender.PerspectiveCamera(math.radians(camera.fov_y or 45.0), znear=0.1 * reach, zfar=2 * reach)
            drawn.add(lens, pose=camera.pose)
            parts = 4
            renderer = pyrender.OffscreenRenderer(*(parts * side for side in scene.size))
            renderer.render(drawn)
            begin = time.perf_counter()
            color, _depth = renderer.render(drawn)
            seconds = time.perf_counter() - begin
            linear = (color[..., :3] / 255.0) ** 2.2
            width, height = scene.size
            return Rendered(linear.reshape(height, parts, width, parts, 3).mean(axis=(1, 3)), seconds)

        yield Session(draw, str(pyrender.__version__), "OpenGL")

    settings = "alpha blending by the mean thickness of each body, unlit, 8 bits, 16 samples"
    return Adapter("pyrender", "pyrender", settings, frozenset({"absorption"}), _needs("pyrender"), start)


def _works(mitsuba: Any, variant: str) -> bool:
    if variant not in mitsuba.variants():
        return False
    try:
        mitsuba.set_variant(variant)
        np.array(mitsuba.Float([1.0]) + 1.0)
    except Exception:  # noqa: BLE001 - no such device, no LLVM
        return False
    return True


_PATHS = "64 paths, no clamp, caustics on, box filter, Open Image Denoise"
_SCREEN = "64 samples, screen-space ray tracing at full resolution, finest volumes"
_NOT_NESTED = ALL - {"nesting", "sheets"}

_ADAPTERS: tuple[Adapter, ...] = (
    _ours("ours", "translucent", "default settings, 16 samples per pixel", samples=16),
    _ours("ours-quick", "translucent, 1 sample", "default settings, 1 sample per pixel", samples=1),
    _ours(
        "ours-screen",
        "translucent, screen space",
        "interfaces in screen space, scattering in layers: no ray tracing, no diffusion",
        samples=4,
        interfaces=ScreenInterfaces(),
        scattering=ScatteringLayer(),
    ),
    _ours(
        "ours-front",
        "translucent, front interface",
        "rays are refracted only at the first interface",
        samples=4,
        interfaces=FrontInterface(),
        scattering=SingleScattering(),
    ),
    _ours(
        "ours-back-face",
        "translucent, back-face depth",
        "thickness to the last surface: convex bodies alone",
        _STRAIGHT,
        samples=4,
        method=BackFaceDepth(),
    ),
    _ours(
        "ours-ray-marched",
        "translucent, ray marching",
        "256 steps along each ray",
        _STRAIGHT,
        samples=4,
        method=RayMarched(steps=256),
    ),
    _ours(
        "ours-thin-layer",
        "translucent, thin layer",
        "one stated thickness over the cosine",
        _STRAIGHT,
        samples=4,
        method=ThinLayer(thickness=0.02),
    ),
    _ours("ours-paths", "translucent, 64 paths", "random paths, 64 for each pixel", method=PathTraced(64, 77)),
    _blender("cycles", 64, "Blender Cycles", _PATHS, _NOT_NESTED),
    _blender("eevee", 64, "Blender EEVEE", _SCREEN, _NOT_NESTED),
    _web(THREE, "three.js", "MeshPhysicalMaterial, PMREM, transmission at full resolution, 16 samples", _GLTF),
    _web(BABYLON, "Babylon.js", "PBR with sub-surface refraction, filtered environment, 16 samples", _GLTF),
    _web(
        MODEL_VIEWER,
        "model-viewer",
        "environment and skybox from .hdr, no tone mapping, no shadow of its own, 16 samples",
        _GLTF - {"shadows"},
    ),
    _web(
        FILAMENT,
        "Filament",
        "gltfio, refraction in screen space, GGX-filtered environment, 8 bits for radiance up to 4, 16 samples",
        _GLTF,
    ),
    _gvxr(),
    _pyrender(),
    _mitsuba(16),
    _mitsuba(64),
)


def adapters() -> Mapping[str, Adapter]:
    """All adapters, by name."""
    return {one.name: one for one in _ADAPTERS}


def adapter_named(name: str) -> Adapter:
    """The adapter of a name; raises `InputError` for other names."""
    known = adapters()
    if name in known:
        return known[name]
    do = closest_name(name, known, f"use some of {', '.join(known)}")
    raise InputError(f"adapter {name!r}", "not known", do)
