"""Image-space global illumination on G-buffers: numpy in, numpy out, OpenCL in between."""

from ssgi_cl import rasterize, truth
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import (
    DeviceError,
    KernelBuildError,
    KernelSourceError,
    MissingExtraError,
    SceneError,
    SsgiError,
    TruthError,
)
from ssgi_cl.core.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.device.drivers import Form
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import PassTime, Runtime
from ssgi_cl.frame.render import Frame, Renderer, render
from ssgi_cl.techniques.ao.bitmask_ao import BitmaskAo, BitmaskParams, bitmask_ao
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams, hbao
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams, ssao
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams, bilateral_blur
from ssgi_cl.techniques.filters.upsample import Upsample, upsample
from ssgi_cl.techniques.indirect.auxiliary_cameras import extra_cameras
from ssgi_cl.techniques.indirect.multires_published import (
    MultiresPublished,
    MultiresPublishedParams,
)
from ssgi_cl.techniques.indirect.multires_splat import (
    MultiresSplat,
    MultiresSplatParams,
    multires_splat,
)
from ssgi_cl.techniques.indirect.rsm_gather import RsmGather, RsmGatherParams, rsm_gather
from ssgi_cl.techniques.indirect.rsm_published import RsmPublished, RsmPublishedParams
from ssgi_cl.techniques.indirect.ssdo import Ssdo, ssdo
from ssgi_cl.techniques.indirect.ssdo_params import SsdoParams
from ssgi_cl.techniques.indirect.vpl_splat import VplSplat, VplSplatParams, vpl_splat
from ssgi_cl.techniques.indirect.vpls import Vpls, choose_vpls
from ssgi_cl.techniques.presets.choose import Choice, choose
from ssgi_cl.techniques.shading.multi_bounce import multi_bounce
from ssgi_cl.techniques.shading.shade import Shade, shade
from ssgi_cl.techniques.shading.tonemap import Tonemap, tonemap
from ssgi_cl.truth import metrics
from ssgi_cl.truth.ray_ao import RayAo, ray_ao
from ssgi_cl.tuning.tune import TuneError, Tuning, tune
from ssgi_cl.version import __version__

__all__ = [
    "Bilateral",
    "BilateralParams",
    "BitmaskAo",
    "BitmaskParams",
    "Camera",
    "Choice",
    "DeviceError",
    "DeviceGBuffer",
    "DeviceRsm",
    "DirectionalLight",
    "Environment",
    "Form",
    "Frame",
    "GBuffer",
    "Gtao",
    "GtaoParams",
    "Hbao",
    "HbaoParams",
    "KernelBuildError",
    "KernelSourceError",
    "Light",
    "MissingExtraError",
    "MultiresPublished",
    "MultiresPublishedParams",
    "MultiresSplat",
    "MultiresSplatParams",
    "PassTime",
    "PointLight",
    "RayAo",
    "ReflectiveShadowMap",
    "Renderer",
    "RsmGather",
    "RsmGatherParams",
    "RsmPublished",
    "RsmPublishedParams",
    "Runtime",
    "SceneError",
    "Shade",
    "SpotLight",
    "Ssao",
    "SsaoParams",
    "Ssdo",
    "SsdoParams",
    "SsgiError",
    "Tonemap",
    "TruthError",
    "TuneError",
    "Tuning",
    "Upsample",
    "VplSplat",
    "VplSplatParams",
    "Vpls",
    "__version__",
    "bilateral_blur",
    "bitmask_ao",
    "choose",
    "choose_vpls",
    "extra_cameras",
    "gtao",
    "hbao",
    "metrics",
    "multi_bounce",
    "multires_splat",
    "rasterize",
    "ray_ao",
    "render",
    "rsm_gather",
    "shade",
    "ssao",
    "ssdo",
    "tonemap",
    "truth",
    "tune",
    "upsample",
    "vpl_splat",
]
