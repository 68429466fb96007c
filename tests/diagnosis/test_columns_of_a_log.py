"""The columns of a run for the calibration of an FMU: of a file, or of the log in a folder."""

import numpy as np
import pandas as pd
import pytest

from diagnosis.fmu_parameters.measured_system import columns_of

TABLE = pd.DataFrame({"time": np.arange(3.0), "ship.x": 0.0, "ship.u": 1.0})


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_folder_has_the_columns_of_its_log(tmp_path, name):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow")
        TABLE.to_parquet(tmp_path / name)
    else:
        TABLE.to_csv(tmp_path / name, index=False)
    assert columns_of(tmp_path) == columns_of(tmp_path / name) == list(TABLE)
