"""What the frozen plant comes to beside every target, fitted or not: the page of `make refit` without fitting.

Run it with `make plant-check`; it prints the tables of docs/plant.md and writes plant_check.html.
"""

from pathlib import Path

from catenary.simulation.cable_parameters import load_cable_arm
from papers.arguments import folder_argument
from papers.plant.page import write_plant_page


def main(folder: Path) -> None:
    """Print the tables and write the page."""
    write_plant_page(folder / "plant_check.html", load_cable_arm())


if __name__ == "__main__":
    main(folder_argument(__doc__))
