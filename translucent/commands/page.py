"""``translucent page``: a scene as one file for any browser."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

import click

from translucent.commands.console import echo
from translucent.commands.model import SceneRequest, medium_lines, read_scene, require_translucent
from translucent.commands.options import (
    AnyMediumOptions,
    CameraOptions,
    ChoiceOptions,
    FileOptions,
    LookOptions,
    group,
    option,
    overwrite_option,
    read_size,
    refuse_overwriting,
    stage_option,
    takes,
)
from translucent.errors import RenderError
from translucent.units import parse_length

#: Values of --poster that are no files.
RENDERED, NO_POSTER = "rendered", "none"


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Options of ``translucent page``."""

    output: Path = option(names=("-o", "--output"), required=True, help="An .html file.")
    medium: AnyMediumOptions = group(AnyMediumOptions)
    file: FileOptions = group(FileOptions, without=("draft_extensions",))
    size: str = option("1280x800", metavar="WxH", help="Of the poster, and of what the view frames.")
    camera: CameraOptions = group(CameraOptions)
    stage: str | None = stage_option()
    look: LookOptions = group(LookOptions)
    choices: ChoiceOptions = group(ChoiceOptions, without=("paths", "caustics"))
    samples: int = option(16, metavar="N", help="Samples per pixel while nothing moves.")
    title: str | None = option(metavar="TEXT", help="Of the page. Default: the name of the model.")
    poster: str = option(
        RENDERED,
        metavar="PICTURE",
        help="Shown until the scene is, and where there is no WebGL2: a .png, .jpg or .webp, rendered, or none.",
    )
    simplify: int | None = option(metavar="N", help="Show a copy of the model with about N triangles.")
    overwrite: bool = overwrite_option()


@click.command(epilog="Example: translucent page goblet -o goblet.html --color '#7b1e3a' --distance 1cm")
@click.argument("model")
@takes(PageOptions)
def page(model: str, given: PageOptions, as_json: bool) -> None:
    """Write MODEL, a file or one of the toolkit's own meshes, as a page that any browser with WebGL2 shows.

    One file, which fetches nothing: to turn around, with the material on a panel, the thickness in false colors, and a
    probe. It runs the passes of the renderer; what it leaves out is told here and on the page.
    """
    from translucent.page.plans import plan_page, simplified, triangles
    from translucent.page.write import check_output, check_page_size, poster_of, save_page
    from translucent.scene.stages import STAGED_TONE

    output, look = given.output, given.look
    check_output(output)
    refuse_overwriting(output, model, look.environment, look.background)
    pixels = check_page_size(read_size(given.size))
    picture = _read_poster(given.poster)
    asked = SceneRequest(
        medium=given.medium.read(),
        camera=given.camera,
        file=given.file,
        size=pixels,
        environment=look.lighting(),
        environment_shadows=given.choices.environment_shadows,
        roughness=given.medium.surface_roughness(look.roughness),
        stage=given.stage,
    )
    scene = read_scene(model, asked)
    require_translucent(model, scene)
    before = triangles(scene)
    if given.simplify is not None:
        scene = simplified(scene, given.simplify)
    tone = look.tone or (STAGED_TONE if len(scene.shown) < len(scene.objects) else "none")
    planned = plan_page(scene, given.choices.read())
    if given.medium.distance is not None:
        planned = dataclasses.replace(planned, distance=parse_length(given.medium.distance))
    if given.poster == RENDERED:
        try:
            picture = poster_of(planned, pixels, look.exposure, tone)
        except RenderError as error:
            echo(f"warning: no poster: {error}", err=True)
    title = given.title or Path(model).stem
    written = save_page(planned, output, title, pixels, given.samples, look.exposure, tone, picture)
    media = medium_lines(scene, planned.panel_distance)  # as the panel shows them
    if as_json:
        told = {
            "output": str(output),
            "bytes": written,
            "triangles": triangles(scene),
            "plan": planned.plan.summary(),
            "notes": [{"kind": str(note.kind), "text": str(note)} for note in planned.notes],
            "medium": "; ".join(media),
        }
        echo(json.dumps(told))
        return
    echo(f"{output}: {written / 1e6:.2f} MB")
    if given.simplify is not None:
        echo(f"simplified: {before:,} triangles to {triangles(scene):,}")
    for line in media:
        echo(f"medium: {line}")
    echo(str(planned.plan))
    for note in planned.own_notes:
        echo(f"  page: {note}")


def _read_poster(poster: str) -> bytes | None:
    """Picture of a file."""
    if poster in (RENDERED, NO_POSTER):
        return None
    from translucent.files.paths import require_file
    from translucent.page.write import check_poster

    require_file(Path(poster), f"--poster {poster!r}")
    return check_poster(Path(poster).read_bytes(), f"--poster {poster!r}")
