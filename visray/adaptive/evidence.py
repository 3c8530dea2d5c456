"""What the samples of an adaptive render tell so far: the error, the allocation of further samples, and the light that
may have been missed."""

from collections.abc import Callable
from dataclasses import astuple

import numpy as np

from visray.adaptive.allocation import Allocation, neighbour_means, weight_steps
from visray.adaptive.brightness import Brightness
from visray.adaptive.cell_buffer import CellBuffer
from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.estimate import Estimate
from visray.adaptive.journal import Journal
from visray.adaptive.small_objects import small_objects
from visray.data.all_objects import address_of
from visray.setup import Prepared

# Light is hidden if it may be HIDDEN times as bright as the brightest pixels of the picture. Most pictures show a third
# of the greatest brightness that their lights and materials allow. The brightest pixels are a share of the picture, but
# at least and at most so many.
HIDDEN = 3.0
SHARE_OF_BRIGHTEST, FEWEST_BRIGHTEST, MOST_BRIGHTEST = 0.01, 4, 16


class NotANumber(Exception):
    """Raised if a pixel is not a number. `mean`: colours of the picture's pixels. Shape: (3, N)."""

    def __init__(self, mean: np.ndarray):
        super().__init__("a pixel is not a number")
        self.mean = mean


class Evidence:
    """The samples of an adaptive render, and what follows from them.

    journal: the results that the render decides by.
    buffer: the dual buffer that samples are added to.
    estimate: error that is estimated from the samples so far.
    pilot_squares: mean square errors in the pilot, as a dict by the number of samples that all lanes had.
    hidden: brightness of light that samples may have missed, and what it is. The small objects that got no samples of
        their own are part of it.
    """

    def __init__(self, prepared: Prepared, journal: Journal):
        self.journal, self.buffer = journal, DualBuffer(prepared, journal)
        self.estimate: Estimate
        self.pilot_squares: dict[int, float] = {}
        self.hidden: tuple[float, str] = 0.0, ""

    def look(self) -> None:
        """Estimates the error of the samples so far. Raises NotANumber if a pixel is not a number."""
        hidden, *estimate = self.journal.result(self._looked).tolist()
        self.buffer.hidden, self.estimate = hidden, Estimate(*estimate)

    def _looked(self) -> tuple[float, ...]:
        """Brightness of the light that is hidden, and the numbers of the estimate."""
        buffer = self.buffer
        buffer.hidden = 0.0
        if self.hidden[0]:
            brightness = np.sqrt(np.square(buffer.mean()).mean(0))
            if buffer.cells is not None:
                brightness = np.delete(brightness, buffer.cells.lanes)
            k = int(np.clip(SHARE_OF_BRIGHTEST * len(brightness), FEWEST_BRIGHTEST, MOST_BRIGHTEST))
            shown = np.sort(brightness)[-k:][0] if len(brightness) else 0.0
            buffer.hidden = self.hidden[0] if self.hidden[0] > HIDDEN * shown else 0.0
        estimate = buffer.estimate()
        if not np.isfinite(estimate.square):
            raise NotANumber(buffer.mean())
        return buffer.hidden, *astuple(estimate)

    def allocation(self) -> Allocation:
        """Allocation by the variance of the samples so far. Updates `estimate` and `pilot_squares` too."""
        self.look()
        counts = self.buffer.counts
        if counts.min() == counts.max():
            self.pilot_squares[int(counts[0])] = self.estimate.square
        steps = self.journal.result(lambda: weight_steps(self._nearby_variances()))
        allocation = Allocation.of_steps(steps, counts[: self.buffer.n])
        allocation.update(self.estimate.square - self.estimate.cells, counts[: self.buffer.n])
        return allocation

    def _nearby_variances(self) -> np.ndarray:
        """Mean variance around each pixel, divided by the square of the picture's luminance. Shape: (N)."""
        buffer, film, order = self.buffer, self.buffer.prepared.scene.film, self.buffer.prepared.order
        variances = np.ones(len(order))
        if buffer.counts.min() > 1:
            variances[order] = buffer.variances().reshape(2, -1).sum(0)
        # A black picture has no luminance to divide by.
        variances /= np.square(self.estimate.luminance) or 1.0
        known = np.ones(variances.shape, bool)
        if buffer.cells is not None:
            known[order[buffer.cells.lanes]] = False
        shape = film.raster[::-1]
        return neighbour_means(variances.reshape(shape), known.reshape(shape)).ravel()[order]

    def look_at_small_objects(self, has_time: Callable[[], bool], seconds_left: Callable[[], float]) -> None:
        """Gives the pixels that show small objects samples of their own. Small objects that cannot have these are
        hidden light.

        has_time: function that returns whether there is time to compile the kernel of these samples.
        seconds_left: as for LaneBuffer.extend.
        """
        buffer, prepared = self.buffer, self.buffer.prepared
        cells, brightness = small_objects(prepared), Brightness.of(prepared)
        self.hidden = brightness.hidden, brightness.cause
        names, materials = list(prepared.scene.all_objects), prepared.scene.materials_of_objects()

        def bright(number: int) -> float:
            return max(brightness.objects[name] for name in materials[number])

        missed = list(cells.missed)
        if len(cells.pixels):
            own = CellBuffer(prepared, cells, np.array([bright(k) for k in cells.objects]), self.journal)
            if has_time() and own.rise(seconds_left):
                buffer.cells = own
            else:
                missed += list(cells.objects)
        if missed:
            brightest = max(missed, key=bright)
            if bright(brightest) > self.hidden[0]:
                self.hidden = bright(brightest), f"{address_of(names[brightest])}, smaller than a pixel"
