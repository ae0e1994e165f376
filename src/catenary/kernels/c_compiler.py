"""Kernels by a C compiler, where there is one with Python's and NumPy's headers: somewhat quicker than numba's."""

import logging
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from hashlib import sha256
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np

from catenary.kernels.c_source import extension_source
from catenary.kernels.kernel_files import forget, keep_with_digest, kept_with_digest, private_folder
from catenary.kernels.tracing import Line

COMPILERS = ("cc", "gcc", "clang")
# as written: no fused products and sums, so that the bits are those of numba's kernels
FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-shared")
_log = logging.getLogger(__name__)


def load_extension(
    stem: str, line: Line, shape: tuple[int, ...], folder: Path | None = None
) -> ModuleType | None:
    """Compile a line of operations as an extension module, or find it compiled; None where that cannot be done.

    The library lies where kernels do (kernel_files.py) and is loaded only if it holds, to the byte, what the
    compiler gave: its digest lies beside it.
    """
    placeholder = extension_source("NAME", line, shape)
    processor = _processor()
    of = "\n".join([placeholder, *FLAGS, processor, EXTENSION_SUFFIXES[0], np.__version__, sys.version])
    digest = sha256(of.encode()).hexdigest()[:32]
    name = f"_catenary_c_kernel_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    try:
        private = private_folder(folder)
        library = private / f"{stem}-{digest}{EXTENSION_SUFFIXES[0]}"
        if kept_with_digest(library) is None:
            forget(library)
            own = ("-march=native",) if processor else ()
            _compile(extension_source(name, line, shape), library, (*FLAGS, *own))
        spec = spec_from_file_location(name, library, loader=ExtensionFileLoader(name, str(library)))
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
    except (OSError, RuntimeError, ImportError, subprocess.SubprocessError) as error:
        _log.info("no kernel by a C compiler: %s", error)
        return None
    sys.modules[name] = module
    return module


def _processor() -> str:
    """Tell processors apart: a home may be shared by several. Empty where that is not known."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return ""
    return next((row for row in text.splitlines() if row.startswith(("flags", "Features"))), "")


def _compile(source: str, library: Path, flags: Sequence[str]) -> None:
    """Compile a source into a private library.

    Raises:
        FileNotFoundError: No compiler, or no headers.
        SubprocessError: The compiler fails.
    """
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    headers = [Path(sysconfig.get_path("include")), Path(np.get_include())]
    if compiler is None:
        raise FileNotFoundError(f"none of {', '.join(COMPILERS)} is installed")
    if not (headers[0] / "Python.h").is_file():
        raise FileNotFoundError(f"{headers[0] / 'Python.h'} is missing")
    with tempfile.TemporaryDirectory(dir=library.parent) as work:
        (Path(work) / "kernel.c").write_text(source)
        result = Path(work) / "kernel.so"
        command = [compiler, *flags, *(f"-I{folder}" for folder in headers)]
        subprocess.run(
            [*command, "-o", str(result), str(Path(work) / "kernel.c"), "-lm"],
            check=True,
            capture_output=True,
            timeout=120.0,
        )
        content = result.read_bytes()
    keep_with_digest(library.name, content, library.parent)
