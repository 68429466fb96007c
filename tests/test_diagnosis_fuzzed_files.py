"""Broken files: mutations of small measurements, each a result or one message, in bounded time."""

import json
import os
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from support.cse1 import FIVE
from support.measured import DATA, commands, needs_data

import diagnosis
from diagnosis import InputError
from diagnosis.runs.columns.columns import TAU

N = 120
MANY = int(os.environ.get("CYBERSHIP_FILES", "60"))
TIME = np.arange(N) * 0.1
WILD = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, -1e308, 1e-308, 1e15, 360.0]
WORDS = ["", "x", "1e400", "0x1", "1,5", '"', "NaN", "9" * 60, "true", "\0", "-", "1e"]


def _columns():
    """A run of 12 s: slow circles with a little noise, and commands that vary."""
    rng = np.random.default_rng(0)
    pose = np.column_stack([np.cos(0.2 * TIME), np.sin(0.2 * TIME), 0.2 * TIME + 1.6])
    pose += 5e-4 * rng.standard_normal(pose.shape)
    return {"time": TIME} | dict(zip(("x", "y", "psi", *TAU), [*pose.T, *commands(TIME).T], strict=True))


COLUMNS = _columns()
X = {"name": "x", "unit": "m", "flip": False, "offset": 0.0}
TEXT = {"encoding": "utf-8", "skip": 0, "units_line": False}
LAYOUT = {"separator": ",", **TEXT, "columns": {"x": X}}


@dataclass
class Fuzz:
    """Files in a folder, broken in ways that a seed chooses."""

    folder: object
    seed: int

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)

    def file(self):
        """A new file."""
        kind = self.rng.choice(["csv", "json", "parquet", "mat"])
        columns = self.cells() if self.rng.random() < 0.6 else dict(COLUMNS)
        path = self.folder / f"run{self.seed}.{'csv' if kind == 'json' else kind}"
        table = pd.DataFrame({name: pd.Series(values) for name, values in columns.items()})
        if kind == "mat":
            data = np.zeros((self.rng.choice([23, 14, 13, 0], p=[0.8, 0.1, 0.05, 0.05]), len(table)))
            for row, name in zip((0, 1, 2, 6, 7, 8, 9, 10, 11), [*COLUMNS, *FIVE], strict=False):
                if row < len(data) and name in table:
                    data[row] = pd.to_numeric(table[name], errors="coerce")
            savemat(path, {"cse1_data" if self.rng.random() < 0.95 else "other": data})
        elif kind == "parquet":
            table.map(str).to_parquet(path) if self.rng.random() < 0.05 else self.parquet(table, path)
        else:
            table.to_csv(path, index=False, sep=self.rng.choice([",", ";", "\t"], p=[0.9, 0.05, 0.05]))
        if kind == "json":
            beside = path.with_name(path.name + ".json")
            beside.write_bytes(self.bytes(json.dumps(self.layout()).encode()))
        elif self.rng.random() < 0.4:
            path.write_bytes(self.bytes(path.read_bytes()))
        return path

    def parquet(self, table, path):
        mixed = [c for c in table if table[c].dtype == object]
        table.astype(dict.fromkeys(mixed, str)).to_parquet(path)

    def cells(self):
        """Some columns changed in cells, as a whole, in order, or not there."""
        columns = {name: values.copy() for name, values in COLUMNS.items()}
        for _ in range(self.rng.integers(1, 4)):
            self.rng.choice([self.wild, self.scaled, self.exchanged, self.shuffled, self.shifted])(
                columns
            )
        last = self.rng.random()
        name, (start, stop) = self.name(columns), np.sort(self.rng.integers(0, N + 1, 2))
        if last < 0.1:
            del columns[name]
        elif last < 0.2:
            columns = {key: values[start:stop] for key, values in columns.items()}
        elif last < 0.3:
            columns[name] = columns[name].astype(object)
            columns[name][start % N] = self.rng.choice(WORDS)
        return columns

    def name(self, columns):
        return str(self.rng.choice(list(columns)))

    def wild(self, columns):
        """Some cells, or all, of a column."""
        start, stop = np.sort(self.rng.integers(0, N + 1, 2)) if self.rng.random() < 0.5 else (0, N)
        columns[self.name(columns)][start:stop] = self.rng.choice(WILD)

    def scaled(self, columns):
        columns[self.name(columns)] *= self.rng.choice([1e-300, 1e-6, 1e3, 1e9, 1e200, -1.0])

    def exchanged(self, columns):
        a, b = self.name(columns), self.name(columns)
        columns[a], columns[b] = columns[b].copy(), columns[a].copy()

    def shuffled(self, columns):
        name = self.name(columns)
        columns[name] = columns[name][self.rng.permutation(N)]

    def shifted(self, columns):
        columns[self.name(columns)][self.rng.integers(0, N)] += self.rng.choice([1e-9, 1.0, 1e4, 1e20])

    def layout(self):
        """Content of the file beside a run, something in it exchanged."""
        wild = [None, [], {}, "", "y", "mm", -1, 1e308, True, [[[[]]]], {"name": "y", "unit": "mm"}]
        layout = json.loads(json.dumps(LAYOUT))
        column = layout["columns"]["x"]
        part = [layout, layout["columns"], column][self.rng.integers(0, 3)]
        part[str(self.rng.choice([*part, "more", "psi"]))] = wild[self.rng.integers(0, len(wild))]
        return layout

    def bytes(self, content):
        """Bytes exchanged, deleted, inserted, repeated or nested."""
        data = bytearray(content)
        for _ in range(self.rng.integers(1, 6)):
            at = int(self.rng.integers(0, len(data) + 1))
            length = int(self.rng.integers(1, 40))
            match self.rng.integers(0, 6):
                case 0:
                    data[at : at + 1] = self.rng.bytes(1)
                case 1:
                    del data[at : at + length]
                case 2:
                    data[at:at] = self.rng.bytes(length)
                case 3:
                    data[at:at] = data[at : at + length]
                case 4:
                    del data[at:]
                case 5:
                    data[at:at] = self.rng.choice([b"[" * 20000, b"\n", b",", b'"', b"-", b"9" * 30])
        return bytes(data)


def outcome(path, anyway=False):
    """Whether a file gives a result; else its message is one line."""
    try:
        comparison = diagnosis.evaluate(diagnosis.gather([path], anyway=anyway))
    except InputError as error:
        message = str(error)
    else:
        message = ""
    assert "\n" not in message
    assert len(message.replace(f"{path.parent}/", "")) < 500
    if message:
        return False
    (evaluation,) = comparison.evaluations
    assert np.isfinite(evaluation.before.omega).all()
    return True


def judge(folder, seeds):
    found = [outcome(Fuzz(folder, seed).file()) for seed in seeds]
    assert 0.0 < np.mean(found) < 1.0, "both must happen"


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_broken_file_is_a_result_or_one_message(tmp_path):
    judge(tmp_path, range(20))


@pytest.mark.slow
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_many_broken_files(tmp_path):
    judge(tmp_path, range(20, MANY))


def run(tmp_path, **columns):
    pd.DataFrame(COLUMNS | columns).to_csv(tmp_path / "a.csv", index=False)
    return tmp_path / "a.csv"


@pytest.mark.parametrize("noise", [0.0, 1e-12, 5e-4])
def test_constant_speed_is_a_result(tmp_path, noise):
    still = noise * np.random.default_rng(1).standard_normal(N)
    constant = {"x": 0.2 * TIME + still, "y": still + 1.0, "psi": still}
    assert outcome(run(tmp_path, **constant, tau_X=0.5, tau_Y=0.0, tau_N=0.0), anyway=True)
    assert outcome(run(tmp_path, **constant), anyway=True)


@pytest.mark.parametrize("size", [1e9 + 1.0, 1e150, 1e308])
def test_commands_beyond_any_thruster_are_refused(tmp_path, size):
    with pytest.raises(InputError, match=r"commands reach .* N, more than any thruster gives"):
        diagnosis.gather([run(tmp_path, tau_X=size * COLUMNS["tau_X"] / COLUMNS["tau_X"].max())])


@pytest.mark.parametrize("size", [1e-300, 1e-5, 1e5])
def test_commands_of_any_other_size_are_a_result(tmp_path, size):
    assert outcome(run(tmp_path, tau_X=size * COLUMNS["tau_X"]), anyway=True)


def test_power_beyond_any_thruster_is_refused(tmp_path):
    shares = {name: np.sin(TIME + k) for k, name in enumerate(FIVE)}
    with pytest.raises(InputError, match=r"power reaches 1e\+300 times the full thrust"):
        diagnosis.gather([run(tmp_path, **shares, power_vsp=1e300, power_bow=1.0)])


def test_matrix_without_samples_is_refused(tmp_path):
    savemat(tmp_path / "a.mat", {"cse1_data": np.zeros((23, 0))})
    with pytest.raises(InputError, match="not a measured run: a matrix of shape"):
        diagnosis.gather([tmp_path / "a.mat"])


def test_deeply_nested_layout_is_refused(tmp_path):
    path = run(tmp_path)
    path.with_name("a.csv.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match="nested too deeply"):
        diagnosis.gather([path])


@pytest.mark.parametrize(
    ("time", "message"),
    [
        (1e-6 * np.arange(10_000_000, 10_000_000 + N * 100_000, 100_000) ** 1.0 * 1e9, "too rare"),
        (np.append(TIME[:-1], 1e300), "a time stamp is wrong"),
        (np.append(np.arange(N - 1) * 1e-6, 10.0), "too frequent"),
    ],
)
def test_clock_that_no_run_has_is_refused(tmp_path, time, message):
    with pytest.raises(InputError, match=message):
        diagnosis.gather([run(tmp_path, time=time)])


def test_bursts_of_samples_are_refused(tmp_path):
    time = np.cumsum(np.where(np.arange(N) % 10 == 0, 2.9, 2e-4))
    with pytest.raises(InputError, match=r"come in bursts, 0\.0002 s apart and 0\.268 s on average"):
        diagnosis.gather([run(tmp_path, time=time, x=0.1 * time, y=0.05 * time)])


def test_column_that_is_there_twice_is_refused(tmp_path):
    path = run(tmp_path)
    table = pd.read_csv(path)
    twice = pd.concat([table, table["x"] + 1.0], axis=1)
    twice.to_csv(path, index=False)
    for measurement in (path, twice):
        with pytest.raises(InputError, match="has the column 'x' more than once"):
            diagnosis.load([measurement])


def test_singular_equations_are_told_as_a_matter_of_the_data(tmp_path, monkeypatch):
    runs = diagnosis.gather([run(tmp_path)])

    def singular(*_):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("diagnosis.session.evaluate_runs", singular)
    with pytest.raises(InputError, match="do not determine the requested values: Singular matrix"):
        diagnosis.evaluate(runs)


@needs_data
@pytest.mark.slow
def test_runs_of_another_ship_are_refused_or_a_result(tmp_path):
    """The tanker's rudder [deg] as a moment is more than thrusters give; nothing of it fits in any case."""
    columns = {"time": "t", "psi": {"name": "psi_deg", "unit": "deg"}, "tau_N": "rudder_deg"}
    columns |= {"tau_X": "none", "tau_Y": "none"}
    table = pd.read_csv(DATA / "kvlcc2_hsva" / "z_35_05.csv").assign(none=0.0)
    table.to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": columns}))
    assert not outcome(tmp_path / "a.csv")
    assert outcome(tmp_path / "a.csv", anyway=True)
