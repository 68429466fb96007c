"""What the channels of a run say of each other, before anything is learned, without a ship's model."""

from .examination import examine
from .sensor_finding import Examined, SensorFinding

__all__ = ["Examined", "SensorFinding", "examine"]
