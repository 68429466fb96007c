from .progress import Advance as Advance
from .progress import silent as silent
from .result_folder import together as together
