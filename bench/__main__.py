"""`python -m ssgi_cl.bench` is `ssgi bench`."""

from .command import bench_command

if __name__ == "__main__":
    bench_command(prog_name="ssgi bench")
