"""Exported headers, compiled as a user compiles them and run on rows of numbers."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

COMPILERS = {"C99": ("gcc", "-std=c99", "-x", "c"), "C++11": ("g++", "-std=c++11", "-x", "c++")}
LANGUAGES = ["C99", pytest.param("C++11", marks=pytest.mark.slow)]


def output_of(header: str, body: str, rows: np.ndarray, folder: Path, language: str) -> np.ndarray:
    """Run `body` on each row (`r`, doubles), compiled with every warning an error; it puts numbers out."""
    compiler = COMPILERS[language]
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"{compiler[0]} is not installed")
    (folder / "robot.h").write_text(header)
    (folder / "main.c").write_text(
        '#include <stdio.h>\n#include "robot.h"\n#define PUT(v) do { const double v_ = (v); fwrite(&v_, 8, 1, stdout); } while (0)\n'
        f"int main(void) {{\n  double r[{rows.shape[1]}];\n  int i;\n  (void)i;\n{body.partition('LOOP')[0]}"
        f"  while (fread(r, 8, {rows.shape[1]}, stdin) == {rows.shape[1]}) {{\n{body.partition('LOOP')[2]}  }}\n  return 0;\n}}\n"
    )
    strict = ["-O1", "-Wall", "-Wextra", "-Werror", "-pedantic", str(folder / "main.c")]
    subprocess.run([*compiler, *strict, "-x", "none", "-lm", "-o", str(folder / "main")], check=True)
    given = subprocess.run([folder / "main"], input=rows.tobytes(), capture_output=True, check=True).stdout
    return np.frombuffer(given).reshape(len(rows), -1)


def puts(**sizes: int) -> str:
    return "".join(f"  for (i = 0; i < {n}; ++i) PUT({name}[i]);\n" for name, n in sizes.items())


def prefix_of(header: str) -> str:
    found = re.search(r"void (\w+)_gravity\(", header)
    assert found
    return found.group(1)
