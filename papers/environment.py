"""What numbers depend on beside the code and its data: versions of libraries, and the processor.

On equal ones, with one thread, results are the same to the last bit. Other versions may compute by other methods, so
that a cluster has to have the same. On another processor sums are taken in another order, as BLAS and compiled code
choose their instructions by it: last digits differ, within the tolerances below.
"""

import functools
import importlib
import platform
import sys
from importlib.metadata import PackageNotFoundError, version

import llvmlite.binding
from threadpoolctl import threadpool_info

LIBRARIES = ("numpy", "scipy", "numba", "scikit-learn", "mujoco", "clarabel")  # that compute what is kept
# how far results differ by the processor, a share of each number. Quick cases of 14 experiments were run with BLAS for
# Haswell, of 8 for Sandybridge, in place of SkylakeX: they differ by 3e-12 at most, by 2e-7 where networks are trained
TOLERANCE = 1e-9
TOLERANCE_OF_NETWORKS = 1e-4
NEGLIGIBLE = 1e-12  # differences as good as none, of numbers that are nearly zero


@functools.cache
def versions() -> str:
    """Return the versions of Python and of the libraries that results depend on."""
    parts = [f"Python {sys.version_info.major}.{sys.version_info.minor}"]
    for name in LIBRARIES:
        try:
            parts.append(f"{name} {version(name)}")
        except PackageNotFoundError:  # an extra
            parts.append(f"no {name}")
    return ", ".join(parts)


@functools.cache
def processor() -> str:
    """Return the processor for which compiled code and BLAS choose their instructions."""
    for loading_blas in ("numpy", "scipy.linalg"):
        importlib.import_module(loading_blas)
    kernels = sorted({one["architecture"] for one in threadpool_info() if "architecture" in one})
    return f"{platform.machine()} {llvmlite.binding.get_host_cpu_name()}, BLAS for {' and '.join(kernels) or 'any'}"


def environment() -> str:
    """Return both in one line, which every result keeps."""
    return f"{versions()}, {processor()}"
