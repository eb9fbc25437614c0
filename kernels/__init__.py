"""OpenCL C sources; read README.md beside this file first."""
