from .calibration import CalibratedNumber as CalibratedNumber
from .calibration import Calibration as Calibration
from .calibration import GrossPose as GrossPose
from .calibration import HeldCombination as HeldCombination
from .calibration import PoseErrors as PoseErrors
from .calibration import TriedBlock as TriedBlock
<<<<<<< HEAD
from .calibration_plan import CalibrationPlan as CalibrationPlan
from .calibration_plan import Noise as Noise
from .calibration_plan import PoseStudy as PoseStudy
=======
from .calibration_job import calibrate as calibrate
>>>>>>> hc
from .check import CalibrationCheck as CalibrationCheck
from .check import NumberChange as NumberChange
from .check import check_calibration as check_calibration
from .jacobian import measured_columns as measured_columns
from .jacobian import pose_columns as pose_columns
from .jacobian import scaled_jacobian as scaled_jacobian
from .jacobian import without as without
from .parameters import Parameters as Parameters
from .parameters import calibration_parameters as calibration_parameters
from .pose_candidates import Box as Box
from .pose_candidates import PoseCandidates as PoseCandidates
from .pose_candidates import reachable as reachable
from .pose_candidates import reachable_box as reachable_box
