"""Errors of float32 sums of many lights; `make figures` writes docs/summation.md."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.wording import markdown
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.constants import VPL_TERMS
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.vpl.vpl_splat import vpl_splat_reference
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

RANGE = 1e8
"""Of the lights' flux, the brightest over the darkest."""
BLOCK = VPL_TERMS
BATCH = 2048
"""Terms of a batch, whose sum is rounded before it is added."""
SIZE = (6, 8)

HEIGHT = 1.5
"""Of the lights above the wall that they shine on, scene units."""
POWERS = (10, 12, 14, 16, 18)
"""Of two: numbers of terms."""
SIDES = (32, 64, 128)
"""Of the maps: as many lights as texels."""


def equal(count: int) -> Doubles:
    """Return terms that all round the same way."""
    return np.full(count, 1.0 / 3.0)


def bright_first(count: int) -> Doubles:
    """Return one term in front of others so small that each vanishes beside it."""
    return np.append(1.0, np.full(count - 1, 1.0 / RANGE))


def spread(count: int) -> Doubles:
    """Return terms spread evenly over the logarithm of `RANGE`, in no order."""
    return np.exp(np.random.default_rng(7).uniform(-math.log(RANGE), 0.0, count))


TERMS: Mapping[str, Callable[[int], Doubles]] = {
    "equal": equal,
    "one bright, then dark": bright_first,
    "spread": spread,
}


def plain(terms: Floats) -> float:
    """Return the sum made one term after the other."""
    return float(np.cumsum(terms, dtype=np.float32)[-1])


def pairwise(terms: Floats) -> float:
    """Return the sum of the two halves' sums, and so on."""
    while len(terms) > 1:
        rest = terms[len(terms) // 2 * 2 :]
        terms = np.append(terms[0 : len(terms) // 2 * 2 : 2] + terms[1::2], rest)
    return float(terms[0])


def blocks(terms: Floats) -> float:
    """Return the sum of the sums of batches, each of the sums of blocks, as kernels make it."""
    for length in (BLOCK, BATCH // BLOCK):
        terms = np.append(terms, np.zeros(-len(terms) % length, np.float32))
        terms = np.cumsum(terms.reshape(-1, length), axis=1, dtype=np.float32)[:, -1]
    return plain(terms)


def compensated(terms: Floats) -> float:
    """Return the sum with what each addition lost carried along (Kahan 1965)."""
    total = lost = np.float32(0.0)
    for term in terms:
        corrected = term - lost
        following = total + corrected
        lost = (following - total) - corrected
        total = following
    return float(total)


SUMS: Mapping[str, Callable[[Floats], float]] = {
    "plain": plain,
    "blocks": blocks,
    "pairwise": pairwise,
    "compensated": compensated,
}


def wall() -> GBuffer:
    """Return a wall z = 0 of one unit, seen from the front."""
    rows, columns = SIZE
    camera = Camera.orthographic((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), view_height=1.0, width=columns, height=rows)
    normal = np.zeros((*SIZE, 3), np.float32)
    normal[..., 2] = 1.0
    return GBuffer(camera=camera, depth=np.full(SIZE, 2.0), normal=normal)


def ceiling(flux: Doubles) -> ReflectiveShadowMap:
    """Return the map of a ceiling of 2 x 2 units that reflects `flux` [texels] in rows, W."""
    side = math.isqrt(len(flux))
    camera = Camera.orthographic((0.0, 0.0, HEIGHT - 1.0), (0.0, 0.0, HEIGHT), view_height=2.0, width=side, height=side)
    depth = np.ones((side, side), np.float32)
    position = camera.unproject(depth)
    return ReflectiveShadowMap(
        light=DirectionalLight((0.0, 0.0, 1.0), 1.0),
        camera=camera,
        depth=depth,
        position=position,
        normal=np.broadcast_to((0.0, 0.0, -1.0), position.shape),
        flux=np.repeat(flux, 3).reshape(side, side, 3),
    )


def lights_of(rsm: ReflectiveShadowMap) -> Vpls:
    """Return a light for each texel of a ceiling, in rows."""
    position, normal, flux = (
        np.asarray(array, np.float64).reshape(-1, 3) for array in (rsm.position, rsm.normal, rsm.flux)
    )
    return Vpls(position, normal, flux, np.full(len(flux), 4.0 / len(flux)))


def technique_errors(runtime: Runtime, flux: Doubles) -> Iterator[tuple[str, float]]:
    """Yield each technique's name and its largest relative error against float64."""
    gbuffer, rsm = wall(), ceiling(flux)
    vpls = lights_of(rsm)
    count = len(vpls)
    wanted = vpl_splat_reference(gbuffer, vpls, VplSplatParams(cutoff=0.0))

    def error(found: Floats) -> float:
        return float(np.abs(found / wanted - 1.0).max())

    device = on_device(gbuffer, runtime)
    splat = VplSplat(runtime, SIZE, VplSplatParams(vpls=count, cutoff=0.0, refine=0.0))
    yield "vpl_splat", error(np.moveaxis(splat.run(device, vpls).download(), 0, -1))
    exact = MultiresSplatParams(vpls=count, coarsest=1, light_error=0.0)
    multires = MultiresSplat(runtime, SIZE, exact)
    yield "multires_splat", error(np.moveaxis(multires.run(device, vpls).download(), 0, -1))
    yield "rsm_gather", error(rsm_gather(gbuffer, rsm, pattern="all", runtime=runtime))


def measured(runtime: Runtime) -> dict[str, Any]:
    """Return all errors as JSON can hold them; see `page`."""
    sums = []
    for name, terms_of in TERMS.items():
        for power in POWERS:
            terms = terms_of(1 << power).astype(np.float32)
            right = math.fsum(terms.astype(np.float64))
            errors = {kind: abs(total(terms) / right - 1.0) for kind, total in SUMS.items()}
            sums.append({"terms": name, "count": 1 << power, "errors": errors})
    found = [
        {"terms": name, "count": side * side, "errors": dict(technique_errors(runtime, terms_of(side * side)))}
        for name, terms_of in TERMS.items()
        for side in SIDES
    ]
    return {"device": f"{runtime.info.label}, {runtime.variant}", "sums": sums, "techniques": found}


def page(found: Mapping[str, Any]) -> str:
    """Return the page of what `measured` returns."""
    largest = max(max(row["errors"].values()) for row in found["techniques"])
    lines = [
        "# Sums of many lights",
        "",
        f"Made by `make figures`. {found['device']}; revision {found.get('revision') or 'unknown'}.",
        "",
        f"Relative errors of float32 sums against float64. Terms: all 1/3; 1 in front of "
        f"{1.0 / RANGE:g}s; spread evenly over the logarithm of {RANGE:g}, in no order. Sums: one "
        f"after the other; by blocks of {BLOCK} and batches of {BATCH}; of halves; with what each "
        "addition lost carried along.",
        "",
        *_table("terms", found["sums"]),
        "",
        "Techniques, as many lights as terms, all at all pixels; the largest error of a pixel. It "
        "includes the roundings of each light's form factor.",
        "",
        *_table("flux", found["techniques"]),
        "",
        "Choice: blocks (rsm_gather: of 256 and no batches). They cost one addition in 64 and need "
        "two sums of each colour; the largest error of a technique above is "
        f"{_digits(largest)}. Halves would need a sum for each "
        "level, compensation three further operations on each colour of each light, a third of "
        "what a light costs in all, for digits that a form factor in float32 has not.",
        "",
    ]
    return "\n".join(lines)


def _table(what: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    heads = list(rows[0]["errors"])
    cells = ((row["terms"], str(row["count"]), *(_digits(row["errors"][head]) for head in heads)) for row in rows)
    return markdown((what, "count", *heads), cells, "lr" + "r" * len(heads))


def _digits(error: float) -> str:
    return f"{error:.1e}"
