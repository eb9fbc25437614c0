"""Former names of modules and functions, which work for one release and warn."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

ATTRIBUTES = {"extra_cameras": "auxiliary_cameras", "Form": "KernelVariant"}
"""Former names of the package -> the present ones."""

_MOVED = {
    ("", "cli"): ("cli_apply=apply cli_render=render"),
    ("", "core"): ("atomic camera check=checks errors gbuffer immutable lights params sampling sight=camera_rays"),
    ("", "device"): (
        "device_gbuffer=gbuffer device_memory=memory device_rsm=rsm drivers host_memory image_limits kernel "
        "memory=arrays opencl probe runtime sources structs window=active_region"
    ),
    ("", "device.drivers"): (
        "device_info=info device_records=records driver_caches=caches pocl_cache pocl_cpu probing"
    ),
    ("", "frame"): ("further_views=auxiliary_views occluder=tile_classifier plan render render_params renderer"),
    ("", "io"): ("cli_common=console exr exr_header png views=previews"),
    ("", "rasterize"): ("viewpoint=default_camera"),
    ("", "techniques"): ("presets"),
    ("", "techniques.indirect"): ("device_vpls=packed_vpls extra_cameras=auxiliary_cameras flux_curve vpls=vpl_choice"),
    ("", "techniques.shading"): ("light_maps"),
    ("", "truth"): ("metrics raycast"),
    ("bench", "tuning"): (
        "calibration case context measure search trials tunables tune tuning=outcome views=measured_scenes"
    ),
    ("presets", "techniques.presets"): ("pace=speed_model"),
    ("presets", "tuning"): ("choose"),
    ("rasterize", "core"): ("scene"),
    ("reference", "reference"): ("lamp_shadows=light_shadows sight_grid=occupancy_grid"),
    ("techniques", "techniques.ao"): ("bent_normals bitmask_ao gtao hbao occlusion slices ssao"),
    ("techniques", "techniques.filters"): ("bilateral upsample"),
    ("techniques", "techniques.indirect"): (
        "methods multires_grid multires_published multires_splat rsm_gather rsm_maps "
        "rsm_published rsm_samples rsm_technique sight_grid=occupancy_grid ssdo ssdo_back "
        "ssdo_bitmask ssdo_directions ssdo_finish ssdo_inputs ssdo_lamps=ssdo_lights ssdo_params "
        "ssdo_point_views ssdo_points ssdo_sides ssdo_view_senders ssdo_views ssdo_views_unseen "
        "view_importance vpl_light vpl_splat vpl_tree"
    ),
    ("techniques", "techniques.shading"): (
        "ambient lamp_shadows=light_shadows lamps=light_data lit_layers=layer_shading "
        "multi_bounce shade shadow_blocks shadow_maps sky tonemap"
    ),
    ("techniques", "truth"): ("ray_ao"),
}
"""(former package, present package) within `ssgi_cl` -> modules, those with another name now as
former=present."""

MODULES = {
    ".".join(filter(None, ("ssgi_cl", before, name.partition("=")[0]))): ".".join(
        filter(None, ("ssgi_cl", after, name.partition("=")[2] or name))
    )
    for (before, after), names in _MOVED.items()
    for name in names.split()
}
"""Former names of modules -> the present ones."""


class _Alias(ModuleType):
    """A module under its former name; callable where a public function has that name now."""

    def __init__(self, name: str, module: ModuleType) -> None:
        super().__init__(name, module.__doc__)
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_module"], name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        name = self.__name__.rpartition(".")[2]
        return getattr(self, ATTRIBUTES.get(name, name))(*args, **kwargs)


class _Finder(MetaPathFinder, Loader):
    """Finds modules by their former names."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname in MODULES else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        new = MODULES[spec.name]
        warnings.warn(f"{spec.name} is now {new}", DeprecationWarning, stacklevel=2)
        return _Alias(spec.name, import_module(new))

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: the module is loaded under its present name."""


def install() -> None:
    """Make imports find modules by their former names."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
