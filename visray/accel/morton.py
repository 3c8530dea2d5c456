"""Clusters of boxes that are near each other, by Morton codes.

The Morton code of a point interleaves the bits of its coordinates, so points with near codes are mostly near each
other. Source: Morton 1966; for trees over boxes: Lauterbach and others 2009.
"""

import numpy as np

BITS = 10  # bits of a code for each axis


def clusters(low: np.ndarray, high: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(the numbers of all boxes, cluster by cluster and by their codes; place of each cluster's first box; number of
    boxes of each cluster).

    A cluster is a set of all boxes whose codes begin with the same bits. It has at most `most` boxes, or boxes that all
    have one code.

    low, high: corners of the boxes. Shape: (3, n).
    """
    centre = low + high
    least = centre.min(axis=1, keepdims=True)
    extent = (centre - least).max()
    steps = (centre - least) * (2**BITS / extent) if extent > 0 else np.zeros_like(centre)
    x, y, z = (_spread(np.minimum(s, 2**BITS - 1).astype(np.uint32)) for s in steps)
    code = x | (y << np.uint32(1)) | (z << np.uint32(2))
    order = np.argsort(code, kind="stable")
    code = code[order]
    head, count, done = np.array([0]), np.array([len(code)]), []
    for bit in reversed(range(3 * BITS)):
        large = count > most
        done.append((head[~large], count[~large]))
        head, count = head[large], count[large]
        if not len(head):
            break
        # Within a cluster all higher bits are equal. So it is cut before the first code in which this bit is set.
        first_set = ((code[head] >> np.uint32(bit)) | np.uint32(1)) << np.uint32(bit)
        cut = np.clip(np.searchsorted(code, first_set), head, head + count)
        halves = np.stack([head, cut], axis=1).ravel(), np.stack([cut - head, head + count - cut], axis=1).ravel()
        head, count = (x[halves[1] > 0] for x in halves)
    done.append((head, count))
    head, count = (np.concatenate(x) for x in zip(*done))
    by_place = np.argsort(head)
    return order, head[by_place], count[by_place]


def _spread(x: np.ndarray) -> np.ndarray:
    """The numbers with two zero bits after each of their bits. Domain: below 2^10."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        x = (x | (x << np.uint32(shift))) & np.uint32(mask)
    return x
