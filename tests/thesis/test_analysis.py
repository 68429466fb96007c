"""PCA, PLS and the organisation of data, chapter 3: identities, scikit-learn, brute force."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cosim import InputError
from diagnosis.report.document import numbers
from diagnosis.report.formatting import number
from thesis.analysis import analysis_figures, pls_report
from thesis.analysis import organisation as org
from thesis.analysis import partial_least_squares as pls
from thesis.analysis import principal_components as pc
from thesis.analysis.outlier_report import analyse, sentences
from thesis.analysis.page_figure import SVG, figure_of
from thesis.analysis.recipes import RECIPES, recipe
from thesis.analysis.samples import NU, TAU, Samples, model_error

NAMES = list("abcdef")


def low_rank(n=400, m=6, rank=3, seed=0, noise=0.1):
    rng = np.random.default_rng(seed)
    return (
        rng.normal(size=(n, rank)) @ rng.normal(size=(rank, m)) + noise * rng.normal(size=(n, m)) + 5.0
    )


def made(n=1600, seed=0, law=None):
    """Samples whose model error is a law of velocity and force, with a little noise."""
    rng = np.random.default_rng(seed)
    nu = rng.normal(size=(n, 3)) * (0.1, 0.05, 0.2)
    tau = rng.normal(size=(n, 3)) * (0.5, 1.0, 0.5)
    omega = 0.01 * rng.normal(size=(n, 3)) + (law(nu, tau) if law else nu @ rng.normal(size=(3, 3)))
    return Samples(np.full(n, "made", dtype=object), 0.1 * np.arange(n), nu, 0.0 * nu, tau, omega)


class TestComponents:
    def test_scores_are_orthogonal_and_data_is_scores_times_loadings_plus_residual(self):
        X = low_rank()
        m = pc.fit_components(X, NAMES, 3)
        T, P = m.scores(X), m.loadings[:, :3]
        G = T.T @ T
        assert np.allclose(G, np.diag(np.diag(G)), atol=1e-8 * G.max())
        assert np.allclose(P.T @ P, np.eye(3))
        standard = (X - m.mean) / m.scale
        assert np.allclose(standard, T @ P.T + m.residuals(X))
        assert np.allclose(m.residuals(X) @ P, 0.0, atol=1e-9)
        assert m.q(X).sum() + np.sum(T**2) == pytest.approx(np.sum(standard**2))
        assert m.variance[:3] == pytest.approx(T.var(axis=0, ddof=1))

    def test_as_scikit_learn_and_nipals(self):
        decomposition = pytest.importorskip("sklearn.decomposition")
        X = low_rank(seed=1)
        m = pc.fit_components(X, NAMES, 2)
        Z = (X - m.mean) / m.scale
        other = decomposition.PCA().fit(Z)
        assert m.variance == pytest.approx(other.explained_variance_)
        assert np.abs(m.loadings.T) == pytest.approx(np.abs(other.components_), abs=1e-9)
        t = Z[:, 0]
        for _ in range(500):  # NIPALS
            p = Z.T @ t / (t @ t)
            p /= np.linalg.norm(p)
            t = Z @ p
        assert np.abs(p) == pytest.approx(np.abs(m.loadings[:, 0]), abs=1e-9)

    def test_limits_keep_their_rate_on_gaussian_samples(self):
        rng = np.random.default_rng(2)
        mix = rng.normal(size=(9, 9)) * np.linspace(2.0, 0.2, 9)[:, None]
        X = rng.normal(size=(100_000, 9)) @ mix
        m = pc.fit_components(X, list("abcdefghi"))
        assert np.mean(m.t2(X) > m.t2_limit) == pytest.approx(0.01, abs=0.001)
        # Jackson and Mudholkar approximate; of a few uneven variances they are on the safe side.
        assert np.mean(m.q(X) > m.q_limit) == pytest.approx(0.01, abs=0.003)
        four = pc.fit_components(X, list("abcdefghi"), 4)
        assert four.t2_limit == pytest.approx(stats.chi2.ppf(0.99, 4), rel=1e-3)

    def test_injected_spikes_are_removed_and_hardly_anything_else(self):
        X = low_rank(5000, seed=3)
        rng = np.random.default_rng(4)
        spikes = rng.choice(5000, 25, replace=False)
        X[spikes, rng.integers(0, 6, 25)] += 10.0 * X.std(axis=0).max()
        m = pc.fit_components(X, NAMES, 3)
        bad = pc.outliers(m, X)
        assert bad[spikes].all()
        assert np.mean(np.delete(bad, spikes)) < 0.02
        listed = pc.removals(m, X, NAMES, np.zeros(5000))
        assert sum(r.last - r.first + 1 for r in listed) == bad.sum()

    @pytest.mark.parametrize(("kind", "why"), [("inside", "Q"), ("outside", "T2")])
    def test_either_limit_makes_an_outlier(self, kind, why):
        """A sample off the plane but near its middle, and one on the plane but far out."""
        X = low_rank(2000, seed=7)
        m = pc.fit_components(X, NAMES, 3)
        size = 30.0 * np.sqrt(m.variance)
        z = size[5] * m.loadings[:, 5] if kind == "inside" else size[0] * m.loadings[:, 0]
        sample = (m.mean + m.scale * z)[None, :]
        beyond = {"T2": m.t2(sample)[0] > m.t2_limit, "Q": m.q(sample)[0] > m.q_limit}
        assert beyond == {"T2": why == "T2", "Q": why == "Q"}
        assert pc.outliers(m, sample).tolist() == [True]
        (one,) = pc.removals(m, sample, NAMES, np.zeros(1))
        assert one.why == why
        assert pc.outliers(m, m.mean[None, :]).tolist() == [False]

    def test_limit_of_q_also_where_one_variance_left_out_stands_out(self):
        """h0 is negative there; the limit still holds back one good sample in a hundred or fewer."""
        variances = np.array([3.5, 2.6, *[0.414] * 7])
        m = pc.PrincipalComponents(np.zeros(9), np.ones(9), np.eye(9), variances, 10_000, 1)
        X = np.random.default_rng(8).normal(size=(100_000, 9)) * np.sqrt(variances)
        assert 0.003 < np.mean(m.q(X) > m.q_limit) < 0.012

    def test_validated_share_by_brute_force(self):
        X = low_rank(80, seed=5)
        found = pc.validated(X, NAMES, blocks=4)
        for a in (1, 3, 6):
            press = total = 0.0
            for k in range(4):
                test, rest = X[20 * k : 20 * k + 20], np.delete(X, np.s_[20 * k : 20 * k + 20], axis=0)
                m = pc.fit_components(rest, NAMES, min(a, 5))
                Z = (test - m.mean) / m.scale
                P = m.loadings[:, :a]
                press += np.sum((Z - Z @ P @ P.T) ** 2)
                total += np.sum(Z**2)
            assert found[a - 1] == pytest.approx(1.0 - press / total)

    def test_constant_columns_and_too_few_samples_are_told(self):
        X = low_rank()
        X[:, 2] = 3.0
        with pytest.raises(InputError, match=r"constant.*: c$"):
            pc.fit_components(X, NAMES)
        with pytest.raises(InputError, match="too few"):
            pc.fit_components(low_rank(8), NAMES)
        with pytest.raises(InputError, match="1 to 5"):
            pc.fit_components(low_rank(), NAMES, 6)


class TestBases:
    BASES = (org.NominalBins, org.ContinuousNominal)

    @pytest.mark.parametrize("basis", BASES)
    def test_sums_to_one_also_outside_of_the_range(self, basis):
        x = np.linspace(-0.5, 0.5, 1001)[:, None]
        t = basis(["u"]).fit(x)
        assert t.transform(x).sum(axis=1) == pytest.approx(1.0)
        assert t.transform(x).shape[1] == len(t.get_feature_names_out())
        assert t.clipped_ == pytest.approx([(np.mean((x < -0.02) | (x > 0.3)))])

    def test_triangles_interpolate_at_their_nodes(self):
        s = org.TABLE_1["u"]
        nodes = org.ContinuousNominal.centres(s)
        assert nodes.size == s.resolution + 1 == 11
        assert org.ContinuousNominal.basis(nodes, s) == pytest.approx(np.eye(11), abs=1e-12)
        x = np.linspace(s.low, s.high, 57)
        assert org.ContinuousNominal.basis(x, s) @ nodes == pytest.approx(x)

    def test_ranges_are_those_of_table_1_with_the_limits_of_y_in_order(self):
        low, high, parts = zip(*org.TABLE_1.values(), strict=True)
        assert [*org.TABLE_1] == [*("x", "y", "psi"), *NU, *(f"{n}_dot" for n in NU), *TAU]
        assert low == (3.5, -2.5, -np.pi, -0.02, -0.15, -0.4, -0.02, -0.02, -0.1, -1.2, -3.8, -2.0)
        assert high == (6.5, 2.5, np.pi, 0.3, 0.15, 0.4, 0.1, 0.02, 0.1, 1.2, 3.8, 2.0)
        assert parts == (10,) * 6 + (5, 5, 3) + (5,) * 3

    def test_bins_of_the_printed_example(self):
        """(3.18), corrected: ten bins of [0, 10]."""
        s = org.StateRange(0.0, 10.0, 10)
        found = org.NominalBins.basis(np.array([0.5, 3.2, 9.9, 10.0, 12.0, -1.0]), s)
        assert found.shape == (6, 10)
        assert found.argmax(axis=1).tolist() == [0, 3, 9, 9, 9, 0]

    def test_quadratic_extension_of_the_velocity_is_that_of_7_14(self):
        t = RECIPES["PLS2"].transformer()
        names = [str(n) for n in t.get_feature_names_out()]
        assert names == [*NU, *TAU, "|u|u", "|u|v", "|u|r", "|v|v", "|v|r", "|r|r", "|r|v"]
        x = np.array([[0.1, -0.2, -0.3, 1.0, 2.0, 3.0]])
        assert t.fit_transform(x)[0, 6:] == pytest.approx(
            [0.01, -0.02, -0.03, -0.04, -0.06, -0.09, -0.06]
        )

    def test_transformers_work_in_a_pipeline_and_a_grid_search(self):
        base = pytest.importorskip("sklearn.base")
        pipeline = pytest.importorskip("sklearn.pipeline")
        cross = pytest.importorskip("sklearn.cross_decomposition")
        s = made()
        for t in (RECIPES["PLS3"].transformer(), org.ContinuousNominal([*NU, *TAU])):
            pipe = pipeline.make_pipeline(base.clone(t), cross.PLSRegression(2)).fit(s.x, s.omega)
            assert pipe.predict(s.x).shape == s.omega.shape


class TestPls:
    def test_scores_are_orthogonal_and_x_is_scores_times_loadings_plus_residual(self):
        s = made()
        found = pls.regressed(s, recipe("PLS2"))
        m = found.parts[0].model
        Z, P = m.x_scores_, m.x_loadings_
        G = Z.T @ Z
        assert np.allclose(G, np.diag(np.diag(G)), atol=1e-6 * G.max())
        X = (found.X - found.X.mean(axis=0)) / found.X.std(axis=0, ddof=1)
        assert np.abs(Z.T @ (X - Z @ P.T)).max() < 1e-6 * np.abs(G).max(), (
            "E is orthogonal to the scores"
        )
        assert found.predicted == pytest.approx(m.predict(found.X))

    def test_all_factors_give_least_squares(self):
        s = made()
        law = recipe("PLS2")
        X = law.transformer().fit_transform(s.x)
        full = pls.regression(X, s.omega, X.shape[1])
        c, B = pls.plain(full)
        A = np.column_stack([np.ones(len(X)), X])
        beta = np.linalg.lstsq(A, s.omega, rcond=None)[0]
        assert c == pytest.approx(beta[0], abs=1e-8)
        assert pytest.approx(beta[1:].T, rel=1e-6, abs=1e-8) == B

    def test_a_hidden_map_is_found(self):
        B = np.array([[-2.0, 0, 0, -0.3, 0, 0], [0, 0, 1.5, 0, 0, 0], [0, 0, -1.0, 0, 0, -0.3]])
        s = made(law=lambda nu, tau: np.hstack([nu, tau]) @ B.T)
        found = pls.regressed(s, replace(recipe("PLS2"), factors=None, most=13))
        assert found.B[:, :6] == pytest.approx(B, abs=0.05)
        assert min(found.by_axis("q2").values()) > 0.9

    def test_validated_share_by_brute_force(self):
        s = made(n=400)
        law = recipe("PLS3")
        X = law.transformer().fit_transform(s.x)
        press = pls.press(X, s.omega, 3, blocks=4)
        for a in (1, 3):
            error = 0.0
            for k in range(4):
                test = np.arange(100 * k, 100 * k + 100)
                rest = np.setdiff1d(np.arange(400), test)
                m = pls.regression(X[rest], s.omega[rest], a)
                error = error + np.sum((s.omega[test] - m.predict(X[test])) ** 2, axis=0)
            assert press[a - 1] == pytest.approx(error)

    def test_sign_changes_are_counted_by_folds(self):
        """A coefficient whose sign the folds agree on, and one that is noise."""
        rng = np.random.default_rng(9)
        X = rng.normal(size=(800, 3))
        y = np.column_stack([X[:, 0], -X[:, 0], X[:, 0]]) + 0.1 * rng.normal(size=(800, 3))
        y[:, 2] += np.where(np.arange(800) < 100, -9.0, 1.0) * X[:, 1]  # one fold lacks what turns it
        found = pls.fitted(X, y, (0, 1, 2), replace(recipe("PLS2"), factors=3))
        each = np.array([pls.plain(f)[1] for f in pls.folds(X, y, 3)])
        assert found.sign_changes[:2, 0].tolist() == [0, 0]
        assert found.B[1, 0] < 0.0 < found.B[0, 0]
        assert found.B[2, 1] < 0.0, "of all blocks together"
        assert found.sign_changes[2, 1] == (each[:, 2, 1] > 0.0).sum() == 1

    def test_fewest_factors_that_are_as_good_as_the_best(self):
        error = np.array([[9.0, 1.0], [5.0, 1.0], [4.0, 1.0], [3.99, 1.0], [6.0, 1.0]])
        assert pls.enough(error) == 3, "0.2 % above the best is as good"
        assert pls.enough(error[::-1]) == 2
        assert pls.enough(np.array([[1.0], [2.0], [3.0]])) == 1
        assert pls.enough(np.array([[3.0], [2.0], [1.0]])) == 3

    def test_factors_are_counted_where_the_recipe_does_not_say(self):
        """Of columns that are equally large and uncorrelated one factor makes the whole prediction."""
        rng = np.random.default_rng(2)
        X = rng.normal(size=(2000, 5))
        y = X[:, :1] + rng.normal(size=(2000, 1))
        free = replace(recipe("PLS2"), factors=None, most=5)
        assert pls.fitted(X, y, (0,), free).factors == 1
        assert pls.fitted(X, y, (0,), replace(free, factors=4)).factors == 4

    def test_explained_share_by_factors_is_that_of_each_regression(self):
        s = made(n=400)
        found = pls.fitted(s.x, s.omega, (0, 1, 2), replace(recipe("PLS2"), factors=4))
        for a in (1, 3, 4):
            guess = pls.regression(s.x, s.omega, a).predict(s.x)
            left = np.sum((s.omega - guess) ** 2, axis=0)
            r2 = 1.0 - left / np.sum((s.omega - s.omega.mean(axis=0)) ** 2, axis=0)
            assert found.r2_by_factors[a - 1] == pytest.approx(r2)
        assert found.r2 == pytest.approx(found.r2_by_factors[3])

    def test_separate_regressions_stand_side_by_side(self):
        found = pls.regressed(made(), recipe("PLS4"))
        assert len(found.parts) == 3
        assert found.B.shape == (3, 10)
        assert all(f <= 3 for f in found.by_axis("factors").values())

    def test_columns_of_ranges_are_told_how_much_they_clip(self):
        found = pls.regressed(made(), recipe("continuous"))
        assert set(found.clipped) == {*NU, *TAU}
        assert found.clipped["u"] > 0.05

    def test_a_missing_library_is_told_with_its_line_for_pip(self, monkeypatch):
        import sys

        monkeypatch.setitem(sys.modules, "sklearn.base", None)
        monkeypatch.delitem(sys.modules, "thesis.analysis.organisation")
        with pytest.raises(InputError, match=r"pip install 'cybership\[analysis\]'"):
            recipe("PLS3").transformer()

    def test_bad_input_is_told(self):
        with pytest.raises(InputError, match="no recipe 'PLS9'"):
            recipe("PLS9")
        s = made()
        s.tau[:, 1] = 0.0
        with pytest.raises(InputError, match=r"constant.*tau_Y"):
            pls.regressed(s, recipe("PLS2"))
        with pytest.raises(InputError, match="too few"):
            pls.regressed(made(n=100), recipe("PLS2"))


def test_a_regression_is_told_in_sentences():
    B = np.array([[-2.0, 0, 0, -0.3, 0, 0], [0, 0, 1.5, 0, 0, 0], [0, 0, -1.0, 0, 0, -0.3]])
    found = pls.regressed(made(law=lambda nu, tau: np.hstack([nu, tau]) @ B.T), recipe("PLS3"))
    first, *rest = pls_report.sentences(found)
    assert first.startswith("PLS3, 1600 samples, ")
    for axis in "XYN":
        assert f"{axis}: {number(found.by_axis('r2')[axis])} / " in first
    assert first.endswith("by 3 factors.")
    assert "Coefficients less than two standard deviations from zero" in " ".join(rest)
    assert pls_report.thrust_of(found).sentence in rest
    page = pls_report.document(found, "an observer")
    fit, *parts = page.sections
    assert (page.lead, fit.text, page.provenance["estimates"]) == (first, rest, "an observer")
    for part, section in zip(found.parts, parts, strict=True):
        factors, coefficients = section.tables
        assert [row[1] for row in factors.rows] == numbers([q[0] for q in part.by_factors], 4)
        assert [row[0] for row in coefficients.rows] == [*found.columns]
        for row, value in zip(coefficients.rows, part.B[0], strict=True):
            assert row[1].startswith(f"{number(value)} ± ")
        stated = [" of other sign" in row[1] for row in coefficients.rows]
        assert stated == [bool(n) for n in part.sign_changes[0]]
        points, names = pls_report.correlations(found, part)
        both = np.column_stack([found.X, found.samples.omega[:, part.axes]])
        scores = part.model.transform(found.X)[:, :2]
        count = both.shape[1]
        assert points == pytest.approx(np.corrcoef(both.T, scores.T)[:count, count:])
        assert names == [*found.columns, *(f"omega_{'XYN'[k]}" for k in part.axes)]
    clipped = list(pls_report.sentences(pls.regressed(made(), recipe("continuous"))))
    assert "Outside of the ranges of Table 1, and clipped: u " in " ".join(clipped)


def test_pictures_of_the_analysis_hold_what_they_are_given():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 50))
    (panel,) = analysis_figures.cloud(a, b, ("t1", "t2")).axes
    assert (panel.get_lines()[0].get_ydata() == b).all()
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("t1", "t2")
    (panel,) = analysis_figures.loadings(np.eye(2), ["omega_X", "u"], "p").axes
    assert [text.get_text() for text in panel.texts] == ["omega_X", "u"]
    nu, kept = rng.normal(size=(50, 3)), np.arange(50) != 7
    top = analysis_figures.before_and_after(nu, kept).axes[0]
    drawn = {line.get_label(): line for line in top.get_lines()}
    assert drawn["removed"].get_xdata().tolist() == [7]
    assert drawn["kept"].get_xdata().size == 49
    assert (drawn["kept"].get_ydata() == nu[kept, 0]).all()


def test_pictures_of_a_regression_hold_what_they_are_given():
    r2, q2 = np.array([0.5, 0.75, 0.8]), np.array([0.4, 0.7, 0.6])
    (panel,) = analysis_figures.share_of_variance(r2, q2, 2, "factors").axes
    explained, validated, kept = panel.get_lines()
    assert (explained.get_label(), validated.get_label()) == ("R²", "Q²")
    assert explained.get_xdata().tolist() == validated.get_xdata().tolist() == [1, 2, 3]
    assert explained.get_ydata() == pytest.approx(100.0 * r2)
    assert validated.get_ydata() == pytest.approx(100.0 * q2)
    assert list(kept.get_xdata()) == [2, 2]
    assert (panel.get_xlabel(), panel.get_xticks().tolist()) == ("factors", [1, 2, 3])
    (panel,) = analysis_figures.coefficient_bars(
        np.array([1.0, -2.0]), np.array([0.1, 0.2]), ["u", "r"], "Y"
    ).axes
    assert [bar.get_height() for bar in panel.patches] == [1.0, -2.0]
    assert [text.get_text() for text in panel.get_xticklabels()] == ["u", "r"]
    (spread,) = panel.collections
    assert [path.vertices[:, 1].tolist() for path in spread.get_paths()] == [[0.9, 1.1], [-2.2, -1.8]]
    assert panel.get_ylabel() == "coefficient, ω Y"


def test_a_spike_is_drawn_however_many_samples_there_are():
    values = np.full(100 * analysis_figures.POINTS, 0.5)
    values[12345], values[70:100] = 80.0, 0.0
    (panel,) = analysis_figures.against_limit(values, 12.5, "T²").axes
    points, limit = panel.get_lines()
    assert points.get_xdata().size == analysis_figures.POINTS
    assert points.get_xdata()[points.get_ydata() > 1.0].tolist() == [12345]
    assert points.get_ydata().min() > 0.0, "the scale is logarithmic"
    assert list(limit.get_ydata()) == [12.5, 12.5]
    assert (limit.get_label(), panel.get_yscale(), panel.get_ylabel()) == (
        "99 % limit 12.5",
        "log",
        "T²",
    )


def test_model_errors_are_drawn_by_axis_with_a_colour_for_each_model():
    time = np.arange(2.0 * analysis_figures.POINTS)
    measured = np.column_stack([time, 2.0 * time, 3.0 * time])
    models = {name: measured + k for k, name in enumerate("abc")}
    panels = analysis_figures.model_error_over_time(measured, models, time).axes
    for k, panel in enumerate(panels):
        omega, *rest = panel.get_lines()
        rows = omega.get_xdata()
        assert rows.size == analysis_figures.POINTS
        assert (rows[0], rows[-1]) == (0, time.size - 1)
        assert (omega.get_label(), [line.get_label() for line in rest]) == ("ω", ["a", "b", "c"])
        assert len({line.get_color() for line in (omega, *rest)}) == 4
        assert omega.get_ydata() == pytest.approx(measured[rows, k])
        assert rest[2].get_ydata() == pytest.approx(measured[rows, k] + 2.0)
    assert [panel.get_ylabel() for panel in panels] == ["ω X [N]", "ω Y [N]", "ω N [N·m]"]
    assert panels[-1].get_xlabel() == "sample"


def test_remark_where_the_validated_share_exceeds_the_explained_one():
    def said(block):
        """Samples of which one block varies far more in the direction that is explained."""
        s = made(n=1600)
        s.nu[:block] *= 4.0
        s.omega[:] = s.nu * (1.0, 1.0, 1.0) + 1e-4 * np.random.default_rng(0).normal(size=s.nu.shape)
        a = analyse([s])
        return "Q² exceeds R²" in " ".join(sentences(a)), (a.q2 > a.model.explained).any()

    assert said(200) == (True, True)
    assert said(0) == (False, False)


def test_model_error_of_the_control_model_is_the_rotational_damping():
    """(7.7): with the true plant of Table 2.1, omega is what (2.27) leaves out."""
    from fmus.hull import (
        Damping,
        Hull,
        Inertia,
        RotationalDamping,
        inverse_mass,
        motion,
        rotational_damping_force,
    )
    from fmus.signals import Force

    rng = np.random.default_rng(6)
    nu, tau = rng.normal(size=(20, 3)) * 0.1, rng.normal(size=(20, 3))
    hull = Hull(Inertia(), inverse_mass(Inertia()), Damping())
    nu_dot = np.array([motion(*n, Force(*f), hull) for n, f in zip(nu, tau, strict=True)])
    expected = [rotational_damping_force(v, r, RotationalDamping()) for _, v, r in nu]
    assert model_error(nu, nu_dot, tau) == pytest.approx(np.array(expected), abs=1e-9)


def test_a_figure_of_a_page_refers_to_its_own_parts_alone():
    """Clips and markers by ids with its key; two figures of a page have no id in common."""
    ids = []
    for key in ("one", "two"):
        figure = figure_of(2.0)
        figure.subplots().plot([0.0, 1.0, 2.0], [0.123456, 1.0, 3.0], marker="o")
        text = figure.svg(key, "a line")
        there = set(re.findall(r' id="([^"]+)"', text))
        asked = {*re.findall(r"url\(#([^)]+)\)", text), *re.findall(r'href="#([^"]+)"', text)}
        assert asked == there
        assert len(asked) > 1
        assert all(name.startswith(f"{key}-") for name in there)
        assert text.startswith(f'<svg xmlns="{SVG}"')
        assert (' role="img"' in text, ' aria-label="a line"' in text, "metadata" in text) == (
            True,
            True,
            False,
        )
        assert not re.search(r' d="[^"]*\.\d{3}', text), "two digits of a point"
        ids.append(there)
    assert not ids[0] & ids[1]
