from .residual.remainder import Remainder as Remainder
from .stability import OPERATING as OPERATING
from .stability import OperatingRegion as OperatingRegion
from .stability import dissipation as dissipation
from .stability import least_dissipation as least_dissipation
from .stability import mass as mass
from .stability import sampled_motions as sampled_motions
