from .load import load_scenario as load_scenario
from .load import with_settings as with_settings
from .roles import Roles as Roles
from .schema import Scenario as Scenario
from .schema import json_schema as json_schema
from .shipped import find_scenario as find_scenario
