from .supervising import end_without_extra as end_without_extra
from .supervising import supervised as supervised
