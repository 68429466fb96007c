from .fmu_model import FmuModel as FmuModel
from .fmu_model import FmuVariable as FmuVariable
from .instance import Instance as Instance
from .isolated import IsolatedInstance as IsolatedInstance
from .local import LocalInstance as LocalInstance
from .memory import DoubleMemory as DoubleMemory
from .memory import Port as Port
