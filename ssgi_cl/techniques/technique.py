"""The descriptor of a technique: its parameters, inputs, results and measurement.

The class of every technique, and of the parts that techniques are made of, has one method that
queues its passes:

    run(gbuffer, source, *, hints...)

- `gbuffer` is what the camera sees. What computes in the scene takes `scene` in its place, such as
  `Radiosity`; what needs no surfaces takes `radiance`, such as `Tonemap`.
- `source` is the one thing that it reads beside the G-buffer, under its own name: `lights`, `rsms`,
  `vpls`, the plane to filter. Techniques of the G-buffer alone have none.
- All else is given by name, with a default unless nothing can be computed without it.
- It returns a plane in device memory, or several as a record of planes; None stands for black.
  `Tonemap` returns the picture, in host memory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ssgi_cl.core.params import Params

KINDS = ("ao", "indirect", "shading", "filter")
INPUTS = (
    *("depth", "normal", "albedo", "emission", "specular", "gloss", "thickness", "motion"),
    *("lights", "rsms", "shadow_maps", "scene", "image"),
)
"""Inputs of techniques: images of the G-buffer, and arguments by name; `image` is one to filter."""
FIRST = ("gbuffer", "scene", "radiance")
"""Names of the first argument of `run`."""

Row = tuple[str, Sequence[tuple[str, str]]]
"""Description of a result, and (description, case of the benchmark) of each figure shown."""


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measurement of a technique, and the figures that README and its page show.

    Attributes:
        settings: of its family of benchmark cases, where these differ from the usual ones.
        families: of cases, whose table its page shows.
        rows: of README's table, by the call that they are of.
    """

    settings: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    rows: Mapping[str, Row] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Technique:
    """A technique, described once: command line, benchmark, tuning, tests and docs iterate over
    these records, see `ssgi_cl.techniques.catalogue`.

    Attributes:
        name: of the function.
        kind: one of `KINDS`.
        paper: authors and year.
        function: numpy in, numpy out; takes `runtime` and the parameters.
        params: the dataclass that declares the parameters.
        technique: the class, to prepare once and run often; see above for its `run`.
        reference: the module of the numpy reference implementation.
        reads: out of `INPUTS`.
        writes: results by name, also in a file; optional ones last.
        methods: other ways to compute it, each with the dataclass of its parameters.
        command: whether `ssgi apply` offers it.
        bench: how it is measured and what of that is shown.
        variants: values of parameters that tests combine, the quickest and usual first.
        quantity: what the result is, a method of the benchmark's `Context` that gives its
            reference.
        tunable: parameters by which presets differ, each with the list of its values; what tuning
            varies by default.
        layers: numbers of depth layers that presets are recorded for.
    """

    name: str
    kind: str
    paper: str
    function: Callable[..., Any]
    params: type[Params]
    technique: Any
    reference: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    methods: Mapping[str, type[Params]] = field(default_factory=dict)
    command: bool = False
    bench: Bench = field(default_factory=Bench)
    variants: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    quantity: str = ""
    tunable: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    layers: tuple[int, ...] = (1,)
