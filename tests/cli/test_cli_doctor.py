"""`ssgi doctor`: what it tells, and its exit status."""

from __future__ import annotations

import json
from typing import Any

import pytest

from ssgi_cl.bench.self_test import NOT_IN_TIME, Outcome
from ssgi_cl.cli import doctor
from ssgi_cl.device import drivers
from ssgi_cl.device.runtime import Runtime

from .commands import answer, ssgi, succeeds

GOOD = [Outcome("ssao"), Outcome("gtao", (1e-6, 1e-7)), Outcome("shading", problem=NOT_IN_TIME)]


def outcomes(monkeypatch: pytest.MonkeyPatch, *found: Outcome) -> None:
    monkeypatch.setattr(doctor, "self_test", lambda *_: list(found))


def test_a_report_has_versions_devices_limits_and_the_self_test(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes(monkeypatch, *GOOD)
    told = succeeds("doctor").stdout
    assert runtime.info.label in told.replace("\n", " ")
    for words in ("numpy", "work-groups of", "1 of 3 techniques have the same bits", "gtao: within 0.001", NOT_IN_TIME):
        assert words in told
    facts = answer("doctor")
    assert facts["chosen"] in [device["label"] for device in facts["devices"]]
    assert [test["good"] for test in facts["self_test"]] == [True] * 3
    assert answer("doctor", "--no-test")["self_test"] is None


def test_a_technique_that_differs_is_a_problem_and_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes(monkeypatch, Outcome("ssao", (3.0, 0.5)))
    result = ssgi("doctor")
    assert result.exit_code == 1
    assert "ssao fails the self-test: beyond 0.001" in result.stdout
    assert "Mend: install the newest version" in result.stdout


def test_without_a_device_it_says_why_and_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    gone: Any = lambda: ()  # noqa: E731
    monkeypatch.setattr(drivers, "devices", gone)
    monkeypatch.setattr(drivers, "problems", lambda: ["/x.icd: libx.so: cannot open shared object file"])
    result = ssgi("doctor", "--json")
    assert result.exit_code == 1
    facts = json.loads(result.stdout)
    assert (facts["chosen"], facts["self_test"]) == (None, None)
    assert "remove the .icd file" in facts["problems"][0]["mend"]
    assert "pip install" in facts["problems"][-1]["mend"]


def test_a_device_that_is_not_there_is_an_error() -> None:
    result = ssgi("doctor", "--device", "no such")
    assert result.exit_code == 1
    assert "no such OpenCL device" in result.stderr
