"""What the channels of a run say of each other, before anything is learned, without a ship's model."""

from .examination import examine
from .path_closure import Closure, closure
from .sensor_finding import Examined, SensorFinding
from .sensor_text import sensor_lines

__all__ = ["Closure", "Examined", "SensorFinding", "closure", "examine", "sensor_lines"]
