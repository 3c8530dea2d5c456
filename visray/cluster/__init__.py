"""Work on several machines, or on several processes of one, by Dask's scheduler and workers (the extra `cluster`).

A client sends a scene with its files once to each worker. Workers take samples and send films back, which are merged to
the bits of one machine.
"""
