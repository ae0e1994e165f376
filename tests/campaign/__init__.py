"""Faults of every kind, by seeds: `python -m tests.campaign`; docs/reliability.md tells what is promised."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # what tests share, as pytest finds it
