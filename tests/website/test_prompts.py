from markdown import Markdown

PAGE = "```\n$ catenary home\ndone\n```\n\n```\nno command\n```\n\n1. do\n\n    ```\n    $ catenary goto\n    ```\n\n```text\n$ as it is\n```\n"


def test_only_blocks_that_begin_with_a_prompt_are_named() -> None:
    lines = Markdown(extensions=["website.prompts"]).preprocessors["prompts"].run(PAGE.splitlines())
    assert [line.strip() for line in lines if "```" in line] == [
        "```console", "```", "```", "```", "```console", "```", "```text", "```",
    ]  # fmt: skip


def test_a_prompt_and_what_a_command_prints_are_told_from_what_is_typed() -> None:
    page = Markdown(extensions=["website.prompts", "pymdownx.superfences"]).convert(PAGE)
    assert '<span class="gp">$ </span>' in page or '<span class="gp">$</span>' in page
    assert '<span class="go">done</span>' in page
