"""Results of a renderer: a folder, or one .zip file, with pictures and a results.json; read, scored, merged, written.

Results come from strangers. Only files with the names of scenes are read from them, texts are cut and escaped where
they are shown, and numbers are checked.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import re
import statistics
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bench.run import processor_name
from translucent.benchmark.measures import (
    Score,
    ThicknessScore,
    common_suspicions,
    score_picture,
    score_thickness_alone,
)
from translucent.benchmark.scenes import BenchmarkScene, scene_named, scene_names
from translucent.benchmark.truth import stored_truth_of, truth_path
from translucent.errors import InputError, printable
from translucent.files.images import read_array, read_exr, write_exr
from translucent.files.paths import OutputFiles, make_folder, write_text_atomically
from translucent.files.reading import MAX_TEXT, json_value, open_file, read_text
from translucent.geometry.ray_caster import ray_caster_of
from translucent.version import VERSION

#: Version of the layout of results.json.
FORMAT = "translucent benchmark results 1"

#: What times are compared with, on every machine.
FLOOR = "one ray through each pixel to the nearest surface (Embree, NumPy), on the processor"

#: Suffixes of pictures, in the order in which they are looked for.
SUFFIXES = (".exr", ".npy")

#: Longest text of a result in characters, and largest picture and archive in bytes.
LONGEST, LARGEST, LARGEST_ARCHIVE = 400, 1 << 25, 1 << 28

_RESULTS = "results.json"


@dataclass(frozen=True)
class SceneResult:
    """Result of one scene.

    Attributes
    ----------
    seconds : float, optional
        Time of the picture, without loading of the scene.
    floor : float, optional
        Seconds of `FLOOR` for the scene, on the same machine.
    lacking : str
        Why the renderer cannot do the scene; empty: it did.
    failure : str
        What went wrong.
    score : Score, optional
    """

    seconds: float | None = None
    floor: float | None = None
    lacking: str = ""
    failure: str = ""
    score: Score | None = None


@dataclass(frozen=True)
class Results:
    """Results of one renderer on one machine.

    Attributes
    ----------
    name, version, settings : str
        Of the renderer.
    machine, device : str
        Processor and system; what it rendered on, such as a graphics card.
    date : str
    toolkit : str
        Version of this toolkit.
    scenes : mapping of str to SceneResult
    folder : Path, optional
        Where its pictures lie.
    """

    name: str
    version: str = ""
    settings: str = ""
    machine: str = ""
    device: str = ""
    date: str = ""
    toolkit: str = VERSION
    scenes: Mapping[str, SceneResult] = field(default_factory=dict)
    folder: Path | None = None

    @property
    def suspicions(self) -> list[str]:
        """Mistakes that most of its pictures seem to share."""
        return common_suspicions([one.score for one in self.scenes.values() if one.score is not None])

    def write(self, folder: Path) -> None:
        """Write results.json into a folder."""
        write_text_atomically(folder / _RESULTS, json.dumps(plain_results(self), indent=1))


def plain_results(results: Results) -> dict[str, Any]:
    """Contents of a results.json."""
    plain = {key: value for key, value in dataclasses.asdict(results).items() if key != "folder"}
    return {"format": FORMAT, **_plain(plain), "suspicions": results.suspicions}


def _plain(value: Any) -> Any:
    """The value without NaN, which JSON has not, and with numbers of five digits."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.5g}") if math.isfinite(value) else None
    return value


def this_machine() -> str:
    """Processor, number of its threads and system."""
    return f"{processor_name()}, {os.cpu_count()} threads, {platform.system()} {platform.machine()}"


def today() -> str:
    """Date, in UTC."""
    return datetime.now(UTC).date().isoformat()


# --- reading ---------------------------------------------------------------------------------------------------------


def read_results(folder: Path) -> Results:
    """Results of a folder, of its results.json where it has one; without scores for pictures that have none.

    Raises
    ------
    InputError
        If it is no folder, or its results.json is not one.
    """
    if not folder.is_dir():
        raise InputError(
            f"results {str(folder)!r}", "this path is not a folder", "give the folder that contains the pictures"
        )
    path = folder / _RESULTS
    found: Any = {}
    if path.is_file():
        found = json_value(read_text(path, f"results {str(path)!r}", MAX_TEXT, do="give a results.json"))
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise InputError(
                f"results {str(path)!r}",
                f"the format of this results.json is not {FORMAT!r}",
                "score the pictures again",
            )
    texts = {
        key: _text(found.get(key, ""))
        for key in ("name", "version", "settings", "machine", "device", "date", "toolkit")
    }
    texts["name"] = texts["name"] or _text(folder.resolve().name)
    scenes = found.get("scenes", {})
    entries = scenes if isinstance(scenes, dict) else {}
    results = {name: _scene_result(entries[name], path) for name in scene_names() if name in entries}
    for name in scene_names():
        if name not in results and any(picture_path(folder, name, what) for what in ("", ".thickness")):
            results[name] = SceneResult()
    return Results(**texts, scenes={name: results[name] for name in scene_names() if name in results}, folder=folder)


def _text(value: Any) -> str:
    """Untrusted text as one line of limited length."""
    return printable(" ".join(str(value).split()))[:LONGEST] if isinstance(value, str | int | float) else ""


def _number(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else math.nan


def _time(value: Any) -> float | None:
    number = _number(value)
    return number if 0.0 < number < 1e7 else None


def _scene_result(entry: Any, path: Path) -> SceneResult:
    if not isinstance(entry, dict):
        raise InputError(
            f"results {str(path)!r}",
            "an entry of a scene is not a JSON object",
            "the documentation describes the contents of this file",
        )
    texts = {key: _text(entry.get(key, "")) for key in ("lacking", "failure")}
    score = entry.get("score")
    return SceneResult(
        _time(entry.get("seconds")),
        _time(entry.get("floor")),
        **texts,
        score=_score(score) if isinstance(score, dict) else None,
    )


def _score(entry: Mapping[str, Any]) -> Score:
    numbers = {key: _number(entry.get(key)) for key in ("nrmse", "block", "flip", "visible", "own_flip", "own_visible")}
    bias = entry.get("bias")
    channels = [_number(one) for one in bias] if isinstance(bias, list) else []
    red, green, blue = channels if len(channels) == 3 else [math.nan] * 3
    thick = entry.get("thickness")
    said = entry.get("suspicions")
    return Score(
        **numbers,
        bias=(red, green, blue),
        thickness=ThicknessScore(**{f.name: _number(thick.get(f.name)) for f in dataclasses.fields(ThicknessScore)})
        if isinstance(thick, dict)
        else None,
        suspicions=tuple(_text(one) for one in said[:4]) if isinstance(said, list) else (),
    )


def picture_path(folder: Path, name: str, what: str = "") -> Path | None:
    """Path of the picture of a scene, or of its thickness; None if there is none."""
    for suffix in SUFFIXES:
        path = folder / f"{name}{what}{suffix}"
        if path.is_file():
            return path
    return None


def read_picture(folder: Path, scene: BenchmarkScene) -> Array:
    """Linear radiance (h, w, 3) of a scene, at its size.

    Raises
    ------
    InputError
        If there is none, or it is of another shape. One that is larger by a whole factor is averaged.
    """
    path = picture_path(folder, scene.name)
    asked = f"picture {scene.name!r}"
    if path is None:
        do = f"name the file {scene.name}{SUFFIXES[0]} or {SUFFIXES[1]}"
        raise InputError(asked, f"no such file in {str(folder)!r}", do)
    if path.suffix == ".exr":
        _, channels = read_exr(path, asked)
        missing = [name for name in "RGB" if name not in channels]
        if missing:
            raise InputError(asked, f"the file has the channels {', '.join(channels)}", "name the channels R, G and B")
        array = np.stack([channels[name] for name in "RGB"], axis=-1)
    else:
        array = _npy(path, asked)
    return _fitted(np.asarray(array), scene, asked)


def _npy(path: Path, asked: str) -> npt.NDArray[Any]:
    with open_file(path, asked, LARGEST) as stream:
        return read_array(stream, path.stat().st_size, asked)


def read_thickness(folder: Path, scene: BenchmarkScene) -> Array | None:
    """Thickness (h, w) in metres of a scene; None if there is none."""
    path = picture_path(folder, scene.name, ".thickness")
    if path is None:
        return None
    asked = f"thickness {scene.name!r}"
    found = next(iter(read_exr(path, asked)[1].values())) if path.suffix == ".exr" else _npy(path, asked)
    array = np.asarray(found, np.float64)
    if array.shape != scene.size[::-1]:
        raise InputError(asked, f"its shape is {array.shape}", f"render {scene.size[1]} rows of {scene.size[0]}")
    return array


def _fitted(array: Array, scene: BenchmarkScene, asked: str) -> Array:
    width, height = scene.size
    if array.ndim != 3 or array.shape[-1] < 3 or array.dtype.kind != "f":
        found = f"the array has the shape {array.shape} and the type {array.dtype}"
        raise InputError(asked, found, "save linear radiance as floats, in an array of height x width x 3")
    times = array.shape[0] // height
    if times < 1 or array.shape[:2] != (times * height, times * width):
        found = f"{array.shape[1]} x {array.shape[0]} pixels"
        raise InputError(
            asked, found, (f"render {width} x {height} pixels, or a whole multiple; do not crop or scale the picture")
        )
    blocks = array[..., :3].astype(np.float64).reshape(height, times, width, times, 3)
    return np.asarray(blocks.mean(axis=(1, 3)))


# --- scoring ---------------------------------------------------------------------------------------------------------


def scored(results: Results, folder: Path, said: Callable[[str], None] | None = None) -> Results:
    """Results with scores of all pictures in a folder; what cannot be read becomes a failure."""
    scenes = dict(results.scenes)
    for name, result in results.scenes.items():
        has_none = picture_path(folder, name) is None and picture_path(folder, name, ".thickness") is None
        if result.lacking or (result.failure and has_none):
            continue
        if not truth_path(name).is_file():  # it is to be rendered yet
            continue
        if said is not None:
            said(name)
        scene = scene_named(name)
        try:
            truth, thickness = stored_truth_of(scene), read_thickness(folder, scene)
            if thickness is not None and picture_path(folder, name) is None:
                score = score_thickness_alone(thickness, truth)
            else:
                score = score_picture(read_picture(folder, scene), truth, thickness)
        except InputError as error:
            scenes[name] = dataclasses.replace(result, failure=str(error), score=None)
            continue
        scenes[name] = dataclasses.replace(result, failure="", score=score)
    return dataclasses.replace(results, scenes=scenes, folder=folder)


def floor_seconds(scene: BenchmarkScene) -> float:
    """Seconds of `FLOOR` for a scene on this machine: the median of five."""
    made = scene.make()
    origins, directions = (part.reshape(-1, 3) for part in made.camera.rays(scene.size))
    origins = np.ascontiguousarray(np.broadcast_to(origins, directions.shape))
    casters = []
    for item in made.objects:
        inverse = np.linalg.inv(item.matrix)
        casters.append((ray_caster_of(item.mesh), inverse))
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        for caster, inverse in casters:
            caster.nearest(origins @ inverse[:3, :3].T + inverse[:3, 3], directions @ inverse[:3, :3].T)
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


# --- files to send ---------------------------------------------------------------------------------------------------


def safe_name(name: str) -> str:
    """Name for a folder: letters, digits and dashes, never empty, never a path."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:60] or "renderer"


def pack(folder: Path, path: Path) -> None:
    """Write results.json and pictures of a folder as one .zip file."""

    def fill(part: Path) -> None:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            for one in sorted(folder.iterdir()):
                if one.is_file() and _is_ours(one.name):
                    archive.write(one, one.name)

    with OutputFiles() as written:
        written.write(path, fill)


def _is_ours(name: str) -> bool:
    scenes = {f"{scene}{what}{suffix}" for scene in scene_names() for what in ("", ".thickness") for suffix in SUFFIXES}
    return name == _RESULTS or name in scenes


def unpacked(path: Path, folder: Path) -> Path:
    """Unpack the known files of a .zip of results into a folder; raises `InputError` for other files."""
    asked = f"results {str(path)!r}"
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [one for one in archive.infolist() if _is_ours(one.filename)]
            if sum(one.file_size for one in entries) > LARGEST_ARCHIVE or any(o.file_size > LARGEST for o in entries):
                raise InputError(
                    asked,
                    "the file contains more data than the benchmark needs",
                    "pack the folder with the pictures again",
                )
            if not entries:
                raise InputError(
                    asked, "the file contains neither results.json nor pictures", "give the file that `run` wrote"
                )
            make_folder(folder)
            for one in entries:
                (folder / one.filename).write_bytes(archive.read(one))
    except (zipfile.BadZipFile, OSError, RuntimeError, NotImplementedError) as error:
        raise InputError(
            asked, f"the file is not a readable .zip ({error})", "give a folder or a .zip file of results"
        ) from error
    return folder


def result_folders(places: Sequence[Path], unpack_into: Path) -> list[Path]:
    """Folders of results among folders, folders of folders, and .zip files."""
    found: list[Path] = []
    for number, place in enumerate(places):
        if place.is_file():
            found.append(unpacked(place, unpack_into / f"{number}"))
        elif _has_results(place):
            found.append(place)
        else:
            inner = (
                [one for one in sorted(place.iterdir()) if one.is_dir() and _has_results(one)] if place.is_dir() else []
            )
            if not inner:
                raise InputError(
                    f"results {str(place)!r}",
                    "the folder or file contains no results",
                    "give a folder or file that `run` or `score` wrote",
                )
            found += inner
    return found


def _has_results(folder: Path) -> bool:
    return folder.is_dir() and (folder / _RESULTS).is_file()


def merge(places: Sequence[Path], into: Path, unpack_into: Path) -> list[Results]:
    """Copy results into one folder, each into a folder of its own, with scores computed here; returns them."""
    merged = []
    taken: set[str] = set()
    for folder in result_folders(places, unpack_into):
        results = scored(read_results(folder), folder)
        name = safe_name(results.name)
        name = next(one for one in _numbered(name) if one not in taken)
        taken.add(name)
        target = into / name
        make_folder(target)
        for path in sorted(folder.iterdir()):
            if path.is_file() and _is_ours(path.name) and path.name != _RESULTS and path.stat().st_size <= LARGEST:
                (target / path.name).write_bytes(path.read_bytes())
        kept = dataclasses.replace(results, folder=target)
        kept.write(target)
        merged.append(kept)
    return merged


def _numbered(name: str) -> Iterator[str]:
    yield name
    for number in range(2, 1000):
        yield f"{name}-{number}"


def write_picture(path: Path, radiance: Array) -> None:
    """Write linear radiance (h, w, 3) as an OpenEXR file in float32."""
    make_folder(path.parent)
    with OutputFiles() as written:
        written.write(path, lambda part: write_exr(part, {"RGB": np.asarray(radiance, np.float32)}, {}))


def write_thickness(path: Path, thickness: Array) -> None:
    """Write thickness (h, w) in metres as an OpenEXR file."""
    with OutputFiles() as written:
        written.write(path, lambda part: write_exr(part, {"thickness": np.asarray(thickness, np.float32)}, {}))
