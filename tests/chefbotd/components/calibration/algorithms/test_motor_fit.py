"""The model of a motor, simulated and fitted, with angles computed by hand and by the model itself."""

import math
import random

import pytest

from chefbotd.components.calibration.algorithms.motor_fit import (
    DELAY,
    SPIN,
    AngleSample,
    Input,
    MotorRun,
    advance,
    fit,
    simulate_run,
)

TRUE = (0.04, 20.0, 0.1, 0.036, 25.0, 0.08, 0.01, 0.9)
START = (0.03, 15.0, 0.03, 0.03, 15.0, 0.03, 0.0, 1.0)
COUNT_RAD = math.tau / 4200


def run(
    *duties: float, begin_s: float, spins: bool = False, noise_rad: float = 0.0, seed: int = 1
) -> MotorRun:
    """Each duty for 0.7 s, then none; a reading every 50 ms of whole counts."""
    inputs = [Input(begin_s + 0.7 * number, duty) for number, duty in enumerate((*duties, 0.0))]
    stamps = [begin_s - 0.1 + 0.05 * number for number in range(14 * len(duties) + 2)]
    empty = MotorRun(spins, tuple(inputs), tuple(AngleSample(stamp_s, 0.0) for stamp_s in stamps))
    chance, wandered = random.Random(seed), 0.0
    samples = []
    for stamp_s, angle_rad in zip(stamps, simulate_run(TRUE, empty), strict=True):
        wandered += chance.gauss(0.0, noise_rad)
        samples.append(AngleSample(stamp_s, math.floor((angle_rad + wandered) / COUNT_RAD) * COUNT_RAD))
    return MotorRun(spins, tuple(inputs), tuple(samples))


def runs(noise_rad: float = 0.0, *, spins: bool = True) -> list[MotorRun]:
    """Both directions on the spot, and both straight on."""
    kinds = ((1, spins), (-1, spins), (1, False), (-1, False))
    return [
        run(
            *(sign * duty for duty in (60, 200, 40, 130)),
            begin_s=10.0 * n,
            spins=kind,
            noise_rad=noise_rad,
            seed=n,
        )
        for n, (sign, kind) in enumerate(kinds)
    ]


def test_a_motor_that_starts_turns_by_the_exponential():
    """70 of duty, 20 of them lost: 2 rad/s in the end, after 0.1 s 2 (1 - 1/e) and 0.2 / e rad."""
    speed, angle = advance(TRUE, 0.0, 70.0, 0.1)
    assert speed == pytest.approx(2 * (1 - 1 / math.e))
    assert angle == pytest.approx(0.2 / math.e)


def test_a_motor_without_duty_comes_to_rest_and_stays():
    """From 0.8 rad/s towards -0.8: at rest after 0.1 ln 2 s, and 0.08 (1 - ln 2) rad farther."""
    speed, angle = advance(TRUE, 0.8, 0.0, 1.0)
    assert speed == 0.0
    assert angle == pytest.approx(0.08 * (1 - math.log(2)))


def test_less_than_the_dead_zone_turns_nothing():
    """In either direction, each with its own."""
    assert advance(TRUE, 0.0, 19.0, 1.0) == (0.0, 0.0)
    assert advance(TRUE, 0.0, -24.0, 1.0) == (0.0, 0.0)
    assert advance(TRUE, 0.0, -26.0, 1.0)[0] < 0


def test_the_true_motor_is_found():
    """From whole counts: the gain within 0.5 %, the dead zone within 0.2 duty, both lags and the delay within 2 ms."""
    fitted = fit(runs(), START)
    assert fitted is not None
    for place, (found, true) in enumerate(zip(fitted.parameters, TRUE, strict=True)):
        most = {0: 0.005 * true, 3: 0.005 * true, 1: 0.2, 4: 0.2, SPIN: 0.02}.get(place, 0.002)
        assert found == pytest.approx(true, abs=most), place
    assert fitted.after_rad < COUNT_RAD < fitted.before_rad


def test_the_standard_deviation_is_that_of_repetitions():
    """Twelve drives disturbed at random: most results are within two of their own standard deviations."""
    within = []
    for seed in range(12):
        drives = [
            run(
                *(s * duty for duty in (60, 200, 40, 130)),
                begin_s=10.0 * n,
                noise_rad=0.005,
                seed=100 * seed + n,
            )
            for n, s in enumerate((1, -1, 1, -1))
        ]
        fitted = fit(drives, START)
        assert fitted is not None
        within += [abs(fitted.parameters[i] - TRUE[i]) <= 2 * fitted.sigmas[i] for i in range(DELAY)]
    assert sum(within) / len(within) > 0.8


def test_one_direction_does_not_determine_the_other():
    """Nothing was driven in reverse: no result."""
    assert fit([run(60, 200, 40, 130, begin_s=0.0), run(130, 60, begin_s=10.0)], START) is None


def test_drives_of_one_kind_leave_the_ratio_as_it_is():
    """Nothing was driven on the spot: the ratio of the time constants has no deviation, and all else is found."""
    fitted = fit(runs(spins=False), START)
    assert fitted is not None
    assert (fitted.parameters[SPIN], fitted.sigmas[SPIN]) == (1.0, 0.0)
    assert fitted.parameters[0] == pytest.approx(TRUE[0], rel=0.005)
