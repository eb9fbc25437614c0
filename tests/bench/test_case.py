"""Names of cases, and settings that are numbers."""

from __future__ import annotations

import pytest

from ssgi_cl.tuning.case import Case, count_of


def test_a_case_and_its_name_tell_the_same() -> None:
    case = Case("ssao-blur", "16", "hall", (600, 800))
    assert case.name == "ssao-blur.16.hall.800x600"
    assert Case.parse(case.name) == case


@pytest.mark.parametrize(
    "name",
    [
        "",
        "ssao",
        "ssao.16.hall",
        "ssao.16.hall.800",
        "ssao.16.hall.0x600",
        "ssao.16.hall.800x600.x",
        "ssao..hall.800x600",
        "ssao.16.ha ll.800x600",
        "ssao.16.hall.800x-600",
    ],
)
def test_what_is_no_name_is_refused_with_an_example(name: str) -> None:
    with pytest.raises(ValueError, match=r"expected family\.setting\.scene\.COLUMNSxROWS"):
        Case.parse(name)


@pytest.mark.parametrize("setting", ["", "-1", "0", "257", "1.5", "many"])
def test_a_setting_that_is_no_count_is_refused_with_the_range(setting: str) -> None:
    with pytest.raises(ValueError, match="expected a number of samples, 1 to 256"):
        count_of(setting, "a number of samples", 1, 256)


def test_a_setting_that_is_a_count_is_one() -> None:
    assert count_of("16", "a number of samples", 1, 256) == 16
