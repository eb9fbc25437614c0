"""Scene at a size with everything that several cases share, made when first asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import truth
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, downloaded, margin_of
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.techniques.direct.light_data import PunctualLight
from ssgi_cl.truth import Truth, metrics

T = TypeVar("T")

Progress = Callable[[str, float], object]
"""Called with what is under way and the share of it that is done."""


@dataclass(frozen=True)
class TruthSettings:
    """Sample counts and options of the truths.

    Attributes:
        rays: per pixel, of ambient occlusion.
        paths: per pixel, of light.
        points: per pixel, of what SSAO converges to.
        attenuation: W of ambient occlusion; see `ray_ao`.
        rebuild: make them anew even where they are kept.
    """

    rays: int = 512
    paths: int = 256
    points: int = 512
    attenuation: str = "none"
    rebuild: bool = False


class Context:
    """A scene, its view and its truths on one device at one size."""

    def __init__(self, runtime: Runtime, view: BuiltinScene, size: Size, truths: TruthSettings | None = None) -> None:
        self.runtime = runtime
        self.view = view
        self.size = size
        self.truths = truths or TruthSettings()
        self.progress: Progress = lambda text, share: None
        self._shared: dict[str, Any] = {}

    @cached_property
    def camera(self) -> Camera:
        """The view at this size."""
        return self.view.camera(self.size[1], self.size[0])

    @property
    def radius(self) -> float:
        """Reach of ambient occlusion, scene units."""
        return self.view.ao_radius

    @cached_property
    def gbuffer(self) -> DeviceGBuffer:
        """What the camera sees, in device memory."""
        return self.layered(1, 0.0)

    def layered(self, layers: int, overscan: float, *, thickness: bool = False) -> DeviceGBuffer:
        """Return a G-buffer with depth layers, overscan and thickness, drawn now, in device memory."""
        margin = margin_of(self.camera, overscan)
        rasterizer = Rasterizer(self.runtime, self.size, layers=layers, margin=margin, thickness=thickness)
        with self.runtime.frame():
            target = rasterizer.render(device_scene(self.view.scene, self.runtime), self.camera)
            target.derive()
        self.runtime.finish()
        return target

    @cached_property
    def host_gbuffer(self) -> GBuffer:
        """The same in numpy."""
        return downloaded(self.gbuffer)

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """[rows, columns]: where a surface is."""
        mask: NDArray[np.bool_] = np.isfinite(np.asarray(self.host_gbuffer.depth))
        return mask

    @cached_property
    def regions(self) -> dict[str, NDArray[np.bool_]]:
        """Where errors may sit; see `metrics.regions`."""
        return metrics.regions(self.host_gbuffer)

    @cached_property
    def smooth_surfaces(self) -> NDArray[np.bool_]:
        """Where blotches can be told from edges; see `metrics.smooth_surfaces`."""
        return metrics.smooth_surfaces(self.host_gbuffer)

    @cached_property
    def surface_pixels(self) -> int:
        """Pixels that show a surface."""
        return int(np.count_nonzero(self.seen))

    @property
    def pixels(self) -> int:
        """Pixels of the image."""
        return self.size[0] * self.size[1]

    @property
    def punctual_lights(self) -> tuple[PunctualLight, ...]:
        """The view's lights but for environments, which no shadow map is made of."""
        return tuple(light for light in self.view.lights if not isinstance(light, Environment))

    def some_lights(self) -> tuple[PunctualLight, ...]:
        """Return `punctual_lights`; ValueError where there are none."""
        if not self.punctual_lights:
            raise ValueError(f"{self.view.name} has no light: expected at least one")
        return self.punctual_lights

    def occlusion(self) -> Truth:
        """World truth of ambient occlusion within `radius`."""
        return self.truth(
            f"rays of {self.view.name}",
            truth.ambient_occlusion,
            self.view.scene,
            self.camera,
            self.radius,
            self.truths.rays,
            attenuation=self.truths.attenuation,
            gbuffer=self.host_gbuffer,
        )

    def bent_normals(self) -> Truth:
        """World truth of bent normals within `radius`."""
        return self.truth(
            f"bent normals of {self.view.name}",
            truth.bent_normals,
            self.view.scene,
            self.host_gbuffer,
            self.radius,
            self.truths.rays,
        )

    def direct(self) -> Truth:
        """World truth of irradiance by direct light of the lights."""
        return self._light("direct light of", truth.direct_light)

    def bounce(self) -> Truth:
        """World truth of irradiance by light of the lights that was reflected once."""
        return self._light("one bounce of", truth.one_bounce)

    def unblocked_bounce(self) -> Truth:
        """As `bounce`, without indirect visibility: what light without shadow rays converges to."""
        return self._light("one bounce, seen through walls, of", truth.one_bounce, visibility=False)

    def _light(self, what: str, make: Callable[..., Truth], **options: Any) -> Truth:
        return self.truth(
            f"{what} {self.view.name}",
            make,
            self.view.scene,
            self.camera,
            self.punctual_lights,
            self.truths.paths,
            **options,
        )

    def radiance(self) -> Truth:
        """World truth of the radiance of a whole frame: all light, pixels as boxes."""
        return self.truth(
            f"radiance of {self.view.name}",
            truth.radiance,
            self.view.scene,
            self.camera,
            self.view.own_lights,
            self.truths.paths,
            box_filter=True,
        )

    def shared(self, title: str, make: Callable[[], T]) -> T:
        """Return what `make` returns, which is called once for each title: for several cases."""
        if title not in self._shared:
            self._shared[title] = make()
        found: T = self._shared[title]
        return found

    def truth(self, title: str, make: Callable[..., Truth], *arguments: Any, **options: Any) -> Truth:
        """Return a truth, made once for each title; `make` also gets `rebuild` and `progress`."""
        return self.shared(
            title,
            lambda: make(
                *arguments, rebuild=self.truths.rebuild, progress=lambda share: self.progress(title, share), **options
            ),
        )


def exact(image: NDArray[np.floating]) -> Truth:
    """Return an image without error as a truth."""
    mean = image.astype(np.float32)
    return Truth(mean, np.zeros_like(mean), 1, "")
