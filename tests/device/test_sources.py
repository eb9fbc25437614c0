"""Kernel sources: the inventory, and includes put in place."""

from __future__ import annotations

from importlib.resources import files

import pytest

from ssgi_cl.core.errors import KernelSourceError
from ssgi_cl.device import sources


def test_the_inventory_has_kernels_and_no_includes() -> None:
    names = sources.kernel_names()
    assert "ssao/ssao.cl" in names
    assert names == sorted(names)
    assert all(name.endswith(".cl") and name.count("/") == 1 for name in names)


def test_every_include_comes_once_and_none_is_left() -> None:
    for name in sources.kernel_names():
        text = sources.flatten(name)
        assert "#include" not in text
        assert text.count("#ifndef SSGI_COMMON_LANES_CLH") <= 1


def test_line_directives_name_the_place_of_every_line() -> None:
    name, line, seen = "", 0, 0
    for text in sources.flatten("ssao/ssao.cl", "typedef int Generated;").splitlines():
        if text.startswith("#line "):
            _, number, quoted = text.split()
            name, line = quoted.strip('"'), int(number)
            continue
        if name != "generated":
            original = files("ssgi_cl.kernels").joinpath(*name.split("/")).read_text("utf-8")
            assert text == original.splitlines()[line - 1]
            seen += 1
        line += 1
    assert seen > 100


def test_generated_definitions_come_first() -> None:
    lines = sources.flatten("probe/probe_gather.cl", "typedef int A;\ntypedef int B;").splitlines()
    assert lines[:4] == ['#line 1 "generated"', "#define SSGI_GUARD 16", "typedef int A;", "typedef int B;"]
    # Constants that the text does not name are not defined.
    assert lines[4] == '#line 1 "probe/probe_gather.cl"'


def test_a_text_includes_files_like_a_file_does() -> None:
    text = '#include "common/lanes.clh"\n#include "common/gbuffer.clh"\nint a;\n'
    flat = sources.flatten_text(text, "mine")
    assert flat.count('#line 1 "common/lanes.clh"') == 1
    assert '#line 1 "common/gbuffer.clh"' in flat
    assert flat.endswith('#line 3 "mine"\nint a;\n')


def test_a_missing_file_is_named_with_the_place_that_wants_it() -> None:
    with pytest.raises(KernelSourceError, match=r"kernels/ssao/none\.cl does not exist"):
        sources.flatten("ssao/none.cl")
    with pytest.raises(KernelSourceError, match=r"kernels/a/b\.clh does not exist; mine:2 asks"):
        sources.flatten_text('int a;\n#include "a/b.clh"\n', "mine")
