"""What a tab may show: the picture, a part of its light, or a plane of the G-buffer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, Light, environments_of
from ssgi_cl.core.params import parameter_fields
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.result import Frame
from ssgi_cl.io.previews import depth_view, normal_view, share_view
from ssgi_cl.rasterize import gbuffer as rasterized
from ssgi_cl.techniques.ao.multi_bounce import multi_bounce
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.filters.tonemap import auto_exposure, tonemap
from ssgi_cl.techniques.reflections.reflections import reflections
from ssgi_cl.techniques.sampled_lights.sampled_lights import sampled_lights
from ssgi_cl.viewer.painter import Painter
from ssgi_cl.viewer.settings import direct_params, occlusion_of

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]
Kind = Literal["light", "share", "depth", "normal", "albedo"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Job:
    """What is to be drawn.

    Attributes:
        painter: renders frames.
        scene: or None of a G-buffer.
        gbuffer: of a source without a scene.
        camera, lights, params: of the frame.
        radius: of ambient occlusion where `params` have none, scene units.
        exposure: factor before the tone curve of light that is not the whole picture, whose own it would be.
        encoded: whether only a picture is asked for, so that light need not leave the device as numbers.
    """

    painter: Painter
    scene: Scene | None
    gbuffer: GBuffer | None
    camera: Camera
    lights: tuple[Light, ...]
    params: FrameParams
    radius: float
    exposure: float | None = None
    encoded: bool = False

    @property
    def runtime(self) -> Runtime:
        """The device."""
        return self.painter.runtime

    def frame(self, *outputs: str) -> Frame:
        """Return a frame of the scene."""
        assert self.scene is not None  # noqa: S101  outputs of scenes alone ask for it
        return self.painter.frame(self.scene, self.camera, self.lights, self.params, *outputs)

    def surfaces(self) -> GBuffer:
        """Return the G-buffer: the one that was given, or of the scene."""
        if self.gbuffer is not None:
            return self.gbuffer
        assert self.scene is not None  # noqa: S101  one of both is there
        return rasterized(self.scene, self.camera, layers=self.params.layers, runtime=self.runtime)


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """What was drawn.

    Attributes:
        kind: what `values` are.
        values: light in W m^-2 sr^-1 [rows, columns, 3]; a share, or depth in scene units [rows, columns]; normals in
            world space or albedo [rows, columns, 3]. None where only the picture was asked for.
        picture: [rows, columns, 3] uint8 sRGB, where it is made already.
        frame: that it was made from, if any.
        exposure: of light.
    """

    kind: Kind
    values: Floats | None
    picture: Picture | None = None
    frame: Frame | None = None
    exposure: float = 1.0

    def encoded(self, params: FrameParams, runtime: Runtime) -> Picture:
        """Return [rows, columns, 3] uint8 for display."""
        if self.picture is not None:
            return self.picture
        values = self.values
        assert values is not None  # noqa: S101  either is there
        if self.kind == "light":
            return lit_picture(values, self.exposure, params, runtime)
        if self.kind == "normal":
            return normal_view(values)
        grey = {"depth": depth_view, "share": share_view}.get(self.kind)
        view = share_view(values ** np.float32(1.0 / 2.2)) if grey is None else grey(values)
        return np.ascontiguousarray(np.broadcast_to(np.atleast_3d(view), (*view.shape[:2], 3)))


@dataclass(frozen=True, kw_only=True)
class Output:
    """Something to show.

    Attributes:
        name: in the page.
        doc: what it is, for the page.
        draw: makes it.
        of_gbuffer: whether G-buffers without a scene have it.
    """

    name: str
    doc: str
    draw: Callable[[Job], Drawn]
    of_gbuffer: bool = False


def lit_picture(radiance: Floats, exposure: float, params: FrameParams, runtime: Runtime) -> Picture:
    """Return light as a picture [rows, columns, 3] uint8."""
    picture: Picture = tonemap(np.maximum(radiance, 0.0), exposure=exposure, curve=params.curve, runtime=runtime)
    return picture


def _picture(job: Job) -> Drawn:
    if job.scene is None:
        return _shaded(job)
    frame = job.frame("image") if job.encoded else job.frame("image", "radiance")
    values = None if job.encoded else frame.radiance
    return Drawn(kind="light", values=values, picture=frame.image, frame=frame, exposure=frame.exposure)


def _shaded(job: Job) -> Drawn:
    """Return direct and ambient light at the surfaces of a G-buffer."""
    surfaces = job.surfaces()
    visibility = _occlusion(job, surfaces)
    bounced = visibility is not None and job.params.multi_bounce
    radiance = shade(surfaces, job.lights, ao=visibility, multi_bounce=bounced, runtime=job.runtime)
    return _light(job, radiance)


def _light(job: Job, radiance: Floats, frame: Frame | None = None) -> Drawn:
    chosen = job.params.exposure or job.exposure
    exposure = auto_exposure(radiance) if chosen is None else chosen
    return Drawn(kind="light", values=radiance, frame=frame, exposure=exposure)


def _occlusion(job: Job, surfaces: GBuffer) -> Floats | None:
    """Return A of a G-buffer, None where the frame has no ambient occlusion."""
    params = occlusion_of(job.params, job.radius)
    if params is None:
        return None
    technique = next(each for each in TECHNIQUES.values() if type(params) is each.params)
    values = {name: getattr(params, name) for name in parameter_fields(type(params)) if name != "bent_normals"}
    found: Floats = technique.function(surfaces, runtime=job.runtime, **values)
    return found


def _ao(job: Job) -> Drawn:
    if job.scene is None:
        surfaces = job.surfaces()
        found = _occlusion(job, surfaces)
        albedo = surfaces.first("albedo")
        if found is not None and albedo is not None and job.params.multi_bounce:
            found = multi_bounce(found, surfaces.inner(albedo)).mean(axis=-1)
        size = surfaces.size
        return Drawn(kind="share", values=np.ones(size, np.float32) if found is None else found)
    frame = job.frame("ao")
    values = np.ones(job.camera.size, np.float32) if frame.ao is None else frame.ao
    return Drawn(kind="share", values=values, frame=frame)


def _direct(job: Job) -> Drawn:
    punctual = tuple(light for light in job.lights if not isinstance(light, Environment))
    params = replace(direct_params(job.params), ao=False, ao_samples=None)
    assert job.scene is not None  # noqa: S101  of scenes alone
    frame = job.painter.frame(job.scene, job.camera, punctual, params, "radiance")
    return _light(job, frame.radiance, frame)


def _indirect(job: Job) -> Drawn:
    frame = job.frame("indirect")
    none = np.zeros((*job.camera.size, 3), np.float32)
    return _light(job, none if frame.indirect is None else frame.indirect / np.float32(np.pi), frame)


def _sky(job: Job) -> Drawn:
    skies = environments_of(job.lights)
    if not skies or job.scene is None:
        return _light(job, np.zeros((*job.camera.size, 3), np.float32))
    whole = job.params.whole
    counts = {} if whole is None else {"directions": whole.directions, "map_size": whole.map_size}
    found = sampled_lights(job.surfaces(), skies, scene=job.scene, runtime=job.runtime, **counts)
    return _light(job, found / np.float32(np.pi))


def _reflections(job: Job) -> Drawn:
    frame = job.frame("radiance")
    assert job.scene is not None  # noqa: S101  of scenes alone
    with_lobes = reflections(job.surfaces(), frame.radiance, job.lights, scene=job.scene, runtime=job.runtime)
    return _light(job, np.maximum(with_lobes - frame.radiance, 0.0), frame)


def _plane(name: Kind) -> Callable[[Job], Drawn]:
    def draw(job: Job) -> Drawn:
        surfaces = job.surfaces()
        array = surfaces.first(name)
        if array is None:
            raise ValueError(f"the G-buffer has no {name}: expected another output")
        return Drawn(kind=name, values=surfaces.inner(array))

    return draw


OUTPUTS: dict[str, Output] = {
    each.name: each
    for each in (
        Output(name="picture", doc="all light, through exposure and tone curve", draw=_picture, of_gbuffer=True),
        Output(name="ao", doc="ambient occlusion, 1 = white = unoccluded", draw=_ao, of_gbuffer=True),
        Output(name="direct", doc="light of lights other than environments, and emission", draw=_direct),
        Output(name="indirect", doc="irradiance by reflected light over pi: as a white surface", draw=_indirect),
        Output(name="sky", doc="irradiance by environments over pi: as a white surface", draw=_sky),
        Output(name="reflections", doc="what glossy lobes reflect of lights and of the picture", draw=_reflections),
        Output(name="normals", doc="world space; -1 to 1 are 0 to 255", draw=_plane("normal"), of_gbuffer=True),
        Output(name="depth", doc="near is white, nothing black", draw=_plane("depth"), of_gbuffer=True),
        Output(
            name="albedo",
            doc="linear reflectance, shown through a power of 1/2.2",
            draw=_plane("albedo"),
            of_gbuffer=True,
        ),
    )
}
"""Everything that may be shown, by name; the first is the default."""

ERROR = "error"
"""Output that is made from another and a reference, where there is one."""
