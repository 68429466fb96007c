from cybership.scratch_folder import scratch_folder as scratch_folder

from .run_state import STATE as STATE
from .spawned import end_with_parent as end_with_parent
