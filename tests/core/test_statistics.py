from itertools import product

import numpy as np
import pytest

from lerobot_bimanual.results.statistics import (
    SuccessRate,
    holm,
    sign_flip_p_value,
    wilson_interval,
)


@pytest.mark.parametrize(
    ("successes", "trials", "lower", "upper"),
    [
        (60, 60, 0.9398, 1.0),
        (40, 40, 0.9124, 1.0),
        (0, 20, 0.0, 0.1611),
        (50, 100, 0.4038, 0.5962),
        (1, 10, 0.0179, 0.4042),
    ],
)
def test_wilson_interval_has_the_published_values(successes, trials, lower, upper):
    assert wilson_interval(successes, trials) == pytest.approx((lower, upper), abs=5e-5)


@pytest.mark.parametrize("trials", [1, 7, 300])
def test_wilson_interval_contains_the_rate_and_mirrors_with_failures(trials):
    for successes in range(trials + 1):
        lower, upper = wilson_interval(successes, trials)
        assert 0 <= lower <= successes / trials <= upper <= 1
        assert wilson_interval(trials - successes, trials) == pytest.approx((1 - upper, 1 - lower))


@pytest.mark.parametrize(("successes", "trials"), [(-1, 3), (4, 3)])
def test_impossible_counts_are_refused(successes, trials):
    with pytest.raises(ValueError, match="successes"):
        SuccessRate(successes, trials)


@pytest.mark.parametrize(
    ("only_first", "only_second", "p_value"),
    [(0, 0, 1.0), (1, 9, 22 / 1024), (9, 1, 22 / 1024), (5, 5, 1.0), (6, 0, 2 / 64)],
)
def test_of_single_successes_the_sign_flip_test_is_mcnemars_with_its_binomial_tail(
    only_first, only_second, p_value
):
    differences = [1] * only_first + [-1] * only_second + [0] * 7
    assert sign_flip_p_value(differences) == pytest.approx(p_value)


@pytest.mark.parametrize(
    "differences", [[3], [2, -1, 0, 3], [1, 1, -2, 4, 4, 0, -1], [5, 3, 3, 2, 1, -1, 6, 6]]
)
def test_the_sign_flip_test_counts_all_signs(differences):
    sums = [abs(np.dot(signs, differences)) for signs in product((-1, 1), repeat=len(differences))]
    at_least = np.mean([value >= abs(sum(differences)) for value in sums])
    assert sign_flip_p_value(differences) == pytest.approx(at_least)


def test_holm_corrects_for_the_number_of_questions_and_keeps_the_order():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([]) == []
