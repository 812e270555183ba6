"""Arrays in a report say what they were made of, to the precision that is promised."""

import base64
import math

import numpy as np
import numpy.typing as npt
import pytest

from orchestration.experiments.report.blobs import NOTHING, Blob, Blobs


def read(blob: Blob) -> npt.NDArray[np.float64]:
    """As the page reads it."""
    content = base64.b64decode(blob.data)
    if blob.kind == "float32":
        return np.frombuffer(content, dtype="<f4").astype(float)
    steps = np.frombuffer(content, dtype="<i2").astype(float)
    values = np.where(steps == NOTHING, np.nan, blob.offset + blob.scale * steps)
    return np.asarray(np.nan_to_num(10.0**values) if blob.logarithmic else values)


def test_an_exact_array_keeps_24_bits() -> None:
    blobs = Blobs()
    values = np.array([0.0, -1.25, math.pi, 1e-12])
    assert blobs.exact(values) == 0
    np.testing.assert_allclose(read(blobs.blobs[0]), values, rtol=2.0**-24)


@pytest.mark.parametrize("values", [np.linspace(-3.0, 7.0, 1001), np.array([5.0]), np.array([2.0, 2.0]), np.zeros(0)])
def test_a_compact_array_is_right_to_a_part_in_65000_of_its_range(values: npt.NDArray[np.float64]) -> None:
    blobs = Blobs()
    blobs.compact(values)
    span = float(np.ptp(values)) if len(values) else 0.0
    np.testing.assert_allclose(read(blobs.blobs[0]), values, rtol=1e-8, atol=span / 65_000)


def test_a_logarithmic_array_has_small_values_as_well_as_large_ones() -> None:
    blobs = Blobs()
    values = np.geomspace(1e-9, 1e3, 500)
    blobs.compact(values, logarithmic=True)
    np.testing.assert_allclose(read(blobs.blobs[0]), values, rtol=12.0 * math.log(10.0) / 65_000)


def test_what_is_no_number_stays_none() -> None:
    blobs = Blobs()
    blobs.compact([math.nan, 1.0, math.inf, 2.0])
    assert np.isnan(read(blobs.blobs[0])).tolist() == [True, False, True, False]


def test_a_zero_has_no_logarithm_and_stays_zero() -> None:
    blobs = Blobs()
    blobs.compact([0.0, 1.0, 10.0], logarithmic=True)
    np.testing.assert_allclose(read(blobs.blobs[0]), [0.0, 1.0, 10.0], rtol=1e-3)


def test_the_same_content_is_there_once() -> None:
    blobs = Blobs()
    assert [blobs.exact([1.0, 2.0]), blobs.exact([3.0]), blobs.exact([1.0, 2.0]), blobs.compact([1.0, 2.0])] == [
        0, 1, 0, 2,
    ]  # fmt: skip
