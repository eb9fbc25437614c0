"""Accumulation: the mean of a value over the frames in which each surface was seen."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any, Literal, TypedDict, Unpack, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.history import History
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.history import DeviceHistory
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.techniques.source import camera_of
from ssgi_cl.techniques.technique import Bench, Technique

Clamp = Literal["neighbourhood", "fast", "none"]
"""What brings a long mean back to what is seen now."""

UNHELD = 1e9
"""Standard errors that no difference exceeds."""
MOST_VALUE = 1e18
"""Greatest value whose square float32 can sum up."""

STRUCT = Struct(
    "AccumulateParams",
    (
        *floats(*ROTATION, "x", "y", "z", "limit", "fast", "plane_distance", "least_cosine", "clamp_sigma", "young"),
        *floats("scale_x", "scale_y"),
        *ints("margin_columns", "margin_rows", "before_columns", "before_rows"),
    ),
)


def _value(_: object) -> Hashable:
    """Return what programs depend on: nothing."""
    return None


@dataclass(frozen=True, kw_only=True)
class AccumulateParams(Params):
    """Parameters of the accumulation over frames."""

    limit: int = param(
        32,
        "frames that a mean stands for at most: from then on a new one weighs 1 / limit",
        low=1,
        high=4096,
        unit="frames",
        shape=_value,
    )
    fast: int = param(
        4, "likewise, of the fast mean; means of more frames are clamped", low=1, high=4096, unit="frames", shape=_value
    )
    clamp: Clamp = param(
        "neighbourhood",
        "what a long mean is held to, in its neighbourhood: the values of this frame, the fast means, or nothing",
        choices=get_args(Clamp),
    )
    clamp_sigma: float = param(
        3.0,
        "standard errors up to which the mean difference there is no change; of n pixels never more than the root of n",
        low=0.0,
        high=1e3,
    )
    clamp_radius: int = param(3, "pixels on either side that are the neighbourhood", low=1, high=8, unit="px")
    young: int = param(
        0,
        "frames below which a mean takes in those of its neighbourhood, weighted by their frames; 0: none does",
        low=0,
        high=4096,
        unit="frames",
        shape=_value,
    )
    plane_distance: float = param(
        2.0,
        "distance from the tangent plane up to which a pixel shows the surface, in footprints of a pixel",
        low=0.0,
        high=1e4,
        above=True,
        unit="footprints",
    )
    normal_angle: float = param(
        0.5, "angle between normals up to which it does so", low=0.0, high=math.pi, unit="radians"
    )


class AccumulateKeywords(TypedDict, total=False):
    """The parameters of `accumulate`."""

    limit: int
    fast: int
    clamp: Clamp
    clamp_sigma: float
    clamp_radius: int
    young: int
    plane_distance: float
    normal_angle: float


class Accumulate(Prepared[AccumulateParams]):
    """The accumulation, prepared for images of one size with `channels` values a pixel.

    Nehab, Sander, Lawrence, Tatarchuk and Isidoro 2007, "Accelerating Real-Time Shading with Reverse Reprojection
    Caching". Departs: see `accumulate`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: of the accumulation.
        channels: values of a pixel.
    """

    def __init__(self, runtime: Runtime, size: Size, params: AccumulateParams | None = None, channels: int = 1) -> None:
        self.runtime, self.size, self.channels = runtime, size, channels
        self._params = params or AccumulateParams()
        self._planes = tuple(DeviceHistory(runtime, size, channels) for _ in range(2))

    def run(
        self,
        gbuffer: DeviceGBuffer,
        value: Plane,
        *,
        previous: DeviceGBuffer | None = None,
        history: DeviceHistory | None = None,
        holds: bool = True,
    ) -> DeviceHistory:
        """Queue the passes; return the new history, whose `mean` is the result.

        It is there until the second run from now: two histories take turns.

        Args:
            gbuffer: of this frame; its `motion` counts if it has any.
            value: of this frame, `channels` images of at most 1e18.
            previous: of the frame before, of any size.
            history: what the run for it returned; None begins anew.
            holds: whether long means are held to what `clamp` says; not where nothing but the camera has changed.
        """
        camera, params = camera_of(gbuffer), self.params
        first = history is None or previous is None
        target = self._planes[history is self._planes[0]]
        clamps = holds and not first and params.clamp != "none" and params.limit > params.fast
        joins = params.young > 1 and not first
        images = [target.mean, target.count, target.reasons]
        if clamps or joins:
            images = [self.runtime.transient.plane(plane.count, self.size) for plane in images]
        blended, frames, why = images
        macros = {"ACCUMULATE_COUNT": self.channels, "ACCUMULATE_FIRST": int(first)}
        before: dict[str, Any] = {}
        packed = self._packed(camera, gbuffer, previous)
        if history is not None and previous is not None:
            macros |= {"ACCUMULATE_MOTION": gbuffer.moves, "ACCUMULATE_LAYERS": previous.layers}
            before = {
                "normal": gbuffer.normal,
                "depth_before": previous.depth,
                "normal_before": previous.normal,
                "mean_before": history.mean,
                "fast_before": history.fast,
                "square_before": history.square,
                "count_before": history.count,
                "size_before": history.size,
                "whole_before": previous.whole,
                "camera": gbuffer.camera_struct,
                "camera_before": previous.camera_struct,
            }
            if gbuffer.moves:
                before["motion"] = gbuffer.motion
        else:
            macros |= {"ACCUMULATE_MOTION": 0, "ACCUMULATE_LAYERS": 1}
        structs = (CAMERA, STRUCT)
        self.runtime.kernel("temporal/accumulate.cl", macros, structs).run(
            self.size,
            value=value,
            depth=gbuffer.depth,
            **before,
            mean=blended,
            fast=target.fast,
            square=target.square,
            count=frames,
            reasons=why,
            whole=gbuffer.whole,
            params=packed,
        )
        if clamps or joins:
            if not clamps:
                packed = self._packed(camera, gbuffer, previous, sigma=UNHELD)
            macros = {
                "ACCUMULATE_COUNT": self.channels,
                "ACCUMULATE_REACH": params.clamp_radius,
                "ACCUMULATE_YOUNG": int(joins),
            }
            self.runtime.kernel("temporal/accumulate_clamp.cl", macros, structs).run(
                self.size,
                blended=blended,
                frames=frames,
                why=why,
                source=target.fast if params.clamp == "fast" else value,
                depth=gbuffer.depth,
                normal=gbuffer.normal,
                mean=target.mean,
                count=target.count,
                reasons=target.reasons,
                whole=gbuffer.whole,
                camera=gbuffer.camera_struct,
                params=packed,
            )
        return target

    def _packed(
        self, camera: Camera, gbuffer: DeviceGBuffer, previous: DeviceGBuffer | None, sigma: float | None = None
    ) -> Any:
        """Return the struct of a frame's parameters; camera to camera in float64. `sigma` in place of `clamp_sigma`."""
        params = self.params
        other = camera if previous is None else camera_of(previous)
        turn = other.view[:3, :3] @ camera.view[:3, :3].T
        shift = other.view[:3, 3] - turn @ camera.view[:3, 3]
        margin = (0, 0) if previous is None else previous.margin
        return STRUCT.pack(
            {
                **rotation_values(turn),
                **dict(zip("xyz", shift.tolist(), strict=True)),
                "limit": params.limit,
                "fast": min(params.fast, params.limit),
                "plane_distance": params.plane_distance,
                "least_cosine": math.cos(params.normal_angle),
                "clamp_sigma": params.clamp_sigma if sigma is None else sigma,
                "young": params.young,
                "scale_x": other.width / camera.width,
                "scale_y": other.height / camera.height,
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
                "before_columns": margin[1],
                "before_rows": margin[0],
            }
        )


@with_fields_described(AccumulateParams)
@serialised
def accumulate(
    plane: ArrayLike,
    gbuffer: GBuffer | DeviceGBuffer,
    previous: GBuffer | DeviceGBuffer | None = None,
    history: History | None = None,
    *,
    runtime: Runtime | None = None,
    **params: Unpack[AccumulateKeywords],
) -> tuple[NDArray[np.float32], History]:
    """Return the mean of a value over the frames in which each surface was seen, and the history for the next.

    Nehab, Sander, Lawrence, Tatarchuk and Isidoro 2007, "Accelerating Real-Time Shading with Reverse
    Reprojection Caching". Departs: each of the four taps of the previous image is tested by its distance
    from the tangent plane, its layer and its normal, and what is left is renormalised; a frame weighs
    1 / (frames + 1); a long mean is moved by its mean difference from this frame's values, or from fast
    means (NVIDIA ReBLUR), over the neighbourhood on the same surface, where that is significant.

    Args:
        plane: [rows, columns] or [rows, columns, 3] float32 of the G-buffer's size, any result whose
            noise differs from frame to frame (`gtao(frame=k)`), within -1e18 to 1e18.
        gbuffer: of this frame. Where surfaces were is told by its `motion`; without, they stand still.
        previous: the G-buffer of the frame before, of any size; None in the first frame and after a cut.
        history: what the call for the frame before returned; None likewise.
        runtime: the device; by default the fastest found.
        **params: the fields of `AccumulateParams`.

    Returns:
        The mean, of the shape of `plane`, and its history. Where nothing is, or the history begins anew,
        the mean is the value itself, to the bit.

    Raises:
        TypeError, ValueError: dtype, shape or values of the plane, or a parameter out of range;
            `history` without `previous`, or of another size or number of channels.
    """
    values = checks.as_array("plane", plane)
    coloured = values.ndim == 3
    values = checks.plane("plane", values, channels=3 if coloured else 0, low=-MOST_VALUE, high=MOST_VALUE)
    planes = np.moveaxis(values, -1, 0) if coloured else values[None]
    chosen = AccumulateParams(**params)
    for name, given in (("gbuffer", gbuffer), ("previous", gbuffer if previous is None else previous)):
        if not isinstance(given, GBuffer | DeviceGBuffer):
            raise TypeError(f"{name} is {type(given).__name__}: expected GBuffer or DeviceGBuffer")
    if values.shape[:2] != gbuffer.size:
        raise ValueError(f"plane has shape {values.shape}: expected {gbuffer.size} as the G-buffer")
    if history is not None:
        _check_history(history, previous, len(planes))
    device = on_device(gbuffer, runtime)
    runtime, size = device.runtime, device.size
    begins = history is None or previous is None
    # Memory of its own for what was before, which may be of the same size.
    earlier = None if previous is None or begins else on_device(previous, runtime, place=1)
    if earlier is not None and earlier is device:
        raise ValueError("previous is the G-buffer itself in device memory: expected that of the frame before")
    technique, value = runtime.prepared(
        (Accumulate, size, chosen.shape(), len(planes)),
        lambda: (Accumulate(runtime, size, chosen, len(planes)), runtime.plane(len(planes), size)),
    )
    technique.params = chosen
    value.upload(planes)
    before: DeviceHistory | None = None
    if history is not None and earlier is not None:
        before = runtime.prepared(
            (DeviceHistory, history.size, len(planes)), lambda: DeviceHistory(runtime, earlier.size, len(planes))
        )
        before.upload(history)
    with runtime.frame():
        result = technique.run(device, value, previous=earlier, history=before).download()
    return result.mean.copy(), result


def _check_history(history: object, previous: GBuffer | DeviceGBuffer | None, channels: int) -> None:
    """Raise TypeError or ValueError unless a history fits the previous G-buffer."""
    if not isinstance(history, History):
        raise TypeError(f"history is {type(history).__name__}: expected the History that accumulate returned, or None")
    if previous is None:
        raise ValueError("history is given without previous: expected the G-buffer of the frame before, or neither")
    if history.size != previous.size:
        raise ValueError(f"history has size {history.size}: expected {previous.size} as the previous G-buffer")
    own = history.mean.shape[2] if history.mean.ndim == 3 else 1
    if own != channels:
        raise ValueError(f"history has {own} channel(s): expected {channels} as the plane")
    most = 1.01 * MOST_VALUE  # with roundings
    for name in ("mean", "fast", "square", "count"):
        limits: checks.Limits = {"low": -most, "high": most}
        if name in ("square", "count"):
            limits = {"low": 1.0, "high": 1e6} if name == "count" else {"low": 0.0, "high": most**2}
        checks.values_in_range(f"history.{name}", np.asarray(getattr(history, name), np.float32), **limits)


DESCRIPTOR = Technique(
    name="accumulate",
    kind="filter",
    paper="Nehab et al. 2007",
    function=accumulate,
    params=AccumulateParams,
    technique=Accumulate,
    reference="ssgi_cl.reference.temporal.accumulate",
    reads=("depth", "normal", "motion", "image"),
    writes=("image",),
    bench=Bench(rows={"accumulate": ("the mean over earlier frames", (("1 channel", "accumulate.1"),))}),
)
