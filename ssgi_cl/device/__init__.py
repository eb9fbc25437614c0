"""OpenCL: drivers, the runtime, memory, kernels, and G-buffers in device memory."""
