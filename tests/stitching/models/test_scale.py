"""Normalisation of observations: per dimension, in float64, and never by next to nothing."""

from pathlib import Path

import numpy as np
import pytest

from stitching.models.scale import SMALLEST_SCALE, observation_scale


def test_is_the_mean_and_standard_deviation_of_each_dimension() -> None:
    rng = np.random.default_rng(0)
    spread, centre = np.array([1.0, 0.01, 300.0]), np.array([0.0, -5.0, 1000.0])
    observations = (centre + spread * rng.standard_normal((500, 3))).astype(np.float32)
    mean, std = observation_scale(observations)
    assert mean.dtype == std.dtype == np.float32
    assert mean.shape == std.shape == (3,)
    for k in range(3):
        column = [float(x) for x in observations[:, k]]
        average = sum(column) / len(column)
        deviation = (sum((x - average) ** 2 for x in column) / len(column)) ** 0.5
        assert mean[k] == pytest.approx(average, rel=1e-6)
        assert std[k] == pytest.approx(deviation, rel=1e-5)


def test_normalised_data_have_mean_0_and_deviation_1() -> None:
    observations = np.random.default_rng(0).gamma(2.0, 5.0, (1000, 4)).astype(np.float32)
    mean, std = observation_scale(observations)
    normalised = (observations - mean) / std
    np.testing.assert_allclose(normalised.mean(axis=0, dtype=np.float64), 0, atol=1e-5)
    np.testing.assert_allclose(normalised.std(axis=0, dtype=np.float64), 1, atol=1e-5)


def test_float32_sums_would_not_do() -> None:
    """A small spread around a large mean, in more rows than float32 can add up."""
    observations = np.full((200_000, 2), 1000.0, dtype=np.float32)
    observations[::2] += 0.125
    assert abs(observations.std(axis=0)[0] - 0.0625) > 1
    mean, std = observation_scale(observations)
    assert mean.tolist() == pytest.approx([1000.0625] * 2, abs=1e-4)
    assert std.tolist() == pytest.approx([0.0625] * 2, rel=1e-4)


def test_constant_dimensions_keep_their_scale() -> None:
    observations = np.full((50, 3), 0.1, dtype=np.float32)
    observations[:, 1] += np.linspace(0, 0.9 * SMALLEST_SCALE, 50, dtype=np.float32)
    observations[:, 2] += np.linspace(0, 100 * SMALLEST_SCALE, 50, dtype=np.float32)
    _, std = observation_scale(observations)
    assert std[:2].tolist() == [1, 1]
    assert SMALLEST_SCALE < std[2] < 1


def test_memory_mapped_data_give_plain_arrays_of_the_same_bytes(tmp_path: Path) -> None:
    observations = np.random.default_rng(0).random((100, 3), dtype=np.float32)
    np.save(tmp_path / "o.npy", observations)
    mapped = np.load(tmp_path / "o.npy", mmap_mode="r")
    for plain, from_map in zip(
        observation_scale(observations), observation_scale(mapped), strict=True
    ):
        assert not isinstance(from_map, np.memmap)
        assert from_map.tobytes() == plain.tobytes()
