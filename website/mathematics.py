"""Mathematics of the pages as MathML, made while the site is built, so that no page loads a program for it.

`$...$` stands in a line, `$$...$$` alone; GitHub draws both as well.
"""

import re
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.blockprocessors import BlockProcessor
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor

# neither `$ catenary` nor prices: no space inside the signs, no letter or digit outside
WITHIN_A_LINE = r"(?<![\\$\w])\$(?![\s$])([^$\n]+?)(?<![\s\\])\$(?![\w$])"


class InlineMathematics(InlineProcessor):
    """A formula in a line."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str, int, int]:
        """Return the formula's place, to be filled when the page is whole."""
        return self.md.htmlStash.store(convert(m[1])), m.start(0), m.end(0)


class DisplayedMathematics(BlockProcessor):
    """A formula on lines of its own."""

    def test(self, parent: ElementTree.Element, block: str) -> bool:
        """Say whether a paragraph is a formula."""
        return len(block) > 4 and block.startswith("$$") and block.rstrip().endswith("$$")

    def run(self, parent: ElementTree.Element, blocks: list[str]) -> None:
        """Turn the paragraph into a box that scrolls where it is too wide."""
        formula = convert(blocks.pop(0).strip().strip("$"), display="block")
        box = ElementTree.SubElement(parent, "div", {"class": "formula"})
        box.text = self.parser.md.htmlStash.store(formula)


class MathematicsExtension(Extension):
    """Python-Markdown's way in."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Look for formulas after code and before backslashes."""
        md.inlinePatterns.register(InlineMathematics(WITHIN_A_LINE, md), "mathematics", 185)
        md.parser.blockprocessors.register(DisplayedMathematics(md.parser), "mathematics", 90)


def makeExtension(**options: object) -> MathematicsExtension:
    """Return the extension; Python-Markdown asks for it by this name."""
    return MathematicsExtension(**options)
