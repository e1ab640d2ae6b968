"""Randomness that belongs to a thing, never to a worker, an arrival order or a task list.

A stream is a counter-based Philox generator whose key is a stable hash of what it is for:

    stream("environment", root_seed, "maze", 0, episode, "g0>g2")

Environment and policy streams leave the method out, so that methods are compared under common
random numbers; planner streams put it in.
"""

from __future__ import annotations

import hashlib

import numpy as np

Label = str | int


def stream(*labels: Label) -> np.random.Generator:
    """The generator that these labels name; the same labels give the same draws everywhere."""
    # Length-prefixed, so that ("ab", "c") and ("a", "bc") name different streams.
    digest = hashlib.blake2b(digest_size=16)
    for label in labels:
        kind = "str" if isinstance(label, str) else "int"  # numpy's integers are integers
        text = f"{kind}:{label}".encode()
        digest.update(len(text).to_bytes(4, "little") + text)
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest.digest(), "little")))
