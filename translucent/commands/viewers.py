"""``translucent preview`` and ``translucent page``: a scene in a window, and in a page for browsers."""

from __future__ import annotations

import dataclasses
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import click

from translucent.commands.console import echo
from translucent.commands.model import (
    SceneRequest,
    echo_advice,
    file_unit,
    files_of,
    medium_lines,
    models_argument,
    read_scene,
    require_translucent,
)
from translucent.commands.options import (
    BodyOptions,
    CameraOptions,
    ChoiceOptions,
    FileOptions,
    LookOptions,
    ground_option,
    overwrite_option,
    read_size,
    refuse_overwriting,
    stage_option,
    verbose_option,
)
from translucent.commands.verbs import VerbCommand, group, option, takes
from translucent.errors import InputError, RenderError, TranslucentError, message_of
from translucent.extras import require_package
from translucent.units import parse_length


def _stage_words() -> str:
    from translucent.scene.stages import STAGES

    return (
        f"Ground, backdrop and lights of the model: {', '.join(STAGES)}, none, or auto (the choice of translucent "
        "render). Default: the stage of the last session, or auto; with --script, none."
    )


@dataclass(frozen=True, kw_only=True)
class PreviewOptions:
    """Options of ``translucent preview``."""

    file: FileOptions = group(FileOptions, without=("draft_extensions",))
    session: Path | None = option(metavar="FILE", help="Open this saved session, a .toml file.")
    stage: str | None = option(metavar="S", help=_stage_words)
    size: str = option("1600x1000", metavar="WxH", help="Size of the window in pixels.")
    scale: float = option(1.0, help="Scale of text and controls, 0.5 to 4.")
    script: Path | None = option(metavar="FILE", help="Run the actions of this .toml file, then close the window.")
    screenshot: Path | None = option(
        metavar="PNG", help="Before the window closes, save a picture of the window as this .png file."
    )


@click.command(epilog="Example: translucent preview goblet")
@models_argument(required=False)
@takes(PreviewOptions)
def preview(model: str | None, given: PreviewOptions, as_json: bool) -> None:
    """Open MODEL in a window.

    MODEL is a file or a built-in mesh. Without MODEL, the window shows a goblet.

    With --script, the window runs the actions of the script, and closes. --screenshot saves a picture of the window. If
    an action fails, the next actions still run, and the exit code is 2 for a wrong request, and 1 for any other
    failure.
    """
    from translucent.preview.document import AUTO, Document, Look, Model
    from translucent.preview.script import Script, read_script
    from translucent.preview.session import Preferences, load_session
    from translucent.preview.tasks import problem
    from translucent.scene.stages import stage_named

    session, stage, script, screenshot = given.session, given.stage, given.script, given.screenshot
    if stage is not None and stage != AUTO:
        stage_named(stage)
    if session is not None and model is not None:
        raise InputError(
            f"--session {str(session)!r}",
            f"{model} is given, too, but a session already names its model",
            "omit MODEL, or omit --session",
        )
    if not 0.5 <= given.scale <= 4.0:
        raise InputError(f"--scale {given.scale}", "the scale must lie in 0.5 to 4", "use a value such as 2")
    if screenshot is not None and (screenshot.suffix.lower() != ".png" or not screenshot.parent.is_dir()):
        raise InputError(
            f"--screenshot {str(screenshot)!r}",
            "this is not a .png file in an existing folder",
            "give the path of a .png file in an existing folder",
        )
    pixels = read_size(given.size)
    if session is not None:
        document = load_session(session)
    else:
        document = Document() if script or screenshot else Document(look=Look(stage=Preferences.read().stage))
    if stage is not None:
        document = dataclasses.replace(document, look=dataclasses.replace(document.look, stage=stage))
    if model is not None:
        document = dataclasses.replace(document, model=Model(model, file_unit(model, given.file)))
    todo = read_script(script) if script is not None else Script.of([]) if screenshot is not None else None
    require_display()
    from translucent.preview.app import leave, run

    shot = str(screenshot) if screenshot is not None else None
    work = run(document, pixels, given.scale, todo, shot, given.file.allow_outside)
    failure = None if todo is None else work.failure
    if as_json:
        reported = [{"kind": message.kind, "text": message.text} for message in work.messages]
        echo(json.dumps({"model": work.document.model.path, "messages": reported}))
    elif todo is not None:
        for message in work.messages:
            # The error by which the script fails is the last line, as that of any verb.
            if failure is None or message.text != problem(failure):
                echo(f"{message.kind}: {message.text}", err=True)
    error = failure if failure is None or isinstance(failure, TranslucentError) else RenderError(problem(failure))
    if error is not None and not work.ended:
        echo(f"error: {message_of(str(error))}", err=True)
    leave(work, 0 if error is None else 2 if isinstance(error, InputError) else 1)
    if error is not None:
        raise error


def require_display() -> None:
    """Raise if there is no display for a window, or no package that could open one.

    Raises
    ------
    RenderError
        It names the way without a window.
    """
    without = "to render without a window, use translucent render MODEL -o picture.png"
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise RenderError("preview", "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)", without)
    require_package("imgui_bundle", "preview", without)


#: Values of --poster that are no files.
RENDERED, NO_POSTER = "rendered", "none"


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Options of ``translucent page``."""

    output: Path = option(names=("-o", "--output"), required=True, help="Output file, such as viewer.html.")
    medium: BodyOptions = group(BodyOptions)
    file: FileOptions = group(FileOptions, without=("draft_extensions",))
    size: str = option(
        "1280x800", metavar="WxH", help="Size of the poster picture, and aspect ratio of the first view, in pixels."
    )
    camera: CameraOptions = group(CameraOptions)
    stage: str | None = stage_option()
    ground: str | None = ground_option()
    look: LookOptions = group(LookOptions)
    choices: ChoiceOptions = group(ChoiceOptions, without=("paths", "caustics", "adaptive"))
    samples: int = option(16, metavar="N", help="Number of samples per pixel while the view is still.")
    title: str | None = option(metavar="TEXT", help="Title of the HTML page. Default: the name of the model.")
    poster: str = option(
        RENDERED,
        metavar="PICTURE",
        help=(
            "Poster: the picture that the page shows until the scene is loaded, and in browsers without "
            "WebGL2. A .png, .jpg or .webp file, or rendered, or none."
        ),
    )
    simplify: int | None = option(metavar="N", help="Simplify the model to about N triangles for the page.")
    overwrite: bool = overwrite_option()
    verbose: bool = verbose_option()


@click.command(
    cls=VerbCommand,
    usual="output color distance preset height size orbit stage roughness title simplify",
    epilog="Example: translucent page goblet -o goblet.html --color '#7b1e3a' --distance 1cm",
)
@models_argument()
@takes(PageOptions)
def page(model: str, given: PageOptions, as_json: bool) -> None:
    """Write MODEL as an interactive HTML page.

    MODEL is a file or a built-in mesh. The page works in any browser with WebGL2. The page is one file, which
    fetches nothing from the network. On the page, you can turn the model, change its material on a panel, show its
    thickness in false colors, and probe single pixels. The page runs the passes of the renderer. The command prints
    the effects that the page leaves out, and the page lists them, too.
    """
    from translucent.files.paths import write_text_atomically
    from translucent.page.plans import plan_page, simplified, triangles
    from translucent.page.write import check_output, check_page_size, page_html, poster_of
    from translucent.scene.stages import STAGED_TONE

    output, look = given.output, given.look
    check_output(output)
    refuse_overwriting(output, *files_of(model), look.environment, look.background)
    pixels = check_page_size(read_size(given.size))
    picture = _read_poster(given.poster)
    requested = SceneRequest(
        medium=given.medium.read(),
        keeps_ior=given.medium.keeps_ior,
        change=given.medium.change,
        camera=given.camera,
        file=given.file,
        size=pixels,
        environment=look.lighting(),
        environment_shadows=given.choices.environment_shadows,
        roughness=given.medium.surface_roughness(look.roughness),
        pattern=given.medium.surface_pattern,
        stage=given.stage,
        ground=given.ground,
    )
    scene = read_scene(model, requested)
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
    text = page_html(planned, title, pixels, given.samples, look.exposure, tone, picture)
    write_text_atomically(output, text)
    written = len(text.encode())
    media = medium_lines(scene, planned.panel_distance)  # as the panel shows them
    if as_json:
        reported = {
            "output": str(output),
            "bytes": written,
            "triangles": triangles(scene),
            "plan": planned.plan.summary(),
            "notes": [{"kind": str(note.kind), "text": str(note)} for note in planned.notes],
            "medium": "; ".join(media),
        }
        echo(json.dumps(reported))
        return
    echo(f"{output}: {written / 1e6:.2f} MB")
    if given.simplify is not None:
        echo(f"simplified: {before:,} triangles to {triangles(scene):,}")
    for note in planned.own_notes:
        echo(f"page: {note}")
    if given.verbose:
        for line in media:
            echo(f"medium: {line}")
        echo(str(planned.plan))
    echo_advice(scene, planned.plan.remarks)


def _read_poster(poster: str) -> bytes | None:
    """Bytes of a poster, read from a file and checked."""
    if poster in (RENDERED, NO_POSTER):
        return None
    from translucent.files.paths import require_file
    from translucent.page.write import check_poster

    require_file(Path(poster), f"--poster {poster!r}")
    return check_poster(Path(poster).read_bytes(), f"--poster {poster!r}")
