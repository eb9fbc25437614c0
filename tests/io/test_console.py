"""Steps of commands, as a terminal shows them."""

from __future__ import annotations

import pytest
from rich.console import Console

from ssgi_cl.io.console import progress


@pytest.mark.parametrize("silent", [False, True])
def test_steps_and_their_share_are_shown_on_a_terminal(
    silent: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Console, "is_terminal", property(lambda _: True))
    with progress(silent) as step:
        step("reading [a]")
        for share in (0.0, 0.5, 1.0):
            step("compiling", share)
        step("writing")
    out, err = capsys.readouterr()
    assert out == ""
    assert ("writing" in err) != silent


def test_nothing_is_shown_without_a_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    with progress(False) as step:
        step("compiling", 0.5)
    assert capfd.readouterr() == ("", "")
