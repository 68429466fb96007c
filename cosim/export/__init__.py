"""Export of systems to other tools: SSP archives, OSP directories, container FMUs."""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .writing import export_fmu, export_osp, export_ssp

__all__ = ["export_fmu", "export_osp", "export_ssp"]

__getattr__ = lazy_names(__name__, dict.fromkeys(__all__, "writing"))
