"""Wheels of a side held against each other: whom to believe, and who is left out."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.motion.kinematics import ChassisParameters, Kinematics, Side, WheelParameters
from chefbotd.motion.same_side import SameSideParameters, SameSideState, SameSideWheels
from tests.budget import examples

RADIUS_M, DT_S = 0.03, 0.02
NO_MEMORY = SameSideParameters(memory_s=1e-3, tolerance_m=0.001, share=0.1)
"""Each step is judged by itself: what was before it has faded by exp(-20)."""


def chassis(a_side: int) -> ChassisParameters:
    """So many wheels on each side, left and right in turn."""
    wheels = tuple(
        WheelParameters(name=f"{side}{i}", side=side, radius_m=RADIUS_M)
        for i in range(a_side)
        for side in Side
    )
    return ChassisParameters(track_width_m=0.2, wheels=wheels)


def wheels_of(a_side: int = 2, params: SameSideParameters = NO_MEMORY) -> SameSideWheels:
    """Counts so fine that they do not matter."""
    return SameSideWheels(params, Kinematics(chassis(a_side)), counts_per_turn=1e9)


def after(
    judge: SameSideWheels, rims_m_s: tuple[float, ...], asked_m_s: tuple[float, ...], steps: int = 1
) -> SameSideState:
    """The wheels roll at these speeds and were asked for those."""
    state = judge.start
    for _ in range(steps):
        travel_rad = tuple(rim * DT_S / RADIUS_M for rim in rims_m_s)
        state = judge.compare(state, travel_rad, asked_m_s, DT_S)
    return state


ALL = (0.3, 0.3, 0.3, 0.3)


@pytest.mark.parametrize(
    ("rims_m_s", "asked_m_s", "substitutes"),
    [
        (ALL, ALL, ()),
        ((0.3, 0.3, 0.27, 0.3), ALL, ()),  # 0.6 mm apart of 6 mm, and 1 mm + 10 % would be 1.6 mm
        ((0.3, 0.3, 0.0, 0.3), ALL, ((2, 0),)),  # a dead encoder
        ((0.3, 0.3, 0.6, 0.3), ALL, ((2, 0),)),  # a slipping wheel
        ((0.3, -0.3, 0.3, 0.3), ALL, ((1, 3),)),  # a reversed one, on the right
        ((0.15, 0.14, 0.3, 0.14), ALL, ((2, 0),)),  # held back on both sides: half is expected, and one spins
        ((-0.2, 0.2, 0.0, 0.2), (-0.2, 0.2, -0.2, 0.2), ((2, 0),)),  # turning on the spot
        ((0.2, 0.2, 0.0, 0.2), (0.0,) * 4, ((2, 0),)),  # pushed by hand: only the ground turns a wheel
        ((0.0, 0.0, 0.2, 0.0), (0.0,) * 4, ((0, 2),)),
        ((0.3, 0.3, 0.0, 0.3), (0.3, 0.3, 0.0, 0.3), ()),  # asked for each on its own
        ((0.0, 0.3, 0.3, 0.0), ALL, ((0, 2), (3, 1))),  # one on each side
        ((0.0, 0.0, 0.0, 0.1), (-0.1, 0.1, -0.1, 0.1), ((1, 3),)),  # the left side still sticks, and tells nothing
        ((0.0, 0.0, 0.0, 0.3), (-0.1, 0.1, -0.1, 0.1), ((1, 3),)),  # nor when the mate has overshot threefold
        ((0.0, 0.07, 0.0, 0.4), (-0.1, 0.1, -0.1, 0.1), ((3, 1),)),  # both move: the nearer to what it was asked for
        ((0.3, 0.0, 0.3, -0.2), ALL, ((1, 3),)),  # the direction has just changed: one rolls on, one is dead
        ((0.3, 0.0, 0.0, 0.0), (0.3, 0.0, 0.3, 0.0), ((2, 0),)),  # the other side is to stand, and tells nothing
        ((-0.1, 0.0, -0.3, 0.0), (0.0,) * 4, ((0, 2),)),  # pushed back by hand, and both roll: the farther one
        ((1.5, 1.5, 1.31, 1.5), (1.5,) * 4, ()),  # 3.8 mm apart of 30 mm, and 1 mm + 10 % are 4 mm
        ((1.31, 1.31, 1.5, 1.31), (1.31,) * 4, ()),  # the same with the slower one believed
        ((0.1, 0.096, 0.3, 0.096), (0.4,) * 4, ((0, 2),)),  # a side at 0.24 of its command sticks, and tells nothing
        ((0.1, 0.108, 0.3, 0.108), (0.4,) * 4, ((2, 0),)),  # one at 0.27 is held back, and so is this one
        ((0.22, 0.4, 0.31, 0.4), (0.2,) * 4, ((0, 2),)),  # one at twice its command: 1.5 times is expected here
        ((0.26, 0.4, 0.39, 0.4), (0.2,) * 4, ((2, 0),)),  # and no more than that
        ((0.04, 0.04, 0.5, 0.04), (0.04,) * 4, ((0, 2),)),  # a wheel stands at 0.08 of what its mate does
        ((0.06, 0.06, 0.5, 0.06), (0.06,) * 4, ((2, 0),)),  # and at 0.12 it moves, as it was asked to
        ((0.28, 0.29, 0.16, 0.15), ALL, ((2, 0), (3, 1))),  # each side by the other's better wheel
    ],
)  # fmt: skip
@pytest.mark.parametrize("direction", [1, -1])
def test_of_two_mates_the_likelier_is_believed(
    rims_m_s: tuple[float, ...],
    asked_m_s: tuple[float, ...],
    substitutes: tuple[tuple[int, int], ...],
    direction: int,
):
    """Each stray with the mate that is believed; the same in reverse."""
    state = after(
        wheels_of(), tuple(direction * v for v in rims_m_s), tuple(direction * v for v in asked_m_s)
    )
    assert state.substitutes == substitutes
    assert state.excluded == tuple(wheel for wheel, _ in substitutes)


def test_a_wrong_choice_is_taken_back():
    """The wheel that stood was believed while it was asked to; asked to roll, the mate that does is, at once."""
    judge = wheels_of()
    state = SameSideState((0.0,) * 4, (0.0,) * 4, (0.0,) * 4, substitutes=((3, 1),))
    travel_rad = tuple(rim * DT_S / RADIUS_M for rim in (0.3, 0.0, 0.3, 0.3))
    assert judge.compare(state, travel_rad, ALL, DT_S).substitutes == ((1, 3),)


def test_while_both_move_the_choice_is_made_anew():
    """Front left was believed; now it does a third of what is asked, its mate and the other side all of it."""
    judge = wheels_of()
    state = SameSideState((0.0,) * 4, (0.0,) * 4, (0.0,) * 4, substitutes=((2, 0),))
    travel_rad = tuple(rim * DT_S / RADIUS_M for rim in (0.1, 0.3, 0.3, 0.3))
    assert judge.compare(state, travel_rad, ALL, DT_S).substitutes == ((0, 2),)


def test_without_movement_the_choice_stays():
    """The wheel that died rolled less far before both stood, and the robot is now asked to go back."""
    judge = wheels_of(params=SameSideParameters(memory_s=0.2, tolerance_m=0.001, share=0.1))
    state = SameSideState((0.03, 0.01, 0.03, 0.03), (0.0,) * 4, (0.03,) * 4, substitutes=((1, 3),))
    for _ in range(15):
        state = judge.compare(state, (0.0,) * 4, (-0.3,) * 4, DT_S)
        assert state.excluded == (1,)


def test_of_three_mates_the_majority_is_believed():
    """Two that read 0.1 m/s outvote the one that reads the 0.3 m/s that were asked for."""
    state = after(wheels_of(3), (0.3, 0.3, 0.1, 0.3, 0.1, 0.3), (0.3,) * 6)
    assert state.substitutes == ((0, 2),)


def test_one_wheel_a_side_has_nobody_to_disagree_with():
    """The state stays as it is, whatever the wheels do."""
    judge = wheels_of(1)
    assert after(judge, (0.3, 0.0), (0.3, 0.3)) is judge.start


def test_a_wheel_comes_back_when_the_disagreement_has_faded():
    """With a memory of 0.2 s, 60 mm against none fade to half of the tolerance (1 mm + 10 %) within a second."""
    judge = wheels_of(params=SameSideParameters(memory_s=0.2, tolerance_m=0.001, share=0.1))
    state = after(judge, (0.3, 0.3, 0.0, 0.3), ALL, steps=50)
    assert state.excluded == (2,)
    excluded = []
    for _ in range(50):
        state = judge.compare(state, (0.2,) * 4, ALL, DT_S)
        excluded.append(state.excluded)
    assert excluded[0] == (2,)
    assert excluded[-1] == ()
    assert excluded == sorted(excluded, reverse=True)  # and does not go and come


@pytest.mark.parametrize("good_every", [2, 5, 10, 50])
def test_a_reading_that_agrees_brings_no_broken_wheel_back(good_every: int):
    """An encoder that counts right in one cycle of so many is left out in every one, good or bad."""
    judge = wheels_of(params=SameSideParameters(memory_s=0.2, tolerance_m=0.001, share=0.1))
    state = after(judge, (0.3, 0.3, 0.0, 0.3), ALL, steps=50)
    for step in range(500):
        rim_m_s = 0.3 if step % good_every == 0 else 0.0
        travel_rad = tuple(rim * DT_S / RADIUS_M for rim in (0.3, 0.3, rim_m_s, 0.3))
        state = judge.compare(state, travel_rad, ALL, DT_S)
        assert state.excluded == (2,)


def test_counts_too_coarse_to_tell_are_allowed_for():
    """80 counts a turn are 2.36 mm each: wheels two counts apart agree."""
    judge = SameSideWheels(NO_MEMORY, Kinematics(chassis(2)), counts_per_turn=80)
    count_rad = math.tau / 80
    state = judge.compare(judge.start, (3 * count_rad, 3 * count_rad, count_rad, 3 * count_rad), ALL, DT_S)
    assert state.excluded == ()


def uneven(*sides: Side, radii_m: tuple[float, ...]) -> Kinematics:
    """One wheel for each side that is named, with these radii."""
    wheels = tuple(
        WheelParameters(name=f"wheel{i}", side=side, radius_m=radius_m)
        for i, (side, radius_m) in enumerate(zip(sides, radii_m, strict=True))
    )
    return Kinematics(ChassisParameters(track_width_m=0.3, wheels=wheels))


def test_the_largest_wheels_counts_are_the_coarsest():
    """80 counts a turn: 2 are 9.4 mm of a 60 mm wheel. So 11 mm between wheels of 20 mm are 1 + 9.4 + 2 mm of tolerance.

    By the counts of the 30 mm wheel it would be 1 + 4.7 + 2 mm, and they would disagree.
    """
    kinematics = uneven(Side.LEFT, Side.RIGHT, Side.LEFT, Side.RIGHT, radii_m=(0.06, 0.06, 0.03, 0.03))
    judge = SameSideWheels(NO_MEMORY, kinematics, counts_per_turn=80)
    travel_rad = (0.020 / 0.06, 0.020 / 0.06, 0.009 / 0.03, 0.020 / 0.03)
    assert judge.compare(judge.start, travel_rad, (1.0,) * 4, DT_S).substitutes == ()
    travel_rad = (0.020 / 0.06, 0.020 / 0.06, 0.007 / 0.03, 0.020 / 0.03)
    assert judge.compare(judge.start, travel_rad, (1.0,) * 4, DT_S).substitutes == ((2, 0),)


def test_a_side_of_two_is_compared_though_the_other_has_one_wheel():
    """Three wheels, with the dead encoder on the side that has two."""
    kinematics = uneven(Side.LEFT, Side.RIGHT, Side.LEFT, radii_m=(RADIUS_M,) * 3)
    judge = SameSideWheels(NO_MEMORY, kinematics, counts_per_turn=1e9)
    state = judge.compare(judge.start, (0.2, 0.2, 0.0), (0.3,) * 3, DT_S)
    assert state.substitutes == ((2, 0),)


def test_what_a_wheel_does_just_now_fades_four_times_as_fast():
    """After 0.05 s at rest, of a memory of 0.2 s: the travel has faded by exp(-1/4), who moves just now by exp(-1)."""
    judge = wheels_of(params=SameSideParameters(memory_s=0.2))
    before = SameSideState((-0.01, 0.02, -0.01, 0.02), (0.01, 0.02, 0.01, 0.02), (0.03, 0.02, 0.03, 0.02))
    state = judge.compare(before, (0.0,) * 4, (0.0,) * 4, 0.05)
    assert state.rolled_m == pytest.approx([m * math.exp(-0.25) for m in before.rolled_m])
    assert state.asked_m == pytest.approx([m * math.exp(-0.25) for m in before.asked_m])
    assert state.latest_m == pytest.approx([m * math.exp(-1.0) for m in before.latest_m])


def test_the_effort_of_a_wheel_that_is_left_out_counts_for_a_half_at_least():
    """A stalled one is to be noticed however gently it is pushed; no push stays none."""
    judge = wheels_of()
    healthy, broken = after(judge, ALL, ALL), after(judge, (0.0, 0.3, 0.3, 0.0), ALL)
    assert judge.credit(healthy, (0.1, 0.1, 0.1, -0.1)) == (0.1, 0.1, 0.1, -0.1)
    assert judge.credit(broken, (0.1, 0.1, 0.1, -0.1)) == (0.5, 0.1, 0.1, -0.5)
    assert judge.credit(broken, (0.0,) * 4) == (0.0,) * 4


@given(st.lists(st.tuples(*[st.floats(-0.5, 0.5)] * 8), max_size=20))
@settings(max_examples=examples(50))
def test_a_wheel_is_always_left_on_each_side(story: list[tuple[float, ...]]):
    """Whatever the wheels do and were asked for, each side has one to believe, and it leads the others."""
    judge = wheels_of(params=SameSideParameters())
    state = judge.start
    for step in story:
        state = judge.compare(state, step[:4], step[4:], DT_S)
        believed = set(range(4)) - set(state.excluded)
        assert believed & {0, 2}
        assert believed & {1, 3}
        assert {substitute for _, substitute in state.substitutes} <= believed


def test_at_the_start_nothing_was_rolled_or_asked():
    """Nothing has to fade before the first readings count."""
    assert wheels_of().start == SameSideState((0.0,) * 4, (0.0,) * 4, (0.0,) * 4)
