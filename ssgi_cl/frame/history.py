"""What a frame knows of the frames before it: means of its light, and the surfaces that the last one showed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import LARGEST_SIZE, Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.history import History
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.history import DeviceHistory
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.skips import same
from ssgi_cl.techniques.direct.kept_crops import KeptCrops
from ssgi_cl.techniques.radiosity.surfel_history import SurfelHistory
from ssgi_cl.techniques.temporal.accumulate import Accumulate, AccumulateParams

PATTERN = 4
"""Pixels along the side of the square that patterns of samples repeat with."""
PAD = PATTERN - 1
"""Pixels by which an image exceeds the picture along rows and columns, so that patterns may lie elsewhere in it."""
MOVING, MOVING_DIRECT = 8, 4
"""Frames that means of light and of direct light stand for at most while the camera moves: each frame that moves by a
part of a pixel blurs them, and shadows have edges."""
RELIT = 1.0
"""`clamp_sigma` in a frame whose lights are others: most pixels have changed then."""
Named = tuple[tuple[str, int], ...]
_ORDER = (0, 2, 1, 3)
_COLOURS = ("normal", "albedo", "emission", "specular", "motion")


def pattern_shift(number: int) -> tuple[int, int]:
    """Return the columns and rows by which the image of a frame begins before the picture; all 16 in turn."""
    return number % PATTERN, (_ORDER[number % PATTERN] + number // PATTERN) % PATTERN


class Shown(NamedTuple):
    """Where the picture lies in the image that a frame is computed for.

    Attributes:
        row, column: its first pixel.
        size: (rows, columns)
    """

    row: int
    column: int
    size: Size

    @classmethod
    def of(cls, number: int, size: Size) -> Shown:
        """Return the place of the picture in a frame."""
        column, row = pattern_shift(number)
        return cls(row, column, size)

    def camera(self, camera: Camera) -> Camera:
        """Return the camera of the image around a camera's picture."""
        rows, columns = self.size
        return camera.cropped(-self.column, -self.row, columns + PAD, rows + PAD)

    def gbuffer(self, image: GBuffer, camera: Camera, margin: Size) -> GBuffer:
        """Return the G-buffer of the picture, which `camera` sees, and a margin around it, from that of the image."""
        if image.camera is camera:
            return image
        rows, columns = (
            slice(first + there - more, first + there + own + more)
            for first, there, own, more in zip((self.row, self.column), image.margin, self.size, margin, strict=True)
        )
        arrays: dict[str, Any] = {}
        for name in ("depth", "gloss", *_COLOURS):
            array = getattr(image, name)
            if array is not None:
                places = (rows, columns, slice(None)) if name in _COLOURS else (rows, columns)
                arrays[name] = np.asarray(array)[(..., *places)]
        found = GBuffer(camera=camera, **arrays)
        object.__setattr__(found, "exact", image.exact)
        return found

    def part(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return the picture of an image [rows, columns, ...]."""
        rows, columns = self.size
        return np.ascontiguousarray(image[self.row : self.row + rows, self.column : self.column + columns])


def image_size(size: Size) -> Size:
    """Return the size of the image that a picture of `size` lies in. ValueError: it would be too large."""
    if max(size) > LARGEST_SIZE - PAD:
        raise ValueError(
            f"history is asked for with a picture of {size} pixels (rows, columns): expected sides of at most "
            f"{LARGEST_SIZE - PAD}"
        )
    return size[0] + PAD, size[1] + PAD


class _Part:
    """Means of some of a frame's planes.

    Args:
        runtime: the device.
        size: (rows, columns) of the image.
        names: what it has means of, and how many channels each has.

    Attributes:
        history: the latest means, one plane after the other; None: it begins anew.
    """

    def __init__(self, runtime: Runtime, size: Size, names: Named) -> None:
        self.key, self.names = (runtime, size, names), names
        self._accumulate = Accumulate(runtime, size, None, sum(count for _, count in names))
        self.history: DeviceHistory | None = None

    def add(
        self,
        planes: Mapping[str, Plane],
        seen: DeviceGBuffer,
        before: DeviceGBuffer | None,
        limit: int,
        sigma: float | None,
    ) -> dict[str, Plane]:
        """Queue the passes that take the means; return them by name.

        Args:
            planes: of the frame.
            seen, before: G-buffers of the frame and of the one before.
            limit: of the accumulation.
            sigma: `clamp_sigma` of the accumulation; None: means are held to nothing.
        """
        runtime, (_, size, _) = seen.runtime, self.key
        value, first = runtime.transient.plane(self._accumulate.channels, size), 0
        for plane in planes.values():
            value.copy_image(first, plane, plane.count)
            first += plane.count
        earlier, self.history = self.history, None  # should a pass fail, the next frame begins anew
        latest = self._accumulate.params
        held = latest.clamp_sigma if sigma is None else sigma
        self._accumulate.params = replace(latest, limit=limit, clamp_sigma=held)
        self.history = self._accumulate.run(seen, value, previous=before, history=earlier, holds=sigma is not None)
        found, first = dict[str, Plane](), 0
        for name, plane in planes.items():
            found[name] = own = runtime.transient.plane(plane.count, size, plane.outside)
            own.copy_image(0, self.history.mean, plane.count, first)
            first += plane.count
        return found


class _Latest(NamedTuple):
    """The frame before.

    Attributes:
        camera: of its image.
        scene, lights: that it showed.
        shown: where its picture lies.
    """

    camera: Camera
    scene: Scene
    lights: tuple[Light, ...]
    shown: Shown


class FrameHistory:
    """The means of a sequence's light over its frames, in device memory.

    `render` and `Renderer` change it with each frame: one for each sequence. Ambient occlusion, light of environments,
    direct light and what surfaces reflect become means over the frames in which a surface was seen (`accumulate`); each
    frame has its patterns of samples elsewhere. Shadows of punctual lights begin anew where lights or surfaces change;
    other light is then held to what the frame shows, see `accumulate`.

    Args:
        limit: frames that a mean stands for at most, 1 to 4096; while the camera moves at most 8, of direct light 4.

    Raises:
        TypeError, ValueError: `limit` is not that.

    Attributes:
        limit: as given.
        number: frames since it began.
        pattern: number of the place of patterns of samples: it stays where surfaces or lights are others than in the
            frame before, so that no difference between patterns is taken for a change of light.
        surfels: that follow the scene's triangles.
        crops: of shadow maps.
    """

    def __init__(self, limit: int = AccumulateParams.limit) -> None:
        self.limit = AccumulateParams(limit=limit).limit
        self.number = self.pattern = 0
        self.surfels, self.crops = SurfelHistory(), KeptCrops()
        self._latest: _Latest | None = None
        self._gbuffer: DeviceGBuffer | None = None
        self._parts: dict[str, _Part] = {}
        self._drawn = 0  # pattern of the latest frame
        self._lights: tuple[Light, ...] = ()  # that it was asked for with
        self._since = 0  # frames since lights or surfaces changed
        self._serial = 0

    @property
    def key(self) -> tuple[object, int]:
        """What tells a state of the history from others."""
        return self, self._serial

    def reset(self) -> None:
        """Begin anew with the next frame, as after a cut."""
        self.number = self.pattern = 0
        self.surfels, self.crops = SurfelHistory(), KeptCrops()
        self._forget()

    def _forget(self) -> None:
        """Drop the means."""
        self._serial += 1
        self._latest = None
        for part in self._parts.values():
            part.history = None

    def shown(self, size: Size, scene: Scene, lights: Sequence[Light]) -> Shown:
        """Return where a picture of `size` lies in the image of the next frame; set `pattern`."""
        latest, given = self._latest, tuple(lights)
        if latest is not None and latest.scene is scene and same(self._lights, given):
            self.pattern = self._drawn + 1
        self._lights = given
        return Shown.of(self.pattern, size)

    def before(self, scene: Scene) -> tuple[Scene, Camera] | None:
        """Return the scene and the camera of the frame before if surfaces may have moved since; else None."""
        latest = self._latest
        if latest is None or latest.scene is scene or not _same_triangles(latest.scene, scene):
            return None
        return latest.scene, latest.camera

    def add(
        self,
        planes: Mapping[str, Plane],
        seen: DeviceGBuffer,
        scene: Scene,
        lights: Sequence[Light],
        *,
        apart: Mapping[str, bool],
    ) -> dict[str, Plane]:
        """Queue the passes that take the means of a frame's planes; return them by the same names.

        Args:
            planes: any number of planes of the image's size.
            seen: G-buffer of the frame, drawn with `before`.
            scene, lights: of the frame.
            apart: planes whose means are short, and whether they begin anew where anything but the camera changes.
        """
        assert seen.camera is not None  # noqa: S101  it was drawn
        lights, latest = tuple(lights), self._latest
        surfaces = self._surfaces(seen)
        if latest is None or surfaces is None or not _same_triangles(latest.scene, scene):
            self._forget()
            surfaces, latest = None, None
        relit = latest is not None and not same(latest.lights, lights)
        if latest is None or relit or latest.scene is not scene:
            self._since = 0
        if relit:
            self.surfels.order.forget()
        still = latest is not None and latest.scene is scene and _same_place(latest.camera, seen.camera)
        self._latest = None
        groups = {"": {name: plane for name, plane in planes.items() if name not in apart}}
        groups |= {name: {name: planes[name]} for name in apart if name in planes}
        found = dict[str, Plane]()
        for group, own in groups.items():
            if own:
                part = self._part(group, own, seen)
                if apart.get(group, False) and self._since == 0:
                    part.history = None
                limit = self.limit if still else min(self.limit, MOVING_DIRECT if group else MOVING)
                sigma = RELIT if relit else AccumulateParams.clamp_sigma
                holds = self._since < AccumulateParams.fast and not apart.get(group, False)
                found |= part.add(own, seen, surfaces, limit, sigma if holds else None)
        self._keep(seen)
        shown = Shown.of(self.pattern, (seen.size[0] - PAD, seen.size[1] - PAD))
        self._drawn = self.pattern
        self._latest = _Latest(seen.camera, scene, lights, shown)
        self._since += 1
        self._serial += 1
        self.number += 1
        return found

    def _part(self, group: str, planes: Mapping[str, Plane], seen: DeviceGBuffer) -> _Part:
        """Return the means of some planes; they begin anew if they are not those of the frame before."""
        names = tuple((name, plane.count) for name, plane in planes.items())
        key = seen.runtime, seen.size, names
        part = self._parts.get(group)
        if part is None or part.key != key:
            part = self._parts[group] = _Part(*key)
        return part

    def _surfaces(self, seen: DeviceGBuffer) -> DeviceGBuffer | None:
        """Return the G-buffer of the frame before; None if it is not of the same kind."""
        kept = self._gbuffer
        if kept is None or kept.runtime is not seen.runtime:
            return None
        return kept if (kept.size, kept.margin, kept.layers) == (seen.size, seen.margin, seen.layers) else None

    def _keep(self, seen: DeviceGBuffer) -> None:
        """Keep what the next frame needs of a G-buffer."""
        kept = self._surfaces(seen)
        if kept is None:
            kept = self._gbuffer = DeviceGBuffer(
                seen.runtime, seen.size, layers=seen.layers, margin=seen.margin, deferred=True
            )
        assert seen.camera is not None  # noqa: S101  it was drawn
        kept.set_camera(seen.camera)
        kept.depth.copy_image(0, seen.depth, seen.layers)
        kept.normal.copy_image(0, seen.normal, 3)

    def counts(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]] | None:
        """Return frames that each pixel's means stand for, [rows, columns] float32, and why they begin anew, uint8 sums
        of `Reset`; None before the first frame."""
        latest, parts = self._latest, [part for part in self._parts.values() if part.history is not None]
        if latest is None or not parts:
            return None
        history = parts[0].history
        assert history is not None  # noqa: S101  as above
        count, reasons = (latest.shown.part(plane.download()[0]) for plane in (history.count, history.reasons))
        return count, reasons.astype(np.uint8)

    def download(self) -> dict[str, History]:
        """Return the history of each plane by its name: means, their moments, counts and reasons. Empty at first."""
        found = dict[str, History]()
        if self._latest is None:
            return found
        part = self._latest.shown.part
        for each in self._parts.values():
            if each.history is None:
                continue
            whole, first = each.history.download(), 0
            images = [part(np.atleast_3d(array)) for array in (whole.mean, whole.fast, whole.square)]
            for name, count in each.names:
                mean, fast, square = (a[..., first] if count == 1 else a[..., first : first + count] for a in images)
                found[name] = History(mean, fast, square, part(whole.count), part(whole.reasons))
                first += count
        return found


def _same_triangles(before: Scene, now: Scene) -> bool:
    """Return whether a scene has the triangles of the one before, wherever they are."""
    if before is now:
        return True
    same_vertices = before.positions.shape == now.positions.shape
    return same_vertices and (before.triangles is now.triangles or np.array_equal(before.triangles, now.triangles))


def _same_place(before: Camera, now: Camera) -> bool:
    """Return whether two cameras of images see the same picture: a crop moves the image plane's origin alone."""
    same_scale = all(before.projection[i, i] == now.projection[i, i] for i in (0, 1))
    return same_scale and before.size == now.size and np.array_equal(before.view, now.view)
