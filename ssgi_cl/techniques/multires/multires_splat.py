"""Multiresolution splatting: one-bounce indirect light, computed where it is not smooth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, ClassVar, Unpack, get_args

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import MultiresMethod
from ssgi_cl.core.params import Prepared, param, with_fields_described
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene, box_corners
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.methods import Method, chosen_params
from ssgi_cl.techniques.multires.final_gather import FinalGather
from ssgi_cl.techniques.multires.multires_grid import MultiresGrid, MultiresGridParams
from ssgi_cl.techniques.multires.multires_published import MultiresPublished, MultiresPublishedParams
from ssgi_cl.techniques.occupancy.occupancy_grid import Occupancy, OccupancyGrid, check_grid, grid_param
from ssgi_cl.techniques.occupancy.scene_rays import SceneRays
from ssgi_cl.techniques.radiosity.even_light import EvenLight
from ssgi_cl.techniques.technique import Bench, Technique
from ssgi_cl.techniques.vpl.kept_order import KeptOrder
from ssgi_cl.techniques.vpl.packed_vpls import DeviceVpls, VplChooser, power_of_two
from ssgi_cl.techniques.vpl.tile_boxes import BOX, bound_tiles, tiles_of
from ssgi_cl.techniques.vpl.view_importance import ViewImportance
from ssgi_cl.techniques.vpl.vpl_light import (
    NEARS,
    NoLight,
    VplKeywords,
    VplParams,
    camera_of,
    cutoff_param,
    importance_param,
    lights_plan,
    lit_by_maps,
    refine_param,
)
from ssgi_cl.techniques.vpl.vpl_tree import SHARES, VplTree
from ssgi_cl.techniques.vpl.world_vpls import WorldVpls


@dataclass(frozen=True, kw_only=True)
class MultiresSplatParams(MultiresGridParams, VplParams):
    """Parameters of multiresolution splatting, method "adaptive", besides the grid's.

    At 800 x 600 with 1024 lights the defaults compute 3 % of the pixels of the Cornell box and
    24 % of the hall's; against all lights at all pixels the error (RMSE) is .52 and .77 % of the
    mean irradiance.
    """

    interpolation_error: float = param(
        0.01,
        "of interpolation, as estimated; 1e6: geometry alone decides",
        unit="of the mean irradiance",
        low=0.0,
        high=1e6,
    )
    light_error: float = param(
        0.007,
        "up to which few lights stand for many, as estimated for each few; 0: never",
        unit="of the mean irradiance",
        low=0.0,
        high=1e6,
    )
    cutoff: float = cutoff_param(0.0)
    refine: float = refine_param()
    visibility: bool = param(
        False,
        "surfaces block light on its way from light to pixel: all triangles where `scene` "
        "is given, else what the camera and the lights see; an "
        "`interpolation_error` of 0.05 is then enough, since the occupancy grid is no more exact",
    )
    grid: int = grid_param()
    share: int = param(
        16,
        "lights that share a shadow ray: 4, 16 or 64, neighbours on a reflective shadow map; "
        "fewer cost more and err less where few of many lights reach what is seen",
        low=4,
        high=64,
    )

    importance: bool = importance_param()

    def __post_init__(self) -> None:
        MultiresGridParams.__post_init__(self)
        check_grid(self.grid)
        if self.share not in SHARES:
            raise ValueError(f"share is {self.share}: expected one of {SHARES} (lights)")


class MultiresSplatKeywords(VplKeywords, total=False):
    """The other parameters of `multires_splat`, of either method."""

    cutoff: float
    coarsest: int
    plane_tolerance: float
    normal_tolerance: float
    light_error: float
    levels: int
    depth_threshold: float
    normal_threshold: float


@dataclass(frozen=True, eq=False)
class Gathered:
    """Result of `MultiresSplat.gather`.

    Attributes:
        irradiance: 3 images, W/m^2, in memory that the next run writes to.
        occupancy: what blocked light; None without `visibility`, where triangles did, and where nothing shone.
    """

    irradiance: Plane
    occupancy: Occupancy | None


class MultiresSplat(Prepared[MultiresSplatParams]):
    """Multiresolution splatting, prepared for images of one size.

    After Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination". Departs:
    see `multires_splat`; `MultiresPublished` is the method as published.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `MultiresSplatParams`.
        surfels: how many lights in world space `run` takes at most, besides those from maps.
        rays: of each point of the coarsest level, about, for `even` light; 0: none is given.

    Attributes:
        grid: which pixels were computed; see `MultiresGrid`.
        tree: what stood for the lights.
    """

    name: ClassVar[str] = "multires splat"
    """Name of the pass that is reported as skipped without light."""

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: MultiresSplatParams | None = None,
        *,
        surfels: int = 0,
        rays: int = 0,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._final = FinalGather(runtime, rays) if rays else None
        self._params = params = params or MultiresSplatParams()
        self.grid = MultiresGrid(runtime, size, params)
        most = -(-params.vpls // 16) * 16 + surfels if surfels else params.vpls
        self._lights = DeviceVpls(runtime, most, parts=params.refine > 0.0)
        self._chooser = VplChooser(runtime, (self._lights,), params.vpls)
        # Of what is seen through and of what is behind it there is one each at the same time.
        self._occupancy = OccupancyGrid(runtime, params.grid, size, kept=False) if params.visibility else None
        tiles = tiles_of(size)
        self._boxes = runtime.empty(tiles[0] * tiles[1] * BOX, np.float32)
        self.tree = VplTree(
            runtime, self._lights, NEARS.index(params.near), int(params.cutoff > 0.0), self._occupancy, params.share
        )
        self.tree.reserve(size[0] * size[1])
        self._importance = ViewImportance(runtime)
        self._no_light = NoLight(runtime, size, self.name)

    def _set(self, params: MultiresSplatParams) -> None:
        self.grid.params = params

    def run(
        self,
        gbuffer: DeviceGBuffer,
        vpls: Vpls | None = None,
        *,
        rsms: Sequence[DeviceRsm] = (),
        scene: DeviceScene | None = None,
        surfels: WorldVpls | None = None,
        other_light: Sequence[Plane] = (),
        blockers: Scene | None = None,
        even: EvenLight | None = None,
    ) -> Plane:
        """Queue the passes; return the plane of irradiance, see `gather`."""
        return self.gather(
            gbuffer,
            vpls,
            rsms=rsms,
            scene=scene,
            surfels=surfels,
            other_light=other_light,
            blockers=blockers,
            even=even,
        ).irradiance

    def gather(
        self,
        gbuffer: DeviceGBuffer,
        vpls: Vpls | None = None,
        *,
        rsms: Sequence[DeviceRsm] = (),
        scene: DeviceScene | None = None,
        surfels: WorldVpls | None = None,
        other_light: Sequence[Plane] = (),
        blockers: Scene | None = None,
        even: EvenLight | None = None,
        order: KeptOrder | None = None,
    ) -> Gathered:
        """Queue the passes; return irradiance, and what blocked light.

        Args:
            gbuffer, vpls, rsms, scene: see `VplSplat.run`.
            surfels: lights besides those that are chosen from `rsms`, such as `Radiosity` returns;
                at most as many as this was prepared for, and `vpls` is None.
            other_light: planes of irradiance in W/m^2 that the result is added to: errors are
                shares of the mean of all light.
            blockers: with `visibility`, the scene whose triangles block light, without holes: rays meet these in
                place of the grid's cells, and lights are chosen without `importance`.
            even: with `blockers`, more light of its surfaces, such as `Radiosity` returns: rays find what is the same
                all over (see `FinalGather`), the rest is that of lights. `surfels` is None.
            order: of the lights in the frame before, in a sequence; it is changed.

        Raises:
            ValueError: the G-buffer is empty or has another size, there are too many lights, `blockers` is given
                without `visibility`, or `even` without rays or `blockers` or with `surfels`.
        """
        camera = camera_of(gbuffer, self.size)
        if blockers is not None and self._occupancy is None:
            raise ValueError("blockers is a Scene: expected None without visibility, with which alone light is blocked")
        final = self._final if even is not None else None
        if even is not None:
            if blockers is None or surfels is not None or final is None:
                raise ValueError("even is EvenLight: expected None without rays or blockers, or with surfels")
            surfels = even.bright
        if not (rsms if vpls is None else vpls) and surfels is None and even is None:
            return Gathered(self._no_light.skipped(), None)
        params, tree = self.params, self.tree
        levels = self.grid.levels(gbuffer, tree.limits)
        coarsest = next(levels)  # the device has work while the host packs the lights
        curve = None
        if vpls is not None:
            self._lights.upload(vpls, camera)
        elif rsms:
            curve = self._chooser.place(rsms, camera, kinds=1, more=surfels)
        elif surfels is not None or blockers is None:
            self._lights.place(None, camera, more=surfels)
        else:
            self._lights.place(None, camera, float(np.abs(_corners_seen(blockers, camera)).max()))
        occupancy = None
        if self._occupancy is not None and blockers is None:
            tiles = bound_tiles(self.runtime, self.grid.half(gbuffer), self._boxes, self._lights)
            occupancy = self._occupancy.fill(gbuffer, rsms, self._boxes, tiles, self._lights, scene)
            if curve is not None and params.importance:
                importance = self._importance.run(gbuffer, curve, occupancy=occupancy)
                self._chooser.place(rsms, camera, kinds=1, importance=importance, more=surfels)
        rays = None
        if blockers is not None:
            rays = SceneRays(self.runtime, blockers, camera.view, self._lights.unit)
            if final is not None and even is not None:
                final.enter(blockers, even.volume, camera)
        tree.update(order)
        values = {"cutoff": params.scaled_cutoff(self._lights.unit), "refine": params.refine}
        for level in chain([coarsest], levels):
            if final is not None and rays is not None:
                final.shine(level, rays, self._lights.values["per_unit"])
            if level is coarsest:
                known = [*other_light, *([] if final is None else [level.values])]
                between = params.interpolation_error * (1.0 if final is None else final.effort.between)
                tree.measure(level.source, level.list, values, between, params.light_error, known)
            if self._lights.count:
                tree.shine(level.source, level.list, level.most, level.fractions, level.values, values, occupancy, rays)
        return Gathered(self.grid.result, occupancy)

    def block(self, gbuffer: DeviceGBuffer, scene: Scene) -> Occupancy:
        """Queue the passes that find what blocks rays where nothing shone, for other rays."""
        assert self._occupancy is not None  # noqa: S101  of an object with `visibility`
        camera = camera_of(gbuffer, self.size)
        corners = _corners_seen(scene, camera)
        unit = power_of_two(float(np.abs(corners).max()))
        solid = device_scene(scene, self.runtime)
        return self._occupancy.fill_scene(solid, camera.view, unit, corners.min(axis=0), corners.max(axis=0))

    def __call__(
        self, gbuffer: GBuffer | DeviceGBuffer, vpls: Vpls, out: NDArray[np.float32] | None = None
    ) -> NDArray[np.float32]:
        """Return irradiance [rows, columns, 3] float32 in W/m^2, written to `out` if given."""
        if out is None:
            out = np.empty((*self.size, 3), np.float32)
        with self.runtime.frame():
            result = self.run(on_device(gbuffer, self.runtime), vpls)
            result.download(np.moveaxis(out, -1, 0))
        return out


def _corners_seen(scene: Scene, camera: Camera) -> NDArray[np.float64]:
    """Return [8, 3] corners of a scene's box in a camera's view space."""
    found: NDArray[np.float64] = box_corners(scene.bounds) @ camera.view[:3, :3].T + camera.view[:3, 3]
    return found


METHODS: dict[str, Method] = dict(
    zip(
        get_args(MultiresMethod),
        (Method(MultiresSplat, MultiresSplatParams), Method(MultiresPublished, MultiresPublishedParams)),
        strict=True,
    )
)
"""The first is the default."""


@banded(lights_plan)
@with_fields_described(MultiresSplatParams, MultiresPublishedParams)
@serialised
def multires_splat(
    gbuffer: GBuffer | DeviceGBuffer,
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    vpls: int = 1024,
    interpolation_error: float | None = None,
    *,
    scene: Scene | None = None,
    method: MultiresMethod = "adaptive",
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[MultiresSplatKeywords],
) -> NDArray[np.float32]:
    """Compute irradiance by one diffuse bounce, from virtual point lights, where it is not smooth.

    Pixels in between are interpolated. After Nichols and Wyman 2009, "Multiresolution Splatting for
    Indirect Illumination"; with `cutoff=0`, `vpl_splat` gives what it is close to.

    Departs, with method "adaptive": where to compute is decided by the light's differences, to an
    error that is asked for; few lights stand for many (after Walter et al. 2005, "Lightcuts");
    near lights give way to their parts; surfaces may block light. Method "published" is as
    published: a min-max mipmap of depth and normals decides, see `MultiresPublishedParams`.

    Args:
        gbuffer: what the camera sees.
        rsms: a reflective shadow map, or one for each light.
        vpls: virtual point lights in all, 1 to 2^24; see `choose_vpls`.
        interpolation_error: method "adaptive": of interpolation as a share of the mean irradiance, >= 0, by
            default 0.01; see `MultiresSplatParams`.
        method: "adaptive", or "published" for subsplats found by geometry alone.
        scene: with `visibility`, the triangles that block light, seen or not; by default what the
            G-buffer and the maps show does.
        max_memory: as of `gtao`; lights are then chosen without `importance`, `visibility` needs `scene`, and
            each band is held to the errors by itself.
        runtime: the device; by default the fastest found.
        **params: the other fields of `MultiresSplatParams` or, with method "published", of
            `MultiresPublishedParams`.

    Returns:
        E [rows, columns, 3] float32 in W/m^2, at most 1e30; 0 where nothing is.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range, or one of another
            method; the message says which, its value and what is allowed.
    """
    given = {
        "vpls": vpls,
        **({} if interpolation_error is None else {"interpolation_error": interpolation_error}),
        **params,
    }
    chosen: Any = chosen_params(METHODS, method, given)
    if scene is not None and method == "published":
        raise ValueError("scene applies only to method='adaptive' (got method='published')")
    return lit_by_maps(METHODS[method].technique, chosen, gbuffer, rsms, runtime, scene)


DESCRIPTOR = Technique(
    name="multires_splat",
    kind="indirect",
    paper="Nichols and Wyman 2009",
    function=multires_splat,
    params=MultiresSplatParams,
    technique=MultiresSplat,
    reference="ssgi_cl.reference.multires.multires_splat",
    reads=("depth", "normal", "rsms", "scene"),
    writes=("irradiance",),
    methods={name: method.params for name, method in METHODS.items()},
    quantity="bounce",
    bench=Bench(
        families=("multires", "multires-visibility"),
        rows={
            "multires_splat": (
                "the same light at few pixels and from few lights, to a given error",
                (("1 %", "multires.10-permille"), ("with visibility", "multires-visibility.4096")),
            )
        },
    ),
)
