"""A C compiler's warnings about the kernels; `make lint` runs this, and `make test` doesn't."""

from __future__ import annotations

import shutil
import subprocess
from importlib.resources import as_file, files
from pathlib import Path

import pytest

from ssgi_cl.bench.built import builds
from ssgi_cl.device import sources
from ssgi_cl.device.constants import definitions
from ssgi_cl.device.drivers import KERNEL_VARIANTS
from ssgi_cl.device.programs import defines
from ssgi_cl.device.runtime import Runtime

from .device.test_kernel_files import is_guarded, text_of

WARNINGS = [
    "-Weverything",
    "-Werror",
    "-Wno-unused-parameter",  # a kernel keeps its arguments whatever its switches say
    "-Wno-unused-macros",  # and so does a file its macros
    "-Wno-declaration-after-statement",  # forbidden before C99
    "-Wno-comma",  # takes a vector's literal for the operator
    "-Wno-float-equal",  # comparisons with what was stored as it is
    "-Wno-padded",  # of structs that stay in registers; the host's have no padding
    "-Wno-bad-function-cast",  # of floor() and its kin, whose results are whole
    "-Wno-missing-variable-declarations",  # a sampler can't be static
]


@pytest.mark.parametrize("path", sources.kernel_names())
def test_clang_has_no_warning_about_a_kernel(path: str, runtime: Runtime, tmp_path: Path) -> None:
    clang = shutil.which("clang-15")
    if clang is None:
        pytest.skip("clang-15 is not installed")
    prelude = tmp_path / "generated.h"
    # Included, not flattened, so that functions unused in the kernel's own file are found.
    with as_file(files("ssgi_cl.kernels")) as folder:
        for build in (build for build in builds(runtime) if build.path == path):
            generated = definitions(sources.flatten(path))
            generated += [struct.text for struct in build.structs]
            prelude.write_text("\n".join(generated) + "\n")
            for variant in KERNEL_VARIANTS:
                options = defines(variant, build.macros, 2048)
                done = subprocess.run(
                    [
                        clang,
                        "-x",
                        "cl",
                        "-cl-std=CL1.2",
                        "-Xclang",
                        "-finclude-default-header",
                        "-fsyntax-only",
                        *WARNINGS,
                        f"-I{folder}",
                        "-include",
                        str(prelude),
                        *(f"-D{name}={value}" for name, value in options.items()),
                        str(folder / path),
                    ],
                    capture_output=True,
                    text=True,
                    check=False,
                )
                assert done.returncode == 0, f"{variant}, {build.macros}:\n{done.stderr}"


def test_a_kernel_refuses_to_build_without_its_macros_and_explains_them(runtime: Runtime) -> None:
    for build in builds(runtime):
        header = text_of(build.path).split("\n\n", 1)[0]
        for macro in build.macros:
            assert is_guarded(macro, sources.flatten(build.path)), (build.path, macro)
            assert macro in header, f"{macro} is not in the header comment of {build.path}"
