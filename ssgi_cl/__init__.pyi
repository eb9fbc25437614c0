# The public names and their modules; `__init__.py` imports each when it is first used.
from . import rasterize as rasterize
from . import truth as truth
from .core.camera import Camera as Camera
from .core.errors import (
    DeviceError as DeviceError,
)
from .core.errors import (
    KernelBuildError as KernelBuildError,
)
from .core.errors import (
    KernelSourceError as KernelSourceError,
)
from .core.errors import (
    MissingExtraError as MissingExtraError,
)
from .core.errors import (
    SceneError as SceneError,
)
from .core.errors import (
    SsgiError as SsgiError,
)
from .core.errors import (
    TruthError as TruthError,
)
from .core.gbuffer import GBuffer as GBuffer
from .core.gbuffer import ReflectiveShadowMap as ReflectiveShadowMap
from .core.lights import (
    DirectionalLight as DirectionalLight,
)
from .core.lights import (
    Environment as Environment,
)
from .core.lights import (
    Light as Light,
)
from .core.lights import (
    PointLight as PointLight,
)
from .core.lights import (
    SpotLight as SpotLight,
)
from .core.suns import split_suns as split_suns
from .core.vpls import Vpls as Vpls
from .device.drivers import KernelVariant as KernelVariant
from .device.gbuffer import DeviceGBuffer as DeviceGBuffer
from .device.rsm import DeviceRsm as DeviceRsm
from .device.runtime import PassTime as PassTime
from .device.runtime import Runtime as Runtime
from .frame.render import render as render
from .frame.renderer import Renderer as Renderer
from .frame.result import Frame as Frame
from .techniques.ao.bitmask_ao import (
    BitmaskAo as BitmaskAo,
)
from .techniques.ao.bitmask_ao import (
    BitmaskParams as BitmaskParams,
)
from .techniques.ao.bitmask_ao import (
    bitmask_ao as bitmask_ao,
)
from .techniques.ao.gtao import Gtao as Gtao
from .techniques.ao.gtao import GtaoParams as GtaoParams
from .techniques.ao.gtao import gtao as gtao
from .techniques.ao.hbao import Hbao as Hbao
from .techniques.ao.hbao import HbaoParams as HbaoParams
from .techniques.ao.hbao import hbao as hbao
from .techniques.ao.ssao import Ssao as Ssao
from .techniques.ao.ssao import SsaoParams as SsaoParams
from .techniques.ao.ssao import ssao as ssao
from .techniques.filters.bilateral import (
    Bilateral as Bilateral,
)
from .techniques.filters.bilateral import (
    BilateralParams as BilateralParams,
)
from .techniques.filters.bilateral import (
    bilateral_blur as bilateral_blur,
)
from .techniques.filters.upsample import Upsample as Upsample
from .techniques.filters.upsample import UpsampleParams as UpsampleParams
from .techniques.filters.upsample import upsample as upsample
from .techniques.indirect.auxiliary_cameras import auxiliary_cameras as auxiliary_cameras
from .techniques.indirect.multires_published import (
    MultiresPublished as MultiresPublished,
)
from .techniques.indirect.multires_published import (
    MultiresPublishedParams as MultiresPublishedParams,
)
from .techniques.indirect.multires_splat import (
    MultiresSplat as MultiresSplat,
)
from .techniques.indirect.multires_splat import (
    MultiresSplatParams as MultiresSplatParams,
)
from .techniques.indirect.multires_splat import (
    multires_splat as multires_splat,
)
from .techniques.indirect.rsm_gather import (
    RsmGather as RsmGather,
)
from .techniques.indirect.rsm_gather import (
    RsmGatherParams as RsmGatherParams,
)
from .techniques.indirect.rsm_gather import (
    rsm_gather as rsm_gather,
)
from .techniques.indirect.rsm_published import (
    RsmPublished as RsmPublished,
)
from .techniques.indirect.rsm_published import (
    RsmPublishedParams as RsmPublishedParams,
)
from .techniques.indirect.ssdo import Ssdo as Ssdo
from .techniques.indirect.ssdo import ssdo as ssdo
from .techniques.indirect.ssdo_params import SsdoParams as SsdoParams
from .techniques.indirect.vpl_choice import choose_vpls as choose_vpls
from .techniques.indirect.vpl_splat import (
    VplSplat as VplSplat,
)
from .techniques.indirect.vpl_splat import (
    VplSplatParams as VplSplatParams,
)
from .techniques.indirect.vpl_splat import (
    vpl_splat as vpl_splat,
)
from .techniques.presets.choose import Choice as Choice
from .techniques.sampled_lights import (
    SampledLights as SampledLights,
)
from .techniques.sampled_lights import (
    SampledLightsParams as SampledLightsParams,
)
from .techniques.sampled_lights import (
    sampled_lights as sampled_lights,
)
from .techniques.shading.multi_bounce import multi_bounce as multi_bounce
from .techniques.shading.shade import Shade as Shade
from .techniques.shading.shade import ShadeParams as ShadeParams
from .techniques.shading.shade import shade as shade
from .techniques.shading.tonemap import Tonemap as Tonemap
from .techniques.shading.tonemap import TonemapParams as TonemapParams
from .techniques.shading.tonemap import tonemap as tonemap
from .truth import metrics as metrics
from .truth.ray_ao import RayAo as RayAo
from .truth.ray_ao import ray_ao as ray_ao
from .tuning.choose import choose as choose
from .tuning.tune import TuneError as TuneError
from .tuning.tune import Tuning as Tuning
from .tuning.tune import tune as tune
from .version import __version__ as __version__
