"""The rasteriser in OpenCL: triangles to a visibility buffer, and from there to a G-buffer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ssgi_cl.core.camera import LARGEST_SIZE, Camera
from ssgi_cl.core.motion import MOST_MOTION
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_bytes
from ssgi_cl.device.constants import RASTER_COUNTERS, RASTER_RECORD, RASTER_TILE, SSGI_GROUP
from ssgi_cl.device.gbuffer import DeviceGBuffer, WorldNormals
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, camera_values
from ssgi_cl.device.transient_chunks import ALIGNMENT
from ssgi_cl.rasterize.raster.device_scene import BOXED, DeviceScene
from ssgi_cl.rasterize.raster.raster_view import STRUCTS, VIEW, view_values
from ssgi_cl.rasterize.raster.tile_regions import busy_region, widened

TILE = RASTER_TILE
RECORD = RASTER_RECORD
LANES = 8
"""Of kernels that draw, at most."""
SUBPIXELS = 256
"""Steps of a pixel in which places within it are given, see kernels/raster/records.clh."""
LEAST_VERTICES = 1 << 20
"""Bytes that are reserved for the vertices of a scene, however few there are."""


@dataclass(frozen=True, eq=False)
class Visible:
    """The visibility buffer of an image.

    Attributes:
        triangles: the number of the triangle in each pixel, or -1; in tiles, see kernels/raster/records.clh.
        depths: the values that the depth test compares, 1 / depth or, orthographic, -depth, and -INFINITY where
            nothing is; None of an image that is shaded at once.
        camera, view: the structs that it was drawn with.
    """

    triangles: DeviceArray
    depths: DeviceArray | None
    camera: Any
    view: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Before:
    """What the previous image showed, for motion.

    Attributes:
        scene: the same triangles, which may have been elsewhere.
        camera: what saw them.
    """

    scene: DeviceScene
    camera: Camera


_Lists = dict[str, DeviceArray]
"""Memory of a frame until its pixels are drawn: "view" and "screen" of vertices; "records" and "places"
of the visible triangles, kernels/raster/records.clh; and the "list" of records that meet each tile."""


class Rasterizer:
    """Draws scenes at one size; see `render`.

    Args:
        runtime: the device.
        size: (rows, columns) of the camera's image.
        layers, margin, attributes: of the target, see `DeviceGBuffer`.
        shaded: whether the target gets what is seen; without, nothing does but what the `write_`
            methods write of the image drawn last.
        regions: whether it draws where anything may be seen alone, and tells the target.
        world: of the target.
        matt: whether albedo has the reflectance of lobes in it, for what draws no lobes.
        lobes: whether the target gets what its front layer mirrors.
        thickness: whether the target gets that of all layers, where they are of closed surfaces; a pass more draws
            the inner sides behind the last layer.
        places: (right, down) from the centre of a pixel in steps of 1/256, at most half a pixel, at which `sampled`
            draws; without, it may not be called.

    Attributes:
        target: the device G-buffer that it draws into.
        stride: number of places that `sampled` draws, a multiple of `LANES`.
        places: [2 stride] int32, their steps right of the centre, and those below it; None without any.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        *,
        layers: int = 1,
        margin: Size = (0, 0),
        shaded: bool = True,
        attributes: int = 1,
        regions: bool = False,
        world: WorldNormals = "kept",
        matt: bool = False,
        lobes: bool = False,
        thickness: bool = False,
        places: Sequence[tuple[int, int]] = (),
    ) -> None:
        self.runtime = runtime
        self.matt, self.lobes, self.shaded, self.regions, self.thickness = matt, lobes, shaded, regions, thickness
        self.stride = -(-len(places) // LANES) * LANES
        steps = [*places, *[places[0] for _ in range(self.stride - len(places))]]
        self.places = runtime.array(np.array(steps, np.int32).reshape(-1, 2).T.ravel()) if places else None
        self._spread = {"RASTER_SPREAD": int(np.abs(places).max(initial=0))}
        if max(size[0] + 2 * margin[0], size[1] + 2 * margin[1]) > LARGEST_SIZE:
            raise ValueError(
                f"size is {size} and margin {margin} (rows, columns): expected at most "
                f"{LARGEST_SIZE} px with the margin on both sides"
            )
        self.target = DeviceGBuffer(
            runtime, size, layers=layers, margin=margin, attributes=attributes if shaded else 0, world=world
        )
        rows, columns = self.target.whole
        self._tiles = (-(-rows // TILE), -(-columns // TILE))
        count = self._tiles[0] * self._tiles[1]
        self._counts = runtime.empty(2 * count, np.int32)
        self._starts = runtime.empty(count + 1, np.int32)
        self._cursors = runtime.empty(2 * count, np.int32)
        self._counters = runtime.array(np.zeros(RASTER_COUNTERS, np.int32))
        self._pixels = count * TILE * TILE
        self._visible: Visible | None = None
        self._capacity = 1 << 15
        self._pair_capacity = 1 << 16
        self._reserve(LEAST_VERTICES)
        parallel = runtime.info.kind == "gpu"
        # A CPU's work-item takes a whole tile, so that a triangle is set up once for it.
        self._rectangle = (1, min(runtime.variant.lanes, 8)) if parallel else (TILE, TILE)
        self._group = (8, 8) if parallel else (1, 1)
        # Likewise all triangles of a box, of which few are left to make records of.
        self._run = runtime.variant.lanes if parallel else BOXED
        kernel = runtime.kernel
        self._vertices = kernel("raster/raster_vertices.cl", structs=STRUCTS)
        self._setup = kernel(
            "raster/raster_setup.cl", {"RASTER_BOXED": BOXED, "RASTER_RUN": self._run, **self._spread}, STRUCTS
        )
        self._scan = kernel("raster/raster_scan.cl", structs=STRUCTS)
        self._fill = kernel("raster/raster_fill.cl", self._spread, STRUCTS)

    def render(
        self, scene: DeviceScene, camera: Camera, *, behind: DeviceArray | None = None, before: Before | None = None
    ) -> DeviceGBuffer:
        """Draw the scene as the camera sees it and return the target.

        `behind` has the `depths` of an image drawn before with the same camera: only what lies
        behind that is drawn. With `before` the target gets the motion of its front layer.

        Reads 8 bytes back before pixels are drawn, and with `regions` 4 for each tile: if lists
        were too small they grow, and it begins again. The size of the lists stays for the next
        frame, so a steady frame allocates nothing.
        """
        lists = self._sorted(scene, camera)
        self.target.has_facets = True
        self.target.emits = scene.emits and self.shaded
        self.target.mirrors = scene.glossy and self.lobes
        self.target.moves = 0
        self.target.thickness = None
        self._visible = self._draw(scene, camera, lists, behind, before)
        return self.target

    def sampled(self, scene: DeviceScene, camera: Camera) -> Visible:
        """Draw what is seen at the places of all pixels; nothing is shaded.

        Args:
            scene, camera: as of `render`; the image has no margin.

        Returns:
            Triangles and depths of each place of a pixel, one after the other; as many are there as a multiple of
            `LANES` has, of which those beyond the places are repetitions of the first.
        """
        lists = self._sorted(scene, camera)
        array, count = self.runtime.transient.array, self._pixels * self.stride
        depths, triangles = array(count, np.float32), array(count, np.int32)
        view, packed_camera = self._view_values(scene, camera), CAMERA.pack(camera_values(camera))
        visible = Visible(triangles, depths, packed_camera, view)
        macros = {"RASTER_STRIDE": self.stride, **self._spread}
        self._run_tiles("raster/raster_places.cl", macros, scene, lists, visible, depths, places=self.places)
        return visible

    def _sorted(self, scene: DeviceScene, camera: Camera) -> _Lists:
        """Return the lists of a scene, as the camera sees it, for all tiles."""
        if camera.size != self.target.size:
            raise ValueError(f"camera has size {camera.size} (rows, columns): expected {self.target.size}")
        self.target.set_camera(camera)
        self.release()
        while True:
            lists = self._lists(scene)
            self._sort(scene, camera, lists)
            records, pairs = self._counters.download().tolist()
            if records <= self._capacity and pairs <= self._pair_capacity:
                return lists
            # The pairs of records that found no room were not counted: leave room for theirs.
            share = max(1.0, records / self._capacity)
            self._capacity = max(self._capacity, records + records // 4)
            self._pair_capacity = max(self._pair_capacity, int(pairs * share) + pairs // 4)
            del lists

    def release(self) -> None:
        """Give the memory of what the `write_` methods read to others."""
        self._visible = None

    def write_depth(self, depth: Plane, image: int = 0) -> None:
        """Queue the pass that writes the depth of the image drawn last, a few roundings off.

        Args:
            depth: images of its size, scene units; INFINITY where nothing is.
            image: number of the one to write.
        """
        depths = self._last_visible.depths
        self._queue("raster/raster_depth.cl", self.target.whole, layer=image, depths=depths, depth=depth)

    def hide_behind(self, front: DeviceGBuffer, found: DeviceArray) -> None:
        """Queue the pass that takes what lies behind others out of the image drawn last.

        Args:
            front: of the same camera; with its margin, which the image need not have.
            found: [1] int32, 0; becomes 1 if anything is left.
        """
        visible = self._last_visible
        self._queue(
            "raster/raster_hidden.cl",
            self.target.size,
            depths=visible.depths,
            front=front.depth,
            triangles=visible.triangles,
            found=found,
            whole=front.whole,
        )

    def write_opacity(self, scene: DeviceScene, target: DeviceGBuffer) -> None:
        """Queue the pass that fills `opacity` and `transmitted` of `target`, which has no margin,
        from the image drawn last."""
        self._queue(
            "raster/raster_opacity.cl",
            target.size,
            **_surface(scene, self._last_visible.triangles),
            through=scene.through,
            opacity=target.opacity,
            transmitted=target.transmitted,
        )

    def _queue(self, path: str, size: Size, *, layer: int = 0, **arguments: Any) -> None:
        """Queue a kernel that reads the image drawn last."""
        visible = self._last_visible
        view = VIEW.pack({**visible.view, "layer": layer})
        self.runtime.kernel(path, structs=STRUCTS).run(size, camera=visible.camera, view=view, **arguments)

    @property
    def depths(self) -> DeviceArray | None:
        """The values that the depth test compared in the image drawn last, which is not shaded."""
        return self._last_visible.depths

    def write_every(self, step: int, scene: DeviceScene, target: DeviceGBuffer) -> None:
        """Queue the pass that fills `target` from the last layer of the image drawn last.

        Args:
            step: pixels of the image from one of the target to the next, along rows and columns:
                of each square of them the one in its middle, or below and to the right of that.
            scene: the one that was drawn.
            target: has no margin. The image's last rows and columns may lack a middle; there
                nothing is seen.
        """
        self._write_attributes(step, scene, target, self._last_visible, emission=target.emits)

    def write_gloss(
        self,
        step: int,
        scene: DeviceScene,
        specular: Plane,
        gloss: Plane,
        *,
        visible: Visible | None = None,
        region: Region | None = None,
    ) -> None:
        """Queue the pass that writes the Phong lobes of the last layer of the image drawn last.

        Args:
            step, scene: as of `write_every`.
            specular: 3 images, reflectance of the lobe.
            gloss: 1 image, its exponent.
            visible: the image; by default the one drawn last.
            region: pixels to write; by default all.
        """
        self.runtime.kernel("raster/raster_gloss.cl", {"RASTER_STEP": step}).run(
            gloss.size,
            region=region,
            triangles=(visible or self._last_visible).triangles,
            faces=scene.faces,
            lobes=scene.lobes,
            specular=specular,
            gloss=gloss,
            tiles=self._tiles,
        )

    def _write_motion(self, scene: DeviceScene, visible: Visible, before: Before) -> None:
        """Queue the pass that writes the motion of what an image shows."""
        if (before.scene.vertices, before.scene.triangles) != (scene.vertices, scene.triangles):
            raise ValueError(
                f"the previous scene has {before.scene.vertices} vertices and {before.scene.triangles} triangles: "
                f"expected {scene.vertices} and {scene.triangles}, the same as the scene"
            )
        target = self.target
        self.runtime.kernel(
            "raster/raster_motion.cl", {"RASTER_STEP": 1, "RASTER_LONGEST": int(MOST_MOTION)}, STRUCTS
        ).run(
            target.whole,
            triangles=visible.triangles,
            faces=scene.faces,
            vertices=scene.shading,
            vertices_before=before.scene.shading,
            motion=target.motion,
            camera=visible.camera,
            view=VIEW.pack(visible.view),
            camera_before=CAMERA.pack(camera_values(before.camera)),
            view_before=VIEW.pack(self._view_values(before.scene, before.camera)),
            scale_x=np.float32(target.size[1] / before.camera.width),
            scale_y=np.float32(target.size[0] / before.camera.height),
        )
        target.moves = 3

    def _reserve(self, vertices: int) -> None:
        """Reserve what a frame needs until its pixels are drawn, for so many bytes of vertices."""
        target = self.target
        passing = self.shaded and target.world == "until released"
        images = 2 * self.stride if self.stride else 1 + min(target.layers + self.thickness, 2)
        self.runtime.transient.reserve(
            4 * self._pixels * images
            + vertices
            + 4 * (self._capacity * (RECORD + 2) + self._pair_capacity)
            + (plane_bytes(3 * target.attributes, target.whole) if passing else 0)
            + 7 * ALIGNMENT  # each of up to seven pieces begins at a multiple
        )

    def _lists(self, scene: DeviceScene) -> _Lists:
        """Return the memory that a frame needs until its pixels are drawn."""
        # In one piece with the rest, of which parts are of use to others afterwards.
        self._reserve(4 * (3 + 4) * scene.vertex_stride)
        array = self.runtime.transient.array
        ints = {"records": self._capacity * RECORD, "places": self._capacity * 2, "list": self._pair_capacity}
        view, screen = array(3 * scene.vertex_stride, np.float32), array(4 * scene.vertex_stride, np.int32)
        return {"view": view, "screen": screen, **{name: array(count, np.int32) for name, count in ints.items()}}

    def _sort(self, scene: DeviceScene, camera: Camera, lists: _Lists) -> None:
        """Queue the passes that list the triangles of each tile."""
        # Without the margin, which kernels add in whole pixels: it must not change a bit.
        packed_camera, view = CAMERA.pack(camera_values(camera)), VIEW.pack(self._view_values(scene, camera))
        tile_count = self._tiles[0] * self._tiles[1]
        self._vertices.run(
            (1, scene.vertices),
            positions=scene.positions,
            view=lists["view"],
            screen=lists["screen"],
            counters=self._counters,
            tiles=self._counts,
            camera=packed_camera,
            to_view=view,
        )
        self._setup.run(
            (1, scene.triangles),
            grid=(1, -(-scene.triangles // self._run)),
            local=(1, SSGI_GROUP) if self._run == 1 else None if self._run < BOXED else (1, 1),
            boxes=scene.boxes,
            corners=scene.corners,
            vertices=scene.shading,
            view=lists["view"],
            screen=lists["screen"],
            records=lists["records"],
            places=lists["places"],
            tiles=self._counts,
            counters=self._counters,
            camera=packed_camera,
            params=view,
        )
        self._scan.run(
            (1, tile_count),
            grid=(1, SSGI_GROUP),
            local=(1, SSGI_GROUP),
            tiles=self._counts,
            starts=self._starts,
            cursors=self._cursors,
            counters=self._counters,
        )
        workers = 256 if self.runtime.info.kind == "cpu" else 16384
        self._fill.run(
            (1, workers),
            grid=(1, workers),
            records=lists["records"],
            places=lists["places"],
            cursors=self._cursors,
            list=lists["list"],
            counters=self._counters,
            view=view,
        )

    def _regions(self) -> list[Region | None]:
        """Return where each layer may have pixels: in tiles with more triangles than its number."""
        layers = range(self.target.layers)
        if not self.regions:
            return [None for _ in layers]
        counts = np.diff(self._starts.download()).reshape(self._tiles)
        return [busy_region(counts > layer, self.target.whole, self.runtime.variant.lanes) for layer in layers]

    def _draw(
        self, scene: DeviceScene, camera: Camera, lists: _Lists, behind: DeviceArray | None, before: Before | None
    ) -> Visible | None:
        """Queue the passes that draw pixels; return what they show unless they are shaded."""
        target, whole = self.target, self.target.whole
        values = self._view_values(scene, camera)
        packed_camera = CAMERA.pack(camera_values(camera))
        regions = self._regions()
        target.region = regions[0]
        late = target.layers == 1 and target.world != "kept" and not self.thickness
        if self.shaded and not late:
            target.take_world()
        array = self.runtime.transient.array
        # A deeper layer begins behind the one before.
        depths = [array(self._pixels, np.float32) for _ in range(min(target.layers + self.thickness, 2))]
        seen = array(self._pixels, np.int32)
        # Its thickness takes the place of the side that a layer shows.
        sides = target.take_thickness(target.layers) if self.thickness else None
        drawn: Region | None = None
        for layer, region in enumerate(regions):
            shaded = layer < target.attributes
            view = {**values, "layer": layer}
            now, nearer = depths[layer % 2], depths[layer % 2 - 1]
            nearer = behind if layer == 0 and behind is not None else nearer
            visible = Visible(seen, None if self.shaded else now, packed_camera, view)
            # What was seen there before is to be cleared.
            with target.previous_regions[layer].over(region, scene.emits) as over:
                over = None if over is None else widened(over, whole, self.runtime.variant.lanes)
                drawn = over if layer == 0 else drawn
                peel = {"RASTER_PEEL": int(layer > 0 or behind is not None), "RASTER_BACKS": 0, "RASTER_SPREAD": 0}
                self._run_tiles("raster/raster_tiles.cl", peel, scene, lists, visible, now, over, previous=nearer)
                if late:
                    lists.clear()
                    if self.shaded:
                        del now, nearer, depths
                        target.take_world()
                if not self.shaded:
                    return visible
                self._write_attributes(
                    1, scene, target, visible, shaded=shaded, emission=scene.emits, region=over, sides=sides
                )
                if target.mirrors and layer == 0:
                    self.write_gloss(1, scene, target.specular, target.gloss, visible=visible, region=over)
                if before is not None and layer == 0:
                    self._write_motion(scene, visible, before)
        if sides is not None:
            self._write_thickness(scene, lists, visible, depths[target.layers % 2], now, sides, drawn)
        return None

    def _write_thickness(
        self,
        scene: DeviceScene,
        lists: _Lists,
        visible: Visible,
        depths: DeviceArray,
        last: DeviceArray,
        thickness: Plane,
        region: Region | None,
    ) -> None:
        """Queue the passes that draw the inner sides behind the last layer, and write the thickness of all.

        Args:
            scene, visible: of the last layer, whose triangles are overwritten.
            lists: of the scene; their memory is free afterwards.
            depths: memory for D of the inner sides.
            last: D of the last layer.
            thickness: sides of all layers, as `_write_attributes` wrote them; becomes the thickness.
            region: where the front layer was drawn.
        """
        target = self.target
        behind = Visible(visible.triangles, depths, visible.camera, {**visible.view, "layer": 0})
        peel = {"RASTER_PEEL": 1, "RASTER_BACKS": 1, "RASTER_SPREAD": 0}
        self._run_tiles(
            "raster/raster_tiles.cl", peel, scene, lists, behind, depths, region, previous=last, closed=scene.closed
        )
        lists.clear()
        backs = self.runtime.transient.plane(1, target.whole, math.inf)
        self.runtime.kernel("raster/raster_depth.cl", structs=STRUCTS).run(
            target.whole, region=region, depths=depths, depth=backs, camera=behind.camera, view=VIEW.pack(behind.view)
        )
        self.runtime.kernel("raster/raster_thickness.cl", {"THICKNESS_LAYERS": target.layers}).run(
            target.whole, region=region, depth=target.depth, backs=backs, thickness=thickness
        )

    def _run_tiles(
        self,
        path: str,
        macros: dict[str, int],
        scene: DeviceScene,
        lists: _Lists,
        visible: Visible,
        depths: DeviceArray,
        region: Region | None = None,
        **more: DeviceArray | None,
    ) -> None:
        """Queue the pass that fills the triangles of a visibility buffer, and `depths`."""
        high, wide = self._rectangle
        extent = {"RASTER_WIDE": wide, "RASTER_HIGH": high, "RASTER_CUTOUT": int(scene.has_cutouts)}
        # Few triangles are wider than 8 lanes: 1.5 to 2 times faster than 16 on a CPU.
        self.runtime.kernel(path, {**macros, **extent}, STRUCTS, most_lanes=LANES).run(
            self.target.whole,
            grid=(self._tiles[0] * TILE // high, self._tiles[1] * TILE // wide),
            local=self._group,
            region=region,
            cell=self._rectangle,
            records=lists["records"],
            starts=self._starts,
            list=lists["list"],
            corners=scene.corners,
            positions_view=lists["view"],
            uvs=scene.uvs,
            cutouts=scene.cutouts,
            depths=depths,
            triangles=visible.triangles,
            camera=visible.camera,
            view=VIEW.pack(visible.view),
            **more,
            **_materials(scene),
        )

    def _write_attributes(
        self,
        step: int,
        scene: DeviceScene,
        target: DeviceGBuffer,
        visible: Visible,
        *,
        emission: bool,
        shaded: bool = True,
        region: Region | None = None,
        sides: Plane | None = None,
    ) -> None:
        macros = {
            "RASTER_SIDES": int(sides is not None),
            "RASTER_STEP": step,
            "RASTER_SHADED": int(shaded),
            "RASTER_TEXTURED": int(shaded and scene.textured),
            "RASTER_COLORED": int(shaded and scene.colored),
            "RASTER_EMISSION": int(shaded and emission) * (1 + scene.emits_textures),
        }
        of_sides: dict[str, Any] = {} if sides is None else {"closed": scene.closed, "sides": sides}
        self.runtime.kernel("raster/raster_attributes.cl", macros, STRUCTS).run(
            target.whole,
            region=region,
            **_surface(scene, visible.triangles),
            depth=target.depth,
            normal=target.normal_world,
            albedo=target.albedo,
            emission=target.emission,
            camera=visible.camera,
            view=VIEW.pack(visible.view),
            **of_sides,
        )

    @property
    def _last_visible(self) -> Visible:
        assert self._visible is not None  # noqa: S101  an image was drawn that is not shaded
        return self._visible

    def _view_values(self, scene: DeviceScene, camera: Camera) -> dict[str, Any]:
        return view_values(
            scene,
            camera,
            self.target,
            tiles_x=self._tiles[1],
            tiles_y=self._tiles[0],
            capacity=self._capacity,
            pair_capacity=self._pair_capacity,
            matt=float(self.matt),
        )


def _materials(scene: DeviceScene) -> dict[str, Any]:
    """Return the arguments of kernels that hold materials and textures."""
    return {"materials": scene.materials, "textures": scene.textures, "texels": scene.texels, "decode": scene.decode}


def _surface(scene: DeviceScene, seen: DeviceArray) -> dict[str, Any]:
    """Return the arguments of kernels that look up the triangle in each pixel."""
    return {"triangles": seen, "faces": scene.faces, "vertices": scene.shading, **_materials(scene)}
