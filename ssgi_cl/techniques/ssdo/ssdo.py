"""Screen-space directional occlusion: direct light with occlusion by near surfaces, and one bounce."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.checks import LEAST_DEPTH
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Light, environments_of
from ssgi_cl.core.params import Prepared, parameter_fields, with_fields_described
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.arrays import Plane, Size, plane_bytes
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import Struct, floats, ints
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.ao.bent_normals import BentNormals
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.ao.occlusion_bands import filtered_rows, pixels_per_depth, widest_ray
from ssgi_cl.techniques.bands import Plan, banded
from ssgi_cl.techniques.direct.light_data import PunctualLights
from ssgi_cl.techniques.direct.shadow_maps import checked_lights, uploaded_maps
from ssgi_cl.techniques.direct.sky import Sky
from ssgi_cl.techniques.radius import sensible_radius
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams, paired_layers
from ssgi_cl.techniques.ssdo.ssdo_params import METHODS, SsdoKeywords, SsdoParams
from ssgi_cl.techniques.ssdo.ssdo_points import SsdoPoints
from ssgi_cl.techniques.ssdo.ssdo_stages import (
    BackEnd,
    Finish,
    Senders,
    Shadows,
    ViewSenders,
    punctual_lights_of,
    set_lights,
    shape_of,
)
from ssgi_cl.techniques.technique import Bench, Technique

SPLIT = Struct(
    "SplitParams",
    (*floats("red", "green", "blue"), *ints("margin_columns", "margin_rows", "lights_columns", "lights_rows")),
)


@dataclass(frozen=True, eq=False)
class SsdoPlanes:
    """Results of directional occlusion in device memory.

    Attributes:
        direct: 3 images, irradiance by all lights, W/m^2; 0 where nothing is.
        bounce: 3 images, irradiance by surfaces within the radius, or None if there is none.
        visibility: a plane whose first image is A, or None if no pass needed it.
        bent: A, and x, y and z of the mean unoccluded direction in world space, of unit length; 0
            where nothing is. None without `bent_normals`. Auxiliary cameras change A only.
    """

    direct: Plane
    bounce: Plane | None
    visibility: Plane | None
    bent: Plane | None = None


class Ssdo(Prepared[SsdoParams]):
    """Directional occlusion and one bounce, prepared for images of one size.

    Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image Space".
    Departs: by default surfaces are found by visibility bitmasks (Therrien, Levesque and Gilet
    2023, "Screen Space Indirect Lighting with Visibility Bitmask"), so that each direction is either
    occluded, and receives the light of its sender, or unoccluded. Method "published" is the paper's.

    Args:
        runtime: the device.
        size: (rows, columns) of the results.
        params: see `SsdoParams`.
        margin: (rows, columns) by which the G-buffers exceed it on every side.
        layers: depth layers of the G-buffers.
        attributes: layers with normals, albedo and emission, 1 or all: only these send light.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: SsdoParams | None = None,
        margin: Size = (0, 0),
        layers: int = 1,
        attributes: int = 1,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or SsdoParams()
        self._shape = shape = (size, margin, layers, attributes)
        self._back = self._back_end()
        self._senders = Senders(runtime, params, shape) if params.bounce else None
        self._bent: BentNormals | None = None
        if params.bent_normals:
            if params.method != "bitmask":
                raise ValueError(f"bent_normals is True with {params.method!r}: expected 'bitmask'")
            self._bent = BentNormals(runtime, size)
        self._views: ViewSenders | None = None
        self._punctual_lights: PunctualLights | None = None
        self._sky = Sky(runtime)
        self._finish = Finish(runtime, size, params)
        # Lights on the front layer and on another, what that sends; then both results.
        runtime.transient.reserve(plane_bytes(9, (size[0] + 2 * margin[0], size[1] + 2 * margin[1])))
        # Frames keep what they need of the results.
        self._direct, self._bounce = (Target(runtime, 3, size, kept=False) for _ in range(2))

    def _back_end(self, *, kept: bool = False) -> BackEnd:
        """Return the back end; `kept` asks for its data that auxiliary cameras add to."""
        size, margin, layers, _ = self._shape
        own = self.params.back_end(size, margin)
        if isinstance(own, SsdoBitmaskParams):
            return SsdoBitmask(self.runtime, size, own, margin, layers, masks=kept)
        return SsdoPoints(self.runtime, size, RESOLUTIONS[self.params.resolution], own, kept=kept)

    def _set(self, params: SsdoParams) -> None:
        back: Any = self._back  # of the same method
        back.params = params.back_end(*self._shape[:2])
        for part in (self._senders, self._views):
            if part is not None:
                part.set(params)
        if self._punctual_lights is not None:
            set_lights(self._punctual_lights, params)

    def run(
        self,
        gbuffer: DeviceGBuffer,
        lights: Sequence[Light],
        *,
        shadows: Shadows = None,
        radiance: Plane | None = None,
        auxiliary_views: Iterable[DeviceGBuffer] = (),
    ) -> SsdoPlanes:
        """Queue the passes. Nothing is allocated after the first call with such arguments.

        Args:
            gbuffer: of the size, margin, layers and attributes that this was prepared for.
            lights: any number of lights.
            shadows: one entry for each light (None: it casts no shadow).
            radiance: of the surfaces, if it is known: 3 images for each layer (number 3 layer +
                channel) of the size with margin, W m^-2 sr^-1, 0 where nothing is. With the method
                "bitmask" as many more may follow for the sides that the camera doesn't see.
            auxiliary_views: what auxiliary cameras see, of any size, margin and layers. Their
                surfaces occlude and send light where the G-buffer shows none. Each view is done
                with before the next is asked for.
        """
        if shape_of(gbuffer) != self._shape:
            raise ValueError(
                "the G-buffer's size, margin, layers and layers with attributes are "
                f"{shape_of(gbuffer)}: expected {self._shape}"
            )
        self._sky.set(environments_of(lights))
        ambient = self._sky.image is not None or bool(self._sky.constant.any())
        sent: Any = radiance
        if self._senders is not None and radiance is None:
            sent, punctual_lights = self._senders.radiance(gbuffer, lights, shadows, ambient=ambient)
            lights_margin = gbuffer.margin
        else:
            self._punctual_lights = self._punctual_lights or punctual_lights_of(self.runtime, self.size, self.params)
            punctual_lights, lights_margin = self._punctual_lights.run(gbuffer, lights, shadows=shadows), (0, 0)
        if punctual_lights is not None:
            punctual_lights = self._finish.lights(gbuffer, punctual_lights, lights, shadows)
        if not self.params.bounce:
            sent = None
        sends = sent is not None
        gathered = bent = None
        if not sends and not ambient and self._bent is None:
            self.runtime.skip("ssdo", "no ambient light, and nothing that a surface could send")
        else:
            source, views = self._finish.source(gbuffer), iter(auxiliary_views)
            first = next(views, None)
            if first is not None and self._views is None:
                self._views = ViewSenders(self.runtime, self.params)
                self._back = self._back_end(kept=True)
            sky = self._sky if self._sky.image is not None else None
            gathered = self._back.run(gbuffer, source, radiance=sent, sky=sky)
            if first is not None and self._views is not None:
                views = chain((first,), views)
                self._views.add(
                    gathered, self._back, gbuffer, source, views, lights, shadows, ambient=ambient, sends=sends
                )
            gathered = self._finish.run(gbuffer, gathered, source=source)
        direct, bounce = self._split(gbuffer, gathered, sends, punctual_lights, lights_margin)
        if self._bent is not None and gathered is not None:
            bent = self._bent.run(gbuffer, gathered)
        return SsdoPlanes(direct, bounce, gathered, bent)

    def look(self, gbuffer: DeviceGBuffer) -> None:
        """Queue the pass that needs the G-buffer's normals in world space, if there is one."""
        if self.params.method == "bitmask":
            paired_layers(gbuffer)

    def _split(
        self,
        gbuffer: DeviceGBuffer,
        gathered: Plane | None,
        bounces: bool,
        punctual_lights: Plane | None,
        lights_margin: Size,
    ) -> tuple[Plane, Plane | None]:
        kernel = self.runtime.kernel(
            "ssdo/ssdo_split.cl",
            {
                "SPLIT_GATHERED": int(gathered is not None),
                "SPLIT_SKY": int(gathered is not None and self._sky.image is not None),
                "SPLIT_BOUNCE": int(bounces),
                "SPLIT_LIGHTS": int(punctual_lights is not None),
                "SPLIT_FIRST": 1 if self._bent is None else 4,
            },
            (SPLIT,),
        )
        red, green, blue = (np.pi * self._sky.constant).tolist()
        values = {
            "red": red,
            "green": green,
            "blue": blue,
            "margin_columns": gbuffer.margin[1],
            "margin_rows": gbuffer.margin[0],
            "lights_columns": lights_margin[1],
            "lights_rows": lights_margin[0],
        }
        # Both have the same background: 0.
        with (
            self._direct.over(gbuffer.seen) as (direct, over),
            self._bounce.over(gbuffer.seen if bounces else None) as (bounce, _),
        ):
            kernel.run(
                self.size,
                region=over,
                depth=gbuffer.depth,
                gathered=gathered,
                punctual_lights=punctual_lights,
                direct=direct,
                bounce=bounce,
                params=SPLIT.pack(values),
            )
        return direct, bounce if bounces else None


def _plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
    names = parameter_fields(SsdoParams)
    given = {name: value for name, value in arguments.items() if name in names and value is not None}
    given["radius"] = sensible_radius(gbuffer, given.get("radius"))
    params = SsdoParams(**given)
    depth: Any = gbuffer.first("depth")
    nearest = max(float(depth.min(initial=math.inf)), LEAST_DEPTH)
    pixels = min(params.radius * pixels_per_depth(gbuffer.camera, nearest), params.max_radius_px)
    rows = min(pixels * widest_ray(gbuffer.camera) + 2.0, gbuffer.size[0]) + filtered_rows(params)
    return Plan({**arguments, "radius": params.radius}, math.ceil(rows), planes=("radiance",))


@banded(_plan)
@with_fields_described(SsdoParams)
@serialised
def ssdo(
    gbuffer: GBuffer | DeviceGBuffer,
    lights: Sequence[Light],
    radius: float | None = None,
    *,
    shadow_maps: Sequence[ReflectiveShadowMap | None] | None = None,
    radiance: ArrayLike | None = None,
    auxiliary_views: Sequence[GBuffer | DeviceGBuffer] = (),
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[SsdoKeywords],
) -> tuple[NDArray[np.float32], ...]:
    """Compute direct light with occlusion by near surfaces, and the light that they reflect once.

    Screen-space directional occlusion (Ritschel, Grosch and Seidel 2009, "Approximating Dynamic
    Global Illumination in Image Space"). `method` says how surfaces are found:

    - "bitmask" (default). Departs most: slices through the view ray cover sectors of the
      hemisphere (Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask").
    - "points" keeps the directions of the hemisphere, each of which has several taps and either
      meets a surface or is unoccluded. Direct and indirect light are conserved: with radiance 1
      everywhere they add up to pi.
    - "published" is equations 1 and 2 with one tap for each direction, sender area pi radius^2 /
      samples times `strength`, and distances of at least `nearest_distance`. It is not conserved:
      the sum above is off by 9 % on average and up to 21 % in an empty box.

    Args:
        gbuffer: what the camera sees. Surfaces of every depth layer occlude light, and those with
            normals and albedo send it; so do those in the margin.
        lights: any number of lights. Near surfaces occlude the light of environments by direction.
            Punctual lights have the shadows of their map or, without one, of the visible surfaces
            within the radius.
        radius: distance up to which surfaces occlude and send light, scene units, > 0; by default 5 % of the
            picture's diagonal where surfaces are seen.
        shadow_maps: for each light its reflective shadow map, whose depth casts its shadow, or None.
        radiance: of the surfaces, W m^-2 sr^-1, >= 0, if it is known: [rows, columns, 3] of the
            size of the depth, or [layers, rows, columns, 3]; by default computed from lights,
            albedo and emission.
        auxiliary_views: what auxiliary cameras see under the same lights (see `auxiliary_cameras`).
            Surfaces that only they see occlude and send light too.
        max_memory: as of `gtao`; roundings of taps then differ in some pixels.
        runtime: the device; by default the fastest found.
        **params: the other fields of `SsdoParams`.

    Returns:
        Irradiance by all lights and by near surfaces, two [rows, columns, 3] float32 in W/m^2; 0
        where nothing is there. With `bent_normals` a third: the mean unoccluded direction, in world
        space, of unit length; 0 where nothing is.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    lights = checked_lights(lights, shadow_maps)
    chosen = SsdoParams(radius=sensible_radius(gbuffer, radius), **params)
    device = on_device(gbuffer, runtime)
    if device.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    runtime = device.runtime
    shape = shape_of(device)
    technique: Ssdo = runtime.prepared(
        (Ssdo, chosen.shape(), *shape), lambda: Ssdo(runtime, shape[0], chosen, *shape[1:])
    )
    technique.params = chosen
    sent = None if radiance is None else _uploaded_radiance(radiance, device)
    with runtime.frame():
        planes = technique.run(
            device,
            lights,
            shadows=uploaded_maps(lights, shadow_maps, runtime),
            radiance=sent,
            auxiliary_views=[_uploaded_view(view, number, runtime) for number, view in enumerate(auxiliary_views)],
        )
        images = [
            np.zeros((3, *device.size), np.float32) if plane is None else plane.download()
            for plane in (planes.direct, planes.bounce)
        ]
        if planes.bent is not None:
            images.append(planes.bent.download()[1:])
    return tuple(np.ascontiguousarray(np.moveaxis(image, 0, -1)) for image in images)


def _uploaded_view(view: GBuffer | DeviceGBuffer, number: int, runtime: Runtime) -> DeviceGBuffer:
    """Return an auxiliary view in device memory of its own."""
    if not isinstance(view, (GBuffer, DeviceGBuffer)):
        raise TypeError(f"auxiliary_views[{number}] is {type(view).__name__}: expected GBuffer or DeviceGBuffer")
    return on_device(view, runtime, place=number + 1)


def _uploaded_radiance(radiance: ArrayLike, device: DeviceGBuffer) -> Plane:
    """Return the plane of the radiance that surfaces send; layers that the array lacks send nothing."""
    given = checks.as_array("radiance", radiance)
    flat = given.reshape(-1, *given.shape[-2:]) if given.ndim == 4 else given
    values = checks.plane("radiance", flat, channels=3, low=0.0, unit="W m^-2 sr^-1")
    shape = given.shape if given.ndim == 4 else (1, *given.shape)
    if shape[1:] != (*device.whole, 3) or shape[0] not in (1, device.layers):
        raise ValueError(
            f"radiance has shape {given.shape}: expected {(*device.whole, 3)}, or with "
            f"{device.layers} layers in front, as the depth"
        )
    images = np.zeros((3 * device.layers, *device.whole), np.float32)
    images[: 3 * shape[0]] = np.moveaxis(values.reshape(shape), -1, 1).reshape(-1, *device.whole)
    plane: Plane = device.runtime.prepared(
        ("ssdo radiance", device.whole, device.layers), lambda: device.runtime.plane(len(images), device.whole)
    )
    plane.upload(images)
    return plane


DESCRIPTOR = Technique(
    name="ssdo",
    kind="indirect",
    paper="Ritschel, Grosch and Seidel 2009",
    function=ssdo,
    params=SsdoParams,
    technique=Ssdo,
    reference="ssgi_cl.reference.ssdo.ssdo_bitmask",
    reads=("depth", "normal", "albedo", "emission", "thickness", "lights", "shadow_maps"),
    writes=("direct", "bounce", "bent"),
    methods=dict.fromkeys(METHODS, SsdoParams),
    command=True,
    quantity="bounce",
    bench=Bench(
        families=("ssdo-bitmask-half", "ssdo-points"),
        rows={
            "ssdo": (
                "directional occlusion and one-bounce indirect light from visible surfaces",
                (("bitmask, half size", "ssdo-bitmask-half.2"), ("points", "ssdo-points.8")),
            )
        },
    ),
)
