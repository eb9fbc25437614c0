"""Sides of depth layers that nobody sees: pairs of layers, by which way normals point."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.reference.ssdo.ssdo_bitmask import sides_of
from ssgi_cl.techniques.ssdo.ssdo_bitmask import closed_sides

from ..analytic import camera

STACKS = {
    "fbfb": (1, -1, 1, -1),  # two closed things
    "ffbb": (1, 1, -1, -1),  # one within another
    "ffb ": (0, 1, -1, 0),  # a sheet before a closed thing
    "fbf ": (1, -1, 0, 0),  # a wall behind one
    "ffff": (0, 0, 0, 0),
    "bfb ": (0, 0, 0, 0),  # a sheet from behind comes first: nothing is said
    "f0b ": (0, 0, 0, 0),  # a layer without a normal
    "    ": (0, 0, 0, 0),
}
"""Layers from the front: (f)ront, (b)ack or no normal; and their sides."""


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_layers_that_bound_something_closed_are_paired(variant_runtime: Runtime, kind: str) -> None:
    made = camera(kind, size=(1, len(STACKS)))
    towards = made.view[2, :3]  # the normal of what faces the camera
    letters = np.array([list(stack) for stack in STACKS]).T[:, None]
    signs = np.select([letters == "f", letters == "b"], [1.0, -1.0], 0.0)
    depth = np.where(letters == " ", np.inf, 2.0 + np.arange(4.0)[:, None, None])
    gbuffer = GBuffer(
        camera=made, depth=depth.astype(np.float32), normal=(signs[..., None] * towards).astype(np.float32)
    )
    device = DeviceGBuffer(variant_runtime, made.size, layers=4, attributes=4)
    device.upload(gbuffer)
    plane = closed_sides(device)
    assert plane is not None
    wanted = np.array(list(STACKS.values())).T[:, None]
    np.testing.assert_array_equal(plane.download(), wanted)
    np.testing.assert_array_equal(sides_of(gbuffer, SurfaceView.of(gbuffer)), wanted)


def test_one_layer_with_normals_says_nothing(runtime: Runtime) -> None:
    for layers in (1, 2):
        assert closed_sides(DeviceGBuffer(runtime, (1, 4), layers=layers)) is None
