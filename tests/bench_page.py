"""Write what the bench shows into docs/truth.md, from tests/truth/table.md: `python -m tests.bench_page`."""

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "tests" / "truth" / "table.md"
PAGE = ROOT / "docs" / "truth.md"
VERDICTS = ("holds", "named", "refused", "FAILS")
HEADINGS = ("holds", "doubt named", "refused", "fails")
WINDOWS = {
    "check": "untouched windows of 2 and 5 minutes, checked",
    "refresh": "refreshed with 2 minutes of another day",
    "gravity": "gravity sensed on bases that turn, accelerate and shake",
    "torques": "recorded torques with a known fault, or none",
    "unknown arms, even seeds": "ten arms drawn at random, with each of 23 faults or none",
    "unknown arms, odd seeds": "ten others",
}
_BLOCK = re.compile(r"(<!-- bench -->\n).*?(<!-- end -->)", re.DOTALL)


def page() -> str:
    """Return the page with the bench's numbers."""
    counts: dict[str, Counter[str]] = {}
    for line in TABLE.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|") or cells[0] in ("case", "---"):
            continue
        command, *_, what = cells[0].split(": ")
        counts.setdefault(WINDOWS.get(command, what), Counter())[cells[-1].partition(":")[0]] += 1
    failed, every = (sum(c[v] for c in counts.values() for v in names) for names in (("FAILS",), VERDICTS))
    rows = [f"| {what} | {' | '.join(str(count[v] or '-') for v in VERDICTS)} |" for what, count in counts.items()]
    lines = [
        f"{every - failed} of {every} cases pass. By what was done to the recording, for `fit` and `evaluate` together:",
        "",
        f"| | {' | '.join(HEADINGS)} |",
        "|---|---|---|---|---|",
        *rows,
    ]
    return _BLOCK.sub(lambda found: found[1] + "\n".join(lines) + "\n" + found[2], PAGE.read_text())


if __name__ == "__main__":
    PAGE.write_text(page())
