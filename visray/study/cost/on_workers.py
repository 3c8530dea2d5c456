"""Turns of a study on the workers of a cluster. A turn is one task, because its choices must be measured one after the
other on one machine. The times are then those of the workers."""

from collections.abc import Iterator, Sequence

from visray.cluster.crew import Crew
from visray.cluster.kept_scenes import kept_scene
from visray.cluster.refusal import versions
from visray.cluster.scene_package import ScenePackage
from visray.cluster.worker import Order, ready, unpacking
from visray.progress import Bar, Interrupts
from visray.study.cost.choices import Choice
from visray.study.cost.measuring import Measurement, Studio, Turn


def measured_on(
    crew: Crew, studio: Studio, choices: list[Measurement], turns: Sequence[Turn], bar: Bar
) -> Iterator[tuple[int, list]]:
    """Yields the number of each turn, and what Studio.once says of each choice, in any order, until Ctrl-C."""
    crew.send(ScenePackage.of(studio.scene))
    order, done = Order(versions(), threads=crew.threads), 0
    asked = tuple(choice.choice for choice in choices), tuple(studio.seeds)
    for turn in turns:
        crew.submit(turn, f"visray-turn-{turn.number}", turn_of, order, *asked, turn)
    while crew.is_busy and not studio.interrupts.requested:
        for turn, found in crew.done():
            done += 1
            bar.update(done * len(choices))
            yield turn.number, found
    crew.cancel()


def turn_of(
    package: ScenePackage, order: Order, choices: tuple[Choice, ...], seeds: tuple[int, ...], turn: Turn
) -> list:
    """What Studio.once says of each choice in a turn. A worker calls this.

    seeds: the seeds of all turns
    """
    with ready(order):
        with unpacking():
            kept = kept_scene(package)
        studio = Studio(kept.scene, seeds, Interrupts())
        studio, measured = kept.made_once((repr(choices), seeds), lambda: (studio, studio.prepared(choices)))
        found = {i: studio.once(measured[i], turn.seeds) for i in turn.order}
        return [found[i] for i in range(len(choices))]
