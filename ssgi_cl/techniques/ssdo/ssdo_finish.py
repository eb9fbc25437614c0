"""From the size at which directional occlusion is gathered to that of the image, and the blur."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.filters.bilateral import Bilateral
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleParams
from ssgi_cl.techniques.source import Source
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams


class Finish:
    """Blurs and upsamples any number of images alike, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the results.
        params: of directional occlusion.
    """

    def __init__(self, runtime: Runtime, size: Size, params: SsdoParams) -> None:
        self.runtime = runtime
        self.size = size
        self._step = RESOLUTIONS[params.resolution]
        self._late = self._step > 1 and params.blur_resolution == "full"
        self._smooth = params.blur
        self._reduced: ReducedGBuffer | None = None
        self._blurs: dict[int, Bilateral] = {}
        self._upsamples: dict[int, Upsample] = {}

    def source(self, gbuffer: DeviceGBuffer) -> Source:
        """Return the G-buffer, or what is picked from it for the size that is gathered."""
        if self._step == 1:
            return gbuffer
        if self._reduced is None:
            self._reduced = ReducedGBuffer(gbuffer, self._step)
        self._reduced.update(gbuffer)
        return self._reduced

    def run(self, gbuffer: DeviceGBuffer, plane: Plane, *, source: Source | None = None) -> Plane:
        """Queue the blur and the upsampling of all images at once; return the plane at full size.

        Args:
            gbuffer: at full size.
            plane: what was gathered.
            source: whose pixels those of `plane` are, see `source`; `gbuffer` by default.
        """
        source = gbuffer if source is None else source
        count = plane.count
        if count not in self._blurs:
            size = self.size if self._late else plane.size
            self._blurs[count] = Bilateral(self.runtime, size, self._smooth, count, kept=False)
        if not self._late:
            region = gbuffer.seen_every(self._step)
            plane = self._blurs[count].run(source, plane, region=region)
        if source is not gbuffer:
            if count not in self._upsamples:
                self._upsamples[count] = Upsample(
                    self.runtime, self.size, UpsampleParams(step=self._step), count, kept=False
                )
            plane = self._upsamples[count].run(gbuffer, plane, reduced=source)
        if self._late:
            plane = self._blurs[count].run(gbuffer, plane, region=gbuffer.seen)
        return plane
