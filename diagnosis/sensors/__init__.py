"""What the channels of a run say of each other, before anything is learned, without a ship's model."""

from .examination import examine
from .sensor_finding import Examined, SensorFinding
from .sensor_text import sensor_lines

__all__ = ["Examined", "SensorFinding", "examine", "sensor_lines"]
