"""The kernel files: one kernel each, headers, macros, constants and literals."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from pathlib import Path

from ssgi_cl.device import constants, sources


def text_of(path: str) -> str:
    return files("ssgi_cl.kernels").joinpath(*path.split("/")).read_text(encoding="utf-8")


@cache
def code_of(text: str) -> str:
    """The text without comments."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)


def all_files() -> list[str]:
    """Every kernel and every file that kernels include."""
    root = files("ssgi_cl.kernels")
    return sorted(
        f"{folder.name}/{file.name}"
        for folder in root.iterdir()
        if folder.is_dir()
        for file in folder.iterdir()
        if file.name.endswith((".cl", ".clh"))
    )


def test_a_file_holds_one_kernel_of_its_own_name() -> None:
    for path in sources.kernel_names():
        assert re.findall(r"__kernel\s+void\s+(\w+)", code_of(text_of(path))) == [Path(path).stem], path


def test_a_file_begins_with_its_licence_and_its_name() -> None:
    for path in all_files():
        first, second = text_of(path).splitlines()[:2]
        assert first == "// SPDX-License-Identifier: MIT", path
        name = Path(path).stem
        start = name if path.endswith(".cl") else name.capitalize()
        assert re.match(rf"// {start}: \S", second), (path, second)


@cache
def guards(text: str) -> str:
    """The conditions that end in #error."""
    joined = text.replace("\\\n", " ")
    return " ".join(re.findall(r"^#if(.*)\n#error", joined, flags=re.MULTILINE))


def is_guarded(name: str, text: str) -> bool:
    return bool(re.search(rf"ndef {name}$|ndef {name} |!defined\({name}\)", guards(text)))


def test_a_kernel_refuses_to_build_without_the_constants_of_the_host() -> None:
    for path in sources.kernel_names():
        text = sources.flatten(path)
        _, generated, own = text.split("#line 1", 2)
        code = code_of(own)
        for name in re.findall(r"#define (\w+)", generated):
            if re.search(rf"\b{name}\b", code):
                assert is_guarded(name, text), (path, name)


def test_constants_of_the_host_are_in_some_kernel_and_defined_nowhere_else() -> None:
    code = "".join(code_of(text_of(path)) for path in all_files())
    assert constants._VALUES.keys() <= {*re.findall(r"\w+", code)}
    names = "|".join(constants._VALUES)
    assert re.findall(rf"#\s*define\s+(?:{names})\b", code) == []


def test_every_literal_is_a_float_or_an_integer() -> None:
    # 1.0 without an f is a double in OpenCL C, which devices need not have.
    number = r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?(?![\w.])"
    for path in all_files():
        assert re.findall(number, code_of(text_of(path))) == [], path
