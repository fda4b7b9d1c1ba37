"""Numbers as the page writes them."""

from __future__ import annotations

import math


def error_text(value: float | None) -> str:
    """Two significant digits: ``3.9e-8``, ``0.21``; ``0`` is exactly that, a dash is not measured."""
    if value is None:
        return "–"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    if 0.00995 <= abs(value) < 999.5:
        return f"{value:.2g}" if abs(value) < 99.5 else f"{value:.0f}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def limit_text(value: float) -> str:
    """A limit, which is a round number: ``1e-4``."""
    return f"{value:.0e}".replace("e-0", "e-")


def signed_error_text(value: float | None) -> str:
    """Error as in `error_text`, with its sign."""
    return f"+{error_text(value)}" if value is not None and value > 0 else error_text(value)


def ratio_text(value: float | None) -> str:
    """A multiple: ``1.12``, ``16.3``, ``240``."""
    if value is None:
        return "–"
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def ms_text(value: float | None) -> str:
    """Milliseconds to three significant digits."""
    if value is None:
        return "–"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.{min(6, max(0, 2 - math.floor(math.log10(abs(value)))))}f}"


def share_text(value: float | None) -> str:
    """A share in percent; ``0`` is exactly that."""
    if value is None:
        return "–"
    if value == 0:
        return "0"
    return "< 0.01 %" if value < 1e-4 else f"{100 * value:.2f} %" if value < 0.09995 else f"{100 * value:.1f} %"


def signed_share_text(value: float) -> str:
    """A share in percent with its sign: ``+3.2 %``."""
    return f"{100 * value:+.1f} %".replace("-", "−")


def change_text(value: float) -> str:
    """A difference of shares with its sign: ``+0.012``."""
    return f"{value:+.3f}".replace("-", "−")


def count_text(value: float | None) -> str:
    """A whole number, in groups of three."""
    return "–" if value is None else f"{value:,.0f}".replace(",", "\u202f")


def rounded_text(value: float) -> str:
    """A whole number to two significant digits: ``121 399`` is ``120 000``."""
    return count_text(float(f"{value:.1e}"))


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def power_text(value: float) -> str:
    """A tick of a logarithmic axis: ``10⁻⁶``, and 0.1 to 1000 written out."""
    exponent = round(math.log10(value))
    return f"{value:g}" if -1 <= exponent <= 3 else "10" + str(exponent).translate(_SUPERSCRIPTS)
