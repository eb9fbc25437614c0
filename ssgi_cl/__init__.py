"""Image-space global illumination on G-buffers: numpy in, numpy out, OpenCL in between."""

from ssgi_cl import metrics, rasterize, truth
from ssgi_cl.bench.tune import TuneError, Tuning, tune
from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.drivers import Form
from ssgi_cl.errors import (
    DeviceError,
    KernelBuildError,
    KernelSourceError,
    MissingExtraError,
    SceneError,
    SsgiError,
    TruthError,
)
from ssgi_cl.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.render import Frame, Renderer, render
from ssgi_cl.runtime import PassTime, Runtime
from ssgi_cl.techniques.bilateral import Bilateral, BilateralParams, bilateral_blur
from ssgi_cl.techniques.bitmask_ao import BitmaskAo, BitmaskParams, bitmask_ao
from ssgi_cl.techniques.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.hbao import Hbao, HbaoParams, hbao
from ssgi_cl.techniques.ray_ao import RayAo, ray_ao
from ssgi_cl.techniques.shade import Shade, shade
from ssgi_cl.techniques.ssao import Ssao, SsaoParams, ssao
from ssgi_cl.techniques.tonemap import Tonemap, tonemap
from ssgi_cl.techniques.upsample import Upsample, upsample
from ssgi_cl.version import __version__

__all__ = [
    "Bilateral",
    "BilateralParams",
    "BitmaskAo",
    "BitmaskParams",
    "Camera",
    "DeviceError",
    "DeviceGBuffer",
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
    "PassTime",
    "PointLight",
    "RayAo",
    "ReflectiveShadowMap",
    "Renderer",
    "Runtime",
    "SceneError",
    "Shade",
    "SpotLight",
    "Ssao",
    "SsaoParams",
    "SsgiError",
    "Tonemap",
    "TruthError",
    "TuneError",
    "Tuning",
    "Upsample",
    "__version__",
    "bilateral_blur",
    "bitmask_ao",
    "gtao",
    "hbao",
    "metrics",
    "rasterize",
    "ray_ao",
    "render",
    "shade",
    "ssao",
    "tonemap",
    "truth",
    "tune",
    "upsample",
]
