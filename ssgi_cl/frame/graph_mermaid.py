"""Frame graph in the language of Mermaid, which pages of Markdown draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ssgi_cl.frame.graph_dot import mebibytes

if TYPE_CHECKING:
    from ssgi_cl.frame.record import GraphRecord

_ENTITIES = str.maketrans({"#": "#35;", '"': "#quot;", "<": "#lt;", ">": "#gt;", "&": "#amp;", "\n": "<br>"})


def mermaid(record: GraphRecord) -> str:
    """Return the graph: stages are boxes, or groups of kernels where they take much time; resources are rounded, hints
    dotted, what did not run dashed."""
    lines = ["flowchart TD", "  classDef still stroke-dasharray: 4 3"]
    for number, stage in enumerate(record.stages):
        still = ":::still" if stage.state in ("idle", "unneeded", "culled") else ""
        boxes = record.boxes(stage)
        if len(boxes) == 1:
            lines.append(f"  s{number}[{_quoted(boxes[0])}]{still}")
        else:
            lines.append(f"  subgraph s{number}[{_quoted(stage.text(record.ms))}]")
            lines += [f"  s{number}_{part}[{_quoted(text)}]" for part, text in enumerate(boxes)]
            lines.append("  end")
    names = {each.name: f"r{number}" for number, each in enumerate(record.resources)}
    for each in record.resources:
        size = f"\n{mebibytes(each.device_bytes)}" if each.device_bytes else ""
        lines.append(f"  {names[each.name]}([{_quoted(each.name + size)}])")
    for number, stage in enumerate(record.stages):
        lines += [f"  {names[name]} --> s{number}" for name in stage.reads]
        lines += [f"  {names[name]} -.-> s{number}" for name in stage.hints]
        lines += [f"  s{number} --> {names[name]}" for name in stage.writes]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return f'"{text.translate(_ENTITIES)}"'
