"""A figure that a notebook shows and a file holds, and how pictures are drawn: format, size, style."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..errors import InputError, nearest
from .canvas import DPI, WIDTH, arrange, check_size, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")


class PictureOptions(NamedTuple):
    """How pictures are written.

    Attributes:
        format: ``png``, ``svg`` or ``pdf``.
        dpi: pixels per inch of a PNG.
        width: of a picture [in]; letters keep their size.
        style: name of a style of matplotlib, or a file of one; None: as the project draws.
    """

    format: str = "png"
    dpi: float = DPI
    width: float = WIDTH
    style: str | None = None

    @contextmanager
    def applied(self) -> Iterator[None]:
        """Context with the style.

        Raises:
            InputError: there is no such style.
        """
        with ExitStack() as stack:
            if self.style is not None:
                from matplotlib import style

                try:
                    stack.enter_context(style.context(self.style))
                except OSError:
                    near = nearest(self.style, style.available)
                    raise InputError(f"no style '{self.style}'{near}") from None
            yield

    def sized(self, figure: Figure) -> Figure:
        """The figure in another size, of the same shape.

        Raises:
            InputError: it is too large to be drawn, or too small for anything beside the labels.
        """
        scale = self.width / WIDTH
        figure.set_size_inches(scale * figure.get_figwidth(), scale * figure.get_figheight())
        check_size(figure, max(self.dpi, DPI))  # letters are measured at DPI
        try:
            return arrange(figure)
        except ValueError:
            raise InputError(
                f"a picture of {self.width:g} in has no room beside its labels; increase its width"
            ) from None


class Drawn:
    """A figure of matplotlib that shows itself in a notebook, and can be saved.

    Attributes:
        figure: of matplotlib, for those who want to change it.
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure

    def save(self, file: str | Path, dpi: float = DPI) -> Path:
        """Write it as ``.png``, ``.svg`` or ``.pdf``, by the ending of the name; its folder is made.

        Raises:
            InputError: another ending.
        """
        path = Path(file)
        if path.suffix[1:] not in FORMATS:
            raise InputError(f"'{file}': a picture is {', '.join(f'.{name}' for name in FORMATS)}")
        path.parent.mkdir(parents=True, exist_ok=True)
        save(self.figure, path, dpi)
        return path

    def _repr_png_(self) -> bytes:
        held = io.BytesIO()
        self.figure.savefig(held, format="png", dpi=DPI)
        return held.getvalue()

    def __repr__(self) -> str:
        width, height = self.figure.get_size_inches()
        return f"picture of {width:g} x {height:g} in; .save('name.svg') writes it"
