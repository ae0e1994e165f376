"""Blocks of commands as the language that tells a command from its prompt and from what it prints.

Then what is copied from a block is what is to be typed (docs/assets/site.css).
"""

import re

from markdown import Markdown
from markdown.extensions import Extension
from markdown.preprocessors import Preprocessor

FENCE = re.compile(r" *```$")


class Prompts(Preprocessor):
    """Names the language of blocks that begin with a prompt."""

    def run(self, lines: list[str]) -> list[str]:
        """Return a page's lines with the language behind such fences."""
        inside, named = False, []
        for line, below in zip(lines, [*lines[1:], ""], strict=True):
            opens = not inside and FENCE.match(line) and below.lstrip().startswith("$ ")
            named.append(f"{line}console" if opens else line)
            if line.lstrip().startswith("```"):
                inside = not inside
        return named


class PromptsExtension(Extension):
    """Python-Markdown's way in."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Look at fences before they are turned into code."""
        md.preprocessors.register(Prompts(md), "prompts", 40)


def makeExtension(**options: object) -> PromptsExtension:
    """Return the extension; Python-Markdown asks for it by this name."""
    return PromptsExtension(**options)
