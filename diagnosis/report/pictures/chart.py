"""Charts as SVG: panels above each other with lines, areas, dots and axes, in the colours of the page.

To import matplotlib takes a second, and each of its figures a tenth of one; it draws other formats only.
"""

import base64
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.constants import inch, point

from ..formatting import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours by Okabe and Ito, which are distinct with any colour vision. The page has a variable of each
# name, lighter ones for a dark screen.
INK, GRID, BAND = "#1f2328", "#dde1e6", "#8a919a"
BEFORE, AFTER, THIRD = "#d55e00", "#0072b2", "#009e73"
PALETTE = {INK: "ink", GRID: "grid", BAND: "band", BEFORE: "before", AFTER: "after", THIRD: "third"}
# pt, of all charts, such that letters keep their size on a phone; chosen: width of a chart, height and
# mean width of letters, from one line of them to the next, width of a line.
WIDTH, LETTER, CHARACTER, ROW, LINE = 346.0, 9.0, 5.2, 12.0, 1.3
FAINT = 0.3  # opacity of what lies below other things; chosen
MARGIN = 0.05  # between what is drawn and the ends of an axis, as a share of the axis; chosen
ROUND = np.outer((1.0, 5.0, 2.0), 10.0 ** np.arange(-12, 13)).ravel()  # ticks, the roundest first
Ends = tuple[float, float]


class Mark(NamedTuple):
    """A line, an area or dots. NaN in x or y begins a new part."""

    x: np.ndarray
    y: np.ndarray
    colour: str
    label: str = ""  # in the legend
    width: float = LINE
    area: bool = False
    dots: bool = False
    faint: bool = False
    dashed: bool = False
    hollow: bool = False


class Text(NamedTuple):
    """A line of letters: the ``start``, ``middle`` or ``end`` of its middle line [pt]."""

    x: float
    y: float
    text: str
    anchor: str = "middle"
    upwards: bool = False


class Box(NamedTuple):
    """Where a panel lies on the chart [pt], ``top`` from above."""

    left: float
    top: float
    width: float
    height: float


@dataclass
class ChartAxis:
    """An axis of a panel.

    Attributes:
        label: with the unit.
        limits: its ends; None: those of the marks, and a margin.
        scale: how values are spaced; None: as they are.
        names: of the ticks at 0, 1, ...; none: numbers.
        shown: whether label and numbers are.
    """

    label: str = ""
    limits: Ends | None = None
    scale: Callable[[Any], Any] | None = None
    names: Sequence[str] = ()
    shown: bool = True

    def spaced(self, x: Any) -> np.ndarray:
        """Values on the scale."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(x, float) if self.scale is None else self.scale(np.asarray(x, float))

    def ends(self, values: Sequence[np.ndarray]) -> Ends:
        """Limits on the scale, between which all values lie."""
        every = np.concatenate([np.zeros(0), *values]) if self.limits is None else self.limits
        known = self.spaced(every)
        known = known[np.isfinite(known)] if np.isfinite(known).any() else np.array([0.0, 1.0])
        if self.limits is not None and known[0] != known[-1]:
            return float(known[0]), float(known[-1])
        low, high = float(known.min()), float(known.max())
        free = MARGIN * ((high - low) or abs(high) or 1.0)
        return low - free, high + free

    def ticks(self, ends: Ends, most: float) -> list[tuple[float, str]]:
        """Places on the scale of the ticks, and their texts, where there is room for so many."""
        if self.names:
            return [(float(k), name) for k, name in enumerate(self.names)]
        (low, high), apart = ends, (ends[1] - ends[0]) / max(most, 2)
        if self.scale is None:
            step = ROUND[apart <= ROUND].min()
            found = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0)
            return [(float(x), number(x + 0.0, 6)) for x in found]
        chosen: dict[float, str] = {}
        for x in (0.0, *ROUND):
            at = float(self.spaced(x))
            if low <= at <= high and all(abs(at - other) >= apart for other in chosen):
                chosen[at] = number(float(x), 6)
        return [*chosen.items()]


@dataclass
class Panel:
    """Marks, from below to above, and the axes on which they lie.

    Attributes:
        x, y: the axes.
        zero: whether a thin line is at y = 0.
        equal: whether both axes have the same scale.
        notes: value of y -> text to the right.
    """

    x: ChartAxis = field(default_factory=ChartAxis)
    y: ChartAxis = field(default_factory=ChartAxis)
    zero: bool = False
    equal: bool = False
    marks: list[Mark] = field(default_factory=list)
    notes: dict[float, str] = field(default_factory=dict)

    def draw(self, x: Any, y: Any, colour: str, label: str = "", **look: Any) -> None:
        """A line through points, or what ``look``, fields of a :class:`Mark`, makes of it."""
        self.marks.append(Mark(np.ravel(x), np.ravel(y), colour, label, **look))

    def fill(self, x: Any, low: Any, high: Any, colour: str, label: str = "") -> None:
        """The area between two lines over the same x, interrupted where one of them is."""
        x, low, high = np.broadcast_arrays(x, low, high)
        known = np.flatnonzero(np.isfinite(x + low + high))
        parts = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
        around = [np.r_[x[p], x[p][::-1], np.nan] for p in parts]
        ends = [np.r_[low[p], high[p][::-1], np.nan] for p in parts]
        self.draw(np.concatenate(around), np.concatenate(ends), colour, label, area=True, faint=True)

    def ends(self) -> tuple[Ends, Ends]:
        """Limits of both axes on their scales."""
        zero = [np.zeros(1)] if self.zero else []
        return self.x.ends([m.x for m in self.marks]), self.y.ends([*(m.y for m in self.marks), *zero])

    def rows(self, height: float) -> list[tuple[float, str]]:
        """Ticks of y for a height [pt]."""
        return self.y.ticks(self.ends()[1], height / (2 * LETTER))

    def drawn(self, b: Box) -> Iterator[tuple[Mark | Text, bool]]:
        """All that is drawn, in points of the chart, and whether only what is within the box is seen."""
        xs, ys = self.ends()
        bottom, right, tick = b.top + b.height, b.left + b.width, LETTER / 2

        def across(spaced: Any) -> Any:
            return b.left + b.width * (spaced - xs[0]) / (xs[1] - xs[0])

        def up(spaced: Any) -> Any:
            return bottom - b.height * (spaced - ys[0]) / (ys[1] - ys[0])

        columns = [(across(at), text) for at, text in self.x.ticks(xs, b.width / (3 * ROW))]
        rows = [(up(at), text) for at, text in self.rows(b.height)]
        grid = [(x, b.top, x, bottom) for x, _ in columns] + [(b.left, y, right, y) for y, _ in rows]
        yield _segments(grid, GRID), False
        if self.zero:
            yield _segments([(b.left, up(0.0), right, up(0.0))], INK), True
        for m in self.marks:
            yield m._replace(x=across(self.x.spaced(m.x)), y=up(self.y.spaced(m.y))), True
        frame = [(b.left, b.top, b.left, bottom), (b.left, bottom, right, bottom)]
        frame += [(x, bottom, x, bottom + tick) for x, _ in columns]
        yield _segments([*frame, *((b.left - tick, y, b.left, y) for y, _ in rows)], INK), False
        texts = [Text(b.left - LETTER, y, text, "end") for y, text in rows]
        texts += [Text(right + tick, up(y), text, "start") for y, text in self.notes.items()]
        texts += [Text(LETTER, b.top + b.height / 2, self.y.label, upwards=True)]
        if self.x.shown:
            texts += [Text(x, bottom + ROW, text) for x, text in columns]
            lines = enumerate(self.x.label.splitlines(), 2)
            texts += [Text((b.left + right) / 2, bottom + k * ROW, text) for k, text in lines]
        yield from ((text, False) for text in texts)


@dataclass
class Chart:
    """Panels from above, with one legend; ``height`` in points."""

    height: float
    panels: Sequence[Panel]

    @property
    def legend(self) -> dict[str, Mark]:
        """Label -> the first mark that has it."""
        found: dict[str, Mark] = {}
        for m in (m for p in self.panels for m in p.marks if m.label):
            found.setdefault(m.label, m)
        return found

    def boxes(self) -> list[Box]:
        """Of each panel; one of equal scales is as large as fits."""
        count, above = len(self.panels), 2 * ROW
        below = [LETTER + ROW * (1 + len(p.x.label.splitlines())) * p.x.shown for p in self.panels]
        each = (self.height - above - sum(below)) / count
        longest = max(len(text) for p in self.panels for _, text in p.rows(each))
        notes = max((len(text) for p in self.panels for text in p.notes.values()), default=0)
        left = 2 * LETTER + ROW + CHARACTER * longest
        width, top, found = WIDTH - left - ROW - CHARACTER * notes, above, []
        for p, room in zip(self.panels, below, strict=True):
            b = Box(left, top, width, each)
            if p.equal:
                east, north = (high - low for low, high in p.ends())
                scale = min(width / east, each / north)
                corner = left + (width - scale * east) / 2, top + (each - scale * north) / 2
                b = Box(*corner, scale * east, scale * north)
            top += each + room
            found.append(b)
        return found

    def drawn(self) -> Iterator[tuple[Mark | Text, int | None]]:
        """All that is drawn, in points, and the number of the panel within which alone it is seen."""
        for k, (panel, box) in enumerate(zip(self.panels, self.boxes(), strict=True)):
            yield from ((item, k if inside else None) for item, inside in panel.drawn(box))
        room = [2 * ROW + LETTER + CHARACTER * len(label) for label in self.legend]
        x = max(LETTER, (WIDTH - sum(room)) / 2)
        for wide, (label, m) in zip(room, self.legend.items(), strict=True):
            ends, low, high = np.array([x, x + ROW + LETTER / 2]), LETTER / 2, ROW
            line = m._replace(x=ends, y=np.full(2, (low + high) / 2))
            if m.dots:
                line = m._replace(x=ends.mean()[None], y=line.y[:1])
            elif m.area:
                line = m._replace(x=np.r_[ends, ends[::-1]], y=np.array([low, low, high, high]))
            yield line, None
            yield Text(ends[1] + LETTER / 2, line.y.mean(), label, "start"), None
            x += wide

    def svg(self, key: str, label: str) -> str:
        """The chart as a file of its own; :func:`themed` makes it a part of the page.

        Args:
            key: letters and digits that no other chart of a page has.
            label: its text for screen readers.
        """
        size = f'viewBox="0 0 {WIDTH:g} {self.height:g}" role="img" aria-label="{escape(label)}"'
        look = f'font-size="{LETTER:g}" font-family="sans-serif" fill="{INK}" stroke-linejoin="round"'
        parts = [f'<svg xmlns="http://www.w3.org/2000/svg" {size} {look}>']
        for k, b in enumerate(self.boxes()):
            rectangle = f'x="{b.left:.1f}" y="{b.top:.1f}" width="{b.width:.1f}" height="{b.height:.1f}"'
            parts.append(f'<clipPath id="{key}-{k}"><rect {rectangle}/></clipPath>')
        for item, inside in self.drawn():
            clip = "" if inside is None else f' clip-path="url(#{key}-{inside})"'
            parts.append(_text(item) if isinstance(item, Text) else _element(item, clip))
        return "".join([*parts, "</svg>"])

    def figure(self) -> "Figure":
        """The same picture by matplotlib, for PNG and PDF."""
        from matplotlib.figure import Figure
        from matplotlib.patches import Rectangle

        size = np.array([WIDTH, self.height])
        made = Figure(figsize=tuple(size * point / inch), facecolor="none")
        axes = made.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, WIDTH), ylim=(self.height, 0.0))
        axes.set_axis_off()
        boxes = [*self.boxes(), Box(0.0, 0.0, WIDTH, self.height)]
        for order, (m, inside) in enumerate(self.drawn()):
            if isinstance(m, Text):
                at = {"start": "left", "middle": "center", "end": "right"}[m.anchor]
                turned = "vertical" if m.upwards else "horizontal"
                look: dict[str, Any] = {"va": "center", "rotation": turned, "parse_math": False}
                axes.text(m.x, m.y, m.text, ha=at, size=LETTER, color=INK, zorder=order, **look)
                continue
            b = boxes[-1 if inside is None else inside]
            look = {"color": m.colour, "alpha": FAINT if m.faint else None, "zorder": order}
            x, y = (each.clip(-WIDTH, 2 * WIDTH) for each in (m.x, m.y))  # as in an SVG
            if m.dots:
                drawn = axes.plot(x, y, ".", mfc="none" if m.hollow else m.colour, **look)
            elif m.area:
                parts = np.split(np.column_stack([x, y]), np.flatnonzero(np.isnan(x)))
                whole = (p[np.isfinite(p).all(axis=1)] for p in parts)
                drawn = [each for p in whole for each in axes.fill(*p.T, linewidth=0.0, **look)]
            else:
                drawn = axes.plot(x, y, "--" if m.dashed else "-", lw=m.width, **look)
            for each in drawn:  # axes would replace a clip that is given earlier
                each.set_clip_path(
                    Rectangle((b.left, b.top), b.width, b.height, transform=axes.transData)
                )
        return made


def themed(svg: str) -> str:
    """A picture in the colours of the page, bright or dark."""
    for colour, name in PALETTE.items():
        svg = svg.replace(colour, f"var(--{name})")
    return svg


def data_uri(svg: str) -> str:
    """Address that holds the file of a picture, for a link by which a reader saves it."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()


def _segments(ends: Sequence[tuple[float, float, float, float]], colour: str) -> Mark:
    """Thin straight lines, from x, y to x, y."""
    points = np.array([(*each, np.nan, np.nan) for each in ends]).reshape(-1, 2)
    return Mark(points[:, 0], points[:, 1], colour, width=LINE / 2)


def _element(m: Mark, clip: str) -> str:
    more = clip + f' opacity="{FAINT:g}"' * m.faint
    line = f'fill="none" stroke="{m.colour}" stroke-width="{m.width:g}"'
    if m.dots:
        known = np.isfinite(m.x) & np.isfinite(m.y)
        places = zip(m.x[known], m.y[known], strict=True)
        dots = (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{2 * LINE:g}"/>' for x, y in places)
        look = line if m.hollow else f'fill="{m.colour}"'
        return f"<g {look}{more}>{''.join(dots)}</g>"
    if m.area:
        return f'<path d="{_path(m, "Z")}" fill="{m.colour}"{more}/>'
    dashes = ' stroke-dasharray="5 2"' if m.dashed else ""
    return f'<path d="{_path(m)}" {line}{dashes}{more}/>'


def _path(m: Mark, end: str = "") -> str:
    """Points to a tenth of a point; of neighbours within half of one the first."""
    places = np.column_stack([m.x, m.y]).clip(-WIDTH, 2 * WIDTH).round(1)
    known, cells = np.isfinite(places).all(axis=1), np.floor(2 * places)
    begins = known & ~np.r_[False, known[:-1]]
    new = begins | (known & np.r_[True, (cells[1:] != cells[:-1]).any(axis=1)])
    parts = zip(places[new].tolist(), begins[new].tolist(), strict=True)
    text = "".join(f"{end}M{x:g},{y:g}" if begin else f" {x:g},{y:g}" for (x, y), begin in parts)
    return text.removeprefix(end) + end if text else ""


def _text(t: Text) -> str:
    place = f'transform="translate({t.x:.1f},{t.y:.1f}){" rotate(-90)" * t.upwards}"'
    anchor = f'text-anchor="{t.anchor}" dy=".35em"'
    return f"<text {place} {anchor}>{escape(t.text)}</text>" if t.text else ""
