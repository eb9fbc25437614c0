"""Signatures of kernels read from their text, and arguments bound to them by name."""

from __future__ import annotations

import inspect
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ssgi_cl.core.errors import KernelSourceError
from ssgi_cl.device import sources
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.signature import PLANE, Parameter, Signature
from ssgi_cl.device.structs import CAMERA, Struct, floats

from ..launches import Build, builds

PAIR = Struct("Pair", (*floats("first"), ("second", "int")))
REFERENCE = Struct("Twin", PAIR.members)

TEXT = """
#include "common/gbuffer.clh"
__kernel void combine(ssgi_plane read, __global const int *restrict numbers,
#if WITH_MORE
                      ssgi_plane more,
#endif
                      ssgi_optional __global const float *restrict rest, // may be absent
                      __global float *restrict result, const int2 size, const int2 other,
                      const int count, const float scale, const Pair pair)
{
    if (get_global_id(0) == 0 && get_global_id(1) == 0) {
        result[0] = (float)numbers[0];
        result[1] = (float)other.x;
        result[2] = (float)other.y;
        result[3] = (float)count * scale;
        result[4] = pair.first + (float)pair.second;
        result[5] = count > 2 ? rest[0] : -1.0f;
        result[6] = (float)size.x;
    }
}
"""

# ---- what is read


@pytest.mark.parametrize(
    ("declaration", "expected"),
    [
        ("ssgi_plane depth", Parameter("depth", PLANE, memory=True)),
        ("__global const float *restrict a", Parameter("a", "float", memory=True)),
        ("__global int4 *a", Parameter("a", "int4", memory=True, written=True)),
        ("ssgi_optional __global int *restrict a", Parameter("a", "int", memory=True, written=True, optional=True)),
        ("const int2 size", Parameter("size", "int2")),
        ("const SsgiCamera camera /* a comment, (of two) */", Parameter("camera", "SsgiCamera")),
        ("float x // of\n", Parameter("x", "float")),
    ],
)
def test_a_declaration_is_read(declaration: str, expected: Parameter) -> None:
    found = Signature.of("k", f"__kernel void k({declaration}) {{ f(1, 2); }}", {})
    assert found == Signature("k", (expected,))


def test_a_kernel_may_take_nothing() -> None:
    for listed in ("", "void", " // nothing\n"):
        assert Signature.of("k", f"__kernel void k({listed})\n{{}}", {}).parameters == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("__kernel void other(int a) {}", "the text has no kernel k"),
        ("__kernel void k(__local float *a) {}", r"kernel k has the parameter '__local float \*a'"),
        ("__kernel void k(unsigned int a) {}", "kernel k has the parameter 'unsigned int a'"),
        ("__kernel void k(ssgi_optional ssgi_plane a) {}", "only a pointer to __global memory"),
        ("__kernel void k(\n#if A ? 1 : 0\nint a\n#endif\n) {}", r"condition #if A \? 1 : 0"),
        ("__kernel void k(\n#if (1\nint a\n#endif\n) {}", r"condition #if \(1"),
    ],
)
def test_what_is_not_understood_is_an_error(text: str, message: str) -> None:
    with pytest.raises(KernelSourceError, match=message):
        Signature.of("k", text, {})


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("7 - 4 - 3", False),
        ("16 / 4 / 2 == 2", True),
        ("7 % 4 * 2 == 6", True),
        ("-1 < 0 && !-0", True),
        ("1 || 0 && 0", True),
        ("!A == 0", True),
        ("010 == 8", True),
        ("1 + 2 * 3 == 7", True),
        ("A \\\n > 1", True),
        ("__has_builtin(f) + 1", True),
    ],
)
def test_conditions_are_those_of_c(condition: str, holds: bool) -> None:
    text = f"__kernel void k(\n#if {condition}\nint yes,\n#endif\nint last) {{}}"
    found = Signature.of("k", text, {"A": 2})
    assert len(found.parameters) == 1 + holds


TYPES = ("float", "int", "int2", "SsgiCamera")
PARAMETERS = st.one_of(
    st.builds(Parameter, st.just(""), st.just(PLANE), memory=st.just(True)),
    st.builds(
        Parameter,
        st.just(""),
        st.sampled_from(("float", "int", "uint", "int2")),
        memory=st.just(True),
        written=st.booleans(),
        optional=st.booleans(),
    ),
    st.builds(Parameter, st.just(""), st.sampled_from(TYPES)),
)
CONDITIONS = st.recursive(
    st.sampled_from(
        [
            ("1", 1),
            ("0", 0),
            ("A", 2),
            ("B", 0),
            ("C", 7),
            ("UNKNOWN", 0),
            ("0x10u", 16),
            ("defined(A)", 1),
            ("defined UNKNOWN", 0),
        ]
    ),
    lambda inner: st.one_of(
        st.tuples(inner).map(lambda a: (f"!({a[0][0]})", int(not a[0][1]))),
        st.tuples(inner, inner).map(lambda a: (f"({a[0][0]}) && {_wrapped(a[1])}", int(bool(a[0][1] and a[1][1])))),
        st.tuples(inner, inner).map(lambda a: (f"{_wrapped(a[0])} || ({a[1][0]})", int(bool(a[0][1] or a[1][1])))),
        st.tuples(inner, inner, st.sampled_from(["<", ">", "<=", ">=", "==", "!="])).map(
            lambda a: (f"{_wrapped(a[0])} {a[2]} {_wrapped(a[1])}", int(_compared(a[2], a[0][1], a[1][1])))
        ),
        st.tuples(inner, inner).map(lambda a: (f"{_wrapped(a[0])} + 3 * {_wrapped(a[1])}", a[0][1] + 3 * a[1][1])),
    ),
    max_leaves=6,
)
"""Conditions of the preprocessor, and their values with A = 2, B = 0 and C = 5 + A."""


def _wrapped(condition: tuple[str, int]) -> str:
    return condition[0] if condition[0].isalnum() else f"({condition[0]})"


def _compared(how: str, a: int, b: int) -> bool:
    return {"<": a < b, ">": a > b, "<=": a <= b, ">=": a >= b, "==": a == b, "!=": a != b}[how]


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(PARAMETERS, st.none() | CONDITIONS), min_size=1, max_size=8), st.booleans())
def test_generated_signatures_come_back(
    wanted: list[tuple[Parameter, tuple[str, int] | None]], otherwise: bool
) -> None:
    lines, expected, absent = [], [], set()
    for number, (made, condition) in enumerate(wanted):
        parameter = replace(made, name=f"p{number}")
        lines += [f"#if {condition[0]}"] if condition else []
        # The last one has no condition, as it has no comma behind it.
        lines += [f"    {parameter.declaration}, // number {number}, of {len(wanted)})"]
        if condition and otherwise:
            lines += ["#else", f"    const int q{number},"]
        lines += ["#endif"] if condition else []
        if condition is None or condition[1]:
            expected.append(parameter)
            absent |= {f"q{number}"} if condition and otherwise else set()
        else:
            absent.add(parameter.name)
            expected += [Parameter(f"q{number}", "int")] if otherwise else []
    body = "\n".join(lines)
    text = (
        f"#define C (5 + A)\n#ifdef NOT\n#define B 1\n#endif\n"
        f"__kernel void k(\n{body}\n    const int last)\n{{ return; }}\n"
    )
    found = Signature.of("k", text, {"A": 2, "B": 0})
    assert found.parameters == (*expected, Parameter("last", "int"))
    assert found.absent == absent


@pytest.mark.parametrize("path", sources.kernel_names())
def test_every_kernel_has_a_signature_of_known_types(path: str) -> None:
    name = path.rsplit("/", 1)[-1].removesuffix(".cl")
    found = Signature.of(name, sources.flatten(path), {"SSGI_LANES": 16, "SSGI_IMAGES": 0})
    names = [parameter.name for parameter in found.parameters]
    assert len(set(names)) == len(names)
    assert Parameter("size", "int2") in found.parameters
    # `Kernel.run` has options of these names.
    options = inspect.getfullargspec(Kernel.run).kwonlyargs
    assert {"grid", "region"} <= {*options}
    assert not {*options} & {*names, *found.absent}


# ---- every technique


def test_every_technique_binds_every_kernel(runtime: Runtime) -> None:
    # `Kernel.run` checks each launch of theirs.
    assert sorted({build.path for build in builds(runtime)}) == sources.kernel_names()


def compiled(runtime: Runtime, build: Build) -> Any:
    """Return the program of a kernel, built with information on its arguments."""
    import pyopencl as cl

    variant = runtime.variant
    defined = {
        "SSGI_LANES": variant.lanes,
        "SSGI_IMAGES": int(variant.storage == "image"),
        "SSGI_IMAGE_ROWS": 4096,
        **build.macros,
    }
    options = [f"-D{name}={value}" for name, value in defined.items()]
    text = sources.flatten(build.path, "\n".join(struct.text for struct in build.structs))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cl.Program(runtime.context, text).build(options=["-cl-std=CL1.2", "-cl-kernel-arg-info", *options])


@pytest.mark.slow  # compiles all kernels once more
def test_the_compiler_reads_the_same_signatures(runtime: Runtime) -> None:
    import pyopencl as cl

    info = cl.kernel_arg_info
    qualified = {cl.kernel_arg_address_qualifier.GLOBAL: True, cl.kernel_arg_address_qualifier.PRIVATE: False}
    # One of each of a kernel's signatures.
    different = {build.kernel.signature: build for build in builds(runtime)}
    for signature, build in different.items():
        parameters = signature.parameters
        kernel = cl.Kernel(compiled(runtime, build), signature.kernel)
        assert kernel.num_args == len(parameters), build.path
        for number, parameter in enumerate(parameters):
            try:
                name = kernel.get_arg_info(number, info.NAME)
            except cl.Error:
                pytest.skip("the driver keeps no information on kernels' arguments")
            # PoCL's own header makes `step`, a built-in function's name, a macro.
            assert name.removeprefix("_cl_") == parameter.name, build.path
            if runtime.variant.storage == "image" and parameter.type == PLANE:
                continue
            is_memory = qualified[kernel.get_arg_info(number, info.ADDRESS_QUALIFIER)]
            assert is_memory == parameter.memory, (build.path, name)
            expected = "float" if parameter.type == PLANE else parameter.type
            assert kernel.get_arg_info(number, info.TYPE_NAME).rstrip("*") == expected, name
            if parameter.memory:
                read = kernel.get_arg_info(number, info.TYPE_QUALIFIER)
                constant = bool(read & cl.kernel_arg_type_qualifier.CONST)
                assert constant != parameter.written, (build.path, name)


# ---- arguments


def combine(runtime: Runtime, more: int = 0) -> Kernel:
    return runtime.kernel_from_text("combine", TEXT, {"WITH_MORE": more}, [PAIR])


def arguments(runtime: Runtime) -> dict[str, Any]:
    return {
        "read": runtime.plane(1, (2, 16)),
        "numbers": runtime.array(np.array([7], np.int32)),
        "rest": runtime.array(np.array([9], np.float32)),
        "result": runtime.empty(7, np.float32),
        "other": (3, 4),
        "count": 5,
        "scale": 0.5,
        "pair": PAIR.pack({"first": 1.5, "second": 2}),
    }


def test_arguments_arrive_in_any_order(variant_runtime: Runtime) -> None:
    wanted = arguments(variant_runtime)
    for names in (list(wanted), list(wanted)[::-1]):
        combine(variant_runtime).run("combine", (2, 16), **{name: wanted[name] for name in names})
        found = wanted["result"].download().tolist()
        # (rows, columns) becomes (columns, rows).
        assert found == [7.0, 4.0, 3.0, 2.5, 3.5, 9.0, 16.0]


def test_parameters_of_one_type_may_change_places(runtime: Runtime) -> None:
    found = []
    for first, second in (("a", "b"), ("b", "a")):
        kernel = runtime.kernel_from_text(
            "divide",
            f"""__kernel void divide(__global const float *restrict {first},
                                     __global const float *restrict {second},
                                     __global float *restrict result, const int2 size)
            {{
                result[0] = a[0] / b[0];
            }}
            """,
        )
        result = runtime.empty(1, np.float32)
        kernel.run(
            "divide",
            (1, 1),
            grid=(1, 1),
            local=(1, 1),
            result=result,
            a=runtime.array(np.array([3.0], np.float32)),
            b=runtime.array(np.array([4.0], np.float32)),
        )
        found.append(result.download()[0])
    assert found == [0.75, 0.75]


def test_optional_memory_may_be_absent(variant_runtime: Runtime) -> None:
    wanted = {**arguments(variant_runtime), "rest": None, "count": 2}
    combine(variant_runtime).run("combine", (2, 16), **wanted)
    assert wanted["result"].download()[5] == -1.0


def test_none_stands_for_a_parameter_that_the_macros_remove(runtime: Runtime) -> None:
    wanted = arguments(runtime)
    combine(runtime).run("combine", (2, 16), more=None, **wanted)
    combine(runtime, more=1).run("combine", (2, 16), more=wanted["read"], **wanted)
    with pytest.raises(TypeError, match=r"more \(a Plane .*\) is a parameter with other macros"):
        combine(runtime).run("combine", (2, 16), more=wanted["read"], **wanted)
    with pytest.raises(TypeError, match=r"combine: more is None .* expected a Plane"):
        combine(runtime, more=1).run("combine", (2, 16), more=None, **wanted)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("read", "array", r"read is a DeviceArray of float32: expected a Plane \(ssgi_plane read"),
        ("read", None, r"read is None \(NoneType\): expected a Plane"),
        (
            "numbers",
            "array",
            r"numbers is a DeviceArray of float32: expected a DeviceArray of int32 "
            r"\(__global const int \*numbers\)",
        ),
        ("numbers", "plane", r"numbers is a Plane of 1 x \(2, 16\): expected a DeviceArray"),
        ("numbers", None, "numbers is None .*: expected a DeviceArray of int32 "),
        ("rest", 1.0, r"rest is 1.0 \(float\): expected a Plane or a DeviceArray of float32 or No"),
        ("result", np.zeros(7, np.float32), r"result is an array of float32 \(7,\)"),
        ("other", 3, r"other is 3 \(int\): expected \(rows, columns\) as a tuple of int"),
        ("other", (3, 4, 5), "other is .*: expected"),
        ("other", (3.0, 4), "other is .*: expected"),
        ("count", 5.0, r"kernel combine: count is 5.0 \(float\): expected an int in int32"),
        ("count", True, r"count is True \(bool\)"),
        ("count", 1 << 31, r"count is 2147483648 \(int\): expected an int in int32"),
        ("scale", "1", r"scale is '1' \(str\): expected a number \(const float scale\)"),
        ("scale", np.zeros(1, np.float32), "scale is an array"),
        (
            "pair",
            REFERENCE.pack({"first": 1.0, "second": 2}),
            "pair is the struct Twin of 8 bytes: expected the struct Pair of 8 bytes",
        ),
        (
            "pair",
            CAMERA.pack(dict.fromkeys(CAMERA.dtype.names or (), 0.0)),
            "pair is the struct SsgiCamera of 36 bytes: expected the struct Pair of 8 bytes",
        ),
        ("pair", (1.0, 2), r"pair is \(1.0, 2\) \(tuple\): expected the struct Pair"),
    ],
)
def test_an_argument_of_another_type_is_named(runtime: Runtime, name: str, value: Any, message: str) -> None:
    wanted = arguments(runtime)
    given = {"array": wanted["rest"], "plane": wanted["read"]}.get(value, value) if isinstance(value, str) else value
    with pytest.raises(TypeError, match=message):
        combine(runtime).run("combine", (2, 16), **{**wanted, name: given})


def test_missing_and_unknown_arguments_are_named(runtime: Runtime) -> None:
    wanted = arguments(runtime)
    kernel = combine(runtime)
    for name in wanted:
        rest = {key: value for key, value in wanted.items() if key != name}
        with pytest.raises(TypeError, match=f"kernel combine: {name} is missing: expected .*"):
            kernel.run("combine", (2, 16), **rest)
        with pytest.raises(TypeError, match=r"kernel combine: x\w+ .* is not a parameter"):
            kernel.run("combine", (2, 16), **rest, **{f"x{name}": wanted[name]})
    for extra in (1, None):
        with pytest.raises(TypeError, match=rf"combine: extra \({extra} .*is not a parameter"):
            kernel.run("combine", (2, 16), **wanted, extra=extra)


def test_numbers_of_numpy_are_numbers(runtime: Runtime) -> None:
    wanted = arguments(runtime)
    wanted |= {"count": np.int64(5), "scale": np.float64(0.5), "other": (np.int32(3), 4)}
    combine(runtime).run("combine", (2, 16), **wanted)
    assert wanted["result"].download()[1:4].tolist() == [4.0, 3.0, 2.5]
    combine(runtime).run("combine", (2, 16), **{**wanted, "scale": 2})
    assert wanted["result"].download()[3] == 10.0


def test_a_type_that_the_host_cannot_pass_is_an_error(runtime: Runtime) -> None:
    text = "__kernel void k(__global float *restrict a, const int2 size, const float4 b) {}"
    with pytest.raises(KernelSourceError, match="k: const float4 b is of a type that the"):
        runtime.kernel_from_text("k", text)
    text = "__kernel void k(__global float *restrict a, const Pair b) {}"
    with pytest.raises(Exception, match="Pair"):
        runtime.kernel_from_text("k", text)


# ---- structs of every technique


@pytest.fixture(scope="module")
def structs(runtime: Runtime) -> list[Struct]:
    """All structs that the library passes to kernels."""
    found = {struct.name: struct for build in builds(runtime) for struct in build.structs}
    return list(found.values())


def test_no_two_structs_have_one_name(runtime: Runtime) -> None:
    found = {struct for build in builds(runtime) for struct in build.structs}
    assert len({struct.name for struct in found}) == len(found)


def test_the_compilers_layout_is_that_of_numpy(variant_runtime: Runtime, structs: list[Struct]) -> None:
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


def test_every_member_arrives_in_the_kernel(variant_runtime: Runtime, structs: list[Struct]) -> None:
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
