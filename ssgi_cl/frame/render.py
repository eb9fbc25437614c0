"""The function `render`: a scene, a camera and lights to a frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light, light_tuple
from ssgi_cl.core.names import AoTechnique, BounceMethod, Bounces, Curve, OneBounce, Preset
from ssgi_cl.core.params import parameter_fields
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Preparing, Progress, part_of, told
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.frame.bands import rendered_in_bands
from ssgi_cl.frame.history import FrameHistory
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.renderer import Renderer, default_ao_radius
from ssgi_cl.frame.result import Frame
from ssgi_cl.frame.samples import mean_of_samples
from ssgi_cl.rasterize.raster.view import device_scene

__all__ = ["Frame", "Renderer", "default_ao_radius", "render"]


@mean_of_samples
@rendered_in_bands
@serialised
def render(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    *,
    bounces: Bounces | None = None,
    preset: Preset | None = None,
    ao: bool | AoTechnique = True,
    ao_radius: float | None = None,
    ao_samples: int | None = None,
    multi_bounce: bool = False,
    indirect: bool | OneBounce | None = None,
    method: BounceMethod | None = None,
    vpls: int = 1024,
    glossy_vpls: int = 0,
    indirect_ao: bool = False,
    layers: int = 1,
    overscan: float = 0.0,
    auxiliary_cameras: int = 0,
    edges: int | None = None,
    shadow_size: int = 1024,
    rsm_size: int = 512,
    exposure: float | None = None,
    curve: Curve = "filmic",
    gbuffer: bool = False,
    outputs: Iterable[str] | None = None,
    skips: bool | Iterable[str] = True,
    samples: int = 1,
    max_memory: int | None = None,
    history: FrameHistory | None = None,
    runtime: Runtime | None = None,
    progress: Progress = None,
) -> Frame:
    """Render the whole picture: direct light with shadows, sky, all bounces, emission.

    Punctual lights have shadow maps. Environments are blocked by the scene's triangles at any
    distance (`sampled_lights`). Surfaces that emit light the scene. Surfels carry reflected light
    between surfaces until it converges (`Radiosity`), and `multires_splat` gathers it. Surfaces
    within two cells of the occupancy grid block sky and reflected light as ambient occlusion.
    Glossy surfaces reflect lights, surfaces and environments within their lobes (`Reflections`);
    with `bounces` 0 and with `indirect`, their lobes count as albedo. Results that depend on scene
    and lights alone are kept from frame to frame.

    Args:
        scene: surfaces and their materials, such as `rasterize.load_scene` returns.
        camera: the view, with the size of the picture.
        lights: any number of lights.
        bounces: reflections on the way from a light to a pixel: 1 or more, or "all". 0: direct
            light only, and that of environments as ambient light, dimmed by ambient occlusion
            within `ao_radius`; emission is then seen and lights nothing. By default "all" without
            `indirect`, 0 with it.
        preset: accuracy of the whole picture: "low", "medium", "high" or "ultra"; by default
            "high". Not with `bounces` 0.
        ao: technique of ambient occlusion: "ssao", "hbao", "gtao" or "bitmask_ao"; True for "gtao" in the whole
            picture and else for "bitmask_ao", which scans every other pixel then; False for none. All but "ssao"
            look into all `layers`, all four into the margin. "bitmask_ao" knows where solids end, whose back sides
            are drawn for it, but in the whole picture.
        ao_radius: its radius in scene units, and that of "ssdo"; by default two cells of the
            occupancy grid for the whole picture, else 5 % of the picture's diagonal where surfaces
            are seen, at most 5 % of the diagonal of the scene's box (see `default_ao_radius`); for
            a new camera that takes a depth map of 96 x 72 pixels.
        ao_samples: points per pixel of "ssao", and of no other, 1 to 256; by default 16.
        multi_bounce: whether AO is brightened by what surfaces reflect, see `multi_bounce`.
        indirect: one technique that reflects light once, in place of all bounces; emission is then
            seen and lights nothing. Of punctual lights: "multires" (`multires_splat`, the fastest)
            and "vpl" (`vpl_splat`), blocked by all triangles of the scene, and "gather"
            (`rsm_gather`, blocked by nothing). Of environments too, by surfaces within `ao_radius`:
            "ssdo", which needs no `ao`. True for "multires", False for none; None: as `bounces` says.
        method: method of the technique in `indirect`: one of `multires_splat`, `rsm_gather` or
            `ssdo`, such as "published"; None for the default. "multires" as published has no
            visibility.
        vpls: virtual point lights of "multires" and "vpl" in all, 1 to 2^24.
        glossy_vpls: more lights of "vpl" for what glossy surfaces mirror, 0 to 2^24.
        indirect_ao: whether AO dims "multires", "vpl" and "gather" too; not `Frame.indirect`.
        layers: depth layers of the G-buffer, 1 to 16.
        overscan: margin of the G-buffer on every side, a share of the image's size in [0, 1].
        auxiliary_cameras: views of half the size of what the camera misses, for "ssdo", 0 to 64; up
            to half of them at spot and directional lights, see `auxiliary_cameras`.
        edges: places of each pixel at which visibility is tested, 0 to 64; each has the radiance of the
            pixel nearby that shows its surface. The mean is that of linear radiance, and exceeds none of
            these pixels. 0: pixel centres alone count. By default 7 in the whole picture, else 0.
            Radiance and image have smooth edges, no other output.
        shadow_size: texels along the side of each shadow map, 16 to 8192.
        rsm_size: texels along a side that reflected light is chosen from, at most, 16 to 8192.
        exposure: factor before the tone curve; by default the log-average luminance becomes 0.18, as of
            `tonemap`. `Frame.exposure` is the one taken.
        curve: "filmic" or "clip".
        gbuffer: whether the frame holds the G-buffer too.
        outputs: of "image", "radiance", "ao", "indirect" and "gbuffer"; passes for others are left
            out. By default image and radiance, and AO and indirect light where the image needs them.
        skips: work that may be left out where it has no effect: True for all, False for none, or
            names from `ssgi_cl.frame.skips.SKIPS`. No bit of any output depends on it.
        samples: frames that the picture is the mean of, in linear radiance, 1 to 1024. Each sees another
            place of every pixel, has its patterns elsewhere and chooses lights anew. From 8 on `edges` is
            0 by default. What depends on scene and lights alone is computed once. AO and indirect light
            are means too; the G-buffer is that of pixel centres.
        max_memory: most bytes of device memory, the scene and its maps counted; a larger picture is
            rendered in bands of rows that are blended where they meet. By default all there is.
        history: means of the sequence that this is the next frame of, which the frame changes; then ambient
            occlusion and light are means over frames. Without it, frames do not depend on those before.
            Not with several `samples` or `max_memory`.
        runtime: the device; by default the fastest found.
        progress: called with the share of the passes that is done, which grows to 1, kernels that are compiled
            first among them; the device is waited for after each. True: a bar in terminals and notebooks.

    Returns:
        The outputs and the table of passes.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
    """
    given = {name: value for name, value in locals().items() if name in parameter_fields(FrameParams)}
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    if history is not None and not isinstance(history, FrameHistory):
        raise TypeError(f"history is {type(history).__name__}: expected an ssgi_cl.FrameHistory, or None")
    lights = light_tuple(lights)
    return _drawn(scene, camera, lights, FrameParams(**given), runtime or Runtime.open(), history, progress)


def _drawn(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    params: FrameParams,
    runtime: Runtime,
    history: FrameHistory | None,
    progress: Progress,
) -> Frame:
    with told(progress, "rendering") as tell:
        made = Preparing(tell)
        with runtime.programs.watched(made):
            device_scene(scene, runtime)
            renderer: Renderer = runtime.prepared(
                (Renderer, camera.size, params.shape(), history is not None),
                lambda: Renderer(runtime, camera.size, params, history=history is not None),
            )
        renderer.params = params
        return renderer(scene, camera, lights, history=history, progress=part_of(tell, made.share, 1.0))
