"""A window in the browser on a scene or a G-buffer: what a technique does to it, how wrong that is, what it costs.

`view.py` opens it. Modules without viser: `pose`, `source`, `settings`, `controls`, `outputs`, `painter`, `quality`,
`accumulation`, `light_settings`, `compose`, `reference`, `session`, `render_loop`, `pass_chart`, `call_code`, `saved`.
With it: `server`, `tab`, `panel`, `light_panel`, `outlet`.
"""
