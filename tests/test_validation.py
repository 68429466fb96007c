"""Criteria that are judged, the uncertainty beside them, and records that show any change."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from support.measured import sail, table_of
from support.project import ROOT

import diagnosis
from cosim import InputError
from cosim.campaign import Posterior
from diagnosis import compare
from diagnosis.acceptance import FILES, json_schema, read_criteria, template
from diagnosis.acceptance.budget import (
    Budget,
    Learned,
    budget,
    combined,
    read_learned,
    sources_of,
)
from diagnosis.acceptance.criterion import Criterion, InputStd
from diagnosis.acceptance.judged_criterion import (
    JudgedErrors,
    Judgement,
    Predicted,
    WindowCounts,
    decide,
    judge,
)
from diagnosis.acceptance.predictions import Predictions, difference, judged
from diagnosis.acceptance.record.validation import _result
from diagnosis.acceptance.statistics import Interval, independent, root_mean_square, share
from diagnosis.acceptance.validity import window_means
from diagnosis.search.prediction_fit.disturbance import ForceDisturbance
from diagnosis.verify import main as verify_main

cryptography = pytest.importorskip("cryptography")
WITHIN = {"quantity": "position", "horizon": 8.0, "tolerance": 1.0, "unit": "m"}


def criterion(**changes):
    return Criterion(**{**WITHIN, **changes})


@pytest.mark.parametrize("statistic", ["fraction", "rms"])
def test_a_record_has_the_statistics_of_the_errors_in_the_unit_of_the_criterion(statistic):
    """In cm; a fraction has no unit."""
    errors, bounds = np.array([0.03, -0.04, 0.01]), Interval(0.9, 0.8, 0.95)
    unsure = Budget(0.01, *[None] * 6)
    found = JudgedErrors(np.zeros(3), errors, np.array([0.02, -0.01]), 3.0, bounds, unsure)
    counts = WindowCounts(3, 3, {}, ["a"], {})
    made = Judgement(criterion(unit="cm", tolerance=5.0, statistic=statistic), None, "", counts, found)
    found = _result(made)
    assert found["E"] == pytest.approx(0.0)
    assert found["rms"] == pytest.approx(100.0 * (26e-4 / 3.0) ** 0.5)
    assert found["largest"] == pytest.approx(4.0)
    assert found["E_axes"] == pytest.approx([2.0, -1.0])
    factor = 100.0 if statistic == "rms" else 1.0
    assert [found[n] for n in ("estimate", "low", "high")] == pytest.approx([factor * x for x in bounds])
    none = _result(made._replace(found=None))
    assert [none[n] for n in ("E", "rms", "largest", "E_axes", "estimate", "budget")] == [None] * 6


def outcome(errors, u_val=0.0, n=None, **changes):
    errors = np.asarray(errors, float)
    return decide(criterion(**changes), errors, errors.size if n is None else n, u_val)[0]


@pytest.fixture(scope="module")
def runs():
    return diagnosis.gather([sail(48.0, h=0.1)[0]], horizon=4.0)


@pytest.fixture(scope="module")
def comparison(runs):
    return diagnosis.evaluate(runs)


@pytest.fixture(scope="module")
def predictions(comparison):
    return Predictions(comparison.evaluations[0], 4.0)


@pytest.fixture
def key(tmp_path):
    return write_key(tmp_path / "key.pem")


def write_key(path):
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    made = Ed25519PrivateKey.generate()
    path.write_bytes(made.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    return path


def write_criteria(path, *criteria, **more):
    path.write_text(json.dumps({"criteria": [{**WITHIN, **c} for c in criteria], **more}))
    return path


@pytest.mark.parametrize("statistic", ["fraction", "median", "rms"])
def test_all_three_outcomes(statistic):
    stated = {"statistic": statistic}
    assert outcome(np.full(60, 0.5), **stated) == "met"
    assert outcome(np.full(60, 2.0), **stated) == "not met"
    few = [0.5, 0.6, 0.4, 1.2][: 4 if statistic == "rms" else 3]
    assert outcome(few, **stated) == "cannot be judged"


def test_a_model_that_runs_away_does_not_meet_a_share():
    assert outcome(np.full(60, np.inf)) == "not met"


def test_what_measurement_may_explain_is_not_held_against_a_model():
    """Errors beyond the tolerance by less than 2 u_val; and a tolerance that nobody could see."""
    errors = np.full(60, 1.1)
    assert outcome(errors) == outcome(errors, 0.04) == "not met"
    assert outcome(errors, 0.06) == "cannot be judged"
    assert outcome(np.full(60, 0.5), 0.51) == "cannot be judged"


def test_overlap_of_what_windows_say_is_no_evidence():
    """As many windows, of which few are independent."""
    assert outcome(np.full(60, 0.5), n=60) == "met"
    assert outcome(np.full(60, 0.5), n=10) == "cannot be judged"


def test_outcomes_do_not_depend_on_units():
    errors = np.random.default_rng(1).rayleigh(0.4, 80)
    found = [
        decide(criterion(), errors, 80, 0.1),
        decide(criterion(tolerance=100.0, unit="cm"), errors, 80, 0.1),
    ]
    assert found[0][0] == found[1][0]
    assert found[0][2] == pytest.approx(found[1][2])


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_a_criterion_that_is_just_missed_is_hardly_ever_told_met(correlation):
    """Errors of which 90 % are within; 5 % of all records may say more than that."""
    tolerance = 1.6448536269514722  # of a standard normal distribution 90 %
    assert met_share(tolerance, correlation) < (0.08 if correlation == 0.0 else 0.12)


def test_a_criterion_that_is_met_is_told_so_at_the_rate_of_its_bound():
    """Of 120 independent windows with 95 % within, by the binomial distribution."""
    n, wanted = 120, 0.9
    enough = next(k for k in range(n + 1) if share(np.arange(n) < k, n, 0.95).low >= wanted)
    expected = binom.sf(enough - 1, n, 0.95)
    found = met_share(1.959963984540054, 0.0, n, given=n)
    assert found == pytest.approx(expected, abs=4.0 * np.sqrt(0.25 / 400))


def met_share(tolerance, correlation, n=120, records=400, given=None):
    rng, run = np.random.default_rng(7), np.zeros(n, int)
    stated = 0
    for _ in range(records):
        errors = rng.standard_normal(n)
        for k in range(1, n):
            errors[k] = correlation * errors[k - 1] + np.sqrt(1.0 - correlation**2) * errors[k]
        free = given or independent(np.abs(errors), run)
        stated += outcome(errors, n=free, tolerance=tolerance) == "met"
    return stated / records


def test_bounds_of_a_share_are_those_of_the_binomial_distribution():
    low, high = share(np.arange(40) < 33, 40, 0.95)[1:]
    assert binom.sf(32, 40, low) == pytest.approx(0.05)
    assert binom.cdf(33, 40, high) == pytest.approx(0.05)
    assert share(np.ones(29, bool), 29, 0.95) == pytest.approx((1.0, 0.05 ** (1 / 29), 1.0))


def test_independent_windows():
    """Of an autoregression (1 - a) / (1 + a) of all; runs are apart; one value again and again counts fully."""
    rng, n, a = np.random.default_rng(2), 4000, 0.5
    errors = rng.standard_normal(n)
    assert independent(errors, np.zeros(n)) > 0.85 * n
    for k in range(1, n):
        errors[k] += a * errors[k - 1]
    assert independent(errors, np.zeros(n)) == pytest.approx(n / 3.0, rel=0.2)
    assert independent(errors, np.arange(n)) == n
    assert independent(7.0 * errors, np.zeros(n)) == pytest.approx(independent(errors, np.zeros(n)))


def test_rms_bounds_hold_their_probability():
    rng = np.random.default_rng(3)
    beyond = [root_mean_square(rng.standard_normal(60), 60, 0.95).high < 1.0 for _ in range(600)]
    assert np.mean(beyond) < 0.12  # squares are skew; 0.05 of many


def test_uncertainties_combine_by_their_squares():
    b = Budget(3.0, 4.0, None, 12.0, 0.0, 0.0, None)
    assert combined(3.0, None, 4.0) == 5.0
    assert b.u_input == pytest.approx(np.sqrt(160.0))
    assert b.u_val == pytest.approx(13.0)
    assert b.unknown == ["parameters", "numerical"]


def test_a_budget_is_over_the_windows_that_count():
    one = {"u": np.array([1.0, 9.0, 100.0])}
    s = dict.fromkeys(Budget._fields, "not given") | {"measurement": one}
    found = budget("u", [s], [np.array([True, True, False])])
    assert found.measurement == pytest.approx(np.sqrt(5.0))
    assert found.parameters is None
    assert budget("r", [s], [np.ones(3, bool)]).measurement is None


def with_std(predictions, **std):
    """Predictions whose initial state is as uncertain as told, and else exact."""
    s = predictions.smoothed
    zero = {name: np.zeros_like(getattr(s, name)) for name in ("eta_std", "eta_dot_std")}
    for name, values in std.items():
        zero[name][:] = values
    made = object.__new__(Predictions)
    made.__dict__ = {**predictions.__dict__, "smoothed": replace(s, **zero)}
    return made


def test_the_initial_state_in_closed_form(comparison):
    """A shift moves the end by as much; of a velocity, for a short while, what it covers in that time."""
    p = Predictions(comparison.evaluations[0], 1.0)
    shifted = sources_of(with_std(p, eta_std=[3e-3, 4e-3, 0.0]), None)["initial_state"]
    assert shifted["position"] == pytest.approx(np.full(p.rows.size, 25e-6), rel=1e-6)
    assert shifted["heading"] == pytest.approx(0.0)
    faster = sources_of(with_std(p, eta_dot_std=[3e-3, 4e-3, 2e-3]), None)["initial_state"]
    seconds = p.smoothed.time[p.rows] - p.start
    assert np.sqrt(faster["position"]) == pytest.approx(5e-3 * seconds, rel=0.2)
    assert np.sqrt(faster["heading"]) == pytest.approx(2e-3 * seconds, rel=0.35)  # yaw is damped


def test_the_measurement_is_as_uncertain_as_its_channels(comparison):
    """Of the position both coordinates, whose errors are independent; of each velocity its own."""
    p = Predictions(comparison.evaluations[0], 1.0)
    s, std = p.smoothed, np.array([0.1, 0.2, 0.3])
    p.smoothed = replace(s, noise=np.array([3e-3, 4e-3, 5e-3]), nu_std=np.tile(std, (s.time.size, 1)))
    found = sources_of(p, None)["measurement"]
    expected = {"position": 5e-3, "heading": 5e-3, **dict(zip("uvr", std, strict=True))}
    for quantity, u in expected.items():
        assert np.sqrt(found[quantity]) == pytest.approx(np.full(p.rows.size, u))


def test_what_acts_from_north_and_from_east_adds_in_quadrature(predictions):
    found = sources_of(predictions, None, InputStd(current=0.02))
    north, east = (
        difference(predictions.with_addition({name: 0.02}), predictions.motion)
        for name in ("V_n", "V_e")
    )
    squares = np.sum(north[:, :2] ** 2 + east[:, :2] ** 2, axis=1)
    assert found["current"]["position"] == pytest.approx(squares, rel=1e-9)
    assert squares.min() > 0.0
    assert isinstance(found["wind"], str), "its uncertainty is not given"


def test_parameters_and_process_noise(predictions):
    """By one parameter as its change does; both quadratic in their size, and unknown without a posterior."""
    assert isinstance(sources_of(predictions, None)["parameters"], str)
    assert isinstance(sources_of(predictions, None)["process_noise"], str)
    size = np.array([0.02, 0.01, 0.005])
    found = []
    for factor in (1.0, 2.0):
        posterior = Posterior(
            names=["vessel.X_u"], units=["N.s/m"], mean=[0.0], covariance=[[(0.01 * factor) ** 2]]
        )
        found.append(
            sources_of(predictions, Learned(posterior, ForceDisturbance(factor * size, np.ones(3)), ()))
        )
    (changed,) = predictions.motions([predictions.model.plus({"X_u": 0.01})])
    expected = judged("position", difference(changed, predictions.motion))
    assert np.sqrt(found[0]["parameters"]["position"]) == pytest.approx(expected, rel=1e-3)
    assert found[1]["parameters"]["position"] == pytest.approx(
        4.0 * found[0]["parameters"]["position"], rel=1e-2
    )
    assert found[1]["process_noise"]["heading"] == pytest.approx(
        4.0 * found[0]["process_noise"]["heading"]
    )
    assert "u" not in found[0]["process_noise"]


def test_predicted_velocities_are_those_of_the_ship(predictions):
    """The nominal model is the ship that sailed: what is left is noise and smoothing."""
    off = difference(predictions.measured, predictions.motion)
    for quantity, most in {"position": 3e-3, "heading": 6e-3, "u": 6e-3, "v": 6e-3, "r": 2e-2}.items():
        assert np.sqrt(np.mean(judged(quantity, off) ** 2)) < most


def test_only_windows_within_count(comparison, predictions):
    p = Predicted("run", predictions, sources_of(predictions, None), window_means(predictions))
    u = p.signals["u"]
    some = judge(criterion(operating_range={"u": [float(np.median(u)), 9.0]}), ["run"], [p])
    assert some.found is not None
    assert some.found.errors.size == np.sum(u >= np.median(u))
    none = judge(criterion(operating_range={"u": [8.0, 9.0]}), ["run"], [p])
    assert none.reason == "outside the data: no window has u from 8 to 9"
    assert judge(criterion(runs=["other"]), ["run"], [p]).reason == "run other was not compared"
    with pytest.raises(InputError, match=r"run run has no 'tau_x'; did you mean 'tau_X'"):
        judge(criterion(operating_range={"tau_x": [0.0, 1.0]}), ["run"], [p])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read as criteria"),
        ("[" * 100_000, "nested too deeply"),
        ("[]", "should be an object"),
        ('{"criteria": []}', "criteria: List should have at least 1 item"),
        ('{"criterai": []}', r"criteri.*(did you mean 'criteria'|is missing)"),
        ({"quantity": "headin"}, r"'headin' cannot be judged; did you mean 'heading'"),
        ({"unit": "deg"}, "'deg' is not a unit of position; there are m, mm"),
        ({"tolerance": -1.0}, r"criteria\[0\].tolerance: Input should be greater than 0"),
        ({"tolerence": 1.0}, r"criteria\[0\].tolerence: unknown key; did you mean 'tolerance'"),
        ({"horizon": 1e400}, r"criteria\[0\].horizon"),
        ({"statistic": "rms", "coverage": 0.5}, "coverage belongs to the statistic 'fraction'"),
        ({"operating_range": {"u": [2, 1]}}, "operating_range.u: 2 is not below 1"),
        ({"tolerance": True}, r"criteria\[0\].tolerance: Input should be a valid number"),
        ({"tolerance": "1"}, r"criteria\[0\].tolerance: Input should be a valid number"),
        ({"training_runs": 1}, r"criteria\[0\].training_runs: Input should be a valid boolean"),
        ('{"purpose": "a", "purpose": "b", "criteria": []}', "key 'purpose' occurs twice"),
        ('{"particulars": {"klient": "a"}, "criteria": []}', "particulars.klient.*did you mean 'client'"),
        ('{"input_std": {"current": -1.0}, "criteria": []}', "input_std.current"),
    ],
)  # fmt: skip
def test_what_are_no_criteria(tmp_path, text, message):
    path = tmp_path / "criteria.json"
    path.write_text(text if isinstance(text, str) else json.dumps({"criteria": [{**WITHIN, **text}]}))
    with pytest.raises(InputError, match=message) as raised:
        read_criteria(path)
    assert "\n" not in str(raised.value)
    with pytest.raises(InputError, match="no such criteria"):
        read_criteria(tmp_path / "other.json")


def test_the_first_file_and_the_schema(tmp_path):
    path = tmp_path / "criteria.json"
    path.write_text(json.dumps(template()))
    assert len(read_criteria(path).content.criteria) == 2
    kept = json.loads((ROOT / "docs" / "criteria.schema.json").read_text())
    assert kept == json_schema(), "cybership criteria --schema > docs/criteria.schema.json"


def test_a_record_of_both_verdicts_and_what_shows_a_change(comparison, tmp_path, key, capsys):
    """Written, checked, and with a byte changed in each file that it names."""
    easy, hard = {"tolerance": 0.5, "coverage": 0.5, "horizon": 4.0}, {"tolerance": 1e-4, "horizon": 4.0}
    criteria = write_criteria(tmp_path / "criteria.json", easy, hard, purpose="a test")
    map_ = tmp_path / "notes.txt"
    map_.write_text("a file")
    v = diagnosis.validate(comparison, criteria, files={"notes": map_})
    assert [j.outcome for j in v.content.judgements] == ["met", "cannot be judged"]
    assert "smaller than the validation uncertainty" in v.content.judgements[1].reason
    out = tmp_path / "out"
    assert set(v.write(out, key)) == set(FILES) == {p.name for p in out.iterdir()}
    record, public = out / FILES[0], public_of(key, tmp_path / "public.pem")
    usual = [str(record), "--key", public, "--allow-missing", "made"]  # which is a table in memory
    for path in (criteria, map_, *(out / name for name in FILES)):
        raw = path.read_bytes()
        # Of the record a byte that leaves it one.
        at = raw.index(b'"purpose": "a t') + 12 if path == record else len(raw) // 2
        path.write_bytes(raw[:at] + bytes([raw[at] ^ 1]) + raw[at + 1 :])
        assert verify_main(usual) == 1, path
        path.write_bytes(raw)
    assert verify_main(usual) == 0
    map_.unlink()
    assert verify_main(usual) == 4
    assert "NOT CHECKED  notes: " in capsys.readouterr().out
    assert verify_main([*usual, "--allow-missing", "notes.txt"]) == 0
    assert "notes.txt: not found here (allowed)" in capsys.readouterr().out
    assert verify_main([*usual, "--allow-missing", "notes.pdf"]) == 2


def public_of(key, path):
    from diagnosis.acceptance.record.signature import public_key

    path.write_text(public_key(key))
    return str(path)


def test_whose_signature_it_is(comparison, tmp_path, key):
    criteria = write_criteria(tmp_path / "criteria.json", {"horizon": 4.0})
    record = tmp_path / "out" / FILES[0]
    diagnosis.validate(comparison, criteria).write(record.parent, key)
    mine = public_of(key, tmp_path / "mine.pem")
    other = public_of(write_key(tmp_path / "key_2.pem"), tmp_path / "other.pem")
    usual = [str(record), "--allow-missing", "made"]
    assert verify_main([*usual, "--key", mine]) == 0
    assert verify_main([*usual, "--key", other]) == 1
    assert verify_main([*usual, "--key", str(criteria)]) == 2
    assert verify_main([str(criteria)]) == 2
    assert verify_main([str(tmp_path / "no.json")]) == 2
    assert verify_main(usual) == 4, "of a key that the record names nobody knows whose it is"
    assert verify_main([*usual, "--allow-missing", "key"]) == 0
    (record.parent / FILES[3]).unlink()
    assert verify_main([*usual, "--allow-missing", "signature", "--allow-missing", "key"]) == 1
    diagnosis.validate(comparison, criteria).write(record.parent)
    assert verify_main([*usual, "--key", mine]) == 1
    assert verify_main(usual) == 4
    assert verify_main([*usual, "--allow-missing", "signature"]) == 0


def test_an_edited_verdict_without_its_signature_is_not_checked(comparison, tmp_path, key):
    criteria = write_criteria(tmp_path / "criteria.json", {"horizon": 4.0, "tolerance": 1e-4})
    record = tmp_path / "out" / FILES[0]
    diagnosis.validate(comparison, criteria).write(record.parent, key)
    content = json.loads(record.read_text())
    content["judgements"][0]["outcome"], content["public_key"] = "met", None
    record.write_text(json.dumps(content))
    (record.parent / FILES[3]).unlink()
    assert verify_main([str(record), "--allow-missing", "made"]) == 4
    assert verify_main([str(record), "--key", public_of(key, tmp_path / "mine.pem")]) == 1
    raw = record.read_text()
    record.write_text(raw.replace('"form"', '"public_key": null, "form"', 1))
    assert verify_main([str(record)]) == 2, "a key twice"


@pytest.mark.parametrize("kind", ["nothing", "no key", "public key"])
def test_what_cannot_sign_leaves_nothing(comparison, tmp_path, key, kind):
    from diagnosis.acceptance.record.signature import public_key

    contents = {"no key": "no key", "public key": public_key(key)}
    path = tmp_path / "bad.pem"
    if kind in contents:
        path.write_text(contents[kind])
    v = diagnosis.validate(comparison, write_criteria(tmp_path / "criteria.json", {"horizon": 4.0}))
    with pytest.raises(InputError, match=r"bad\.pem"):
        v.write(tmp_path / "out", path)
    assert not (tmp_path / "out").exists()


def test_signing_without_the_library_says_what_to_install(monkeypatch, key):
    from diagnosis.acceptance.record.signature import sign

    monkeypatch.setitem(__import__("sys").modules, "cryptography", None)
    with pytest.raises(InputError, match=r"needs cryptography: pip install 'cybership\[diagnosis\]'"):
        sign(b"", key)


def test_a_key_is_read_before_the_work(tmp_path, capsys):
    criteria = write_criteria(tmp_path / "criteria.json", {"horizon": 4.0})
    given = ["--criteria", str(criteria), "--sign", "nothere.pem", "--out", str(tmp_path / "out")]
    assert compare.main(["nothere.csv", *given]) == 2
    assert "the key 'nothere.pem' cannot be read" in capsys.readouterr().err


def test_an_operating_range_of_what_no_run_has_is_refused_before_anything_is_written(tmp_path, capsys):
    log = tmp_path / "a.csv"
    table_of(sail(40.0, 0.1)[0]).to_csv(log, index=False)
    out = ["--out", str(tmp_path / "out")]
    for name, code in (("w", 2), ("u", 0)):
        ranges = {"horizon": 4.0, "operating_range": {name: [0.0, 1.0]}}
        criteria = write_criteria(tmp_path / f"{name}.json", ranges)
        assert compare.main([str(log), "--criteria", str(criteria), *out]) == code
        assert (tmp_path / "out").exists() == (code == 0)
    assert "operating_range: no run has 'w'" in capsys.readouterr().err


def test_a_script_learns_by_the_exit_code_whether_all_criteria_are_met(tmp_path):
    log = tmp_path / "a.csv"
    table_of(sail(40.0, 0.1)[0]).to_csv(log, index=False)
    for tolerance, required, code in ((1e3, True, 0), (1e-9, True, 1), (1e-9, False, 0)):
        criteria = write_criteria(
            tmp_path / "c.json", {"statistic": "rms", "horizon": 4.0, "tolerance": tolerance}
        )
        given = [str(log), "--criteria", str(criteria), "--out", str(tmp_path / "out")]
        assert compare.main([*given, *["--require-met"] * required]) == code


def test_a_signature_is_of_criteria(tmp_path, capsys):
    assert compare.main([str(tmp_path), "--sign", "key.pem", "--out", str(tmp_path / "out")]) == 2
    assert "--criteria FILE.json is missing" in capsys.readouterr().err


LEFT = json.dumps({"unrecorded": {"size": [0.1, 0.2, 0.3], "time": [1.0, 2.0, 3.0]}})
KNOWN = json.dumps({"names": ["vessel.m"], "units": ["kg"], "mean": [15.0], "covariance": [[0.01]]})


@pytest.mark.parametrize(
    ("diagnosis_json", "posterior_json"),
    [
        ("{", KNOWN),
        ("[]", KNOWN),
        (LEFT.replace("0.1", "null"), KNOWN),
        (LEFT.replace("1.0", "0.0"), KNOWN),
        (LEFT, "{"),
        (LEFT, "[]"),
        (LEFT, KNOWN.replace("0.01", "-1.0")),
        (None, KNOWN),
    ],
)
def test_what_is_no_result_of_learn_is_refused_with_one_line(tmp_path, diagnosis_json, posterior_json):
    if diagnosis_json is not None:
        (tmp_path / "diagnosis.json").write_text(diagnosis_json)
    (tmp_path / "posterior.json").write_text(posterior_json)
    with pytest.raises(InputError) as refused:
        read_learned(tmp_path)
    assert "\n" not in str(refused.value)


def test_what_learn_wrote_is_read(tmp_path):
    (tmp_path / "diagnosis.json").write_text(LEFT)
    assert read_learned(tmp_path).posterior is None, "where nothing was fitted"
    (tmp_path / "posterior.json").write_text(KNOWN)
    found = read_learned(tmp_path)
    assert found.disturbance.size.tolist() == [0.1, 0.2, 0.3]
    assert list(found.posterior.names) == ["vessel.m"]
