"""Spoilt files: one clear error each, no other exception, no hang (25,000 more by `tests.motion.fuzz_readers`)."""

from tests.motion.fuzz_readers import fuzz


def test_every_spoilt_file_is_read_or_refused_in_one_message():
    outcomes, failures, _ = fuzz(600, seed=20251125)
    assert not failures, "\n".join(failures[:5])
    assert outcomes["refused"] > 300
