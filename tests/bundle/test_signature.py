"""Signatures: made with an SSH key, true for the archive and its unpacked folder, and for nothing else."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from replay.bundle import seal, sign, signer_of
from replay.cli import main
from replay.errors import BundleError, InputError

from .conftest import fabricate

pytestmark = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="OpenSSH is not on this machine")


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of two laboratories, and a file that trusts the first."""
    folder = tmp_path_factory.mktemp("keys")
    for name in ("north", "other"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(folder / name)]
        subprocess.run(command, check=True)
    public = (folder / "north.pub").read_text().split()
    (folder / "trusted").write_text(f"lab@north.example {public[0]} {public[1]}\n")
    return folder


@pytest.fixture
def bundle(tmp_path: Path, sealed) -> Path:
    return Path(shutil.copy(sealed(), tmp_path / "demo.zip"))


def test_a_signature_names_who_made_it_and_changes_no_byte_of_the_bundle(bundle, keys, sealed, capsys):
    assert main(["sign", str(bundle), "--key", str(keys / "north")]) == 0
    assert bundle.read_bytes() == sealed().read_bytes()
    assert main(["verify", str(bundle), "--signers", str(keys / "trusted")]) == 0
    assert "signed by lab@north.example" in capsys.readouterr().out
    assert main(["verify", str(bundle)]) == 0
    assert "not checked: name whom you trust" in capsys.readouterr().out


def test_it_holds_for_the_unpacked_folder(bundle, keys):
    signature = sign(bundle, keys / "north")
    with zipfile.ZipFile(bundle) as archive:
        archive.extractall(bundle.parent)
    folder = bundle.parent / "demo"
    assert signer_of(folder, keys / "trusted", signature) == "lab@north.example"
    shutil.copy(signature, bundle.parent / "demo.sig")
    assert signer_of(folder, keys / "trusted") == "lab@north.example"


def test_openssh_alone_checks_it_as_the_page_says(bundle, keys):
    signature = sign(bundle, keys / "north")
    with zipfile.ZipFile(bundle) as archive:
        text = archive.read("demo/tagmanifest-sha256.txt")
    command = ["ssh-keygen", "-Y", "verify", "-f", str(keys / "trusted"), "-I", "lab@north.example"]
    subprocess.run([*command, "-n", "replay-bundle", "-s", str(signature)], input=text, check=True)


def test_a_signature_of_another_bundle_by_a_stranger_or_none_is_refused(tmp_path, bundle, keys, source_root):
    with pytest.raises(BundleError, match="is not signed"):
        signer_of(bundle, keys / "trusted")
    sign(bundle, keys / "other")
    with pytest.raises(BundleError, match=r"demo.zip.sig: was made by nobody in trusted"):
        signer_of(bundle, keys / "trusted")
    signature = sign(bundle, keys / "north")
    other = tmp_path / "other.zip"
    seal(fabricate(tmp_path / "run", shift=1.0), other, source_root=source_root)
    with pytest.raises(BundleError, match=r"demo.zip.sig: is no signature of other.zip by lab@north.example"):
        signer_of(other, keys / "trusted", signature)
    (tmp_path / "demo.zip.sig").write_text("hello")
    with pytest.raises(BundleError, match="was made by nobody"):
        signer_of(bundle, keys / "trusted")


def test_a_signature_made_for_another_purpose_is_none(bundle, keys):
    with zipfile.ZipFile(bundle) as archive:
        text = archive.read("demo/tagmanifest-sha256.txt")
    command = ["ssh-keygen", "-Y", "sign", "-q", "-f", str(keys / "north"), "-n", "git"]
    made = subprocess.run(command, input=text, check=True, capture_output=True).stdout
    bundle.with_name("demo.zip.sig").write_bytes(made)
    with pytest.raises(BundleError, match="demo.zip.sig: "):
        signer_of(bundle, keys / "trusted")


def test_a_key_or_a_list_of_signers_that_is_not_there_is_said_so(bundle, keys, tmp_path):
    with pytest.raises(InputError, match="there is no such key"):
        sign(bundle, tmp_path / "none")
    (tmp_path / "text").write_text("hello")
    with pytest.raises(InputError, match="cannot sign"):
        sign(bundle, tmp_path / "text")
    with pytest.raises(InputError, match="there is no such file"):
        signer_of(bundle, tmp_path / "none")
