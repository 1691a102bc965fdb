from .acquisition_process import AcquisitionProcess as AcquisitionProcess
from .heartbeat import Heartbeat as Heartbeat
from .heartbeat import RestartDelay as RestartDelay
from .loop_process import LoopProcess as LoopProcess
from .loop_process import ModelChange as ModelChange
from .service_process import ServiceProcess as ServiceProcess
from .service_process import StateLog as StateLog
