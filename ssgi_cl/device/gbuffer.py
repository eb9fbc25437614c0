"""A G-buffer in device memory, as kernels read it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import Floats, GBuffer
from ssgi_cl.core.gbuffer_band import Band
from ssgi_cl.device.active_region import PreviousRegion, Region
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.shared import Strided, channels_first, pack, strided
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, camera_values, floats, rotation_values

WorldNormals = Literal["kept", "until released", "until derived"]

NORMAL_ROWS = 2
"""Rows on either side of a pixel that its normal is reconstructed from."""
PLAIN_ALBEDO = 0.8
"""Where a G-buffer has none."""

VIEW_ROTATION = Struct("GbufferRotation", floats(*ROTATION))


class DeviceGBuffer:
    """A G-buffer that stays on the device from frame to frame.

    Attributes:
        runtime: the device.
        size: (rows, columns) of the camera's image and of every result.
        margin: (rows, columns) by which the planes exceed it on every side.
        layers: of depth.
        attributes: layers, from the front, that have normal, albedo and emission: 1 or all, or 0
            where there is no image at all.
        front: the layer that shading works on, see `layer`.
        facing: 1, or -1 to shade the sides that turn away from the viewer.
        depth: `layers` images, scene units; INFINITY where nothing is.
        linear: 1 / depth (orthographic: depth) of layer 0; INFINITY where nothing is.
        normal: 3 images a layer (number 3 layer + channel), view space, facing the viewer; 0 where
            nothing is.
        normal_world: likewise, as given.
        albedo: likewise; with `deferred` from when it is first asked for on.
        emission: likewise; one pixel before the first contents that emit.
        mirrors: whether there are `specular`, 3 images, and `gloss`, 1 image: reflectance and
            exponent of the Phong lobe of layer 0.
        opacity, transmitted: 1 image, share of the surface of layer 0 that is there, and 3 images,
            share of the light from behind that passes it; of surfaces that are seen through.
        world: how long `normal_world` stays: "kept"; "until released" by `release_world`; or
            "until derived", when `normal` takes its memory over. With `deferred` it is there if it was given.
        sides: what `ssdo_bitmask.paired_layers` found in the current contents, None if it did not look.
        thickness: 1 image or one for each layer, scene units, -1 where it is not known; or None if the contents have
            none.
        motion: 3 images, columns and rows to the previous image in pixels, and the change of depth; asked for, it is
            there.
        moves: how many of these the contents have: 0, 2 or 3.
        has_facets: whether depths are exact enough to tell a triangle's plane from neighbours':
            those of the rasteriser are.
        is_exact: likewise, also of what was drawn elsewhere and uploaded, see `GBuffer.exact`.
        region: pixels of the planes, margin and all, outside which nothing is; None if that is not
            known.
        traces: of what was drawn into each layer.
        camera: the camera of the current contents; `camera_struct` is what kernels get.
        band: where these rows lie in a larger image, if they do.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        *,
        layers: int = 1,
        margin: Size = (0, 0),
        attributes: int = 1,
        world: WorldNormals = "kept",
        deferred: bool = False,
    ) -> None:
        if attributes not in (0, 1, layers):
            raise ValueError(f"attributes is {attributes}: expected 0, 1 or {layers}, all layers")
        self.runtime, self.size, self.margin = runtime, size, margin
        self.layers, self.attributes = layers, attributes
        self.front, self.facing = 0, 1.0
        self.whole = (size[0] + 2 * margin[0], size[1] + 2 * margin[1])
        shown = self.whole if attributes else (1, 1)
        self.depth = runtime.plane(layers, shown, math.inf)
        self._images = max(3 * attributes, 1)
        self.linear = runtime.plane(1, shown, math.inf)
        self._plain_albedo = False  # whether the last upload had none, and nothing was drawn since
        self.normal = runtime.plane(self._images, shown)
        self._albedo = None if deferred else runtime.plane(self._images, shown)
        self.world: WorldNormals = world
        self.sides: Plane | None = None
        self._normal_world: Plane | None = None
        own = world == "kept" and attributes > 0 and not deferred
        self._own_world = runtime.plane(self._images, self.whole) if own else None
        self._emission: Plane | None = None
        self._no_emission = runtime.plane(1, (1, 1))
        self.emits = self.mirrors = False
        self.moves = 0
        self.has_facets = False
        self._exact_upload = False
        self.region: Region | None = None
        self.previous_regions = [PreviousRegion() for _ in range(layers)]
        self._derived = PreviousRegion()
        self.thickness: Plane | None = None
        self._thickness: Plane | None = None
        self.camera: Camera | None = None
        self.band: Band | None = None
        self.camera_struct: Any = None

    @property
    def albedo(self) -> Plane:
        """Albedo of each layer."""
        if self._albedo is None:
            self._albedo = self.runtime.plane(self._images, self.whole if self.attributes else (1, 1))
            if self._plain_albedo:
                self._albedo.upload(self._layered(None, PLAIN_ALBEDO))
        return self._albedo

    @property
    def emission(self) -> Plane:
        """Emission of each layer."""
        if self.emits and self._emission is None:
            self._emission = self.runtime.plane(self._images, self.whole)
        return self._no_emission if self._emission is None else self._emission

    @cached_property
    def specular(self) -> Plane:
        """Reflectance of the lobe of layer 0."""
        return self.runtime.plane(3, self.whole)

    @cached_property
    def gloss(self) -> Plane:
        """Exponent of that lobe."""
        return self.runtime.plane(1, self.whole)

    @cached_property
    def motion(self) -> Plane:
        """Motion of layer 0 to the previous image."""
        return self.runtime.plane(3, self.whole)

    @cached_property
    def opacity(self) -> Plane:
        """Share of the surface of layer 0 that is there."""
        return self.runtime.plane(1, self.whole)

    @cached_property
    def transmitted(self) -> Plane:
        """Share of the light from behind that passes it."""
        return self.runtime.plane(3, self.whole)

    @property
    def normal_world(self) -> Plane:
        """Normals as given, world space.

        Raises:
            ValueError: they were not kept.
        """
        if self._normal_world is None:
            raise ValueError("the device G-buffer does not keep its normals in world space")
        return self._normal_world

    @property
    def is_exact(self) -> bool:
        """Whether depths are not rounded beyond float32."""
        return self.has_facets or self._exact_upload

    @property
    def has_world(self) -> bool:
        """Whether `normal_world` is there."""
        return self._normal_world is not None

    def take_world(self) -> None:
        """Make room for `normal_world`, which is about to be written.

        What is kept is 0 outside of what `previous_regions` say; other memory has anything there.
        """
        self.sides = None
        kept = self.world == "kept"
        if kept and self._own_world is None:
            self._own_world = self.runtime.plane(self._images, self.whole)
            self.previous_regions = [PreviousRegion() for _ in range(self.layers)]
        if kept:
            self._normal_world = self._own_world
        elif self.world == "until derived":
            self._normal_world = self.normal
        else:
            self._normal_world = self.runtime.transient.plane(self._images, self.whole)

    def take_thickness(self, layers: int) -> Plane:
        """Return memory for `thickness` of so many layers, which is about to be written."""
        if self._thickness is None or self._thickness.count != layers:
            self._thickness = self.runtime.plane(layers, self.whole)
        self.thickness = self._thickness
        return self._thickness

    def upload(self, gbuffer: GBuffer) -> None:
        """Replace the contents by a G-buffer of the same size, margin and number of layers.

        A deeper layer has what the G-buffer's array has for it; else it is taken as one where the
        array is None.
        """
        shape = (gbuffer.size, gbuffer.margin, gbuffer.layers)
        if shape != (self.size, self.margin, self.layers):
            raise ValueError(
                f"the G-buffer has size, margin and layers {shape}: expected {(self.size, self.margin, self.layers)}"
            )
        self.region = None
        self.has_facets = False
        self._exact_upload = gbuffer.exact
        self.previous_regions = [PreviousRegion() for _ in range(self.layers)]
        plain = self._plain_albedo
        depth = np.asarray(gbuffer.depth)
        self.depth.upload(depth.reshape(self.layers, *self.whole))
        self.sides = None
        self._normal_world = None
        if gbuffer.normal is not None or self.attributes > 1:
            self.take_world()
            self.normal_world.upload(self._layered(gbuffer.normal, 0.0))
        if gbuffer.albedo is not None or (self._albedo is not None and not plain):
            self.albedo.upload(self._layered(gbuffer.albedo, PLAIN_ALBEDO))
        self.emits = gbuffer.emission is not None
        if self.emits:
            self.emission.upload(self._layered(gbuffer.emission, 0.0))
        specular, gloss = gbuffer.first("specular"), gbuffer.first("gloss")
        self.mirrors = specular is not None and gloss is not None
        if specular is not None and gloss is not None:
            self.specular.upload(np.moveaxis(specular, -1, 0))
            self.gloss.upload(gloss[None])
        motion = gbuffer.first("motion")
        self.moves = 0 if motion is None else motion.shape[2]
        if motion is not None:
            padded = motion if self.moves == 3 else np.pad(motion, ((0, 0), (0, 0), (0, 1)))
            self.motion.upload(np.moveaxis(padded, -1, 0))
        self.thickness = None
        if gbuffer.thickness is not None:
            thickness = np.asarray(gbuffer.thickness).reshape(-1, *self.whole)
            self.take_thickness(len(thickness)).upload(thickness)
        self.set_camera(gbuffer.camera, gbuffer.band)
        self._plain_albedo = gbuffer.albedo is None
        with self.runtime.frame():
            self.derive(given=gbuffer.normal is not None)

    def take(
        self,
        camera: Camera,
        depth: Any,
        *,
        normal: Any = None,
        albedo: Any = None,
        emission: Any = None,
        wait_for: Sequence[Any] | None = None,
    ) -> Any:
        """Replace the contents by arrays in device memory, which never go to the host.

        Values are not checked: depths that are not above 0 and NaN count as nothing, NaN elsewhere as 0.

        Args:
            camera: of `size`.
            depth: [rows, columns] with the margin, with more than one layer [layers, rows, columns], float32, scene
                units; INFINITY where nothing is. Any kind of array that `ssgi_cl.device.shared` has.
            normal: [rows, columns, 3], or of a G-buffer with attributes of all layers [layers, rows, columns, 3];
                world space, unit length; None to take them from the depth.
            albedo: likewise, 0 to 1; None for .8.
            emission: likewise, radiance; None for none.
            wait_for: events of other queues that the arrays are complete after.

        Returns:
            The event after which the arrays may be written again.

        Raises:
            TypeError, ValueError: an array is no device memory of OpenCL, or of another type or shape.
            DeviceError: an array is of another context.
        """
        runtime, layers = self.runtime, self.layers
        if (camera.height, camera.width) != self.size:
            raise ValueError(f"camera has size {(camera.height, camera.width)}: expected {self.size}")
        if not self.attributes:
            raise ValueError("the device G-buffer has no image: expected attributes of 1 or all layers")
        plain = self.whole if layers == 1 else (layers, *self.whole)
        vectors = (*self.whole, 3) if self.attributes == 1 else (self.attributes, *self.whole, 3)
        given = {"normal": normal, "albedo": albedo, "emission": emission}
        arrays = {name: strided(runtime, name, value, vectors) for name, value in given.items() if value is not None}
        source = strided(runtime, "depth", depth, plain)
        if layers == 1:
            source = source.stacked()
        if wait_for:
            opencl().enqueue_barrier(runtime.queue, wait_for=list(wait_for))
        self.region = None
        self.has_facets = self._exact_upload = self.mirrors = False
        self.moves = 0
        self.thickness = self.sides = None
        self.previous_regions = [PreviousRegion() for _ in range(layers)]
        pack(self.depth, source, positive=True)
        self._normal_world = None
        if normal is not None:
            self.take_world()
            self._pack_vectors(self.normal_world, arrays["normal"])
        if albedo is not None:
            self._pack_vectors(self.albedo, arrays["albedo"])
        elif self._albedo is not None and not self._plain_albedo:
            self._albedo.upload(self._layered(None, PLAIN_ALBEDO))  # once, after albedo that was given
        self._plain_albedo = albedo is None
        self.emits = emission is not None
        if self.emits:
            self._pack_vectors(self.emission, arrays["emission"])
        done = opencl().enqueue_marker(runtime.queue)
        self.set_camera(camera)
        with runtime.frame():
            self.derive(given=normal is not None)
        return done

    def _pack_vectors(self, plane: Plane, array: Strided) -> None:
        """Queue a copy of [rows, columns, 3] or [layers, rows, columns, 3] to the images of a plane."""
        planar = channels_first(array)
        if len(planar.shape) == 3:
            planar = planar.stacked()
        for layer in range(planar.shape[0]):
            first = planar.first + layer * planar.steps[0]
            pack(plane, Strided(planar.memory, first, planar.shape[1:], planar.steps[1:]), to=3 * layer)

    def _layered(self, array: ArrayLike | None, instead: float) -> Floats:
        """Return [3 attributes, rows, columns] of an array with or without layers."""
        if array is None:
            return np.broadcast_to(np.float32(instead), (3 * self.attributes, *self.whole))
        given = np.asarray(array).reshape(-1, *self.whole, 3)[: self.attributes]
        if self.attributes == 1:
            return np.moveaxis(given[0], -1, 0)  # without a copy
        planar = np.moveaxis(given, -1, 1).reshape(-1, *self.whole)
        missing = 3 * self.attributes - len(planar)
        if missing:
            rest = np.full((missing, *self.whole), instead, np.float32)
            planar = np.concatenate([planar, rest])
        return planar

    def layer(self, number: int, *, back: bool = False) -> DeviceGBuffer:
        """Return a layer of the current contents as an image of its own that has no margin.

        It shares all memory: planes still hold every layer, `front` says which is meant, and
        `facing` whether its sides towards the viewer are or, with `back`, those away from it.
        Shading (`Shade`, `LitLayers`) looks at that layer; other techniques read layer 0.

        Raises:
            ValueError: the layer has no normals, albedo and emission.
        """
        if not 0 <= number < self.attributes:
            raise ValueError(
                f"number is {number}: expected 0 to {self.attributes - 1}, the layers that have "
                "normals, albedo and emission"
            )
        view = copy(self)
        view._albedo = self.albedo  # one for both, made now if it was not asked for before
        view.size, view.margin, view.front = self.whole, (0, 0), number
        view.facing = -1.0 if back else 1.0
        return view

    def set_camera(self, camera: Camera, band: Band | None = None) -> None:
        """Note the camera that saw the contents, and where they lie in a larger image."""
        self._plain_albedo = False  # it is about to be drawn
        self.camera = camera
        self.band = band
        if band is None:
            values = camera_values(camera, self.margin)
        else:
            below = band.rows - band.first - self.whole[0]
            values = camera_values(band.camera, band.margin, band.first, below)
        self.camera_struct = CAMERA.pack(values)

    def derive(self, *, given: bool = True) -> None:
        """Queue the pass that makes `linear` and `normal` from `depth` and `normal_world`."""
        camera = self.camera
        if camera is None:
            raise ValueError("the device G-buffer has no camera: call set_camera or upload first")
        rotation = VIEW_ROTATION.pack(rotation_values(camera.view[:3, :3]))
        world = self.normal_world if given else None
        in_place = world is self.normal
        if in_place:
            self._normal_world = None  # whatever becomes of the pass
        source = 0 if not given else 2 if in_place else 1
        kernel = self.runtime.kernel("gbuffer/gbuffer_normals.cl", {"GBUFFER_GIVEN": source}, (CAMERA, VIEW_ROTATION))
        with self._derived.over(self.region) as region:
            region = region if self.band is None else self._looked_at(self.band)
            for layer in range(self.attributes):
                kernel.run(
                    self.whole,
                    region=region,
                    depth=self.depth,
                    normal=world if given and not in_place else None,
                    linear=self.linear,
                    normal_view=self.normal,
                    camera=self.camera_struct,
                    rotation=rotation,
                    layer=layer,
                )

    def _looked_at(self, band: Band) -> Region:
        """Return the rows whose normals count: those beyond are for their depths alone."""
        beyond = max(self.margin[0] - band.margin[0] - NORMAL_ROWS, 0)
        return Region(beyond, 0, self.whole[0] - 2 * beyond, self.whole[1])

    def release_world(self) -> None:
        """Give the memory of `normal_world` to others, unless it is kept."""
        if self.world != "kept":
            self._normal_world = None

    @property
    def seen(self) -> Region | None:
        """`region` in pixels of the camera's image."""
        return None if self.region is None else self.region.inside(self.size, self.margin)

    def seen_every(self, step: int) -> Region | None:
        """Return `seen` in a result that has every step-th pixel of the camera's image."""
        seen = self.seen
        return None if seen is None else seen.reduced(step)


def on_device(gbuffer: GBuffer | DeviceGBuffer, runtime: Runtime | None, *, place: int = 0) -> DeviceGBuffer:
    """Return the G-buffer in device memory, uploaded unless it is there already.

    Memory for uploads is kept by the runtime and used again for G-buffers of the same size;
    several that are needed at a time have a `place` each.
    """
    if isinstance(gbuffer, DeviceGBuffer):
        return gbuffer
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected GBuffer or DeviceGBuffer")
    runtime = runtime or Runtime.open()
    shapes = [np.shape(a) for a in (gbuffer.normal, gbuffer.albedo, gbuffer.emission) if a is not None]
    attributes = gbuffer.layers if any(len(shape) == 4 for shape in shapes) else 1
    key = (DeviceGBuffer, gbuffer.size, gbuffer.margin, gbuffer.layers, attributes, place)
    device: DeviceGBuffer = runtime.prepared(
        key,
        lambda: DeviceGBuffer(
            runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin, attributes=attributes, deferred=True
        ),
    )
    device.upload(gbuffer)
    return device
