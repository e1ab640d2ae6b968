"""A forecast of which pairs of skills work, from held-out demonstrations alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from stitching.data.initiation import distance_scale
from stitching.data.transitions import Transitions
from stitching.envs.factors import Factors
from stitching.envs.protocol import Benchmark


def configuration(factors: Factors) -> list[int]:
    """Columns of the robot's pose, and of the positions of all objects that a skill is about."""
    names = [name for name in factors.names if name in factors.own.values()]
    positions = [column for name in names for column in factors.objects[name].positions]
    return [*factors.pose, *positions]


def pair_forecast(
    benchmark: Benchmark, data: Transitions, competence: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """How often the second skill of each ordered pair will succeed once the first one has.

    P(B | A) = c(B) · mean over e of exp(−d(e, B)): c(B) is how often B's policy succeeds from its
    own held-out starts (`stitching.studies.diagnosis.competence`), e runs over the states in which
    A's held-out demonstrations succeed, and d(e, B) is the distance from e to the nearest start of
    B's. Two states are as far apart as the root mean square difference of their configurations
    (`configuration`), each number in units of its standard deviation in the held-out data. Nothing
    here was fitted to a pair.

    Without a stitch. A's demonstrations may have moved other objects before A, and e has them as
    they are then; where a pair is played, nothing came before A. A pair is left out if either
    skill has no held-out demonstration that succeeds. Each entry has first, second, distance (the
    median of d) and success.
    """
    columns = configuration(benchmark.factors)
    scale = distance_scale(data, columns)
    last = data.episode_ends - 1
    starts, ends = {}, {}
    for index, skill in enumerate(benchmark.skills):
        own = (data.episode_skills == index) & data.episode_successes
        if own.any():
            starts[skill.name] = data.observations[data.episode_starts[own]][:, columns] / scale
            ends[skill.name] = data.next_observations[last[own]][:, columns] / scale
    forecast = []
    for first in ends:
        for second in starts:
            if first == second or second not in competence:
                continue
            gaps = cdist(ends[first], starts[second]).min(axis=1)
            own_rate = competence[second]["successes"] / competence[second]["trials"]
            forecast.append(
                {
                    "first": first,
                    "second": second,
                    "distance": float(np.median(gaps)),
                    "success": float(own_rate * np.exp(-gaps).mean()),
                }
            )
    return forecast
