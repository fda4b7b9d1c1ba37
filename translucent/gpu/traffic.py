"""Bytes that the passes of a plan read from and write to their targets, worked out without OpenGL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from translucent.gpu.features import FrameFeatures
from translucent.gpu.formats import FORMATS, accumulator_format, compact_format
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import RenderPlan


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
        told = [step for step in self.passes if step.pixel is not None]
        rest = [step.name.value for step in self.passes if step.pixel is None]
        lines = ["bytes in targets at most, of one sample:"]
        for step in told:
            assert step.pixel is not None
            face = f" and {_words(*step.face)} for each face over it" if any(step.face) else ""
            lines.append(f"  {step.name}: {_words(*step.pixel)} per pixel{face}")
        read, written = (sum(step.pixel[i] for step in told if step.pixel is not None) for i in range(2))
        lines.append(f"  together: {_words(read, written)} per pixel, and {self.read_back} read back")
        if rest:
            lines.append(f"  not counted, as it goes with what a ray meets: {', '.join(rest)}")
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
    """Traffic of what shades interfaces; of rays, only what they start from and end at."""
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
