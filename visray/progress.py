"""Long work: a bar with the time left after two seconds, and Ctrl-C that waits for a good moment."""

import signal
import threading
from types import FrameType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from visray import clock

SHOWN_AFTER = 2.0


class Bar:
    """Reports the share done of a total, which may change, on standard error; a context manager."""

    def __init__(self, title: str, total: int, shown: bool = True):
        self.title, self.total, self.shown = title, total, shown
        self.begun = clock.now()
        self.bar: Progress | None = None

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()

    def update(self, done: int) -> None:
        """Says that `done` steps are done."""
        if self.bar is None:
            if not self.shown or clock.now() - self.begun < SHOWN_AFTER or done >= self.total:
                return
            columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %")
            console = Console(stderr=True)
            self.bar = Progress(*columns, TimeElapsedColumn(), "left", TimeRemainingColumn(), console=console)
            self.bar.start()
            # The time before the bar appeared counts for the estimate of what is left.
            task = self.bar.add_task(self.title, total=self.total)
            self.bar.tasks[task].start_time -= clock.now() - self.begun
        self.bar.update(self.bar.task_ids[0], completed=done, total=max(self.total, done))


class Interrupts:
    """Takes Ctrl-C as a request: `requested` becomes true, and the work stops at a safe point. A second one interrupts.

    An interrupt in the middle of Dr.Jit's tracing would leave half a kernel behind.
    """

    def __init__(self) -> None:
        self.requested = False
        self.before: object = None

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            self.before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *_: object) -> None:
        if self.before is not None:
            signal.signal(signal.SIGINT, self.before)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
