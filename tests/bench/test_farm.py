"""`ssgi truth` and `ssgi bench` on the workers of a cluster."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from ssgi_cl.bench import farm
from ssgi_cl.bench.suite import Measurements, select
from ssgi_cl.cli.command import main
from ssgi_cl.core.errors import SequenceError
from ssgi_cl.tuning.calibration import Calibration

distributed = pytest.importorskip("distributed", reason="Dask distributed is not installed (extra 'cluster')")

VIEWS = ("--scene", "cornell_box", "--scene", "hall", "--size", "40x30")
QUICK = (*VIEWS, "--truth-rays", "4", "--truth-points", "4", "--truth-paths", "2")


def ssgi(*arguments: object, status: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == status, result.output
    return result


@contextmanager
def workers(**options: Any) -> Iterator[str]:
    with distributed.LocalCluster(dashboard_address=":0", **{"threads_per_worker": 1} | options) as local:
        yield local.scheduler_address


@pytest.mark.slow
def test_truths_of_workers_have_the_bytes_of_one_process(own_store: Path) -> None:
    arguments = ("truth", "ssao.4", "embree", *QUICK)
    ssgi(*arguments)
    one = {path.name: path.read_bytes() for path in (own_store / "truth").iterdir()}
    ssgi("truth", "--clear")
    with workers(n_workers=2) as address:
        ssgi(*arguments, "--scheduler", address)
    assert {path.name: path.read_bytes() for path in (own_store / "truth").iterdir()} == one
    assert len(one) > 2


@pytest.mark.slow
def test_workers_that_keep_truths_elsewhere_are_told(
    own_store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with workers(n_workers=1) as address:
        monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "other"))
        found = ssgi("truth", "ssao.4", *QUICK, "--scheduler", address, status=1)
    assert f"this worker keeps truths in {own_store}" in found.stderr
    assert "hall.40x30: TruthError" in found.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("own_store")
def test_a_machine_measures_a_scene_at_a_time() -> None:
    arguments = ("bench", "ssao.4", "ssao.8", *QUICK, "--seconds", "0.05", "--json")
    with workers(n_workers=1, threads_per_worker=os.cpu_count(), resources={"MACHINE": 1}) as address:
        found = json.loads(ssgi(*arguments, "--scheduler", address).stdout)
    alone = json.loads(ssgi(*arguments).stdout)
    for key in ("device", "machine", "versions", "options", "skipped"):
        assert found[key] == alone[key]
    for one, other in zip(found["results"], alone["results"], strict=True):
        assert one["name"] == other["name"]
        assert one["errors"] == other["errors"]
        assert one["wall_ms"]["median"] > 0.0


@pytest.mark.slow
@pytest.mark.usefixtures("own_store")
def test_workers_without_the_resource_and_two_on_a_machine_do_not_measure() -> None:
    arguments = ("bench", "ssao.4", *QUICK, "--seconds", "0.05", "--scheduler")
    with workers(n_workers=1) as address:
        assert "start some with --resources 'MACHINE=1'" in ssgi(*arguments, address, status=1).stderr
    with workers(n_workers=2, resources={"MACHINE": 1}) as address:
        assert "has 2 workers with the resource MACHINE" in ssgi(*arguments, address, status=1).stderr


def part(machine: str, *names: str, ms: float = 1.0) -> farm.Part:
    found = Measurements(Calibration(1.0, 1.0, 1.0), ms, [{"name": name} for name in names])
    return farm.Part({"created": machine, "machine": machine[0]}, found)


def test_parts_are_joined_and_unlike_machines_refused() -> None:
    stamp, whole = farm._joined([part("a1", "x", "y"), part("a2", "z", ms=3.0)], [{"name": "w", "reason": "r"}], False)
    assert [result["name"] for result in whole.results] == ["x", "y", "z"]
    assert (stamp["created"], whole.reference_ms, whole.skipped) == ("a1", 2.0, [{"name": "w", "reason": "r"}])
    with pytest.raises(SequenceError, match="the machines differ in machine: a and b"):
        farm._joined([part("a1", "x"), part("b1", "y")], [], False)


def test_places_are_scenes_at_a_size() -> None:
    cases = select(["ssao.4", "ssao.8"], ["a", "b"], [(30, 40), (60, 80)])
    places = farm.places_of(cases, {"a": "a", "b": "b.json"})
    assert [str(place) for place in places] == ["a.40x30", "a.80x60", "b.40x30", "b.80x60"]
    assert [place.scene for place in places] == ["a", "a", "b.json", "b.json"]
    assert all(len(place.cases) == 2 for place in places)
