from .command_line import Done as Done
from .command_line import anyway_option as anyway_option
from .command_line import out_options as out_options
from .command_line import run as run
from .command_line import ship_option as ship_option
