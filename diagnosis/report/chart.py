"""Charts as SVG: panels above each other with lines, areas, dots and axes, in the colours of the page.

To import matplotlib takes a second, and each of its figures a tenth of one; it draws other formats only.
"""

import base64
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours by Okabe and Ito, which are distinct with any colour vision. The page has a variable of each
# name, lighter ones for a dark screen.
INK, GRID, BAND = "#1f2328", "#dde1e6", "#8a919a"
BEFORE, AFTER, THIRD = "#d55e00", "#0072b2", "#009e73"
PALETTE = {INK: "ink", GRID: "grid", BAND: "band", BEFORE: "before", AFTER: "after", THIRD: "third"}


class PT:
    """Sizes of all charts [pt], such that letters keep their size on a phone; chosen."""

    width, right, below, above, between = 346.0, 12.0, 33.0, 22.0, 9.0  # chart, and room around panels
    letter, character = 9.0, 5.2  # height of letters, mean width of one
    thin, line, dot = 0.6, 1.3, 2.2  # width of grid and axes, of a line; radius of a dot
    tick, sample, apart = 3.0, 16.0, 26.0  # lengths: tick, line in the legend, from tick to tick
    far = 1e4  # where a line that leaves the chart ends


ROUND = np.array([1.0, 2.0, 2.5, 5.0, 10.0])  # steps between ticks, times a power of ten
POWERS = 10.0 ** np.arange(-9, 10)
# Ticks of an axis that is not linear, the roundest first.
CANDIDATES = (0.0, *POWERS, *(5.0 * POWERS), *(2.0 * POWERS))
WRITTEN_OUT = (1e-4, 1e6)  # magnitudes without an exponent
Ends = tuple[float, float]


class Mark(NamedTuple):
    """A line, an area (``width`` 0) or dots (``radius`` > 0). NaN in x or y begins a new part."""

    x: np.ndarray
    y: np.ndarray
    colour: str
    label: str = ""  # in the legend
    width: float = PT.line
    radius: float = 0.0
    opacity: float = 1.0
    dashed: bool = False
    hollow: bool = False


class Text(NamedTuple):
    """A line of letters at a place [pt], which is its ``start``, ``middle`` or ``end``."""

    x: float
    y: float
    text: str
    anchor: str = "middle"
    upwards: bool = False


class Box(NamedTuple):
    """Where a panel lies on the chart, from the upper left corner [pt]."""

    left: float
    top: float
    width: float
    height: float


@dataclass
class Axis:
    """An axis of a panel.

    Attributes:
        label: with the unit.
        limits: its ends; None: those of the marks, and ``margin``, a share of the reach.
        scale: how values are spaced; None: as they are.
        names: of the ticks at 0, 1, ...; none: numbers.
        shown: whether label and numbers are.
    """

    label: str = ""
    limits: Ends | None = None
    margin: float = 0.05
    scale: Callable[[Any], Any] | None = None
    names: Sequence[str] = ()
    shown: bool = True

    def spaced(self, x: Any) -> np.ndarray:
        """Values on the scale."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(x, float) if self.scale is None else self.scale(np.asarray(x, float))

    def ends(self, values: Sequence[np.ndarray]) -> Ends:
        """Limits on the scale, between which all values lie."""
        known = self.spaced(
            np.concatenate([np.zeros(0), *values]) if self.limits is None else self.limits
        )
        known = known[np.isfinite(known)] if np.isfinite(known).any() else np.array([0.0, 1.0])
        if self.limits is not None and known[0] != known[-1]:
            return float(known[0]), float(known[-1])
        low, high = float(known.min()), float(known.max())
        free = self.margin * ((high - low) or abs(high) or 1.0)
        return low - free, high + free

    def ticks(self, ends: Ends, length: float) -> list[tuple[float, str]]:
        """Places on the scale of the ticks, and their texts, for an axis of a length [pt]."""
        if self.names:
            return [(float(k), name) for k, name in enumerate(self.names)]
        (low, high), most = ends, max(2, int(length / PT.apart))
        span = high - low
        if self.scale is None:
            power = 10.0 ** np.floor(np.log10(span / most))
            step = power * ROUND[np.argmax(ROUND * power * most >= span)]
            found = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0)
            return [(float(x), tick_text(x, step)) for x in found]
        chosen: dict[float, str] = {}
        for x in CANDIDATES:
            at = float(self.spaced(x))
            if low <= at <= high and all(abs(at - other) * most >= span for other in chosen):
                chosen[at] = tick_text(x, x)
        return [*chosen.items()]


def tick_text(x: float, step: float) -> str:
    """A number to the digits in which it differs from others that are a step apart."""
    if x and not WRITTEN_OUT[0] <= max(abs(x), step) < WRITTEN_OUT[1]:
        return f"{x:.6g}".replace("-", "−")
    # A step of 2.5 has one digit more than its size.
    digits = max(1, 1 - int(np.floor(np.log10(step) + 1e-9))) if step > 0.0 else 1
    text = f"{x:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text.replace("-", "−")


@dataclass
class Panel:
    """Marks, from below to above, and the axes on which they lie.

    Attributes:
        x, y: the axes.
        zero: whether a thin line is at y = 0.
        equal: whether both axes have the same scale.
        notes: value of y -> text to the right.
    """

    x: Axis = field(default_factory=Axis)
    y: Axis = field(default_factory=Axis)
    zero: bool = False
    equal: bool = False
    marks: list[Mark] = field(default_factory=list)
    notes: dict[float, str] = field(default_factory=dict)

    def draw(self, x: Any, y: Any, colour: str, label: str = "", **look: Any) -> None:
        """A line through points, or what ``look``, fields of a :class:`Mark`, makes of it."""
        self.marks.append(Mark(np.ravel(x), np.ravel(y), colour, label, **look))

    def fill(self, x: Any, low: Any, high: Any, colour: str, label: str = "", **look: Any) -> None:
        """The area between two lines over the same x, interrupted where one of them is."""
        x, low, high = np.broadcast_arrays(x, low, high)
        known = np.flatnonzero(np.isfinite(x + low + high))
        parts = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
        around = [np.r_[x[p], x[p][::-1], np.nan] for p in parts]
        ends = [np.r_[low[p], high[p][::-1], np.nan] for p in parts]
        look = {"width": 0.0, "opacity": 0.2} | look
        self.draw(np.concatenate(around), np.concatenate(ends), colour, label, **look)

    def ends(self) -> tuple[Ends, Ends]:
        """Limits of both axes on their scales."""
        zero = [np.zeros(1)] if self.zero else []
        return self.x.ends([m.x for m in self.marks]), self.y.ends([*(m.y for m in self.marks), *zero])

    def rows(self, height: float) -> list[tuple[float, str]]:
        """Ticks of y for a height [pt]; they need less room than those beside each other."""
        return self.y.ticks(self.ends()[1], 1.5 * height)

    def drawn(self, b: Box) -> Iterator[tuple[Mark | Text, bool]]:
        """All that is drawn, in points of the chart, and whether only what is within the box is seen."""
        xs, ys = self.ends()
        bottom, right, middle = b.top + b.height, b.left + b.width, 0.35 * PT.letter

        def across(spaced: Any) -> Any:
            return b.left + b.width * (spaced - xs[0]) / (xs[1] - xs[0])

        def up(spaced: Any) -> Any:
            return bottom - b.height * (spaced - ys[0]) / (ys[1] - ys[0])

        columns = [(across(at), text) for at, text in self.x.ticks(xs, 0.6 * b.width)]
        rows = [(up(at), text) for at, text in self.rows(b.height)]
        grid = [(x, b.top, x, bottom) for x, _ in columns] + [(b.left, y, right, y) for y, _ in rows]
        yield _segments(grid, GRID), False
        if self.zero:
            yield _segments([(b.left, up(0.0), right, up(0.0))], INK), True
        for m in self.marks:
            yield m._replace(x=across(self.x.spaced(m.x)), y=up(self.y.spaced(m.y))), True
        frame = [(b.left, b.top, b.left, bottom), (b.left, bottom, right, bottom)]
        frame += [(x, bottom, x, bottom + PT.tick) for x, _ in columns]
        yield _segments([*frame, *((b.left - PT.tick, y, b.left, y) for y, _ in rows)], INK), False
        texts = [Text(b.left - 1.5 * PT.tick, y + middle, text, "end") for y, text in rows]
        texts += [Text(right + PT.tick, up(y) + middle, text, "start") for y, text in self.notes.items()]
        texts += [Text(PT.letter, b.top + 0.5 * b.height, self.y.label, upwards=True)]
        if self.x.shown:
            below = bottom + PT.tick + PT.letter
            texts += [Text(x, below, text) for x, text in columns]
            for k, text in enumerate(self.x.label.splitlines(), 1):
                texts.append(Text(0.5 * (b.left + right), below + 1.2 * k * PT.letter, text))
        yield from ((text, False) for text in texts)


@dataclass
class Chart:
    """Panels from above, with one legend; ``height`` and room to the ``right`` in points."""

    height: float
    panels: Sequence[Panel]
    title: str = ""
    right: float = PT.right

    @property
    def legend(self) -> dict[str, Mark]:
        """Label -> the first mark that has it."""
        found: dict[str, Mark] = {}
        for m in (m for p in self.panels for m in p.marks if m.label):
            found.setdefault(m.label, m)
        return found

    def boxes(self) -> list[Box]:
        """Of each panel; one of equal scales is as large as fits."""
        count, between = len(self.panels), PT.between + PT.below * self.panels[0].x.shown
        below = PT.below + 1.2 * PT.letter * self.panels[-1].x.label.count("\n")
        each = (self.height - PT.above - below - (count - 1) * between) / count
        longest = max(len(text) for p in self.panels for _, text in p.rows(each))
        left = 1.8 * PT.letter + 2.0 * PT.tick + PT.character * longest
        width, found = PT.width - left - self.right, []
        for k, p in enumerate(self.panels):
            b = Box(left, PT.above + k * (each + between), width, each)
            if p.equal:
                east, north = (high - low for low, high in p.ends())
                scale = min(width / east, each / north)
                corner = left + 0.5 * (width - scale * east), b.top + 0.5 * (each - scale * north)
                b = Box(*corner, scale * east, scale * north)
            found.append(b)
        return found

    def drawn(self) -> Iterator[tuple[Mark | Text, int | None]]:
        """All that is drawn, in points, and the number of the panel within which alone it is seen."""
        for k, (panel, box) in enumerate(zip(self.panels, self.boxes(), strict=True)):
            yield from ((item, k if inside else None) for item, inside in panel.drawn(box))
        yield Text(PT.width - self.right, PT.above - PT.tick, self.title, "end"), None
        room = [2.0 * PT.sample + PT.character * len(label) for label in self.legend]
        x = max(PT.tick, 0.5 * (PT.width - sum(room)))
        for wide, (label, m) in zip(room, self.legend.items(), strict=True):
            ends, low, high = np.array([x, x + PT.sample]), 0.3 * PT.letter, 0.9 * PT.letter
            line = m._replace(x=ends, y=np.full(2, 0.5 * (low + high)))
            if m.radius:
                line = m._replace(x=ends.mean()[None], y=line.y[:1])
            elif not m.width:
                line = m._replace(x=np.r_[ends, ends[::-1]], y=np.array([low, low, high, high]))
            yield line, None
            yield Text(x + 1.25 * PT.sample, PT.letter, label, "start"), None
            x += wide

    def svg(self, key: str, label: str) -> str:
        """The chart as a file of its own; :func:`themed` makes it a part of the page.

        Args:
            key: letters and digits that no other chart of a page has.
            label: its text for screen readers.
        """
        size = f'viewBox="0 0 {PT.width:g} {self.height:g}" role="img" aria-label="{escape(label)}"'
        look = f'font-size="{PT.letter:g}" font-family="sans-serif" fill="{INK}" stroke-linejoin="round"'
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

        inch = 72.0  # pt
        made = Figure(figsize=(PT.width / inch, self.height / inch), facecolor="none")
        axes = made.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, PT.width), ylim=(self.height, 0.0))
        axes.set_axis_off()
        boxes = [*self.boxes(), Box(0.0, 0.0, PT.width, self.height)]
        for order, (m, inside) in enumerate(self.drawn()):
            look: dict[str, Any] = {"zorder": order}
            if isinstance(m, Text):
                look |= {"rotation": 90.0 * m.upwards, "rotation_mode": "anchor", "parse_math": False}
                at = {"start": "left", "middle": "center", "end": "right"}[m.anchor]
                axes.text(m.x, m.y, m.text, ha=at, size=PT.letter, color=INK, **look)
                continue
            b, look = (
                boxes[-1 if inside is None else inside],
                look | {"color": m.colour, "alpha": m.opacity},
            )
            x, y = m.x.clip(b.left, b.left + b.width), m.y.clip(b.top, b.top + b.height)
            if m.radius:
                axes.plot(x, y, "o", ms=2.0 * m.radius, mfc="none" if m.hollow else m.colour, **look)
            elif m.width:
                axes.plot(x, y, "--" if m.dashed else "-", lw=m.width, **look)
            else:
                parts = np.split(np.column_stack([x, y]), np.flatnonzero(np.isnan(x)))
                axes.fill(
                    *(v for part in parts for v in part[np.isfinite(part[:, 0])].T), lw=0.0, **look
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
    return Mark(points[:, 0], points[:, 1], colour, width=PT.thin)


def _element(m: Mark, clip: str) -> str:
    more = (f' opacity="{m.opacity:g}"' if m.opacity < 1.0 else "") + clip
    line = f'fill="none" stroke="{m.colour}" stroke-width="{m.width:g}"'
    if m.radius:
        known = np.isfinite(m.x) & np.isfinite(m.y)
        places = zip(m.x[known], m.y[known], strict=True)
        dots = (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{m.radius:g}"/>' for x, y in places)
        look = line if m.hollow else f'fill="{m.colour}"'
        return f"<g {look}{more}>{''.join(dots)}</g>"
    if not m.width:
        return f'<path d="{_path(m, "Z")}" fill="{m.colour}"{more}/>'
    dashes = ' stroke-dasharray="5 2"' if m.dashed else ""
    return f'<path d="{_path(m)}" {line}{dashes}{more}/>'


def _path(m: Mark, end: str = "") -> str:
    """Points to a tenth of a point; neighbours that are the same there once."""
    places = np.column_stack([m.x, m.y]).clip(-PT.far, PT.far).round(1)
    known = np.isfinite(places).all(axis=1)
    begins = known & ~np.r_[False, known[:-1]]
    new = begins | (known & np.r_[True, (places[1:] != places[:-1]).any(axis=1)])
    parts = zip(places[new].tolist(), begins[new].tolist(), strict=True)
    text = "".join(f"{end}M{x:g},{y:g}" if begin else f" {x:g},{y:g}" for (x, y), begin in parts)
    return text.removeprefix(end) + end if text else ""


def _text(t: Text) -> str:
    if not t.text:
        return ""
    place = f'x="{t.x:.1f}" y="{t.y:.1f}"'
    if t.upwards:
        place = f'transform="translate({t.x:.1f},{t.y:.1f}) rotate(-90)"'
    return f'<text {place} text-anchor="{t.anchor}">{escape(t.text)}</text>'
