"""Benchmarks: `python -m tests.benchmarks.NAME` from the repository's root finds what tests share, as pytest does."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
