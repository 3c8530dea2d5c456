"""Asks the workers of a scheduler for what a client must know of them."""

import asyncio
from typing import Any

from visray.cluster.refusal import facts


def facts_of(client: Any, seconds: float) -> dict[str, dict[str, Any] | str]:
    """The facts of each worker, by its address; of one that has none, the reason.

    client: Dask's client
    seconds: time in which a worker must answer. A process that is stopped keeps its connection, and never does.
    """

    async def asked(worker: str) -> dict[str, Any] | str:
        """The facts of a worker."""
        try:
            found = await asyncio.wait_for(client.run(facts, workers=[worker], on_error="return"), seconds)
        except TimeoutError:
            return f"does not answer within {seconds:g} s"
        own = found.get(worker, "it has ended")
        return own if isinstance(own, dict) else f"cannot import visray: {own}"

    async def all_asked(workers: list[str]) -> list[dict[str, Any] | str]:
        """The facts of all workers."""
        return await asyncio.gather(*map(asked, workers))

    workers = list(client.nthreads())
    return dict(zip(workers, client.sync(all_asked, workers)))
