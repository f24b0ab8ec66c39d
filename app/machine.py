"""The type of processor that something was computed on: on another type, a number may differ in its last bits.

numpy, numba and LLVM choose their code by what the processor can do. One flipped acceptance of the sampler changes
everything that follows, so a session is derived again bit for bit only on the type that it was computed on.
"""

from __future__ import annotations

import platform
import re
from functools import cache
from pathlib import Path

from llvmlite import binding

# The extensions that change how floating-point numbers are computed, on x86 and on ARM.
_ARITHMETIC = re.compile(r"sse4\.2|avx.*|fma4?|neon|sve.*|fullfp16")


@cache
def machine() -> str:
    """Returns the processor's type: architecture, model, LLVM's name for it, and extensions for arithmetic.

    An example is `x86_64, AMD EPYC (znver4): avx avx2 fma sse4.2`.
    """
    has = binding.get_host_cpu_features()
    extensions = sorted(name for name, is_there in has.items() if is_there and _ARITHMETIC.fullmatch(name))
    return f"{platform.machine()}, {cpu_model()} ({binding.get_host_cpu_name()}): {' '.join(extensions)}"


def cpu_model() -> str:
    """Returns the processor's name, as its maker or the virtual machine gives it."""
    description = Path("/proc/cpuinfo")
    if description.exists():
        for line in description.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
