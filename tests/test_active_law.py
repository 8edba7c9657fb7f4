"""The stress mobilisation (73)-(78) against its stated properties."""

import numpy as np
import pytest

from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.constitutive import StressMobilisation


def test_length_factor_has_its_maximum_one_at_stretch_one():
    law = StressMobilisation()
    stretch = np.linspace(0.3, 2.0, 3401)
    f = law.length_factor(stretch)
    assert law.length_factor(1.0) == pytest.approx(1.0, abs=1e-14)
    assert stretch[f.argmax()] == pytest.approx(1.0, abs=1e-3)


def test_length_factor_is_the_printed_one():
    """(74), (75) as printed, at a = 3, b = 5."""
    a, b = 3.0, 5.0
    s, c = np.log(b - 1) / (a * b), b * (b - 1) ** (-(1 - 1 / b))
    for stretch in (0.6, 0.8, 1.0, 1.5):
        x = stretch - 1 + s
        printed = c * np.exp(-a * x) / (1 + np.exp(-a * b * x))
        assert StressMobilisation(a, b).length_factor(stretch) == pytest.approx(printed, rel=1e-13)


def test_length_factor_neither_overflows_nor_turns_negative():
    f = StressMobilisation().length_factor(np.array([1e-6, 0.01, 3.0, 20.0]))
    assert np.isfinite(f).all() and (f >= 0).all() and f[0] < 1e-3 and f[-1] < 1e-9


def test_rate_factor_goes_through_its_points():
    """g(0) = 0.7, g(-25/s) = 0.2 (76)-(78), weaker in shortening, between 0 and 1."""
    law = StressMobilisation()
    assert law.rate_factor(0.0) == pytest.approx(0.7, abs=1e-14)
    assert law.rate_factor(-25.0) == pytest.approx(0.2, abs=1e-14)
    rates = np.linspace(-200, 200, 401)
    g = law.rate_factor(rates)
    assert (np.diff(g) > 0).all() and g[0] > 0 and g[-1] < 1
    # the printed form with tanh-like fraction (76)
    a, b = law.rate_slope, law.rate_offset
    printed = 0.5 * (1 + (1 - np.exp(-b - a * rates)) / (1 + np.exp(-b - a * rates)))
    assert g == pytest.approx(printed, rel=1e-10)


@pytest.mark.parametrize(
    "bad", [{"b": 1.0}, {"a": -1.0}, {"y0": 1.2}, {"y1": 0.8}, {"rate1": 0.0}, {"a": np.nan}]
)
def test_bad_numbers_are_refused(bad):
    with pytest.raises(OutOfRange):
        StressMobilisation(**bad)
