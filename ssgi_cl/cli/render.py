"""The command `ssgi render`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from ssgi_cl.cli.facts import camera_facts, light_facts
from ssgi_cl.cli.frame_arguments import CULL, frame_arguments
from ssgi_cl.cli.frames import cameras_options, frames_options
from ssgi_cl.cli.views import Shot, render_views
from ssgi_cl.frame.params import AO_CONTACT, AO_DEFAULT, BOUNCES, DEFAULT_PRESET, PRESETS
from ssgi_cl.frame.render import Frame, render
from ssgi_cl.frame.skips import ONE_PICTURE, SKIPS
from ssgi_cl.io import png
from ssgi_cl.io.console import (
    VECTOR,
    GroupedCommand,
    checked_output,
    device_option,
    human_errors,
    json_option,
    memory_option,
    printable,
    progress,
    report,
)
from ssgi_cl.io.previews import VIEWS, gbuffer_views, levels_view, share_view
from ssgi_cl.techniques.catalogue import TECHNIQUES

_GROUPS = {
    "Output": ("output", "views", "width", "height", "exposure"),
    "Scene and camera": ("eye", "target", "up", "fov", "camera", "cull", "no_textures"),
    "Many pictures": ("cameras", "frames", "history", "fps", "video", "again", "scheduler"),
    "Light": (
        *("ambient", "environment", "bounces", "ao", "ao_radius", "ao_samples"),
        *("indirect", "method", "vpls", "glossy_vpls", "indirect_ao"),
    ),
    "Quality": ("preset", "samples", "edges", "layers", "auxiliary_cameras", "shadow_size", "rsm_size", "no_skips"),
    "Device and report": ("device", "max_memory", "explain", "as_json"),
}
"""Headings of the help, and the options under each."""


@click.command("render", cls=GroupedCommand, groups=_GROUPS)
@click.argument("scene", metavar="SCENE")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="The picture: .png, or .exr for linear radiance with AO and the G-buffer.",
)
@click.option(
    "--views", is_flag=True, help="Write .exr and views of AO, depth, normal and albedo beside the picture too."
)
@click.option("--width", type=int, help="Pixels; 800 by default.")
@click.option("--height", type=int, help="Pixels; 600 by default.")
@click.option("--eye", help="Where the camera is: world space, scene units.", **VECTOR)
@click.option("--target", help="What it looks at: world space, scene units.", **VECTOR)
@click.option("--up", help="Which way is up in the picture: world space; y by default.", **VECTOR)
@click.option("--fov", type=float, help="Vertical field of view in degrees; 50 by default.")
@click.option(
    "--camera",
    metavar="NAME|FILE",
    help="A camera of SCENE by its name (see `ssgi info`), or a JSON file with origin, "
    "forward, up (world space) and fov_deg (horizontal). By default the file named like "
    "SCENE with .scene.json at its end, else SCENE's first camera, else one that shows "
    "the scene well.",
)
@cameras_options
@click.option(
    "--cull",
    type=click.Choice(list(CULL)),
    default="file",
    show_default=True,
    help="Which back faces of SCENE are not there, for cameras and lights: as the file says (glTF: those of "
    "materials that are not double-sided), all, or none.",
)
@click.option("--no-textures", is_flag=True, help="Draw materials with their factors alone.")
@click.option("--ambient", type=float, help="Add a constant environment of this radiance, W m^-2 sr^-1.")
@click.option(
    "--environment",
    metavar="PATH|R,G,B",
    help="Light from all around in place of a sun "
    "and a sky: a latitude-longitude image (.exr, .hdr), or one radiance; W m^-2 sr^-1.",
)
@click.option(
    "--bounces",
    metavar="N|all",
    help="Reflections on the way from a light to a pixel; "
    "all by default. 0: direct light, and that of environments dimmed by --ao.",
)
@click.option(
    "--preset",
    type=click.Choice(tuple(PRESETS)),
    help=f"How exactly all bounces are computed; {DEFAULT_PRESET} by default.",
)
@click.option(
    "--ao",
    type=click.Choice((*TECHNIQUES, "none")),
    help=f"What dims ambient light; {AO_DEFAULT} by default, with all bounces {AO_CONTACT}.",
)
@click.option(
    "--ao-radius",
    type=float,
    help="Scene units; by default two cells of "
    "the occupancy grid, with --bounces 0 or --indirect 5 % of the picture's diagonal "
    "where surfaces are seen.",
)
@click.option("--ao-samples", type=int, help="Points per pixel of --ao ssao; 16 by default.")
@click.option(
    "--indirect",
    type=click.Choice(tuple(BOUNCES)),
    help="In place of all bounces the light "
    "that surfaces reflect once: of punctual lights, by virtual point lights "
    "(multires, the fastest, and vpl, which all triangles block) or gathered, or of all "
    "lights within --ao-radius by ssdo, which "
    "hides ambient light too.",
)
@click.option(
    "--method",
    metavar="NAME",
    help="How --indirect multires, gather or ssdo computes "
    "it: 'published' for the method as its paper has it; by default the library's own.",
)
@click.option(
    "--vpls", type=int, default=1024, show_default=True, help="Virtual point lights of --indirect multires and vpl."
)
@click.option(
    "--glossy-vpls",
    type=int,
    default=0,
    show_default=True,
    help="More lights of --indirect vpl, for what glossy surfaces mirror.",
)
@click.option("--indirect-ao", is_flag=True, help="Let --ao dim the light of --indirect multires, vpl and gather too.")
@click.option("--layers", type=int, default=1, show_default=True, help="Depth layers.")
@click.option(
    "--auxiliary-cameras",
    "--extra-cameras",
    type=int,
    default=0,
    show_default=True,
    help="Cameras that show --indirect ssdo what the camera misses.",
)
@click.option(
    "--edges", type=int, help="Places of each pixel that smooth edges, 0 for none; 7 by default in the whole picture."
)
@click.option("--samples", type=int, default=1, show_default=True, help="Frames that the picture is the mean of.")
@click.option("--shadow-size", type=int, default=1024, show_default=True, help="Texels along a shadow map's side.")
@click.option(
    "--rsm-size",
    type=int,
    default=512,
    show_default=True,
    help="Of them, at most so many along a side are what reflected light is chosen from.",
)
@click.option("--explain", is_flag=True, help="Say of all that was left out how much time that saves, by estimate.")
@click.option("--no-skips", is_flag=True, help="Leave nothing out; the picture is the same.")
@click.option("--exposure", type=float, help="Factor before the tone curve; automatic by default, and printed.")
@frames_options
@memory_option
@device_option
@json_option
@human_errors
def render_command(
    scene: str,
    output: Path,
    cameras: Path | None,
    fps: float,
    history: bool,
    video: Path | None,
    frames: str | None,
    again: bool,
    scheduler: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Render SCENE, a .glb, .gltf, .obj or .ply file with y up, a built-in scene (cornell_box,
    hall, parlour, terrace, workshop), or a generated one: KIND-SEED, such as room-7, with KIND
    room, colonnade, foliage, machine, street or terrain.

    A file's scene is lit by the lights that the file describes (glTF, KHR_lights_punctual), one
    without by a sun and a sky, a closed room by a light. What a file says that is not drawn is
    listed. Times are milliseconds on the device.

    With --cameras the scene is loaded once, and a picture drawn for each; what is done already is skipped, and the
    exit status is 1 if any failed. Without lights of its own the scene is lit as for the first camera in all of
    them. With --history a run that goes on after an interruption renders up to 32 frames before what is missing
    again, for their light.
    """
    if cameras is not None:
        shot = Shot(cameras, frames, fps=fps, history=history, video=video)
        render_views(scene, shot, output, options, again=again, scheduler=scheduler, as_json=as_json)
        return
    if frames is not None or again or scheduler is not None or history or video is not None:
        raise click.UsageError("--frames, --history, --video, --again and --scheduler go with --cameras")
    _render_one(scene, output, options, as_json=as_json)


def _render_one(scene: str, output: Path, options: dict[str, Any], *, as_json: bool) -> None:
    """Render one picture and report what ran."""
    endings: tuple[str, ...] = ()
    if options["views"]:
        endings = (".exr", *(f".{name}.png" for name in (*VIEWS, "ao", "levels")))
    for path in (output, *map(output.with_suffix, endings)):
        checked_output(path, (".png", ".exr"))
    most = options["max_memory"]
    if most is not None and (options["views"] or output.suffix.lower() != ".png"):
        raise click.UsageError("--max-memory gives a picture alone: expected a .png as --output, and no --views")
    several = options["samples"] != 1
    skips = frozenset[str]() if options["no_skips"] else frozenset(SKIPS) if several else ONE_PICTURE
    with progress(as_json) as step:
        loaded, camera, lights, arguments = frame_arguments(scene, options, step)
        runtime = arguments["runtime"]
        if most is not None:
            step("rendering bands")
            frame = render(loaded, camera, lights, outputs=("image",), max_memory=most, **arguments)
            frame.save(output)
            files = [output]
        else:
            # Kernels are compiled for the first of two pictures; the second one's times are told.
            once = {**arguments, "samples": 1}
            render(loaded, camera, lights, skips=skips, progress=partial(step, "compiling kernels"), **once)
            step("rendering")
            tell = partial(step, "rendering") if several else None
            frame = render(loaded, camera, lights, gbuffer=True, skips=skips, progress=tell, **arguments)
            step("writing files")
            files = _write(frame, output, views=options["views"])
    if not as_json:
        for note in loaded.notes:
            click.echo(printable(f"note: {note}"), err=True)
    report(
        as_json,
        runtime,
        frame.passes,
        files,
        {
            "scene": scene,
            "width": camera.width,
            "height": camera.height,
            "triangles": len(loaded.triangles),
            "camera": camera_facts(camera),
            "lights": [light_facts(light) for light in lights],
            "exposure": frame.exposure,
            "wall_ms": round(frame.wall_ms, 3),
            "notes": list(loaded.notes),
        },
        explain=options["explain"],
    )


def _write(frame: Frame, output: Path, *, views: bool) -> list[Path]:
    gbuffer = frame.gbuffer
    assert gbuffer is not None  # noqa: S101  it was asked for
    written = [output]
    if views and output.suffix.lower() == ".png":
        written.append(output.with_suffix(".exr"))
    for path in written:
        frame.save(path)
    if views:
        pictures = gbuffer_views(gbuffer)
        if frame.ao is not None:
            pictures["ao"] = share_view(frame.ao)
        if frame.levels is not None:
            pictures["levels"] = levels_view(frame.levels)
        for name, view in pictures.items():
            written.append(output.with_suffix(f".{name}.png"))
            png.write(written[-1], view)
    return written
