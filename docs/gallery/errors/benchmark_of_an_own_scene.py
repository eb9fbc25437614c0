"""
A benchmark of one's own scene
==============================

``ssgi bench`` measures run time against error on any mesh, and puts other programs beside it where they are
installed. The scene is a file that trimesh writes here.

**What to notice.** Each dot is a setting, with its error against rays through this mesh. Which technique is
best depends on the scene: thin bars punish horizons (GTAO), large blocks do not. The JSON has quartiles, device
and versions.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

rng = np.random.default_rng(4)
parts = [trimesh.creation.box((8, 0.1, 8))]
for x, z in rng.uniform(-3.5, 3.5, (40, 2)):
    size = (0.05, 2.2, 0.05) if rng.random() < 0.5 else rng.uniform(0.3, 0.9, 3)
    parts.append(trimesh.creation.box(size).apply_translation((x, size[1] / 2, z)))

with tempfile.TemporaryDirectory() as folder:
    mesh, found = Path(folder) / "own.glb", Path(folder) / "found.json"
    trimesh.Scene(parts).export(mesh)
    command = [sys.executable, "-m", "ssgi_cl.bench", "ssao.16", "gtao", "bitmask_ao", "--own", "--scene", str(mesh)]
    command += ["--size", "160x120", "--seconds", "0.02", "--truth-rays", "64", "--truth-points", "4", "-o", str(found)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    results = json.loads(found.read_text())["results"]

figure, panel = plt.subplots(figsize=(7, 4.2), layout="constrained")
for family in dict.fromkeys(result["family"] for result in results):
    rows = [result for result in results if result["family"] == family]
    milliseconds = [row["wall_ms"]["median"] for row in rows]
    panel.plot(milliseconds, [row["errors"]["world"]["rmse"] for row in rows], "o", label=family)
panel.set(xscale="log", xlabel="ms for 160 x 120 pixels", ylabel="RMSE", ylim=(0, None))
panel.xaxis.set_major_formatter("{x:g}")
panel.xaxis.set_minor_formatter("{x:g}")
panel.legend()
