"""Concurrent learning, the smallest singular value maximised, driven by eps: CL-SVD-eps, Table 4.1."""

from .concurrent import concurrent
from .models import ROTATIONAL
from .store import singular

COMPONENT = concurrent(
    name="controller_cl_svd_eps",
    description="Concurrent learning: singular values, prediction error",
    model=ROTATIONAL,
    storage=singular,
    by_eps=True,
)
