"""The command `ssgi render`."""

from __future__ import annotations

import math
from collections.abc import Callable
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ssgi_cl.cli.facts import camera_facts, light_facts
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import shown
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import AO_DEFAULT, BOUNCES, DEFAULT_PRESET, PRESETS
from ssgi_cl.frame.render import Frame, render
from ssgi_cl.frame.skips import ONE_PICTURE
from ssgi_cl.io import png
from ssgi_cl.io.console import (
    DEFAULT_FOV,
    VECTOR,
    GroupedCommand,
    checked_output,
    device_option,
    human_errors,
    json_option,
    printable,
    progress,
    report,
    yfov_of,
)
from ssgi_cl.io.previews import VIEWS, gbuffer_views, levels_view, share_view
from ssgi_cl.rasterize.files.load import READERS
from ssgi_cl.techniques.catalogue import TECHNIQUES

if TYPE_CHECKING:
    from ssgi_cl.core.scene import Scene
    from ssgi_cl.rasterize.scenes import BuiltinScene

_OUTDOORS = (DirectionalLight, Environment)
"""Lights that --environment replaces."""
_CULL = {"file": None, "all": True, "none": False}
_AS_GIVEN = (
    *("preset", "indirect", "method", "vpls", "glossy_vpls", "indirect_ao", "layers", "auxiliary_cameras"),
    *("ao_samples", "shadow_size", "rsm_size", "exposure"),
)
"""Options that are arguments of `render` as they are."""
_GROUPS = {
    "Output": ("output", "views", "width", "height", "exposure"),
    "Scene and camera": ("eye", "target", "up", "fov", "camera", "cull", "no_textures"),
    "Light": (
        *("ambient", "environment", "bounces", "ao", "ao_radius", "ao_samples"),
        *("indirect", "method", "vpls", "glossy_vpls", "indirect_ao"),
    ),
    "Quality": ("preset", "layers", "auxiliary_cameras", "shadow_size", "rsm_size", "no_skips"),
    "Device and report": ("device", "explain", "as_json"),
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
@click.option(
    "--cull",
    type=click.Choice(list(_CULL)),
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
    default=AO_DEFAULT,
    show_default=True,
    help="What dims ambient light.",
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
@click.option("--exposure", type=float, help="Factor before the tone curve; automatic by default.")
@device_option
@json_option
@human_errors
def render_command(scene: str, output: Path, as_json: bool, **options: Any) -> None:
    """Render SCENE, a .glb, .gltf, .obj or .ply file with y up, a built-in scene (cornell_box,
    hall, parlour, terrace, workshop), or a generated one: KIND-SEED, such as room-7, with KIND
    room, colonnade, foliage, machine, street or terrain.

    A file's scene is lit by the lights that the file describes (glTF, KHR_lights_punctual), one
    without by a sun and a sky, a closed room by a light. What a file says that is not drawn is
    listed. Times are milliseconds on the device.
    """
    endings: tuple[str, ...] = ()
    if options["views"]:
        endings = (".exr", *(f".{name}.png" for name in (*VIEWS, "ao", "levels")))
    for path in (output, *map(output.with_suffix, endings)):
        checked_output(path, (".png", ".exr"))
    skips = frozenset[str]() if options["no_skips"] else ONE_PICTURE
    with progress(as_json) as step:
        loaded, camera, lights, arguments = frame_arguments(scene, options, step)
        runtime = arguments["runtime"]
        # Kernels are compiled for the first of two pictures; the second one's times are told.
        render(loaded, camera, lights, skips=skips, progress=partial(step, "compiling kernels"), **arguments)
        step("rendering")
        frame = render(loaded, camera, lights, gbuffer=True, skips=skips, **arguments)
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


def frame_arguments(
    scene: str, options: dict[str, Any], step: Callable[[str], None]
) -> tuple[Scene, Camera, tuple[Light, ...], dict[str, Any]]:
    """Return the scene, the camera, the lights and the other arguments of `render` but `skips`.

    Args:
        scene: as given on the command line.
        options: of the command `ssgi render` that shape a frame.
        step: is called with the name of each step.
    """
    from ssgi_cl.rasterize.scenes import is_scene, make_scene

    given = [f"--{name}" for name in ("eye", "target", "up", "fov") if options[name] is not None]
    if options["camera"] is not None and given:
        raise click.UsageError(f"--camera and {given[0]} exclude each other")
    check_scene(scene)
    around = None if options["environment"] is None else _environment(options["environment"])
    step("opening the device")
    runtime = Runtime.open(options["device"])
    step(f"loading {scene}")
    loaded, camera, lights, radius = (
        _builtin(make_scene(scene), options) if is_scene(scene) else _from_file(Path(scene), options, runtime)
    )
    if around is not None:
        lights = (*(light for light in lights if not isinstance(light, _OUTDOORS)), around)
    if options["ambient"] is not None:
        lights = (*lights, Environment(options["ambient"]))
    arguments = {
        **{name: options[name] for name in _AS_GIVEN},
        "bounces": _bounces(options["bounces"]),
        "ao": False if options["ao"] == "none" else options["ao"],
        "ao_radius": radius if options["ao_radius"] is None and not _whole(options) else options["ao_radius"],
        "runtime": runtime,
    }
    return loaded, camera, lights, arguments


def _whole(options: dict[str, Any]) -> bool:
    """Return whether options ask for all light, emission included, and not one technique."""
    return options["indirect"] is None and options["bounces"] != "0"


def _bounces(text: str | None) -> int | str | None:
    """Return what --bounces says; `render` checks its range."""
    if text in (None, "all"):
        return text
    try:
        return int(text)
    except ValueError:
        raise click.UsageError(f"--bounces is {text!r}: expected an integer from 0 on, or 'all'") from None


def _environment(text: str) -> Environment:
    """Return the environment of an image file, or of one radiance: three numbers with commas."""
    parts = text.split(",")
    try:
        radiance = [float(part) for part in parts]
    except ValueError:
        return Environment.load(text)
    if len(radiance) != 3:
        raise click.UsageError(f"--environment {shown(text)}: expected a file or R,G,B")
    return Environment(radiance)


def check_scene(name: str) -> None:
    """Raise unless it is a scene's name, there is such a file, or it ends like a scene file's, which is read later."""
    from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, SCENE_NAMES, is_scene

    path = Path(name)
    if is_scene(name):
        return
    if path.is_dir():
        raise ValueError(f"scene is {name!r}: it is a folder; expected a file or {SCENE_NAMES}")
    if not path.exists() and path.suffix.lower() not in READERS:
        near = get_close_matches(name, BUILTIN_SCENES, 1)
        guess = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"scene is {name!r}: there is no such file; expected one or {SCENE_NAMES}{guess}")


def _size(options: dict[str, Any]) -> tuple[int, int]:
    """Return (width, height); the camera checks them."""
    width, height = options["width"], options["height"]
    return 800 if width is None else width, 600 if height is None else height


def _builtin(builtin: BuiltinScene, options: dict[str, Any]) -> tuple[Scene, Camera, tuple[Light, ...], float | None]:
    width, height = _size(options)
    if options["camera"] is not None:
        camera = _camera_file(Path(options["camera"]), options)
    else:
        camera = Camera.look_at(
            builtin.eye if options["eye"] is None else options["eye"],
            builtin.target if options["target"] is None else options["target"],
            builtin.up if options["up"] is None else options["up"],
            yfov=yfov_of(options, builtin.yfov),
            width=width,
            height=height,
        )
    lights = builtin.own_lights if _whole(options) else builtin.lights
    return builtin.scene, camera, lights, builtin.ao_radius


def _from_file(
    path: Path, options: dict[str, Any], runtime: Runtime
) -> tuple[Scene, Camera, tuple[Light, ...], float | None]:
    from ssgi_cl.rasterize import load_scene
    from ssgi_cl.rasterize.raster.default_camera import default_lights

    if (options["eye"] is None) != (options["target"] is None):
        raise click.UsageError("--eye and --target go together")
    if options["up"] is not None and options["eye"] is None:
        raise click.UsageError("--up needs --eye and --target")
    width, height = _size(options)
    yfov = yfov_of(options, math.radians(DEFAULT_FOV))
    # The camera's size and the rest of it are checked before a large scene is loaded.
    Camera.look_at((0, 0, 1), (0, 0, 0), yfov=yfov, width=width, height=height)
    camera = None
    if options["eye"] is not None:
        camera = Camera.look_at(
            options["eye"], options["target"], options["up"] or (0.0, 1.0, 0.0), yfov=yfov, width=width, height=height
        )
    elif options["camera"] is not None:
        file = Path(options["camera"])
        if file.suffix.lower() == ".json" or file.is_file():
            camera = _camera_file(file, options)
    scene = load_scene(path, textures=not options.get("no_textures"), cull=_CULL[options.get("cull", "file")])
    camera = camera or _camera_of(scene, path, options, runtime)
    lights = scene.lights or default_lights(scene, camera, runtime, emission=_whole(options))
    return scene, camera, lights, None


def _camera_of(scene: Scene, path: Path, options: dict[str, Any], runtime: Runtime) -> Camera:
    """Return the camera of a file's scene that was asked for by its name, or the default one."""
    from ssgi_cl.rasterize.raster.default_view import file_camera

    name = options["camera"]
    if name is not None and name not in scene.cameras:
        known = ", ".join(map(shown, scene.cameras)) or "none"
        raise ValueError(f"--camera is {name!r}: there is no such file, and {path} has no such camera (it has {known})")
    if name is not None:
        return scene.cameras[name].sized(*_size(options))
    yfov = None if options["fov"] is None else yfov_of(options, 0.0)
    return file_camera(scene, path, options["width"], options["height"], yfov, runtime)


def _camera_file(path: Path, options: dict[str, Any]) -> Camera:
    from ssgi_cl.rasterize.raster.default_camera import camera_from_json

    return camera_from_json(path, options["width"], options["height"])


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
