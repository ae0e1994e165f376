"""Claims of commands against the truth; scenes are those of the tests beside, which import from this folder's parent."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))
