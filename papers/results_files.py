"""What an experiment leaves: a table of results that is committed, a page, pictures; what is printed on the way."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from catenary.files import json_text, write_atomically
from catenary.reports.page import Block, Heading, Remarks, Text, picture, write_page
from catenary.tables import Table
from papers.experiment import Case, Claim, Experiment, Judgement, Outcomes, Report, Scope
from papers.kit import NOT_MEASURED, Missing
from papers.store import Finished, write_raw

RAW = ".raw.json.xz"  # ending of the file that holds what the cases of an experiment left
FITTED = "Fitted: the simulated robot was fitted to this number, or to one that implies it."


def judged(experiment: Experiment, outcomes: Outcomes) -> list[tuple[Claim, Judgement]]:
    """Return every claim with what was measured of it; where a judge misses a case, it is not measured."""
    return [(claim, _judged(claim, outcomes) if len(outcomes) else NOT_MEASURED) for claim in experiment.claims]


def _judged(claim: Claim, outcomes: Outcomes) -> Judgement:
    try:
        return claim.judge(outcomes)
    except Missing:
        return NOT_MEASURED


def shown_verdict(verdict: str, *, fitted: bool) -> str:
    """Return a verdict as pages show it: with the mark of those claims whose number the robot was fitted to."""
    return f"{verdict} (fitted)" if fitted else verdict


def verdict_table(claims: Sequence[tuple[Claim, Judgement]]) -> Table:
    """Return claims beside what came out of them."""
    return Table(
        ["claim", "published", "here", "verdict", "criterion"],
        [
            [
                f"{claim.says} ({claim.place})",
                claim.published,
                judgement.measured,
                shown_verdict(judgement.verdict, fitted=claim.fitted),
                claim.criterion,
            ]
            for claim, judgement in claims
        ],
    )


def summary(
    experiment: Experiment,
    scope: Scope,
    report: Report,
    claims: Sequence[tuple[Claim, Judgement]],
    finished: Sequence[Finished],
    missing: int,
    outcomes: Outcomes,
) -> dict[str, Any]:
    """Return an experiment's table of results as plain data: what docs quote, and where it comes from."""
    views = {"nominal": outcomes.nominal, "variant": outcomes.variant}
    beside = {name: judged(experiment, view) for name, view in views.items() if claims and view}
    return {
        "name": experiment.name,
        "paper": experiment.paper,
        "place": experiment.place,
        "title": experiment.title,
        "simulated": experiment.simulated,
        "recordings": experiment.needs_data,
        "version": ", ".join(sorted({one.version for one in finished})),
        "source": sorted({one.source for one in finished}),
        "environments": sorted({one.environment for one in finished} - {""}),
        "date": _days([one.date for one in finished]),
        "robots": ["nominal" if robot is None else robot for robot in scope.robots],
        "networks": outcomes.trainings,  # how often each was trained
        "cases": len(finished),
        "missing": missing,
        "processor_minutes": round(sum(one.processor_seconds for one in finished) / 60.0, 1),
        "tables": [
            {"title": one.title, "header": list(one.table.header), "rows": [list(row) for row in one.table.rows]}
            for one in report.tables
        ],
        "pictures": list(report.pictures),
        "remarks": list(report.remarks),
        "claims": [
            {
                "says": claim.says,
                "place": claim.place,
                "published": claim.published,
                "criterion": claim.criterion,
                "measured": judgement.measured,
                "verdict": judgement.verdict,
                **{name: f"{of[k][1].measured}: {of[k][1].verdict}" for name, of in beside.items()},
            }
            for k, (claim, judgement) in enumerate(claims)
        ],
    }


def _days(dates: Sequence[str]) -> str:
    """Return the day on which cases ended, or the first and the last where they are several."""
    first, last = min(dates)[:10], max(dates)[:10]
    return first if first == last else f"{first} to {last}"


def outcome(
    experiment: Experiment, scope: Scope, kept: Mapping[Case, Finished], missing: int = 0
) -> tuple[dict[str, Any], Report, list[tuple[Claim, Judgement]]]:
    """Return what NAME.json holds, the report, and the verdicts: none of quick results, or where cases are missing."""
    outcomes = Outcomes({case: finished.result for case, finished in kept.items()})
    report = experiment.report(outcomes)
    claims = judged(experiment, outcomes) if not (scope.quick or missing) else []
    finished = list(kept.values())
    return (summary(experiment, scope, report, claims, finished, missing, outcomes), report, claims)


def write_results(
    folder: Path, experiment: Experiment, scope: Scope, kept: Mapping[Case, Finished], missing: int = 0
) -> dict[str, Any]:
    """Write NAME.json, NAME.raw.json.xz, NAME.html and NAME-1.svg ... into a folder; return what NAME.json holds."""
    content, report, claims = outcome(experiment, scope, kept, missing)
    folder.mkdir(parents=True, exist_ok=True)
    write_raw(folder / f"{experiment.name}{RAW}", kept)
    for number, drawn in enumerate(report.pictures.values(), 1):
        write_atomically(folder / f"{experiment.name}-{number}.svg", svg(drawn))
    blocks: list[Block] = [Text(paragraph) for paragraph in experiment.about.split("\n\n")]
    if missing:
        blocks.append(Text(f"{missing} cases are missing: see the folder failures, and run it again."))
    blocks += [picture(drawn, caption) for caption, drawn in report.pictures.items()]
    for one in report.tables:
        blocks += [Heading(one.title), one.table]
    if report.remarks:
        blocks.append(Remarks(report.remarks))
    if claims:
        blocks += [Heading("Claims"), verdict_table(claims)]
        reasons = [f"{claim.says}: {claim.why}" for claim, _ in claims if claim.why]
        blocks.append(Remarks([FITTED, *reasons] if any(claim.fitted for claim, _ in claims) else reasons))
    blocks.append(Text(made_with(content)))
    title = f"{experiment.title}{', simulated' if experiment.simulated else ''}"
    write_page(folder / f"{experiment.name}.html", title, experiment.place, blocks, simulated=experiment.simulated)
    write_atomically(folder / f"{experiment.name}.json", json_text(content).encode())
    return content


def made_with(content: Mapping[str, Any]) -> str:
    """Say in a sentence what results were made with."""
    robots = ", ".join(str(robot) for robot in content["robots"])
    times = " or ".join(str(count) for count in content["networks"])
    trained = f", each network trained {times} times and errors averaged" if times not in ("", "1") else ""
    recorded = ", and recordings of real arms" if content["recordings"] else ""
    kind = f"Simulated robots {robots}{recorded}{trained}" if content["simulated"] else "Measured on real arms"
    return f"{kind}; {content['cases']} cases; catenary {content['version']}, {content['date']}."


def markdown(table: Mapping[str, Any]) -> str:
    """Return a table of results as Markdown."""
    lines = ["| " + " | ".join(table["header"]) + " |", "|" + "---|" * len(table["header"])]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in table["rows"]]
    return "\n".join(lines)


def svg(figure: Any) -> bytes:
    """Return a matplotlib figure as SVG, the same bytes for the same picture."""
    import matplotlib

    for axes in figure.axes:
        if axes.name == "rectilinear":
            axes.spines[["top", "right"]].set_visible(False)
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "catenary", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
