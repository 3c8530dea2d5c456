"""Feedback and interruption of long work: a progress bar that appears after two seconds, and Ctrl-C that stops the work
at a safe point. Work in a thread can be followed and stopped by another thread instead (Follower)."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING, ClassVar

from visray import clock

if TYPE_CHECKING:
    from rich.progress import Progress

SHOWN_AFTER = 2.0


@dataclass
class Follower:
    """Follows the long work of a thread from another one.

    report: function that is called with what is done, as a text, and its share that is done, from 0 to 1
    stopped: whether the work should stop at a safe point, as after Ctrl-C
    """

    report: Callable[[str, float], None]
    stopped: bool = False

    @contextmanager
    def following(self) -> Iterator[None]:
        """Follows what the current thread does in a `with` block."""
        token = _FOLLOWER.set(self)
        try:
            yield
        finally:
            _FOLLOWER.reset(token)


# The follower of the work of the current thread.
_FOLLOWER: ContextVar[Follower | None] = ContextVar("follower", default=None)


class Bar:
    """Progress bar on standard error, with the estimated time left; a context manager.

    title: text before the bar
    total: total number of steps, which may change; 1 for work that is finished when the bar is left
    shown: whether the bar may appear
    before: text before the bar until the first step is finished, such as "compiling"; None means the title. A thread
        shows it, because a compilation may take minutes, in which no step is reported.
    """

    def __init__(self, title: str, total: int, shown: bool = True, before: str | None = None):
        self.title, self.total, self.shown, self.before = title, total, shown, before or title
        self.is_one_step = total == 1 and before is None
        self.begun, self.lock = clock.now(), threading.Lock()
        self.timer = threading.Timer(SHOWN_AFTER, self._appear)
        self.bar: Progress | None = None
        self.follower = _FOLLOWER.get()

    def __enter__(self) -> "Bar":
        if self.follower is not None:
            self.follower.report(self.before, 0.0)
        if self.shown:
            self.timer.daemon = True
            self.timer.start()
        return self

    def __exit__(self, error: type | None, *_: object) -> None:
        self.timer.cancel()
        with self.lock:
            self.shown = False
            if self.bar is not None:
                if error is None and self.is_one_step:
                    self.bar.update(self.bar.task_ids[0], completed=1, total=1)
                self.bar.stop()

    def update(self, done: float) -> None:
        """Reports that `done` of the steps are finished."""
        if self.follower is not None:
            self.follower.report(self.title, done / max(self.total, done) if done else 0.0)
        with self.lock:
            self.timer.cancel()
            if self.bar is None:
                if not self.shown or clock.now() - self.begun < SHOWN_AFTER or done >= self.total:
                    return
                self._show()
            task, total = self.bar.task_ids[0], max(self.total, done)
            self.bar.update(task, description=self.title, completed=done, total=total)

    def _appear(self) -> None:
        """Shows the bar before a step is finished."""
        with self.lock:
            if self.shown and self.bar is None:
                self._show()

    def _show(self) -> None:
        """Shows the bar, without a number of steps."""
        self.bar = _rich_bar()
        self.bar.start()
        # The estimate of the time left includes the time before the bar appeared.
        task = self.bar.add_task(self.before, total=None)
        self.bar.tasks[task].start_time -= clock.now() - self.begun


def _rich_bar() -> "Progress":
    """A progress bar of rich."""
    # Here, because most work is done before a bar would appear.
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    title, share = TextColumn("{task.description}", markup=False), TextColumn("{task.percentage:>3.0f} %")
    times = TimeElapsedColumn(), "left", TimeRemainingColumn()
    return Progress(title, BarColumn(), share, *times, console=Console(stderr=True))


class Interrupts:
    """Turns Ctrl-C into a request: `requested` becomes true, and the work stops at a safe point. A second Ctrl-C
    interrupts at once. Where the program handles SIGTERM, as the command line does, SIGTERM is the same request. In
    other programs, SIGTERM ends the process, as they expect.

    An interrupt in the middle of Dr.Jit's tracing would leave an incomplete kernel behind. Instances may be nested: a
    request to the inner one is a request to the outer one too.

    last: number of the last signal that was a request, in any instance; None if there was none.
    requested: whether Ctrl-C was pressed, or a Follower has stopped the work.
    has_results: whether there is something to keep. Until then, a process that Ctrl-C cannot reach may be ended.
    """

    last: ClassVar[int | None] = None

    def __init__(self, has_results: bool = True) -> None:
        self._requested, self.has_results, self.follower = False, has_results, _FOLLOWER.get()
        self.previous_handlers: dict[int, object] = {}

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            numbers = [signal.SIGINT, signal.SIGTERM] if callable(signal.getsignal(signal.SIGTERM)) else [signal.SIGINT]
            self.previous_handlers = {number: signal.signal(number, self._request) for number in numbers}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self.previous_handlers.items():
            if handler is not None:
                signal.signal(number, handler)

    @property
    def requested(self) -> bool:
        return self._requested or (self.follower is not None and self.follower.stopped)

    @requested.setter
    def requested(self, requested: bool) -> None:
        self._requested = requested

    def loses_nothing(self) -> bool:
        """Whether nothing would be lost if the process ended now."""
        outer = self._outer()
        return not self.has_results and (outer is None or outer.loses_nothing())

    def _outer(self) -> "Interrupts | None":
        """The instance in whose block this one is used, if there is one."""
        owner = getattr(self.previous_handlers.get(signal.SIGINT), "__self__", None)
        return owner if isinstance(owner, Interrupts) else None

    def _ask(self) -> None:
        """Records a request, also for the outer instances."""
        self.requested = True
        if (outer := self._outer()) is not None:
            outer._ask()

    def _request(self, number: int, frame: FrameType | None) -> None:
        """Handler of the signals: the first one is recorded, the second goes to the previous handler."""
        Interrupts.last = number
        if not self.requested:
            self._ask()
        elif callable(previous_handler := self.previous_handlers.get(number)):
            previous_handler(number, frame)
        else:
            raise KeyboardInterrupt
