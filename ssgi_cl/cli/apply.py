"""The command `ssgi apply`."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import click

from ssgi_cl.cli.frames import frames_options, run_frames
from ssgi_cl.core.depth_kind import KINDS
from ssgi_cl.core.errors import shown
from ssgi_cl.core.gbuffer import NAN
from ssgi_cl.core.keywords import unknown_name
from ssgi_cl.core.normal_space import ENCODED, SPACES
from ssgi_cl.core.params import Params, describe, parameter_fields
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.io.console import (
    GroupedCommand,
    NearestChoice,
    checked_output,
    device_option,
    human_errors,
    json_option,
    memory_option,
    progress,
    report,
    wrapped,
    yfov_of,
)
from ssgi_cl.io.exr_layouts import LAYOUTS
from ssgi_cl.sequences.apply_exr import ApplyExr, lights_of
from ssgi_cl.sequences.exr_image import ExrImage
from ssgi_cl.sequences.exr_passes import Passes
from ssgi_cl.sequences.frame_names import FrameNames
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.technique import Technique

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")

_LONG = 300
"""Letters that no number has."""

OFFERED = {name: each for name, each in CATALOGUE.items() if each.command}
"""The techniques that `ssgi apply` takes."""
_GROUPS = {
    "Output": ("output", "overwrite", "confidence"),
    "Input": (
        *("layout", "channels", "layer", "part", "depth_kind", "depth_range", "normal_space", "no_normals"),
        *("nan", "invalid"),
    ),
    "Camera": ("fov", "camera_file", "ortho", "intrinsics"),
    "Sequence": ("frames", "again", "scheduler"),
    "Light (ssdo)": ("sky", "sun", "lit"),
    "Quality": ("settings", "method", "preset", "error", "budget_ms"),
    "Device and report": ("device", "max_memory", "as_json"),
}
"""Headings of the help, and the options under each."""


@click.command("apply", cls=GroupedCommand, groups=_GROUPS)
@click.argument("technique", type=NearestChoice(sorted(OFFERED)))
@click.argument("source", metavar="IN.exr", required=False, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The result, .exr.")
@click.option("--overwrite", is_flag=True, help="Let the output be IN.exr itself: the result is added to its channels.")
@click.option(
    "--confidence",
    is_flag=True,
    help="Ambient occlusion: write a channel 'confidence' too, 1 where it may be trusted, down to 0.",
)
@click.option(
    "--fov",
    type=float,
    help="Vertical field of view of the file's display window in degrees; by default the camera in its header, "
    "else 50.",
)
@click.option(
    "--camera",
    "camera_file",
    metavar="FILE",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="JSON file with origin, forward, up (world space) and fov_deg (horizontal), as of `ssgi render`.",
)
@click.option(
    "--ortho",
    type=float,
    metavar="HEIGHT",
    help="Orthographic camera whose display window is this high, in scene units.",
)
@click.option(
    "--intrinsics",
    nargs=4,
    type=float,
    metavar="FX FY CX CY",
    help="Calibrated camera, in pixels; CX CY from the display window's corner.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A parameter of the technique, such as radius=0.3; several times. '--set help' lists them with their units.",
)
@click.option(
    "--method",
    metavar="NAME",
    help="Short for --set method=NAME: how ssdo finds "
    "surfaces, 'published' as its paper has it if there is such a method.",
)
@click.option(
    "--preset",
    metavar="NAME",
    help="Where parameters without --set come from: low, medium, high or ultra; by default the technique's defaults.",
)
@click.option(
    "--error",
    type=float,
    metavar="RMSE",
    help="Instead of a preset: the fastest recorded setting that is expected to be no further from cast rays.",
)
@click.option(
    "--budget-ms",
    type=float,
    metavar="MS",
    help="Instead of a preset: the best recorded setting that is expected to take no longer on this device.",
)
@click.option(
    "--sky", nargs=3, type=float, metavar="R G B", help="ssdo: a constant environment of this radiance, W m^-2 sr^-1."
)
@click.option(
    "--sun",
    nargs=4,
    type=float,
    metavar="X Y Z E",
    help="ssdo: parallel light that travels along X Y Z in camera space, with irradiance E in W/m^2.",
)
@click.option("--lit", is_flag=True, help="ssdo: the file's R, G and B are the light that surfaces send, W m^-2 sr^-1.")
@click.option(
    "--nan",
    type=click.Choice(NAN),
    default="refuse",
    show_default=True,
    help="What NaN in the file means: 'hole' takes a NaN depth for nothing there and other NaN for 0.",
)
@click.option(
    "--invalid",
    multiple=True,
    type=float,
    metavar="DEPTH",
    help="A depth that means that nothing is there, such as 0; several times.",
)
@click.option("--no-normals", is_flag=True, help="Ignore normals in the file; those of the depth are used.")
@click.option(
    "--normals",
    "normal_space",
    metavar="SPACE",
    help=f"Space of the file's normals: {', '.join(SPACES)}, each with '{ENCODED}' if they are stored in 0..1. By "
    "default it is found by holding them to the depth.",
)
@click.option(
    "--depth",
    "depth_kind",
    type=click.Choice(KINDS),
    help="Kind of the file's depth. By default planar, ray or inverse, found by planes in it.",
)
@click.option(
    "--depth-range",
    nargs=2,
    type=float,
    metavar="AT0 AT1",
    help="Depths, in scene units, of the values 0 and 1 of a depth that is remapped to 0..1.",
)
@click.option(
    "--layout", type=NearestChoice(list(LAYOUTS)), help="Program whose conventions IN.exr has; guessed by default."
)
@click.option(
    "--channels",
    multiple=True,
    metavar="WHAT=NAME",
    help="Channel of 'depth', or stem of the channels of 'normal', such as normal=ViewLayer.Normal; several times.",
)
@click.option("--layer", metavar="NAME", help="Layer whose channels are read, such as ViewLayer; found by default.")
@click.option("--part", metavar="NAME", help="Part of a file of several parts; all by default.")
@frames_options
@memory_option
@device_option
@json_option
@human_errors
def apply_command(
    technique: str,
    source: Path | None,
    output: Path | None,
    overwrite: bool,
    confidence: bool,
    fov: float | None,
    camera_file: Path | None,
    ortho: float | None,
    intrinsics: tuple[float, ...] | None,
    settings: tuple[str, ...],
    method: str | None,
    preset: str | None,
    error: float | None,
    budget_ms: float | None,
    sky: tuple[float, ...] | None,
    sun: tuple[float, ...] | None,
    lit: bool,
    nan: str,
    invalid: tuple[float, ...],
    no_normals: bool,
    normal_space: str | None,
    depth_kind: str | None,
    depth_range: tuple[float, float] | None,
    layout: str | None,
    channels: tuple[str, ...],
    layer: str | None,
    part: str | None,
    frames: str | None,
    again: bool,
    scheduler: str | None,
    max_memory: int | None,
    device: str | None,
    as_json: bool,
) -> None:
    """Apply TECHNIQUE to the G-buffer in IN.exr (depth, and normals if it has them).

    Depth is in scene units, planar (the distance to the camera's plane) or along the view ray, which is found;
    1e10 and more is where nothing is. The camera is that of the file's header where it has one.
    The space of the normals is found: camera space (+x right, +y up, +z towards the viewer, or with
    other axes), or a world's, as those of `ssgi render` and of Blender; what was read and found is
    printed. The result covers the file's data window, margin included.

    With #### for the numbers of frames in the names of IN.exr and of the output, a sequence is done: what is done
    already is skipped, a bad frame stops no other, and the exit status is 1 if any failed.

    ssdo writes irradiance, direct and bounce. Without --sky, --sun and --lit its light is a sky of
    radiance 1.
    """
    chosen = OFFERED[technique]
    params = chosen.params
    if "help" in settings:
        _list_parameters(params, as_json)
        return
    if source is None:
        raise click.UsageError("Missing argument 'IN.exr'.")
    if output is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    if method is not None:
        settings = (*settings, f"method={method}")
    parameters = dict(_setting(text, technique, params) for text in settings)
    asked = {"preset": preset, "error": error, "budget_ms": budget_ms}
    parameters |= {name: value for name, value in asked.items() if value is not None}
    if confidence:
        if chosen.kind != "ao":
            raise click.UsageError(f"--confidence is for ambient occlusion: {technique} has none")
        if max_memory is not None:
            raise click.UsageError("--confidence is of the whole image: expected no --max-memory")
        parameters["confidence"] = True
    _check_lights(chosen, {"--sky": sky, "--sun": sun, "--lit": lit or None}, asked)
    if sum(value is not None for value in (fov, ortho, intrinsics, camera_file)) > 1:
        raise click.UsageError("--fov, --camera, --ortho and --intrinsics exclude each other")
    passes = Passes(
        yfov=None if fov is None else yfov_of({"fov": fov}, 0.0),
        view_height=ortho,
        intrinsics=intrinsics,
        camera_file=camera_file,
        channels=_given_channels(channels),
        layer=layer,
        part=part,
        layout=layout,
        normal_space=normal_space,
        depth_kind=depth_kind,
        depth_range=depth_range,
        invalid=invalid,
        nan=nan,
        normals=not no_normals,
    )
    if max_memory is not None and chosen.kind != "ao":
        raise click.UsageError(f"--max-memory is for ambient occlusion: {technique} reads the whole image")
    work = ApplyExr(
        technique=technique,
        parameters=parameters,
        passes=passes,
        lights=lights_of(sky, sun),
        lit=lit,
        device=device,
        max_memory=max_memory,
    )
    names = FrameNames.of(source)
    if names is None and (frames is not None or scheduler is not None):
        raise click.UsageError(f"IN.exr is {source}: expected #### in its name with --frames or --scheduler")
    if names is not None:
        run_frames(work, names, output, frames=frames, again=again, scheduler=scheduler, as_json=as_json)
        return
    _apply_one(work, source, output, overwrite=overwrite, as_json=as_json)


def _apply_one(work: ApplyExr, source: Path, output: Path, *, overwrite: bool, as_json: bool) -> None:
    """Apply a technique to one file, and report what ran."""
    checked_output(output, (".exr",))
    adds = source.exists() and output.exists() and source.samefile(output)  # by links too
    if adds and not overwrite:
        raise click.UsageError(f"--output is {output}: that is the input; --overwrite adds the result to its channels")
    if adds and work.max_memory is not None:
        raise click.UsageError(f"--output is {output}: that is the input; expected another file with --max-memory")
    with progress(as_json) as step:
        step("opening the device")
        runtime = Runtime.open(work.device)
        step(f"reading {source}")
        frame = work.read(source)
        step(f"computing {work.technique}")
        if isinstance(frame, ExrImage):
            camera = frame.camera
            exr.write_in_rows(output, work.rows(frame, runtime), like=source)
            times = runtime.times()
        else:
            camera = frame.gbuffer.camera
            results = work.compute(frame, runtime)
            times = runtime.times()
            step("writing the file")
            if adds:
                exr.add(output, results)
            else:
                exr.write(output, results, like=source)
    facts = {"width": camera.width, "height": camera.height, "notes": list(frame.notes)}
    report(as_json, runtime, times, [output], facts)


def _given_channels(options: tuple[str, ...]) -> dict[str, str | tuple[str, ...]]:
    """Return the channels of --channels by quantity."""
    given: dict[str, str | tuple[str, ...]] = {}
    for text in options:
        what, equals, name = text.partition("=")
        if not equals or not name:
            raise click.UsageError(f"--channels {shown(text)}: expected WHAT=NAME, such as depth=Z")
        given[what] = name
    return given


def _check_lights(chosen: Technique, lights: dict[str, Any], asked: dict[str, Any]) -> None:
    """Raise for options that the technique doesn't have."""
    if "lights" in chosen.reads:
        wrong = [name.replace("_", "-") for name, value in asked.items() if value is not None]
        if wrong:
            raise click.UsageError(f"--{wrong[0]} is not for {chosen.name}: it has no recorded settings")
        return
    wrong = [name for name, value in lights.items() if value is not None]
    if wrong:
        raise click.UsageError(f"{wrong[0]} is for ssdo: {chosen.name} knows no light")


def _setting(text: str, technique: str, params: type[Params]) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"--set {shown(text)}: expected NAME=VALUE")
    names = parameter_fields(params)
    if name not in names:
        raise click.UsageError(f"--set {shown(text)}: {unknown_name(technique, name, names)}")
    special = {"true": True, "false": False, "inf": math.inf}
    if value.lower() in special:
        return name, special[value.lower()]
    if len(value) < _LONG and _NUMBER.fullmatch(value):  # .8 and +0.5, which JSON does not know
        return name, float(value) if set(value) & set(".eE") else int(value)
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value
    except RecursionError:
        raise click.UsageError(f"--set {name}: the value is nested too deeply") from None


def _list_parameters(params: type[Params], as_json: bool) -> None:
    rows = describe(params)
    if as_json:
        keys = ("name", "default", "meaning")
        print(json.dumps([dict(zip(keys, row, strict=True)) for row in rows], indent=1))
        return
    for name, default, meaning in rows:
        click.echo(f"{name}={default}")
        click.echo(wrapped(meaning, "    "))
