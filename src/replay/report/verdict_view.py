"""The verdict banner and the gates: what was decided, by which check, against whose limit."""

from __future__ import annotations

from collections.abc import Sequence

from replay.report.markup import badge, label, limit, number, table, text, unit
from replay.report.model import ReportInput, Row

_STATUS_KIND = {"accepted": "pass", "accepted with warnings": "warn", "rejected": "fail"}
_MOST_CAUSES = 6


def banner(report: ReportInput) -> str:
    """Return the verdict with its causes, and every limit the play loosened."""
    verdict = report.verdict
    status = str(verdict["status"])
    worst = "fail" if status == "rejected" else "warn"
    causes = [c for c in verdict.get("causes", ()) if worst == "warn" or c["verdict"] == "fail"]
    judged = [c for c in causes if c["verdict"] != "vacuous"]
    lines = [f"<li>{gate_title(report, c['gate'])}: {_cause(report, c)}</li>" for c in judged[:_MOST_CAUSES]]
    if len(judged) > _MOST_CAUSES:
        lines.append(f'<li>and {len(judged) - _MOST_CAUSES} more, <a href="#gates">in the gates below</a></li>')
    lines += [f"<li>not checked, {text(why)}: {what}</li>" for why, what in _powerless(report, causes)]
    if not causes and verdict.get("not_evaluated"):
        missing = ", ".join(gate_title(report, name) for name in verdict["not_evaluated"])
        lines.append(f"<li>not evaluated: {missing}</li>")
    words = {
        "accepted": "Every gate of the protocol passes.",
        "accepted with warnings": "No gate fails. These checks warn, or have no power in this run:",
        "rejected": "At least one gate fails or was not evaluated. Do not interpret this replay.",
    }[status]
    if verdict.get("stopped_by"):
        words = f"The gate “{gate_title(report, verdict['stopped_by'])}” ended the play; later stages were not run."
    loosened = "".join(_loosened(report, item) for item in verdict.get("loosened", ()))
    listed = f"<ul>{''.join(lines)}</ul>" if lines else ""
    return (
        f'<div class="verdict {_STATUS_KIND[status]}" role="status"><strong>{text(status.capitalize())}</strong>'
        f"<p>{words}</p>{listed}{loosened}</div>"
    )


def _loosened(report: ReportInput, item: Row) -> str:
    check = _find(report, item["gate"], item["check"])
    of = check["unit"] if check else ""
    limits = [_with_unit(limit(item[key]), of) for key in ("limit", "instead_of")]
    return (
        f'<p class="loosened">Loosened by the play: {gate_title(report, item["gate"])}, '
        f"{label(item['check'], of)} {limits[0]} instead of {limits[1]}</p>"
    )


def _cause(report: ReportInput, cause: Row) -> str:
    """Word one cause from its check, so that units and numbers are printed as everywhere on the page."""
    check = _find(report, cause["gate"], cause["check"])
    if check is None:
        return text(cause["sentence"])
    words = label(check["name"], check["unit"])
    if check["value"] is not None:
        words += f" {_with_unit(number(check['value']), check['unit'])}, limit {limit(check['limit'])}"
    return words + (f" ({text(check['detail'])})" if check.get("detail") else "")


def _powerless(report: ReportInput, causes: Sequence[Row]) -> list[tuple[str, str]]:
    """Checks without power, gathered by their reason, with their gates."""
    found: dict[str, dict[str, list[str]]] = {}
    for cause in causes:
        check = _find(report, cause["gate"], cause["check"])
        if cause["verdict"] == "vacuous" and check is not None:
            gates = found.setdefault(str(check.get("detail") or "no reason given"), {})
            gates.setdefault(gate_title(report, cause["gate"]), []).append(label(check["name"], check["unit"]))
    return [(why, "; ".join(f"{g}: {', '.join(names)}" for g, names in gates.items())) for why, gates in found.items()]


def _find(report: ReportInput, gate_name: str, check_name: str) -> Row | None:
    checks = (check for gate in report.gates if gate["gate"] == gate_name for check in gate["checks"])
    return next((check for check in checks if check["name"] == check_name), None)


def _with_unit(value: str, of: str) -> str:
    return f"{value} {unit(of)}".rstrip()


def gate_title(report: ReportInput, name: str) -> str:
    """Return a gate's title as HTML."""
    return text(report.gate_facts.get(name, {}).get("title", name.replace("_", " ")))


def gates_section(report: ReportInput) -> str:
    """Return a summary of all gates, then the checks of each; those that do not pass lie open."""
    given = {gate["gate"]: gate for gate in report.gates}
    names = [name for name in report.gate_facts if name in given] + [n for n in given if n not in report.gate_facts]
    rows, parts = [], []
    for name in dict.fromkeys([*report.gate_facts, *names]):
        facts = report.gate_facts.get(name, {})
        if name not in given:
            rows.append([gate_title(report, name), badge("not run"), "", text(facts.get("source", ""))])
            continue
        gate = given[name]
        counts = [sum(c["verdict"] == v for c in gate["checks"]) for v in ("pass", "warn", "fail", "vacuous")]
        told = ", ".join(f"{n} {word}" for n, word in zip(counts, ("pass", "warn", "fail", "without power")) if n)
        rows.append([gate_title(report, name), badge(gate["verdict"]), text(told), text(facts.get("source", ""))])
        open_ = "" if gate["verdict"] == "pass" else " open"
        parts.append(
            f"<details{open_}><summary>{gate_title(report, name)} {badge(gate['verdict'])}"
            f'<span class="detail">{text(told)}</span></summary>{_checks(report, gate)}</details>'
        )
    summary = table("The gates, in the order of the protocol", ["Gate", "Verdict", "Checks", "From"], rows, stack=True)
    legend = (
        '<p class="note">“No power” (○): the check cannot fail here, for the reason beside it. It has proved'
        " nothing, so its gate does not pass.</p>"
    )
    return summary + legend + "".join(parts)


def _checks(report: ReportInput, gate: Row) -> str:
    rows = []
    for check in gate["checks"]:
        loose = check.get("loosened_from")
        allowed = f'<span class="limit">{limit(check["limit"])}</span> {unit(check["unit"])}'
        if loose:
            allowed += f'<br><span class="loose">loosened from {limit(loose)}</span>'
        printed = _with_unit(number(check["value"]), check["unit"] if check["value"] is not None else "")
        detail = f'<br><span class="detail">{text(check["detail"])}</span>' if check.get("detail") else ""
        rows.append(
            [
                label(check["name"], check["unit"]) + detail,
                badge(check["verdict"]),
                printed,
                allowed,
                f'<span class="source">{text(check["source"])}</span>',
            ]
        )
    caption = f"Checks of the gate “{report.gate_facts.get(gate['gate'], {}).get('title', gate['gate'])}”"
    return table(caption, ["Check", "Verdict", "Value", "Limit", "Source of the limit"], rows, numeric=(2,), stack=True)
