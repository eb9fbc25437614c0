"""The command line: `ssgi render`, `ssgi apply`, `ssgi devices`."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import wraps
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ssgi_cl import check, drivers, exr, png
from ssgi_cl.bench.command import bench_command, truth_command
from ssgi_cl.camera import Camera
from ssgi_cl.drivers import DeviceInfo
from ssgi_cl.errors import KernelBuildError, SsgiError
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.lights import Environment, Light
from ssgi_cl.params import Params, describe
from ssgi_cl.render import AO_DEFAULT, AO_PARAMS, BOUNCES, Frame, render
from ssgi_cl.runtime import PassTime, Runtime
from ssgi_cl.techniques import TECHNIQUES
from ssgi_cl.version import __version__
from ssgi_cl.views import VIEWS, gbuffer_views, share_view

if TYPE_CHECKING:
    from ssgi_cl.rasterize.scene import Scene
    from ssgi_cl.rasterize.scenes import BuiltinScene

DEFAULT_FOV = 50.0


def _human_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the library's errors into one line (a compiler's log apart) and exit status 1."""

    @wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except BrokenPipeError:
            raise  # whoever reads the output has gone, such as `head`
        except (SsgiError, ValueError, TypeError, OSError) as error:
            raise click.ClickException(_one_line(error)) from error

    return run


def _one_line(error: Exception) -> str:
    if isinstance(error, KernelBuildError):
        return str(error)
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    first, *rest = str(error).splitlines() or [type(error).__name__]
    return " ".join([first, "; ".join(line.strip() for line in rest)]).strip()


@contextmanager
def _progress(silent: bool) -> Iterator[Callable[[str], None]]:
    """Give a function that names the step under way; shown on a terminal, on standard error."""
    console = Console(stderr=True)
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(),
        console=console, transient=True, disable=silent or not console.is_terminal,
    ) as progress:
        task = progress.add_task("", total=None)
        yield lambda text: progress.update(task, description=text)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="ssgi")
def main() -> None:
    """Image-space global illumination on G-buffers, on any OpenCL device."""


main.add_command(bench_command)
main.add_command(truth_command)


def _checked_output(path: Path, suffixes: tuple[str, ...]) -> None:
    """Raise if `path` has another suffix or can't be written, before work is spent on it."""
    if path.suffix.lower() not in suffixes:
        raise click.UsageError(
            f"--output is {path}: expected a name that ends in {' or '.join(suffixes)}"
        )
    if not path.parent.is_dir():
        raise click.ClickException(f"--output is {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise click.ClickException(f"--output is {path}: it is a folder, expected a file's name")


_device = click.option(
    "--device", metavar="WORDS", help="Words of the device's label, such as 'pocl 3.1'; by default "
    "SSGI_CL_DEVICE, else the fastest found.",
)
_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
_vector: dict[str, Any] = {"nargs": 3, "type": float, "metavar": "X Y Z"}


@main.command("render")
@click.argument("scene", metavar="SCENE")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path),
              help="The picture: .png, or .exr for linear radiance with AO and the G-buffer.")
@click.option("--views", is_flag=True, help="Write .exr and views of AO, depth, normal and albedo "
              "beside the picture too.")
@click.option("--width", type=int, help="Pixels; 800 by default.")
@click.option("--height", type=int, help="Pixels; 600 by default.")
@click.option("--eye", help="Where the camera is: world space, scene units.", **_vector)
@click.option("--target", help="What it looks at: world space, scene units.", **_vector)
@click.option("--fov", type=float, help="Vertical field of view in degrees; 50 by default.")
@click.option("--camera", "camera_file", type=click.Path(path_type=Path),
              help="JSON file with origin, forward, up (world space) and fov_deg (horizontal). "
              "A file named like the scene with .scene.json at its end is found by itself.")
@click.option("--ambient", type=float, help="Add a constant environment of this radiance, "
              "W m^-2 sr^-1.")
@click.option("--ao", type=click.Choice((*AO_PARAMS, "none")), default=AO_DEFAULT,
              show_default=True, help="What dims ambient light.")
@click.option("--ao-radius", type=float, help="Scene units; by default 5 % of the scene's "
              "diagonal.")
@click.option("--ao-samples", type=int, help="Points per pixel of --ao ssao; 16 by default.")
@click.option("--indirect", type=click.Choice(BOUNCES), help="Add the light of lamps that surfaces "
              "reflect once, shot by virtual point lights or gathered; by default none.")
@click.option("--vpls", type=int, default=1024, show_default=True,
              help="Virtual point lights of --indirect vpl.")
@click.option("--layers", type=int, default=1, show_default=True,
              help="Depth layers; with 2 or more, walls block light of --indirect vpl.")
@click.option("--shadow-size", type=int, default=1024, show_default=True,
              help="Texels along a shadow map's side.")
@click.option("--exposure", type=float, help="Factor before the tone curve; automatic by default.")
@_device
@_json
@_human_errors
def render_command(scene: str, output: Path, as_json: bool, **options: Any) -> None:
    """Render SCENE, a .glb, .gltf, .obj or .ply file with y up, or a built-in scene: cornell_box,
    hall, terrace or workshop.

    A file's scene is lit by a sun and a sky, a closed room by a lamp. Times are milliseconds on
    the device.
    """
    from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

    endings = (".exr", ".ao.png", *(f".{name}.png" for name in VIEWS)) if options["views"] else ()
    for path in (output, *map(output.with_suffix, endings)):
        _checked_output(path, (".png", ".exr"))
    _check_view_options(options)
    with _progress(as_json) as step:
        step("opening the device")
        runtime = Runtime.open(options["device"])
        step(f"loading {scene}")
        loaded, camera, lights, radius = (
            _builtin(BUILTIN_SCENES[scene](), options)
            if scene in BUILTIN_SCENES
            else _from_file(Path(scene), options, runtime)
        )
        if options["ambient"] is not None:
            lights = (*lights, Environment(options["ambient"]))
        arguments: dict[str, Any] = {
            "ao": False if options["ao"] == "none" else options["ao"],
            "indirect": options["indirect"],
            "vpls": options["vpls"],
            "layers": options["layers"],
            "ao_radius": radius if options["ao_radius"] is None else options["ao_radius"],
            "ao_samples": options["ao_samples"],
            "shadow_size": options["shadow_size"],
            "exposure": options["exposure"],
            "runtime": runtime,
        }
        step("compiling kernels")
        render(loaded, camera, lights, **arguments)
        step("rendering")
        frame = render(loaded, camera, lights, gbuffer=True, **arguments)
        step("writing files")
        files = _write(frame, output, views=options["views"])
    _report(
        as_json, runtime, frame.passes, files,
        {"scene": scene, "width": camera.width, "height": camera.height,
         "triangles": len(loaded.triangles), "wall_ms": round(frame.wall_ms, 3)},
    )


def _check_view_options(options: dict[str, Any]) -> None:
    given = [f"--{name}" for name in ("eye", "target", "fov") if options[name] is not None]
    if options["camera_file"] is not None and given:
        raise click.UsageError(f"--camera and {given[0]} exclude each other")


def _size(options: dict[str, Any]) -> tuple[int, int]:
    """Return (width, height); the camera checks them."""
    width, height = options["width"], options["height"]
    return 800 if width is None else width, 600 if height is None else height


def _yfov(options: dict[str, Any], default: float) -> float:
    """Return the vertical field of view in radians."""
    if options["fov"] is None:
        return default
    return math.radians(check.number("--fov", options["fov"], low=0.01, high=179.0, unit="degrees"))


def _builtin(
    builtin: BuiltinScene, options: dict[str, Any]
) -> tuple[Scene, Camera, tuple[Light, ...], float | None]:
    width, height = _size(options)
    if options["camera_file"] is not None:
        camera = _camera_file(options["camera_file"], options)
    else:
        camera = Camera.look_at(
            builtin.eye if options["eye"] is None else options["eye"],
            builtin.target if options["target"] is None else options["target"],
            builtin.up, yfov=_yfov(options, builtin.yfov), width=width, height=height,
        )
    return builtin.scene, camera, builtin.lights, builtin.ao_radius


def _from_file(
    path: Path, options: dict[str, Any], runtime: Runtime
) -> tuple[Scene, Camera, tuple[Light, ...], float | None]:
    from ssgi_cl.rasterize import load_scene
    from ssgi_cl.viewpoint import default_camera, default_lights

    if (options["eye"] is None) != (options["target"] is None):
        raise click.UsageError("--eye and --target go together")
    width, height = _size(options)
    yfov = _yfov(options, math.radians(DEFAULT_FOV))
    # The camera's size and the rest of it are checked before a large scene is loaded.
    camera = Camera.look_at((0, 0, 1), (0, 0, 0), yfov=yfov, width=width, height=height)
    beside = path.with_name(path.stem + ".scene.json")
    if options["eye"] is not None:
        camera = Camera.look_at(options["eye"], options["target"], yfov=yfov, width=width,
                                height=height)
    elif options["camera_file"] is not None:
        camera = _camera_file(options["camera_file"], options)
    scene = load_scene(path)
    if options["eye"] is None and options["camera_file"] is None:
        if beside.is_file() and options["fov"] is None:
            camera = _camera_file(beside, options)
        else:
            camera = default_camera(scene, width, height, yfov, runtime)
    return scene, camera, default_lights(scene, camera, runtime), None


def _camera_file(path: Path, options: dict[str, Any]) -> Camera:
    from ssgi_cl.viewpoint import camera_from_json

    return camera_from_json(path, options["width"], options["height"])


def _write(frame: Frame, output: Path, *, views: bool) -> list[Path]:
    gbuffer = frame.gbuffer
    assert gbuffer is not None  # noqa: S101  it was asked for
    arrays = {"image": frame.radiance}
    if frame.ao is not None:
        arrays["ao"] = frame.ao
    if frame.indirect is not None:
        arrays["indirect"] = frame.indirect
    for name in ("depth", "normal", "albedo", "emission"):
        array = gbuffer.first(name)
        if array is not None:
            arrays[name] = gbuffer.inner(array)
    is_picture = output.suffix.lower() == ".png"
    wanted: list[tuple[Path, Any]] = [(output, frame.image if is_picture else arrays)]
    if is_picture and views:
        wanted.append((output.with_suffix(".exr"), arrays))
    if views:
        pictures = gbuffer_views(gbuffer)
        if frame.ao is not None:
            pictures["ao"] = share_view(frame.ao)
        wanted += [(output.with_suffix(f".{name}.png"), view) for name, view in pictures.items()]
    for path, content in wanted:
        if path.suffix.lower() == ".exr":
            exr.write(path, content)
        else:
            png.write(path, content)
    return [path for path, _ in wanted]


@main.command("apply")
@click.argument("technique", type=click.Choice(sorted(TECHNIQUES)))
@click.argument("source", metavar="IN.exr", required=False, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The result, .exr.")
@click.option("--fov", type=float, help="Vertical field of view of the camera in degrees; "
              "50 by default.")
@click.option("--ortho", type=float, metavar="HEIGHT",
              help="Orthographic camera whose view is this high, in scene units.")
@click.option("--intrinsics", nargs=4, type=float, metavar="FX FY CX CY",
              help="Calibrated camera, in pixels.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE",
              help="A parameter of the technique, such as radius=0.3; several times. '--set help' "
              "lists them with their units.")
@click.option("--preset", metavar="NAME", help="Where parameters without --set come from: low, "
              "medium, high or ultra; by default the technique's defaults.")
@click.option("--error", type=float, metavar="RMSE", help="Instead of a preset: the fastest "
              "recorded setting that is expected to be no further from cast rays.")
@click.option("--budget-ms", type=float, metavar="MS", help="Instead of a preset: the best "
              "recorded setting that is expected to take no longer on this device.")
@click.option("--no-normals", is_flag=True, help="Ignore normals in the file; those of the depth "
              "are used.")
@_device
@_json
@_human_errors
def apply_command(
    technique: str, source: Path | None, output: Path | None, fov: float | None,
    ortho: float | None, intrinsics: tuple[float, ...] | None, settings: tuple[str, ...],
    preset: str | None, error: float | None, budget_ms: float | None, no_normals: bool,
    device: str | None, as_json: bool,
) -> None:
    """Apply TECHNIQUE to the G-buffer in IN.exr (depth, and normals if it has them).

    Depth is linear along the line of sight, in scene units; 1e10 and more is where nothing is.
    Normals are taken as camera space: +x right, +y up, +z towards the viewer. Use --no-normals if
    the file's are in world space, as those of `ssgi render` and of Blender are.
    """
    entry = TECHNIQUES[technique]
    if "help" in settings:
        _list_parameters(entry.params, as_json)
        return
    if source is None:
        raise click.UsageError("Missing argument 'IN.exr'.")
    if output is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    _checked_output(output, (".exr",))
    parameters = dict(_setting(text, technique, entry.params) for text in settings)
    asked = {"preset": preset, "error": error, "budget_ms": budget_ms}
    parameters |= {name: value for name, value in asked.items() if value is not None}
    if sum(value is not None for value in (fov, ortho, intrinsics)) > 1:
        raise click.UsageError("--fov, --ortho and --intrinsics exclude each other")
    with _progress(as_json) as step:
        step("opening the device")
        runtime = Runtime.open(device)
        step(f"reading {source}")
        with redirect_stdout(StringIO()):  # OpenEXR prints warnings there; errors are raised too
            arrays = exr.read_gbuffer(source)
        if no_normals:
            arrays.pop("normal", None)
        rows, columns = arrays["depth"].shape
        camera = _apply_camera(rows, columns, fov, ortho, intrinsics)
        gbuffer = GBuffer(camera=camera, **arrays)
        step(f"computing {technique}")
        result = entry.function(gbuffer, runtime=runtime, **parameters)
        passes = runtime.times()
        step("writing the file")
        channels = {entry.channel: result}
        if isinstance(result, tuple):  # with bent normals
            a, bent = result
            channels = {entry.channel: a}
            channels |= {f"bent.{axis}": bent[..., i] for i, axis in enumerate("XYZ")}
        exr.write(output, channels)
    _report(as_json, runtime, passes, [output], {"width": columns, "height": rows})


def _apply_camera(
    rows: int, columns: int, fov: float | None, ortho: float | None,
    intrinsics: tuple[float, ...] | None,
) -> Camera:
    if intrinsics is not None:
        fx, fy, cx, cy = intrinsics
        return Camera.from_intrinsics(fx, fy, cx, cy, width=columns, height=rows)
    eye, target = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    if ortho is not None:
        return Camera.orthographic(eye, target, view_height=ortho, width=columns, height=rows)
    yfov = _yfov({"fov": fov}, math.radians(DEFAULT_FOV))
    return Camera.look_at(eye, target, yfov=yfov, width=columns, height=rows)


def _setting(text: str, technique: str, params: type[Params]) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"--set {text}: expected NAME=VALUE")
    names = [field.name for field in dataclasses.fields(params)]  # type: ignore[arg-type]
    if name not in names:
        raise click.UsageError(
            f"--set {text}: {technique} has no parameter {name!r}; it has {', '.join(names)}"
        )
    special = {"true": True, "false": False, "inf": math.inf}
    if value.lower() in special:
        return name, special[value.lower()]
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


def _list_parameters(params: type[Params], as_json: bool) -> None:
    rows = describe(params)
    if as_json:
        keys = ("name", "default", "meaning")
        print(json.dumps([dict(zip(keys, row, strict=True)) for row in rows], indent=1))
        return
    for name, default, meaning in rows:
        click.echo(f"{name}={default}")
        click.echo(_wrapped(meaning, "    "))


def _wrapped(text: str, indent: str) -> str:
    width = max(40, min(100, shutil.get_terminal_size().columns))
    return textwrap.fill(text, width, initial_indent=indent, subsequent_indent=indent,
                         break_long_words=False, break_on_hyphens=False)


@main.command("devices")
@_json
@_human_errors
def devices_command(as_json: bool) -> None:
    """List OpenCL devices, and the build of the kernels that each gets and why."""
    with _progress(as_json) as step:
        step("timing devices not seen before")
        found = drivers.devices()
    if as_json:
        print(json.dumps([
            {"label": info.label, "kind": info.kind, "units": info.units, "driver": info.driver,
             "form": str(info.best), "million_reads_per_second": info.speeds}
            for info in found
        ], indent=1))
        return
    if not found:
        raise click.ClickException(
            "no OpenCL device found. Install a driver, for example: pip install 'ssgi-cl[pocl]'"
        )
    usable = [info for info in found if info.best is not None]
    chosen = max(usable, key=lambda info: info.speed, default=None)
    for info in found:
        _list_device(info, default=info == chosen)
    click.echo(_wrapped(
        "Numbers are million scattered reads a second with each form of the kernels. In use (*) is "
        "the widest form within 15 % of the fastest.", ""
    ))


def _list_device(info: DeviceInfo, *, default: bool) -> None:
    units = f"{info.units} compute unit{'s' if info.units != 1 else ''}"
    click.echo(_wrapped(info.label, ""))
    click.echo(f"  {info.kind}, {units}{', used by default' if default else ''}")
    for form in drivers.FORMS:
        speed = info.speeds.get(str(form), "not tried")
        mark = "*" if form == info.best else " "
        if isinstance(speed, str):
            click.echo(f"  {mark} {form!s:17} does not run:")
            click.echo(_wrapped(speed, " " * 8))
        else:
            why = ""
            if form == info.best:
                within = "fastest" if speed == info.speed else "widest within 15 %"
                why = f"  in use: {within}"
            click.echo(f"  {mark} {form!s:17} {speed:7.0f}{why}")
    if info.best is None:
        click.echo("  no form of the kernels runs on it, so it is not used")
    click.echo()


def _report(
    as_json: bool, runtime: Runtime, passes: list[PassTime] | tuple[PassTime, ...],
    files: list[Path], facts: dict[str, Any],
) -> None:
    if as_json:
        print(json.dumps({
            **facts,
            "device": runtime.info.label,
            "form": str(runtime.form),
            "passes": [{"name": p.name, "ms": round(p.ms, 4), "skipped": p.skipped or None}
                       for p in passes],
            "files": [str(path) for path in files],
        }, indent=1))
        return
    click.echo(f"{runtime.info.label}, {runtime.form}")
    table = Table("pass", "ms")
    table.columns[1].justify = "right"
    for name, (count, ms, skipped) in _merged(passes).items():
        label = f"{name} x {count}" if count > 1 else name
        table.add_row(label, f"{ms:.2f}" if not skipped else f"skipped: {skipped}")
    table.add_section()
    table.add_row("sum", f"{sum(p.ms for p in passes):.2f}")
    console = Console()
    console.print(table)
    for path in files:
        console.print(f"wrote {path}", highlight=False)


def _merged(passes: list[PassTime] | tuple[PassTime, ...]) -> dict[str, tuple[int, float, str]]:
    """Return name -> (count, milliseconds, why skipped) in order of first appearance."""
    merged: dict[str, tuple[int, float, str]] = {}
    for p in passes:
        count, ms, _ = merged.get(p.name, (0, 0.0, ""))
        merged[p.name] = (count + 1, ms + p.ms, p.skipped)
    return merged


if __name__ == "__main__":
    sys.exit(main())
