"""Results into the repository: committed tables, pictures, a page for each experiment, and blocks of documents.

Every experiment has a page, docs/results/NAME.md, with all that it left. A document quotes between
`<!-- papers WHAT -->` and `<!-- end -->`, where WHAT is one of

    NAME              its pictures, or its first table if it has none and that is small, and how its claims came out
    NAME TABLE        one table of it, by its number
    counts            how many claims of each paper hold
    total             the same of all, in words
    claims PAPER      the claims by which a paper is known; all of them where they are few

docs/results/claims.md has every claim, a line each.

A reason holds for the numbers that it was read with: `python -m papers confirm NAME ...` says that somebody has read an
experiment's reasons beside its tables. Where numbers change, they are marked, and a test fails, until it is said again.

`python -m papers publish` writes pages and blocks, and a test holds them against the committed tables. What was
measured comes from these. Reasons, and which numbers the robot was fitted to, come from the experiments, so that
telling them better needs no run. Nor does telling or judging otherwise what was measured: `python -m papers judge`
makes tables, pictures and verdicts of the committed raw results.
"""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from catenary.errors import InputError
from catenary.files import write_atomically
from papers.catalog import MODULES, experiment, named
from papers.experiment import BEYOND
from papers.kit import NOT_MEASURED
from papers.results_files import FITTED, RAW, made_with, markdown, shown_verdict

ROOT = Path(__file__).parents[1]
COMMITTED = ROOT / "papers" / "results"
PAGES = ROOT / "docs"
PICTURES = PAGES / "images" / "papers"
RESULTS = PAGES / "results"
BLOCK = re.compile(r"(<!-- papers (?P<what>[^>]*?) -->\n).*?(\n?<!-- end -->)", re.DOTALL)
OLDER = "Older: judged by a criterion that has been corrected since; it is judged by the new one when it runs next."
STALE = " (of older numbers: not read again since they changed)"
REASONS = Path(__file__).parent / "reasons.json"
MARKS = {
    "reproduced": "✓", "same direction": "~", "not reproduced": "✗", "cannot be judged by one session": "?",
    "not measured": "-",
}  # fmt: skip
BESIDE = {"nominal": "nominal robot alone", "variant": "encoders off their centres"}
LEGEND = "✓ reproduced, ~ same direction, ✗ not reproduced, ? one session cannot tell, - not judged yet"
# names of groups of claims and the pages that are about them
GROUPS = {
    "calibration": "[Joint calibration](paper-joint-calibration.md)",
    "gravity": "[Dynamic gravity](paper-dynamic-gravity.md)",
    "regressor": "[Gravity regressor](paper-gravity-regressor.md)",
    "tutorial": "[Mass and gravity](tutorial-two-link.md)",
    BEYOND: "[Beyond the papers](beyond.md)",
}
# of the two papers that claim most
HEADLINES = (
    "Calibration takes 8 to 21 minutes, of which recording takes 4 to 17",
    "Offset > linear > network on every joint, direction J2-J3",
    "J2-J3 is among the two best directions",
    "Beyond the fixed offset the network removes more than 76 % of the error",
    "With little data the network is best",
    "Six unloaded hours: fixed offset, linear model and network lose accuracy on every joint",
    "Under 500 g joint 1 loses about twice as much",
    "138 inputs: the network of 100-100 loses considerably",
    "Homing hurts joint 2 considerably, joints 1 and 3 not",
    "The network is much worse end to end",
    "With DG the PD term exerts nearly zero torque on joint 1 at every base angle",
    "The SG term of joint 1 becomes less accurate at increasing base angles",
    "DG alone holds any pose at every orientation of the base, upside down too",
    "SG alone holds only at or near horizontal",
    "Joint 1's error is about 12 % below PD's with DG at 20 deg",
    "At 20 deg SG's wrong vector has negated its improvement of joint 1",
    "Joint 3 has higher errors with compensation",
    "On the rocking base joint 1's tracking improves by the same 12 %",
    "Compensation has little collective effect on Cartesian tracking",
    "A case exists in which perturbations of the base make an unstable feedback between robot and accelerometer",
)
SHORT, LONG = 14, 30  # words of a number that a line still holds: of every claim, of those on a paper's page
SMALL_ROWS, SMALL_WORDS = 6, 90  # of a table that stands for a picture

Results = Mapping[str, Mapping[str, Any]]


def publish(out: Path, names: Sequence[str] | None = None) -> list[Path]:
    """Take finished results of experiments, or of all, out of a folder into the repository; return what was written."""
    written: list[Path] = []
    finished = [name for name in (MODULES if names is None else names) if (out / f"{name}.json").exists()]
    if names and not finished:
        raise InputError(f"{out}: no results of {', '.join(names)}; run them first, or name their folder by --out")
    for name in finished:
        source = out / f"{name}.json"
        content = json.loads(source.read_text(encoding="utf-8"))
        if content["missing"]:
            raise InputError(f"{source}: {content['missing']} cases are missing; run {name} again")
        if not (raw := out / f"{name}{RAW}").exists():
            raise InputError(f"{raw}: missing; run {name} again")
        COMMITTED.mkdir(exist_ok=True)
        PICTURES.mkdir(parents=True, exist_ok=True)
        for old in PICTURES.glob(f"{name}-[0-9].svg"):
            old.unlink()
        for path, target in [
            *((path, COMMITTED / path.name) for path in (source, raw)),
            *((path, PICTURES / path.name) for path in sorted(out.glob(f"{name}-[0-9].svg"))),
        ]:
            write_atomically(target, path.read_bytes())
            written.append(target)
    results = committed()
    RESULTS.mkdir(parents=True, exist_ok=True)
    anew = {RESULTS / f"{name}.md": page_of(content) for name, content in results.items()}
    anew[RESULTS / "claims.md"] = every_claim(results)
    anew |= {page: with_blocks(page.read_text(encoding="utf-8"), results) for page in documents()}
    for page, text in anew.items():
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            write_atomically(page, text.encode())
            written.append(page)
    return written


def raw_results(words: Sequence[str]) -> list[str]:
    """Return the experiments of which raw results are committed: those that words ask for, or all without words."""
    names = named(words or ["all"])
    committed = [name for name in names if (COMMITTED / f"{name}{RAW}").exists()]
    if not committed:
        raise InputError(f"{COMMITTED}: no raw results of {', '.join(names)}; run them, and publish them")
    return committed


def documents() -> list[Path]:
    """Return the documents that may quote results."""
    return sorted([*PAGES.glob("*.md"), *PAGES.parent.glob("README.md")])


def committed() -> dict[str, dict[str, Any]]:
    """Return committed tables of results by experiment, in the papers' order, claims as the code tells them."""
    return {
        name: with_current_claims(json.loads(path.read_text(encoding="utf-8")))
        for name in MODULES
        if (path := COMMITTED / f"{name}.json").exists()
    }


def with_current_claims(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return results with those claims that their experiment makes today, and what it says of them and of its data.

    A claim that has another criterion since it was judged is marked as older, and one that is new is not measured: both
    are judged when the experiment runs next.
    """
    today, read = experiment(content["name"]), _reasons_read().get(content["name"], {})
    judged = {claim["says"]: claim for claim in content["claims"]}
    claims = []
    for one in today.claims:
        new = {"says": one.says, "place": one.place, "published": one.published, "criterion": one.criterion}
        claim = judged.get(one.says, {**new, **NOT_MEASURED._asdict()})
        stale = bool(one.why) and read.get(one.says) != _reason_of(one.why, claim.get("measured", ""))
        changes = {"why": one.why, "stale": stale, "fitted": one.fitted, "older": claim["criterion"] != one.criterion}
        claims.append(claim | changes)
    return {
        **content, "simulated": today.simulated, "recordings": today.needs_data, "about": today.about, "claims": claims,
    }  # fmt: skip


def confirm(names: Sequence[str]) -> None:
    """Say that the reasons of experiments have been read beside today's numbers."""
    read = _reasons_read()
    for name, content in committed().items():
        if name in names:
            of_claims = {
                one["says"]: _reason_of(one["why"], one["measured"]) for one in content["claims"] if one["why"]
            }
            read[name] = dict(sorted(of_claims.items()))
    write_atomically(REASONS, (json.dumps(dict(sorted(read.items())), indent=1) + "\n").encode())


def _reasons_read() -> dict[str, dict[str, str]]:
    reasons: dict[str, dict[str, str]] = json.loads(REASONS.read_text(encoding="utf-8")) if REASONS.exists() else {}
    return reasons


def _reason_of(why: str, measured: str) -> str:
    """Return eight hexadecimal digits of a reason and the numbers that it is given for."""
    return hashlib.sha256(f"{why}\n{measured}".encode()).hexdigest()[:8]


def with_blocks(text: str, results: Results) -> str:
    """Return a document with its blocks written from results."""
    return BLOCK.sub(lambda match: match[1] + block(match["what"].split(), results) + "\n<!-- end -->", text)


def block(what: Sequence[str], results: Results) -> str:
    """Return what a document quotes, as the module's first lines say."""
    kind, *details = what
    if kind in ("counts", "total"):
        return _counts(results) if kind == "counts" else _total(results)
    if kind == "claims":
        claims = list(_claims(details[0], results))
        known = [one for one in claims if one[1]["says"] in HEADLINES]
        return _scoreboard(known or claims, "results/", LONG) if claims else "*No claim has been judged yet.*"
    content = results.get(kind)
    if content is None:
        return f"*No result is committed yet: `python -m papers {kind}`.*"
    return markdown(content["tables"][int(details[0]) - 1]) if details else _short(content)


def page_of(content: Mapping[str, Any]) -> str:
    """Return the page of an experiment: everything that it left, left out of the site's search."""
    parts = [
        "---\nsearch:\n  exclude: true\n---", f"# {content['title']}: {content['place']}", content["about"],
        *_pictures(content, "../images/papers"),
        *(f"## {table['title']}\n\n{markdown(table)}" for table in content["tables"]),
        *content["remarks"],
    ]  # fmt: skip
    if claims := content["claims"]:
        rows = [
            {
                "claim": one["says"],
                "place": one["place"],
                "published": one["published"],
                "here": one["measured"],
                **{title: one[name] for name, title in BESIDE.items() if name in one},
                "verdict": shown_verdict(one["verdict"], fitted=one["fitted"]),
                "criterion": f"{one['criterion']}{' (older)' if one.get('older') else ''}",
            }
            for one in claims
        ]
        content_of = {"header": list(rows[0]), "rows": [list(row.values()) for row in rows]}
        parts += ["## Claims", markdown(content_of)]
        parts += [FITTED] if any(claim["fitted"] for claim in claims) else []
        parts += [OLDER] if any(claim.get("older") for claim in claims) else []
        parts += [f"*{one['says']}*: {one['why']}{STALE * one.get('stale', False)}" for one in claims if one["why"]]
    parts.append(f"*{made_with(content)} `python -m papers {content['name']}`*")
    return "\n\n".join(parts) + "\n"


def _pictures(content: Mapping[str, Any], folder: str) -> list[str]:
    return [f"![{caption}]({folder}/{content['name']}-{k}.svg)" for k, caption in enumerate(content["pictures"], 1)]


def _short(content: Mapping[str, Any]) -> str:
    """Return what a document shows of an experiment."""
    parts = _pictures(content, "images/papers")
    if not parts:
        small = [one for one in content["tables"] if len(one["rows"]) <= SMALL_ROWS and _words(one) <= SMALL_WORDS]
        parts += [f"{table['title']}:\n\n{markdown(table)}" for table in small[:1]]
    counted = Counter(claim["verdict"] for claim in content["claims"])
    counts = ", ".join(f"{counted[verdict]} {verdict}" for verdict in MARKS if counted[verdict])
    of = f"Claims: {counts}. " if counts else ""
    parts.append(f"*{of}[Numbers, criteria, reasons and conditions](results/{content['name']}.md).*")
    return "\n\n".join(parts)


def _words(table: Mapping[str, Any]) -> int:
    return sum(len(cell.split()) for row in table["rows"] for cell in row)


def _claims(group: str, results: Results) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield experiments and claims of a paper, or those that stand in none."""
    for name, content in results.items():
        for claim in content["claims"]:
            if group == (BEYOND if claim["place"].startswith(BEYOND) else content["paper"]):
                yield name, claim


def every_claim(results: Results) -> str:
    """Return the page of all claims."""
    parts = [
        "# Every claim of the papers",
        "What the paper says, its number, ours, and whether it holds. *Fitted*: the simulated robot was fitted to this "
        "number, which is then no evidence.",
    ]
    for group, page in GROUPS.items():
        parts += [f"## {page[1:].partition(']')[0]}", _scoreboard(list(_claims(group, results)), "", SHORT)]
    return "\n\n".join([*parts, "**Read next:** [the four papers](../papers.md)."]) + "\n"


def _tally(claims: Iterable[Mapping[str, Any]]) -> list[int]:
    """Return how many claims there are, hold, hold in direction, do not, cannot be judged, and were fitted to."""
    every = [claim for claim in claims if claim["verdict"] != NOT_MEASURED.verdict]
    counted = Counter(claim["verdict"] for claim in every)
    return [len(every), *(counted[verdict] for verdict in list(MARKS)[:4]), sum(claim["fitted"] for claim in every)]


def _counts(results: Results) -> str:
    tallies = {page: _tally(claim for _, claim in _claims(group, results)) for group, page in GROUPS.items()}
    rows = [[page, *map(str, tally)] for page, tally in tallies.items()]
    return markdown(
        {
            "header": [
                "",
                "claims",
                "reproduced",
                "same direction",
                "not reproduced",
                "one session cannot tell",
                "of these fitted",
            ],
            "rows": rows,
        }
    )


def _total(results: Results) -> str:
    papers = [group for group in GROUPS if group != BEYOND]
    every, held, alike, not_held, chance, fitted = _tally(
        claim for group in papers for _, claim in _claims(group, results)
    )
    return (
        f"Of {every} claims of the four papers, {held} are reproduced on simulated robots, {alike} in direction, "
        f"{not_held} are not, and {chance} the paper's one session cannot tell; the simulated robot was fitted to "
        f"{fitted} of them."
    )


def _scoreboard(claims: Sequence[tuple[str, Mapping[str, Any]]], folder: str, words: int) -> str:
    """Return a line for each claim; its mark leads to the numbers, the criterion and the reason."""
    rows = [
        [
            claim["says"],
            _brief(claim["published"], words),
            _brief(claim["measured"], words),
            f"[{MARKS[claim['verdict']]}]({folder}{name}.md#claims){' fitted' if claim['fitted'] else ''}"
            f"{' older' if claim.get('older') else ''}",
        ]
        for name, claim in claims
    ]
    table = markdown({"header": ["claim", "published", "here", ""], "rows": rows})
    return f"{table}\n\n*{LEGEND}; the mark leads to criterion, numbers and reason.*"


def _brief(numbers: str, words: int) -> str:
    """Return numbers as a line holds them: of long ones the first, and how many parts hold where that is told."""
    parts = numbers.split()
    if len(parts) <= words:
        return numbers
    counted = re.search(r"\((\d+ of \d+)[^()]*\)$", numbers)
    first = re.match(r"(.*[\d%a-z])\W", " ".join(parts[:words]) + " ")
    return f"{first[1] if first else parts[0]} …{f' ({counted[1]} parts hold)' if counted else ''}"
