"""The frame graph: culling, order, reuse and skips with their reasons; its record and drawings."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.graph import UNCHANGED, Graph
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.passes.resources import AO, CASTING, GBUFFER, SCENE
from ssgi_cl.frame.record import GraphRecord, StageRecord, device_bytes
from ssgi_cl.frame.renderer import Renderer
from ssgi_cl.frame.stage import Declared, Stage, Values
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.ao.gtao import GtaoParams


class Recorder:
    """Stages that note their runs; each adds up what it reads, and one."""

    def __init__(self) -> None:
        self.ran: list[str] = []

    def stage(self, name: str, reads: tuple[str, ...] = (), *, writes: str = "", **more: Any) -> Stage:
        def run(values: Declared) -> Any:
            self.ran.append(name)
            return sum(values[each] or 0 for each in reads) + 1

        return Stage(name=name, reads=reads, writes=(writes or name,), run=more.pop("run", run), **more)

    def since(self) -> list[str]:
        """Return the stages that ran since the latest call."""
        ran, self.ran = self.ran, []
        return ran


@pytest.fixture
def stages() -> Recorder:
    return Recorder()


def reasons(graph: Graph, number: int, outputs: tuple[str, ...]) -> list[tuple[str, str]]:
    return [(p.name, p.skipped) for p in graph.run({"number": number}, outputs).passes]


# ---- order


def test_stages_run_in_the_order_of_the_list(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime,
        [
            stages.stage("first", ("number",)),
            stages.stage("right", ("first",)),
            stages.stage("left", ("first",)),
            stages.stage("last", ("left", "right")),
        ],
    )
    run = graph.run({"number": 4}, ["last"])
    assert stages.since() == ["first", "right", "left", "last"]
    assert run.values["last"] == 13


@pytest.mark.parametrize("uses", [{"reads": ("b",)}, {"hints": ("b",)}, {"reads": ("a",)}], ids=str)
def test_a_stage_that_reads_what_is_not_made_yet_is_refused(
    runtime: Runtime, stages: Recorder, uses: dict[str, Any]
) -> None:
    read = next(iter(uses.values()))[0]
    message = rf"stage 'a' reads '{read}' before stage '{read}' writes it: expected it after that in the list"
    with pytest.raises(ValueError, match=message):
        Graph(runtime, [stages.stage("a", **uses), stages.stage("b", ("a",))])


def test_a_resource_that_nobody_makes_is_refused(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(runtime, [stages.stage("a", ("number",))])
    message = r"stage 'a' reads 'number', which no stage writes and which is not given; stages write a$"
    for given in ({}, {"number": None}):
        with pytest.raises(ValueError, match=message):
            graph.run(given, ["a"])
    with pytest.raises(ValueError, match=r"an output is 'b': expected one of 'a'"):
        graph.run({"number": 1}, ["b"])


def test_names_that_occur_twice_are_refused(runtime: Runtime, stages: Recorder) -> None:
    with pytest.raises(ValueError, match=r"two stages are called 'a'"):
        Graph(runtime, [stages.stage("a"), stages.stage("a", writes="b")])
    with pytest.raises(ValueError, match=r"stages 'a' and 'b' both write 'a': expected one"):
        Graph(runtime, [stages.stage("a"), stages.stage("b", writes="a")])


# ---- cull and skip


def test_what_no_output_needs_is_culled(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime,
        [stages.stage("a", ("number",)), stages.stage("b", ("a",)), stages.stage("c", ("a",), culled="not asked for")],
    )
    passes = reasons(graph, 1, ("b",))
    assert stages.since() == ["a", "b"]
    assert passes == [("c", "not asked for")]
    record = graph.run({"number": 1}, ["c"]).record
    assert {s.name: (s.state, s.why) for s in record.stages} == {
        "a": ("reused", UNCHANGED),
        "b": ("culled", "no output needs it"),
        "c": ("ran", ""),
    }


def test_a_condition_makes_a_stage_idle_and_what_only_it_reads(runtime: Runtime, stages: Recorder) -> None:
    def condition(facts: Values) -> str | None:
        assert facts["outputs"] == {"sum"}
        return "the number is odd" if facts["number"] % 2 else None

    graph = Graph(
        runtime,
        [
            stages.stage("only for b", ("number",)),
            stages.stage("b", ("only for b",), condition=condition),
            stages.stage("sum", ("b", "number")),
        ],
    )
    assert reasons(graph, 3, ("sum",)) == [("b", "the number is odd")]
    assert stages.since() == ["sum"]
    record = graph.run({"number": 3}, ["sum"]).record
    states = {s.name: s.state for s in record.stages}
    assert states == {"only for b": "unneeded", "b": "idle", "sum": "reused"}
    assert reasons(graph, 4, ("sum",)) == []
    assert stages.since() == ["only for b", "b", "sum"]


def test_what_the_caller_gives_is_not_made(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime,
        [stages.stage("costly", ("number",)), stages.stage("factor", ("costly",)), stages.stage("a", ("factor",))],
    )
    assert graph.run({"number": 1}, ["a"]).values["a"] == 4
    run = graph.run({"number": 1, "factor": 10}, ["a"])
    assert run.values["a"] == 11
    assert stages.since() == ["costly", "factor", "a", "a"]
    whys = {s.name: s.why for s in run.record.stages}
    assert whys == {"costly": "no output needs it", "factor": "the caller gives factor", "a": ""}
    graph.run({"number": 1, "factor": 10}, ["a"])
    assert stages.since() == [], "the same value is no change"


# ---- what later stages do


def test_a_stage_runs_anew_where_what_it_foresees_changes(runtime: Runtime, stages: Recorder) -> None:
    def run(values: Declared) -> float:
        stages.ran.append("first")
        return 10.0 if values.foresees("later") else 1.0

    dark = {"on": True}
    graph = Graph(
        runtime,
        [
            stages.stage("first", ("number",), run=run, foresees=("later",)),
            stages.stage("later", ("first",), condition=lambda facts: "dark" if dark["on"] else None),
            stages.stage("last", ("first", "later")),
        ],
    )
    given = {"number": 1}
    assert graph.run(given, ["last"]).values["last"] == 2  # the idle one leaves nothing
    assert stages.since() == ["first", "last"]
    dark["on"] = False
    assert graph.run(given, ["last"]).values["last"] == 22
    assert stages.since() == ["first", "later", "last"]
    assert graph.run(given, ["last"]).values["last"] == 22
    assert stages.since() == []  # reused, it is still made
    assert graph.run(given, ["first"]).values["first"] == 1.0  # no output needs the later one
    assert stages.since() == ["first"]


def test_a_stage_foresees_what_it_declares_alone(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(runtime, [stages.stage("first", run=lambda values: values.foresees("later")), stages.stage("later")])
    with pytest.raises(LookupError, match="stage 'first' asks whether 'later' will be made: expected one of none"):
        graph.run({}, ["first"])


# ---- reuse


def test_stages_are_reused_until_an_input_changes_or_they_are_forgotten(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime, [stages.stage("a", ("number",)), stages.stage("b", ("other",)), stages.stage("c", ("a", "b"))]
    )

    def run(number: int, other: int) -> list[str]:
        graph.run({"number": number, "other": other}, ["c"])
        return stages.since()

    assert run(1, 2) == ["a", "b", "c"]
    assert run(1, 2) == []
    assert run(1, 3) == ["b", "c"]
    assert run(5, 3) == ["a", "c"]
    graph.forget("b")
    assert run(5, 3) == ["b", "c"]


def test_a_graph_that_keeps_nothing_runs_all(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(runtime, [stages.stage("a", ("number",))], keep=False)
    for _ in range(2):
        assert reasons(graph, 1, ("a",)) == []
    assert stages.since() == ["a", "a"]


def test_a_number_changes_by_its_value_alone(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime, [stages.stage("halved", ("number",), run=lambda v: v["number"] // 2.0), stages.stage("a", ("halved",))]
    )
    ran = []
    for number in (2, 3, 4):
        graph.run({"number": number}, ["a"])
        ran.append(stages.since())
    assert ran == [["a"], [], ["a"]]


def test_a_given_resource_changes_by_its_key(runtime: Runtime, stages: Recorder) -> None:
    class Thing:
        key = 3

    graph = Graph(runtime, [stages.stage("a", ("thing",), run=lambda v: v["thing"])])
    first = Thing()
    assert graph.run({"thing": first}, ["a"]).values["a"] is first
    assert graph.run({"thing": Thing()}, ["a"]).values["a"] is first


def test_a_hint_is_no_reason_to_run_again(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(runtime, [stages.stage("proof", ("other",)), stages.stage("a", ("number",), hints=("proof",))])
    for other in (1, 2):
        graph.run({"number": 1, "other": other}, ["a"])
    assert stages.since() == ["proof", "a", "proof"]


def test_a_stage_on_demand_runs_with_its_readers_and_as_an_output(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime,
        [
            stages.stage("map", ("number",), on_demand=True),
            stages.stage("a", ("map",)),
            stages.stage("b", ("map", "other")),
        ],
    )

    def run(number: int, other: int, *outputs: str) -> list[str]:
        record = graph.run({"number": number, "other": other}, outputs or ("a", "b")).record
        assert (record.stages[0].state == "ran") == ("map" in stages.ran)
        return stages.since()

    assert run(1, 1) == ["map", "a", "b"]
    assert run(1, 1) == []
    assert run(1, 2) == ["map", "b"]
    assert run(2, 2) == ["map", "a", "b"], "what the map is made of changed"
    assert run(2, 2, "map") == ["map"], "it is an output"


def test_a_stage_that_fails_is_made_again(runtime: Runtime, stages: Recorder) -> None:
    fails = [False]

    def run(values: Declared) -> int:
        if fails[0]:
            raise RuntimeError("no")
        return values["number"] + 10 * len(fails)

    graph = Graph(runtime, [stages.stage("a", ("number",), run=run), stages.stage("b", ("a",))])
    assert graph.run({"number": 1}, ["b"]).values["b"] == 12
    fails[0] = True
    assert graph.run({"number": 1}, ["b"]).values["b"] == 12, "it need not run"
    with pytest.raises(RuntimeError, match="no"):
        graph.run({"number": 2}, ["b"])
    fails[:] = [False, False]
    assert graph.run({"number": 1}, ["b"]).values["b"] == 22, "what failed is not trusted"


# ---- the record


def test_the_record_says_how_long_each_resource_is_needed(runtime: Runtime, stages: Recorder) -> None:
    graph = Graph(
        runtime,
        [
            stages.stage("a", ("number",), run=lambda v: runtime.plane(2, (4, 5))),
            stages.stage("b", ("a",), run=lambda v: [runtime.empty(3, np.float32)] * 2),
            stages.stage("c", ("b",), hints=("a",), run=lambda v: 1),
            stages.stage("d", ("c",), run=lambda v: 1),
            stages.stage("e", ("a",)),
        ],
    )
    resources = graph.run({"number": 1}, ["d"], also=["b"]).record.resources
    found = {r.name: (r.first, r.last, r.device_bytes) for r in resources}
    plane = device_bytes(runtime.plane(2, (4, 5)))
    assert plane > 2 * 4 * 5 * 4
    assert found == {
        "number": ("a", "a", None),
        "a": ("a", "c", plane),
        "b": ("b", "c", 12),
        "c": ("c", "d", 0),
        "d": ("d", "d", 0),
        "e": (None, None, None),
    }
    assert {r.name for r in resources if r.output} == {"b", "d"}


def renderer_and_frame(runtime: Runtime) -> tuple[Renderer, Any]:
    built = BUILTIN_SCENES["cornell_box"]()
    renderer = Renderer(runtime, (48, 64), FrameParams(bounces=0, ao=GtaoParams(radius=0.3), shadow_size=32))
    camera = Camera.look_at(built.eye, built.target, yfov=built.yfov, width=64, height=48)
    return renderer, renderer(built.scene, camera, (*built.lights, Environment(0.3)))


def test_a_frame_has_its_graph(runtime: Runtime) -> None:
    renderer, frame = renderer_and_frame(runtime)
    stages = {stage.name: stage for stage in frame.graph.stages}
    lit = ["G-buffer", "gtao", "shadow maps", "direct light", "combine", "blended layers"]
    assert list(stages) == [*lit, "read-back", "exposure", "picture"]
    assert {stage.state for stage in stages.values()} == {"ran"}
    assert stages["G-buffer"].ms == sum(p.ms for p in stages["G-buffer"].passes) > 0.0
    ran = [p for stage in frame.graph.stages for p in stage.passes]
    assert ran == [p for p in frame.passes if not p.skipped], "each pass belongs to one stage"
    lives = {r.name: (r.first, r.last, r.output) for r in frame.graph.resources}
    assert lives[GBUFFER] == ("G-buffer", "picture", True)
    assert lives[AO] == ("gtao", "combine", True)
    assert lives["shadow maps"] == ("shadow maps", "blended layers", False), "layers are lit too"
    assert lives[SCENE] == ("G-buffer", "blended layers", False)
    assert lives[CASTING] == ("shadow maps", "shadow maps", False)
    assert renderer.graph() == frame.graph


def test_a_renderer_has_a_graph_before_its_first_frame(runtime: Runtime) -> None:
    record = Renderer(runtime, (6, 8), FrameParams(ao=GtaoParams())).graph()
    assert {stage.state for stage in record.stages} == {"planned"}
    assert "planned" in record.to_json()


def test_the_record_is_written_as_json_dot_and_mermaid(runtime: Runtime) -> None:
    record = renderer_and_frame(runtime)[1].graph
    text = json.loads(record.to_json())
    assert set(text) == {"device", "outputs", "memory", "stages", "resources"}
    keys = {"name", "state", "why", "ms", "host_ms", "latest_ms", "reads", "hints", "writes", "passes", "skips"}
    assert set(text["stages"][0]) == keys
    assert {"name": "G-buffer", "first": "G-buffer", "last": "picture", "kept": True}.items() <= (
        next(r for r in text["resources"] if r["name"] == "G-buffer").items()
    )
    dot = record.to_dot()
    assert dot.count(" -> ") == sum(len(s["reads"]) + len(s["hints"]) + len(s["writes"]) for s in text["stages"])
    drawn = record.to_mermaid().splitlines()
    assert drawn[0] == "flowchart TD"
    assert sum(" --> " in line or " -.-> " in line for line in drawn) == dot.count(" -> ")
    for number, stage in enumerate(record.stages):
        assert any(re.match(rf'  (subgraph )?s{number}\["{stage.name}<br>', line) for line in drawn)
    for number, each in enumerate(record.resources):
        assert any(line.startswith(f'  r{number}(["{each.name}') for line in drawn)


def test_a_stage_of_much_time_is_drawn_as_a_group_of_its_kernels() -> None:
    def stage(name: str, *passes: tuple[str, float]) -> StageRecord:
        own = tuple(PassTime(*each) for each in passes)
        return StageRecord(name, "ran", "", 0.0, None, (), (), (), own, ())

    gather, blur = stage("gather", ("shade", 5.0), ("cut", 1.0), ("shade", 1.0)), stage("blur", ("blur", 3.0))
    nothing: frozenset[str] = frozenset()
    record = GraphRecord("device", (), (gather, blur), {}, {}, nothing, nothing, nothing)
    assert record.boxes(gather) == ["shade x 2\n6.00 ms, 60%", "cut\n1.00 ms, 10%"]
    assert record.boxes(blur) == ["blur\n3.00 ms, 30%"], "it is one kernel"
    assert record.boxes(stage("small", ("a", 1.0), ("b", 1.0))) == ["small\n2.00 ms, 20%"]
    assert 'subgraph cluster_0 { label="gather\\n7.00 ms, 70%";' in record.to_dot()
    assert '  subgraph s0["gather<br>7.00 ms, 70%"]' in record.to_mermaid()
