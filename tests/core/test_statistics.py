import pytest

from lerobot_bimanual.statistics import SuccessRate, wilson_interval


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


def test_nothing_tried_says_nothing():
    assert wilson_interval(0, 0) == (0, 1)
    assert SuccessRate(0, 0).rate == 0


@pytest.mark.parametrize(("successes", "trials"), [(-1, 3), (4, 3)])
def test_impossible_counts_are_refused(successes, trials):
    with pytest.raises(ValueError, match="successes"):
        SuccessRate(successes, trials)
    with pytest.raises(ValueError, match="successes"):
        wilson_interval(successes, trials)


def test_a_rate_reads_as_counts_and_interval():
    assert str(SuccessRate(60, 60)) == "60/60 (94.0% to 100.0%)"
