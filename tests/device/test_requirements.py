"""What a device has to have is asked for, and what it lacks is named."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import sources
from ssgi_cl.device.requirements import OPTIONAL, check, facts
from ssgi_cl.device.runtime import Runtime

LEAST = {
    "version": "OpenCL 1.2 X",
    "opencl_c_version": "OpenCL C 1.2 X",
    "profile": "FULL_PROFILE",
    "available": True,
    "compiler_available": True,
    "endian_little": True,
    "max_work_group_size": 64,
    "local_mem_size": 32 << 10,
    "max_constant_buffer_size": 64 << 10,
    "max_parameter_size": 1024,
}
"""What OpenCL 1.2 guarantees, beside work-groups of 64."""


def device(**changes: Any) -> Any:
    return SimpleNamespace(**{**LEAST, **changes})


def test_the_least_that_opencl_guarantees_is_enough() -> None:
    check("X", device())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"version": "OpenCL 1.1 X"}, "X has OpenCL 1.1: expected 1.2 or later; install a newer driver"),
        ({"opencl_c_version": "OpenCL C 1.0"}, "X has OpenCL C 1.0: expected 1.2"),
        ({"opencl_c_version": "unknown"}, "X has OpenCL C 'unknown'"),
        ({"profile": "EMBEDDED_PROFILE"}, "EMBEDDED_PROFILE: expected FULL_PROFILE"),
        ({"available": False}, "X is not available"),
        ({"compiler_available": False}, "X has no compiler"),
        ({"endian_little": False}, "X is big-endian"),
        ({"max_work_group_size": 63}, "work-groups of at most 63 work-items: expected 64 or more"),
        ({"local_mem_size": 4096}, "4096 bytes of local memory: expected 8192 or more"),
        ({"max_constant_buffer_size": 8192}, "8192 bytes of constant memory: expected 16384"),
        ({"max_parameter_size": 512}, "512 bytes of arguments of a kernel: expected 1024"),
    ],
)
def test_what_is_missing_is_named(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(DeviceError, match=re.escape(said)):
        check("X", device(**changes))


def test_facts_go_into_reports(runtime: Runtime) -> None:
    found = facts(runtime.device)
    assert json.loads(json.dumps(found)) == found
    assert found["opencl"].startswith("OpenCL ")
    assert found["work_group"] >= 64
    assert set(found["extensions"]) <= set(OPTIONAL)


@pytest.mark.parametrize("name", sorted(sources.kernel_names()))
def test_no_kernel_takes_what_is_optional(name: str) -> None:
    """64-bit atomics, subgroups and double precision are optional in OpenCL 1.2 to 3.0, and no kernel has them."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", sources.flatten(name), flags=re.DOTALL)
    found = re.findall(
        r"\bdouble\d*\b|\batom_\w+|\bsub_group\w*|\bcl_khr_\w+|\bvload_half|\bpipe\b|\b__generic\b", text
    )
    assert found == []


@pytest.mark.parametrize(
    ("variable", "most", "works"), [("POCL_MAX_WORK_GROUP_SIZE", "64", True), ("POCL_MAX_WORK_GROUP_SIZE", "32", False)]
)
def test_small_work_groups_are_obeyed_or_refused(runtime: Runtime, variable: str, most: str, works: bool) -> None:
    if "pocl" not in runtime.info.label.lower():
        pytest.skip("only PoCL's limits can be lowered")
    script = (
        "from ssgi_cl.bench.every import inputs, results, TECHNIQUES\n"
        "from ssgi_cl.device.runtime import Runtime\nfrom ssgi_cl.device.drivers import DeviceInfo, KernelVariant\n"
        "import os, sys\nfrom ssgi_cl.device.process import load_driver\n"
        f"info = DeviceInfo({runtime.info.driver!r}, 0, 0, '', 'gpu', 1)\n"
        "load_driver(info)\nrt = Runtime(DeviceInfo('', 0, 0, 'X', 'gpu', 1), KernelVariant(1, 'buffer'))\n"
        "assert rt.device.max_work_group_size == int(sys.argv[1])\n"
        "results(inputs(rt, (12, 16), 8), rt, ['drawing', 'ssao', 'vpl splatting', 'multiresolution splatting'])\n"
    )
    environment = {**os.environ, variable: most}
    done = subprocess.run(
        [sys.executable, "-c", script, most], env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode == 0) == works, done.stderr
    if not works:
        assert "expected 64 or more" in done.stderr
