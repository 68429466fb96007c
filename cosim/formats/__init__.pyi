from .ssv import Parameter as Parameter
from .ssv import ParameterSet as ParameterSet
from .ssv import read_parameters as read_parameters
from .ssv import write_parameters as write_parameters
from .systems import is_system as is_system
from .systems import read_system as read_system
