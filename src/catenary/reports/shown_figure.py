"""Matplotlib figure that notebooks display without pyplot."""

from io import BytesIO

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """Matplotlib figure that renders itself as PNG."""

    def _repr_png_(self) -> bytes:
        content = BytesIO()
        self.savefig(content, format="png", dpi=100)
        return content.getvalue()
