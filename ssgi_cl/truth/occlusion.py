"""World truth of ambient occlusion: rays against the mesh, in independent passes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ssgi_cl.truth.ray_ao as estimator
import ssgi_cl.truth.raycast
from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Progress, part_of, told
from ssgi_cl.truth.digests import camera_description, digest, scene_digest
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.store import Truth, accumulated

FEWEST_RAYS = 64
"""Of a pass, where there are enough for two: fewer are spread less well over the hemisphere."""
MOST_PASSES = 16
"""More rays make passes larger instead: a pass of n rays has an error of about n^-0.75."""


def ambient_occlusion(
    scene: Scene,
    camera: Camera,
    radius: float,
    rays: int = 512,
    *,
    weighting: str = "cosine",
    attenuation: str | ArrayLike = "none",
    gbuffer: GBuffer | None = None,
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return A by rays from what each pixel's centre shows to the mesh; kept on disk.

    Rays are cast in 2 to 16 passes of equal size, each one set that is well spread over the
    hemisphere, moved at random in every pixel and pass.

    Args:
        scene, camera, radius, weighting, attenuation, gbuffer: see `ssgi_cl.ray_ao`.
        rays: per pixel, 1 to 2^20; rounded up to a multiple of the number of passes.
        rebuild: make it anew, whatever is kept.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.

    Returns:
        Mean A [rows, columns] float32 in [0, 1] and its standard error; 1 and 0 where nothing is
        seen. The error has one degree of freedom less than there are passes (512 rays: 7), and
        does not know of an occluder that no ray of the pixel has met.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
        TruthError: what is kept is damaged; see `ssgi_cl.truth.store.accumulated`.
        MissingExtraError: embreex is not installed; it comes with the extra `truth`.
    """
    embreex = ssgi_cl.truth.raycast.embree_version()
    ssgi_cl.truth.raycast.check_gbuffer(gbuffer, camera)
    passes, share = split(rays)
    description: dict[str, Any] = {
        "kind": "ao",
        "scene": scene_digest(scene),
        "camera": camera_description(camera),
        **of_rays(radius, share, weighting, attenuation),
        "gbuffer": None if gbuffer is None else inner_digest(gbuffer),
        "embreex": embreex,
        "estimator": versioned("occlusion"),
    }

    with told(progress, "ambient occlusion") as tell:

        def make(number: int) -> NDArray[np.float32]:
            return estimator.ray_ao(
                scene,
                camera,
                radius,
                share,
                weighting=weighting,
                attenuation=attenuation,
                gbuffer=gbuffer,
                seed=number,
                progress=part_of(tell, number / passes, (number + 1) / passes),
            )

        return accumulated(description, passes, make, rebuild=rebuild, progress=tell)


def split(rays: int) -> tuple[int, int]:
    """Return the number of passes for `rays` per pixel, and the rays of each."""
    rays = checks.integer("rays", rays, low=1, high=estimator.MOST_RAYS, unit="rays per pixel")
    passes = min(max(rays // FEWEST_RAYS, 2), MOST_PASSES)
    return passes, -(-rays // passes)


def of_rays(radius: float, share: int, weighting: str, attenuation: str | ArrayLike) -> dict[str, Any]:
    """Return what rays depend on, checked, for a description."""
    return {
        "radius": checks.number("radius", radius, low=0, above=True, unit="scene units", infinite=True),
        "rays": share,
        "weighting": checks.choice("weighting", weighting, estimator.WEIGHTINGS),
        "attenuation": attenuation if isinstance(attenuation, str) else np.asarray(attenuation, np.float64).tolist(),
    }


def inner_digest(gbuffer: GBuffer) -> str:
    """Return the hash of what rays take from a G-buffer."""
    arrays = (gbuffer.first(name) for name in ("depth", "normal"))
    return digest(*(None if array is None else gbuffer.inner(array) for array in arrays))
