"""Drawings for the documentation as SVG text, legible on light and dark pages."""

from collections.abc import Iterable, Sequence
from html import escape

Point = Sequence[float]
"""Across and down, pixels."""

STYLE = """\
svg { background: #ffffff; font-family: Helvetica, Arial, sans-serif; }
text { fill: #202228; font-size: 14px; }
text.title { font-size: 17px; font-weight: bold; }
text.small { font-size: 12px; fill: #5a5e69; }
"""


def svg(width: int, height: int, parts: Iterable[str], title: str) -> str:
    """A whole drawing; `title` is read to those who cannot see it."""
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" role="img">\n'
        f"<title>{escape(title)}</title>\n<style>\n{STYLE}</style>\n"
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>\n{body}\n</svg>\n'
    )


def text(at: Point, words: str, kind: str = "", anchor: str = "start") -> str:
    """A line of text whose baseline starts, ends or has its middle at a point."""
    x, y = at
    return f'<text x="{x:.0f}" y="{y:.0f}" class="{kind}" text-anchor="{anchor}">{escape(words)}</text>'


def line(points: Sequence[Point], color: str, width: float = 2, dash: str = "", fill: str = "none") -> str:
    """Straight lines from point to point."""
    corners = " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
    return (
        f'<polyline points="{corners}" fill="{fill}" stroke="{color}" stroke-width="{width}" '
        f'stroke-dasharray="{dash}" stroke-linejoin="round"/>'
    )


def arrow(start: Point, end: Point, color: str, width: float = 2) -> str:
    """A line with a head at its end."""
    (x, y), (to_x, to_y) = start, end
    length = max(((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5, 1e-9)
    along_x, along_y = (to_x - x) / length, (to_y - y) / length
    wings = [
        (to_x - 8 * along_x - side * 4 * along_y, to_y - 8 * along_y + side * 4 * along_x) for side in (1, -1)
    ]
    return line([start, end], color, width) + line([wings[0], end, wings[1]], color, width, fill=color)


def dot(at: Point, color: str, radius: float = 4) -> str:
    """A filled circle."""
    x, y = at
    return f'<circle cx="{x:.0f}" cy="{y:.0f}" r="{radius}" fill="{color}"/>'


def box(left: float, top: float, width: float, height: float, fill: str, stroke: str = "#5a5e69") -> str:
    """A rectangle with round corners."""
    return (
        f'<rect x="{left:.0f}" y="{top:.0f}" width="{width:.0f}" height="{height:.0f}" rx="6" '
        f'fill="{fill}" stroke="{stroke}"/>'
    )
