"""Frame graph in the language of Graphviz."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ssgi_cl.frame.record import GraphRecord

_STYLES = {"idle": "dashed", "unneeded": "dashed", "culled": "dotted"}


def dot(record: GraphRecord) -> str:
    """Return the graph: stages are boxes, or groups of kernels where they take much time; resources are ellipses, hints
    dashed lines."""
    lines = ["digraph frame {", "  compound=true;", '  node [fontname="sans-serif", fontsize=10, fillcolor="#e8f0fb"];']
    for number, stage in enumerate(record.stages):
        style = f"shape=box, style={_STYLES.get(stage.state, 'filled')}"
        boxes = [f"s{number}_{part} [{style}, label={_quoted(text)}];" for part, text in enumerate(record.boxes(stage))]
        group = len(boxes) > 1
        if group:
            lines.append(f"  subgraph cluster_{number} {{ label={_quoted(stage.text(record.ms))};")
        lines += [f"  {box}" for box in boxes]
        if group:
            lines.append("  }")
        tail, head = (f" [{end}=cluster_{number}]" if group else "" for end in ("ltail", "lhead"))
        lines += [f"  {_quoted(name)} -> s{number}_0{head};" for name in stage.reads]
        lines += [f"  {_quoted(name)} -> s{number}_0{head} [style=dashed];" for name in stage.hints]
        lines += [f"  s{number}_0 -> {_quoted(name)}{tail};" for name in stage.writes]
    for each in record.resources:
        size = f"\n{mebibytes(each.device_bytes)}" if each.device_bytes else ""
        output = ", peripheries=2" if each.output else ""
        lines.append(f"  {_quoted(each.name)} [shape=ellipse{output}, label={_quoted(each.name + size)}];")
    return "\n".join([*lines, "}"]) + "\n"


def mebibytes(size: int) -> str:
    """Return a number of bytes in MiB, or KiB where that is less than a tenth."""
    return f"{size / 2**20:.1f} MiB" if size >= 2**20 / 10 else f"{size / 2**10:.1f} KiB"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
