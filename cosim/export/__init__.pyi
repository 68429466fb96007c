from .writing import export_fmu as export_fmu
from .writing import export_osp as export_osp
from .writing import export_ssp as export_ssp
