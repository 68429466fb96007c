"""The cases: one command line each, with files in the folder that ``make`` writes."""

from typing import NamedTuple


class Cell(NamedTuple):
    """A problem of the benchmark of hidden effects, of which the first seconds are kept.

    Attributes:
        effects: ids of what is hidden.
        noise: n1, n4 or n10.
        wrong: whether the plant's coefficients are up to 10 % wrong.
        seconds: of each run.
    """

    effects: tuple[str, ...]
    noise: str
    wrong: bool
    seconds: float = 120.0


CELLS = {
    "X_u": Cell(("X_u",), "n1", False),
    "N_r": Cell(("N_r",), "n4", True),
    "loss_yaw": Cell(("loss_yaw",), "n4", False),
    "bow_failure": Cell(("bow_failure",), "n1", False, 240.0),
    "current": Cell(("current",), "n4", True),
    "delay": Cell(("delay",), "n1", False),
    "mass": Cell(("mass",), "n10", True),
    "heading_offset": Cell(("heading_offset",), "n1", True),
    "curve": Cell(("curve_vsp_x(c)",), "n1", False),
    "none": Cell((), "n4", True),
    "pair": Cell(("X_u", "N_r"), "n1", True),
    "tether": Cell(("tether",), "n4", False),
    "outages": Cell(("bow_outage at other times",), "n1", False, 240.0),
    "process_noise": Cell(("X_u in process noise",), "n1", True),
}


class Described(NamedTuple):
    """Three runs of a described ship by :mod:`benchmarks.ship_effects`: its cause, and its model."""

    ship: str
    cause: str
    wrong: bool


DESCRIBED = {
    "otter_loss": Described("otter", "loss", False),
    "otter_wind": Described("otter", "wind", True),
    "otter_none": Described("otter", "none", True),
    "cybership2_drag": Described("cybership2", "drag", False),
    "cybership2_lag": Described("cybership2", "lag", True),
    "kvlcc2_current": Described("kvlcc2", "current", False),
    "kvlcc2_drag": Described("kvlcc2", "drag", True),
    "gunnerus_loss": Described("gunnerus", "loss", True),
}
SPOILT = ("two_runs", "tau_mN", "outliers_5")  # ways of benchmarks.spoilt_files
FAULTS = ("clock slow", "rate in degrees", "heading axis")  # of benchmarks.sensor_faults
MEASURED = "measured"  # folder of what is made of public measurements


def _cell(name: str, train: str, options: str, test: bool = True) -> str:
    runs = " ".join(f"cells/{name}/run{k}.csv" for k in train)
    held_out = f" --test cells/{name}/run4.csv" if test else ""
    return f"learn {runs}{held_out} {options}"


def _described(name: str, options: str, train: str = "12", test: bool = True) -> str:
    runs = " ".join(f"ships/{name}/run{k}.csv" for k in train)
    held_out = f" --test ships/{name}/run3.csv" if test else ""
    return f"learn {runs}{held_out} --ship {DESCRIBED[name].ship} {options}"


# Name -> command and its arguments.
CASES = {
    "X_u": _cell("X_u", "13", "--prior 0"),
    "X_u_sindy": _cell("X_u", "13", "--prior 0 --method sindy"),
    "X_u_pls": _cell("X_u", "12", "--prior 0 --method pls"),
    "N_r": _cell("N_r", "23", "--prior 0.1"),
    "loss_yaw_three_runs": _cell("loss_yaw", "123", "--prior 0"),
    "bow_failure": _cell("bow_failure", "13", "--prior 0"),
    "current": _cell("current", "12", "--prior 0.1"),
    "delay_one_run": _cell("delay", "3", "--prior 0", test=False),
    "mass": _cell("mass", "13", "--prior 0.1"),
    "heading_offset_no_test": _cell("heading_offset", "12", "--prior 0.1", test=False),
    "curve": _cell("curve", "13", "--prior 0"),
    "none_own_effects": _cell("none", "13", "--prior 0.1 --effects own_effects.py"),
    "pair": _cell("pair", "23", "--prior 0.1"),
    "tether_four_runs": _cell("tether", "1234", "--prior 0", test=False),
    "outages": _cell("outages", "12", "--prior 0"),
    "process_noise_three_runs": _cell("process_noise", "123", "--prior 0.1"),
    "otter_loss": _described("otter_loss", "--prior 0"),
    "otter_wind": _described("otter_wind", "--prior 0.1"),
    "otter_none_one_run": _described("otter_none", "", train="1"),
    "cybership2_drag": _described("cybership2_drag", "--prior 0"),
    "cybership2_lag": _described("cybership2_lag", "--prior 0.1"),
    "kvlcc2_current": _described("kvlcc2_current", "--prior 0"),
    "kvlcc2_drag_three_runs": _described("kvlcc2_drag", "", train="123", test=False),
    "gunnerus_loss": _described("gunnerus_loss", "--prior 0.1"),
    "cse1_measured": "learn measured/run1.mat --test measured/random_run1.mat",
    "cse1_measured_two_runs": (
        "learn measured/run1.mat measured/random_run1.mat --test measured/dptest1.mat"
    ),
    "cse1_measured_priors": (
        "learn measured/dptest1.mat --test measured/run1.mat --prior mass=0.01,thrust=0.5"
    ),
    "kvlcc2_measured": (
        "learn measured/z_10_10_p.csv measured/z_10_10_s.csv --test measured/z_20_10_p.csv --ship kvlcc2"
    ),
    "kvlcc2_measured_thrust": (
        "learn measured/z_20_10_p.csv --test measured/z_10_10_s.csv --ship kvlcc2 --fit propeller.thrust"
    ),
    "gunnerus_measured": (
        "learn measured/circle.csv measured/zigzag.csv --test measured/starboard.csv"
        " --ship gunnerus --horizon 60 --anyway"
    ),
    "fmu_drag": "learn fmu/drag1.csv --test fmu/drag2.csv --model fmu/vendor.fmu",
    "fmu_none": "learn fmu/none1.csv fmu/none2.csv --model fmu/vendor.fmu",
    "compare_clock_slow": "compare faults/clock_slow.csv",
    "compare_rate_in_degrees": "compare faults/rate_in_degrees.csv",
    "compare_heading_axis": "compare faults/heading_axis.csv",
    "compare_two_runs": "compare spoilt/two_runs.csv",
    "compare_tau_mN": "compare spoilt/tau_mN.csv",
    "compare_outliers_5": "compare spoilt/outliers_5.csv",
    "compare_fmu": "compare fmu/drag1.csv fmu/none1.csv --model fmu/vendor.fmu",
    "compare_kvlcc2_trial": "compare measured/z_20_10_s.csv --ship kvlcc2",
    "compare_cse1_measured": "compare measured/run1.mat",
    "compare_otter": "compare ships/otter_wind/run1.csv ships/otter_wind/run2.csv --ship otter",
    "compare_cybership2": "compare ships/cybership2_lag/run1.csv --ship cybership2",
    "compare_gunnerus_horizon": "compare measured/circle.csv --ship gunnerus --horizon 60",
    "compare_log": "compare log",
    "compare_own_names": "compare own_names.csv --horizon 20",
    "compare_parquet_model": "compare X_u.parquet cells/X_u/run2.csv --model hidden.ssv --anyway",
}
