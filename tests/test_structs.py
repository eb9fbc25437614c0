"""Structs that cross from the host to kernels."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct, camera_values, floats

from .launches import builds


@pytest.fixture(scope="module")
def structs(runtime: Runtime) -> list[Struct]:
    """All structs that the library passes to kernels."""
    found = {struct.name: struct for build in builds(runtime) for struct in build.structs}
    return list(found.values())


def test_the_text_is_that_of_the_members() -> None:
    struct = Struct("Mixed", (*floats("a", "b"), ("n", "int")))
    assert struct.text == "typedef struct { float a; float b; int n; } Mixed;"
    assert struct.dtype == np.dtype([("a", "<f4"), ("b", "<f4"), ("n", "<i4")])


def test_no_two_structs_have_one_name(runtime: Runtime) -> None:
    found = {struct for build in builds(runtime) for struct in build.structs}
    assert len({struct.name for struct in found}) == len(found)


def test_the_compilers_layout_is_that_of_numpy(
    variant_runtime: Runtime, structs: list[Struct]
) -> None:
    expected: list[int] = []
    lines = []
    for struct in structs:
        fields = struct.dtype.fields
        assert fields is not None
        lines.append(f"result[{len(expected)}] = (int)sizeof({struct.name});")
        expected.append(struct.dtype.itemsize)
        for name, _ in struct.members:
            lines.append(
                f"result[{len(expected)}] = (int)((__private const char *)&of_{struct.name}.{name}"
                f" - (__private const char *)&of_{struct.name});"
            )
            expected.append(fields[name][1])
    declared = "\n".join(f"{struct.name} of_{struct.name};" for struct in structs)
    body = "\n".join(lines)
    kernel = variant_runtime.kernel_from_text(
        "layout",
        f"""__kernel void layout(__global int *restrict result, const int2 size)
        {{
            {declared}
            {body}
        }}
        """,
        structs=structs,
    )
    result = variant_runtime.empty(len(expected), np.int32)
    kernel.run("layout", (1, 1), grid=(1, 1), local=(1, 1), result=result)
    assert result.download().tolist() == expected


def test_every_member_arrives_in_the_kernel(
    variant_runtime: Runtime, structs: list[Struct]
) -> None:
    expected: list[float] = []
    lines, packed = [], {}
    for struct in structs:
        values = {}
        for name, _ in struct.members:
            lines.append(f"result[{len(expected)}] = (float)of_{struct.name}.{name};")
            values[name] = float(3 + 2 * len(expected))
            expected.append(values[name])
        packed[f"of_{struct.name}"] = struct.pack(values)
    arguments = ", ".join(f"const {struct.name} of_{struct.name}" for struct in structs)
    body = "\n".join(lines)
    kernel = variant_runtime.kernel_from_text(
        "members",
        f"""__kernel void members(__global float *restrict result, const int2 size,
                                  {arguments})
        {{
            {body}
        }}
        """,
        structs=structs,
    )
    result = variant_runtime.empty(len(expected), np.float32)
    kernel.run("members", (1, 1), grid=(1, 1), local=(1, 1), result=result, **packed)
    assert result.download().tolist() == expected


def test_a_missing_member_is_named() -> None:
    with pytest.raises(KeyError, match="b"):
        Struct("Two", floats("a", "b")).pack({"a": 1.0})


@pytest.mark.parametrize("margin", [(0, 0), (3, 5)])
def test_a_margin_shifts_the_camera_by_its_pixels(margin: tuple[int, int]) -> None:
    camera = Camera.from_intrinsics(50.0, 60.0, 30.0, 20.0, width=64, height=48)
    values, wider = camera_values(camera, margin), camera_values(camera.with_margin(margin))
    # The same numbers by two roads in float64; the largest is about 100.
    assert values == pytest.approx(wider, rel=1e-12)
    sx, sy, ox, oy = camera.pixel_to_view
    assert values["to_x"] * (10.5 + margin[1]) + values["at_x"] == pytest.approx(sx * 10.5 + ox)
    assert values["to_y"] * (20.5 + margin[0]) + values["at_y"] == pytest.approx(sy * 20.5 + oy)
    assert values["from_x"] * values["to_x"] == pytest.approx(1.0)
    assert values["perspective"] == 1.0
