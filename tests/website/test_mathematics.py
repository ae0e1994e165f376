import pytest
from markdown import Markdown


def html(text: str) -> str:
    return Markdown(extensions=["website.mathematics", "fenced_code", "tables"]).convert(text)


def test_a_formula_in_a_line_becomes_mathml() -> None:
    page = html(r"One sign: $M(q)\,\ddot q + g(q) = \tau$, everywhere.")
    assert '<math xmlns="http://www.w3.org/1998/Math/MathML" display="inline">' in page
    assert "$" not in page
    assert page.endswith(", everywhere.</p>")


def test_a_formula_of_its_own_is_in_a_box_that_scrolls() -> None:
    page = html("before\n\n$$\ng_k = -\\gamma^T [z_k]_\\times R s_k\n$$\n\nafter")
    assert page.startswith('<p>before</p>\n<div class="formula"><math')
    assert 'display="block"' in page
    assert page.endswith("</div>\n<p>after</p>")


def test_underscores_stars_and_backslashes_stay_mathematics() -> None:
    page = html(r"$a_1 * b_1$ and $a_2 * b_2$, $\{x\}$")
    assert "<em>" not in page
    assert page.count("<math") == 3


@pytest.mark.parametrize(
    "text", ["costs $5 or $10", "`$x$` is typed so", "```\n$ catenary home\n$ catenary goto\n```", r"\$x\$", "$ a $"]
)
def test_dollar_signs_that_are_no_formula_are_left_alone(text: str) -> None:
    assert "<math" not in html(text)
    assert "$" in html(text)
