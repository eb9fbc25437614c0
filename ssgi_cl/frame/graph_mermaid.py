"""A frame graph in the language of Mermaid, which pages of Markdown draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ssgi_cl.frame.graph_dot import mebibytes

if TYPE_CHECKING:
    from ssgi_cl.frame.record import GraphRecord

_ENTITIES = str.maketrans({"#": "#35;", '"': "#quot;", "<": "#lt;", ">": "#gt;", "&": "#amp;", "\n": "<br>"})


def mermaid(record: GraphRecord) -> str:
    """Return the graph: stages are boxes, resources rounded, hints dotted, what did not run dashed."""
    lines = ["flowchart TD", "  classDef still stroke-dasharray: 4 3"]
    for number, stage in enumerate(record.stages):
        ran = stage.state == "ran"
        texts = [stage.name, f"{stage.ms:.2f} ms" if ran else stage.state]
        texts += [stage.why] if stage.why else [f"{skip.name}: {skip.skipped}" for skip in stage.skips]
        still = ":::still" if stage.state in ("idle", "unneeded", "culled") else ""
        lines.append(f"  s{number}[{_quoted(*texts)}]{still}")
    names = {each.name: f"r{number}" for number, each in enumerate(record.resources)}
    for each in record.resources:
        size = [mebibytes(each.device_bytes)] if each.device_bytes else []
        lines.append(f"  {names[each.name]}([{_quoted(each.name, *size)}])")
    for number, stage in enumerate(record.stages):
        lines += [f"  {names[name]} --> s{number}" for name in stage.reads]
        lines += [f"  {names[name]} -.-> s{number}" for name in stage.hints]
        lines += [f"  s{number} --> {names[name]}" for name in stage.writes]
    return "\n".join(lines) + "\n"


def _quoted(*texts: str) -> str:
    joined = "\n".join(texts)
    return f'"{joined.translate(_ENTITIES)}"'
