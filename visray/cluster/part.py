"""Parts of a picture: what one task of a worker renders. A picture is cut into tiles, or into sample blocks as well.

Tiles travel and merge with the fewest bytes: a film has as many numbers per pixel with any number of samples. The sums
of a block of 16 samples (moments.py) take about half as many bytes as such a film, for each block. So a picture is cut
into sample blocks only if it has too few pixels for tiles.
"""

from dataclasses import dataclass

from visray.moments import BLOCK
from visray.passes import PACKET

# A task should run for TARGET seconds, and near the end of a picture, when workers would wait for others, for LEAST.
TARGET, LEAST = 1.5, 0.5
# A picture that does not have this many tiles for each worker is cut into sample blocks.
TILES_PER_WORKER = 4


@dataclass(frozen=True)
class Part:
    """Some samples of some pixels.

    number: number of the part, from 0
    begin, end: the lanes, as a range of passes.spread_lanes
    first_block, end_block: range of sample blocks; the whole range of a picture's blocks makes a tile
    is_tile: whether the part has all samples of its lanes, and comes back as a film
    """

    number: int
    begin: int
    end: int
    first_block: int
    end_block: int
    is_tile: bool

    @property
    def lanes(self) -> slice:
        """The lanes, as a slice of passes.spread_lanes."""
        return slice(self.begin, self.end)

    @property
    def blocks(self) -> int:
        """Number of sample blocks."""
        return self.end_block - self.first_block

    @property
    def name(self) -> str:
        """What the dashboard calls the part."""
        return f"visray-{'tile' if self.is_tile else 'samples'}-{self.number}"


def least_lanes(threads: int) -> int:
    """Number of lanes that keep all threads of a worker busy: Dr.Jit gives each thread whole packets of lanes."""
    return PACKET * threads


class Cutter:
    """Cuts a picture into parts, one after the other. The bits of the picture do not depend on how it is cut.

    lanes: number of lanes of the picture
    spp: samples per pixel
    workers: number of workers
    least: number of lanes that keep a worker busy
    may_split: whether the samples of a pixel may be divided
    """

    def __init__(self, lanes: int, spp: int, workers: int, least: int, may_split: bool = True):
        self.lanes, self.spp, self.least = lanes, spp, least
        self.blocks = -(-spp // BLOCK)
        self.by_blocks = may_split and self.blocks > 1 and lanes < TILES_PER_WORKER * workers * least
        self.number, self.lane, self.block = 0, 0, 0

    @property
    def samples_left(self) -> int:
        """Number of samples in all parts that are not cut yet."""
        if not self.by_blocks:
            return (self.lanes - self.lane) * self.spp
        left = self.spp - BLOCK * self.block
        return self.lanes * max(left, 0) - self.lane * min(left, BLOCK)

    @property
    def is_done(self) -> bool:
        """Whether the whole picture is cut."""
        return self.block == self.blocks if self.by_blocks else self.lane == self.lanes

    def part(self, samples: float) -> Part:
        """The next part, of about this many samples. Domain: not is_done."""
        begin, per_lane = self.lane, BLOCK if self.by_blocks else self.spp
        size = max(samples / per_lane, self.least)
        end = self._end(begin + int(size) // PACKET * PACKET)
        first, count = self.block, self.blocks
        if self.by_blocks:
            # Several blocks of all lanes, or one block of some lanes.
            count = int(min(max(size // self.lanes, 1), self.blocks - first)) if begin == 0 and end == self.lanes else 1
            self.block += count if end == self.lanes else 0
            self.lane = end % self.lanes
        else:
            self.lane = end
        self.number += 1
        return Part(self.number - 1, begin, end, first, first + count, not self.by_blocks)

    def _end(self, end: int) -> int:
        """The end of a range of lanes near `end`: less than a packet is not left over."""
        return self.lanes if self.lanes - end < PACKET else end


class Pace:
    """Measured speed of the workers, and how many samples the next task should have.

    first: number of samples of the first tasks, which are measured
    """

    def __init__(self, first: int):
        self.first, self.samples, self.seconds = first, 0, 0.0

    def add(self, samples: int, seconds: float) -> None:
        """Records a task."""
        self.samples, self.seconds = self.samples + samples, self.seconds + seconds

    def next_samples(self, left: int, workers: int) -> float:
        """Number of samples of the next task. left: those that no worker has yet. workers: number of workers"""
        if not self.seconds:
            return self.first
        rate = self.samples / self.seconds
        return max(min(TARGET * rate, left / (2 * workers)), LEAST * rate)
