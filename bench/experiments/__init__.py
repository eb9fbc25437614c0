"""Experiments that chose defaults and told limits: `python -m ssgi_cl.bench.experiments.NAME`, from a clone."""
