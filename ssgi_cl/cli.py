"""The command line: `ssgi render`, `ssgi apply`, `ssgi devices`."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ssgi_cl import drivers, exr, png
from ssgi_cl.camera import Camera
from ssgi_cl.errors import SsgiError
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.lights import Environment
from ssgi_cl.params import describe
from ssgi_cl.render import Frame, render
from ssgi_cl.runtime import PassTime, Runtime
from ssgi_cl.techniques import TECHNIQUES
from ssgi_cl.version import __version__
from ssgi_cl.views import gbuffer_views, share_view

DEFAULT_FOV = 50.0


def _human_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the library's errors into one line and exit status 1."""

    @wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (SsgiError, ValueError, TypeError, OSError) as error:
            raise click.ClickException(str(error)) from error

    return run


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


_device = click.option(
    "--device", metavar="WORDS", help="Words of the device's label, such as 'pocl 3.1'; by default "
    "SSGI_CL_DEVICE, else the fastest found.",
)
_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
_vector = {"nargs": 3, "type": float, "metavar": "X Y Z"}


@main.command("render")
@click.argument("scene", metavar="SCENE")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path),
              help="The picture: .png, or .exr for linear radiance with AO and the G-buffer.")
@click.option("--views", is_flag=True, help="Write .exr and views of AO, depth, normal and albedo "
              "beside the picture too.")
@click.option("--width", type=int, help="Pixels; 800 by default.")
@click.option("--height", type=int, help="Pixels; 600 by default.")
@click.option("--eye", help="Where the camera is, world space.", **_vector)
@click.option("--target", help="What it looks at.", **_vector)
@click.option("--fov", type=float, help="Vertical field of view in degrees; 50 by default.")
@click.option("--camera", "camera_file", type=click.Path(path_type=Path),
              help="JSON file with origin, forward, up, fov_deg (horizontal). A file named like "
              "the scene with .scene.json at its end is found by itself.")
@click.option("--ambient", type=float, help="Add a constant environment of this radiance, "
              "W m^-2 sr^-1.")
@click.option("--ao-radius", type=float, help="Scene units; 5 % of the scene's diagonal by default.")
@click.option("--ao-samples", type=int, default=16, show_default=True, help="Points per pixel.")
@click.option("--shadow-size", type=int, default=1024, show_default=True,
              help="Texels along a shadow map's side.")
@click.option("--exposure", type=float, help="Factor before the tone curve; automatic by default.")
@_device
@_json
@_human_errors
def render_command(scene: str, output: Path, as_json: bool, **options: Any) -> None:
    """Render SCENE, a .glb, .gltf, .obj or .ply file or a built-in scene's name."""
    from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

    if output.suffix.lower() not in (".png", ".exr"):
        raise click.UsageError(f"--output is {output}: expected a name that ends in .png or .exr")
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
            "ao_radius": options["ao_radius"] or radius,
            "ao_samples": options["ao_samples"],
            "shadow_size": options["shadow_size"],
            "exposure": options["exposure"],
            "runtime": runtime,
        }
        if options["ao_radius"] is not None:
            arguments["ao_radius"] = options["ao_radius"]
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


def _builtin(builtin: Any, options: dict[str, Any]) -> tuple[Any, Camera, tuple[Any, ...], float]:
    width, height = options["width"] or 800, options["height"] or 600
    camera = builtin.camera(width, height)
    if _places_camera(options):
        camera = Camera.look_at(
            options["eye"] or builtin.eye, options["target"] or builtin.target, builtin.up,
            yfov=math.radians(options["fov"]) if options["fov"] else builtin.yfov,
            width=width, height=height,
        )
    if options["camera_file"]:
        camera = _camera_file(options["camera_file"], options)
    return builtin.scene, camera, builtin.lights, builtin.ao_radius


def _from_file(
    path: Path, options: dict[str, Any], runtime: Runtime
) -> tuple[Any, Camera, tuple[Any, ...], None]:
    from ssgi_cl.rasterize import load_scene
    from ssgi_cl.viewpoint import DEFAULT_LIGHTS, default_camera

    scene = load_scene(path)
    width, height = options["width"] or 800, options["height"] or 600
    yfov = math.radians(options["fov"] or DEFAULT_FOV)
    beside = path.with_name(path.stem + ".scene.json")
    if options["eye"] and options["target"]:
        camera = Camera.look_at(options["eye"], options["target"], yfov=yfov, width=width,
                                height=height)
    elif options["eye"] or options["target"]:
        raise click.UsageError("--eye and --target go together")
    elif options["camera_file"] or (beside.is_file() and options["fov"] is None):
        camera = _camera_file(options["camera_file"] or beside, options)
    else:
        camera = default_camera(scene, width, height, yfov, runtime)
    return scene, camera, DEFAULT_LIGHTS, None


def _places_camera(options: dict[str, Any]) -> bool:
    return bool(options["eye"] or options["target"] or options["fov"])


def _camera_file(path: Path, options: dict[str, Any]) -> Camera:
    from ssgi_cl.viewpoint import camera_from_json

    return camera_from_json(path, options["width"], options["height"])


def _write(frame: Frame, output: Path, *, views: bool) -> list[Path]:
    gbuffer = frame.gbuffer
    assert gbuffer is not None  # noqa: S101  it was asked for
    arrays = {"image": frame.radiance}
    if frame.ao is not None:
        arrays["ao"] = frame.ao
    for name in ("depth", "normal", "albedo", "emission"):
        array = gbuffer.first(name)
        if array is not None:
            arrays[name] = gbuffer.inner(array)
    wanted: list[tuple[Path, Any]] = []
    if output.suffix.lower() == ".png":
        wanted.append((output, frame.image))
    if views or output.suffix.lower() == ".exr":
        wanted.append((output.with_suffix(".exr"), arrays))
    if views:
        pictures = gbuffer_views(gbuffer)
        if frame.ao is not None:
            pictures["ao"] = share_view(frame.ao)
        wanted += [(output.with_suffix(f".{name}.png"), view) for name, view in pictures.items()]
    for path, content in wanted:
        if path.suffix == ".exr":
            exr.write(path, content)
        else:
            png.write(path, content)
    return [path for path, _ in wanted]


@main.command("apply")
@click.argument("technique", type=click.Choice(sorted(TECHNIQUES)))
@click.argument("source", metavar="IN.exr", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path),
              help="The result, .exr.")
@click.option("--fov", type=float, help="Vertical field of view of the camera in degrees.")
@click.option("--ortho", type=float, metavar="HEIGHT",
              help="Orthographic camera whose view is this high, in scene units.")
@click.option("--intrinsics", nargs=4, type=float, metavar="FX FY CX CY",
              help="Calibrated camera, in pixels.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE",
              help="A parameter of the technique; several times. '--set help' lists them.")
@_device
@_json
@_human_errors
def apply_command(
    technique: str, source: Path, output: Path, fov: float | None, ortho: float | None,
    intrinsics: tuple[float, ...] | None, settings: tuple[str, ...], device: str | None,
    as_json: bool,
) -> None:
    """Apply TECHNIQUE to the G-buffer in IN.exr (depth, and normals if it has them).

    Normals are taken as camera space: +x right, +y up, +z towards the viewer.
    """
    entry = TECHNIQUES[technique]
    if "help" in settings:
        table = Table("parameter", "default", "meaning")
        for row in describe(entry.params):
            table.add_row(*row)
        Console().print(table)
        return
    if output.suffix.lower() != ".exr":
        raise click.UsageError(f"--output is {output}: expected a name that ends in .exr")
    if sum(value is not None for value in (fov, ortho, intrinsics)) > 1:
        raise click.UsageError("--fov, --ortho and --intrinsics exclude each other")
    with _progress(as_json) as step:
        step("opening the device")
        runtime = Runtime.open(device)
        step(f"reading {source}")
        arrays = exr.read_gbuffer(source)
        rows, columns = arrays["depth"].shape
        camera = _apply_camera(rows, columns, fov, ortho, intrinsics)
        gbuffer = GBuffer(camera=camera, **arrays)
        step(f"computing {technique}")
        result = entry.function(gbuffer, runtime=runtime, **dict(map(_setting, settings)))
        passes = runtime.times()
        step("writing the file")
        exr.write(output, {entry.channel: result})
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
    yfov = math.radians(DEFAULT_FOV if fov is None else fov)
    return Camera.look_at(eye, target, yfov=yfov, width=columns, height=rows)


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"--set {text}: expected NAME=VALUE")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


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
    chosen = drivers.choose(None)
    table = Table("device", "kind", "units", *(str(form) for form in drivers.FORMS), "chosen")
    for info in found:
        cells = []
        for form in drivers.FORMS:
            speed = info.speeds.get(str(form), "")
            cells.append(f"{speed:.0f}" if isinstance(speed, float) else "fails")
        default = " (default)" if info == chosen else ""
        table.add_row(info.label + default, info.kind, str(info.units), *cells, str(info.best))
    console = Console()
    console.print(table)
    console.print(
        "Million scattered reads a second with each form of the kernels. Chosen is the widest "
        "within 15 % of the fastest; 'fails': it does not compile or run there."
    )
    for info in found:
        for form, reason in info.speeds.items():
            if isinstance(reason, str):
                console.print(f"{info.label}, {form}: {reason}", highlight=False)


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
    table = Table("pass", "ms", title=f"{runtime.info.label}, {runtime.form}")
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
