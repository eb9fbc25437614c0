"""What every report's page is made of: its style, its script and the frame round its body."""

from __future__ import annotations

from html import escape

PLOT_STYLE = """
:root { color-scheme: light dark; --page: #fcfcfa; --text: #1b1c1e; --soft: #5b5f66;
  --rule: #d9d9d4; --grid: #e7e7e2; --panel: #f3f3ee; --front: #8a8d92; --mark: #0072b2;
  --c0: #0072b2; --c1: #c04a00; --c2: #00815c; --c3: #b0568b; --c4: #946800; --c5: #6b4fc0;
  --c6: #4c4c4c; }
@media (prefers-color-scheme: dark) { :root { --page: #16181b; --text: #e6e6e3; --soft: #a0a5ad;
  --rule: #3a3e44; --grid: #272a2f; --panel: #1f2226; --front: #7d828a; --mark: #5ab4f0;
  --c0: #5ab4f0; --c1: #ff8a4a; --c2: #3fcf9f; --c3: #e29ac6; --c4: #f0b432; --c5: #b8a6ff;
  --c6: #c9c9c9; } }
.c0 { color: var(--c0); } .c1 { color: var(--c1); } .c2 { color: var(--c2); }
.c3 { color: var(--c3); } .c4 { color: var(--c4); } .c5 { color: var(--c5); }
.c6 { color: var(--c6); }
svg.plot { display: block; width: 100%; max-width: 56rem; height: auto; }
svg text { font: 12px system-ui, sans-serif; fill: currentColor; }
svg .middle { text-anchor: middle; } svg .end { text-anchor: end; }
svg > text { fill: var(--soft); } svg > text.name { fill: var(--text); }
svg path { fill: none; }
svg .grid { stroke: var(--grid); } svg .axis { stroke: var(--soft); }
svg .front { stroke: var(--front); stroke-width: 7; stroke-opacity: .35; stroke-linejoin: round; }
svg .line { stroke: currentColor; stroke-width: 1.8; } svg .dashed { stroke-dasharray: 5 4; }
svg .spread { stroke: currentColor; stroke-width: 1.2; }
svg .point { fill: currentColor; stroke: var(--page); stroke-width: 1; }
svg .unsteady { fill: var(--page); stroke: currentColor; stroke-width: 2; }
"""
"""Colours, and what plots look like."""

STYLE = (
    PLOT_STYLE
    + """
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 76rem; padding: 1.5rem 1.25rem 3rem; background: var(--page);
  color: var(--text); font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; line-height: 1.2; }
h2 { font-size: 1.2rem; margin: 3rem 0 .4rem; padding-top: .8rem;
  border-top: 1px solid var(--rule); }
h3 { font-size: 1rem; margin: 1.8rem 0 .4rem; }
p { margin: .3rem 0 .7rem; max-width: 46rem; }
a { color: var(--mark); }
.soft, figcaption { color: var(--soft); }
dl.facts { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1rem;
  margin: 1rem 0; }
dl.facts dt { color: var(--soft); } dl.facts dd { margin: 0; overflow-wrap: anywhere; }
nav ul { margin: .3rem 0; padding-left: 1.2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .22rem .6rem; text-align: right; white-space: nowrap;
  border-bottom: 1px solid var(--grid); }
thead th { color: var(--soft); font-weight: 500; vertical-align: bottom; white-space: normal;
  border-bottom: 1px solid var(--rule); }
tbody th { text-align: left; font-weight: 500; position: sticky; left: 0;
  background: var(--page); }
tbody tr.front th { font-weight: 700; }
thead th:first-child, td.text { text-align: left; }
thead th:first-child { padding-left: 1.7rem; }
td.text { white-space: normal; color: var(--soft); }
ul.notes { margin: .5rem 0; padding-left: 1.2rem; color: var(--soft); font-size: .9rem; }
td small { color: var(--soft); }
.star { color: var(--mark); display: inline-block; width: 1.1em; }
.key { display: flex; flex-wrap: wrap; gap: .2rem 1.1rem; list-style: none; padding: 0;
  margin: .3rem 0; font-size: .9rem; }
.swatch { width: 32px; height: 16px; vertical-align: -3px; margin-right: .3rem; }
.viewer { margin: 0; max-width: 56rem; }
.controls { display: flex; flex-wrap: wrap; gap: .5rem 1.5rem; align-items: center;
  margin-bottom: .5rem; }
.controls label { margin-right: .7rem; white-space: nowrap; }
fieldset { border: 0; padding: 0; margin: 0; display: flex; flex-wrap: wrap; }
legend { float: left; margin-right: .7rem; padding: 0; color: var(--soft); }
select { font: inherit; max-width: 100%; }
.stage { position: relative; overflow: hidden; background: var(--panel); --cut: 50%;
  cursor: ew-resize; touch-action: pan-y; user-select: none; }
.stage img { position: absolute; inset: 0; width: 100%; height: 100%; display: block; }
.stage .left { clip-path: inset(0 calc(100% - var(--cut)) 0 0); }
.stage .cut { position: absolute; top: 0; bottom: 0; left: var(--cut); width: 2px;
  margin-left: -1px; background: #fff; box-shadow: 0 0 0 1px #0008; }
.stage .tag { position: absolute; bottom: .5rem; padding: .05rem .5rem; border-radius: 3px;
  background: #000b; color: #fff; font-size: .8rem; pointer-events: none; }
.stage .tag.result { left: .5rem; } .stage .tag.other { right: .5rem; }
.viewer input[type=range] { display: block; width: 100%; margin: .4rem 0; }
.scale { display: flex; align-items: center; gap: .6rem; font-size: .85rem; flex-wrap: wrap; }
.scale[hidden] { display: none; }
.scale .colors { display: flex; width: 13rem; height: .8rem; }
.scale .colors i { flex: 1; }
.bars { display: grid; grid-template-columns: max-content 1fr; gap: .25rem .7rem;
  align-items: center; max-width: 56rem; font-size: .88rem; }
.bar { display: flex; height: 1.35rem; }
.bar span { overflow: hidden; white-space: nowrap; color: #111; font-size: .75rem;
  line-height: 1.35rem; text-align: center; }
.key i { display: inline-block; width: .9rem; height: .9rem; vertical-align: -1px;
  margin-right: .35rem; }
.r0 { background: #7cc4ec; } .r1 { background: #efb04a; } .r2 { background: #d993bd; }
.r3 { background: #5fbf9d; } .r4 { background: #c4c4c4; }
.pixels .bar { opacity: .75; }
summary { cursor: pointer; }
:focus-visible { outline: 2px solid var(--mark); outline-offset: 2px; }
@media (max-width: 40rem) { body { padding: 1rem .8rem 2rem; }
  dl.facts { grid-template-columns: 1fr; gap: 0; } dl.facts dd { margin-bottom: .4rem; }
  svg.plot { width: 46rem; max-width: none; } }
@media print { .controls, .viewer input { display: none; } }
"""
)

SCRIPT = """
const pictures = JSON.parse(document.getElementById("pictures").textContent);
for (const viewer of document.querySelectorAll(".viewer")) {
  const [right, left] = viewer.querySelectorAll(".stage img");
  const stage = viewer.querySelector(".stage"), slider = viewer.querySelector("[type=range]");
  const select = viewer.querySelector("select"), sides = viewer.querySelectorAll("[type=radio]");
  const other = viewer.querySelector(".tag.other"), scale = viewer.querySelector(".scale");
  const show = () => {
    const of = select.selectedOptions[0];
    for (const side of sides) side.disabled = !of.dataset[side.value];
    let side = [...sides].find(s => s.checked);
    if (side.disabled) { side = [...sides].find(s => !s.disabled); side.checked = true; }
    const what = side.parentElement.textContent.trim();
    left.src = pictures[of.dataset.result];
    left.alt = "result of " + of.textContent;
    right.src = pictures[of.dataset[side.value]];
    right.alt = what + " of " + of.textContent;
    other.textContent = what;
    scale.hidden = !side.value.startsWith("error");
  };
  const cut = () => stage.style.setProperty("--cut", slider.value + "%");
  const drag = event => {
    if (event.type === "pointermove" && !event.buttons) return;
    const box = stage.getBoundingClientRect();
    slider.value = 100 * (event.clientX - box.left) / box.width;
    cut();
  };
  stage.addEventListener("pointerdown", drag);
  stage.addEventListener("pointermove", drag);
  slider.addEventListener("input", cut);
  viewer.addEventListener("change", show);
  cut();
  // A picture is decoded when its viewer comes near.
  const near = new IntersectionObserver(seen => {
    if (seen.some(s => s.isIntersecting)) { near.disconnect(); show(); }
  }, { rootMargin: "600px" });
  near.observe(viewer);
}
"""

# Nothing may be fetched, whatever the page holds.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def page(title: str, body: str, pictures: str) -> str:
    """Return a whole HTML document.

    Args:
        title: plain text.
        body: HTML.
        pictures: JSON, id -> data URI.
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}\n"
        f'<script type="application/json" id="pictures">{pictures}</script>\n'
        f"<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )
