"""What stands in LaTeX read back as numbers: sums of products such as -0.5 c_{1} s_{23} + \\cos(q_{1}-q_{2})."""

import re
from collections.abc import Mapping

import numpy as np

ATOM = {"c": np.cos, "s": np.sin}
NAME = r"(?:\\gamma|u)_\{[\d,]+,[xyz]\}"


def value(text: str, q: np.ndarray, named: Mapping[str, float] | None = None) -> float:
    """Evaluate a sum of products of joints q, and of names that have values."""
    text = re.sub(NAME, lambda m: f"({(named or {})[m[0]]!r})", text)
    text = re.sub(r"\\(cos|sin)\(([^)]*)\)", r"np.\1(\2)", text)
    text = re.sub(r"(?<![\w}])([cs])_\{([\d,]+)\}", lambda m: f"({float(ATOM[m[1]](_sum(m[2], q)))!r})", text)
    text = re.sub(r"q_\{(\d+)\}", lambda m: f"({float(q[int(m[1]) - 1])!r})", text)
    words = re.sub(r"(?<=[\d)]) (?=[\d(n])", " * ", text)
    return float(eval(words, {"np": np}))


def values(lines: list[str], q: np.ndarray) -> dict[str, float]:
    """Evaluate lines of the kind name = sum, each in terms of names before it."""
    found: dict[str, float] = {}
    for line in lines:
        name, text = line.split(" = ", 1)
        found[name] = value(text, q, found)
    return found


def _sum(indices: str, q: np.ndarray) -> float:
    return sum(q[int(k) - 1] for k in (indices.split(",") if "," in indices else indices))
