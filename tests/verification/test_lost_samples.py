"""A log that lost samples tells the same within its grown errors, or says that it doesn't."""

import pytest

import script
from sid_logs import four_axes

proof = script.loaded("proof/lost_samples")


@pytest.mark.parametrize(
    ("name", "kind", "share"), [("yaw", "bursts", 0.16), ("ship", "single", 0.28)]
)
def test_a_truth_is_found_without_samples_that_were_lost(name, kind, share):
    found, held = proof.judged(name, kind, share, 3)
    assert held
    assert found.errors < proof.verdicts.ERRORS


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "share"), [("bursts", 0.16), ("buffer", 0.28)])
def test_a_log_without_messages_that_were_cut_tells_the_same(tmp_path, kind, share):
    whole, left = four_axes(tmp_path / "whole.bin"), tmp_path / "left.bin"
    proof.cut(whole, left, kind, share, 5)
    assert left.stat().st_size < (1.0 - 0.7 * share) * whole.stat().st_size
    before, after = proof.fits(whole), proof.fits(left)
    assert set(before) == set(after)
    for name, fit in before.items():
        for one in fit.parameters.values():
            found = after[name][one.name]
            assert abs(found.value - one.value) <= 3.0 * found.standard_error + 1e-12
            assert abs(found.value - one.value) <= found.cramer_rao + 1e-12
