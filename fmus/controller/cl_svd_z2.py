"""Concurrent learning, the smallest singular value maximised, driven by z2: CL-SVD-z2, Table 4.1."""

from .concurrent import concurrent
from .models import ROTATIONAL
from .store import singular

COMPONENT = concurrent(
    name="controller_cl_svd_z2",
    description="Concurrent learning: singular values, tracking error",
    model=ROTATIONAL,
    storage=singular,
    by_eps=False,
)
