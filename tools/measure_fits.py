"""Measure how often the error bars of a fit to photographs hold the truth.

    python tools/measure_fits.py [ROUNDS] [SEED]

Simulates photographs of five steps with faces of ior 1.5 before a light, with shot noise, and prints for each of what
else they suffer from the share of 95 % intervals, of three channels and ROUNDS (300), that hold the true extinction.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from tests.values.test_photographs import KINDS, held


def main() -> None:
    """Print a line for each kind of photographs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rounds", type=int, nargs="?", default=300)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            inside, narrow = held(kind, given.rounds, given.seed, Path(folder))
            print(f"{kind:<28}{100 * inside:5.1f} % hold the truth, {100 * narrow:5.1f} % are narrower than 10 % of it")


if __name__ == "__main__":
    main()
