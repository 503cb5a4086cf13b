"""Who sealed a bundle: an SSH signature of its tag manifest, made and checked by OpenSSH.

``tagmanifest-sha256.txt`` holds the hashes of the manifests, and those the hashes of every file, so that one
signature covers all. It lies beside the bundle (``<play>.zip.sig``): the bundle's own bytes stay the same,
and it holds for the unpacked folder too.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from replay.bundle.members import open_members
from replay.bundle.names import shown
from replay.errors import BundleError, InputError, ReplayError
from replay.files import write_text

NAMESPACE = "replay-bundle"
"""Purpose that the signature is bound to, so that one made for another purpose is none of a bundle."""
SIGNED = "tagmanifest-sha256.txt"


def signature_path(bundle: Path) -> Path:
    """Where a bundle's signature lies."""
    return bundle.with_name(bundle.name + ".sig")


def sign(bundle: str | Path, key: str | Path) -> Path:
    """Sign a bundle and write the signature beside it.

    Parameters
    ----------
    bundle
        Archive or unpacked bundle.
    key
        Private SSH key, or the public one where an agent holds the other half.

    Raises
    ------
    InputError
        When the key cannot be used.
    """
    bundle, key = Path(bundle), Path(key)
    if not key.is_file():
        raise InputError(key, "there is no such key", mend="ssh-keygen -t ed25519 -f KEY makes one")
    done = _ssh_keygen("-Y", "sign", "-q", "-f", str(key), "-n", NAMESPACE, message=_signed_text(bundle))
    if done.returncode:
        raise InputError(key, f"cannot sign: {_said(done)}", mend="name a private SSH key that you can use")
    path = signature_path(bundle)
    write_text(path, done.stdout.decode())
    return path


def signer_of(bundle: str | Path, signers: str | Path, signature: str | Path | None = None) -> str:
    """Check a bundle's signature against those who are trusted.

    Parameters
    ----------
    bundle
        Archive or unpacked bundle, verified before: the signature is of its tag manifest.
    signers
        OpenSSH's file of allowed signers: lines ``name key-type key``.
    signature
        By default `signature_path`.

    Returns
    -------
    str
        Name of the signer, as `signers` has it.

    Raises
    ------
    BundleError
        When there is no signature, it is of another bundle, or nobody in `signers` made it.
    """
    bundle, signers = Path(bundle), Path(signers)
    path = signature_path(bundle) if signature is None else Path(signature)
    if not signers.is_file():
        raise InputError(
            signers, "there is no such file", expected="lines `name ssh-ed25519 AAAA...`", mend="write one"
        )
    if not path.is_file():
        message = f"{bundle.name}: is not signed: there is no {path.name} beside it\n    mend: ask for its signature"
        raise BundleError(message)
    options = ("-n", NAMESPACE, "-f", str(signers), "-s", str(path))
    found = _ssh_keygen("-Y", "find-principals", *options)
    names = found.stdout.decode(errors="replace").split("\n")[0]
    if found.returncode or not names:
        message = f"{path.name}: was made by nobody in {signers.name} ({_said(found)})"
        raise BundleError(message)
    checked = _ssh_keygen("-Y", "verify", "-I", names, *options, message=_signed_text(bundle))
    if checked.returncode:
        message = f"{path.name}: is no signature of {bundle.name} by {shown(names)} ({_said(checked)})"
        raise BundleError(message)
    return shown(names)


def _signed_text(bundle: Path) -> bytes:
    with open_members(bundle) as members:
        if SIGNED not in members.sizes:
            message = f"{members.label}: {SIGNED}: is missing"
            raise BundleError(message)
        with members.open(SIGNED) as stream:
            return stream.read()


def _ssh_keygen(*arguments: str, message: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    program = shutil.which("ssh-keygen")
    if program is None:
        text = "ssh-keygen is not on this machine\n    mend: install OpenSSH 8.2 or later"
        raise ReplayError(text)
    return subprocess.run((program, *arguments), input=message, capture_output=True, check=False)


def _said(done: subprocess.CompletedProcess[bytes]) -> str:
    lines: Sequence[str] = (done.stderr or done.stdout).decode(errors="replace").strip().splitlines()
    return shown(lines[-1]) if lines else f"ssh-keygen ended with {done.returncode}"
