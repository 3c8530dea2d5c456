"""A picture that gets better step by step: first coarse and at once, then with every pixel, then with less noise.

A step is one launch of a kernel. Nothing can interrupt it, so it must be short. A sweep is a number of steps that give
each cell of a grid one sample or more (grids.py). After the sweeps with every pixel, the film is that of a render with
so many samples of each pixel, bit for bit.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from visray import clock
from visray.film import Film
from visray.legend.layer import has_legend
from visray.live.blurring import Blurring
from visray.live.closeness import error_of
from visray.live.frame import Frame
from visray.live.grids import Grid, grains, grid
from visray.live.over import LegendOver, preload
from visray.live.pace import Pace
from visray.live.pixel_parts import Part, film_of, new_parts
from visray.live.replay import Replays
from visray.live.screen import Screen
from visray.motion_blur import FIRST_SWEEP
from visray.passes import PACKET
from visray.setup import Prepared

# Seconds from a change to the first state that shows it. Seconds that a later step should take: this share of the time
# since the change, within these limits. A hand that has just moved something may soon move it again.
FIRST, SHARE, SHORTEST, LONGEST = 0.07, 0.3, 0.05, 0.15
# A first state keeps the grain of the one before, unless this factor from FIRST: grains that change are restless.
STEADY = 1.35
# The picture is not finished with fewer samples of a pixel, and a pixel takes no more of them, whatever the error is.
LEAST_SAMPLES, MOST_SAMPLES = 16, 4096
# Seconds after a change from which on the legend is drawn, which takes longer than a step.
LEGEND = 0.6
# Seconds after a change from which on motion blur is computed. The picture begins anew then.
REST = 0.5
# Seconds after a change from which on the scene may be prepared for rest, which takes longer than a step.
SETTLED = 0.2
# Seconds of a sweep over all pixels from which on users are told that the scene takes long.
LONG = 4.0


class LivePicture:
    """The picture of a prepared scene, as a sequence of better and better states.

    prepared: the scene
    target: error at which the picture is finished
    pace: what is known of the duration of steps
    replays: recordings of passes
    rest: the same scene, prepared so that samples are faster, or with its shutter open, and the pace of its steps; a
        function, as this may take longer than a step. None: there is no such scene
    is_blurred: whether `rest` may open the shutter. Then the picture is sharp at first, and blurred when it rests
    """

    def __init__(
        self,
        prepared: Prepared,
        target: float,
        pace: Pace,
        replays: Replays | None = None,
        rest: Callable[[], tuple[Prepared, Pace]] | None = None,
        is_blurred: bool = False,
    ):
        self.prepared, self.target, self.pace, self.rest = prepared, target, pace, rest
        self.replays, self._waits = replays or Replays(), is_blurred
        self._blurring: Blurring | None = None
        film = prepared.scene.film
        self.size = film.raster
        self.screen = Screen(prepared.a, self.size, film.transparent)
        self.finished = False
        self.error: float | None = None
        self.parts: list[Part] = []
        self._todo: list[Part] = []
        self._done = self._goal = 0
        self._born = clock.now()
        self._whole: Grid | None = None
        self._legend: LegendOver | None = None
        if has_legend(prepared.scene):
            preload()

    @property
    def film(self) -> Film:
        """The film of all samples. Domain: between two sweeps over all pixels."""
        return film_of(self.prepared, self.parts)

    @property
    def _room(self) -> float:
        """Number of samples for which there is time in a step after the first one."""
        return self.pace.samples(min(max(SHARE * (clock.now() - self._born), SHORTEST), LONGEST))

    @property
    def is_new(self) -> bool:
        """Whether the next step needs a kernel that may have to be compiled."""
        return not self.replays.knows(self.prepared)

    def step(self) -> Frame:
        """The next state of the picture. Domain: it is not finished."""
        if not self._todo:
            self._next_sweep()
        part = self._todo[0]
        mean = self._blurred(part) if self.prepared.shutter else self._sampled(part, self._goal)
        if mean is None:
            return self._frame()
        self._todo.pop(0)
        self._done += dr.width(part.grid.cells)
        if self._whole.grain == 1:
            part.closeness.update(self.prepared.a, mean, part.count)
        if not self._todo:
            self._end_sweep()
        return self._frame()

    def _sampled(self, part: Part, goal: int) -> Any:
        """Takes samples of a part until each pixel has `goal` of them, and shows it. Returns its mean colours."""
        while True:
            begun, n, first = clock.now(), dr.width(part.grid.x), part.count
            moments, is_new = self.replays.sampled(
                self.prepared, part.grid.x, part.grid.y, part.moments, first, goal - first
            )
            traced = clock.now()
            dr.eval(moments)
            dr.sync_thread()
            ran = clock.now() - traced
            mean = self.screen.paint(part.grid, moments, goal)
            dr.sync_thread()
            if not is_new:
                break
            # Its time was that of compilation. It is repeated, so that its own time is known.
        part.moments, part.count = moments, goal
        self.pace.learn(n * (goal - first), clock.now() - begun, ran)
        return mean

    def _blurred(self, part: Part) -> Any:
        """Takes samples of a part while the shutter is open, for the time of a step. If these are all samples of the
        sweep, shows them, and returns the part's mean colours; else returns None."""
        begun = clock.now()
        if self._blurring is None:
            self._blurring = Blurring(self.prepared, self.replays, part.grid, part.moments, part.count, self._goal)
        if not self._blurring.go_on(begun + LONGEST, int(self.pace.samples(LONGEST))):
            return None
        part.moments, part.count, self._blurring = self._blurring.moments, self._goal, None
        mean = self.screen.paint(part.grid, part.moments, part.count)
        dr.sync_thread()
        return mean

    def _next_sweep(self) -> None:
        """Begins the next sweep: over a finer grid, or over all pixels."""
        a, before = self.prepared.a, self._whole
        if before is not None and before.grain == 1:
            largest = max(dr.width(part.grid.x) for part in self.parts)
            room = int(self._room / largest)
            done = self.parts[0].count
            self._goal = min(done + max(min(room, done), 1), MOST_SAMPLES)
            if self.prepared.shutter:
                # Sweeps through all moments double (motion_blur.py).
                self._goal = 2 * done
            self._todo, self._done = list(self.parts), 0
            return
        grain = self._next_grain(before)
        self._whole = whole = grid(a, *self.size, grain)
        self.screen.begin(whole)
        room = len(whole)
        if self.pace.per_sample is not None:
            room = max(int(self._room) // PACKET, 1) * PACKET
        self._todo = new_parts(self.prepared.a, whole, room)
        self._goal, self._done = 1, 0
        if grain == 1:
            self.parts = list(self._todo)

    def _next_grain(self, before: Grid | None) -> int:
        """Grain of the next sweep. before: the grid of the sweep before, if there was one."""
        known = grains(*self.size)
        if self.pace.per_sample is None:
            # Nothing is known of the scene, which may be very slow.
            return known[0]
        pixels = self.size[0] * self.size[1]
        if before is None:
            room, old = self.pace.samples(FIRST, first=True), self.pace.grain
            fitting = [g for g in known if pixels / g**2 <= room] or [known[0]]
            if old in known and room / STEADY <= pixels / old**2 <= room * STEADY:
                fitting.append(old)
            self.pace.grain = fitting[-1]
            return fitting[-1]
        room = self._room
        finer = [g for g in known if g < before.grain]
        return ([g for g in finer if pixels / g**2 <= room] or [finer[0]])[-1]

    def _end_sweep(self) -> None:
        """What is known after a sweep."""
        if self._whole.grain > 1:
            return
        count = self.parts[0].count
        self.error = error_of([part.closeness for part in self.parts], self.size[0] * self.size[1])
        is_good = self.error is not None and self.error <= self.target and count >= LEAST_SAMPLES
        is_good |= count >= MOST_SAMPLES
        if self._waits and clock.now() - self._born < REST and count < MOST_SAMPLES:
            return
        # Else a slider that moves would wait for what only a picture at rest needs, such as lists of rows.
        rests = self._waits or (not is_good and clock.now() - self._born >= SETTLED)
        if self.rest is not None and rests:
            is_good &= not self._begin_rest()
        self.finished = is_good

    def _begin_rest(self) -> bool:
        """Goes on with the scene that is prepared for rest. Returns whether the picture begins anew, as its shutter is
        open."""
        prepared, pace = self.rest()
        self.rest, self._waits = None, False
        if pace.per_sample is None:
            pace.fixed, pace.per_sample = self.pace.fixed, self.pace.per_sample
        if prepared.shutter or pace.per_sample <= self.pace.per_sample:
            self.prepared, self.pace = prepared, pace
        if prepared.shutter:
            # A launch takes the samples of one moment: about so many samples of each pixel in the first sweep.
            each = FIRST_SWEEP / len(prepared.shutter.values)
            # The sharp picture is seen until a part has its first samples.
            room = max(int(self._room / min(each, FIRST_SWEEP)) // PACKET, 1) * PACKET
            self.parts = new_parts(prepared.a, self._whole, room)
            self._todo, self._goal, self._done, self.error = list(self.parts), FIRST_SWEEP, 0, None
        return prepared.shutter is not None

    def _frame(self) -> Frame:
        """The state as it is now."""
        whole, share = self._whole, self._done / len(self._whole)
        samples = 1 / whole.grain**2
        if whole.grain == 1:
            samples = sum(part.count * dr.width(part.grid.x) for part in self.parts) / len(whole)
        notes, passing = [], len(grid(self.prepared.a, *self.size, 1)) * (self.pace.per_sample or 0.0)
        if passing > LONG:
            notes.append(f"a sample of each pixel takes about {passing:.0f} s")
        if self.prepared.shutter or self._waits:
            notes.append("with motion blur" if self.prepared.shutter else "sharp; motion blur comes at rest")
        rgb = self._with_legend(self.screen.rgb())
        return Frame(
            rgb, self.size, whole.grain, samples, self.error, self.finished, share=share, note=", ".join(notes)
        )

    def _with_legend(self, rgb: np.ndarray) -> np.ndarray:
        """The colours with the legend of the scene, once the picture is at rest."""
        rests = self.finished or clock.now() - self._born > LEGEND
        if self._whole.grain > 1 or not self.parts[-1].count or not has_legend(self.prepared.scene):
            return rgb
        if self._legend is None and rests and not self._todo:
            self._legend = LegendOver(self.prepared.scene, rgb)
        return rgb if self._legend is None else self._legend.over(rgb)
