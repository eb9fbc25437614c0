"""
A technique of one's own
========================

Alchemy ambient obscurance (McGuire et al. 2011) as one OpenCL kernel on the arrays of a `GBuffer`, held to
`gtao` and to rays. A `Runtime` lends its context and queue; a kernel of the library itself would be written as
CONTRIBUTING describes.

**What to notice.** Twenty lines of OpenCL C are a technique. It is noisy, as each pixel turns its samples at
random, and `bilateral_blur` is there to be used. Its contrast is set by hand, so its error against rays is
larger than that of `gtao`.
"""

import matplotlib.pyplot as plt
import numpy as np
import pyopencl as cl

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import hall

SOURCE = """
float3 position(__global const float *depth, int2 at, int2 size, float2 scale) {
    float2 ndc = 2.0f * (convert_float2(at) + 0.5f) / convert_float2(size) - 1.0f;
    return (float3)(ndc.x * scale.x, -ndc.y * scale.y, -1.0f) * depth[at.y * size.x + at.x];
}
__kernel void obscurance(__global const float *depth, __global const float *normal, __global float *out,
                         int2 size, float2 scale, float radius) {
    int2 at = (int2)(get_global_id(0), get_global_id(1));
    int pixel = at.y * size.x + at.x;
    float3 p = position(depth, at, size, scale), n = vload3(pixel, normal);
    float radius_px = radius / (-p.z * scale.y) * 0.5f * size.y, sum = 0.0f;
    float turn = 6.2831853f * fmod(fabs(sin(dot(convert_float2(at), (float2)(12.9898f, 78.233f)))) * 43758.55f, 1.0f);
    for (int i = 0; i < 16; i++) {
        float r = radius_px * sqrt((i + 0.5f) / 16.0f), angle = turn + 2.3999632f * i;
        int2 tap = clamp(at + convert_int2((float2)(cos(angle), sin(angle)) * r), (int2)(0), size - 1);
        float3 v = position(depth, tap, size, scale) - p;
        float near = dot(v, v) < radius * radius ? 1.0f : 0.0f;
        sum += near * fmax(0.0f, dot(v, n) + 0.001f * p.z) / (dot(v, v) + 1e-4f);
    }
    out[pixel] = fmax(0.0f, 1.0f - 2.0f * radius / 16.0f * sum);
}
"""

room = hall()
camera = room.camera(320, 240)
gbuffer = gi.rasterize.gbuffer(room.scene, camera)
runtime = gi.Runtime.open()
obscurance = cl.Kernel(cl.Program(runtime.context, SOURCE).build(), "obscurance")
READ, rows, columns = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR, *gbuffer.size
view = np.ascontiguousarray(gbuffer.normal @ camera.view[:3, :3].T, np.float32)
inputs = [cl.Buffer(runtime.context, READ, hostbuf=np.ascontiguousarray(a)) for a in (gbuffer.depth, view)]
own = np.empty((rows, columns), np.float32)
output = cl.Buffer(runtime.context, cl.mem_flags.WRITE_ONLY, own.nbytes)
size = np.array((columns, rows), np.int32)
scale = np.float32(1 / camera.projection.diagonal()[:2])
obscurance(runtime.queue, (columns, rows), None, *inputs, output, size, scale, np.float32(room.ao_radius))
cl.enqueue_copy(runtime.queue, own, output)

rays = gi.truth.ambient_occlusion(room.scene, camera, radius=room.ao_radius, rays=256).mean
results = {"own": own, "own, blurred": gi.bilateral_blur(own, gbuffer, radius=4)}
results |= {"gtao": gi.gtao(gbuffer, radius=room.ao_radius), "256 rays": rays}
figure, panels = plt.subplots(1, 4, figsize=(14, 3.1), layout="constrained")
for panel, (name, image) in zip(panels, results.items(), strict=True):
    panel.imshow(image, cmap="gray", vmin=0, vmax=1)
    panel.set_title(f"{name}: RMSE {gi.metrics.rmse(image, rays):.3f}")
    panel.axis("off")
