"""Virtual point lights in device memory, in the form that kernels read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.vpls import PARTS, SHARPEST, Vpls
from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.constants import VPL_BOUNDS, VPL_LIGHT, VPL_LOBE_BOUNDS, VPL_LOBE_LIGHT
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import ROTATION, Struct, floats, ints, rotation_values
from ssgi_cl.techniques.vpl.flux_curve import FluxCurve, curve_key
from ssgi_cl.techniques.vpl.vpl_choice import ChosenVpls
from ssgi_cl.techniques.vpl.world_vpls import WorldVpls

Doubles = NDArray[np.float64]

VPL = Struct(
    "VplParams",
    (
        *floats("per_unit", "gain", "cutoff", "lobe_centre", "lobe_squared", "refine"),
        *ints("segment", "count", "stride", "span", "capacity", "near_capacity", "margin_columns", "margin_rows"),
    ),
)
PLACE = Struct(
    "VplPlaceParams",
    (
        *floats(*ROTATION, "x", "y", "z", "per_unit", "per_brightest"),
        *ints("lights", "split", "batch", "subsets", "stride", "span", "edge_stride", "place_stride"),
    ),
)

BATCH = 2048
"""Lights of one pass, which bounds the memory for the lists of an image's tiles."""
CAPACITY = 2
"""Places of a tile's list for each light of a batch, where parts are listed beside lights."""
NEAR_CAPACITY = 1024
"""Places of a tile's list of lights that have parts there, with subsets; less by some lanes."""
LIGHT, BOUNDS = VPL_LIGHT, VPL_BOUNDS
LOBE_LIGHT, LOBE_BOUNDS = VPL_LOBE_LIGHT, VPL_LOBE_BOUNDS
LEAST_AREA = 1e-12
"""Least area of a light, in squares of the lights' distance from the eye: float32 holds its products."""
BRIGHTEST = 1e30
"""W, or W per square unit: more counts as this."""
LEAST_REACH, MOST_REACH = 1e-15, 1e14
"""Scene units: distances of a scene from its light. Squares of 1e-3 of the one, and areas of texels
at the other, are float32 numbers."""


def packed_params(values: Mapping[str, float], margin: Size) -> Any:
    """Return the struct `VPL` of an image with a margin; members that are not given are 0."""
    zeros = dict.fromkeys((name for name, _ in VPL.members), 0)
    return VPL.pack({**zeros, **values, "margin_columns": margin[1], "margin_rows": margin[0]})


class DeviceVpls:
    """Lights on the device, in batches of which each is split into `subsets` segments.

    Light i of a batch is number i / subsets of the segment i % subsets, so that each subset is
    spread like the whole. With parts, those of number n follow the segment's own lights, at
    stride + 16 n. Places without a light hold one without flux where another light is.

    Args:
        runtime: the device.
        most: lights, at most.
        subsets: 1, or 16 for interleaved sampling.
        parts: whether the lights may have parts.
        listed: places of a list for each light of a batch: 1, or `CAPACITY` where parts are listed.
        glossy: whether they have lobes; then they have no parts.

    Attributes:
        count: lights there are now.
        lights, bounds: see kernels/vpl/vpl_splat.cl and vpl_lists.cl.
        stride, span: lights of a segment, at most, without and with parts.
        room: places of a list.
        parted: whether the lights that there are now have parts.
        values: members of the struct `VPL` that depend on the lights.
        unit: scene units of the length in which kernels count.
    """

    def __init__(
        self,
        runtime: Runtime,
        most: int,
        subsets: int = 1,
        *,
        parts: bool = False,
        listed: int = 1,
        glossy: bool = False,
    ) -> None:
        self.glossy = glossy
        self.most = most
        self.subsets = subsets
        self.count = 0
        self.parted = False
        self.batch = min(most, BATCH // listed)
        self.stride = -(-self.batch // (16 * subsets)) * 16
        self.segments = -(-most // self.batch) * subsets
        self.span = self.stride * (1 + PARTS if parts else 1)
        self.capacity = self.stride * listed
        self.runtime = runtime
        self._floats, bounds = (LOBE_LIGHT, LOBE_BOUNDS) if glossy else (LIGHT, BOUNDS)
        self.lights = runtime.empty(self.segments * self.span * self._floats, np.float32)
        self.bounds = runtime.empty(self.segments * self.stride * bounds, np.float32)
        self.values: dict[str, float] = {}
        self.unit = 1.0

    def records(self) -> NDArray[np.float32]:
        """Return [count, VPL_LIGHT] what kernels read of lights without parts and lobes, in one
        batch: see kernels/vpl/light.clh."""
        found: NDArray[np.float32] = self.lights.download().reshape(-1, LIGHT)[: self.count]
        return found

    def upload(self, vpls: Vpls, camera: Camera, unit: float | None = None) -> None:
        """Replace the contents by lights as a camera sees them.

        Args:
            vpls: the lights.
            camera: whose view space kernels count in.
            unit: as the attribute; by default it suits the lights.

        Raises:
            ValueError: there are too many lights, or they have lobes and should not, or lack them.
        """
        if len(vpls) > self.most:
            raise ValueError(f"vpls has {len(vpls)} lights: expected at most {self.most}")
        if self.glossy != (vpls.axis is not None):
            raise ValueError(
                f"vpls has lights with{'out' if self.glossy else ''} lobes: expected "
                f"{'lobes' if self.glossy else 'diffuse light, which alone this technique takes'}"
            )
        # In float64: both may be far from the world's origin and near each other.
        position = vpls.position @ camera.view[:3, :3].T + camera.view[:3, 3]
        self.count = count = len(vpls)
        self.parted = vpls.parts is not None and self.span > self.stride
        power = np.minimum(vpls.flux, BRIGHTEST)
        furthest = np.abs(position).max(initial=0.0) if unit is None else unit
        unit, brightest = self._scale(furthest, power.max(initial=0.0))
        lights = np.zeros((self.segments, self.span, self._floats), np.float32)
        lights[..., 3] = LEAST_AREA
        if self.glossy:
            lights[..., 11] = 2.0 * math.pi
        if count:
            lights[..., :3] = position[0] / unit
        index = np.arange(count)
        batch, within = index // self.batch, index % self.batch
        segment, number = batch * self.subsets + within % self.subsets, within // self.subsets
        lights[segment, number] = _packed(vpls, camera, unit, brightest)
        if vpls.parts is not None and self.parted:
            places = self.stride + PARTS * number[:, None] + np.arange(PARTS)
            lights[np.repeat(segment, PARTS), places.ravel()] = _packed(vpls.parts, camera, unit, brightest)
        own = lights[:, : self.stride]
        rows = [own[..., :3], -own[..., 4:7], own[..., 3:4]]
        if self.glossy:
            rows += [-own[..., 12:15], own[..., 7:8], own[..., 11:12]]
        bounds = np.concatenate(rows, axis=-1)
        self.lights.send(lights)
        self.bounds.send(bounds.transpose(0, 2, 1))

    def place(
        self, chosen: ChosenVpls | None, camera: Camera, unit: float | None = None, more: WorldVpls | None = None
    ) -> None:
        """Queue the passes that replace the contents by lights as a camera sees them.

        Nothing is read back: lengths and powers are counted in what the maps say that theirs are
        at most, or lengths in a given unit.

        Args:
            chosen: from maps, or None for none.
            camera: whose view space kernels count in.
            unit: as the attribute; by default it suits the lights.
            more: lights that come behind the chosen ones, whose number is rounded up to a multiple
                of 16 by lights without flux.
        """
        own, others = 0 if chosen is None else chosen.count, 0 if more is None else more.count
        first = -(-own // 16) * 16 if more is not None else own
        if first + others > self.most:
            raise ValueError(f"vpls has {first + others} lights: expected at most {self.most}")
        maps = () if chosen is None else chosen.curve.maps
        for rsm in maps:
            rsm.check_scale("light from VPLs", LEAST_REACH, MOST_REACH)
        self.count = first + others
        parted = (chosen is None or chosen.part_places is not None) and self.count > 0
        self.parted = parted and self.span > self.stride
        away = [float(np.abs(rsm.to_view(camera)[:, 3]).max()) + rsm.reach for rsm in maps]
        brightest = [rsm.brightest for rsm in maps]
        if more is not None:
            away.append(float(np.abs(more.to_view(camera)[:, 3]).max()) + more.reach)
            brightest.append(more.brightest)
        unit, power = self._scale(max(away, default=1.0) if unit is None else unit, max(brightest, default=1.0))
        if chosen is not None:
            self._place_chosen(chosen, camera, unit, power)
        if more is not None:
            self._place_more(more, camera, unit, power, first)

    def _place_chosen(self, chosen: ChosenVpls, camera: Camera, unit: float, power: float) -> None:
        values = {
            **self._space(chosen.curve.maps[0].to_view(camera), unit),
            "per_brightest": 1.0 / power,
            "lights": chosen.count,
            "split": chosen.split,
            "edge_stride": chosen.edges.stride,
        }
        wanted = [chosen.places]
        if chosen.part_places is not None and self.parted:
            wanted.append(chosen.part_places)
        for part, places in enumerate(wanted):
            macros = {"VPL_PART": part, "VPL_GLOSSY": int(self.glossy)}
            kernel = self.runtime.kernel("vpl/vpl_place.cl", macros, (PLACE,))
            kernel.run(
                (self.segments, self.stride * (PARTS if part else 1)),
                edges=chosen.edges.array,
                places=places.array,
                lights=self.lights,
                bounds=self.bounds,
                params=PLACE.pack({**values, "place_stride": places.stride}),
            )

    def _place_more(self, more: WorldVpls, camera: Camera, unit: float, power: float, first: int) -> None:
        values = {
            **self._space(more.to_view(camera), unit),
            "per_brightest": more.brightest / power,
            "lights": more.count,
            "split": 1,
            "edge_stride": 0,
        }
        wanted = [(more.lights, more.stride), (more.parts, more.part_stride)]
        for part, (world, stride) in enumerate(wanted[: 1 + int(self.parted)]):
            kernel = self.runtime.kernel("vpl/vpl_to_view.cl", {"VPL_PART": part}, (PLACE,))
            kernel.run(
                (self.segments, self.stride * (PARTS if part else 1)),
                world=world,
                lights=self.lights,
                bounds=self.bounds,
                first=first,
                params=PLACE.pack({**values, "place_stride": stride}),
            )

    def _space(self, to_view: Doubles, unit: float) -> dict[str, float]:
        """Return members of the struct `PLACE` that say where lights are placed."""
        return {
            **rotation_values(to_view[:, :3]),
            **dict(zip("xyz", to_view[:, 3].tolist(), strict=True)),
            "per_unit": 1.0 / unit,
            "batch": self.batch,
            "subsets": self.subsets,
            "stride": self.stride,
            "span": self.span,
        }

    def _scale(self, furthest: float, brightest: float) -> tuple[float, float]:
        """Set and return the units of length and of power; see `values`."""
        self.unit, power = power_of_two(furthest), power_of_two(min(brightest, BRIGHTEST))
        self.values = {
            "per_unit": 1.0 / self.unit,
            "gain": min(power / self.unit**2, BRIGHTEST),
            "stride": self.stride,
            "span": self.span,
            "capacity": self.capacity,
            "near_capacity": NEAR_CAPACITY,
        }
        return self.unit, power

    def batches(self) -> Iterator[dict[str, float]]:
        """Yield the struct's members of each batch; of an empty one if there are no lights."""
        for number in range(max(-(-self.count // self.batch), 1)):
            yield {"segment": number * self.subsets, "count": min(self.count - number * self.batch, self.batch)}


class VplChooser:
    """Chooses lights from maps and places them, some numbers of lights from the same sums.

    Args:
        runtime: the device.
        lights: what is filled, all with lobes or all without.
        most: lights that are chosen, at most; by default as many as there is room for.
    """

    def __init__(self, runtime: Runtime, lights: Sequence[DeviceVpls], most: int | None = None) -> None:
        self.runtime = runtime
        self._lights = tuple(lights)
        self._most = most
        self._chosen: dict[bool, tuple[ChosenVpls, ...]] = {}

    def place(
        self,
        rsms: Sequence[DeviceRsm],
        camera: Camera,
        *,
        kinds: int,
        unit: float | None = None,
        importance: DeviceArray | None = None,
        more: WorldVpls | None = None,
    ) -> FluxCurve:
        """Queue the passes that fill the first `kinds` of the lights from at least one map.

        As long as the maps stay the same, lights are placed anew but not chosen anew, unless
        `importance` is given. Nothing is allocated while the maps' sizes stay the same.

        Args:
            rsms, camera, unit, more: see `DeviceVpls.place`.
            kinds: how many of the lights are wanted.
            importance: of the maps' runs; see `FluxCurve.update`.

        Returns:
            The sums that they were chosen by.
        """
        weighted = importance is not None
        made = self._chosen.get(weighted)
        if made is None or made[0].curve.key != curve_key(rsms):
            curve = FluxCurve(self.runtime, curve_key(rsms), glossy=self._lights[0].glossy)
            made = self._chosen[weighted] = tuple(
                ChosenVpls(curve, min(self._most or own.most, curve.texels), parts=own.span > own.stride)
                for own in self._lights
            )
        made[0].curve.update(rsms, importance)
        for chosen, own in zip(made[:kinds], self._lights, strict=False):
            chosen.update()
            own.place(chosen, camera, unit, more)
        return made[0].curve


def _packed(vpls: Vpls, camera: Camera, unit: float, brightest: float) -> NDArray[np.float32]:
    """Return [count, LIGHT] what kernels read of lights."""
    turn = camera.view[:3, :3]
    lights = np.zeros((len(vpls), LIGHT if vpls.axis is None else LOBE_LIGHT), np.float32)
    lights[:, 0:3] = (vpls.position @ turn.T + camera.view[:3, 3]) / unit
    lights[:, 3] = np.maximum(vpls.area / unit**2, LEAST_AREA)
    lights[:, 4:7] = -vpls.normal @ turn.T
    lights[:, 8:11] = np.minimum(vpls.flux, BRIGHTEST) / brightest
    if vpls.axis is not None and vpls.gloss is not None:
        gloss = np.clip(vpls.gloss, 1.0, SHARPEST)
        lights[:, 12:15] = lights[:, 4:7]
        lights[:, 4:7] = -vpls.axis @ turn.T
        lights[:, 7] = gloss - 1.0
        cosine = np.sum(vpls.axis * vpls.normal, axis=1)
        lights[:, 11] = 2.0 * math.pi * lobe_share(gloss, cosine)
    return lights


def lobe_share(gloss: Doubles, cosine: Doubles) -> Doubles:
    """Return the share of lobes (n + 1) / (2 pi) cos^n lies above their surface, within 0.4 %.

    Exactly it is the distribution of Student's t with n + 1 degrees of freedom at
    sqrt(n + 1) cosine / sine.

    Args:
        gloss: [count] exponents n, >= 1.
        cosine: [count] of the axis to the normal; in [0, 1], or clipped to it.
    """
    squared_sine = np.maximum(1.0 - np.clip(cosine, 0.0, 1.0) ** 2, 1e-30)
    fall = -0.5 * (gloss + 0.6374) * np.log(squared_sine)
    share: Doubles = 1.0 - 0.5 * np.exp(np.maximum(-1.1 * np.sqrt(fall) - 0.7123 * fall, -87.0))
    return share


def power_of_two(value: float) -> float:
    """Return a power of two near a number, 1 for 0: scaled by it, no digit changes."""
    return 2.0 ** round(math.log2(value)) if value > 0.0 else 1.0
