"""Surfaces with a Phong lobe for Mitsuba's own integrators, which have no such BSDF.

Radiance reflected to the eye is albedo / pi E, and specular times the mean of the radiance that
arrives within (n + 1) / (2 pi) cos^n(a) of the mirrored view direction (Phong 1975, with the
normalisation of Lewis 1994); what of the lobe lies below the surface is lost. Albedo and specular
together are at most 1: the lobe has what the albedo leaves.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

PHONG = "ssgi_phong"

_registered: set[str] = set()

LEAST_COSINE = 1e-12
"""Of which the logarithm is taken: its powers are nothing."""


def phong_lobe(dr: Any, cosine: Any, gloss: Any) -> Any:
    """Return the lobe's value at an angle from its axis, per solid angle."""
    power = dr.exp(gloss * dr.log(dr.maximum(cosine, LEAST_COSINE)))
    return dr.select(cosine > 0.0, (gloss + 1.0) / (2.0 * math.pi) * power, 0.0)


def phong_direction(mi: Any, axis: Any, gloss: Any, first: Any, second: Any) -> Any:
    """Return the direction that two numbers in [0, 1) give, distributed as the lobe."""
    dr = import_module("drjit")
    cosine = dr.exp(dr.log(dr.maximum(1.0 - first, LEAST_COSINE)) / (gloss + 1.0))
    sine = dr.sqrt(dr.maximum(1.0 - cosine * cosine, 0.0))
    turn = 2.0 * math.pi * second
    local = mi.Vector3f(sine * dr.cos(turn), sine * dr.sin(turn), cosine)
    return mi.Frame3f(axis).to_world(local)


def register_phong(mi: Any) -> None:
    """Make the BSDF known to the variant of Mitsuba that is set."""
    if mi.variant() in _registered:
        return
    _registered.add(mi.variant())
    dr = import_module("drjit")

    class Phong(mi.BSDF):  # type: ignore[misc]
        """`reflectance` and `specular` are textures, `gloss` is the exponent."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.reflectance = properties.get_texture("reflectance")
            self.specular = properties.get_texture("specular")
            self.gloss = float(properties["gloss"])
            flags = mi.BSDFFlags.FrontSide
            self.m_components = [mi.BSDFFlags.DiffuseReflection | flags, mi.BSDFFlags.GlossyReflection | flags]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def _parts(self, si: Any, active: Any) -> tuple[Any, Any, Any]:
            """Return albedo, specular, and the share of samples that the lobe takes."""
            albedo = self.reflectance.eval(si, active)
            specular = dr.minimum(self.specular.eval(si, active), 1.0 - albedo)
            lobe, rest = dr.max(specular), dr.max(albedo)
            return albedo, specular, lobe / dr.maximum(lobe + rest, 1e-20)

        def _lobe(self, si: Any, wo: Any) -> Any:
            mirrored = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            return phong_lobe(dr, dr.dot(mirrored, wo), self.gloss)

        def sample(self, context: Any, si: Any, number: Any, numbers: Any, active: Any = True) -> tuple[Any, Any]:
            _, _, share = self._parts(si, active)
            mirrored = number < share
            around = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            wo = dr.select(
                mirrored,
                phong_direction(mi, around, self.gloss, numbers.x, numbers.y),
                mi.warp.square_to_cosine_hemisphere(numbers),
            )
            found = dr.zeros(mi.BSDFSample3f)
            found.wo = wo
            found.eta = 1.0
            found.pdf = self.pdf(context, si, wo, active)
            found.sampled_component = dr.select(mirrored, mi.UInt32(1), mi.UInt32(0))
            found.sampled_type = dr.select(
                mirrored, mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
            )
            value = self.eval(context, si, wo, active) / dr.maximum(found.pdf, 1e-30)
            return found, dr.select(active & (found.pdf > 0.0), value, 0.0)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            albedo, specular, _ = self._parts(si, active)
            faces = active & (si.wi.z > 0.0) & (wo.z > 0.0)
            value = albedo * (wo.z / math.pi) + specular * self._lobe(si, wo)
            return dr.select(faces, value, 0.0)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            _, _, share = self._parts(si, active)
            faces = active & (si.wi.z > 0.0) & (wo.z > 0.0)
            density = (1.0 - share) * (wo.z / math.pi) + share * self._lobe(si, wo)
            return dr.select(faces, density, 0.0)

        def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
            return self.reflectance.eval(si, active)

        def to_string(self) -> str:
            return f"Phong[gloss={self.gloss}]"

    mi.register_bsdf(PHONG, Phong)
