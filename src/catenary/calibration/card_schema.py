"""What readers of a model's card rely on; more may stand in one."""

from pydantic import JsonValue

from catenary.calibration.model import Card
from catenary.config import Recorded, parse_settings


class CardInput(Recorded):
    """An input of the model."""

    name: str


class CardSource(Recorded):
    """A recording that the model was fitted to."""

    name: str
    sha256: str | None
    rows: int


class CardRun(Recorded):
    """Settings of the run."""

    seed: int | None
    max_error: tuple[float | None, ...] | None = None  # deg and mm; None is no limit


class CardSpread(Recorded):
    """Errors of a joint over blocks of time."""

    joint: str
    unit: str
    rmse_mean: float
    rmse_sd: float
    offset_rmse_mean: float


class CardFolds(Recorded):
    """Errors of the cross-validation."""

    joints: tuple[CardSpread, ...]


class CardErrors(Recorded):
    """Errors of a joint on the recordings' last part."""

    name: str
    unit: str
    rmse: float
    offset_rmse: float


class CardEvaluation(Recorded):
    """What errors the card tells."""

    cross_validation: CardFolds | None
    held_out: tuple[CardErrors, ...] | None


class CardFile(Recorded):
    """What readers of a card take from it; more may stand there."""

    robot: str | None
    simulated: bool
    kind: str
    preset: str | None
    inputs: tuple[CardInput, ...]
    target: str
    scaling: str
    data: tuple[CardSource, ...]
    rows: int
    run: CardRun
    version: dict[str, JsonValue]
    errors: CardEvaluation
    notes: tuple[str, ...]


def check_card(card: Card, where: str) -> None:
    """Refuse a card that lacks what its readers rely on; `where` opens the message.

    Raises:
        ConfigError: A key is missing, or of another kind.
    """
    parse_settings(card, CardFile, f"{where}: card")
