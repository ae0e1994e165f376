"""A robot out of the file of its identified parameters, with their masses, friction, rotors and springs."""

from pathlib import Path

from catenary.archives import content_in_words, read_arrays
from catenary.cards import card_of
from catenary.documents import cut, json_table
from catenary.errors import FileFormatError
from catenary.robots.model import Massless, RobotModel
from catenary.robots.model_record import robot_from_record

REMEDY = "`catenary identify` makes it again"
IDENTIFIED = "identified"  # array of the archive that holds the robot, as JSON


def load_identified(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load the robot that `catenary identify` found.

    Raises:
        FileFormatError: No such file, another archive, a damaged one, or parameters that are no robot's: combinations
            of links' alone (`--free`).
        InputError: `massless` names a link that does not exist or has a mass.
    """
    arrays = read_arrays(path)
    if IDENTIFIED not in arrays:
        if {"structure", "combination"} <= set(arrays):
            raise FileFormatError(
                f"{path}: holds combinations of links' parameters, of which no robot follows (identify --free, or an "
                "earlier version): identify once more without --free"
            )
        raise FileFormatError(
            f"{path}: holds no robot ({content_in_words(arrays)}); catenary identify writes one beside its parameters"
        )
    try:
        card_of(arrays, path, REMEDY)
        robot = robot_from_record(json_table(str(arrays[IDENTIFIED]), IDENTIFIED))
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {cut(str(error).removeprefix(f'{path}: '))}") from error
    return robot.with_massless(massless) if massless else robot
