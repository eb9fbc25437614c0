"""Signatures of kernels as drivers tell them, and arguments bound to them by name."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssgi_cl
from ssgi_cl.bench.built import builds
from ssgi_cl.core.errors import DeviceError, KernelSourceError
from ssgi_cl.device import sources
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.signature import ARGUMENT_INFO, PLANE, Parameter, Signature, _written
from ssgi_cl.device.structs import CAMERA, Struct, floats

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


def signature(runtime: Runtime, listed: str, macros: dict[str, int] | None = None) -> Signature:
    text = f"""#include "common/gbuffer.clh"
        __kernel void k({listed}) {{}}"""
    return runtime.kernel_from_text("k", text, macros, [CAMERA]).signature


@pytest.mark.parametrize(
    ("declaration", "expected"),
    [
        ("ssgi_plane depth", Parameter("depth", PLANE, memory=True)),
        ("__global const float *restrict a", Parameter("a", "float", memory=True)),
        ("__global int4 *a", Parameter("a", "int4", memory=True, written=True)),
        ("ssgi_optional __global int *restrict a", Parameter("a", "int", memory=True, written=True, optional=True)),
        ("__global const uchar *a", Parameter("a", "uchar", memory=True)),
        ("__global unsigned int *a", Parameter("a", "uint", memory=True, written=True)),
        ("const int2 size", Parameter("size", "int2")),
        ("const SsgiCamera camera /* a comment, (of two) */", Parameter("camera", "SsgiCamera")),
        ("const float step", Parameter("step", "float")),
        ("float x // of\n", Parameter("x", "float")),
    ],
)
def test_a_declaration_is_read(variant_runtime: Runtime, declaration: str, expected: Parameter) -> None:
    assert signature(variant_runtime, declaration) == Signature("k", (expected,))


@pytest.mark.parametrize("listed", ["", "void", " // nothing\n"])
def test_a_kernel_may_take_nothing(runtime: Runtime, listed: str) -> None:
    assert signature(runtime, listed).parameters == ()


@pytest.mark.parametrize(
    ("declaration", "message"),
    [
        ("__local float *a", r"kernel k has the parameter '__local float \*a'"),
        ("__constant float *a", r"kernel k has the parameter '__constant float \*a'"),
        ("__read_only image2d_t a", "kernel k has the parameter '__read_only image2d_t a'"),
        ("const sampler_t a", "const sampler_t a is of a type that the host can't pass"),
        ("const float4 a", "k: const float4 a is of a type that the host can't pass"),
        ("unsigned int a", "const uint a is of a type that the host can't pass"),
        ("ssgi_optional ssgi_plane a", "only a pointer to __global memory"),
        ("ssgi_optional int a", "only a pointer to __global memory"),
    ],
)
def test_what_the_host_cannot_pass_is_an_error(runtime: Runtime, declaration: str, message: str) -> None:
    with pytest.raises(KernelSourceError, match=message):
        signature(runtime, declaration)


def test_parameters_of_other_macros_are_absent(variant_runtime: Runtime) -> None:
    listed = """
        #if A > 1 && \\
            !defined(B)
            ssgi_plane r, // of two, or
        #else
            const int p,
            const float q,
        #endif
        const int last"""
    numbers = (Parameter("p", "int"), Parameter("q", "float"), Parameter("last", "int"))
    assert signature(variant_runtime, listed, {"A": 1}) == Signature("k", numbers, frozenset({"r"}))
    plane = (Parameter("r", PLANE, memory=True), Parameter("last", "int"))
    assert signature(variant_runtime, listed, {"A": 2}) == Signature("k", plane, frozenset({"p", "q"}))


class Silent:
    """A kernel of a driver that keeps no information on arguments."""

    function_name, num_args = "k", 1

    def get_arg_info(self, number: int, what: int) -> Any:
        import pyopencl as cl

        raise cl.Error("clGetKernelArgInfo", cl.status_code.KERNEL_ARG_INFO_NOT_AVAILABLE, "")


def test_a_driver_without_the_information_is_an_error() -> None:
    with pytest.raises(DeviceError, match=r"kernel k: the driver does not tell .*-cl-kernel-arg-info"):
        Signature.of(Silent(), "__kernel void k(int a) {}")


def test_a_program_from_a_binary_tells_the_same(runtime: Runtime) -> None:
    import pyopencl as cl

    kernel = combine(runtime)
    program = kernel._kernel.get_info(cl.kernel_info.PROGRAM)
    binaries = program.get_info(cl.program_info.BINARIES)
    again = cl.Program(runtime.context, [runtime.device], binaries).build(options=[ARGUMENT_INFO])
    assert Signature.of(cl.Kernel(again, "combine"), TEXT) == kernel.signature


# ---- every kernel


@pytest.fixture(scope="module")
def structs() -> list[Struct]:
    """All structs that the library passes to kernels; they are constants of its modules."""
    found = {}
    for folder in ("device", "techniques", "rasterize.raster"):
        package = importlib.import_module(f"ssgi_cl.{folder}")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            constants = vars(importlib.import_module(module.name)).values()
            found.update({id(struct): struct for struct in constants if isinstance(struct, Struct)})
    return list(found.values())


def test_every_kernel_takes_its_size_and_known_types(structs: list[Struct]) -> None:
    assert len({struct.name for struct in structs}) == len(structs)
    values = "|".join(("float", "int", "int2", *(struct.name for struct in structs)))
    memory = r"(ssgi_optional )?__global (const )?(float|int|uint|uchar)[248]? \*(restrict )?"
    known = re.compile(rf"(ssgi_plane |{memory}|const ({values}) )\w+")
    # `Kernel.run` has options of these names.
    options = {*inspect.getfullargspec(Kernel.run).kwonlyargs}
    assert {"grid", "region"} <= options
    for path in sources.kernel_names():
        declared = _written(Path(path).stem, sources.flatten(path))
        assert declared["size"] == "const int2 size", path
        assert not options & declared.keys(), path
        assert [text for text in declared.values() if not known.fullmatch(text)] == [], path


def test_every_kernel_is_named_by_the_library() -> None:
    root = Path(ssgi_cl.__file__).parent
    files = (*root.rglob("*.py"), *Path(str(ssgi_cl.rasterize.__file__)).parent.rglob("*.py"))
    words = {word for file in files for word in re.findall(r"\w+", file.read_text("utf-8"))}
    assert {Path(path).stem for path in sources.kernel_names()} <= words


@pytest.mark.slow
def test_every_technique_binds_every_kernel(runtime: Runtime, structs: list[Struct]) -> None:
    # `Kernel.run` checks each launch of theirs.
    made = builds(runtime)
    assert sorted({build.path for build in made}) == sources.kernel_names()
    assert {struct for build in made for struct in build.structs} <= {*structs}


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
        combine(variant_runtime).run((2, 16), **{name: wanted[name] for name in names})
        found = wanted["result"].download().tolist()
        # (rows, columns) becomes (columns, rows).
        assert found == [7.0, 4.0, 3.0, 2.5, 3.5, 9.0, 16.0]


def test_optional_memory_may_be_absent(variant_runtime: Runtime) -> None:
    wanted = {**arguments(variant_runtime), "rest": None, "count": 2}
    combine(variant_runtime).run((2, 16), **wanted)
    assert wanted["result"].download()[5] == -1.0


def test_none_stands_for_a_parameter_that_the_macros_remove(runtime: Runtime) -> None:
    wanted = arguments(runtime)
    combine(runtime).run((2, 16), more=None, **wanted)
    combine(runtime, more=1).run((2, 16), more=wanted["read"], **wanted)
    with pytest.raises(TypeError, match=r"more \(a Plane .*\) is a parameter with other macros"):
        combine(runtime).run((2, 16), more=wanted["read"], **wanted)
    with pytest.raises(TypeError, match=r"combine: more is None .* expected a Plane"):
        combine(runtime, more=1).run((2, 16), more=None, **wanted)


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
            "pair is the struct SsgiCamera of 48 bytes: expected the struct Pair of 8 bytes",
        ),
        ("pair", (1.0, 2), r"pair is \(1.0, 2\) \(tuple\): expected the struct Pair"),
    ],
)
def test_an_argument_of_another_type_is_named(runtime: Runtime, name: str, value: Any, message: str) -> None:
    wanted = arguments(runtime)
    given = {"array": wanted["rest"], "plane": wanted["read"]}.get(value, value) if isinstance(value, str) else value
    with pytest.raises(TypeError, match=message):
        combine(runtime).run((2, 16), **{**wanted, name: given})


def test_missing_and_unknown_arguments_are_named(runtime: Runtime) -> None:
    wanted = arguments(runtime)
    kernel = combine(runtime)
    for name in wanted:
        rest = {key: value for key, value in wanted.items() if key != name}
        with pytest.raises(TypeError, match=f"kernel combine: {name} is missing: expected .*"):
            kernel.run((2, 16), **rest)
        with pytest.raises(TypeError, match=r"kernel combine: x\w+ .* is not a parameter"):
            kernel.run((2, 16), **rest, **{f"x{name}": wanted[name]})
    for extra in (1, None):
        with pytest.raises(TypeError, match=rf"combine: extra \({extra} .*is not a parameter"):
            kernel.run((2, 16), **wanted, extra=extra)


def test_numbers_of_numpy_are_numbers(runtime: Runtime) -> None:
    wanted = arguments(runtime)
    wanted |= {"count": np.int64(5), "scale": np.float64(0.5), "other": (np.int32(3), 4)}
    combine(runtime).run((2, 16), **wanted)
    assert wanted["result"].download()[1:4].tolist() == [4.0, 3.0, 2.5]
    combine(runtime).run((2, 16), **{**wanted, "scale": 2})
    assert wanted["result"].download()[3] == 10.0


# ---- structs of the library


def test_every_member_arrives_in_the_kernel(variant_runtime: Runtime, structs: list[Struct]) -> None:
    # The compiler's layout is that of numpy, then.
    expected: list[float] = []
    lines, packed = [], {}
    for struct in structs:
        lines.append(f"result[{len(expected)}] = (float)sizeof({struct.name});")
        expected.append(struct.dtype.itemsize)
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
    kernel.run((1, 1), grid=(1, 1), local=(1, 1), result=result, **packed)
    assert result.download().tolist() == expected
