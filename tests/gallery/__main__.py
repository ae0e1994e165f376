"""Write the table of docs/formats-read.md anew: `python -m tests.gallery`."""

from . import PAGE, page

PAGE.write_text(page())
