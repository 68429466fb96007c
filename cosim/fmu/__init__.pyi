from .fmu_model import Model as Model
from .fmu_model import Variable as Variable
from .instance import Instance as Instance
from .isolated import IsolatedInstance as IsolatedInstance
from .local import LocalInstance as LocalInstance
from .memory import Memory as Memory
from .memory import Port as Port
