"""The base of everything that a scenario file holds."""

from pydantic import BaseModel, ConfigDict


class StrictModel(BaseModel):
    """Refuses unknown keys, NaN and infinity."""

    model_config = ConfigDict(defer_build=True, extra="forbid", allow_inf_nan=False)
