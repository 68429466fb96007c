"""What the channels of a run say of each other, before anything is learned, without a ship's model."""

from .closure import Closure, closure
from .examination import examine
from .sensor_finding import Examined, SensorFinding
from .sensor_text import sensor_lines

__all__ = ["Closure", "Examined", "SensorFinding", "closure", "examine", "sensor_lines"]
