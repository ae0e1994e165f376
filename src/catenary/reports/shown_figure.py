"""A figure that a notebook shows in its first cell: pyplot, which tells notebooks of figures, need not be there."""

from io import BytesIO

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """Matplotlib's, which draws itself as PNG."""

    def _repr_png_(self) -> bytes:
        content = BytesIO()
        self.savefig(content, format="png", dpi=100)
        return content.getvalue()
