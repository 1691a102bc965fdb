from .calibration import calibrate as calibrate
from .calibration import plan_calibration as plan_calibration
from .calibration import write_built_machine as write_built_machine
from .diagnosis import compare as compare
from .diagnosis import diagnose as diagnose
from .measurements import Range as Range
from .measurements import plan_measurement as plan_measurement
from .models import add_effect as add_effect
