"""Kernels compiled for graphics processors that are not there, and what their compilers say of them.

AMD: clang with libclc, for gfx1030. NVIDIA: clang to PTX, then ptxas for each of `NVIDIA`. Intel: ocloc, for the
first Arc. Where a compiler is missing, `missing` says which.

clang has no images for the first two, so that reads of them become the instructions that drivers emit, without the
clamping at edges.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from ssgi_cl.core.errors import KernelBuildError
from ssgi_cl.device.programs import OPTIONS

CLANG = "clang-15"
LIBCLC = Path("/usr/lib/clc")
NVIDIA = {"sm_75": 32, "sm_86": 48, "sm_120": 48}
"""Architecture -> warps that a multiprocessor holds."""
REGISTERS, WARP_STEP = 1 << 16, 4
"""Registers of a multiprocessor, each of 32 bits; warps come and go so many at a time."""
AMD, AMD_WAVES = "gfx1030", 16
"""Architecture, and the waves that a SIMD unit of it holds."""
INTEL, INTEL_LANES = "acm-g10", 32
"""Architecture, and the widest of its work-items at once."""


@dataclass(frozen=True)
class Usage:
    """What a kernel takes on a device.

    Attributes:
        registers: 32-bit ones of a work-item; those of a thread on Intel.
        spills: registers, vector and scalar, that don't fit (AMD); bytes of them (NVIDIA, Intel).
        scratch: bytes of private memory of a work-item, spills in it or not.
        resident: waves (AMD, of `AMD_WAVES`), warps (NVIDIA, see `NVIDIA`) or work-items in step (Intel, of
            `INTEL_LANES`) that fit.
        most: of those, that there may be.
        scalars: registers of a wave (AMD).
        local: bytes of local memory of a work-group (AMD, NVIDIA).
        code: bytes of instructions (AMD).
    """

    registers: int
    spills: int
    scratch: int
    resident: int
    most: int
    scalars: int = 0
    local: int = 0
    code: int = 0


def warps(registers: int, most: int) -> int:
    """Return the warps of a multiprocessor of NVIDIA whose work-items take so many registers."""
    taken = -(-max(registers, 1) // 8) * 8 * 32
    return min(most, REGISTERS // taken // WARP_STEP * WARP_STEP)


def missing(target: str) -> str:
    """Return what is not there of what compiling for a target takes; empty if all is."""
    needs = {
        AMD: (CLANG, LIBCLC / "amdgcn--amdhsa.bc"),
        **dict.fromkeys(NVIDIA, (CLANG, LIBCLC / "nvptx64--nvidiacl.bc", "ptxas")),
        INTEL: ("ocloc",),
    }[target]
    found = (each.exists() if isinstance(each, Path) else shutil.which(each) for each in needs)
    return ", ".join(str(each) for each, there in zip(needs, found, strict=True) if not there)


def versions() -> dict[str, str]:
    """Return the version of each compiler that is there: figures of others differ."""
    said = {}
    for tool, words in ((CLANG, ["--version"]), ("ptxas", ["--version"]), ("ocloc", ["query", "NEO_REVISION"])):
        if shutil.which(tool):
            with TemporaryDirectory() as folder:
                output = subprocess.run([tool, *words], capture_output=True, text=True, check=False, cwd=folder).stdout
                output += "".join(file.read_text() for file in Path(folder).iterdir())
            found = re.search(r"clang version (\S+)|, (V[\d.]+)|^(\d+)", output, re.MULTILINE)
            said[tool] = next(filter(None, found.groups())) if found else "unknown"
    return said


def usages(name: str, text: str, defined: Mapping[str, int]) -> dict[str, Usage]:
    """Return what a kernel takes on each device whose compiler is there.

    Args:
        name: of the kernel.
        text: its flattened source.
        defined: macro -> value, those of the form among them.

    Raises:
        KernelBuildError: a compiler refuses it.
    """
    found = {}
    options = [*OPTIONS, *(f"-D{macro}={value}" for macro, value in defined.items())]
    with TemporaryDirectory() as folder:
        work = Path(folder)
        if not missing(AMD):
            found[AMD] = _amd(
                _clang(work, name, _AMD_IMAGES + text, options, [*_AMD_TARGET, *_linked("amdgcn--amdhsa")])
            )
        present = [arch for arch in NVIDIA if not missing(arch)]
        if present:
            # Handles of textures in registers need the other of the two modes.
            ptx = _clang(work, name, _NVIDIA_IMAGES + text, options, [*_NVIDIA_TARGET, *_linked("nvptx64--nvidiacl")])
            (work / "k.ptx").write_text(ptx.replace(", texmode_independent", ""))
        for arch in present:
            command = ["ptxas", "-v", f"-arch={arch}", "k.ptx", "-o", "k.cubin"]
            found[arch] = _nvidia(_run(command, work, name), NVIDIA[arch])
        if not missing(INTEL):
            (work / "k.cl").write_text(text)
            command = ["ocloc", "compile", "-q", "-file", "k.cl", "-device", INTEL, "-out_dir", "intel"]
            _run([*command, "-options", " ".join(options)], work, name)
            (binary,) = (work / "intel").glob("*.bin")
            _run(["ocloc", "disasm", "-q", "-file", str(binary), "-dump", "dump"], work, name)
            found[INTEL] = _intel((work / "dump" / "PTM.txt").read_text())
    return found


def _run(command: list[str], folder: Path, name: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    if done.returncode != 0:
        raise KernelBuildError(f"{name} does not compile by {' '.join(command)}:\n{said}")
    return said


_AMD_TARGET = ["-target", "amdgcn-amd-amdhsa", f"-mcpu={AMD}", "-nogpulib"]
_NVIDIA_TARGET = ["-target", "nvptx64-nvidia-nvcl", "-Xclang", "-target-cpu", "-Xclang", "sm_75"]
_AMD_IMAGES = """
#define __read_only
#define image2d_t __constant const uint8 *
float4 ssgi_image_load(int, int, int, uint8, int, int) __asm("llvm.amdgcn.image.load.2d.v4f32.i32");
#define read_imagef(plane, sampler, at) ssgi_image_load(15, (at).x, (at).y, *(plane), 0, 0)
"""
_NVIDIA_IMAGES = """
#define __read_only
#define image2d_t ulong
static inline float4 ssgi_image_load(const ulong plane, const int2 at)
{
    float4 read;
    __asm("tex.2d.v4.f32.s32 {%0, %1, %2, %3}, [%4, {%5, %6}];"
          : "=f"(read.x), "=f"(read.y), "=f"(read.z), "=f"(read.w) : "l"(plane), "r"(at.x), "r"(at.y));
    return read;
}
#define read_imagef(plane, sampler, at) ssgi_image_load(plane, at)
"""


def _linked(library: str) -> list[str]:
    """Return clang's options that bring libclc's functions for a target."""
    return ["-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(LIBCLC / f"{library}.bc")]


def _clang(folder: Path, name: str, text: str, options: list[str], target: list[str]) -> str:
    (folder / "k.cl").write_text(text)
    header = ["-Xclang", "-finclude-default-header"]
    _run([CLANG, *target, "-x", "cl", *options, *header, "-O3", "-S", "k.cl", "-o", "k.s"], folder, name)
    return (folder / "k.s").read_text()


def _number(pattern: str, text: str) -> int:
    found = re.search(pattern, text)
    if found is None:
        raise ValueError(f"a compiler's output has no {pattern}")
    return int(found[1])


def _amd(assembly: str) -> Usage:
    """Return what the assembler's comments and metadata of an AMD kernel say."""
    return Usage(
        registers=_number(r"; NumVgprs: (\d+)", assembly),
        spills=_number(r"\.vgpr_spill_count: (\d+)", assembly) + _number(r"\.sgpr_spill_count: (\d+)", assembly),
        scratch=_number(r"; ScratchSize: (\d+)", assembly),
        resident=_number(r"; Occupancy: (\d+)", assembly),
        most=AMD_WAVES,
        scalars=_number(r"; NumSgprs: (\d+)", assembly),
        local=_number(r"; LDSByteSize: (\d+)", assembly),
        code=_number(r"; codeLenInByte = (\d+)", assembly),
    )


def _nvidia(said: str, most: int) -> Usage:
    """Return what ptxas says of a kernel, verbosely."""
    registers = _number(r"Used (\d+) registers", said)
    local = re.search(r"(\d+) bytes smem", said)
    return Usage(
        registers=registers,
        spills=_number(r"(\d+) bytes spill stores", said),
        scratch=_number(r"(\d+) bytes stack frame", said),
        resident=warps(registers, most),
        most=most,
        local=int(local[1]) if local else 0,
    )


def _intel(dump: str) -> Usage:
    """Return what ocloc's dump of patch tokens says.

    Token 23 is the execution environment, 38 private memory, 18 scratch space, which spills go to.
    """

    def word(token: int, place: int) -> int:
        """Return a number of the payload of a token; 0 if it is not there."""
        found = re.search(rf"4 Token {token}\n\s*4 Size \d+\n\s*Hex ([^\n]*)", dump)
        four = found[1].split()[4 * place : 4 * place + 4] if found else []
        return int.from_bytes(bytes(int(byte, 16) for byte in four), "little")

    return Usage(
        registers=word(23, 20), spills=word(18, 1), scratch=word(38, 3), resident=word(23, 3), most=INTEL_LANES
    )
