"""The script that says what a campaign's error bars are worth, on rows whose answer is known."""

import pytest

from script import loaded


@pytest.fixture(scope="module")
def study():
    return loaded("proof/campaign_study")


def made(errors, *, duration=90, flights=1, turbulence=0.0, parameter="N_r", se=0.01):
    """Rows of N_r, whose truth is -1, with these relative errors; a failed one for None."""
    return [
        {
            "replicate": number,
            "sweep.duration": duration,
            "weather.turbulence": turbulence,
            "flights": flights,
            "flight_time": None if error is None else float(duration * flights),
            "method": "designed",
            "model": "yaw_base",
            "parameter": parameter,
            "truth": None if error is None else -1.0,
            "estimate": None if error is None else -1.0 + error,
            "standard_error": None if error is None else se,
            "cramer_rao": None if error is None else 3.0 * se,
            "failure": "no coherence" if error is None else None,
        }
        for number, error in enumerate(errors)
    ]


KEY = ("yaw_base", "N_r")
GOOD, BAD = [0.04, -0.04] * 10, [0.04] * 18 + [0.06, -0.06]


@pytest.mark.parametrize(
    ("flown", "least"),
    [
        ({(90, 1): BAD, (90, 3): GOOD, (90, 10): GOOD}, "270 (3 x 90)"),
        ({(90, 1): GOOD, (90, 3): BAD, (90, 10): GOOD}, "900 (10 x 90)"),  # one may be luck
        ({(90, 1): BAD, (90, 3): GOOD, (30, 3): GOOD}, "90 (3 x 30)"),
        ({(90, 1): [0.04] * 19 + [0.06]}, "90 (1 x 90)"),  # 19 of 20 are 95 %
        ({(90, 1): [0.04] * 18 + [None, None]}, "not reached"),  # a failure is not within
        ({(90, 1): [None] * 20}, "not reached"),
    ],
)
def test_the_shortest_flight_is_the_least_from_which_on_all_suffice(study, flown, least):
    """Within 5 % in 95 % of the replicates, and in longer flights too."""
    rows = [
        row
        for (duration, flights), errors in flown.items()
        for row in made(errors, duration=duration, flights=flights)
    ]
    assert study.need(rows, KEY, 0.05) == least


def test_the_mildest_condition_has_the_longest_records(study):
    rows = made(GOOD, duration=30, turbulence=3.0) + made(GOOD, duration=90, turbulence=0.0)
    columns = ("sweep.duration", "weather.turbulence")
    assert study.mildest(rows, columns) == {"sweep.duration": 90, "weather.turbulence": 0.0}


def test_intervals_may_hold_the_mean_and_miss_the_truth(study, capsys):
    """Errors of 10 and 13 % with 1 % of standard error: off the truth, near their mean."""
    rows = made([0.10, 0.13] * 10, turbulence=0.0) + made([-0.01, 0.01] * 10, turbulence=3.0)
    study.apart(rows, ("weather.turbulence",), {KEY: -0.95})
    *_, line = capsys.readouterr().out.splitlines()
    # half of all within 1.96 % of the truth, all within 1.96 % of their condition's mean;
    # the bias is the mean of 11.5 % and none, the structure's -0.95 against -1
    assert line.split() == ["yaw_base", "N_r", "50.0", "100.0", "5.75", "5.00"]


def test_bias_and_scatter_stand_below_their_level(study, capsys):
    rows = made([0.2] * 5, turbulence=3.0) + made([0.1] * 5, turbulence=0.0)
    study.against(rows, "weather.turbulence", {"flights": 1})
    head, line = capsys.readouterr().out.splitlines()[-2:]
    assert head.split() == ["0", "3"]
    assert line.split() == ["yaw_base", "N_r", "10.00", "+-", "0.00", "20.00", "+-", "0.00"]


def test_the_papers_bounds_are_the_limits(study):
    """Cramér-Rao bounds of its Table 3; 5 % for N_r, for which it has none."""
    # Wu and Chen, Table 3, IN1: CR of L_b 13.9 % and of M_a 7.54 %
    found = [100.0 * study.bound(model, name) for model, name in study.WANTED]
    assert found == pytest.approx([5.0, 13.9, 7.54], rel=1e-12)
