"""Interleaved timing on a shared machine.

All is measured in turns, A B C A B C, and the floor before and after each: what slows the machine down for longer than
a drawing slows both, and their quotient stays. Medians and quartiles are over rounds, so that single hiccups do not
count either. Slow drawings leave the rounds early, once they have had their share of the time; those whose rounds
differ much stay longer. What takes less than clocks can tell apart is drawn several times for one sample.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.bench.record import Ratio, TimeStatistics

#: Rounds that even the slowest takes part in, and that the fastest needs no more than.
FEWEST, MOST = 3, 60

#: A drawing that is called long needs no more rounds than this, and less from `LONGEST` seconds on: its own noise
#: averages out within it.
FEWEST_LONG = 2
FEWEST_LONGEST, LONGEST = 1, 2.0

#: What differs much between rounds takes part in so many at least, while it and its floors have taken fewer seconds: of
#: three rounds, one hiccup in a floor and one in a drawing are most.
FEWEST_UNSURE, CHEAP = 9, 0.1

#: Seconds of a sample, below which a drawing is repeated in it, and the largest number of repetitions.
SHORTEST, MOST_REPEATED = 4e-3, 16

#: Standard error of the median ratio, as a share of it, from which on more rounds are asked for.
UNSURE = 0.03

#: Draws of the floor on each side of a sample take this share of the time of the sample, up to `MOST_FLOORS` draws.
FLOOR_SHARE, MOST_FLOORS = 0.3, 10


class Sample(NamedTuple):
    """Sample: seconds of one drawing.

    Attributes
    ----------
    wall, frame : float
        By the clock: until the passes that find thickness are done, and until all are.
    gpu : float or None
        Of those passes, by the GPU's timer.
    part, whole : float
        The same two, by the clock that drawings are compared by: see `translucent.bench.drawing.BenchContext`.
    """

    wall: float
    frame: float
    gpu: float | None
    part: float
    whole: float


@dataclass
class Samples:
    """Samples of one drawing over the rounds, in seconds.

    Attributes
    ----------
    wall, frame, gpu, part, whole : list of float
        As in `Sample`.
    floor, floor_wall : list of float
        Of the floor around each: `Sample.part` and `Sample.wall`.
    times, floor_times : int
        How often the drawing, and the floor, are drawn for a sample.
    """

    wall: list[float] = field(default_factory=list)
    frame: list[float] = field(default_factory=list)
    gpu: list[float] = field(default_factory=list)
    part: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    floor: list[float] = field(default_factory=list)
    floor_wall: list[float] = field(default_factory=list)
    times: int = 1
    floor_times: int = 1

    @property
    def spent(self) -> float:
        """Total time in seconds so far."""
        return self.times * sum(self.frame) + self.floor_times * sum(self.floor_wall)

    @property
    def of_whole_frames(self) -> Samples:
        """Samples of whole frames, for cases without passes that find thickness; the GPU's timer had only these."""
        return replace(self, wall=self.frame, gpu=[], part=self.whole)

    def add(self, sample: Sample, floor: float, floor_wall: float) -> None:
        """Add a sample."""
        for values, value in zip(
            (self.wall, self.frame, self.part, self.whole, self.floor, self.floor_wall),
            (sample.wall, sample.frame, sample.part, sample.whole, floor, floor_wall),
            strict=True,
        ):
            values.append(value)
        if sample.gpu is not None:
            self.gpu.append(sample.gpu)


def interleaved(
    floor: Callable[[], Sample],
    drawings: Mapping[str, Callable[[], Sample]],
    seconds: float,
    failed: Callable[[str, Exception], None],
    patience: float = 1.0,
    long: float = 0.3,
) -> dict[str, Samples]:
    """Measure all drawings, in turns, for about as many seconds; each gets an equal share, and at least a few rounds.

    Parameters
    ----------
    floor : callable
        Draws the floor.
    drawings : mapping of str to callable
    seconds : float
        In all.
    failed : callable
        Called with the name and the error of a drawing that raises, which is left out of the other rounds.
    patience : float
        How many times its share a drawing is timed at most while its ratio to the floor is `UNSURE`.
    long : float
        Seconds of a drawing from which on `FEWEST_LONG` rounds do.
    """
    warming = seconds / 8 / max(len(drawings), 1)
    warmed = {name: draw for name, draw in drawings.items() if _warm_up(name, draw, warming, failed)}
    for _ in range(5):
        floor()
    base, repeated = _Repeated(floor), {name: _Repeated(draw) for name, draw in warmed.items()}
    found = {name: Samples() for name in warmed}
    share = 0.85 * seconds / max(len(warmed), 1)
    typical = float(np.median([base.sample().wall for _ in range(5)]))
    while running := [name for name in warmed if not _enough(found[name], share, patience, long)]:
        before = _floor(base, typical, 0.0)
        for name in running:
            try:
                sample = repeated[name].sample()
            except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row, and the others go on
                failed(name, error)
                del warmed[name], found[name]
                continue
            after = _floor(base, typical, sample.wall * repeated[name].times / base.times)
            found[name].times, found[name].floor_times = repeated[name].times, base.times
            found[name].add(sample, 0.5 * (before[0] + after[0]), 0.5 * (before[1] + after[1]))
            before = after
    return found


def _warm_up(name: str, draw: Callable[[], Sample], seconds: float, failed: Callable[[str, Exception], None]) -> bool:
    """Warm up for some seconds, with at least one draw: shaders compile, buffers grow, caches fill."""
    begin = time.perf_counter()
    try:
        draw()
        while time.perf_counter() - begin < seconds:
            draw()
    except Exception as error:  # noqa: BLE001 - as above
        failed(name, error)
        return False
    return True


def _floor(floor: _Repeated, typical: float, beside: float) -> tuple[float, float]:
    """Medians of a few draws of the floor, the longer what is beside it takes the more: by both clocks."""
    count = int(np.clip(round(FLOOR_SHARE * beside / typical), 1, MOST_FLOORS))
    samples = [floor.sample() for _ in range(count)]
    return float(np.median([one.part for one in samples])), float(np.median([one.wall for one in samples]))


class _Repeated:
    """Drawing that is drawn as often for a sample as it takes to tell it from the noise of clocks.

    Attributes
    ----------
    times : int
    """

    def __init__(self, draw: Callable[[], Sample]) -> None:
        self._draw, self.times = draw, 0

    def sample(self) -> Sample:
        """Draw, and return the means of the times; the first sample decides how many they are."""
        samples = [self._draw()]
        if not self.times:
            self.times = math.ceil(min(SHORTEST / max(samples[0].frame, SHORTEST / MOST_REPEATED), MOST_REPEATED))
        samples += [self._draw() for _ in range(self.times - 1)]
        return samples[0] if len(samples) == 1 else _mean(samples)


def _mean(samples: list[Sample]) -> Sample:
    """Sample of means."""
    gpu = [one.gpu for one in samples if one.gpu is not None]
    wall, frame, part, whole = np.mean([(one.wall, one.frame, one.part, one.whole) for one in samples], axis=0).tolist()
    return Sample(wall, frame, float(np.mean(gpu)) if gpu else None, part, whole)


def _enough(samples: Samples, share: float, patience: float, long: float) -> bool:
    rounds = len(samples.wall)
    first = samples.frame[0] if rounds else 0.0
    fewest = FEWEST_LONGEST if first > LONGEST else FEWEST_LONG if first > long else FEWEST
    most = MOST * patience
    if rounds >= most or rounds < fewest or samples.spent < share:
        return rounds >= most
    if rounds < FEWEST_UNSURE and samples.spent < CHEAP and _unsure(samples):
        return False
    return samples.spent >= patience * share or not _unsure(samples)


def _unsure(samples: Samples) -> bool:
    found = ratio(samples.part, samples.floor)
    return found is not None and found.noise > UNSURE * found.median


def timing(seconds: list[float]) -> TimeStatistics | None:
    """Statistics in milliseconds; None without samples."""
    if not seconds:
        return None
    low, median, high, p95 = np.quantile(np.array(seconds) * 1e3, (0.25, 0.5, 0.75, 0.95))
    return TimeStatistics(float(median), float(p95), float(high - low), len(seconds))


def ratio(seconds: list[float], floor: list[float]) -> Ratio | None:
    """Statistics of the ratios of rounds."""
    if not seconds:
        return None
    quotients: npt.NDArray[np.float64] = np.array(seconds) / np.array(floor)
    low, median, high = np.quantile(quotients, (0.25, 0.5, 0.75))
    # The quartiles of a normal distribution are 1.349 standard deviations apart; the median of n samples has a
    # standard error of sqrt(pi / 2) = 1.253 standard deviations over sqrt(n).
    noise = 1.253 * (high - low) / 1.349 / np.sqrt(len(quotients))
    return Ratio(float(median), float(high - low), float(noise))
