"""A coefficient that varies, as a small drawing among the words of a page."""

from html import escape

import numpy as np

from study.compare.varying_coefficients import VaryingCoefficient, varying_in_words
from study.explore.page_units import in_text, number
from study.support.arrays import Floats


def varying_drawing(one: VaryingCoefficient) -> str:
    """The coefficient along time or its channel with its 95 % band, as SVG in HTML."""
    width, height, left, top, bottom = 420, 190, 74, 12, 40  # pixels
    half = 1.96 * one.error
    low, high = float(np.min(one.value - half)), float(np.max(one.value + half))
    low, high = (low, high) if high > low else (low - 1.0, high + 1.0)
    x = left + (one.at - one.at[0]) / (one.at[-1] - one.at[0]) * (width - left - 12)

    def y(values: Floats) -> Floats:
        return np.asarray(top + (high - values) / (high - low) * (height - top - bottom), dtype=np.float64)

    def points(across: Floats, up: Floats) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))

    band = points(np.concatenate([x, x[::-1]]), np.concatenate([y(one.value + half), y(one.value - half)[::-1]]))
    floor, unit = height - bottom, f" / {in_text(one.along_unit)}" if one.along_unit else ""
    words = [
        f"<text x='{left - 6}' y='{at:.0f}' text-anchor='end'>{number(value, 4)}</text>"
        for value, at in ((high, top + 8), (low, floor))
    ]
    words += [
        f"<text x='{at:.0f}' y='{floor + 16}' text-anchor='{anchor}'>{number(float(value), 4)}</text>"
        for value, at, anchor in ((one.at[0], left, "start"), (one.at[-1], width - 12, "end"))
    ]
    words.append(
        f"<text x='{(left + width) / 2:.0f}' y='{height - 6}' text-anchor='middle'>"
        f"{escape(one.along.replace('_', ' ') + unit)}</text>"
    )
    middle = (top + floor) / 2
    words.append(
        f"<text x='12' y='{middle:.0f}' text-anchor='middle' transform='rotate(-90 12 {middle:.0f})'>"
        f"{escape(f'{one.symbol} / {in_text(one.unit)}')}</text>"
    )
    return (
        f"<svg class='varying' width='{width}' height='{height}' role='img' font-size='11' fill='currentColor'>"
        f"<title>{escape(varying_in_words(one))}</title>"
        f"<path d='M{left},{top} V{floor} H{width - 12}' fill='none' stroke='currentColor' stroke-width='0.8'/>"
        f"<polygon points='{band}' fill='#b5b5b5' fill-opacity='0.7'/>"
        f"<polyline points='{points(x, y(one.value))}' fill='none' stroke='#1f5fa8' stroke-width='1.8'/>"
        f"{''.join(words)}</svg>"
    )
