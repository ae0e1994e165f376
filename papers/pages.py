"""Results into the repository: committed tables, pictures, and the blocks of documents that quote them.

A document quotes an experiment between `<!-- papers NAME -->` and `<!-- end -->`, one table of it by
`<!-- papers NAME TABLE -->`, and every claim of a paper by `<!-- papers claims PAPER -->`. What stands between is
written by `python -m papers publish`, and a test holds it against the committed tables.

What was measured comes from the committed tables. Reasons, and which numbers the robot was fitted to, come from the
experiments, so that telling them better needs no run.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from catenary.errors import InputError
from catenary.files import write_atomically
from papers.catalog import MODULES, experiment
from papers.experiment import BEYOND
from papers.results_files import markdown, shown_verdict, told_of

ROOT = Path(__file__).parents[1]
COMMITTED = ROOT / "papers" / "results"
PICTURES = ROOT / "docs" / "images" / "papers"
PAGES = ROOT / "docs"
BLOCK = re.compile(r"(<!-- papers (?P<what>[^>]*?) -->\n).*?(\n?<!-- end -->)", re.DOTALL)
CLAIMS = ["claim", "published", "here", "verdict"]
EVERY_CLAIM = ["claim", "place", "published", "here", "verdict", "criterion"]


def publish(out: Path, names: Sequence[str] | None = None) -> list[Path]:
    """Take finished results into the repository, and write the documents' blocks anew; return what was written.

    Args:
        out: Where they were run.
        names: Of experiments; those that have not run are left as they are. All of them when None.

    Raises:
        InputError: None that is named has results, or cases of one are missing.
    """
    written: list[Path] = []
    finished = [name for name in (MODULES if names is None else names) if (out / f"{name}.json").exists()]
    if names and not finished:
        raise InputError(f"{out}: no results of {', '.join(names)}; run them first, or name their folder by --out")
    for name in finished:
        source = out / f"{name}.json"
        content = json.loads(source.read_text(encoding="utf-8"))
        if content["missing"]:
            raise InputError(f"{source}: {content['missing']} cases are missing; run {name} again")
        COMMITTED.mkdir(exist_ok=True)
        PICTURES.mkdir(parents=True, exist_ok=True)
        for old in PICTURES.glob(f"{name}-[0-9].svg"):
            old.unlink()
        for path, target in [
            (source, COMMITTED / source.name),
            *((path, PICTURES / path.name) for path in sorted(out.glob(f"{name}-[0-9].svg"))),
        ]:
            write_atomically(target, path.read_bytes())
            written.append(target)
    results = committed()
    for page in sorted(PAGES.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        anew = with_blocks(text, results)
        if anew != text:
            write_atomically(page, anew.encode())
            written.append(page)
    return written


def committed() -> dict[str, dict[str, Any]]:
    """Return committed tables of results by experiment, in the papers' order, claims as the code tells them."""
    return {
        name: as_told_today(json.loads(path.read_text(encoding="utf-8")))
        for name in MODULES
        if (path := COMMITTED / f"{name}.json").exists()
    }


def as_told_today(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return results with those claims that their experiment makes today, and what it says of them and of its data."""
    today = experiment(content["name"])
    made = {claim.says: claim for claim in today.claims}
    claims = [
        {**claim, "why": made[says].why, "fitted": made[says].fitted}
        for claim in content["claims"]
        if (says := claim["says"]) in made
    ]
    return {**content, "simulated": today.simulated, "recordings": today.needs_data, "claims": claims}


def with_blocks(text: str, results: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a document with its blocks written from results."""
    return BLOCK.sub(lambda found: found[1] + block(found["what"].split(), results) + "\n<!-- end -->", text)


def block(what: Sequence[str], results: Mapping[str, Mapping[str, Any]]) -> str:
    """Return what a document quotes: `NAME`, `NAME NUMBER` of a table, `claims PAPER`, or `claims beyond`."""
    if what[0] == "claims":
        return _claims(what[1], results)
    content = results.get(what[0])
    if content is None:
        return f"*No result is committed yet: `python -m papers {what[0]}`.*"
    if len(what) > 1:
        return markdown(content["tables"][int(what[1]) - 1])
    parts = [
        f"![{caption}](images/papers/{content['name']}-{number}.svg)"
        for number, caption in enumerate(content["pictures"], 1)
    ]
    parts += [f"{table['title']}:\n\n{markdown(table)}" for table in content["tables"]]
    parts += list(content["remarks"])
    if content["claims"]:
        parts.append(markdown({"header": CLAIMS, "rows": [_row(claim) for claim in content["claims"]]}))
        parts += [f"{claim['says']}: {claim['why']}" for claim in content["claims"] if claim["why"]]
    parts.append(f"*{told_of(content)} `python -m papers {content['name']}`*")
    return "\n\n".join(parts)


def _row(claim: Mapping[str, Any]) -> list[str]:
    return [
        f"{claim['says']} ({claim['place']}). Criterion: {claim['criterion']}",
        claim["published"],
        claim["measured"],
        shown_verdict(claim["verdict"], fitted=claim["fitted"]),
    ]


def _claims(paper: str, results: Mapping[str, Mapping[str, Any]]) -> str:
    """Return every claim of a paper, or every one that stands in none."""
    rows = [
        [
            *(claim[part] for part in ("says", "place", "published", "measured")),
            shown_verdict(claim["verdict"], fitted=claim["fitted"]),
            claim["criterion"],
        ]
        for content in results.values()
        for claim in content["claims"]
        if paper == (BEYOND if claim["place"].startswith(BEYOND) else content["paper"])
    ]
    if not rows:
        return "*No claim of this paper has been judged yet.*"
    return markdown({"header": EVERY_CLAIM, "rows": rows})
