"""``translucent benchmark``: scenes with truth, for any renderer; its pictures scored, and a page of results."""

from __future__ import annotations

import dataclasses
import json
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from translucent.commands.console import echo
from translucent.errors import InputError, RenderError, TranslucentError
from translucent.extras import require_package

if TYPE_CHECKING:
    from translucent.benchmark.results import Results
    from translucent.benchmark.scenes import BenchmarkScene

_FOLDER = click.Path(path_type=Path)
_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
_DEBUG = click.option("--debug", is_flag=True, hidden=True)
_ONLY = click.option(
    "--only",
    multiple=True,
    metavar="SCENE,...",
    help="Use only these scenes, or groups of scenes such as scattering. Repeatable.",
)


@click.group(
    epilog="Example: translucent benchmark list",
)
def benchmark() -> None:
    """Score renderers on thirty scenes with known true pictures."""


@benchmark.command("list", epilog="Example: translucent benchmark list")
@_JSON
@_DEBUG
def list_scenes(as_json: bool, debug: bool) -> None:
    """List the scenes and their purposes, and available renderers."""
    from translucent.benchmark.adapters import adapters
    from translucent.benchmark.scenes import SCENES
    from translucent.benchmark.truth import read_records

    records = read_records()
    known = {name: one.missing() for name, one in adapters().items()}
    if as_json:
        scenes = [
            {"name": one.name, "title": one.title, "tests": one.tests, "group": one.group, "needs": one.needs}
            for one in SCENES
        ]
        echo(json.dumps({"scenes": scenes, "adapters": known}))
        return
    echo(f"{'scene':<16}{'tests':<44}{'noise':>7}  needs")
    for one in SCENES:
        noise = f"{records[one.name].noise:.1%}" if one.name in records else "-"
        echo(f"{one.name:<16}{one.tests:<44}{noise:>7}  {', '.join(one.needs)}")
    echo(f"\nrenderers here: {', '.join(name for name, why in known.items() if not why)}")
    for name, why in known.items():
        if why:
            echo(f"not here: {name}: {why}")


@benchmark.command(epilog="Example: translucent benchmark export scenes --only glass-ball,jade")
@click.argument("folder", type=_FOLDER)
@_ONLY
@_DEBUG
def export(folder: Path, only: tuple[str, ...], debug: bool) -> None:
    """Write the scenes into FOLDER as glTF, JSON and EXR files."""
    from translucent.benchmark.export import export_scenes

    require_package("OpenEXR", "benchmark export")
    found = export_scenes(folder, _chosen(only))
    echo(f"{len(found)} scenes in {folder}; {folder / 'README.txt'} explains them")


@benchmark.command(epilog="Example: translucent benchmark run ours mitsuba-64 -o results")
@click.argument("names", metavar="ADAPTER...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    type=_FOLDER,
    required=True,
    metavar="DIR",
    help="Output folder, with a subfolder for each renderer.",
)
@_ONLY
@_JSON
@_DEBUG
def run(names: tuple[str, ...], output: Path, only: tuple[str, ...], as_json: bool, debug: bool) -> None:
    """Render the scenes with installed renderers, and score them.

    The results of each renderer are written to DIR/ADAPTER/, and packed into DIR/ADAPTER.zip, which you can send to
    others. The adapter name `all` selects all installed renderers.
    """
    from translucent.benchmark.adapters import adapter_named, adapters, run_adapter
    from translucent.benchmark.results import pack

    require_package("OpenEXR", "benchmark run")
    known = [one.name for one in adapters().values() if not one.missing()] if names == ("all",) else names
    chosen = [adapter_named(name) for name in known]
    scenes = _chosen(only)
    made, failed = [], []
    for adapter in chosen:
        begun = time.process_time()
        try:
            results = run_adapter(adapter, scenes, output / adapter.name, partial(_say, adapter.name))
        except TranslucentError as error:
            if len(chosen) == 1:
                raise
            failed.append(str(error))
            echo(f"warning: {error}", err=True)
            continue
        pack(output / adapter.name, output / f"{adapter.name}.zip")
        made.append(results)
        if not as_json:
            echo(_table(results))
            echo(f"{adapter.name}: {time.process_time() - begun:.0f} s of processor time; {output / adapter.name}.zip")
    if as_json:
        echo(json.dumps([_summary(one) for one in made]))
    if failed:
        raise RenderError("benchmark run", f"{len(failed)} of {len(chosen)} renderers did not run", failed[0])


@benchmark.command(epilog='Example: translucent benchmark score my-pictures --name "My renderer" --version 1.2')
@click.argument("folder", type=_FOLDER)
@click.option("--name", help="Name of the renderer. Default: the name in results.json, or the name of the folder.")
@click.option("--version", help="Version of the renderer.")
@click.option("--settings", help="Settings of the renderer, such as samples.")
@click.option("--device", help="Device that rendered the pictures, such as a graphics card.")
@click.option(
    "--elsewhere",
    is_flag=True,
    help="State that the pictures were rendered on another machine, so that no reference time is measured.",
)
@_JSON
@_DEBUG
def score(
    folder: Path,
    name: str | None,
    version: str | None,
    settings: str | None,
    device: str | None,
    elsewhere: bool,
    as_json: bool,
    debug: bool,
) -> None:
    """Score your pictures of the scenes in FOLDER.

    FOLDER contains SCENE.exr or SCENE.npy for each scene, with linear radiance at the size of the scene.

    The scores are written to FOLDER/results.json, and packed into FOLDER.zip, which you can send to others. Scenes
    without a picture are not counted.
    """
    from translucent.benchmark.results import floor_seconds, pack, read_results, scored, this_machine, today
    from translucent.benchmark.scenes import scene_named

    require_package("OpenEXR", "benchmark score")
    found = read_results(folder)
    found = dataclasses.replace(
        found,
        name=found.name if name is None else name,
        version=found.version if version is None else version,
        settings=found.settings if settings is None else settings,
        device=found.device if device is None else device,
    )
    if not found.scenes:
        raise InputError(
            f"pictures in {str(folder)!r}",
            "no file in the folder has the name of a scene",
            "run 'translucent benchmark list' to see the names",
        )
    if not elsewhere:
        found = dataclasses.replace(found, machine=found.machine or this_machine())
        timed = {
            key: dataclasses.replace(one, floor=one.floor or floor_seconds(scene_named(key)))
            for key, one in found.scenes.items()
            if one.seconds is not None
        }
        found = dataclasses.replace(found, scenes={**found.scenes, **timed})
    found = dataclasses.replace(scored(found, folder), date=found.date or today())
    found.write(folder)
    archive = folder.resolve().with_suffix(".zip")
    pack(folder, archive)
    if as_json:
        echo(json.dumps(_summary(found)))
    else:
        echo(_table(found))
        echo(f"written: {folder / 'results.json'}, {archive}")
    failed = [f"{key}: {one.failure}" for key, one in found.scenes.items() if one.failure]
    if failed:
        raise RenderError(
            f"score {str(folder)!r}",
            f"{len(failed)} pictures could not be scored: {failed[0]}",
            "the messages above name the reasons",
        )


@benchmark.command(epilog="Example: translucent benchmark page results -o benchmark.html")
@click.argument("places", metavar="RESULTS...", type=_FOLDER, nargs=-1, required=True)
@click.option(
    "-o", "--output", type=_FOLDER, required=True, metavar="FILE", help="Output file, such as benchmark.html."
)
@_DEBUG
def page(places: tuple[Path, ...], output: Path, debug: bool) -> None:
    """Write one HTML page about results (folders or .zip files)."""
    from translucent.benchmark.page import write_benchmark_page
    from translucent.benchmark.results import read_results, result_folders, scored

    require_package("OpenEXR", "benchmark page")
    if output.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"page {str(output)!r}", "not an .html file", "name it for example benchmark.html")
    with tempfile.TemporaryDirectory(prefix="translucent-benchmark-") as temporary:
        folders = result_folders(places, Path(temporary))
        write_benchmark_page([scored(read_results(one), one) for one in folders], output)
    echo(f"{output}: {len(folders)} results")


@benchmark.command(epilog="Example: translucent benchmark merge mine theirs.zip -o all")
@click.argument("places", metavar="RESULTS...", type=_FOLDER, nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    type=_FOLDER,
    required=True,
    metavar="DIR",
    help="Output folder, with a subfolder for each renderer.",
)
@_JSON
@_DEBUG
def merge(places: tuple[Path, ...], output: Path, as_json: bool, debug: bool) -> None:
    """Join results (folders or .zip files), and score them again."""
    from translucent.benchmark.results import merge as merged

    with tempfile.TemporaryDirectory(prefix="translucent-benchmark-") as temporary:
        made = merged(places, output, Path(temporary))
    if as_json:
        echo(json.dumps([_summary(one) for one in made]))
        return
    for one in made:
        echo(f"{one.folder}: {one.name} {one.version}, {len(one.scenes)} scenes, {one.machine or 'machine not stated'}")


def _say(renderer: str, scene: str) -> None:
    echo(f"{renderer}: {scene}", err=True)


def _chosen(only: tuple[str, ...]) -> list[BenchmarkScene]:
    """Scenes that ``--only`` names, by name or group, each time that it is given; none: all."""
    from translucent.benchmark.scenes import SCENES, scene_named

    if not only:
        return list(SCENES)
    words = [word.strip() for text in only for word in text.split(",")]
    named = {scene.name for word in words for scene in SCENES if word == scene.group}
    named |= {scene_named(word).name for word in words if all(word != scene.group for scene in SCENES)}
    return [scene for scene in SCENES if scene.name in named]


def _summary(results: Results) -> dict[str, object]:
    """Results as the object that ``--json`` prints."""
    from translucent.benchmark.results import plain_results

    return plain_results(results)


def _table(results: Results) -> str:
    """Text about results, a line for each scene."""
    from translucent.benchmark.page import table_of

    return table_of(results)
