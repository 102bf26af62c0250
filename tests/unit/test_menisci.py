"""The script of the menisci of three fluids between plates: their angles, their jumps of pressure, bad input."""

import math

import pytest

from scripts import menisci
from warpsph.errors import CaseError
from warpsph.running.tension_doubts import contradicting_angles


def test_the_three_angles_belong_together():
    assert not list(contradicting_angles(menisci.slit(8)))
    assert 90 < menisci.young() < 180


def test_jumps_are_those_of_laplace_and_young():
    """Three fluids with angles at walls: within a spacing over the width, as a method of first order has it."""
    found = menisci.jumps(menisci.slit(8))
    assert found["oil, air"][1] == pytest.approx(2 * 0.030 * math.cos(math.radians(35)) / 0.004)
    for jump, exact in found.values():
        assert exact > 0 and jump == pytest.approx(exact, rel=1 / 8)


def test_a_slit_that_is_too_narrow_is_told():
    with pytest.raises(CaseError, match="--spacings"):
        menisci.slit(3)
