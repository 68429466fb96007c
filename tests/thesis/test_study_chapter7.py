"""The parts of chapter 7's report, of samples whose model error is known in closed form."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from cosim.dispatch import FinishedRun
from diagnosis import Model
from studies.study_report import Report, Verdict
from thesis import analysis, chapter7
from thesis.analysis import NU, TAU, Samples, concurrent_passes
from thesis.basin_trials import sysid4, trials
from thesis.error_models import analysis_tables, model_loops
from thesis.tracking.outcome import AXES

MAP = np.array(
    [
        [-3.0, 0.0, 0.0, -0.5, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0, 0.0, -0.25],
    ]
)


def motion(n=600, runs=2):
    """Velocities and forces that have nothing to do with each other."""
    rng = np.random.default_rng(3)
    t = np.tile(np.arange(n // runs) * 0.1, runs)
    names = np.repeat([f"run{k}" for k in range(runs)], n // runs)
    wave = np.sin(
        np.outer(t, rng.uniform(0.3, 2.0, 9)) + rng.uniform(0.0, 6.0, 9) + (names == "run1")[:, None]
    )
    return names, t, *np.split(wave * [0.2, 0.05, 0.2, 0.1, 0.1, 0.1, 0.5, 0.3, 0.2], 3, axis=1)


def linear(noise=0.0):
    """Samples whose model error is a linear map of velocity and force."""
    names, t, nu, nu_dot, tau = motion()
    omega = np.hstack([nu, tau]) @ MAP.T + [0.1, 0.2, 0.3]
    return Samples(
        names, t, nu, nu_dot, tau, omega + noise * np.random.default_rng(0).normal(size=omega.shape)
    )


@pytest.fixture(scope="module")
def found():
    return analysis_tables.regressions(linear(0.01))


@pytest.fixture
def drawn(monkeypatch):
    """Name -> figure and caption."""
    made = {}
    monkeypatch.setattr(
        Report, "figure", lambda self, name, figure, caption: made.update({name: (figure, caption)})
    )
    return made


def stated(tmp_path, write, *given):
    report = Report(tmp_path, "t")
    write(report, *given)
    return report.write().read_text("utf-8")


def test_a_linear_map_is_found_and_put_back_into_the_plant(found):
    wide = found["PLS2"]
    assert wide.predicted == pytest.approx(wide.samples.omega, abs=0.1)
    r2, q2 = wide.by_axis("r2")["Y"], wide.by_axis("q2")["Y"]
    assert analysis_tables.shares(wide)[1] == f"{r2:.3f} / {q2:.3f}"
    assert q2 > 0.98
    assert model_loops.eigenvalues(wide) == ", ".join(
        f"{x:.3f}"
        for x in sorted(
            np.linalg.eigvals(np.eye(3) + wide.B[:, [wide.columns.index(n) for n in TAU]]).real
        )
    )
    assert model_loops.eigenvalues(found["PLS1"]) == "–", "products of forces are not in the plant"
    made = model_loops.ships(found)
    assert list(made) == [*analysis.TABLE_7_1, "PLS2", "PLS3", "PLS4", "PLS2, nearest stable"]
    given = model_loops.parameters_of(made["PLS4"])
    assert {name.partition(".")[0] for name in given} <= {"vessel", "thrusters"}
    assert model_loops.parameters_of(Model(vessel={"a": 1.0}, thrusters={"b": 2.0})) == {
        "vessel.a": 1.0,
        "thrusters.b": 2.0,
    }


def test_surge_force_by_unit_of_force_is_told(found):
    text = model_loops.why(found)
    wide = found["PLS2"]
    assert f"PLS2 (7 factors) {wide.B[0, wide.columns.index('tau_X')]:.2f}" in text
    assert "PLS4" not in text, "without forces"
    x = wide.samples.x
    assert f"correlate by {np.corrcoef(x[:, 0], x[:, 3])[0, 1]:.2f};" in text


def test_findings_have_their_numbers(found):
    three, products, sway = analysis_tables.findings(found)
    assert sway.holds is False, "sway is as systematic as the others"
    q2 = found["PLS4"].by_axis("q2")
    assert f"X, Y, N: {', '.join(f'{q2[a]:.3f}' for a in AXES)}; limits" in sway.numbers
    assert products.holds is True, "there are none in the truth"
    assert products[2].split(" ")[2] == "12"
    best = analysis.regressed(
        found["PLS2"].samples, analysis_tables.replace(analysis.recipe("PLS2"), factors=analysis_tables.MOST)
    ).parts[0].by_factors  # fmt: skip
    assert (
        f"the best of up to 8 {', '.join(f'{x:.3f}' for x in best.max(axis=0))}; enough: 95 %"
        in three[2]
    )
    assert three[2].startswith(f"Q² by 3 factors {', '.join(f'{x:.3f}' for x in best[2])}")


def test_products_with_sway_are_significant_where_they_act():
    s = linear(0.001)
    u, v, r = s.nu.T
    signs = np.column_stack([abs(a) * b for a in (u, v, r) for b in (v, r)])
    s.omega[:] += 5.0 * signs @ np.ones((6, 3))
    _, products, _ = analysis_tables.findings(analysis_tables.regressions(s))
    assert products.holds is False


@pytest.mark.parametrize(("significant", "chance"), [(0, True), (1, True), (3, False)])
def test_products_are_insignificant_if_no_more_are_significant_than_by_chance(significant, chance):
    unsure = np.arange(12).reshape(3, 4) >= significant
    assert (analysis_tables.by_chance(unsure) > analysis_tables.CHANCE) is chance


@pytest.mark.parametrize("best", [0.2, 0.8, 0.9])
def test_factors_suffice_for_95_percent_of_the_best_where_there_is_a_model(best):
    some = best * np.array([0.951, 0.949, 1.0])
    found = analysis_tables.suffice(some, np.full(3, best))
    assert found == {"X": True, "Y": False, "N": True}
    none = analysis_tables.suffice(np.zeros(3), np.array([0.099, 0.101, -3.0]))
    assert none == {"X": None, "Y": False, "N": None}


@pytest.mark.parametrize(
    ("q2", "so"),
    [
        ((0.8, 0.39, 0.9), True),
        ((0.8, 0.41, 0.9), False),
        ((0.9, 0.39, 0.8), True),
        ((0.09, -1.0, 0.9), False),  # surge has no model either
        ((0.9, -1.0, 0.11), True),
    ],
)
def test_sway_is_unsystematic_below_half_of_both_others(q2, so):
    assert analysis_tables.unsystematic(np.array(q2)) is so


def test_coefficients_are_insignificant_within_two_deviations_or_of_changing_sign():
    B, std = np.array([1.9, -1.9, 2.1, -2.1, 9.0]), np.ones(5)
    found = analysis_tables.insignificant(B, std, np.array([0, 0, 0, 0, 1]))
    assert found.tolist() == [True, True, False, False, True]


def test_the_eight_has_its_components_a_row_for_each_recipe_and_its_findings(
    found, tmp_path, monkeypatch
):
    s = linear(0.01)
    asked = []
    monkeypatch.setattr(analysis_tables, "write_components", lambda *given: asked.append(given[1:]))
    monkeypatch.setattr(analysis_tables, "regressions", lambda given: found if given is s else None)
    monkeypatch.setattr(
        analysis_tables, "findings", lambda given: [Verdict("A statement", True, "numbers")]
    )
    text = stated(tmp_path, analysis_tables.write_eight, s, found)
    assert asked == [(s, "eight")]
    assert "A statement: eight" in text
    for name, r in found.items():
        assert f"| {name} | {' | '.join(analysis_tables.shares(r))} |" in text


@pytest.mark.quick
def test_pictures_of_the_regressions(found, tmp_path, drawn):
    stated(tmp_path, analysis_tables.write_regressions, found, "made")
    assert {name.removeprefix("made_") for name in drawn} >= {
        *(f"PLS2_{axis}" for axis in AXES),
        *(f"{name}_variance_XYN" for name in ("PLS2", "PLS3")),
        *(f"PLS4_variance_{axis}" for axis in AXES),
        "PLS2_loadings",
        "PLS3_loadings",
        "PLS",
    }
    wide = found["PLS2"]
    figure, caption = drawn["made_PLS2_Y"]
    assert "each column, Y (Fig. 7.7)" in caption
    scale = wide.X.std(axis=0, ddof=1)
    heights = {round(abs(patch.get_height()), 9) for patch in figure.axes[0].patches}
    widths = {round(abs(patch.get_width()), 9) for patch in figure.axes[0].patches}
    assert {round(abs(x), 9) for x in wide.B[1] * scale} in (heights, widths)
    curve, caption = drawn["made_PLS3_variance_XYN"]
    assert caption == "PLS3: explained variance, mean of XYN (Fig. 7.8a)."
    lines = curve.axes[0].get_lines()
    part = found["PLS3"].parts[0]
    shown = [line.get_ydata() for line in lines if len(line.get_ydata()) == len(part.by_factors)]
    assert shown[0] == pytest.approx(100.0 * part.r2_by_factors.mean(axis=1))
    assert shown[1] == pytest.approx(100.0 * part.by_factors.mean(axis=1))
    over_time, _ = drawn["made_PLS"]
    quarter = wide.samples.time.size // 4
    assert all(
        len(line.get_xdata()) == quarter for panel in over_time.axes for line in panel.get_lines()
    )


def test_scatter_has_each_force_over_each_velocity(monkeypatch):
    """Of as many samples as a picture takes, evenly."""
    s = linear()
    monkeypatch.setattr(analysis_tables, "POINTS", 100)
    shown = slice(None, None, s.time.size // 100)
    figure = analysis_tables.scatter(s)
    for k, axis in enumerate(("omega_X", "omega_Y", "omega_N")):
        for j, state in enumerate(NU):
            panel = figure.axes[3 * k + j]
            (points,) = panel.get_lines()
            assert (points.get_xdata() == s.nu[shown, j]).all()
            assert (points.get_ydata() == s.omega[shown, k]).all()
            assert len(points.get_xdata()) == 100
            assert panel.get_xlabel() == (state if k == 2 else "")
            assert panel.get_ylabel() == (axis if j == 0 else "")


def test_components_are_told_and_drawn(tmp_path, drawn):
    text = stated(tmp_path, analysis_tables.write_components, linear(0.01), "made")
    assert "4 components explain" in text
    assert set(drawn) == {"made_scatter", "made_outliers"}


@pytest.mark.quick
def test_the_row_that_made_the_samples_explains_them(tmp_path, drawn):
    names, t, nu, nu_dot, tau = motion()
    made = Samples(names, t, nu, nu_dot, tau, np.zeros_like(nu))
    made.omega[:] = analysis.regressors(made) @ np.array(sysid4.PHI)
    text = stated(tmp_path, analysis_tables.write_table_7_1, made, "made")
    rows = {
        line.split(" | ")[0][2:]: line.split(" | ")[1:4]
        for line in text.splitlines()
        if line.startswith("| ")
    }
    assert rows["SYSID4"] == rows["least squares"] == ["1.000"] * 3
    assert rows["SYSID1"] != ["1.000"] * 3
    assert set(rows) == {
        "thesis", "The identified model has the main dynamics of the model error (7.2.4, Fig. 7.2): made",
        "model", ":--", *analysis.TABLE_7_1, "least squares", "identified, limits of Algorithm 4", "identified, limits of the data"
    }  # fmt: skip
    found = analysis.identify(analysis.by_run(analysis.without_outliers(made)))
    rest = "" if found.settled else ", not converged"
    passed = ", ".join(f"{100.0 * x:.0f}" for x in found.passed)
    assert (
        f"limits of Algorithm 4: {found.passes} passes{rest}, the blocker lets {passed} % of each run"
        in text
    )
    assert f"Condition numbers {', '.join(f'{x:.3g}' for x in found.condition)}." in text
    figure, caption = drawn["made_table_7_1"]
    assert caption == "ω of run0 and Table 7.1 (Fig. 7.2)."
    assert len(figure.axes[0].get_lines()) == 1 + len(analysis.TABLE_7_1)


def wave(**columns):
    t = np.arange(0.0, 200.0, 0.5)
    states = analysis.recipe("nominal").transformer().ranges
    names = [f"thrusters.tau_cmd_{n[-1]}" if n in TAU else f"vessel.{n}" for n in states]
    return {"time": t, **{n: 0.1 * np.sin(0.05 * t + k) for k, n in enumerate(names)}, **columns}


def test_columns_of_a_run_sum_to_one_for_each_state():
    log = wave(**{"vessel.psi": np.linspace(0.0, 30.0, 400)})
    assert analysis_tables.states_of(log, "tau_Y") is log["thrusters.tau_cmd_Y"]
    assert analysis_tables.states_of(log, "u") is log["vessel.u"]
    turned = analysis_tables.states_of(log, "psi")
    assert np.abs(turned).max() <= np.pi
    assert np.cos(turned) == pytest.approx(np.cos(log["vessel.psi"]))
    figure = analysis_tables.matrices(log)
    nominal, continuous = (panel.get_images()[0] for panel in figure.axes)
    assert [panel.get_ylabel() for panel in figure.axes] == ["column, nominal", "column, continuous"]
    states = len(analysis.recipe("nominal").transformer().ranges)
    for image in (nominal, continuous):
        values = np.asarray(image.get_array())
        assert values.shape[1] == 20, "every twentieth row"
        assert values.sum(axis=0) == pytest.approx(states)
        assert image.get_extent() == [0.0, 199.5, 0, values.shape[0]]
        assert image.origin == "lower"
    assert set(np.unique(np.asarray(nominal.get_array()))) == {0.0, 1.0}
    assert len(np.unique(np.asarray(continuous.get_array()))) > 10


@pytest.mark.quick
def test_shapes_are_those_of_the_regression(tmp_path, drawn):
    s = linear(0.01)
    stated(tmp_path, analysis_tables.write_shapes, s, wave())
    assert set(drawn) == {"simulated_shapes", "simulated_matrices"}
    found = analysis.regressed(analysis.without_outliers(s), analysis.recipe("continuous"))
    for panel, state in zip(drawn["simulated_shapes"][0].axes, (*NU, *TAU), strict=True):
        assert panel.get_xlabel().startswith(f"{state} [")
        places = [k for k, n in enumerate(found.columns) if n.startswith(f"{state}=")]
        for k, line in enumerate(panel.get_lines()):
            assert line.get_label() == AXES[k]
            assert line.get_ydata() == pytest.approx(found.B[k, places])
            assert line.get_xdata() == pytest.approx(
                [float(found.columns[j][len(state) + 1 :]) for j in places]
            )


# In the loop


@pytest.mark.parametrize(
    ("status", "off", "lost"), [("done", 1.0, False), ("done", 3.0, True), ("failed", 1.0, True)]
)
def test_numbers_of_a_model_in_the_loop(status, off, lost):
    t = np.arange(0.0, 100.0, 0.1)
    log = {
        "time": t,
        "vessel.x": 0.6 * off + t,
        "vessel.y": 0.8 * off - t,
        "guidance.x_t": t,
        "guidance.y_t": -t,
    }
    log["controller.z1_x"] = np.where(t < 49.9, 9.0, -0.3)
    found = model_loops.loop(FinishedRun({}, status=status, log=log))
    assert found.lost == lost
    assert found.position == pytest.approx(off if status == "done" else np.nan, nan_ok=True)
    assert found.lag == pytest.approx(-0.3)
    assert found.log["time"] == pytest.approx(np.arange(100.0))


def test_runs_have_the_model_in_the_plant_and_no_spikes():
    model = Model(vessel={"delta_X_u": -2.0}, thrusters={"loss_bow": 0.2})
    made = model_loops.contents({"a": model}, 30.0)
    assert set(made) == {f"a|{run}" for run in model_loops.RUNS}
    for key, content in made.items():
        fmus = content["fmus"]
        assert fmus["vessel"]["parameters"]["delta_X_u"] == -2.0
        assert fmus["thrusters"]["parameters"]["loss_bow"] == 0.2
        assert {fault["kind"] for fault in content["faults"]} == {"noise", "freeze"}
        assert content["stop"] == 30.0
        assert content["log"] == {"signals": model_loops.SIGNALS}
        assert ("eight" in key) == ("eight" in fmus["guidance"]["path"])
        assert (fmus["guidance"]["parameters"]["calls"] == 4.0) == ("fault" in key)
        controller = {"RBS": trials.RBS, "CLZ": trials.CLZ, "CLE": trials.CLE}[key[2:5]]
        assert fmus["controller"]["path"] == f"{controller}.fmu"
    assert model_loops.contents({"a": model}, None)["a|RBS, eight"]["stop"] == trials.TRIALS[1].seconds


def test_table_of_the_loops_has_what_is_lost(found, tmp_path, monkeypatch, drawn):
    t = np.arange(30.0)
    log = {n: np.sin(t) for n in ("time", *model_loops.SIGNALS)} | {"time": t}

    def run_all(todo, seeds, analyse, folder, jobs):
        assert ([*seeds], folder, jobs) == ([0], None, 3)
        return {
            key: [model_loops.LoopResult(9.0 if key == "PLS2|RBS, eight" else 0.25, -0.125, log)]
            for key in todo
        }

    monkeypatch.setattr(model_loops, "run_all", run_all)
    text = stated(tmp_path, model_loops.write_loops, found, 30.0, 3)
    assert (
        "| SYSID1 |  |  | 0.25 (-0.125) | 0.25 (-0.125) | 0.25 (-0.125) | 0.25 (-0.125) | 0.25 (-0.125) |"
        in text
    )
    row = next(line for line in text.splitlines() if line.startswith("| PLS2 |"))
    assert row.endswith("| 0.25 (-0.125) | lost, 9 (-0.125) |")
    check = "yes" if analysis.thrust_of(found["PLS2"]).holds else "no"
    assert row.startswith(f"| PLS2 | {model_loops.eigenvalues(found['PLS2'])} | {check} |")
    assert "| With PLS3 (SYSMV3; SYSMV4 in the caption)" in text
    assert "runs lost: PLS2 1 of 5, PLS3 0 of 5, PLS4 0 of 5. Force in X" in text
    loses, predicted = json.loads((tmp_path / "results.json").read_text("utf-8"))["loops"][-2:]
    assert loses["here"] is False
    assert predicted["here"] is (not analysis.thrust_of(found["PLS2"]).holds)
    assert set(drawn) == {
        *(f"loop_RBS_ellipse_fault_{what}" for what in ("tracks", "errors", "model_error")),
        *(f"loop_CLE_ellipse_{what}" for what in ("tracks", "errors", "model_error_and_estimate")),
        "loop_RBS_ellipse_tracks",
    }
    labels = [line.get_label() for line in drawn["loop_RBS_ellipse_tracks"][0].axes[0].get_lines()]
    assert labels == ["target", "SYSID4", "PLS2", "PLS3"]


# The report


def test_identification_stands_beside_what_is_hidden(tmp_path, monkeypatch):
    asked = []

    def identify(runs):
        asked.append(runs)
        k = len(asked)
        return SimpleNamespace(
            phi=np.array(sysid4.PHI) * k,
            condition=np.array([10.0, 20.0, 30.0]) * k,
            passes=k,
            settled=True,
            least_squares=np.arange(14.0) * k,
        )

    monkeypatch.setattr(analysis, "identify", identify)
    monkeypatch.setattr(
        analysis, "explained", lambda runs, phi: np.array([0.5, 0.25, phi[1] / sysid4.PHI[1]])
    )
    s, e = linear(), linear(0.01)
    text = stated(tmp_path, chapter7.identification, [("true states", s), ("eight", e)])
    assert asked == [[s], [e]]
    assert "| SysID has the main dynamics of the model error (7.2.4) | does not hold |" in text
    assert "here the eight (7.2.4) | does not hold |" in text
    assert "| coefficient | hidden | true states | eight |" in text
    assert "| N_r | -1.8 | -1.8 | -3.6 |" in text
    assert "| R² of ω Y |  | 0.2500 | 0.2500 |" in text
    assert "| R² of ω N |  | 1.0000 | 2.0000 |" in text
    assert "| condition number N |  | 30 | 60 |" in text
    assert "| delta_N, least squares | 0.31 | 13 | 26 |" in text
    assert "true states: 1 passes, eight: 2 passes." in text
    assert "largest condition number 60, of the ellipse true states 30 |" in text


def test_simulated_runs_have_every_part(found, tmp_path, monkeypatch, drawn):
    asked = []
    monkeypatch.setattr(analysis_tables, "regressions", lambda samples: found)
    monkeypatch.setattr(analysis_tables, "write_table_7_1", lambda *given: asked.append(given[1:]))
    monkeypatch.setattr(chapter7, "identification", lambda report, runs: asked.append(runs))
    s = linear(0.01)
    report = Report(tmp_path, "t")
    assert chapter7.simulated(report, s, [("true states", s)]) is found
    assert asked == [(s, "simulated"), [("true states", s)]]
    text = report.write().read_text("utf-8")
    for name, r in found.items():
        factors = r.by_axis("factors")["X"]
        assert (
            f"| {name} | {' | '.join(analysis_tables.shares(r))} | {factors} | {len(r.columns)} |"
            in text
        )
    for part in (
        "Principal components (7.3)",
        "4 components explain",
        "| Three factors suffice",
        "SYSID4 hidden",
    ):
        assert part in text
    assert {name.partition("_")[0] for name in drawn} == {"simulated"}


def test_real_runs_have_the_same_parts(found, tmp_path, monkeypatch, drawn):
    monkeypatch.setattr(concurrent_passes, "MOST", 1)
    s = linear(0.01)
    asked = []
    monkeypatch.setattr(chapter7, "measured_files", lambda data: [data / "a.mat"])
    monkeypatch.setattr(
        analysis, "gather_samples", lambda files, by: asked.append((files, by)) or analysis.by_run(s)
    )
    monkeypatch.setattr(analysis_tables, "regressions", lambda samples: found)
    text = stated(tmp_path, chapter7.measured, tmp_path)
    assert asked == [([tmp_path / "a.mat"], "smoothed")]
    assert "NTNU's runs run0, run1 in a row" in text
    assert "limits of Algorithm 4: 1 passes, not converged, the blocker" in text
    rows = [line for line in text.splitlines() if line.startswith("| PLS1 |")]
    assert rows[0].endswith("| – |")
    for part in ("4 components explain", "| Three factors suffice", "| least squares |"):
        assert part in text
    assert {name.partition("_")[0] for name in drawn} == {"measured"}
    assert {"measured_scatter", "measured_PLS2_X", "measured_table_7_1"} <= set(drawn)


def test_a_run_that_broke_off_ends_the_study():
    assert chapter7.folder(FinishedRun({}, folder="there")) == "there"
    with pytest.raises(Exception, match="why"):
        chapter7.folder(FinishedRun({}, status="failed", message="why"))


def test_the_study_runs_every_scenario_and_reads_what_lies_in_its_folder(tmp_path, monkeypatch):
    read, ran, stated = [], {}, []
    s = linear(0.01)

    def run_all(todo, seeds, analyse, logs, jobs, advance):
        for name in todo:
            where = logs / name / str(seeds[0])
            ran[where] = analyse(FinishedRun({}, folder=where))
            advance()

    monkeypatch.setattr(chapter7, "run_all", run_all)
    monkeypatch.setattr(chapter7, "true_samples", lambda run: read.append(run) or s)
    monkeypatch.setattr(chapter7.cosim, "read_log", read.append)
    monkeypatch.setattr(
        analysis, "gather_samples", lambda runs, by: read.extend(runs) or analysis.by_run(s)
    )
    monkeypatch.setattr(analysis_tables, "write_shapes", lambda *given: stated.append("shapes"))
    monkeypatch.setattr(chapter7, "write_replay", lambda *given: stated.append(given[1].parent.name))
    monkeypatch.setattr(analysis_tables, "write_eight", lambda *given: stated.append("eight"))
    monkeypatch.setattr(chapter7, "simulated", lambda *given: stated.append([n for n, _ in given[2]]))
    monkeypatch.setattr(chapter7, "write_loops", lambda *given: stated.append(given[2:]))
    monkeypatch.setattr(chapter7, "measured", lambda report, data: stated.append(data))
    chapter7.study(tmp_path, 9.0, 2, None)
    assert ran == {where: str(where) for where in read}
    quiet = ["true states", "smoothed", "mdf", "eight"]
    assert stated == ["shapes", "controller_cl_win_eps_eight", quiet, "eight", (9.0, 2)]
    chapter7.study(tmp_path, None, 2, tmp_path)
    assert stated[-1] == tmp_path
