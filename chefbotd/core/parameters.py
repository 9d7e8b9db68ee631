"""The base of every parameter set: declared beside its algorithm, checked when it is made."""

from pydantic import BaseModel, ConfigDict


class Parameters(BaseModel):
    """A frozen set of parameters; unknown keys, non-finite numbers and bad ranges raise ``ValidationError``.

    Field names carry their unit. Where the API's name is shorter than the configuration's (``kp`` for
    ``kp_duty_per_m_s``), the longer one is the field's alias and both are accepted.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)
