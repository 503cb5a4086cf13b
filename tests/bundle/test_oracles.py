"""Programs that know nothing of ours agree with our bundles."""

from __future__ import annotations

import io
import shutil
import subprocess
import zipfile
from pathlib import Path

import bagit
import pytest


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory, sealed) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    with zipfile.ZipFile(sealed()) as archive:
        assert archive.testzip() is None
        archive.extractall(folder)
    return folder / "demo"


def test_bagit_validates_the_bag_and_notices_a_change(tmp_path, unpacked):
    bag = bagit.Bag(str(unpacked))
    assert bag.validate(processes=1)
    assert set(bag.algorithms) == {"sha256", "sha512"}
    assert bag.info["External-Identifier"] == "demo"
    shutil.copytree(unpacked, tmp_path / "demo")
    (tmp_path / "demo/data/README.md").write_text("another")
    with pytest.raises(bagit.BagValidationError):
        bagit.Bag(str(tmp_path / "demo")).validate(processes=1)


@pytest.mark.parametrize("algorithm", ["sha256", "sha512"])
def test_the_manifests_are_read_by_the_system_s_own_tool(unpacked, algorithm):
    tool = shutil.which(f"{algorithm}sum")
    if tool is None:
        pytest.skip(f"{algorithm}sum is not on this machine")
    for manifest in (f"manifest-{algorithm}.txt", f"tagmanifest-{algorithm}.txt"):
        subprocess.run([tool, "--check", "--strict", "--quiet", manifest], cwd=unpacked, check=True)


def test_the_digest_beside_the_archive_is_read_by_the_system_s_own_tool(sealed):
    tool = shutil.which("sha256sum")
    if tool is None:
        pytest.skip("sha256sum is not on this machine")
    subprocess.run([tool, "--check", "--strict", "demo.zip.sha256"], cwd=sealed().parent, check=True)


# The validator reads JSON-LD contexts from the network; their published texts stand in for it.
CONTEXTS = {
    "https://w3id.org/ro/crate/1.1/context": "ro-crate-1.1.jsonld",
    "https://w3id.org/ro/crate/1.2/context": "ro-crate-1.2.jsonld",
    "https://w3id.org/ro/terms/workflow-run/context": "workflow-run.json",
}


def fill_cache(cache: Path, contexts: Path) -> None:
    """Put the contexts where the validator looks before it asks the network."""
    requests = pytest.importorskip("requests")
    requests_cache = pytest.importorskip("requests_cache")
    urllib3 = pytest.importorskip("urllib3")

    class FromFile(requests.adapters.BaseAdapter):
        def send(self, request, **_):
            response = requests.Response()
            response.status_code, response.url, response.request, response.encoding = 200, request.url, request, "utf-8"
            response.headers["Content-Type"] = "application/ld+json"
            body = io.BytesIO((contexts / CONTEXTS[request.url]).read_bytes())
            response.raw = urllib3.HTTPResponse(
                body=body, status=200, headers=dict(response.headers), preload_content=False
            )
            return response

        def close(self):
            pass

    with requests_cache.CachedSession(cache_name=str(cache), backend="sqlite", expire_after=-1) as session:
        session.mount("https://", FromFile())
        for url in CONTEXTS:
            session.get(url)
            session.get(url, headers={"Accept": "application/ld+json, application/json;q=0.9"})


@pytest.mark.shared
@pytest.mark.parametrize("rejected", [False, True])
def test_the_crate_validates_against_its_profiles(tmp_path, shared, sealed, rejected):
    services = pytest.importorskip("rocrate_validator.services", reason="roc-validator is not installed")
    models = pytest.importorskip("rocrate_validator.models")
    contexts = shared / "recipes" / "contexts"
    if not contexts.is_dir():
        pytest.skip("the published JSON-LD contexts are not beside the checkout")
    fill_cache(tmp_path / "http_cache", contexts)
    with zipfile.ZipFile(sealed(rejected=rejected) if rejected else sealed()) as archive:
        archive.extractall(tmp_path)
    for profile in ("provenance-run-crate", "workflow-ro-crate"):
        settings = models.ValidationSettings(
            rocrate_uri=str(tmp_path / "demo" / "data"),
            profile_identifier=profile,
            requirement_severity="REQUIRED",
            offline=True,
            cache_path=str(tmp_path / "http_cache"),
        )
        result = services.validate(settings)
        issues = [f"{issue.check.identifier}: {issue.message}" for issue in result.get_issues()]
        assert result.passed(), "\n".join(issues)


@pytest.mark.parametrize("rejected", [False, True])
def test_runcrate_reports_each_action_with_what_it_read_and_made(tmp_path, sealed, rejected):
    tool = shutil.which("runcrate")
    if tool is None:
        pytest.skip("runcrate is not on this machine; it pins old versions of its thirty dependencies")
    with zipfile.ZipFile(sealed(rejected=rejected) if rejected else sealed()) as archive:
        archive.extractall(tmp_path)
    done = subprocess.run([tool, "report", tmp_path / "demo/data"], capture_output=True, text=True, check=True)
    blocks = {block.split("\n")[0]: block for block in done.stdout.split("action: ")[1:]}
    assert {"#run-reconstruction", "#run-driver", "#run-shake", "#run-verdict"} <= set(blocks)
    assert ("#run-replay" in blocks) is not rejected
    assert "results/reconstruction/kinematics.csv" in blocks["#run-driver"].partition("outputs:")[0]
    assert "results/driver/driver_6dof.csv" in blocks["#run-driver"].partition("outputs:")[2]
