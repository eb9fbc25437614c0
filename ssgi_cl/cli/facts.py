"""What commands say of cameras and lights, as JSON can hold it: world space, scene units, degrees, W."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light


def camera_facts(camera: Camera) -> dict[str, Any]:
    """Return place, size in pixels, and field of view (or height, of an orthographic camera)."""
    return {**placed(camera.view), "width": camera.width, "height": camera.height, **_field(camera)}


def placed(view: np.ndarray) -> dict[str, Any]:
    """Return position, direction and upward direction of a view matrix."""
    return {
        "eye": (-view[:3, :3].T @ view[:3, 3]).tolist(),
        "forward": (-view[2, :3]).tolist(),
        "up": view[1, :3].tolist(),
    }


def _field(camera: Camera) -> dict[str, float]:
    scale = float(camera.projection[1, 1])
    if camera.is_orthographic:
        return {"view_height": 2.0 / scale}
    return {"fov": math.degrees(2.0 * math.atan(1.0 / scale))}


def light_facts(light: Light) -> dict[str, Any]:
    """Return kind and values; an environment's image is given by its size and mean."""
    values: dict[str, Any] = {"kind": type(light).__name__}
    for field in fields(light):
        value = getattr(light, field.name)
        if isinstance(value, np.ndarray) and value.ndim == 3:
            values["image"] = [value.shape[1], value.shape[0]]
            value = _sphere_mean(value)
        values[field.name] = value.tolist() if isinstance(value, np.ndarray) else value
    for name in ("cone_angle", "angle"):
        if name in values:
            values[name] = math.degrees(values[name])
    return values


def _sphere_mean(image: np.ndarray) -> np.ndarray:
    """Return the mean radiance of a latitude-longitude image over the sphere."""
    edges = np.cos(np.linspace(0.0, math.pi, len(image) + 1))
    mean: np.ndarray = 0.5 * np.einsum("r,rd->d", edges[:-1] - edges[1:], image.mean(axis=1))
    return mean
