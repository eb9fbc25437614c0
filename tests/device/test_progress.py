"""Progress: what is told to functions, and what is shown where."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest
from rich.console import Console

from ssgi_cl.device.progress import Preparing, part_of, told, told_steps


def worked(progress: Any) -> None:
    with told(progress, "work [x]") as tell:
        for share in (0.0, 0.25, 0.254, 1.0):
            if tell is not None:
                tell(share)


def test_a_function_is_told_as_it_is_and_none_is_told_nothing() -> None:
    heard: list[float] = []
    worked(heard.append)
    assert heard == [0.0, 0.25, 0.254, 1.0]
    for nothing in (None, False):
        with told(nothing, "work") as tell:
            assert tell is None


@pytest.mark.parametrize("wrong", ["yes", 1, 0.5])
def test_anything_else_is_refused(wrong: object) -> None:
    with pytest.raises(TypeError, match=r"progress is .*: expected True for a bar, a function"), told(wrong, "work"):  # type: ignore[arg-type]
        pass


@pytest.mark.parametrize("progress", [None, False, True])
def test_nothing_is_printed_where_nobody_looks(progress: bool | None, capfd: pytest.CaptureFixture[str]) -> None:
    worked(progress)
    assert capfd.readouterr() == ("", "")


def test_a_terminal_gets_a_bar_on_standard_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Console, "is_terminal", property(lambda _: True))
    worked(True)
    out, err = capsys.readouterr()
    assert out == ""
    assert "work [x]" in err  # and not taken for markup
    assert "100%" in err


def test_a_notebook_gets_a_line_of_whole_percents(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Console, "is_jupyter", True, raising=False)
    init: Callable[..., None] = Console.__init__

    def in_notebook(self: Console, *args: Any, **kwargs: Any) -> None:
        init(self, *args, **kwargs)
        self.is_jupyter = True

    monkeypatch.setattr(Console, "__init__", in_notebook)
    worked(True)
    assert capsys.readouterr() == ("\rwork [x]   0 %\rwork [x]  25 %\rwork [x] 100 %\n", "")
    with told_steps(True, "work") as tell:
        assert tell is not None
        tell("a long step", 0.5)
        tell("step", 0.5)  # and nothing is left of the longer line
    assert capsys.readouterr().out == "\ra long step  50 %\rstep  50 %       \n"
    with pytest.raises(RuntimeError), told(True, "work"):
        raise RuntimeError  # the line ends all the same
    assert capsys.readouterr().out == "\n"
    assert sys.stdout is not None


def test_steps_are_told_as_they_are(capfd: pytest.CaptureFixture[str]) -> None:
    heard: list[tuple[str, float]] = []
    given: list[Any] = [lambda text, share: heard.append((text, share)), True, False, None]
    for progress in given:
        with told_steps(progress, "work") as tell:
            assert (tell is None) == (progress in (False, None))
            if tell is not None:
                tell("step", 0.5)
    assert heard == [("step", 0.5)]
    assert capfd.readouterr() == ("", "")
    with pytest.raises(TypeError, match="progress is 'x'"), told_steps("x", "work"):  # type: ignore[arg-type]
        pass


def test_parts_are_told_as_shares_of_the_whole() -> None:
    heard: list[float] = []
    part = part_of(heard.append, 0.5, 0.75)
    assert part is not None
    for share in (0.0, 0.5, 1.0):
        part(share)
    assert heard == [0.5, 0.625, 0.75]
    assert part_of(None, 0.0, 1.0) is None


def test_preparing_grows_with_each_program_and_stays_below_its_limit() -> None:
    heard: list[float] = []
    preparing = Preparing(heard.append)
    for _ in range(200):
        preparing()
    assert heard[0] == 0.0
    assert heard == sorted(set(heard))
    assert heard[Preparing.HALF] == Preparing.MOST / 2
    assert heard[-1] < Preparing.MOST
    assert preparing.share == heard[-1]
