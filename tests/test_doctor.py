"""The doctor on a Slurm account, told by what Slurm's own commands print."""

from __future__ import annotations

import pytest

from replay import doctor

CONFIG = """SLURM_VERSION           = 23.11.4
ClusterName             = campus
AccountingStorageType   = {accounting}
AccountingStorageEnforce = associations,limits
MinJobAge               = {age} sec
KillWait                = 30 sec
PreemptMode             = REQUEUE
"""


def found(monkeypatch: pytest.MonkeyPatch, said: dict[str, str | None]) -> dict[str, doctor.Finding]:
    monkeypatch.setattr(doctor, "_said", lambda *command, timeout_s=30.0: said.get(command[0]))
    return {finding.what: finding for finding in doctor.slurm_findings()}


SINFO = "short*|up|30:00|16|64000\nlong|up|7-00:00:00|64|256000\n"


def account(
    age: int = 300, sinfo: str = SINFO, accounts: str = "lab\n", accounting: str = "accounting_storage/slurmdbd"
) -> dict[str, str | None]:
    return {"scontrol": CONFIG.format(age=age, accounting=accounting), "sacctmgr": accounts, "sinfo": sinfo}


def test_an_account_that_is_well_has_nothing_to_mend(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = found(monkeypatch, account())
    assert all(finding.ok for finding in lines.values())
    assert lines["account"].found == "yours: lab"
    assert lines["partitions"].found == "short, long; default short"
    assert lines["coarse"].found.endswith(": short, long")
    assert lines["fine"].found.endswith(": long"), "half an hour is too short for it"


def test_a_controller_that_does_not_answer_is_the_first_thing_told(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = found(monkeypatch, {})
    assert not lines["slurm"].ok
    assert "does not answer" in lines["slurm"].found
    assert "partitions" not in lines


@pytest.mark.parametrize(
    ("changed", "what", "mend"),
    [
        ({"accounts": ""}, "account", "slurm_account"),
        ({"sinfo": "short|up|30:00|16|64000\n"}, "partitions", "slurm_partition"),
        ({"sinfo": "short*|down|30:00|16|64000\n"}, "partitions", "wait until one is up"),
        ({"sinfo": "small*|up|30:00|2|64000\n"}, "coarse", "most_threads"),
        ({"sinfo": "brief*|up|5:00|16|64000\n"}, "coarse", "another partition"),
        ({"sinfo": "thin*|up|30:00|16|500\n"}, "coarse", "another partition"),
        ({"age": 5, "accounting": "accounting_storage/none"}, "status", "MinJobAge=300"),
    ],
)
def test_what_would_stop_a_season_is_named_with_its_mend(
    monkeypatch: pytest.MonkeyPatch, changed: dict, what: str, mend: str
) -> None:
    finding = found(monkeypatch, account(**changed))[what]
    assert not finding.ok
    assert mend in finding.mend


def test_a_short_memory_of_squeue_does_no_harm_where_sacct_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    assert found(monkeypatch, account(age=5))["status"].ok


@pytest.mark.parametrize(
    ("text", "minutes"), [("infinite", float("inf")), ("30:00", 30), ("2:00:00", 120), ("7-00:30:00", 10110)]
)
def test_time_limits_are_read_as_sinfo_prints_them(text: str, minutes: float) -> None:
    assert doctor._minutes(text) == minutes
