"""A picture that gets better step by step: first coarse and at once, then with every pixel, then with less noise.

A lane is one pixel in the arrays of a kernel. A step is one launch of a kernel. The grain is the side in pixels of the
squares that a coarse state consists of.
"""

from dataclasses import dataclass

import numpy as np

from visray import clock
from visray import film as films
from visray.live.frame import Frame
from visray.moments import Moments
from visray.output.curves import LUMINANCE, curve
from visray.pass_timer import PassTimer
from visray.passes import PACKET, empty_film, exposed_once, spread_lanes, subset
from visray.setup import Prepared

# Seconds that the first state of a picture should take, and that each later step should take. Nothing can interrupt a
# step, so a hand at the mouse waits for its end.
FIRST, STEP = 0.06, 0.12
# Sides of the squares of coarse states.
GRAINS = (32, 16, 8, 4, 2)
# A pixel takes no more samples than this, whatever the error is.
MOST_SAMPLES = 4096


@dataclass
class Pace:
    """How long steps take. One for all pictures of a viewer, so that each knows what those before have learned.

    fixed: seconds that every step takes, whatever its number of samples
    per_sample: seconds that one sample of one pixel takes; None before the first step
    """

    fixed: float = 0.0
    per_sample: float | None = None

    def learn(self, samples: int, seconds: float, ran: float) -> None:
        """Learns from a step. seconds: how long it took without compilation; ran: how long its kernels ran."""
        self.per_sample = ran / samples
        self.fixed = max(seconds - ran, 0.0)

    def samples(self, seconds: float) -> float:
        """Number of samples for which there is time in a step."""
        if self.per_sample is None:
            return 4096
        return max(seconds - self.fixed, seconds / 4) / max(self.per_sample, 1e-12)


class LivePicture:
    """The picture of a prepared scene, as a sequence of better and better states.

    prepared: the scene
    target: error at which the picture is finished
    pace: what is known of the duration of steps
    """

    def __init__(self, prepared: Prepared, target: float, pace: Pace):
        self.prepared, self.target, self.pace = prepared, target, pace
        film = prepared.scene.film
        self.width, self.height = film.width, film.height
        self.grain = self._first_grain()
        self.finished = False
        self.film: films.Film | None = None
        self.left = np.zeros(0, np.int64)
        self.goal = 0

    def step(self) -> Frame:
        """The next state of the picture. Domain: it is not finished."""
        if self.grain > 1:
            frame = self._coarse(self.grain)
            self.grain = max(self.grain // 2, 1)
            return frame
        return self._fine()

    def _first_grain(self) -> int:
        """Grain of the first state: the finest one for which there is time."""
        room, pixels = self.pace.samples(FIRST), self.width * self.height
        fitting = [g for g in (*GRAINS, 1) if pixels / g**2 <= room]
        return min(fitting, default=GRAINS[0])

    def _exposed(self, prepared: Prepared, film: films.Film, targets: np.ndarray | int) -> films.Film:
        """The film after one more step. targets: number of samples that each lane has then."""
        timer, begun = PassTimer(), clock.now()
        samples = int(np.sum(targets - film.counts))
        film = exposed_once(prepared, film, targets, timer)
        ran = timer.sample_seconds * samples
        self.pace.learn(samples, clock.now() - begun - timer.compile_seconds, ran)
        return film

    def _coarse(self, grain: int) -> Frame:
        """A state in which one pixel of each square is computed."""
        columns, rows = (np.arange(-(-n // grain)) * grain for n in (self.width, self.height))
        columns, rows = (np.minimum(x + grain // 2, n - 1) for x, n in ((columns, self.width), (rows, self.height)))
        wanted = (rows[:, None] * self.width + columns).ravel()
        lane_of = np.empty(len(self.prepared.order), np.int64)
        lane_of[self.prepared.order] = np.arange(len(lane_of))
        lanes = lane_of[wanted]
        sorting = np.argsort(lanes)
        part = subset(self.prepared, lanes[sorting])
        film = self._exposed(part, empty_film(part), 1)
        picture = np.empty((len(wanted), 3))
        picture[sorting] = np.array(film.mean).T
        rgb = displayed(picture.reshape(len(rows), len(columns), 3))
        return Frame(rgb, (self.width, self.height), grain, 1 / grain**2, None, False)

    def _fine(self) -> Frame:
        """A state in which each pixel has its own colour, with more samples than the state before."""
        n, a = len(self.prepared.order), self.prepared.a
        if self.film is None:
            self.film = empty_film(self.prepared)
        while True:
            if not len(self.left):
                done = int(self.film.counts.min())
                room = max(int(self.pace.samples(STEP) / n), 1)
                self.goal = min(done + min(max(done, 1), room), MOST_SAMPLES)
                self.left = spread_lanes(n)
            room = max(int(self.pace.samples(STEP) / max(self.goal - self.film.counts.min(), 1)) // PACKET, 1) * PACKET
            if len(self.left) == n and room >= n:
                self.film, self.left = self._exposed(self.prepared, self.film, self.goal), self.left[:0]
                return self._state()
            now, self.left = np.split(self.left, [room if len(self.left) - room >= PACKET else len(self.left)])
            kinds, moments = Moments.types(a), [np.array(x) for x in self.film.moments.arrays]
            counts = self.film.counts.copy()
            part = films.Film(a, Moments(*(a.put(k, x[..., now]) for k, x in zip(kinds, moments))), counts[now], now)
            part = self._exposed(subset(self.prepared, now), part, np.full(len(now), self.goal))
            for x, new in zip(moments, part.moments.arrays):
                x[..., now] = np.array(new)
            counts[now] = part.counts
            self.film = self.film.with_moments(Moments(*(a.put(k, x) for k, x in zip(kinds, moments))), counts)
            if counts.all():
                return self._state()

    def _state(self) -> Frame:
        """The state of the film."""
        film, counts = self.film, self.film.counts
        mean, error = np.array(film.mean), None
        if counts.min() > 1:
            luminance = float((LUMINANCE @ mean).mean())
            square = float((np.array(film.squares) / (counts - 1) / counts).mean())
            error = np.sqrt(square) / luminance if luminance > 0 else None
        self.finished = (error is not None and error <= self.target) or counts.min() >= MOST_SAMPLES
        rgb = np.empty((len(counts), 3))
        rgb[self.prepared.order] = mean.T
        rgb = displayed(rgb.reshape(self.height, self.width, 3))
        size = self.width, self.height
        return Frame(rgb, size, 1, float(counts.mean()), error, self.finished)


def displayed(rgb: np.ndarray) -> np.ndarray:
    """Linear colours as they are shown on a screen. Shapes: (h, w, 3) to uint8 (h, w, 3)."""
    return np.floor(curve(np.clip(rgb, 0, 1), "srgb") * 255 + 0.5).astype(np.uint8)
