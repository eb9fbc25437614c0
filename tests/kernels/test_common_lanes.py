"""kernels/common/lanes.clh, function by function, in every form and on every implementation."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import drivers
from ssgi_cl.device.runtime import Runtime

from .expression import run_expressions

LANES = "common/lanes.clh"
SOME = np.array([0.0, -0.0, 0.25, -0.25, 1.0, -1.0, 1.5, -1.5, 2.0, -3e7, 3e7, 1e-30, -1e30, 7.0])
SOME_INTS = np.array([0, -1, 1, 7, -7, 2**31 - 1, -(2**31), 65536, 5, 5, -3, 12], np.int32)
TRUE, FALSE = -1, 0


def pairs(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Every pair of the values."""
    first, second = np.meshgrid(values, values)
    return first.ravel(), second.ravel()


def bits(values: NDArray[Any]) -> NDArray[np.int32]:
    return np.ascontiguousarray(values, np.float32).view(np.int32)


def fused(a: NDArray[np.float32], b: NDArray[np.float32], c: NDArray[np.float32]) -> NDArray[np.float32]:
    """a * b + c rounded once (Boldo and Melquiond 2008: round to odd, then to float32)."""
    product = a.astype(np.float64) * b.astype(np.float64)  # exact: 48 bits
    wide = c.astype(np.float64)
    total = product + wide
    part = total - product
    error = (product - (total - part)) + (wide - part)  # Knuth's exact error of the sum
    even = (total.view(np.int64) & 1) == 0
    towards = np.where(error > 0, np.inf, -np.inf)
    odd = np.where((error != 0) & even, np.nextafter(total, towards), total)
    return odd.astype(np.float32)


def divides_exactly(runtime: Runtime) -> bool:
    """Return whether the device promises correctly rounded division and square root."""
    return runtime.info.kind == "cpu"


@pytest.fixture(scope="session", params=[1, 8, 16])
def every_width(request: pytest.FixtureRequest) -> Runtime:
    """The device under test with each number of lanes that it takes; storage does not matter here."""
    try:
        return Runtime.open(lanes=request.param, storage="buffer")
    except DeviceError as error:
        pytest.skip(str(error))


# Programs of many expressions, each built once for a width: a test gives its own numbers and looks
# at those results that it is about.
FLOATS = {
    "sum": "x + y",
    "difference": "x - y",
    "product": "x * y",
    "quotient": "x / y",
    "root": "v_sqrt(v_abs(x))",
    "fused": "v_fma(x, y, z)",
    "not fused": "x * y + z",
    "1 / root": "v_rsqrt(v_abs(x))",
    "splat": "v_splat(0.1f)",
    "select": "v_select(x, y, v_lt(x, y))",
    "sum of lanes": "v_splat(v_sum(x))",
    "largest": "v_splat(v_largest(x))",
    "min": "v_min(x, y)",
    "max": "v_max(x, y)",
    "clamp": "v_clamp(x, -1.25f, 7.5f)",
    "abs": "v_abs(x)",
    "floor": "v_floor(x)",
    "copysign": "v_copysign(x, y)",
    "round": "v_round(x)",
}
FUNCTIONS = {
    "exp2": "v_exp2(x)",
    "weight": "v_exp2_weight(x)",
    "exp": "v_exp(x)",
    "log2": "v_log2(x)",
    "pow": "v_pow(x, y)",
    "quick root": "v_rsqrt_quick(x)",
    "acos": "v_acos(x)",
}
FLOATS_TO_INTS = {
    **{name: f"v_{name}(x, y)" for name in ("lt", "le", "gt", "ge", "eq", "ne")},
    "not": "~v_lt(x, v_splat(0.0f))",
    "and": "v_lt(x, v_splat(0.0f)) & v_lt(y, v_splat(0.0f))",
    "or": "v_lt(x, v_splat(0.0f)) | v_lt(y, v_splat(0.0f))",
    "xor": "v_lt(x, v_splat(0.0f)) ^ v_lt(y, v_splat(0.0f))",
    "any": "v_splat_int(v_any(v_gt(x, v_splat(0.0f))) ? 1 : 0)",
    "all": "v_splat_int(v_all(v_gt(x, v_splat(0.0f))) ? 1 : 0)",
    "cast": "v_to_int(x)",
    "floor": "v_floor_to_int(x)",
    "bits": "v_bits(x)",
}
WITHIN = (1, 7, 65536, 2**31 - 1)
INTS = {
    "splat": "v_splat_int(-7)",
    "iota": "v_iota()",
    **{name: f"v_{name}(i, j)" for name in ("ilt", "ile", "igt", "ige", "ieq", "ine")},
    "select": "v_iselect(i, j, ~v_ilt(i, j))",
    "largest": "v_splat_int(v_ilargest(i))",
    "imin": "v_imin(i, j)",
    "imax": "v_imax(i, j)",
    "iclamp": "v_iclamp(i, -3, 6)",
    "right": "v_shift_right(i, j & 31)",
    "count": "v_count_bits(i)",
    **{f"within {count}": f"v_within(i, {count})" for count in WITHIN},
}


def results(
    runtime: Runtime,
    expressions: dict[str, str],
    x: NDArray[Any],
    y: NDArray[Any] | None = None,
    z: NDArray[Any] | None = None,
) -> dict[str, NDArray[Any]]:
    """Return what each of FLOATS, FUNCTIONS, FLOATS_TO_INTS or INTS gives; y and z are x or given."""
    y, z = x if y is None else y, x if z is None else z
    if expressions is INTS:
        return run_expressions(runtime, LANES, INTS, returns="vint", i=x, j=y)
    returns = "vint" if expressions is FLOATS_TO_INTS else "vfloat"
    return run_expressions(runtime, LANES, expressions, returns=returns, x=x, y=y, z=z)


def operands(rng: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    """Numbers of both signs and of many sizes, whose products and quotients are normal."""
    count = 4096
    x, y = (rng.choice([-1, 1], count) * np.exp2(rng.uniform(-40, 40, count)) for _ in range(2))
    near = -x * y * (1 + rng.uniform(-1e-6, 1e-6, count))  # where rounding once or twice differs
    return {name: v.astype(np.float32) for name, v in (("x", x), ("y", y), ("z", near))}


def assert_masks(result: dict[str, NDArray[Any]], expected: dict[str, NDArray[np.bool_]]) -> None:
    for name, values in expected.items():
        np.testing.assert_array_equal(result[name], np.where(values, TRUE, FALSE), err_msg=name)


def test_arithmetic_rounds_as_ieee_754_says(every_width: Runtime, rng: np.random.Generator) -> None:
    given = operands(rng)
    x, y, z = given["x"], given["y"], given["z"]
    result = results(every_width, FLOATS, x, y, z)
    expected = {"sum": x + y, "difference": x - y, "product": x * y, "fused": fused(x, y, z), "not fused": x * y + z}
    for name, values in expected.items():
        np.testing.assert_array_equal(bits(result[name]), bits(values), err_msg=name)
    # The numbers tell the two apart.
    assert (expected["fused"] != expected["not fused"]).mean() > 0.5
    one = np.float32(1)
    rounded = {"quotient": x / y, "root": np.sqrt(np.abs(x)), "1 / root": one / np.sqrt(np.abs(x))}
    for name, values in rounded.items():
        # OpenCL allows 2.5 (division) and 3 (square root) units in the last place; CPUs are exact.
        error = np.abs(bits(result[name]).astype(np.int64) - bits(values))
        assert error.max() <= (0 if divides_exactly(every_width) else 6), name


def test_every_width_gives_bit_identical_results(every_width: Runtime, rng: np.random.Generator) -> None:
    x, y, z = operands(rng).values()
    some = np.minimum(np.abs(x), np.float32(1.0))
    plain = Runtime.open(lanes=1, storage="buffer")
    across = {"sum of lanes", "largest"}  # of as many lanes as there are
    for names, expressions, given in (
        (FLOATS.keys() - across, FLOATS, (x, y, z)),
        ({"exp2", "weight", "exp"}, FUNCTIONS, (x, y, z)),
        ({"log2", "quick root"}, FUNCTIONS, (np.abs(x), y, z)),
        ({"pow", "acos"}, FUNCTIONS, (some, np.abs(y), z)),
    ):
        here, there = (results(runtime, expressions, *given) for runtime in (every_width, plain))
        for name in names:
            np.testing.assert_array_equal(bits(here[name]), bits(there[name]), err_msg=name)


def test_splat_and_iota_fill_the_lanes(every_width: Runtime) -> None:
    zeros = np.zeros(32, np.float32)
    assert (results(every_width, FLOATS, zeros)["splat"] == np.float32(0.1)).all()
    whole = results(every_width, INTS, zeros.astype(np.int32))
    assert (whole["splat"] == -7).all()
    np.testing.assert_array_equal(whole["iota"], np.arange(32) % every_width.variant.lanes)


def test_masks_of_floats_are_0_or_all_bits_and_choose(every_width: Runtime) -> None:
    x, y = pairs(np.array([*SOME, np.inf, -np.inf, np.nan], np.float32))
    expected = {"lt": x < y, "le": x <= y, "gt": x > y, "ge": x >= y, "eq": x == y, "ne": x != y}
    p, q = x < 0, y < 0
    expected |= {"not": ~p, "and": p & q, "or": p | q, "xor": p ^ q}
    assert_masks(results(every_width, FLOATS_TO_INTS, x, y), expected)
    chosen = results(every_width, FLOATS, x, y)["select"]
    np.testing.assert_array_equal(chosen, np.where(x < y, y, x))


def test_integers_are_as_in_numpy(every_width: Runtime) -> None:
    i, j = pairs(SOME_INTS)
    result = results(every_width, INTS, i, j)
    expected = {"ilt": i < j, "ile": i <= j, "igt": i > j, "ige": i >= j, "ieq": i == j, "ine": i != j}
    expected |= {f"within {count}": (i >= 0) & (count > i) for count in WITHIN}
    assert_masks(result, expected)
    unsigned = i.view(np.uint32)
    values = {
        "select": np.where(i < j, i, j),
        "imin": np.minimum(i, j),
        "imax": np.maximum(i, j),
        "iclamp": np.clip(i, -3, 6),
        "right": (unsigned >> (j & 31).astype(np.uint32)).view(np.int32),
        "count": [int(value).bit_count() for value in unsigned],
    }
    for name, wanted in values.items():
        np.testing.assert_array_equal(result[name], wanted, err_msg=name)


def test_any_and_all_look_at_every_lane(every_width: Runtime) -> None:
    # Blocks of 16 lanes with every number of set lanes, at either end.
    x = np.concatenate(
        [np.where(np.arange(16) < n, 1, -1) for n in range(17)]
        + [np.where(np.arange(16) >= n, 1, -1) for n in range(17)]
    ).astype(np.float32)
    result = results(every_width, FLOATS_TO_INTS, x)
    lanes = every_width.variant.lanes
    blocks = (x > 0).reshape(-1, lanes)
    np.testing.assert_array_equal(result["any"], np.repeat(blocks.any(axis=1), lanes))
    np.testing.assert_array_equal(result["all"], np.repeat(blocks.all(axis=1), lanes))


def test_sums_and_maxima_of_the_lanes_have_one_order(every_width: Runtime, rng: np.random.Generator) -> None:
    x = (rng.standard_normal(1024) * np.exp2(rng.uniform(-20, 20, 1024))).astype(np.float32)
    i = rng.integers(-(2**31), 2**31, 1024, dtype=np.int64).astype(np.int32)
    lanes = every_width.variant.lanes
    result = results(every_width, FLOATS, x)
    halves = x.reshape(-1, lanes)
    while halves.shape[1] > 1:  # the first half of the lanes plus the second, over and over
        middle = halves.shape[1] // 2
        halves = halves[:, :middle] + halves[:, middle:]
    np.testing.assert_array_equal(result["sum of lanes"], np.repeat(halves[:, 0], lanes))
    np.testing.assert_array_equal(result["largest"], np.repeat(x.reshape(-1, lanes).max(axis=1), lanes))
    whole = results(every_width, INTS, i)["largest"]
    np.testing.assert_array_equal(whole, np.repeat(i.reshape(-1, lanes).max(axis=1), lanes))


def test_floats_are_as_in_numpy(every_width: Runtime) -> None:
    x, y = pairs(np.array([*SOME, np.inf, -np.inf], np.float32))
    result = results(every_width, FLOATS, x, y)
    expected = {
        "min": np.minimum(x, y),
        "max": np.maximum(x, y),
        "clamp": np.clip(x, -1.25, 7.5),
        "abs": np.abs(x),
        "floor": np.floor(x),
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(result[name], values, err_msg=name)
    # The sign of zeros too.
    np.testing.assert_array_equal(bits(result["copysign"]), bits(np.copysign(x, y)))


def test_floats_and_integers_convert(every_width: Runtime) -> None:
    x = np.array([0.0, -0.0, 0.9, -0.9, 1.5, -1.5, -2.0, 16777216.0, -1e9, 1e9], np.float32)
    result = results(every_width, FLOATS_TO_INTS, x)
    np.testing.assert_array_equal(result["cast"], x.astype(np.int32))  # towards 0
    np.testing.assert_array_equal(result["floor"], np.floor(x).astype(np.int32))
    np.testing.assert_array_equal(result["bits"], bits(x))


def test_integers_become_floats_and_places_of_floats(every_width: Runtime, rng: np.random.Generator) -> None:
    reals = rng.standard_normal(64).astype(np.float32)
    i = np.concatenate([SOME_INTS, rng.integers(0, 64, 200, dtype=np.int32)])
    expressions = {"number": "v_to_float(i)", "bits": "v_from_bits(i & 0x3fffffff)", "gather": "v_gather(t, i & 63)"}
    floats = run_expressions(every_width, LANES, expressions, tables={"t": reals}, i=i)
    np.testing.assert_array_equal(floats["number"], i.astype(np.float32))
    np.testing.assert_array_equal(bits(floats["bits"]), i & 0x3FFFFFFF)
    np.testing.assert_array_equal(floats["gather"], reals[i & 63])
    whole = rng.integers(-(2**31), 2**31, 64, dtype=np.int64).astype(np.int32)
    places = {"gather": "v_igather(t, i & 63)"}
    found = run_expressions(every_width, LANES, places, returns="vint", tables={"t": whole}, i=i)
    np.testing.assert_array_equal(found["gather"], whole[i & 63])


@pytest.mark.parametrize("shift", [0, 1, 3])
def test_loads_and_stores_need_no_alignment(every_width: Runtime, shift: int) -> None:
    lanes = every_width.variant.lanes
    kernel = every_width.kernel_from_text(
        "move",
        f"""#include "{LANES}"
        __kernel void move(__global const float *restrict x, __global const int *restrict i,
                           __global float *restrict y, __global int *restrict j, const int2 size,
                           const int shift)
        {{
            const int at = (int)get_global_id(0) * SSGI_LANES + shift;
            v_store(v_load(x + at), y + at);
            v_istore(v_iload(i + at), j + at);
        }}
        """,
    )
    x, i = np.arange(64, dtype=np.float32) + 0.5, np.arange(64, dtype=np.int32) - 32
    y, j = np.full_like(x, -1), np.full_like(i, -1)
    to = [every_width.array(y), every_width.array(j)]
    kernel.run((1, 32), local=(1, 1), x=every_width.array(x), i=every_width.array(i), y=to[0], j=to[1], shift=shift)
    moved = slice(shift, shift + 32)
    y[moved], j[moved] = x[moved], i[moved]
    assert 32 % lanes == 0
    np.testing.assert_array_equal(to[0].download(), y)
    np.testing.assert_array_equal(to[1].download(), j)


def spread(rng: np.random.Generator, low: float, high: float) -> NDArray[np.float32]:
    """Numbers from all of a range, its ends and whole numbers among them."""
    whole = np.arange(np.ceil(low), np.floor(high) + 1)
    return np.concatenate([[low, high], whole, rng.uniform(low, high, 200_000)]).astype(np.float32)


# The bounds below are those that lanes.clh states.


def test_powers_and_roots_are_as_accurate_as_they_say(every_width: Runtime, rng: np.random.Generator) -> None:
    roots = np.exp2(rng.uniform(-125, 127, 4096)).astype(np.float32)
    for name, x, exact, most in (
        ("exp2", spread(rng, -126, 126), np.exp2, 2.5e-7),
        ("exp", spread(rng, -87, 87), np.exp, 2.5e-7),
        ("weight", spread(rng, -126, 0), np.exp2, 1e-4),
        ("quick root", roots, lambda x: x**-0.5, 2e-6),
    ):
        result, truth = results(every_width, FUNCTIONS, x)[name], exact(x.astype(np.float64))
        assert np.abs(result.astype(np.float64) / truth - 1.0).max() < most, name
        if name == "exp2":
            whole = x == np.floor(x)
            np.testing.assert_array_equal(result[whole], truth[whole])
        if name == "weight":
            assert (result[x == 0] == 1.0).all()
            assert result.max() == 1.0


def test_log2_is_as_accurate_as_it_says(every_width: Runtime, rng: np.random.Generator) -> None:
    x = np.concatenate([np.exp2(spread(rng, -125.9, 127.9)), spread(rng, 0.5, 2.0)])
    result = results(every_width, FUNCTIONS, x)["log2"].astype(np.float64)
    truth = np.log2(x.astype(np.float64))
    rounding = 0.5 * np.spacing(np.abs(truth).astype(np.float32))
    assert (np.abs(result - truth) - rounding).max() < 3e-7


def test_pow_is_as_accurate_as_it_says(every_width: Runtime, rng: np.random.Generator) -> None:
    x = np.exp2(rng.uniform(-20, 99, 200_000)).astype(np.float32)
    y = np.exp2(rng.uniform(-6, 8, x.size)).astype(np.float32)
    power = y.astype(np.float64) * np.log2(x.astype(np.float64))
    inside = np.abs(power) < 125.9  # beyond, it is clamped
    x, y, power = x[inside], y[inside], power[inside]
    result = results(every_width, FUNCTIONS, x, y)["pow"].astype(np.float64)
    error = np.abs(result / np.exp2(power) - 1.0)
    assert (error - 2e-7 * np.abs(power)).max() < 3e-7
    assert np.abs(result - np.exp2(power))[x <= 1].max() < 2e-7


def test_acos_is_as_accurate_as_it_says(every_width: Runtime, rng: np.random.Generator) -> None:
    ends = np.array([-1.0, -0.0, 0.0, 1.0, np.nextafter(np.float32(1), np.float32(0))])
    x = np.concatenate([ends, rng.uniform(-1, 1, 4000), 1 - 10.0 ** rng.uniform(-7, 0, 500)])
    x = x.astype(np.float32)
    a = results(every_width, FUNCTIONS, x)["acos"]
    assert np.abs(a - np.arccos(x.astype(np.float64))).max() < 5e-7
    assert a[3] == 0.0


def test_whole_numbers_are_rounded_to_and_ties_go_to_even(every_width: Runtime, rng: np.random.Generator) -> None:
    x = np.concatenate([np.arange(-4, 4.5, 0.5), rng.uniform(-(2.0**21), 2.0**21, 500)])
    x = x.astype(np.float32)
    a = results(every_width, FLOATS, x)["round"]
    np.testing.assert_array_equal(a, np.rint(x))


def test_arguments_beyond_the_range_are_clamped(every_width: Runtime) -> None:
    x = np.array([-np.inf, -1e30, -127.0, 127.0, 1e30, np.inf], np.float32)
    result = results(every_width, FUNCTIONS, x)
    low, high = 2.0**-126, 2.0**126
    np.testing.assert_array_equal(result["exp2"], [low] * 3 + [high] * 3)
    np.testing.assert_array_equal(result["weight"], [low] * 3 + [1.0] * 3)
    ends = np.exp([-87.0] * 3 + [87.0] * 3)
    np.testing.assert_allclose(result["exp"], ends, rtol=2.5e-7)  # its stated accuracy
    # A power of nothing is nothing; the last one's logarithm is clamped to -126.
    x = np.array([0.0, 1e-38, 0.0, 1.0, 1.0, 1e-30], np.float32)
    y = np.array([0.1, 1.0, 100.0, 0.1, 100.0, 100.0], np.float32)
    result = results(every_width, FUNCTIONS, x, y)
    np.testing.assert_array_equal(result["pow"], [0.0, 0.0, 0.0, 1.0, 1.0, np.float32(low)])


@pytest.mark.slow
def test_every_other_implementation_passes_these_tests(runtime: Runtime) -> None:
    others = [info for info in drivers.devices() if info.driver != runtime.info.driver]
    for info in others:
        if info.best is None:
            continue
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-m", "not slow", os.path.dirname(__file__)],
            env={**os.environ, "OCL_ICD_VENDORS": info.driver, "SSGI_CL_DEVICE": info.label},
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        assert run.returncode == 0, f"{info.label}:\n{run.stdout[-8000:]}"
