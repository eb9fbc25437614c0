"""The same on workers of Dask distributed: results as in one process, and what is lost with a worker."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.core.errors import SequenceError
from ssgi_cl.sequences import cluster
from ssgi_cl.sequences.map_frames import map_frames

from .work import doubled, once_deadly, slowly

dask = pytest.importorskip("dask", reason="Dask distributed is not installed (extra 'cluster')")
distributed = pytest.importorskip("distributed", reason="Dask distributed is not installed (extra 'cluster')")
pytestmark = pytest.mark.slow

SLOW = {"seconds": 0.5}


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local,
        distributed.Client(local) as connected,
    ):
        yield connected


def test_a_cluster_writes_the_same_bytes(client: Any, frames: list[Path], tmp_path: Path) -> None:
    frames[2].write_bytes(b"no file")
    told: list[int] = []
    map_frames(doubled, frames, tmp_path / "a.####.exr")
    found = map_frames(doubled, frames, tmp_path / "b.####.exr", client=client, progress=lambda n, *_: told.append(n))
    assert [each.state for each in found] == ["done", "done", "failed", "done"]
    assert told == [1, 2, 3, 4]
    for number in (1, 2, 4):
        one, other = (tmp_path / f"{name}.{number:04d}.exr" for name in ("a", "b"))
        assert one.read_bytes() == other.read_bytes()
    assert len(map_frames(doubled, frames, tmp_path / "b.####.exr", client=client).skipped) == 3


def test_frames_of_a_killed_worker_are_done_by_another(client: Any, frames: list[Path], tmp_path: Path) -> None:
    (tmp_path / "marks").mkdir()
    found = map_frames(
        once_deadly, frames, tmp_path / "out.####.exr", arguments={"marks": str(tmp_path / "marks")}, client=client
    )
    assert not found.failed  # the result of one that was done may be lost with the worker: then it is skipped
    assert len(list(tmp_path.glob("out.*.exr"))) == 4
    assert list((tmp_path / "marks").iterdir())


def test_frames_that_dask_gives_up_are_handed_in_again(frames: list[Path], tmp_path: Path) -> None:
    """Here it does so after the first death, of all frames that wait for that worker."""
    (tmp_path / "marks").mkdir()
    arguments = {"marks": str(tmp_path / "marks")}
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, resources={"GPU": 1}, dashboard_address=":0"
        ) as local,
        distributed.Client(local) as client,
    ):
        found = map_frames(once_deadly, frames, tmp_path / "a.####.exr", arguments=arguments, client=client, retries=0)
        assert "KilledWorker" in found[1].reason
        (tmp_path / "marks" / frames[1].name).unlink()
        found = map_frames(once_deadly, frames, tmp_path / "b.####.exr", arguments=arguments, client=client)
        assert not found.failed
    assert len(list(tmp_path.glob("b.*.exr"))) == 4


def test_workers_of_another_version_are_refused(
    client: Any, frames: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "__version__", "0.0.0")
    with pytest.raises(SequenceError, match=r"workers have another version of ssgi_cl than 0\.0\.0: tcp"):
        map_frames(doubled, frames, tmp_path / "out.####.exr", client=client)


def test_workers_with_a_device_get_one_frame_at_a_time(frames: list[Path], tmp_path: Path) -> None:
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, resources={"GPU": 1}, dashboard_address=":0"
        ) as local,
        distributed.Client(local) as client,
    ):
        assert cluster._checked_workers(client) == {"GPU": 1.0}
        assert len(map_frames(doubled, frames, tmp_path / "out.####.exr", client=client).failed) == 0


def test_a_lost_scheduler_loses_no_finished_frame(frames: list[Path], tmp_path: Path) -> None:
    local = distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0")
    client = distributed.Client(local)

    def lose(done: int, *_: object) -> None:
        if done == 2:
            local.close()

    try:
        with pytest.raises(SequenceError, match=r"the scheduler was lost after [23] of 4 frames"):
            map_frames(slowly, frames, tmp_path / "out.####.exr", arguments=SLOW, client=client, progress=lose)
    finally:
        client.close(timeout=1)
    found = map_frames(slowly, frames, tmp_path / "out.####.exr", arguments=SLOW)
    assert len(found.skipped) >= 2
    assert not found.failed
