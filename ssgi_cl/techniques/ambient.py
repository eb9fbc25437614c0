"""Ambient light: the irradiance that environments bring to a surface with nothing round it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ssgi_cl.lights import Environment, Light
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques.lamps import BRIGHTEST


class Ambient:
    """The environments' sum as kernels read it: a quadratic function of the world-space normal.

    Attributes:
        coefficients: [9, 3] float32, see `Environment.irradiance_coefficients`.
        shines: whether there is any such light.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.coefficients = runtime.array(np.zeros(27, np.float32))
        self.shines = False
        self._environments: list[Environment] = []

    def set(self, lights: Sequence[Light]) -> bool:
        """Take the environments among the lights; return whether they changed since last time."""
        environments = [light for light in lights if isinstance(light, Environment)]
        before = self._environments
        same = len(before) == len(environments)
        if same and all(a is b for a, b in zip(before, environments, strict=True)):
            return False  # an environment never changes
        total = sum((e.irradiance_coefficients() for e in environments), np.zeros((9, 3)))
        self.shines = bool(total.any())
        self.coefficients.upload(np.clip(total, -BRIGHTEST, BRIGHTEST).astype(np.float32))
        self._environments = environments
        return True
