"""Commands for whoever received a bundle: verify it, compare it with another run, sign it."""

from __future__ import annotations

from pathlib import Path

from replay.bundle import compare as compare_runs
from replay.bundle import sign as sign_bundle
from replay.bundle import signature_path, signer_of
from replay.bundle import verify as verify_bundle


def verify(bundle: Path, signers: Path | None = None) -> int:
    """Verify a bundle and say what was verified; a bad one raises, naming its first bad file.

    Parameters
    ----------
    bundle
        Archive or unpacked bundle.
    signers
        Who is trusted to have sealed it; without it a signature is not looked at.
    """
    print(verify_bundle(bundle).text())
    if signers is not None:
        print(f"signed by {signer_of(bundle, signers)}, whom {signers} trusts")
    elif signature_path(bundle).is_file():
        print(f"{signature_path(bundle).name} lies beside it, not checked: name whom you trust with --signers")
    return 0


def compare(old: Path, new: Path) -> int:
    """Compare two runs; 0 when they agree, each artifact by its class."""
    comparison = compare_runs(old, new)
    print(comparison.text())
    return 0 if comparison.agree else 1


def sign(bundle: Path, key: Path) -> int:
    """Verify a bundle, sign it, and say where the signature is."""
    verify_bundle(bundle)
    print(f"{sign_bundle(bundle, key)}: signature of {bundle.name}")
    return 0
