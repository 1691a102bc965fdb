from .compensation import compensate_cmm as compensate_cmm
from .compensation import compensate_machine_tool as compensate_machine_tool
from .external import external_as_applied as external_as_applied
from .pose_command import command_pose as command_pose
from .pose_command import scales_of_command as scales_of_command
from .values import Compensation as Compensation
from .values import GaugeValues as GaugeValues
from .values import WarmStart as WarmStart
