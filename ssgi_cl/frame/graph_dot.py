"""A frame graph in the language of Graphviz."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ssgi_cl.frame.record import GraphRecord

_STYLES = {
    "ran": "filled",
    "reused": "filled",
    "planned": "filled",
    "idle": "dashed",
    "unneeded": "dashed",
    "culled": "dotted",
}


def dot(record: GraphRecord) -> str:
    """Return the graph: stages are boxes, resources ellipses, hints dashed lines."""
    lines = ["digraph frame {", '  node [fontname="sans-serif", fontsize=10, fillcolor="#e8f0fb"];']
    for stage in record.stages:
        text = f"{stage.ms:.2f} ms" if stage.state == "ran" else stage.state
        why = f"\n{stage.why}" if stage.why else ""
        skips = "".join(f"\n{skip.name}: {skip.skipped}" for skip in stage.skips)
        label = f"{stage.name}\n{text}{why}{'' if stage.why else skips}"
        lines.append(
            f"  {_quoted('stage ' + stage.name)} [shape=box, style={_STYLES[stage.state]}, label={_quoted(label)}];"
        )
    for each in record.resources:
        size = f"\n{mebibytes(each.device_bytes)}" if each.device_bytes else ""
        output = ", peripheries=2" if each.output else ""
        lines.append(f"  {_quoted(each.name)} [shape=ellipse{output}, label={_quoted(each.name + size)}];")
    for stage in record.stages:
        node = _quoted("stage " + stage.name)
        lines += [f"  {_quoted(name)} -> {node};" for name in stage.reads]
        lines += [f"  {_quoted(name)} -> {node} [style=dashed];" for name in stage.hints]
        lines += [f"  {node} -> {_quoted(name)};" for name in stage.writes]
    return "\n".join([*lines, "}"]) + "\n"


def mebibytes(size: int) -> str:
    """Return a number of bytes in MiB, or KiB where that is less than a tenth."""
    return f"{size / 2**20:.1f} MiB" if size >= 2**20 / 10 else f"{size / 2**10:.1f} KiB"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
