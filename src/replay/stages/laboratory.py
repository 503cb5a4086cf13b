"""Commands of the laboratory: a material in a test, parameters fitted to data, the article's Figures 1 to 4."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from replay import models
from replay.errors import InputError
from replay.files import write_json
from replay.laboratory import (
    ANSWER_TABLE,
    Curve,
    Fit,
    Free,
    answer,
    calibrate,
    curve_answer,
    left_out,
    programme,
    read_tests,
    rms,
    squeeze,
)  # fmt: skip
from replay.laboratory.hopkinson import ENDS, Specimen
from replay.report.figure import Picture
from replay.report.tissue import TissueCurve, curves_picture, specimen_picture, write_page, write_pictures
from replay.solver import Material

_TRUE = {"strain": "true strain (compression: −ln λ; shear: amount of shear)", "stress": "true stress (kPa)"}


def shipped_tests() -> Path:
    """Table of published tests of brain tissue that comes with the project."""
    return Path(str(resources.files("replay.laboratory") / "data" / "brain_tests.csv"))


def shipped_material(name: str) -> Material:
    """A material by name: of the model, or ``brain:<set>`` for a parameter set of the brain's law."""
    library = {f"brain:{key}": models.brain_material(key) for key in models.brain_sets()}
    library |= models.load_materials()
    if name not in library:
        where = "laboratory"
        raise InputError(where, f"there is no material {name!r}", column="material", expected=", ".join(library))
    facts = library[name]
    return Material(name, facts["law"], facts["density_kg_per_m3"], facts["parameters"])


def run_material(name: str, mode: str, rate_per_s: float, strain: float, out: Path) -> int:
    """Put one material through one test; write its table and picture."""
    material = shipped_material(name)
    found = answer(material, programme(mode, rate_per_s, strain))
    stem = f"{name.replace(':', '-')}_{mode}_{rate_per_s:g}_per_s"
    ANSWER_TABLE.write(out / f"{stem}.csv", found.table())
    caption = f"{material.law}: {mode.replace('_', ' ')} at {rate_per_s:g} per s, nominal."
    curve = TissueCurve(
        f"{mode.replace('_', ' ')}, {rate_per_s:g} per s", found.programme.strains, 1e-3 * found.nominal_pa,
        np.empty((0, 3)), "",
    )  # fmt: skip
    picture = curves_picture(
        stem, name, {name: [curve]}, caption, strain="nominal strain", stress="nominal stress (kPa)"
    )
    write_pictures(out, [picture])
    print(f"{out / stem}.csv: nominal stress up to {found.nominal_pa.max():.6g} Pa")
    return 0


def run_calibration(data: Path, out: Path, *, modes: str, hold: Sequence[str], starts: int, seed: int) -> int:
    """Fit the brain's law to a table of tests; write the set, its report and its figures."""
    curves = read_tests(data)
    used = [curve for curve in curves if modes == "all" or curve.mode == modes]
    if not used:
        raise InputError(data, f"there is no row of {modes!r} to fit", mend="choose another --modes")
    material = shipped_material("brain:compression")
    facts = models.brain_parameters()
    if unknown := [name for name in hold if name not in facts]:
        where = "--hold"
        raise InputError(where, f"{unknown[0]!r} is no parameter of the brain's law", expected=", ".join(facts))
    free = [
        Free(name, *f["bounds"]) for name, f in facts.items() if f["certainty"] == "calibrated" and name not in hold
    ]
    fit = calibrate(material, free, used, starts=starts, seed=seed)
    foretold = left_out(fit.material, free, used)
    pictures = article_figures(fit.material, curves)
    write_json(
        out / "calibration.json",
        {
            "data": data.name,
            "fitted_to": [curve.name for curve in used],
            "values": dict(fit.material.parameters),
            "rms_Pa": rms(fit.material, curves),
            "rms_when_left_out_Pa": foretold,
            "cost": fit.cost,
            "costs_of_all_starts": fit.costs,
            "on_a_bound": fit.on_a_bound(),
            "standard_error_of_ln": dict(zip([f.name for f in free], fit.spread.tolist())),
            "correlation_of_ln": fit.correlation.tolist(),
            "profile": {name: {"value": v.tolist(), "cost": c.tolist()} for name, (v, c) in fit.profile.items()},
        },
    )
    write_pictures(out, pictures)
    write_page(
        out / "calibration.html",
        f"Calibration to {data.name}",
        _words(fit, used),
        pictures,
        _tables(fit, curves, foretold),
    )
    for name, error in rms(fit.material, curves).items():
        unseen = f", {1e-3 * foretold[name]:.3f} under a fit to the others" if name in foretold else ""
        print(f"  {name}: RMS {1e-3 * error:.3f} kPa{unseen}")
    print(f"{out / 'calibration.html'}: cost {fit.cost:.4g}, on a bound: {', '.join(fit.on_a_bound()) or 'none'}")
    return 0


def run_article_figures(out: Path, data: Path | None, *, threads: int | None) -> int:
    """Draw the article's Figures 1 to 4 from the shipped parameter sets, with the status of every datum."""
    curves = read_tests(data or shipped_tests())
    pictures: list[Picture] = []
    for key in models.brain_sets():
        for picture in article_figures(shipped_material(f"brain:{key}"), curves):
            pictures.append(dataclasses.replace(picture, name=f"{picture.name}_{key}"))
    material = shipped_material("brain:compression")
    found = {}
    for ends in ENDS:
        with tempfile.TemporaryDirectory() as folder:
            done = squeeze(material, ends, Path(folder), threads=threads)
        found[ends] = (done.strains, done.diameters, done.shapes)
    count = Specimen().hexes_of_the_whole
    caption = (
        f"Specimen of 30 by 15 mm, {count} hexes of the whole, 750 per s, platens rigid (the bars' E is 2391.2 MPa). No"
        " measured diameters are shown: none are public here."
    )
    pictures.append(specimen_picture(found, caption))
    write_pictures(out, pictures)
    print(f"{out}: {len(pictures)} figures")
    return 0


def article_figures(material: Material, curves: Sequence[Curve]) -> list[Picture]:
    """Figures 1 to 3: compression and shear at matched rates, low rates, high rates; true stress."""

    def panel(mode: str, rates: Sequence[float]) -> list[TissueCurve]:
        return [_true(material, c) for c in curves if c.mode == mode and c.rate_per_s in rates]

    low = [c.rate_per_s for c in curves if c.mode == "compression" and c.rate_per_s < 1.0]
    high = [c.rate_per_s for c in curves if c.mode == "compression" and c.rate_per_s >= 1.0]
    both = [r for r in high if any(c.mode == "simple_shear" and c.rate_per_s == r for c in curves)][:2]
    converted = " Nominal data are shown as true stress of an incompressible specimen; bars: standard deviation."
    figures = []
    for name, title, panels in (
        (
            "figure_1_compression_and_shear", "Compression and simple shear at matched rates",
            {"Compression": panel("compression", both), "Simple shear": panel("simple_shear", both)},
        ),
        ("figure_2_low_rates", "Low rates", {"Compression at low rates": panel("compression", low)}),
        ("figure_3_high_rates", "High rates", {"Compression at high rates": panel("compression", high)}),
    ):  # fmt: skip
        kept = {heading: found for heading, found in panels.items() if found}
        if kept:
            figures.append(curves_picture(name, title, kept, f"{title}, {material.name}.{converted}", **_TRUE))
    return figures


def _true(material: Material, curve: Curve) -> TissueCurve:
    found = curve_answer(material, curve)
    points = np.column_stack([curve.strains, 1e-3 * curve.stresses_pa, 1e-3 * curve.deviations_pa])
    strain = found.programme.strains
    if curve.mode != "simple_shear":
        sign = 1.0 if curve.mode == "tension" else -1.0
        stretch = 1 + sign * points[:, 0]
        points[:, 1:] *= stretch[:, None]
        points[:, 0], strain = sign * np.log(stretch), sign * np.log(found.programme.stretches)
    status = ", ".join(dict.fromkeys(curve.statuses))
    return TissueCurve(f"{curve.rate_per_s:g} per s", strain, 1e-3 * found.true_pa, points, status)


def _words(fit: Fit, used: Sequence[Curve]) -> list[str]:
    blind = [f.name for f, s in zip(fit.free, fit.spread) if s > np.log(2.0)]
    words = [
        f"Fitted to {', '.join(curve.name for curve in used)}.",
        f"Least cost of {len(fit.costs)} starts {fit.cost:.4g}, the worst {fit.costs[-1]:.4g}.",
        "On a bound: " + (", ".join(fit.on_a_bound()) or "none") + ".",
    ]
    if blind:
        words.append(
            "Not told by these data to within a factor of two at one weighted standard error, so that other values"
            " serve as well: " + ", ".join(blind) + ". Their values are a choice, not a measurement."
        )
    return words


def _tables(
    fit: Fit, curves: Sequence[Curve], foretold: Mapping[str, float]
) -> list[tuple[str, list[str], list[list[Any]]]]:
    errors: Mapping[str, float] = rms(fit.material, curves)
    status = {curve.name: ", ".join(dict.fromkeys(curve.statuses)) for curve in curves}
    names = [f.name for f in fit.free]
    profile = [
        [name, *(1.0 * v for v in values), *(float(c - fit.cost) for c in costs)]
        for name, (values, costs) in fit.profile.items()
    ]
    points = len(profile[0]) // 2 if profile else 0
    return [
        (
            "Errors", ["Test", "RMS (kPa)", "under a fit to the other tests (kPa)", "data"],
            [[n, 1e-3 * e, 1e-3 * foretold[n] if n in foretold else "", status[n]] for n, e in errors.items()],
        ),
        (
            "Parameters", ["Parameter", "value", "lower bound", "upper bound", "standard error of its logarithm"],
            [[f.name, fit.value(f.name), f.least, f.most, float(s)] for f, s in zip(fit.free, fit.spread)],
        ),
        ("Correlation of the logarithms", ["", *names], [[n, *row] for n, row in zip(names, fit.correlation.tolist())]),
        (
            "Profiles: values, then how much the cost rises when all others are fitted again",
            ["Parameter", *(f"{what} {k + 1}" for what in ("value", "cost") for k in range(points))], profile,
        ),
    ]  # fmt: skip
