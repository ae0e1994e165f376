"""Documents quote committed tables: blocks are what `publish` writes, and no measured number stands outside of one."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from catenary.errors import InputError
from catenary.files import json_text
from catenary.spatial import STANDARD_GRAVITY
from papers import catalog, pages
from papers.experiment import Scope
from papers.pages import HEADLINES, ROOT, block, committed, every_claim, page_of, publish, with_blocks
from papers.results_files import RAW, outcome
from papers.store import read_raw, write_raw

QUOTING = [page for page in pages.documents() if "<!-- papers " in page.read_text()]
OF_PAPERS = [
    page for page in QUOTING if page.stem.startswith("paper-") or page.stem in ("beyond", "papers", "tutorial-two-link")
]
NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?"
UNIT = r"(?:deg|degrees|rad|mm|m|Nm|N|us|ms|s|min|minutes|hours|Hz|kg|g|times)\b|%"
# decimals, and integers with a unit
TOLD = rf"(?<![\w.])\d+\.\d+(?:e[+-]?\d+)?(?![\w.]|\.\d)|(?<![\w.,/-])\d+(?= ?(?:{UNIT}))"
PUBLISHED = (ROOT / "papers" / "calibration" / "published.py").read_text()

RESULTS = {
    "calibration-table-1": {
        "name": "calibration-table-1",
        "paper": "calibration",
        "title": "Directions",
        "place": "table I",
        "about": "What was chosen.",
        "simulated": True,
        "recordings": False,
        "robots": ["nominal", 1],
        "networks": [3, 5],
        "cases": 2,
        "missing": 0,
        "version": "0.1.0",
        "date": "2026-11-23",
        "tables": [{"title": "J1 [deg]", "header": ["a", "b"], "rows": [["x|y", "0.1"]]}],
        "pictures": ["RMSE by direction"],
        "remarks": ["Said beside it."],
        "claims": [
            {
                "says": "A > B",
                "place": "II-E",
                "published": "2 > 1",
                "criterion": "holds",
                "measured": "1 > 2",
                "verdict": "not reproduced",
                "why": "since",
                "fitted": True,
            }
        ],
    }
}


def with_claim(**parts: Any) -> dict[str, Any]:
    """Return the results, parts of their claim being others."""
    content = RESULTS["calibration-table-1"]
    (claim,) = content["claims"]
    return {"calibration-table-1": {**content, "claims": [claim | parts]}}


@pytest.mark.parametrize("page", QUOTING, ids=lambda page: page.stem)
def test_blocks_of_a_document_are_what_the_committed_tables_say(page: Path) -> None:
    text = page.read_text()
    assert with_blocks(text, committed()) == text, "run `python -m papers publish`"


def test_every_experiment_and_all_claims_have_a_page_that_says_what_the_committed_tables_do() -> None:
    results = committed()
    pages_of = {name: page_of(content) for name, content in results.items()} | {"claims": every_claim(results)}
    assert {path.stem: path.read_text() for path in pages.RESULTS.glob("*.md")} == pages_of
    assert set(HEADLINES) <= {claim["says"] for content in results.values() for claim in content["claims"]}


def test_a_block_counts_claims_and_leads_to_their_criteria() -> None:
    short = block(["calibration-table-1"], RESULTS)
    assert "1 not reproduced" in short
    assert "(results/calibration-table-1.md)" in short
    assert "criterion" not in short
    assert "| A > B | 2 > 1 | 1 > 2 | [✗](results/calibration-table-1.md#claims) fitted |" in block(
        ["claims", "calibration"], RESULTS
    )
    long = with_claim(measured=f"{'0.1 ' * 40}(2 of 3)", published="0.1 " * 40)
    assert f"| {'0.1 ' * 30}… | {'0.1 ' * 30}… (2 of 3 parts hold) |" in block(["claims", "calibration"], long)
    assert "| 1 | 0 | 0 | 1 | 0 | 1 |" in block(["counts"], RESULTS)
    assert "Of 1 claims of the four papers, 0 are reproduced" in block(["total"], RESULTS)
    for told in ("Criterion", "holds", "*A > B*: since", "not reproduced (fitted)", "What was chosen.", "x\\|y"):
        assert told.lower() in page_of(RESULTS["calibration-table-1"]).lower()


def without_source(text: str, results: dict[str, Any]) -> list[str]:
    """Return the numbers of a page, outside blocks and in reasons, that nothing on it gives.

    What gives a number: the pages of the experiments that it quotes, without their reasons; other blocks; published.py;
    and standard gravity.
    """
    quoted = [found["what"].split() for found in pages.BLOCK.finditer(text)]
    told = [re.sub(pages.BLOCK, "", text)]
    known = [PUBLISHED, f"{STANDARD_GRAVITY:.2f}"]
    unreasoned = {
        name: {**content, "claims": [{**claim, "why": ""} for claim in content["claims"]]}
        for name, content in results.items()
    }
    for what in quoted:
        known.append(page_of(unreasoned[what[0]]) if what[0] in results else block(what, unreasoned))
        if what[0] in results:
            told += [claim["why"] for claim in results[what[0]]["claims"]]
    prose = re.sub(r"^```.*?^```|`[^`\n]*`", "", "\n".join(told), flags=re.MULTILINE | re.DOTALL)
    return sorted(set(re.findall(TOLD, prose)) - set(re.findall(NUMBER, "\n".join(known))))


@pytest.mark.parametrize("page", OF_PAPERS, ids=lambda page: page.stem)
def test_numbers_in_prose_and_reasons_stand_in_a_block_of_the_page_or_are_the_papers(page: Path) -> None:
    assert without_source(page.read_text(), committed()) == []


def test_a_number_that_no_block_of_its_page_shows_is_found() -> None:
    quoting = "\n<!-- papers calibration-table-1 1 -->\n<!-- end -->\n"
    assert without_source("At 0.1 deg and 43 Hz, `1.234`." + quoting, RESULTS) == ["43"]
    typed = "It was 0.777 deg and 41 mm after 4321 turns"
    assert without_source(typed + quoting, RESULTS) == ["0.777", "41"]
    assert without_source(quoting, with_claim(why="since 0.777 is so")) == ["0.777"]


@pytest.mark.parametrize("name", sorted(path.stem for path in pages.COMMITTED.glob("*.json")))
def test_committed_claims_are_those_that_the_experiment_makes_and_an_older_criterion_is_marked(name: str) -> None:
    content = json.loads((pages.COMMITTED / f"{name}.json").read_text())
    judged = content["claims"]
    kept = {tuple(claim[part] for part in ("says", "place", "published")) for claim in judged}
    made = [(one.says, one.place, one.published) for one in catalog.experiment(name).claims]
    assert all(len(row) == len(table["header"]) for table in content["tables"] for row in table["rows"])
    assert len(content["pictures"]) == len(list(pages.PICTURES.glob(f"{name}-[0-9].svg")))
    assert kept <= set(made), f"a claim has changed since it was judged: judge {name} again, then publish"
    told = pages.with_current_claims(content)
    assert [(claim["says"], claim["place"], claim["published"]) for claim in told["claims"]] == made
    marked = any(claim["older"] for claim in told["claims"])
    assert marked == (pages.OLDER in page_of(told))
    raw = (pages.COMMITTED / f"{name}{RAW}").exists()
    assert not raw or (not marked and len(judged) == len(made)), f"judge {name} again, then publish"


@pytest.mark.alike
@pytest.mark.parametrize("name", sorted(path.name.removesuffix(RAW) for path in pages.COMMITTED.glob(f"*{RAW}")))
def test_committed_tables_and_verdicts_follow_from_committed_raw_results(name: str) -> None:
    told = json.loads((pages.COMMITTED / f"{name}.json").read_text())
    robots = tuple(None if robot == "nominal" else robot for robot in told["robots"])
    content, _, _ = outcome(catalog.experiment(name), Scope(robots), read_raw(pages.COMMITTED / f"{name}{RAW}"))
    assert json.loads(json_text(content)) == told, f"judge {name} again, then publish"


def test_reasons_and_what_was_fitted_are_as_the_experiment_says_today(monkeypatch: pytest.MonkeyPatch) -> None:
    one = catalog.experiment("calibration-table-1")
    claims = [replace(claim, why=f"since {n}", fitted=n == 0, criterion=f"{n}") for n, claim in enumerate(one.claims)]
    monkeypatch.setattr(pages, "experiment", lambda _: replace(one, claims=claims))
    judged = [{"says": claim.says, "why": "before", "criterion": "1", "verdict": "reproduced"} for claim in claims[1:]]
    told = pages.with_current_claims({"name": one.name, "claims": judged})["claims"]
    assert [(each["says"], each["why"], each["fitted"], each["older"], each["verdict"]) for each in told] == [
        (claim.says, claim.why, claim.fitted, n > 1, "reproduced" if n else "not measured")
        for n, claim in enumerate(claims)
    ]
    assert "fitted older |" in block(["claims", "calibration"], with_claim(older=True))
    assert "holds (older) |" in page_of(with_claim(older=True)["calibration-table-1"])


def test_a_page_has_a_column_of_the_nominal_robot_alone_where_others_ran() -> None:
    assert "nominal robot alone" not in page_of(RESULTS["calibration-table-1"])
    page = page_of(with_claim(nominal="3 > 1: reproduced")["calibration-table-1"])
    assert "| here | nominal robot alone | verdict |" in page
    assert "| 1 > 2 | 3 > 1: reproduced | not reproduced (fitted) |" in page


@pytest.mark.parametrize("page", QUOTING, ids=lambda page: page.stem)
def test_every_block_names_a_committed_result_or_the_claims_of_a_paper(page: Path) -> None:
    named = {found["what"].split()[0] for found in pages.BLOCK.finditer(page.read_text())}
    assert named <= {"claims", "counts", "total", *committed()}


def test_results_with_missing_cases_are_not_published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("COMMITTED", "PICTURES", "PAGES", "RESULTS"):
        monkeypatch.setattr(pages, name, tmp_path / name.lower())
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "page.md").write_text("<!-- papers calibration-table-1 1 -->\n\n<!-- end -->\n")
    content = RESULTS["calibration-table-1"]
    (tmp_path / "calibration-table-1.json").write_text(json.dumps({**content, "missing": 1}))
    with pytest.raises(InputError, match="1 cases are missing"):
        publish(tmp_path, ["calibration-table-1"])
    (tmp_path / "calibration-table-1.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"raw\.json\.xz: missing; run calibration-table-1 again"):
        publish(tmp_path, ["calibration-table-1"])
    write_raw(tmp_path / f"calibration-table-1{RAW}", {})
    (tmp_path / "calibration-table-1-1.svg").write_text("<svg/>")
    written = publish(tmp_path, ["calibration-table-1"])
    endings = (".json", RAW, "-1.svg", ".md")
    names = [*(f"calibration-table-1{ending}" for ending in endings), "claims.md", "page.md"]
    assert [path.name for path in written] == names
    assert "0.1" in (tmp_path / "pages" / "page.md").read_text()


def test_reasons_have_been_read_beside_the_numbers_that_they_are_given_for() -> None:
    stale = {name: [one["says"] for one in each["claims"] if one["stale"]] for name, each in committed().items()}
    assert {name: says for name, says in stale.items() if says} == {}, "read them again: python -m papers confirm NAME"


def test_a_reason_whose_numbers_changed_is_marked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(pages, "REASONS", tmp_path / "reasons.json")
    name = "calibration-table-1"
    assert any(one["stale"] for one in committed()[name]["claims"])
    pages.confirm([name])
    assert not any(one["stale"] for one in committed()[name]["claims"])
    said = json.loads((tmp_path / "reasons.json").read_text())[name]
    (tmp_path / "reasons.json").write_text(json.dumps({name: dict.fromkeys(said, "00000000")}))
    changed = pages.committed()[name]
    assert "(of older numbers" in page_of(changed)
