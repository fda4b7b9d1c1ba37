"""Costs of the passes of a plan: seconds that the GPU spends on each, and bytes that each reads and writes."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import moderngl

from translucent.gpu.features import FrameFeatures
from translucent.gpu.targets import FORMATS, accumulator_format, compact_format
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import RenderPlan

_TIME_ELAPSED, _CURRENT_QUERY, _QUERY_RESULT = 0x88BF, 0x8865, 0x8866

#: What moderngl reads, 32 bits of nanoseconds, of whatever takes 4.295 s or more.
_SATURATED = (1 << 32) - 1


class PassTimer:
    """OpenGL timer queries by name; read after the frame, or a sample later, so that drawing does not wait for them."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._queries: dict[str, moderngl.Query] = {}
        self._numbers: dict[str, int] = {}  # of the queries, as OpenGL counts them
        self._seconds: dict[str, float] = {}  # of what was drawn in the frame before what the query has measured last
        # Mesa's software rasterizer measures the first query of a context from the beginning of time.
        texture = gl.texture((1, 1), 1)
        framebuffer = gl.framebuffer([texture])
        first = gl.query(time=True)
        with first:
            framebuffer.clear()
        _ = first.elapsed
        framebuffer.release()
        texture.release()
        self._get_query = self._function("glGetQueryiv", ctypes.c_uint, ctypes.c_uint)
        self._get_result = self._function("glGetQueryObjectui64v", ctypes.c_uint, ctypes.c_uint)

    def begin_frame(self) -> None:
        """Discard the previous frame's times."""
        self._seconds.clear()

    def measure(self, name: str) -> moderngl.Query:
        """Context manager that times the draws within; times of the same name in a frame add up."""
        if name not in self._queries:
            self._queries[name] = query = self._gl.query(time=True)
            self._numbers[name] = self._number(query)
        if name in self._seconds:
            self._seconds[name] += self._elapsed(name)
        else:
            self._seconds[name] = 0.0
        return self._queries[name]

    def stop(self) -> None:
        """End the running measurement, if there is one."""
        for query in self._queries.values():
            with suppress(moderngl.Error):  # it was not begun
                query.mglo.end()

    def seconds(self) -> dict[str, float]:
        """Seconds per name, in the order of the frame; blocks until the GPU is done."""
        return {name: before + self._elapsed(name) for name, before in self._seconds.items()}

    def _elapsed(self, name: str) -> float:
        """Seconds that a query measured last, read with 64 bits if 32 are too few."""
        nanoseconds = self._queries[name].elapsed
        return 1e-9 * (nanoseconds if nanoseconds < _SATURATED else self._all_bits(name))

    def _all_bits(self, name: str) -> int:
        result = ctypes.c_uint64()
        self._get_result(self._numbers[name], _QUERY_RESULT, ctypes.byref(result))
        return result.value

    def _number(self, query: moderngl.Query) -> int:
        """OpenGL name of a timer query, which moderngl does not expose."""
        number = ctypes.c_int()
        query.mglo.begin()
        self._get_query(_TIME_ELAPSED, _CURRENT_QUERY, ctypes.byref(number))
        query.mglo.end()
        return number.value

    def _function(self, name: str, *arguments: type) -> Callable[..., None]:
        """OpenGL function of this name, whose last argument is a pointer to its result."""
        if sys.platform == "win32":
            prototype = ctypes.WINFUNCTYPE
        else:
            prototype = ctypes.CFUNCTYPE
        return prototype(None, *arguments, ctypes.c_void_p)(self._gl.mglo._context.load_opengl_function(name))


@dataclass(frozen=True)
class PassTraffic:
    """Bytes that a pass reads and writes.

    Passes over pixels read and write each target once, and clears write. Depth buffers, and textures of meshes, lights
    and surfaces, are not counted.

    Attributes
    ----------
    name : PassName
    pixel : (int, int), optional
        Read and written for each pixel, at most. None where that goes with the scene: lists of faces, rays, photons,
        maps of a size of their own.
    face : (int, int)
        Read and written for each face over a pixel, at most, in addition.
    """

    name: PassName
    pixel: tuple[int, int] | None = None
    face: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class FrameTraffic:
    """Bytes that a frame of one sample reads and writes, by pass; and that are read back of each pixel."""

    passes: tuple[PassTraffic, ...]
    read_back: int

    def summary(self) -> dict[str, object]:
        """Traffic as values that JSON can hold."""
        keys = "read", "written"
        return {
            "passes": [
                {
                    "name": step.name.value,
                    "pixel": None if step.pixel is None else dict(zip(keys, step.pixel, strict=True)),
                    "face": None if step.pixel is None else dict(zip(keys, step.face, strict=True)),
                }
                for step in self.passes
            ],
            "read_back": self.read_back,
        }

    def __str__(self) -> str:
        counted = [step for step in self.passes if step.pixel is not None]
        rest = [step.name.value for step in self.passes if step.pixel is None]
        lines = ["largest number of bytes read and written in render targets, for one sample:"]
        for step in counted:
            assert step.pixel is not None
            face = f" and {_words(*step.face)} for each face over the pixel" if any(step.face) else ""
            lines.append(f"  {step.name}: {_words(*step.pixel)} per pixel{face}")
        read, written = (sum(step.pixel[i] for step in counted if step.pixel is not None) for i in range(2))
        lines.append(f"  together: {_words(read, written)} per pixel, and {self.read_back} read back")
        if rest:
            lines.append(f"  not counted, because it depends on the rays: {', '.join(rest)}")
        return "\n".join(lines)


def frame_traffic(plan: RenderPlan) -> FrameTraffic:
    """Bytes that a frame reads from its targets and writes to them, by its plan."""
    features = FrameFeatures(plan)
    cleared: set[str] = set()
    steps = [_COUNTED[step.name](features, step, cleared) if step.name in _COUNTED else None for step in plan.passes]
    found = (step or PassTraffic(spec.name) for step, spec in zip(steps, plan.passes, strict=True))
    return FrameTraffic(tuple(found), _read_back(features))


def _words(read: int, written: int) -> str:
    return f"{read} read, {written} written"


def _ends(features: FrameFeatures) -> int:
    return FORMATS["opaque"].bytes_of(0) if features.has_opaque else 0


def _opaque(features: FrameFeatures, spec: PassSpec, cleared: set[str]) -> PassTraffic:
    size = FORMATS["opaque"].bytes_of()
    return PassTraffic(spec.name, (0, size), (0, size))


def _adding(features: FrameFeatures, spec: PassSpec, cleared: set[str]) -> PassTraffic:
    """Traffic of a pass whose faces add to an accumulator, which the first one clears."""
    size, count = _accumulator(features)
    first = spec.target not in cleared
    cleared.add(spec.target)
    return PassTraffic(spec.name, (0, size * count if first else 0), (size + _ends(features), size))


def _back_faces(features: FrameFeatures, spec: PassSpec, cleared: set[str]) -> PassTraffic:
    faces = FORMATS["nearest_and_farthest"].bytes_of()
    size = accumulator_format(features.plan.spectral).bytes_of()
    written = size if spec.target in cleared else 2 * size
    cleared.add(spec.target)
    return PassTraffic(spec.name, (faces, faces + written), (faces + _ends(features), faces))


def _transmittance(features: FrameFeatures, spec: PassSpec, cleared: set[str]) -> PassTraffic:
    size, count = _accumulator(features)
    accumulators = features.accumulates * count + features.has_fallback + features.has_unlit
    read = size * accumulators + (FORMATS["ordered"].bytes_of() if features.plan.ordered else 0)
    if features.has_opaque and not features.has_surfaces:
        read += FORMATS["opaque"].bytes_of()
    result = compact_format(features.plan.spectral) if features.can_be_compact else FORMATS["result"]
    return PassTraffic(spec.name, (read, result.bytes_of()))


def _interfaces(features: FrameFeatures, spec: PassSpec, cleared: set[str]) -> PassTraffic:
    entered, left = FORMATS["entered"].bytes_of(), FORMATS["left"].bytes_of()
    other = 0 if features.one_interface else FORMATS["ordered" if features.finds_exits else "entered"].bytes_of(0)
    pixel = (0, entered if features.one_interface else entered + left)
    return PassTraffic(spec.name, pixel, (_ends(features) + other, entered))


def _surfaces(features: FrameFeatures, spec: PassSpec, cleared: set[str]) -> PassTraffic:
    """Bytes of a pass that shades interfaces; of traced rays, only the targets at their two ends."""
    parts = (0, 1) if features.traced else (0, 1, 2, 3)
    read = FORMATS["result"].bytes_of(*parts) + FORMATS["entered"].bytes_of()
    if not features.one_interface:
        read += FORMATS["left"].bytes_of()
    if features.has_opaque:
        read += FORMATS["opaque"].bytes_of()
    return PassTraffic(spec.name, (read, FORMATS["surfaced"].bytes_of()))


def _accumulator(features: FrameFeatures) -> tuple[int, int]:
    """Bytes of a pixel of an accumulator, and how many there are for the media."""
    apart = features.media_apart if features.can_be_compact else None
    if apart is not None:
        return accumulator_format(False).bytes_of(), int(apart.max()) + 1
    return accumulator_format(features.plan.spectral).bytes_of(), 1


def _read_back(features: FrameFeatures) -> int:
    """Bytes of each pixel that `gpu.reading` takes."""
    floats = 4
    if features.can_be_compact:
        size = (3 + 1 + (3 if features.plan.spectral else 0)) * floats
    else:
        size = (3 + 3 + 3 + 1) * floats + 1
    if features.path_traced:
        size += (4 + 3) * floats
    elif features.traced:
        size += 4 * floats
    size += 4 * floats if features.plan.ordered else 0
    return size + (4 * floats if features.has_surfaces else 0)


_COUNTED: dict[PassName, Callable[[FrameFeatures, PassSpec, set[str]], PassTraffic]] = {
    PassName.OPAQUE: _opaque,
    PassName.SIGNED_DEPTH: _adding,
    PassName.SIGNED_DEPTH_FALLBACK: _adding,
    PassName.UNLIT: _adding,
    PassName.THIN_LAYER: _adding,
    PassName.THIN_LAYER_FALLBACK: _adding,
    PassName.BACK_FACE_DEPTH: _back_faces,
    PassName.TRANSMITTANCE: _transmittance,
    PassName.INTERFACES: _interfaces,
    PassName.SURFACES: _surfaces,
    PassName.TRACED: _surfaces,
}
